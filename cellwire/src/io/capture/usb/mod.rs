//! The serial adapters of a USB capture: the bytes that the PC's program sends and receives at each of their ports.

mod adapter;
mod header;

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::Result;

use self::header::{Kind, Transfer};
use super::{CaptureItem, Fault, Flow, Line, Packet, Summary};

pub use self::adapter::Adapter;
use self::adapter::LineSettings;
pub(super) use self::header::Header;

/// The numbers of transfers, bytes and requests of a device that wait until its kind is known.
const MAX_WAITING: usize = 256;
const MAX_WAITING_BYTES: usize = 1 << 16;
/// The number of devices that are kept.
const MAX_DEVICES: usize = 256;
/// An FTDI is known by the status bytes of this many packets.
const STATUS_PACKETS: usize = 4;

/// A packet with bytes of a link, or with the description of an adapter.
pub(super) struct CapturedPacket<'a> {
    pub(super) number: u64,
    pub(super) at: Option<Duration>,
    pub(super) header: Header,
    pub(super) data: &'a [u8],
    pub(super) is_big: bool,
    /// The number of bytes that the capture has cut off.
    pub(super) missing: u64,
}

/// Every device of a capture, by its bus and number.
pub(super) struct Devices {
    /// The type of a device that does not show it.
    given: Option<Adapter>,
    all: BTreeMap<(u16, u16), Device>,
}

#[derive(Default)]
struct Device {
    /// Vendor, product and release.
    described: Option<[u16; 3]>,
    /// The endpoints by address.
    endpoints: BTreeMap<u8, Endpoint>,
    is: UsbDeviceKind,
    lines: BTreeMap<u8, LineSettings>,
    /// Bytes that came with a sign of wrong settings or of a line that is read too late.
    errors: u64,
    /// The last control transfer that has not come back.
    asked: Option<(u64, [u8; 8])>,
    /// The requests before the type of the device was known.
    requests: Vec<([u8; 8], Vec<u8>)>,
    waiting: Vec<PendingTransfer>,
    waiting_bytes: usize,
    /// The number of packets without information about a link.
    ignored: u64,
}

#[derive(Default, Clone, Copy, PartialEq, Eq)]
enum UsbDeviceKind {
    #[default]
    Unknown,
    Adapter(Adapter),
    /// Any other packet.
    Other,
}

#[derive(Clone, Copy)]
struct Endpoint {
    class: u8,
    interface: u8,
    /// The longest packet.
    packet: u16,
}

/// A transfer of bytes that may be a link's.
struct PendingTransfer {
    number: u64,
    at: Option<Duration>,
    endpoint: u8,
    data: Vec<u8>,
    missing: u64,
}

type ItemSink<'a> = &'a mut dyn FnMut(CaptureItem<'_>) -> Result<()>;

impl Devices {
    pub(super) fn new(given: Option<Adapter>) -> Self {
        Self { given, all: BTreeMap::new() }
    }

    pub(super) fn add(&mut self, captured: &CapturedPacket<'_>, take: ItemSink<'_>) -> Result<()> {
        let CapturedPacket { number, at, header, data, is_big, missing } = *captured;
        let transfer = match header::transfer(header, data, is_big, missing) {
            Ok(transfer) => transfer,
            Err(why) => {
                return take(CaptureItem::Fault(number, Fault::Unreadable { why: why.into(), missing }));
            }
        };
        let place = (transfer.bus, transfer.device);
        if self.all.len() >= MAX_DEVICES && !self.all.contains_key(&place) {
            return Ok(());
        }
        let device = self.all.entry(place).or_default();
        match transfer.kind {
            Kind::Control => device.control(&transfer),
            Kind::Bulk => {
                let is_in = transfer.endpoint & 0x80 != 0;
                if is_in == transfer.is_complete && (!transfer.data.is_empty() || transfer.missing > 0) {
                    let Transfer { endpoint, data, missing, .. } = transfer;
                    let (data, length) = (data.to_vec(), data.len());
                    device.waiting.push(PendingTransfer { number, at, endpoint, data, missing });
                    device.waiting_bytes += length;
                }
            }
            Kind::Other => {}
        }
        if device.is == UsbDeviceKind::Unknown {
            device.look(self.given);
        }
        let is_full = device.waiting.len() >= MAX_WAITING || device.waiting_bytes >= MAX_WAITING_BYTES;
        if device.is != UsbDeviceKind::Unknown || is_full {
            device.tell(place, take)?;
        }
        Ok(())
    }

    /// Called at the end of the capture.
    pub(super) fn finish(&mut self, summary: &mut Summary, take: ItemSink<'_>) -> Result<()> {
        for (&(bus, number), device) in &mut self.all {
            device.tell((bus, number), take)?;
            if device.ignored > 0 {
                let what =
                    if device.is == UsbDeviceKind::Unknown { "not known" } else { "no serial adapter" };
                let name = format!("transfers of USB {bus}.{number}, which is {what}");
                *summary.others.entry(name).or_default() += device.ignored;
            }
            let UsbDeviceKind::Adapter(kind) = device.is else { continue };
            let errors = match device.errors {
                0 => String::new(),
                errors => format!("; {errors} packets with a wrong parity, a wrong stop bit or an overrun"),
            };
            let is_one = device.lines.len() == 1;
            let lines = device.lines.iter().map(|(port, line)| match is_one {
                true => format!(", {line}"),
                false => format!(", port {port} {line}"),
            });
            let lines: String = lines.collect();
            summary.adapters.push(format!("USB {bus}.{number}: {kind}{lines}{errors}"));
        }
        Ok(())
    }
}

impl Device {
    fn control(&mut self, transfer: &Transfer<'_>) {
        const GET_DESCRIPTOR: [u8; 2] = [0x80, 6];
        if let Some(setup) = transfer.setup {
            self.asked = Some((transfer.id, setup));
            let is_in = setup.first().is_some_and(|kind| kind & 0x80 != 0);
            let length = u16::from_le_bytes([setup[6], setup[7]]);
            // Older versions of USBPcap have the bytes in a packet of their own.
            if is_in || length == 0 || !transfer.data.is_empty() {
                self.request(setup, transfer.data);
            }
            return;
        }
        let Some((_, setup)) = self.asked.filter(|(id, _)| *id == transfer.id) else { return };
        if transfer.data.is_empty() {
            return;
        }
        match (setup, transfer.data) {
            ([a, b, _, 1, ..], &[18, 1, _, _, class, _, _, _, v, w, p, q, r, s, ..])
                if [a, b] == GET_DESCRIPTOR =>
            {
                let described = [[v, w], [p, q], [r, s]].map(u16::from_le_bytes);
                if self.described.is_some_and(|before| before != described) {
                    // Another device has got its number.
                    *self = Self { ignored: self.ignored, ..Self::default() };
                }
                self.described = Some(described);
                if let (UsbDeviceKind::Unknown, Some(kind)) =
                    (self.is, Adapter::of(described[0], described[1]))
                {
                    self.is = UsbDeviceKind::Adapter(kind);
                } else if class == 9 {
                    self.is = UsbDeviceKind::Other;
                }
            }
            ([a, b, _, 2, ..], configuration) if [a, b] == GET_DESCRIPTOR => self.configure(configuration),
            ([kind, ..], data) if kind & 0x80 == 0 => self.request(setup, data),
            _ => {}
        }
    }

    /// Takes the interfaces and endpoints of a configuration.
    fn configure(&mut self, mut rest: &[u8]) {
        let (mut interface, mut class, mut is_modem, mut is_open) = (0, 0, false, false);
        while let Some(&length) = rest.first().filter(|length| **length >= 2) {
            let Some((descriptor, after)) = rest.split_at_checked(length.into()) else { return };
            rest = after;
            match *descriptor {
                [_, 4, number, _, _, of, below, ..] => {
                    (interface, class) = (number, of);
                    is_modem |= (of, below) == (2, 2);
                    is_open |= of == 0xFF;
                }
                [_, 5, address, attributes, a, b, ..] if attributes & 3 == 2 => {
                    let packet = u16::from_le_bytes([a, b]) & 0x7FF;
                    self.endpoints.insert(address, Endpoint { class, interface, packet });
                }
                _ => {}
            }
        }
        if self.is == UsbDeviceKind::Unknown && !self.endpoints.is_empty() {
            match (is_modem, is_open) {
                (true, _) => self.is = UsbDeviceKind::Adapter(Adapter::CdcAcm),
                (false, false) => self.is = UsbDeviceKind::Other,
                (false, true) => {}
            }
        }
    }

    fn request(&mut self, setup: [u8; 8], data: &[u8]) {
        match self.is {
            UsbDeviceKind::Adapter(kind) => self.told(kind, setup, data),
            UsbDeviceKind::Unknown if self.requests.len() < MAX_WAITING => {
                self.requests.push((setup, data.to_vec()))
            }
            _ => {}
        }
    }

    fn told(&mut self, kind: Adapter, setup: [u8; 8], data: &[u8]) {
        let index = setup[4];
        let port = match kind {
            Adapter::Ftdi => index.max(1),
            Adapter::CdcAcm | Adapter::Cp210x => index,
            Adapter::Ch340 | Adapter::Pl2303 => 0,
        };
        let release = self.described.map(|[_, _, release]| release);
        let mut line = self.lines.get(&port).copied().unwrap_or_default();
        if line.told(kind, release, setup, data) {
            self.lines.insert(port, line);
        }
    }

    /// Finds the type of the device by its driver's requests, the shape of its data, or the user's option.
    fn look(&mut self, given: Option<Adapter>) {
        let asked = self.requests.iter().find_map(|(setup, _)| Adapter::asked(*setup));
        let is_disk =
            |waiting: &PendingTransfer| waiting.data.starts_with(b"USBC") && waiting.data.len() == 31;
        self.is = match (asked, given) {
            (Some(Adapter::CdcAcm), Some(given)) => UsbDeviceKind::Adapter(given),
            (Some(asked), _) => UsbDeviceKind::Adapter(asked),
            _ if self.has_status_bytes() => UsbDeviceKind::Adapter(Adapter::Ftdi),
            _ if self.waiting.iter().any(is_disk) => UsbDeviceKind::Other,
            (None, Some(given)) if !self.waiting.is_empty() => UsbDeviceKind::Adapter(given),
            _ => return,
        };
        if let UsbDeviceKind::Adapter(kind) = self.is {
            for (setup, data) in std::mem::take(&mut self.requests) {
                self.told(kind, setup, &data);
            }
        }
    }

    /// Returns whether every packet to the PC begins with the state of the modem's lines and of the receiver, as an FTDI
    /// sends them, and at least one has no other bytes: an FTDI sends such a packet each time that its timer expires.
    fn has_status_bytes(&self) -> bool {
        let mut packets = self.waiting.iter().filter(|it| it.endpoint & 0x80 != 0);
        let first = packets.clone().find_map(|it| it.data.first().map(|state| state & 0x0F));
        packets.clone().count() >= STATUS_PACKETS
            && packets.clone().any(|it| it.data.len() == 2)
            && packets.all(|it| match *it.data {
                [modem, line, ..] => first.is_some_and(|kind| kind <= 2 && is_status(kind, modem, line)),
                _ => false,
            })
    }

    /// Passes on the waiting packets, after the device has become known or will remain unknown.
    fn tell(&mut self, (bus, device): (u16, u16), take: ItemSink<'_>) -> Result<()> {
        self.waiting_bytes = 0;
        let waiting = std::mem::take(&mut self.waiting);
        let kind = match self.is {
            UsbDeviceKind::Adapter(kind) => kind,
            UsbDeviceKind::Other => {
                self.ignored += waiting.len() as u64;
                return Ok(());
            }
            UsbDeviceKind::Unknown => {
                let is_first = self.ignored == 0;
                self.ignored += waiting.len() as u64;
                return match waiting.first() {
                    Some(first) if is_first => {
                        let device = format!("{bus}.{device}");
                        take(CaptureItem::Fault(first.number, Fault::UnknownDevice { device }))
                    }
                    _ => Ok(()),
                };
            }
        };
        for PendingTransfer { number, at, endpoint, data, missing } in waiting {
            let Some(port) = self.port(kind, endpoint) else {
                self.ignored += 1;
                continue;
            };
            let is_in = endpoint & 0x80 != 0;
            let payload =
                if kind == Adapter::Ftdi && is_in { self.without_status(endpoint, &data) } else { data };
            let flow = Flow::Kept(Line::Usb { bus, device, port }, !is_in);
            take(CaptureItem::Packet(Packet {
                number,
                at,
                flow,
                segment: None,
                payload: &payload,
                missing,
            }))?;
        }
        Ok(())
    }

    /// Returns the port of an endpoint: by its interface, or by the maker's numbering.
    fn port(&self, kind: Adapter, endpoint: u8) -> Option<u8> {
        match (self.endpoints.get(&endpoint), kind) {
            (Some(it), Adapter::CdcAcm) if it.class != 0x0A => None,
            (Some(it), _) => Some(it.interface),
            (None, Adapter::Ftdi) => Some((endpoint & 0x0F).saturating_sub(1) / 2),
            (None, _) => Some(0),
        }
    }

    /// Returns the bytes between the status bytes, two at the beginning of each packet.
    fn without_status(&mut self, endpoint: u8, data: &[u8]) -> Vec<u8> {
        const ERRORS: u8 = 0x0E;
        let known = self.endpoints.get(&endpoint).map(|it| usize::from(it.packet)).filter(|size| *size > 2);
        let size = known.unwrap_or_else(|| packet_size(data));
        let mut bytes = Vec::with_capacity(data.len());
        for packet in data.chunks(size) {
            if let Some(([_, line], rest)) = packet.split_first_chunk() {
                self.errors += u64::from(line & ERRORS != 0);
                bytes.extend_from_slice(rest);
            }
        }
        bytes
    }
}

/// Returns whether two bytes may be the status of an FTDI of this kind, which is the lower half of the first byte, on an
/// unbroken line.
fn is_status(kind: u8, modem: u8, line: u8) -> bool {
    modem & 0x0F == kind && line & 0x9C == 0
}

/// Returns the length of an FTDI's packets by the bytes at their beginnings: 64 bytes, or 512 at high speed.
fn packet_size(data: &[u8]) -> usize {
    const FULL: usize = 64;
    const HIGH: usize = 512;
    let kind = data.first().map_or(0, |state| state & 0x0F);
    let is_full = data.chunks(FULL).all(|packet| match *packet {
        [modem, line, ..] => is_status(kind, modem, line),
        _ => false,
    });
    if is_full { FULL } else { HIGH }
}
