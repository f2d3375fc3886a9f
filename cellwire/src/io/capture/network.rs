//! From the header of the link to the payload of IP.

use core::fmt;
use std::net::IpAddr;

use etherparse::{IpFragOffset, IpNumber, Ipv6ExtensionSlice, LaxIpSlice};

use super::usb::Header;

const IPV4: u16 = 0x0800;
const IPV6: u16 = 0x86DD;
const PPPOE_SESSION: u16 = 0x8864;
/// 802.1Q, 802.1ad, and the tag of QinQ before it was a standard.
const TAGS: [u16; 3] = [0x8100, 0x88A8, 0x9100];

/// The contents of a link's frame.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Network<'a> {
    /// The bytes of a serial line.
    Serial,
    /// An IP packet.
    Ip(&'a [u8]),
    /// A USB transfer.
    Usb(Header),
    /// Packets that never contain a link's bytes.
    Other(OtherPacket),
    /// A header that is truncated or not valid.
    Unreadable(&'static str),
    /// The capture's link type is not known.
    UnknownLink(u32),
}

/// Packets that never contain a link's bytes.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum OtherPacket {
    /// Another protocol of a network.
    EtherType(u16),
    /// Another protocol in IP.
    Protocol(u8),
    /// 802.3 with LLC, as spanning trees have it.
    Llc,
    /// A packet of an unknown link.
    LinkType(u32),
}

impl fmt::Display for OtherPacket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EtherType(0x0806) => f.write_str("ARP"),
            Self::EtherType(0x88CC) => f.write_str("LLDP"),
            Self::EtherType(0x8892) => f.write_str("PROFINET"),
            Self::EtherType(0x8863) => f.write_str("PPPoE discovery"),
            Self::EtherType(other) => write!(f, "Ethernet type {other:04x}"),
            Self::Protocol(1) => f.write_str("ICMP"),
            Self::Protocol(2) => f.write_str("IGMP"),
            Self::Protocol(58) => f.write_str("ICMPv6"),
            Self::Protocol(other) => write!(f, "IP protocol {other}"),
            Self::Llc => f.write_str("LLC"),
            Self::LinkType(other) => write!(f, "link type {other}"),
        }
    }
}

/// Returns the contents of a frame with this link type of the capture.
pub(super) fn of(link_type: u32, data: &[u8]) -> Network<'_> {
    const CUT: Network<'_> = Network::Unreadable("the header of the link was cut off");
    match link_type {
        147..=162 => Network::Serial,
        189 => Network::Usb(Header::Linux),
        220 => Network::Usb(Header::LinuxMapped),
        249 => Network::Usb(Header::UsbPcap),
        // RAW, also by its numbers on other systems, and RAW of one version.
        12 | 14 | 101 | 228 | 229 => Network::Ip(data),
        // ETHERNET
        1 => typed(data, 12, 14).unwrap_or(CUT),
        // LINUX_SLL, whose type is of another space where the interface has no Ethernet
        113 => typed(data, 14, 16).unwrap_or(CUT),
        // LINUX_SLL2
        276 => typed(data, 0, 20).unwrap_or(CUT),
        // C_HDLC
        104 => typed(data, 2, 4).unwrap_or(CUT),
        // NULL has the byte order of the machine that captured, LOOP that of the network.
        0 | 108 => match data.split_first_chunk::<4>() {
            Some((family, rest)) => match u32::from_le_bytes(*family).min(u32::from_be_bytes(*family)) {
                // IPv4; IPv6 on Linux, the BSDs and Windows
                2 | 10 | 23 | 24 | 28 | 30 => Network::Ip(rest),
                other => Network::Other(OtherPacket::LinkType(other)),
            },
            None => CUT,
        },
        // PPP, PPP in HDLC framing
        9 | 50 => ppp(data).unwrap_or(CUT),
        other => Network::UnknownLink(other),
    }
}

/// Returns the contents after a type at `at`, and after tags of virtual networks.
fn typed(data: &[u8], at: usize, header: usize) -> Option<Network<'_>> {
    let mut ether_type = word(data, at)?;
    let mut rest = data.get(header..)?;
    // The types that no Ethernet has: ARPHRD_NONE and the like have IP where they have anything.
    loop {
        match ether_type {
            IPV4 | IPV6 => return Some(Network::Ip(rest)),
            PPPOE_SESSION => return ppp(rest.get(6..)?),
            tag if TAGS.contains(&tag) => {
                ether_type = word(rest, 2)?;
                rest = rest.get(4..)?;
            }
            // A length: 802.3, perhaps with SNAP, which has a type again.
            0..=1500 => match rest.strip_prefix(&[0xAA, 0xAA, 0x03, 0, 0, 0]) {
                Some(snap) => {
                    ether_type = word(snap, 0)?;
                    rest = snap.get(2..)?;
                    if ether_type <= 1500 {
                        return Some(Network::Other(OtherPacket::Llc));
                    }
                }
                None => return Some(Network::Other(OtherPacket::Llc)),
            },
            other => return Some(Network::Other(OtherPacket::EtherType(other))),
        }
    }
}

/// Address and control may be left out, and so may the first byte of the protocol.
fn ppp(data: &[u8]) -> Option<Network<'_>> {
    // Cisco's HDLC under the same link type: a type follows.
    if let [0x0F | 0x8F, 0x00, ..] = data {
        return typed(data, 2, 4);
    }
    let data = data.strip_prefix(&[0xFF, 0x03]).unwrap_or(data);
    let (first, rest) = data.split_first()?;
    let (protocol, rest) = match first & 1 {
        1 => (u16::from(*first), rest),
        _ => (word(data, 0)?, data.get(2..)?),
    };
    Some(match protocol {
        0x0021 | 0x0057 => Network::Ip(rest),
        other => Network::Other(OtherPacket::EtherType(other)),
    })
}

fn word(data: &[u8], at: usize) -> Option<u16> {
    data.get(at..)?.first_chunk().map(|bytes| u16::from_be_bytes(*bytes))
}

/// The header of an IP packet.
#[derive(Debug)]
pub(super) struct Ip<'a> {
    pub(super) source: IpAddr,
    pub(super) destination: IpAddr,
    pub(super) protocol: IpNumber,
    pub(super) payload: &'a [u8],
    /// The number of bytes of the payload that were cut off.
    pub(super) missing: u64,
    pub(super) fragment: Option<Fragment>,
}

/// The position of a fragment in its packet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fragment {
    pub(super) identification: u32,
    pub(super) offset: IpFragOffset,
    pub(super) is_last: bool,
}

/// Parses the headers of an IP packet, which may be truncated.
pub(super) fn ip(data: &[u8]) -> Result<Ip<'_>, String> {
    let (ip, fault) = LaxIpSlice::from_slice(data).map_err(|error| error.to_string())?;
    if let Some((error, _)) = fault {
        return Err(error.to_string());
    }
    let payload = ip.payload();
    let length = payload.payload.len() as u64;
    let (whole, fragment) = match &ip {
        LaxIpSlice::Ipv4(v4) => {
            let header = v4.header();
            let before = header.slice().len() + v4.extensions().auth.map_or(0, |auth| auth.slice().len());
            let whole = u64::from(header.total_len()).saturating_sub(before as u64);
            let fragment = header.is_fragmenting_payload().then(|| Fragment {
                identification: header.identification().into(),
                offset: header.fragments_offset(),
                is_last: !header.more_fragments(),
            });
            (whole, fragment)
        }
        LaxIpSlice::Ipv6(v6) => {
            let whole =
                u64::from(v6.header().payload_length()).saturating_sub(v6.extensions().slice().len() as u64);
            let fragment = v6.extensions().clone().into_iter().find_map(|extension| match extension {
                Ipv6ExtensionSlice::Fragment(it) if it.is_fragmenting_payload() => Some(Fragment {
                    identification: it.identification(),
                    offset: it.fragment_offset(),
                    is_last: !it.more_fragments(),
                }),
                _ => None,
            });
            (whole, fragment)
        }
    };
    let missing = if payload.incomplete { whole.saturating_sub(length) } else { 0 };
    Ok(Ip {
        source: ip.source_addr(),
        destination: ip.destination_addr(),
        protocol: payload.ip_number,
        payload: payload.payload,
        missing,
        fragment,
    })
}
