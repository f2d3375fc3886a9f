//! `cellwire simulate fanuc`: the controller over Modbus TCP, RTU over TCP, or RTU on a pseudo-terminal.

use std::cell::RefCell;
use std::net::SocketAddr;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use cellwire_sim::fanuc::{Controller, FanucController, FanucEvent, Shared, TelemetryFaults, circle};
use cellwire_sim::{Simulator, Told};
use fanuc_hmi_modbus::{ServerConfig, ServerEvent, WordOrder};
use robot_session::{Driver, Session as _};
use serde_json::{Map, Value, json};

use super::control;
use super::inputs::Inputs;
use super::mapping::Mapping;
use super::options::{FanucSettings, ProgramSettings};
use super::program::{Finding, Machine, Programs, load};
use super::robot::{Reporting, Reports, Robot};
use crate::io::drive::turn;
use crate::io::line::{Clock, Line};
use crate::io::listener::Listener;
use crate::io::output::{admits, log, remark};
use crate::io::serve::{Notice, Service};
use crate::io::tcp;
use crate::links::device;
use crate::links::device::{Attached, Endpoint, LOOK, SimulateOptions};
use cellwire_links::settings;
use cellwire_motion::{Arm, Limits, Planner, Pose};

/// Runs until interrupted. The settings are those of [`FanucSettings`].
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let mut settings = settings::read("fanuc", FanucSettings::default(), &options.settings)?;
    settings.program.check()?;
    let is_line = matches!(options.endpoint, Endpoint::Pty(_));
    for name in settings.unused(is_line).into_iter().filter(|name| options.settings.contains_key(*name)) {
        remark(&format!("the setting {name} has no effect here"));
    }
    settings.program.leaves_registers = !options.settings.contains_key("telemetry");
    let faults: TelemetryFaults = settings.faults.as_deref().unwrap_or_default().parse()?;
    let reports = Reports::default();
    let controller = match &settings.program.program {
        None => Controller::new(Box::new(circle), settings.word_order),
        Some(program) => {
            let robot = robot(Path::new(program), &settings.program, settings.word_order)?;
            let robot = Reporting { robot, reports: Arc::clone(&reports) };
            Controller::running(Box::new(robot), settings.word_order)
        }
    };
    let controller = Arc::new(Mutex::new(controller.with_faults(faults)));
    let runs = settings.program.program.is_some();
    match &options.endpoint {
        Endpoint::Listen(address) => {
            let config = settings.on_tcp();
            let listener = tcp::listen(address)?;
            options.ready("fanuc", "listen", &listener.local_addr()?.to_string())?;
            let (trace, clock) = (options.trace.start("fanuc"), Clock::start());
            let mut first = connection(&controller, config)?;
            options.control("fanuc", &mut first, control::own())?;
            let look = options.control.as_ref().map(|_| LOOK);
            if runs {
                keep_running(&controller, &reports, clock)?;
            }
            let service = Service { clock, trace: &trace, idle_timeout: options.idle_timeout, look };
            serve_clients(Listener::new(listener)?, first, &service, true)
        }
        Endpoint::Pty(_) => device::serve("fanuc", "fanuc", options, settings.baud, |line, clock| {
            if runs {
                keep_running(&controller, &reports, clock)?;
            }
            let mut robot = connection(&controller, settings.on_line())?;
            options.control("fanuc", &mut robot, control::own())?;
            serve_line(line, &mut robot)
        }),
        Endpoint::Connect(_) => bail!("a FANUC controller is a server: use --listen, or --pty for RTU"),
    }
}

/// The event of a background task that would write registers that the programs use; `None` if it writes others.
fn overwritten(programs: &Programs, first: u32) -> Option<Value> {
    let last = first + BACKGROUND_REGISTERS - 1;
    let mut used = programs.values().flat_map(|program| program.registers());
    let number = used.find(|number| (first..=last).contains(number))?;
    let what = format!(
        "the background task does not run: it would write R[{first}] to R[{last}], and the program uses R[{number}]; set telemetry=N to write R[N] and those after it"
    );
    Some(json!({"event": "not_modelled", "what": what, "count": 1}))
}

/// How many registers the background task writes.
const BACKGROUND_REGISTERS: u32 = 19;

/// The robot that runs a program; what is not modelled of it is the first of its events.
///
/// # Errors
/// When a file cannot be read, or is not what it should be.
pub fn robot(program: &Path, settings: &ProgramSettings, order: WordOrder) -> Result<Robot> {
    let (main, programs, findings) = load(program, &settings.macros)?;
    let overwritten = match settings.leaves_registers {
        true => overwritten(&programs, settings.telemetry.into()),
        false => None,
    };
    let read = |path: &str| std::fs::read_to_string(path).with_context(|| format!("cannot read {path}"));
    let limits = match &settings.robot {
        Some(path) => Limits::from_json(&read(path)?).with_context(|| path.clone())?,
        None => Limits::LR_MATE_200ID,
    };
    let arm = limits.arm.map_or(Arm::LR_MATE_200ID, |arm| arm.arm(Pose::IDENTITY));
    let mapping = match &settings.assignments {
        Some(path) => Mapping::parse(&read(path)?, order).with_context(|| path.clone())?,
        None => Mapping::telemetry(settings.telemetry.max(1), order)?,
    };
    let inputs = Inputs::parse(settings.inputs.as_deref().unwrap_or_default())?;
    let mut planner = Planner::new(arm, limits, settings.joints);
    if settings.anywhere {
        planner = planner.anywhere();
    }
    let mut machine = Machine::new(main, programs, planner, settings.repeat);
    machine.robot = match &settings.robot {
        Some(path) => format!("the robot of {path}"),
        None => "an LR Mate 200iD, since no other is described".into(),
    };
    let telemetry = if overwritten.is_some() { 0 } else { settings.telemetry.into() };
    findings.iter().map(Finding::event).chain(overwritten).for_each(|event| machine.report(event));
    Ok(Robot::new(machine, mapping, inputs, telemetry))
}

/// Lets the program run also while no client asks, and prints what it reports.
///
/// # Errors
/// When the system has no room for a thread.
fn keep_running(controller: &Shared, reports: &Reports, clock: Clock) -> Result<()> {
    let (controller, reports) = (Arc::clone(controller), Arc::clone(reports));
    let thread = thread::Builder::new().name("program".into()).spawn(move || {
        loop {
            thread::sleep(Duration::from_millis(16));
            controller.lock().unwrap_or_else(PoisonError::into_inner).tick(clock.now());
            let reports = core::mem::take(&mut *reports.lock().unwrap_or_else(PoisonError::into_inner));
            for event in reports {
                let _ = log(&event); // a script that reads no more is none of our business
            }
        }
    });
    thread.context("cannot start a thread that runs the program").map(drop)
}

/// Serves any number of clients at once until the listener fails, and prints nothing.
///
/// # Errors
/// When it does.
pub fn serve_tcp(
    listener: Listener,
    controller: &Shared,
    config: ServerConfig,
    service: &Service<'_>,
) -> Result<()> {
    serve_clients(listener, connection(controller, config)?, service, false)
}

/// As [`serve_tcp`]: each client has another connection of the same device. `first` is not connected. `prints`: what the clients do is printed.
fn serve_clients(
    listener: Listener,
    first: Simulator<FanucController>,
    service: &Service<'_>,
    prints: bool,
) -> Result<()> {
    // A script that reads no more is none of our business.
    let print = |event: Value| drop(log(&event));
    let admits = |kind| prints && admits(kind);
    let first = RefCell::new(first);
    let open = || first.borrow().another().context("cannot make another connection of the controller");
    service.run(listener, open, |notice| {
        match notice {
            Notice::Look(now) => {
                let mut first = first.borrow_mut();
                first.handle_timeout(now);
                while first.poll_event().is_some() {}
                if !first.accepts(now) {
                    return ControlFlow::Break("the controller has no power".into());
                }
            }
            Notice::Connected(peer) if admits("connected") => {
                print(json!({"event": "connected", "peer": peer}));
            }
            Notice::Refused(peer, why) if admits("refused_client") => {
                print(json!({"event": "refused_client", "peer": peer, "why": why}))
            }
            Notice::Event(_, Told::Device(FanucEvent::Server(ServerEvent::OutOfStep(error)))) => {
                return ControlFlow::Break(format!("the client violates the protocol: {error}"));
            }
            Notice::Event(peer, Told::Device(event)) if prints => {
                if let Some(event) = show(event, Some(peer)) {
                    print(event);
                }
            }
            Notice::Event(_, Told::Close(why)) => return ControlFlow::Break(why.into()),
            Notice::Disconnected(peer, why) if admits("disconnected") => {
                print(json!({"event": "disconnected", "peer": peer, "why": why}));
            }
            Notice::Traced(path) if prints => print(json!({"event": "trace", "path": path})),
            _ => {}
        }
        ControlFlow::Continue(())
    })
}

/// An RTU line until it is gone for good.
fn serve_line(line: &mut Line, robot: &mut Simulator<FanucController>) -> Result<()> {
    let mut driver = Driver::new(line);
    let (mut attached, mut closes) = (Attached::default(), false);
    loop {
        attached.keep_up(core::mem::take(&mut closes), driver.transport_mut(), robot);
        let goes_on = turn(&mut driver, robot, Some(LOOK), |_, told| {
            closes |= matches!(told, Told::Close(_));
            if let Told::Device(event) = told
                && let Some(event) = show(event, None)
            {
                drop(log(&event));
            }
            Ok(())
        })?;
        if !goes_on {
            return Ok(());
        }
    }
}

/// One connection, without a record of writes.
fn connection(controller: &Shared, config: ServerConfig) -> Result<Simulator<FanucController>> {
    Ok(Simulator::new(FanucController::new(config, Arc::clone(controller))?).keeping_nothing())
}

/// Returns the line for what a client reads and writes, what was refused, and what was corrupt, if it is to be printed.
fn show(event: FanucEvent, peer: Option<SocketAddr>) -> Option<Value> {
    let kind = match event {
        FanucEvent::Read { .. } => "read",
        FanucEvent::Written(_) => "write",
        FanucEvent::Server(ServerEvent::Served { exception: Some(_), .. }) => "refused",
        FanucEvent::Server(ServerEvent::Refused { .. }) => "too_many",
        FanucEvent::Server(ServerEvent::Corrupt(_)) => "corrupt",
        _ => return None,
    };
    // Of most requests nothing is printed: their lines are not made.
    if !admits(kind) {
        return None;
    }
    let fields = match event {
        FanucEvent::Read { table, address, count } => {
            json!({"table": table, "address": address, "count": count})
        }
        FanucEvent::Written(write) => control::show(&write),
        FanucEvent::Server(ServerEvent::Served { unit, function, exception, .. }) => {
            json!({"unit": unit, "function": function, "exception": exception.map(u8::from)})
        }
        FanucEvent::Server(ServerEvent::Refused { unit, function }) => {
            json!({"unit": unit, "function": function})
        }
        FanucEvent::Server(ServerEvent::Corrupt(error)) => json!({"error": error}),
        _ => return None,
    };
    let mut line = Map::new();
    line.insert("event".into(), kind.into());
    if let Some(peer) = peer {
        line.insert("peer".into(), peer.to_string().into());
    }
    if let Value::Object(fields) = fields {
        line.extend(fields);
    }
    Some(line.into())
}
