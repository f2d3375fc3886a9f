//! `cellwire simulate fanuc`: the controller over Modbus TCP, RTU over TCP, or RTU on a pseudo-terminal.

use std::net::{TcpListener, TcpStream};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use anyhow::{Result, bail};
use fanuc_hmi_modbus::{
    Bits, BitsMut, DecodeError, Exception, Registers, Server, ServerConfig, ServerEvent, Words, WordsMut,
};
use robot_session::Ended;
use serde_json::{Value, json};

use super::controller::{Controller, circle};
use super::options::FanucSettings;
use crate::io::drive::Traced;
use crate::io::line::{Clock, Line};
use crate::io::output::{log, ready};
use crate::io::tcp;
use crate::io::trace::Trace;
use crate::links::device;
use crate::links::device::{Endpoint, SimulateOptions};
use crate::links::settings;

/// Who a controller is shared between: every connection sees the same registers.
pub type Shared = Arc<Mutex<Controller>>;

/// Runs until interrupted. The settings are those of [`FanucSettings`].
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("fanuc", FanucSettings::default(), &options.settings)?;
    let controller = Arc::new(Mutex::new(Controller::new(Box::new(circle), settings.word_order)));
    match &options.endpoint {
        Endpoint::Listen(address) => {
            let config = settings.on_tcp();
            let listener = tcp::listen(address)?;
            ready("fanuc", "listen", &listener.local_addr()?.to_string())?;
            let notify = |event: Value| drop(log(&event)); // a script that reads no more is none of our business
            serve_tcp(&listener, &controller, Clock::start(), config, &options.trace.start("fanuc"), notify)
        }
        Endpoint::Pty(_) => device::serve("fanuc", "fanuc", options, settings.baud, |line, clock| {
            serve_line(line, clock, &controller, settings.on_line())
        }),
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
    config: ServerConfig,
    trace: &Trace,
    notify: impl Fn(Value) + Clone + Send + 'static,
) -> Result<()> {
    for stream in listener.incoming() {
        let (stream, controller, trace, notify) =
            (stream?, Arc::clone(controller), trace.clone(), notify.clone());
        thread::spawn(move || {
            let peer = stream.peer_addr().map_or_else(|_| "gone".into(), |peer| peer.to_string());
            notify(json!({"event": "connected", "peer": peer}));
            let why = match serve_stream(stream, &controller, clock, config, &trace, &notify) {
                Ok(None) => "the client closed the connection".into(),
                Ok(Some(error)) => format!("the client is out of step: {error}"),
                Err(error) => format!("{error:#}"),
            };
            notify(json!({"event": "disconnected", "peer": peer, "why": why}));
            if let Some(path) = trace.finish(&why) {
                notify(json!({"event": "trace", "path": path}));
            }
        });
    }
    Ok(())
}

/// One connection until it ends; what the client did wrong if that ended it.
fn serve_stream(
    stream: TcpStream,
    controller: &Shared,
    clock: Clock,
    config: ServerConfig,
    trace: &Trace,
    notify: &impl Fn(Value),
) -> Result<Option<DecodeError>> {
    stream.set_nodelay(true)?;
    let registers = Connection { controller: Arc::clone(controller), clock };
    let mut server = Server::<_, PLACES>::new(config, registers)?;
    let transport = Traced::new(stream, trace, clock);
    let ended = robot_session::drive(&mut server, transport, |_, event| match report(event, notify) {
        Some(error) => ControlFlow::Break(error),
        None => ControlFlow::Continue(()),
    })?;
    Ok(match ended {
        Ended::ByHandler(error) => Some(error),
        Ended::ByPeer => None,
    })
}

/// An RTU line until it is gone for good.
fn serve_line(line: &mut Line, clock: Clock, controller: &Shared, config: ServerConfig) -> Result<()> {
    let registers = Connection { controller: Arc::clone(controller), clock };
    let mut server = Server::<_, PLACES>::new(config, registers)?;
    robot_session::drive(&mut server, line, |_, event| {
        // A line has no connection that could be closed.
        report(event, &|event| drop(log(&event)));
        ControlFlow::<()>::Continue(())
    })?;
    Ok(())
}

/// The replies that a connection holds: a client may send so many requests at once.
const PLACES: usize = 32;

/// The controller as one connection reaches it.
struct Connection {
    controller: Shared,
    clock: Clock,
}

impl Connection {
    /// The controller, its background task up to date.
    fn controller(&self) -> MutexGuard<'_, Controller> {
        let mut controller = self.controller.lock().unwrap_or_else(PoisonError::into_inner);
        controller.tick(self.clock.now());
        controller
    }
}

impl Registers for Connection {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.controller().read_coils(address, out)
    }

    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.controller().read_discrete_inputs(address, out)
    }

    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.controller().read_holding_registers(address, out)
    }

    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.controller().read_input_registers(address, out)
    }

    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        self.controller().write_coils(address, values)
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        self.controller().write_registers(address, values)
    }
}

/// Reports what was refused, and what was corrupt; why the connection is to be closed.
fn report(event: ServerEvent, notify: &impl Fn(Value)) -> Option<DecodeError> {
    match event {
        ServerEvent::Served { unit, function, exception: Some(exception), .. } => {
            let exception = u8::from(exception);
            notify(json!({"event": "refused", "unit": unit, "function": function, "exception": exception}));
            None
        }
        ServerEvent::Refused { unit, function, .. } => {
            notify(json!({"event": "too_many", "unit": unit, "function": function}));
            None
        }
        ServerEvent::Corrupt(error) => {
            notify(json!({"event": "corrupt", "error": error}));
            None
        }
        ServerEvent::OutOfStep(error) => Some(error),
        _ => None,
    }
}
