//! `cellwire modbus`: requests as JSON lines to any Modbus server, replies as JSON lines back.

use std::collections::VecDeque;
use std::io::{self, BufRead, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use clap::ValueEnum;
use fanuc_hmi_modbus::client::{Client, Config, Event};
use fanuc_hmi_modbus::{Frame, PduBuf};
use serde_json::{Value, json};

use super::json;
use crate::line::Clock;
use crate::simulate::log;
use crate::{serial, tcp};

/// Sends Modbus requests to a server and prints its replies.
///
/// Reads message objects, one a line, as `cellwire encode fanuc-hmi-modbus --from client` does (a "transaction" is not needed),
/// sends one after the other, and prints one line for each: the reply's message object, or {"failed":"…"}. The exit status is 1
/// if there was any failure; an exception is an answer and none.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The server: HOST:PORT, or the path of a serial port
    server: String,
    /// How frames are written to a TCP port; a serial port has RTU
    #[arg(long, value_enum, default_value_t = FramingArg::Tcp)]
    framing: FramingArg,
    /// The baud rate of a serial port
    #[arg(long, value_name = "N", default_value_t = 19_200, value_parser = serial::baud_rate())]
    baud: u32,
    /// How long a reply may take, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 1000)]
    timeout: u64,
    /// The requests [default: standard input]
    file: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FramingArg {
    /// Modbus TCP
    Tcp,
    /// RTU frames through the connection
    Rtu,
}

/// Returns true when every request was answered.
pub fn run(args: &Args) -> Result<bool> {
    let input: Box<dyn BufRead> = match &args.file {
        Some(path) => {
            let file =
                std::fs::File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
            Box::new(io::BufReader::new(file))
        }
        None => Box::new(io::stdin().lock()),
    };
    let mut line = Connection::open(args)?;
    let mut all = true;
    for (number, text) in (1..).zip(input.lines()) {
        let text = text.context("cannot read the requests")?;
        if text.trim().is_empty() {
            continue;
        }
        let frame: Frame<PduBuf> =
            serde_json::from_str(&text).with_context(|| format!("line {number} is no message object"))?;
        let answer = line.ask(&frame).with_context(|| format!("line {number}"))?;
        all &= answer.get("failed").is_none();
        log(&answer)?;
    }
    Ok(all)
}

/// A transport and the session on it.
struct Connection {
    transport: Box<dyn Transport>,
    client: Client<1>,
    clock: Clock,
    out: VecDeque<Value>,
}

impl Connection {
    fn open(args: &Args) -> Result<Self> {
        let is_path = args.server.contains('/') || !args.server.contains(':');
        let (transport, mut config): (Box<dyn Transport>, _) = if is_path {
            (Box::new(serial::open(&args.server, args.baud)?), Config::rtu(args.baud))
        } else {
            let config = match args.framing {
                FramingArg::Tcp => Config::tcp(),
                FramingArg::Rtu => Config::rtu_over_tcp(),
            };
            (Box::new(tcp::connect(&args.server)?), config)
        };
        config.timeout = Duration::from_millis(args.timeout);
        Ok(Self { transport, client: Client::new(config), clock: Clock::start(), out: VecDeque::new() })
    }

    /// The answer to one request, as the object to print.
    fn ask(&mut self, frame: &Frame<PduBuf>) -> Result<Value> {
        self.client.request(frame.unit, &frame.pdu.request()?)?;
        let mut buffer = [0; 4096];
        loop {
            if let Some(answer) = self.out.pop_front() {
                return Ok(answer);
            }
            while let Some(len) = self.client.poll_transmit(self.clock.now(), &mut buffer) {
                self.transport.write_all(buffer.get(..len).unwrap_or_default())?;
            }
            let due = self.client.poll_timeout().unwrap_or(self.clock.now());
            let wait = due.saturating_sub(self.clock.now()).max(Duration::from_millis(1));
            let bytes = match self.transport.read_for(wait, &mut buffer) {
                Ok(0) => bail!("the server closed the connection"),
                Ok(n) => buffer.get(..n).unwrap_or_default(),
                Err(e) if tcp::is_silence(&e) => &[],
                Err(e) => return Err(e).context("the connection broke"),
            };
            let mut rest = bytes;
            while !rest.is_empty() {
                let taken = self.client.handle_input(self.clock.now(), rest);
                rest = rest.get(taken..).unwrap_or_default();
                drain(&mut self.client, &mut self.out);
            }
            self.client.handle_timeout(self.clock.now());
            drain(&mut self.client, &mut self.out);
        }
    }
}

/// Turns what the session tells into answers; what is none goes to standard error.
fn drain(client: &mut Client<1>, out: &mut VecDeque<Value>) {
    while let Some(event) = client.poll_event() {
        match event {
            Event::Reply { unit, reply, .. } => {
                out.push_back(json(Frame { transaction: None, unit, pdu: reply }))
            }
            Event::Announced { .. } => out.push_back(json!({"broadcast": true})),
            Event::Failed { failure, .. } => out.push_back(json!({"failed": failure.to_string()})),
            event => eprintln!("{event:?}"),
        }
    }
}

/// A socket or a serial port.
trait Transport: Read + Write {
    /// Reads what is there, or waits so long for something.
    fn read_for(&mut self, wait: Duration, buffer: &mut [u8]) -> io::Result<usize>;
}

impl Transport for TcpStream {
    fn read_for(&mut self, wait: Duration, buffer: &mut [u8]) -> io::Result<usize> {
        self.set_read_timeout(Some(wait))?;
        self.read(buffer)
    }
}

impl Transport for Box<dyn serialport::SerialPort> {
    fn read_for(&mut self, wait: Duration, buffer: &mut [u8]) -> io::Result<usize> {
        self.set_timeout(wait)?;
        self.read(buffer)
    }
}
