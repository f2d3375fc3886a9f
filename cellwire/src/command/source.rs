//! The arguments of commands that read recorded bytes.

use std::io::BufRead;
use std::path::PathBuf;

use anyhow::Result;
use clap::ValueEnum;

use crate::io::capture::{Adapter, Form, Reading, Summary};
use crate::io::input;
use crate::io::output::remark;

/// Where recorded bytes are, and in which form.
#[derive(Debug, clap::Args)]
pub(super) struct SourceArgs {
    /// The format of the input
    #[arg(long, value_enum, default_value_t = Format::Hex)]
    pub(super) format: Format,
    /// In a capture, read only what is sent from or to this TCP or UDP port
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    /// In a capture of USB, what a device is whose descriptor is not in the capture
    #[arg(long, value_enum, value_name = "KIND")]
    adapter: Option<Adapter>,
    /// Of strace, read only this file descriptor [default: all but standard input and output and files that are no devices]
    #[arg(long, value_name = "N")]
    fd: Option<u32>,
    /// The input; - is standard input [default: -]
    file: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Hex digits; blanks and line ends anywhere, `#` begins a comment
    Hex,
    /// The bytes themselves
    Raw,
    /// A pcap or pcapng file: each direction of each connection, and of each port of a USB serial adapter, is decoded separately, and
    /// its lines have "flow" and "from". What the capture lacks is a line with "error": a gap, a packet that was cut off, fragments
    /// without the rest. At a USB adapter, --from is the end that the computer is
    Pcap,
    /// A hex dump as text2pcap reads it: an offset and bytes; the two ends by `O` and `I`, or by the place of the line, as Wireshark has
    /// them. --from is the end of `O`, or of the lines further to the left
    Hexdump,
    /// What strace has written of a program: `strace -f -tt -xx -y -s 4096 -e trace=read,write …`; --from is the end that the program is
    Strace,
    /// A file that --trace has written: lines have "from" and "at", the seconds of the trace; --from is the end that wrote it
    Trace,
}

impl SourceArgs {
    /// The input.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub(super) fn open(&self) -> Result<Box<dyn BufRead + Send>> {
        input::open(self.file.as_deref())
    }

    /// How a capture is read, if it is one.
    pub(super) fn reading(&self) -> Option<Reading> {
        let form = match self.format {
            Format::Pcap => Form::Pcap,
            Format::Hexdump => Form::HexDump,
            Format::Strace => Form::Strace,
            Format::Hex | Format::Raw | Format::Trace => return None,
        };
        Some(Reading { form, port: self.port, adapter: self.adapter, descriptor: self.fd })
    }

    /// ` on port 502`, where only one is read.
    pub(super) fn on_port(&self) -> String {
        self.port.map_or_else(String::new, |port| format!(" on port {port}"))
    }
}

/// What never holds bytes of a link is counted on standard error: it is no fault. So is what USB adapters were told.
pub(super) fn report(summary: &Summary) {
    for adapter in &summary.adapters {
        remark(adapter);
    }
    if summary.others.is_empty() {
        return;
    }
    let total: u64 = summary.others.values().sum();
    let others: Vec<String> = summary.others.iter().map(|(what, count)| format!("{count} {what}")).collect();
    let packets = summary.packets;
    remark(&format!("{total} of {packets} packets are neither TCP nor UDP: {}", others.join(", ")));
}
