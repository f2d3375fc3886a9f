//! The arguments of commands that read recorded bytes.

mod format;

use std::io::BufRead;
use std::path::PathBuf;

use anyhow::Result;
use clap::ValueEnum;

use crate::io::capture::{Adapter, Form, Reading, Summary};
use cellwire_io::input;
use cellwire_io::output::{quoted, remark};

/// Where recorded bytes are, and in which form.
#[derive(Debug, clap::Args)]
pub(super) struct SourceArgs {
    /// The format of the input [default: that of its first bytes]
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// In a capture, read only this TCP or UDP port
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    /// In a USB capture, the kind of a device whose descriptor was not captured
    #[arg(long, value_enum, value_name = "KIND", hide_short_help = true)]
    adapter: Option<Adapter>,
    /// In strace output, read only this file descriptor [default: all but standard input and output and regular files]
    #[arg(long, value_name = "N", hide_short_help = true)]
    fd: Option<u32>,
    /// The input; - is standard input [default: -]
    file: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Hex digits; white space is ignored, `#` begins a comment
    Hex,
    /// The bytes themselves
    Raw,
    /// A pcap or pcapng file. Each direction of each connection, and of each port of a USB serial adapter, is decoded separately;
    /// its lines have "flow" and "from". Missing data is a line with "error": a gap, a truncated packet, incomplete
    /// fragments. At a USB adapter, --from is the computer's end
    Pcap,
    /// A hex dump as text2pcap reads it: an offset and bytes, not words; the direction by `O` and `I`, or by indentation as in
    /// Wireshark. --from is the end of `O`, or of the leftmost lines
    Hexdump,
    /// Output of strace: `strace -f -tt -xx -y -s 4096 -e trace=%desc,%network …`; --from is the end of the traced program
    Strace,
    /// Output of `socat -x` or `socat -x -v`; --from is the end at socat's first address
    Socat,
    /// A file written by --trace: lines have "from" and "at", the seconds of the trace; --from is the end that wrote it
    Trace,
}

impl SourceArgs {
    /// Opens the input, and its format.
    ///
    /// # Errors
    /// When it cannot be opened, or has the format of something else than bytes.
    pub(super) fn open(&self) -> Result<(Format, Box<dyn BufRead>)> {
        let input = input::open(self.file.as_deref())?;
        match self.format {
            Some(format) => Ok((format, input)),
            None => format::detect(input),
        }
    }

    /// Returns the name of the input as a word of a command line.
    pub(super) fn name(&self) -> String {
        let file = self.file.as_ref().filter(|file| file.as_os_str() != "-");
        file.map_or_else(|| "FILE".into(), |file| quoted(&file.to_string_lossy()))
    }

    /// Returns the way to read an input of this format, if it is a capture.
    pub(super) fn reading(&self, format: Format) -> Option<Reading> {
        let form = match format {
            Format::Pcap => Form::Pcap,
            Format::Hexdump => Form::HexDump,
            Format::Strace => Form::Strace,
            Format::Socat => Form::Socat,
            Format::Trace => Form::Trace,
            Format::Hex | Format::Raw => return None,
        };
        Some(Reading { form, port: self.port, adapter: self.adapter, descriptor: self.fd })
    }

    /// Returns ` on port 502`, if only one port is read.
    pub(super) fn on_port(&self) -> String {
        self.port.map_or_else(String::new, |port| format!(" on port {port}"))
    }
}

/// Reports packets that never contain bytes of a link on standard error, with their number: they are not a fault. Also reports
/// the settings of USB adapters.
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
