//! `cellwire modbus`: a Modbus client for the bench and for scripts.

mod poll;
mod range;
mod requests;
mod scan;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result};
use clap::{Subcommand, ValueEnum};
use fanuc_hmi_modbus::ClientConfig;
use serialport::{Parity, StopBits};

use super::settings::{SetArgs, connect_settings};
use crate::io::input::seconds;
use crate::io::serial::{self, Mode};
use crate::io::tcp::ConnectArgs;
use crate::links::fanuc_hmi_modbus::client::{Port, PortKind};
use cellwire_links::fanuc_hmi_modbus::{ClientSettings, Frames, client_settings};
use cellwire_links::settings;

/// Sends Modbus requests to a server and prints its replies; scans for units and addresses; polls values.
///
/// Reads message objects, one a line, as `cellwire encode fanuc-hmi-modbus --from client` does (a "transaction" is not needed),
/// sends one after the other, and prints one line for each: the reply's message object, or {"failed":"…"}.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// The server: HOST:PORT, or the name of a serial port
    #[arg(required = true)]
    server: Option<String>,
    /// The requests; - is standard input [default: -]
    file: Option<PathBuf>,
    /// Read back each written value, and add "confirmed" to the reply
    #[arg(long)]
    confirm: bool,
    #[command(flatten)]
    port: PortArgs,
}

const EXAMPLES: &str = "\
Examples:
  echo '{\"unit\":1,\"function\":3,\"address\":0,\"quantity\":37}' | cellwire modbus 192.168.0.10:502
  cellwire modbus --confirm 192.168.0.10:502 writes.jsonl        each write is read back
  cellwire modbus scan /dev/ttyUSB0 --parity even                which units reply; on Windows: COM5
  cellwire modbus scan 192.168.0.10:502 --ranges --unit 1        which addresses are readable
  cellwire modbus poll 192.168.0.10:502 holding:0-36 coils:0-15  changes, one line per value

Exit status:
  0 every request was executed   1 no usable reply, an unconfirmed write, or nothing found
  2 the command could not be run   3 the connection was lost   6 a server refused a request (an exception)
  8 a request that is no read has no reply: the server may have executed it";

#[derive(Debug, Subcommand)]
enum Command {
    Scan(scan::Args),
    Poll(poll::Args),
}

/// How the servers are reached.
#[derive(Debug, clap::Args)]
struct PortArgs {
    /// The unit, of requests that name none [default: the setting `unit` of a file, or 1]
    #[arg(long, value_name = "N")]
    unit: Option<u8>,
    /// The framing on a TCP port; a serial port has RTU [default: the setting `framing` of a file, or tcp]
    #[arg(long, value_enum)]
    framing: Option<FramingArg>,
    /// The baud rate of a serial port
    #[arg(long, value_name = "N", default_value_t = 19_200, value_parser = serial::baud_rate())]
    baud: u32,
    /// The parity of a serial port; the factory default of most devices is even
    #[arg(long, value_enum, default_value_t = ParityArg::None)]
    parity: ParityArg,
    /// The stop bits of a serial port; the specification requires 2 without parity
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    stop_bits: u8,
    /// How long a reply may take, in milliseconds [default: 1000; scan of units: 200]
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u64).range(1..=3_600_000))]
    timeout: Option<u64>,
    #[command(flatten)]
    connect: ConnectArgs,
    #[command(flatten)]
    set: SetArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FramingArg {
    /// Modbus TCP
    Tcp,
    /// RTU frames over TCP
    Rtu,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ParityArg {
    None,
    Even,
    Odd,
}

/// A server has refused a request.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Refused(String);

/// A request that is no read has no reply: a server may have executed it.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Unknown(String);

/// Returns true when there was a usable reply to every request.
///
/// # Errors
/// When the server cannot be reached or is lost, the requests cannot be read, or the server has [refused](Refused) one.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Some(Command::Scan(args)) => scan::scan(args),
        Some(Command::Poll(args)) => poll::poll(args),
        None => {
            let server = args.server.as_deref().context("a server is needed")?;
            let (port, unit) = args.port.port(server, 1000)?;
            requests::run(&port, unit, args.file.as_deref(), args.confirm)
        }
    }
}

/// What can be set of a client, for the help.
pub fn settings() -> Vec<settings::Setting> {
    [client_settings(), connect_settings()].concat()
}

impl PortArgs {
    /// The port of the server, and its unit.
    fn port(&self, server: &str, timeout: u64) -> Result<(Port, u8)> {
        self.port_with(server, timeout, |_| {})
    }

    /// With other defaults of the session.
    fn port_with(
        &self,
        server: &str,
        timeout: u64,
        defaults: impl FnOnce(&mut ClientConfig),
    ) -> Result<(Port, u8)> {
        let is_path = server.contains('/') || !server.contains(':');
        let (frames, given) = self.set.read_client()?;
        let kind = if is_path {
            PortKind::Serial {
                path: server.to_owned(),
                baud: self.baud,
                mode: Mode {
                    parity: match self.parity {
                        ParityArg::None => Parity::None,
                        ParityArg::Even => Parity::Even,
                        ParityArg::Odd => Parity::Odd,
                    },
                    stop_bits: if self.stop_bits == 2 { StopBits::Two } else { StopBits::One },
                    ..Mode::EIGHT_N_ONE
                },
            }
        } else {
            PortKind::Tcp {
                server: server.to_owned(),
                rtu: self.framing.map_or(frames.frames == Frames::Rtu, |framing| framing == FramingArg::Rtu),
            }
        };
        let mut port = Port::new(kind, self.set.dialing(None, self.connect)?);
        let longest = self.timeout.map(Duration::from_millis);
        port.config.timeout = longest.unwrap_or(Duration::from_millis(timeout));
        defaults(&mut port.config);
        settings::read("modbus", ClientSettings(&mut port.config), &given)
            .map_err(|error| self.set.located(error.into()))?;
        port.config.timeout = longest.unwrap_or(port.config.timeout);
        Ok((port, self.unit.or(frames.unit).unwrap_or(1)))
    }
}

/// The parser of `--seconds`.
fn run_time() -> impl Fn(&str) -> Result<Duration, String> + Clone {
    seconds(0.001..=1e9)
}
