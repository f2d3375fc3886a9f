//! `cellwire simulate`: simulates one end of a link until interrupted.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Result;
use serde_json::{Map, Value, json};

use crate::interrupt;
use crate::links::Device;
use crate::settings;
use crate::trace::TraceArgs;

/// Simulates a device until interrupted.
///
/// Prints one line of JSON when the device is ready, with the address or the path to connect to, then one line for each event.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The device
    device: Device,
    #[command(flatten)]
    endpoint: EndpointArgs,
    #[command(flatten)]
    trace: TraceArgs,
    /// A setting of the device other than its default, such as baud=19200; `simulate --help` lists them by device
    #[arg(long, value_name = "NAME=VALUE", value_parser = settings::parse)]
    set: Vec<(String, Value)>,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct EndpointArgs {
    /// Listen on this TCP address; port 0 selects any free port
    #[arg(long, value_name = "ADDR")]
    listen: Option<String>,
    /// Connect to this TCP address, for a device that is a TCP client
    #[arg(long, value_name = "ADDR")]
    connect: Option<String>,
    /// Create a pseudo-terminal and a link to it at this path
    #[arg(long, value_name = "LINKPATH")]
    pty: Option<PathBuf>,
}

/// The options of a simulator.
#[derive(Debug)]
pub struct SimulateOptions {
    /// Where clients reach it.
    pub endpoint: Endpoint,
    /// What to do with the bytes of a session that ended.
    pub trace: TraceArgs,
    /// Settings other than the device's defaults.
    pub settings: Map<String, Value>,
}

/// Where clients reach a simulated device.
#[derive(Debug)]
pub enum Endpoint {
    /// A TCP address to listen on.
    Listen(String),
    /// A TCP address to connect to.
    Connect(String),
    /// The path of a link to a pseudo-terminal.
    Pty(PathBuf),
}

/// Runs until interrupted.
pub fn run(args: &Args) -> Result<bool> {
    let endpoint = match &args.endpoint {
        EndpointArgs { listen: Some(address), .. } => Endpoint::Listen(address.clone()),
        EndpointArgs { connect: Some(address), .. } => Endpoint::Connect(address.clone()),
        EndpointArgs { pty: Some(path), .. } => Endpoint::Pty(path.clone()),
        _ => anyhow::bail!("give --listen, --connect or --pty"),
    };
    let settings = args.set.iter().cloned().collect();
    interrupt::handle()?;
    args.device.simulate(&SimulateOptions { endpoint, trace: args.trace.clone(), settings })?;
    Ok(true)
}

/// Prints the line that reports the device as ready, and its endpoint: `{"ready":"kawasaki-pc","listen":"127.0.0.1:9105"}`.
///
/// # Errors
/// When standard output is closed.
pub fn ready(device: &str, kind: &str, place: &str) -> Result<()> {
    log(&json!({"ready": device, kind: place}))
}

/// Prints one line of JSON and flushes it, so that a script can read it while the device runs.
///
/// # Errors
/// When standard output is closed.
pub fn log(line: &Value) -> Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")?;
    out.flush()?;
    Ok(())
}
