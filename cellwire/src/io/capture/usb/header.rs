//! The headers of a USB capture: Linux's usbmon, without and with the fields of its memory map, and Windows' USBPcap.

/// The header with which a packet begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::io::capture) enum Header {
    /// LINUX_USB: 48 bytes.
    Linux,
    /// LINUX_USB_MMAPPED: 64 bytes, and one record for each packet of an isochronous transfer.
    LinuxMapped,
    /// USBPCAP: its length is in it.
    UsbPcap,
}

/// A transfer on its way to the device, or back from it.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Transfer<'a> {
    /// The same on both ways.
    pub(super) id: u64,
    pub(super) bus: u16,
    pub(super) device: u16,
    /// With bit 7 set: to the PC.
    pub(super) endpoint: u8,
    pub(super) kind: Kind,
    /// The transfer comes back from the device.
    pub(super) is_complete: bool,
    /// The setup packet of a control transfer on its way to the device.
    pub(super) setup: Option<[u8; 8]>,
    pub(super) data: &'a [u8],
    /// The number of bytes of the data that are not in the capture.
    pub(super) missing: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Control,
    Bulk,
    /// Interrupt and isochronous transfers, and remarks of USBPcap.
    Other,
}

const CUT: &str = "the header of a USB transfer was cut off";

/// Decodes a transfer; `missing` is the number of bytes that the capture has cut off the packet.
pub(super) fn transfer(
    header: Header,
    data: &[u8],
    is_big: bool,
    missing: u64,
) -> Result<Transfer<'_>, &'static str> {
    let read = match header {
        Header::Linux => linux(data, 48, is_big, missing),
        Header::LinuxMapped => linux(data, 64, is_big, missing),
        Header::UsbPcap => usb_pcap(data, missing),
    };
    read.ok_or(CUT)
}

fn linux(packet: &[u8], header: usize, is_big: bool, missing: u64) -> Option<Transfer<'_>> {
    let word = |at: usize| -> Option<u32> {
        let bytes = *packet.get(at..)?.first_chunk()?;
        Some(if is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    };
    let id = *packet.first_chunk::<8>()?;
    let bus = *packet.get(12..)?.first_chunk()?;
    let kind = match *packet.get(9)? {
        2 => Kind::Control,
        3 => Kind::Bulk,
        _ => Kind::Other,
    };
    let is_complete = *packet.get(8)? != b'S';
    // A letter in place of 0 is the reason for a missing setup packet.
    let has_setup = kind == Kind::Control && !is_complete && *packet.get(14)? == 0;
    let has_data = *packet.get(15)? == 0;
    let endpoint = *packet.get(10)?;
    let data = packet.get(header..)?;
    let length = if has_data { word(36)? as usize } else { 0 };
    let data = data.get(..length.min(data.len()))?;
    // Of bytes to the device all were meant to be sent; of bytes from it, this many came.
    let carries = (endpoint & 0x80 != 0) == is_complete;
    let lost = if carries { u64::from(word(32)?).saturating_sub(data.len() as u64) } else { 0 };
    Some(Transfer {
        id: if is_big { u64::from_be_bytes(id) } else { u64::from_le_bytes(id) },
        bus: if is_big { u16::from_be_bytes(bus) } else { u16::from_le_bytes(bus) },
        device: u16::from(*packet.get(11)?),
        endpoint,
        kind,
        is_complete,
        setup: if has_setup { packet.get(40..)?.first_chunk().copied() } else { None },
        data,
        missing: lost.max(missing),
    })
}

fn usb_pcap(packet: &[u8], missing: u64) -> Option<Transfer<'_>> {
    const SETUP: u8 = 0;
    let half = |at: usize| packet.get(at..)?.first_chunk().map(|bytes| u16::from_le_bytes(*bytes));
    let kind = match *packet.get(22)? {
        2 => Kind::Control,
        3 => Kind::Bulk,
        _ => Kind::Other,
    };
    let length = u32::from_le_bytes(*packet.get(23..)?.first_chunk()?) as usize;
    let data = packet.get(usize::from(half(0)?)..)?;
    let mut data = data.get(..length.min(data.len()))?;
    let mut setup = None;
    if kind == Kind::Control && *packet.get(27)? == SETUP {
        let (request, rest) = data.split_first_chunk()?;
        (setup, data) = (Some(*request), rest);
    }
    Some(Transfer {
        id: u64::from_le_bytes(*packet.get(2..)?.first_chunk()?),
        bus: half(17)?,
        device: half(19)?,
        endpoint: *packet.get(21)?,
        kind,
        is_complete: *packet.get(16)? & 1 != 0,
        setup,
        data,
        missing,
    })
}
