//! `cellwire modbus`: a Modbus client for the bench and for scripts.

mod poll;
mod range;
mod requests;
mod retries;
mod scan;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Result, ensure};
use clap::Subcommand;
use fanuc_hmi_modbus::ClientConfig;

use super::settings::{SetArgs, client_help};
use crate::devices::fanuc_hmi_modbus::client::{Client, Port, PortKind};
use cellwire_io::output::remark;
use cellwire_io::port::AnyPort;
use cellwire_io::serial::{self, Mode};
use cellwire_io::tcp::TimeoutArgs;
use cellwire_io::tls::TlsArgs;
use cellwire_links::fanuc_hmi_modbus::{Frames, client_settings};
use cellwire_links::settings::Setting;

/// Sends Modbus requests; scans for units and addresses; polls values
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

/// Sends Modbus requests to a server and prints its replies
///
/// Reads message objects, one a line, as `cellwire encode fanuc --from client` does (a "transaction" is not needed), sends
/// one after the other, and prints one line for each: the reply's message object, or {"failed":"…"}.
#[derive(Debug, clap::Args)]
struct SendArgs {
    /// The server: HOST:PORT, or the name of a serial port
    server: String,
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
  echo '{\"unit\":1,\"function\":3,\"address\":0,\"quantity\":37}' | cellwire modbus send 10.0.0.9:502
  cellwire modbus send 10.0.0.9:502 writes.jsonl --confirm   read writes back
  cellwire modbus scan /dev/ttyUSB0 --mode 8E1               find units; or COM5
  cellwire modbus scan 10.0.0.9:502 --ranges --unit 1        find addresses
  cellwire modbus poll 10.0.0.9:502 holding:0-36 coils:0-15  print changes

Exit status:
  0 every request was executed   1 no usable reply, an unconfirmed write, or nothing found
  2 the command could not be run   3 the connection was lost   6 a server refused a request (an exception)
  8 a request that is no read has no reply: the server may have executed it";

#[derive(Debug, Subcommand)]
enum Command {
    Send(SendArgs),
    Scan(scan::Args),
    Poll(poll::Args),
}

/// The settings of the link's bytes that the commands use.
const USES: [&str; 2] = ["framing", "unit"];

/// The default of the time that a reply may take.
const REPLY: Duration = Duration::from_secs(1);

/// A shorter wait before the first request is not reported.
const MIN_REPORTED: Duration = Duration::from_secs(1);

/// How the servers are reached.
#[derive(Debug, clap::Args)]
struct PortArgs {
    /// The unit, of requests that name none [default: the setting `unit` of a file, or 1]
    #[arg(long, value_name = "N")]
    unit: Option<u8>,
    /// The baud rate of a serial port
    #[arg(long, value_name = "N", default_value_t = 19_200, value_parser = serial::baud_rate())]
    baud: u32,
    /// Data bits, parity and stop bits of a serial port; most devices leave their factory with 8E1
    #[arg(long, value_name = "MODE", default_value = "8N1")]
    mode: Mode,
    #[command(flatten)]
    connect: TimeoutArgs,
    #[command(flatten)]
    tls: TlsArgs,
    #[command(flatten)]
    set: SetArgs,
}

/// A server has refused a request.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct RefusedRequest(pub(super) String);

/// A request that is not a read has no reply: a server may have executed it.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Unknown(pub(super) String);

/// Opens a client. A remark states that its first request must wait.
///
/// # Errors
/// The errors of [`Client::open`].
fn open(port: &Port) -> Result<Client> {
    let client = Client::open(port)?;
    let wait = client.first_wait();
    if wait >= MIN_REPORTED {
        remark(&format!(
            "the first request waits {:.1} s, for a reply to a request of an earlier client (the settings timeout and settle)",
            wait.as_secs_f64()
        ));
    }
    Ok(client)
}

/// Returns the hint after a timeout: the way to find the units that answer.
pub(super) fn silent_unit(server: &str, unit: u8) -> String {
    format!("`cellwire modbus scan {server}` shows which units answer; {unit} was asked")
}

/// Returns true when there was a usable reply to every request.
///
/// # Errors
/// When the server cannot be reached or is lost, the requests cannot be read, or the server has [refused](RefusedRequest) one.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Command::Scan(args) => scan::scan(args),
        Command::Poll(args) => poll::poll(args),
        Command::Send(args) => {
            let (port, unit) = args.port.port(&args.server, REPLY)?;
            requests::run(&port, unit, args.file.as_deref(), args.confirm)
        }
    }
}

/// Returns the settings of a client, for the help.
pub fn settings() -> Vec<Setting> {
    client_help(client_settings(), &USES)
}

impl PortArgs {
    /// Returns the port of the server, and its unit.
    fn port(&self, server: &str, timeout: Duration) -> Result<(Port, u8)> {
        self.port_with(server, timeout, |_| {})
    }

    /// Returns the port and the unit, with other defaults of the session.
    fn port_with(
        &self,
        server: &str,
        timeout: Duration,
        defaults: impl FnOnce(&mut ClientConfig),
    ) -> Result<(Port, u8)> {
        let is_path = AnyPort::is_serial(server);
        let given = self.set.read_client("modbus", &USES)?;
        let kind = if is_path {
            ensure!(!self.tls.is_given(), "--tls is for TCP, and {server} is a serial port");
            PortKind::Serial { path: server.to_owned(), baud: self.baud, mode: self.mode }
        } else {
            let tls = self.tls.client()?;
            PortKind::Tcp { server: server.to_owned(), rtu: given.view.frames == Frames::Rtu, tls }
        };
        let mut port = Port::new(kind, self.set.dialing(None, self.connect)?);
        port.config.timeout = timeout;
        defaults(&mut port.config);
        self.set.configure(&given, &mut port.config)?;
        if is_path && given.frames_given && given.view.frames == Frames::Tcp {
            remark("the setting framing=tcp has no effect on a serial port: its frames are RTU");
        }
        Ok((port, self.unit.or(given.view.unit).unwrap_or(1)))
    }
}
