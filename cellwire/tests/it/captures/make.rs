//! Captures of a Modbus client and its server, as files of many kinds.

use core::net::IpAddr;

/// Returns a request for one register.
pub(crate) fn request(transaction: u8) -> Vec<u8> {
    vec![0, transaction, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1]
}

/// Returns the reply to that request.
pub(crate) fn reply(transaction: u8) -> Vec<u8> {
    vec![0, transaction, 0, 0, 0, 5, 1, 3, 2, 0, transaction]
}

/// Returns the requests of these transactions, one after the other.
pub(crate) fn requests(transactions: impl IntoIterator<Item = u8>) -> Vec<u8> {
    transactions.into_iter().flat_map(request).collect()
}

pub(crate) const CLIENT: u16 = 40_000;
pub(crate) const SERVER: u16 = 502;
pub(crate) const SYN: u8 = 2;
pub(crate) const ACK: u8 = 16;

/// Returns a TCP segment, from client to server or back.
pub(crate) fn tcp(from: u16, to: u16, sequence: u32, flags: u8, payload: &[u8]) -> Vec<u8> {
    let mut segment = Vec::new();
    segment.extend(from.to_be_bytes());
    segment.extend(to.to_be_bytes());
    segment.extend(sequence.to_be_bytes());
    segment.extend(1u32.to_be_bytes());
    segment.extend([0x50, flags, 0xFF, 0xFF, 0, 0, 0, 0]);
    segment.extend(payload);
    segment
}

pub(crate) fn udp(from: u16, to: u16, payload: &[u8]) -> Vec<u8> {
    let mut datagram = Vec::new();
    datagram.extend(from.to_be_bytes());
    datagram.extend(to.to_be_bytes());
    datagram.extend((8 + payload.len() as u16).to_be_bytes());
    datagram.extend([0, 0]);
    datagram.extend(payload);
    datagram
}

pub(crate) const TCP: u8 = 6;
pub(crate) const UDP: u8 = 17;

fn ends(from: u16, is_v6: bool) -> (IpAddr, IpAddr) {
    let address = |last: u8| match is_v6 {
        true => IpAddr::from([0xFD, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, last]),
        false => IpAddr::from([10, 0, 0, last]),
    };
    if from == CLIENT { (address(2), address(1)) } else { (address(1), address(2)) }
}

fn bytes(address: IpAddr) -> Vec<u8> {
    match address {
        IpAddr::V4(it) => it.octets().to_vec(),
        IpAddr::V6(it) => it.octets().to_vec(),
    }
}

/// Returns an IPv4 packet around a segment or datagram.
pub(crate) fn v4(protocol: u8, payload: &[u8]) -> Vec<u8> {
    v4_fragment(protocol, payload, u16::from_be_bytes([payload[0], payload[1]]), 0, 0, false)
}

/// Returns the fragment of a packet from this port: `offset` in units of 8 bytes.
pub(crate) fn v4_fragment(
    protocol: u8,
    payload: &[u8],
    from: u16,
    id: u16,
    offset: u16,
    more: bool,
) -> Vec<u8> {
    let (source, destination) = ends(from, false);
    let mut packet = vec![0x45, 0];
    packet.extend((20 + payload.len() as u16).to_be_bytes());
    packet.extend(id.to_be_bytes());
    packet.extend((offset | if more { 0x2000 } else { 0 }).to_be_bytes());
    packet.extend([64, protocol, 0, 0]);
    packet.extend(bytes(source));
    packet.extend(bytes(destination));
    let sum: u32 = packet.chunks(2).map(|pair| u32::from(u16::from_be_bytes([pair[0], pair[1]]))).sum();
    let sum = (sum & 0xFFFF) + (sum >> 16);
    let sum = !(((sum & 0xFFFF) + (sum >> 16)) as u16);
    packet[10..12].copy_from_slice(&sum.to_be_bytes());
    packet.extend(payload);
    packet
}

pub(crate) fn v6(protocol: u8, payload: &[u8]) -> Vec<u8> {
    v6_headers(protocol, &[], payload, u16::from_be_bytes([payload[0], payload[1]]))
}

/// Returns the fragment of a packet from this port: `offset` in units of 8 bytes.
pub(crate) fn v6_fragment(
    protocol: u8,
    payload: &[u8],
    from: u16,
    id: u32,
    offset: u16,
    more: bool,
) -> Vec<u8> {
    let mut header = vec![protocol, 0];
    header.extend((offset << 3 | u16::from(more)).to_be_bytes());
    header.extend(id.to_be_bytes());
    v6_headers(44, &header, payload, from)
}

fn v6_headers(next: u8, headers: &[u8], payload: &[u8], from: u16) -> Vec<u8> {
    let (source, destination) = ends(from, true);
    let mut packet = vec![0x60, 0, 0, 0];
    packet.extend(((headers.len() + payload.len()) as u16).to_be_bytes());
    packet.extend([next, 64]);
    packet.extend(bytes(source));
    packet.extend(bytes(destination));
    packet.extend(headers);
    packet.extend(payload);
    packet
}

/// Returns an Ethernet frame with these tags of virtual networks, padded to the least length.
pub(crate) fn ethernet(tags: &[u16], ip: &[u8]) -> Vec<u8> {
    let mut frame = vec![2, 0, 0, 0, 0, 1, 2, 0, 0, 0, 0, 2];
    for tag in tags {
        frame.extend(tag.to_be_bytes());
        frame.extend([0, 7]);
    }
    frame.extend(if ip[0] >> 4 == 6 { [0x86, 0xDD] } else { [8, 0] });
    frame.extend(ip);
    frame.resize(frame.len().max(60), 0);
    frame
}

/// A frame, and how much of it was captured.
pub(crate) type Frame = (Vec<u8>, usize);

pub(crate) fn whole(frames: impl IntoIterator<Item = Vec<u8>>) -> Vec<Frame> {
    frames.into_iter().map(|frame| (frame.clone(), frame.len())).collect()
}

/// How a file is written.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Form {
    pub(crate) is_big: bool,
    pub(crate) is_nano: bool,
}

pub(crate) const LITTLE: Form = Form { is_big: false, is_nano: false };

impl Form {
    pub(crate) fn u32(self, value: u32) -> [u8; 4] {
        if self.is_big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    pub(crate) fn u16(self, value: u16) -> [u8; 2] {
        if self.is_big { value.to_be_bytes() } else { value.to_le_bytes() }
    }

    pub(crate) fn pcap(self, link_type: u32, frames: &[Frame]) -> Vec<u8> {
        let mut file = Vec::new();
        file.extend(self.u32(if self.is_nano { 0xA1B2_3C4D } else { 0xA1B2_C3D4 }));
        file.extend([self.u16(2), self.u16(4)].concat());
        for value in [0, 0, 262_144, link_type] {
            file.extend(self.u32(value));
        }
        for (at, (frame, captured)) in (1..).zip(frames) {
            for value in [at, 0, *captured as u32, frame.len() as u32] {
                file.extend(self.u32(value));
            }
            file.extend(&frame[..*captured]);
        }
        file
    }

    pub(crate) fn section(self) -> Vec<u8> {
        let body =
            [self.u32(0x1A2B_3C4D).to_vec(), self.u16(1).to_vec(), self.u16(0).to_vec(), vec![0xFF; 8]];
        self.block(0x0A0D_0D0A, &body.concat())
    }

    pub(crate) fn interface(self, link_type: u16, snap: u32) -> Vec<u8> {
        let body = [self.u16(link_type).to_vec(), self.u16(0).to_vec(), self.u32(snap).to_vec()];
        self.block(1, &body.concat())
    }

    pub(crate) fn enhanced(self, interface: u32, (frame, captured): &Frame) -> Vec<u8> {
        let head =
            [interface, 0, 1, *captured as u32, frame.len() as u32].map(|value| self.u32(value)).concat();
        self.block(6, &[&head, &frame[..*captured]].concat())
    }

    pub(crate) fn simple(self, (frame, captured): &Frame) -> Vec<u8> {
        self.block(3, &[&self.u32(frame.len() as u32)[..], &frame[..*captured]].concat())
    }

    /// Returns the packet block of the first drafts.
    pub(crate) fn obsolete(self, interface: u16, (frame, captured): &Frame) -> Vec<u8> {
        let head = [0, 1, *captured as u32, frame.len() as u32].map(|value| self.u32(value)).concat();
        self.block(2, &[&self.u16(interface)[..], &self.u16(0), &head, &frame[..*captured]].concat())
    }

    pub(crate) fn block(self, kind: u32, body: &[u8]) -> Vec<u8> {
        let padded = body.len().next_multiple_of(4);
        let length = self.u32(12 + padded as u32);
        let mut block = [self.u32(kind), length].concat();
        block.extend(body);
        block.resize(8 + padded, 0);
        block.extend(length);
        block
    }
}

/// Returns a connection: opened, then requests and replies of these transactions.
pub(crate) fn connection(transactions: impl IntoIterator<Item = u8>) -> Vec<Vec<u8>> {
    let mut segments = vec![tcp(CLIENT, SERVER, 999, SYN, &[]), tcp(SERVER, CLIENT, 4_999, SYN | ACK, &[])];
    let (mut client, mut server) = (1000, 5000);
    for transaction in transactions {
        segments.push(tcp(CLIENT, SERVER, client, ACK, &request(transaction)));
        segments.push(tcp(SERVER, CLIENT, server, ACK, &reply(transaction)));
        (client, server) = (client + 12, server + 11);
    }
    segments
}
