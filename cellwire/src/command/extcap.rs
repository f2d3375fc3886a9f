//! `cellwire extcap`: a tap in Wireshark's list of interfaces.

use std::path::PathBuf;
use std::thread;

use anyhow::{Context as _, Result};

use super::tap::{CaptureCloser, TapTransport, TapTransportArgs, join};
use crate::io::capture::write::{CaptureEnd, Writer};
use crate::io::tap::Watch;
use cellwire_io::interrupt::{Policy, on_interrupt};
use cellwire_io::output::{self, remark};

/// Adds the tap to Wireshark's list of interfaces.
///
/// Wireshark runs the programs in its folder of extcap programs (Help, About, Folders). Put a script there that runs this
/// command, and make it executable:
///
///   #!/bin/sh
///
///   exec cellwire extcap "$@"
///
/// Then `cellwire` is an interface; the gear beside it opens its options, those of `cellwire tap`. A serial line is shown as a
/// TCP connection of port 9100: choose Analyze, Decode As, and the link, whose dissector is in reference/wireshark.
///
/// The tap ends with the capture: it stops forwarding, and connections are reset.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// List the interfaces
    #[arg(long)]
    extcap_interfaces: bool,
    /// The version of Wireshark
    #[arg(long, value_name = "VERSION")]
    extcap_version: Option<String>,
    /// The name of the interface
    #[arg(long, value_name = "NAME")]
    extcap_interface: Option<String>,
    /// List the link types of the interface
    #[arg(long)]
    extcap_dlts: bool,
    /// List the options of the interface
    #[arg(long)]
    extcap_config: bool,
    /// A capture filter; not supported
    #[arg(long, value_name = "FILTER")]
    extcap_capture_filter: Option<String>,
    /// Capture
    #[arg(long, requires = "fifo")]
    capture: bool,
    /// The pipe from which Wireshark reads
    #[arg(long, value_name = "PIPE")]
    fifo: Option<PathBuf>,
    #[command(flatten)]
    transport: TapTransportArgs,
}

const INTERFACES: &str = concat!(
    "extcap {version=",
    env!("CARGO_PKG_VERSION"),
    "}{help=",
    env!("CARGO_PKG_REPOSITORY"),
    "}\ninterface {value=cellwire}{display=cellwire: between the two ends of a robot link}\n"
);

/// Packets begin with their IP header.
const LINK_TYPES: &str = "dlt {number=101}{name=RAW}{display=IP}\n";

const OPTIONS: &str = "\
arg {number=0}{call=--listen}{display=Listen on}{type=string}{tooltip=The address for clients, such as 0.0.0.0:9105}{group=Network}
arg {number=1}{call=--connect}{display=Connect to}{type=string}{tooltip=The server, such as 192.168.0.10:9105}{group=Network}
arg {number=2}{call=--udp}{display=Datagrams}{type=boolflag}{tooltip=UDP instead of TCP}{group=Network}
arg {number=3}{call=--a}{display=Port of one end}{type=string}{tooltip=The PC, such as /dev/ttyUSB0 or COM5}{group=Serial}
arg {number=4}{call=--b}{display=Port of the other end}{type=string}{tooltip=The device, such as /dev/ttyUSB1 or COM6}{group=Serial}
arg {number=5}{call=--baud}{display=Baud rate}{type=unsigned}{range=50,4000000}{default=9600}{group=Serial}
arg {number=6}{call=--mode}{display=Bits}{type=string}{default=8N1}{tooltip=Data bits, parity, stop bits}{group=Serial}
arg {number=7}{call=--listen-only}{display=Only listen}{type=boolflag}{tooltip=The receive lines of a Y cable}{group=Serial}
";

/// Answers what Wireshark asks, or captures until it stops.
pub fn run(args: &Args) -> Result<bool> {
    if args.extcap_interfaces {
        print!("{INTERFACES}");
    } else if args.extcap_dlts {
        print!("{LINK_TYPES}");
    } else if args.extcap_config {
        print!("{OPTIONS}");
    } else {
        let pipe = args.fifo.as_deref().context("this command is run by Wireshark: see --help")?;
        capture(&args.transport, pipe)?;
    }
    Ok(true)
}

fn capture(args: &TapTransportArgs, pipe: &std::path::Path) -> Result<()> {
    let transport = TapTransport::open(args)?;
    on_interrupt(Policy::End)?;
    let mut watch = Watch::default();
    let seen = watch.add();
    let written = CaptureCloser::default().of(&watch);
    let writer = Writer::into_pipe(pipe, "cellwire")?;
    thread::scope(|scope| {
        let passing = scope.spawn(move || transport.pass(args, &watch));
        let ended = writer.record(&seen);
        let _ = written.send(ended);
        if ended == CaptureEnd::Unread {
            // The threads that pass bytes on wait for them.
            remark("the capture has ended, and the tap with it");
            output::finish();
            std::process::exit(0);
        }
        join(passing)
    })
}
