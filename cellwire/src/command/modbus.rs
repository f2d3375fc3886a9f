//! `cellwire modbus`: requests as JSON lines to any Modbus server, replies as JSON lines back.

use std::io::{self, BufRead as _};
use std::net::TcpStream;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result};
use clap::ValueEnum;
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, Frame, PduBuf};
use robot_session::{Driver, Ended, Received, Sent, Session as _, Transport};
use serde_json::{Value, json};

use crate::io::drive::Lost;
use crate::io::output::log;
use crate::io::output::remark;
use crate::io::tcp::ConnectArgs;
use crate::io::{input, serial, tcp};
use crate::links::fanuc_hmi_modbus::options::json;

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
    #[command(flatten)]
    connect: ConnectArgs,
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
    let input = input::open(args.file.as_deref())?;
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
    driver: Driver<AnyTransport>,
    client: Client<1>,
}

impl Connection {
    fn open(args: &Args) -> Result<Self> {
        let is_path = args.server.contains('/') || !args.server.contains(':');
        let (transport, mut config) = if is_path {
            let port = serial::open(&args.server, args.baud)?;
            (AnyTransport::Serial(serial::Port(port)), ClientConfig::rtu(args.baud))
        } else {
            let config = match args.framing {
                FramingArg::Tcp => ClientConfig::tcp(),
                FramingArg::Rtu => ClientConfig::rtu_over_tcp(),
            };
            (AnyTransport::Tcp(tcp::connect(&args.server, args.connect.timeout())?), config)
        };
        config.timeout = Duration::from_millis(args.timeout);
        let mut client = Client::new(config)?;
        client.handle_connected(robot_session::now());
        Ok(Self { driver: Driver::new(transport), client })
    }

    /// The answer to one request, as the object to print.
    fn ask(&mut self, frame: &Frame<PduBuf>) -> Result<Value> {
        self.client.request(frame.unit, &frame.pdu.request()?)?;
        loop {
            let turn = self.driver.turn(&mut self.client, None, answer);
            match turn.map_err(|error| Lost(format!("the connection broke: {error}")))? {
                ControlFlow::Continue(()) => {}
                ControlFlow::Break(Ended::ByHandler(answer)) => return Ok(answer),
                ControlFlow::Break(Ended::ByPeer) => {
                    return Err(Lost("the server closed the connection".into()).into());
                }
            }
        }
    }
}

/// The answer in an event; what is none goes to standard error.
fn answer(client: &mut Client<1>, event: ClientEvent) -> ControlFlow<Value> {
    match event {
        ClientEvent::Replied { ticket, unit } => match client.reply(ticket) {
            Some(reply) => ControlFlow::Break(json(Frame { transaction: None, unit, pdu: reply })),
            None => ControlFlow::Continue(()),
        },
        ClientEvent::Announced { .. } => ControlFlow::Break(json!({"broadcast": true})),
        ClientEvent::Failed { failure, .. } => ControlFlow::Break(json!({"failed": failure.to_string()})),
        event => {
            remark(&format!("{event:?}"));
            ControlFlow::Continue(())
        }
    }
}

/// A socket or a serial port.
enum AnyTransport {
    Tcp(TcpStream),
    Serial(serial::Port),
}

impl Transport for AnyTransport {
    fn receive(&mut self, buffer: &mut [u8], wait: Option<Duration>) -> io::Result<Received> {
        match self {
            Self::Tcp(stream) => stream.receive(buffer, wait),
            Self::Serial(port) => port.receive(buffer, wait),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        match self {
            Self::Tcp(stream) => stream.send(bytes),
            Self::Serial(port) => port.send(bytes),
        }
    }
}
