//! The faults that prevent bytes of a capture from being read.

use std::net::IpAddr;

use serde::Serialize;

/// The reason why bytes of a capture could not be read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Fault {
    /// The packets of an interface have a link type that is not known: once for each interface.
    LinkType {
        /// The number of the link type in the registry of tcpdump.org.
        number: u32,
        /// The index of the interface, from 0.
        interface: usize,
    },
    /// A packet of an interface that the capture does not describe.
    NoInterface {
        /// The index of the interface, from 0.
        interface: usize,
    },
    /// A header that is not valid, or that the capture has cut off.
    Unreadable {
        /// The error of the header.
        why: String,
        /// The number of bytes of the packet that the capture has cut off.
        missing: u64,
    },
    /// A USB device carries bytes, and nothing shows whether it is a serial adapter, and which: once for each device.
    UnknownDevice {
        /// The bus and the number of the device, as `1.5`.
        device: String,
    },
    /// Fragments of an IP packet whose rest is not in the capture, or came too late.
    Fragments {
        /// The address of the sender.
        source: IpAddr,
        /// The address of the receiver.
        destination: IpAddr,
        /// The identification of the packet.
        identification: u32,
        /// The number of bytes of the payload that were captured.
        captured: usize,
        /// The reason for which they are not a packet.
        why: &'static str,
    },
    /// A line of a hex dump that does not continue at the previous one's end, or a line of strace that cannot be read.
    Line {
        /// The error of the line.
        why: String,
    },
    /// The capture ends in the middle of a block.
    Truncated {
        /// The number of bytes of the incomplete block.
        length: usize,
    },
    /// A block that is not valid: nothing after it can be read.
    Corrupt {
        /// The offset in the capture at which the block begins.
        at: u64,
        /// The error of the block.
        why: String,
    },
}
