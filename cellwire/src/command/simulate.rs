//! `cellwire simulate`: simulates one end of a link until interrupted.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use serde_json::Value;

use super::settings::SetArgs;
use crate::io::input::seconds;
use crate::io::tcp::ConnectArgs;
use crate::io::trace::TraceArgs;
use crate::io::{interrupt, output};
use crate::links::device::{Device, Endpoint, SimulateOptions};
use crate::links::device_parser;

/// Simulates a device until interrupted.
///
/// Prints one line of JSON when the device is ready, with the address or the path to connect to, then one line for each event.
///
/// These protocols have no authentication: whoever reaches the address can connect, and is obeyed. Listen on 127.0.0.1 unless the
/// peer is another machine. A device on a serial line serves one client at a time and refuses others; a new client of a Kawasaki PC
/// or of an MM&A device takes the place of the one before; a FANUC controller serves a thousand at once. No client makes another
/// wait, and what a client sends faster than the device reads, waits in the client's own socket.
///
/// Nor does whoever does not read the lines: up to 1 MiB of them waits, and after that a line says how many were dropped.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The device
    #[arg(value_parser = device_parser())]
    device: &'static Device,
    #[command(flatten)]
    endpoint: EndpointArgs,
    /// fanuc: the LS file that the robot runs (the setting `program`)
    #[arg(long, value_name = "FILE.LS")]
    program: Option<String>,
    /// fanuc: the listing of $SNPX_ASG that says what the holding registers show (the setting `assignments`)
    #[arg(long, value_name = "FILE")]
    assignments: Option<String>,
    #[command(flatten)]
    connect: ConnectArgs,
    /// Disconnect a client that neither sends nor takes a byte for so many seconds; 0: never
    #[arg(long, value_name = "N", default_value = "600", value_parser = seconds(0.0..=1e6))]
    idle_timeout: Duration,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    set: SetArgs,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct EndpointArgs {
    /// Listen on this address; a port alone is one of this machine's loopback address, and port 0 any free one
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
        EndpointArgs { connect: Some(address), .. } => Endpoint::Connect(address.clone()),
        EndpointArgs { pty: Some(path), .. } => Endpoint::Pty(path.clone()),
        _ => anyhow::bail!("give --listen, --connect or --pty"),
    };
    let mut settings = args.set.read()?;
    for (name, value) in [("program", &args.program), ("assignments", &args.assignments)] {
        if let Some(value) = value {
            settings.insert(name.into(), Value::from(value.as_str()));
        }
    }
    output::never_wait()?;
    interrupt::handle()?;
    let options = SimulateOptions {
        endpoint,
        connect_timeout: args.connect.timeout(),
        idle_timeout: (!args.idle_timeout.is_zero()).then_some(args.idle_timeout),
        trace: args.trace.clone(),
        settings,
    };
    (args.device.simulate)(&options).map_err(|error| args.set.located(error))?;
    Ok(true)
}
