//! `cellwire simulate`: simulates one end of a link until interrupted.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Result, ensure};

use super::settings::SetArgs;
use crate::devices::control::Control;
use crate::devices::device::{Device, Endpoint, SimulateOptions};
use crate::devices::device_parser;
use cellwire_io::input::time;
use cellwire_io::interrupt::{Policy, on_interrupt};
use cellwire_io::output::{self, EventArgs};
use cellwire_io::tcp::{self, ConnectArgs};
use cellwire_io::tls::TlsArgs;
use cellwire_io::trace::TraceArgs;

/// Simulates a device until interrupted.
///
/// Prints one line of JSON when the device is ready, with the address or path to connect to and the address of --control,
/// then one line for each event.
///
/// These protocols have no authentication: any program that reaches the address can connect and send commands. Listen on
/// 127.0.0.1 unless the peer is another machine. A device on a serial line serves one client and refuses others; a new
/// client of a Kawasaki end or of an MM&A device replaces the previous one; a FANUC controller serves a thousand at once.
/// Clients do not block each other: data that a client sends faster than the device reads waits in that client's socket.
///
/// Of events that a client can cause at any rate, such as reads, writes and corrupt bytes, ten of a kind are printed in a
/// second; a line `left_out` has the number of the others. --control lists everything that was executed.
///
/// Slow readers of the output do not block the device: up to 1 MiB of lines is buffered; then lines are dropped and counted.
#[derive(Debug, clap::Args)]
#[command(override_usage = USAGE)]
pub struct Args {
    /// The device
    #[arg(value_parser = device_parser())]
    device: &'static Device,
    #[command(flatten)]
    endpoint: EndpointArgs,
    /// Accept commands to the simulator on this TCP address: faults, inputs, the list of what was executed. One JSON object
    /// a line, such as {"do":"help"}; see docs/simulate.md. A port alone means 127.0.0.1, port 0 any free port
    #[arg(long, value_name = "ADDR")]
    control: Option<String>,
    #[command(flatten)]
    connect: ConnectArgs,
    #[command(flatten)]
    tls: TlsArgs,
    /// Disconnect a client after this time without a byte in either direction, or `never`
    #[arg(long, value_name = "TIME", default_value = "600s", value_parser = time(Duration::from_millis(1)..=Duration::MAX))]
    idle_timeout: Duration,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    set: SetArgs,
    #[command(flatten)]
    events: EventArgs,
    /// Print the line that reports the device as ready, and no events
    #[arg(long)]
    quiet: bool,
}

/// The devices whose link is TCP. Those on a serial line are reached through a device server of another protocol.
const TLS: [&str; 5] = ["fanuc", "kawasaki-pc", "kawasaki-robot", "mma-robot", "mma-platform"];

const USAGE: &str = "\
cellwire simulate [OPTIONS] <DEVICE> --listen <ADDR>
       cellwire simulate [OPTIONS] <DEVICE> --connect <ADDR>
       cellwire simulate [OPTIONS] <DEVICE> --pty <LINKPATH>";

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct EndpointArgs {
    /// Listen on this address; a port alone means 127.0.0.1, port 0 any free port
    #[arg(long, value_name = "ADDR")]
    listen: Option<String>,
    /// Connect to this address, for a device that is a client
    #[arg(long, value_name = "ADDR")]
    connect: Option<String>,
    /// Create a pseudo-terminal and a link to it at this path
    #[arg(long, value_name = "LINKPATH")]
    pty: Option<PathBuf>,
}

/// Runs until interrupted.
pub fn run(args: &Args) -> Result<bool> {
    let endpoint = match &args.endpoint {
        EndpointArgs { listen: Some(address), .. } => Endpoint::Listen(address.clone()),
        EndpointArgs { connect: Some(address), .. } => {
            tcp::check(address)?;
            Endpoint::Connect(address.clone())
        }
        EndpointArgs { pty: Some(path), .. } => Endpoint::Pty(path.clone()),
        _ => anyhow::bail!("give --listen, --connect or --pty"),
    };
    let settings = args.set.read(&(args.device.settings)())?;
    ensure!(
        !args.tls.is_given() || TLS.contains(&args.device.name) && !matches!(endpoint, Endpoint::Pty(_)),
        "--tls is for a device on TCP, with --listen or --connect: {}",
        TLS.join(", ")
    );
    args.events.choose();
    if args.quiet {
        output::be_quiet();
    }
    output::never_wait()?;
    on_interrupt(Policy::End)?;
    let options = SimulateOptions {
        endpoint,
        dialing: args.connect.dialing(),
        tls: args.tls.clone(),
        idle_timeout: (args.idle_timeout < Duration::MAX).then_some(args.idle_timeout),
        trace: args.trace.clone(),
        settings,
        control: args.control.as_deref().map(Control::bind).transpose()?,
    };
    (args.device.simulate)(&options)?;
    Ok(true)
}
