//! `cellwire simulate fanuc`: the controller over Modbus TCP, RTU over TCP, or RTU on a pseudo-terminal.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use anyhow::{Result, bail};
use fanuc_hmi_modbus::server::{Config, Event};
use fanuc_hmi_modbus::{DecodeError, Server};
use serde_json::{Value, json};

use super::controller::{Controller, circle};
use super::{is_rtu, word_order};
use crate::device;
use crate::line::{Clock, Line};
use crate::serial::READ_TIMEOUT;
use crate::settings::Settings;
use crate::simulate::{Endpoint, SimulateOptions, log, ready};
use crate::tcp;
use crate::trace::{Trace, Way};

/// Who a controller is shared between: every connection sees the same registers.
pub type Shared = Arc<Mutex<Controller>>;

/// Runs until interrupted. Settings: `framing`, `unit`, `baud`, `word_order`.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let settings = Settings::new("fanuc", &options.settings, &["framing", "unit", "baud", "word_order"])?;
    let unit = settings.number("unit", 1u8)?;
    let controller = Arc::new(Mutex::new(Controller::new(Box::new(circle), word_order(&settings)?)));
    match &options.endpoint {
        Endpoint::Listen(address) => {
            let config = if is_rtu(&settings)? { Config::rtu_over_tcp(unit) } else { Config::tcp() };
            let listener = tcp::listen(address)?;
            ready("fanuc", "listen", &listener.local_addr()?.to_string())?;
            let tell = |event: Value| drop(log(&event)); // a script that reads no more is none of our business
            serve_tcp(&listener, &controller, Clock::start(), config, &options.trace.start("fanuc"), tell)
        }
        Endpoint::Pty(_) => {
            let baud = settings.baud(19_200)?;
            device::serve("fanuc", "fanuc", options, baud, |line, clock| {
                serve_line(line, clock, &controller, Config::rtu(unit, baud))
            })
        }
        Endpoint::Connect(_) => bail!("a FANUC controller is a server: use --listen, or --pty for RTU"),
    }
}

/// Serves any number of clients at once until the listener fails.
///
/// # Errors
/// When it does.
pub fn serve_tcp(
    listener: &TcpListener,
    controller: &Shared,
    clock: Clock,
    config: Config,
    trace: &Trace,
    tell: impl Fn(Value) + Clone + Send + 'static,
) -> Result<()> {
    for stream in listener.incoming() {
        let (stream, controller, trace, tell) =
            (stream?, Arc::clone(controller), trace.clone(), tell.clone());
        thread::spawn(move || {
            let peer = stream.peer_addr().map_or_else(|_| "gone".into(), |peer| peer.to_string());
            tell(json!({"event": "connected", "peer": peer}));
            let why = match serve_stream(stream, &controller, clock, config, &trace, &tell) {
                Ok(None) => "the client closed the connection".into(),
                Ok(Some(error)) => format!("the client is out of step: {error}"),
                Err(error) => format!("{error:#}"),
            };
            tell(json!({"event": "disconnected", "peer": peer, "why": why}));
            if let Ok(Some(path)) = trace.session_ended(&why) {
                tell(json!({"event": "trace", "path": path}));
            }
        });
    }
    Ok(())
}

/// One connection until it ends; what the client did wrong if that ended it.
fn serve_stream(
    mut stream: TcpStream,
    controller: &Shared,
    clock: Clock,
    config: Config,
    trace: &Trace,
    tell: &impl Fn(Value),
) -> Result<Option<DecodeError>> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(READ_TIMEOUT))?;
    let mut server = Server::new(config);
    let (mut input, mut out) = ([0; 4096], [0; Server::MAX_TRANSMIT]);
    loop {
        let mut bytes = match stream.read(&mut input) {
            Ok(0) => return Ok(None),
            Ok(n) => input.get(..n).unwrap_or_default(),
            Err(e) if tcp::is_silence(&e) => &[],
            Err(e) => return Err(e.into()),
        };
        trace.add(clock.now(), Way::Received, bytes);
        loop {
            let now = clock.now();
            let taken = server.handle_input(now, bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            while let Some(len) = transmit(&mut server, controller, clock, &mut out) {
                let reply = out.get(..len).unwrap_or_default();
                trace.add(clock.now(), Way::Sent, reply);
                stream.write_all(reply)?;
            }
            if let Some(error) = tell_events(&mut server, tell)
                && config.framing == fanuc_hmi_modbus::Framing::Tcp
            {
                return Ok(Some(error));
            }
            if bytes.is_empty() {
                break;
            }
        }
    }
}

/// An RTU line until it is gone for good.
fn serve_line(line: &mut Line, clock: Clock, controller: &Shared, config: Config) -> Result<()> {
    let mut server = Server::new(config);
    let mut out = [0; Server::MAX_TRANSMIT];
    loop {
        let due = server.poll_timeout().unwrap_or(clock.now() + READ_TIMEOUT);
        if !line.wait(due) {
            return Ok(());
        }
        while let Some((at, byte)) = line.receive() {
            if server.handle_input(at, &[byte]) == 0 {
                server.reset(); // cannot be: its buffer is drained at every silence
            }
        }
        server.handle_timeout(clock.now());
        while let Some(len) = transmit(&mut server, controller, clock, &mut out) {
            line.send(out.get(..len).unwrap_or_default());
        }
        tell_events(&mut server, &|event| drop(log(&event)));
    }
}

fn transmit(server: &mut Server, controller: &Shared, clock: Clock, out: &mut [u8]) -> Option<usize> {
    let mut controller = controller.lock().unwrap_or_else(PoisonError::into_inner);
    let now = clock.now();
    controller.tick(now);
    server.poll_transmit(now, &mut *controller, out)
}

/// Tells what was refused, and what was damaged; the last damage.
fn tell_events(server: &mut Server, tell: &impl Fn(Value)) -> Option<DecodeError> {
    let mut damage = None;
    while let Some(event) = server.poll_event() {
        match event {
            Event::Served { unit, function, exception: Some(exception), .. } => {
                let exception = u8::from(exception);
                tell(json!({"event": "refused", "unit": unit, "function": function, "exception": exception}));
            }
            Event::Damaged(error) => {
                tell(json!({"event": "damaged", "error": error}));
                damage = Some(error);
            }
            _ => {}
        }
    }
    damage
}
