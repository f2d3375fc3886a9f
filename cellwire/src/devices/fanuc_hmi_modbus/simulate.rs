//! `cellwire simulate fanuc`: the controller over Modbus TCP, RTU over TCP, or RTU on a pseudo-terminal.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use cellwire_sim::fanuc::{
    Controller, FanucController, FanucEvent, Identification, Lists, Roles, Shared, Tables, TelemetryFaults,
    Write, circle,
};
use cellwire_sim::host::Notice;
use cellwire_sim::{Simulator, SimulatorReport};
use fanuc_hmi_modbus::{Exception, ServerConfig, ServerEvent, Table, TelemetryBlock, WordOrder};
use serde_json::{Map, Value, json};

use super::control;
use super::inputs::Inputs;
use super::mapping::Mapping;
use super::options::{FanucSettings, ProgramSettings};
use super::program::{Finding, Machine, Programs, load};
use super::robot::{ReportingRobot, Reports, Robot};
use crate::devices::device::{Endpoint, SimulateOptions};
use crate::devices::host::{connected, disconnected, reason};
use crate::devices::on_line::{Presence, on_line};
use cellwire_io::clock::Clock;
use cellwire_io::output::{self, admits, log, remark};
use cellwire_links::settings;
use cellwire_motion::{Arm, Limits, Planner, Pose};

/// Runs until interrupted. The settings are those of [`FanucSettings`].
///
/// # Errors
/// If the endpoint cannot be opened, or a setting is not one of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let mut settings = settings::read("fanuc", FanucSettings::default(), &options.settings)?;
    settings.program.check()?;
    let is_line = matches!(options.endpoint, Endpoint::Pty(_));
    for name in settings.unused(is_line).into_iter().filter(|name| options.settings.contains_key(*name)) {
        remark(&format!("the setting {name} has no effect here"));
    }
    settings.program.leaves_registers = !options.settings.contains_key("telemetry");
    let faults: TelemetryFaults = settings.faults.as_deref().unwrap_or_default().parse()?;
    let identification: Identification = settings.identification.as_deref().unwrap_or_default().parse()?;
    let files: Lists = settings.files.as_deref().unwrap_or_default().parse()?;
    let queues: Lists = settings.queues.as_deref().unwrap_or_default().parse()?;
    let roles: Roles = settings.roles.as_deref().unwrap_or_default().parse()?;
    ensure!(
        roles.is_empty() || options.tls.verifies_clients(),
        "the setting roles needs the certificates of clients: give their authority with --tls"
    );
    let reports = Reports::default();
    let (controller, mapping) = match &settings.program.program {
        None => (Controller::new(Box::new(circle), settings.word_order), None),
        Some(program) => {
            let robot = robot(Path::new(program), &settings.program, settings.word_order)?;
            let mapping = robot.mapping.clone();
            let robot = ReportingRobot { robot, reports: Arc::clone(&reports) };
            (Controller::running(Box::new(robot), settings.word_order), Some(mapping))
        }
    };
    let shown = AccessPrinter { mapping };
    let controller = Arc::new(Mutex::new(
        controller
            .with_faults(faults)
            .with_identification(identification)
            .with_exception_status(settings.exception_status)
            .with_files(files, queues)
            .with_roles(roles),
    ));
    let runs = settings.program.program.is_some();
    let start = |clock| if runs { keep_running(&controller, &reports, clock) } else { Ok(()) };
    match &options.endpoint {
        Endpoint::Listen(_) => {
            let (device, clock) = (connection(&controller, settings.on_tcp())?, Clock::start());
            start(clock)?;
            let mut violation = None;
            options.serve_tcp("fanuc", clock, device, control::own(), |trace, notice| {
                let printed = match notice {
                    Notice::Connected(peer) => connected(peer),
                    Notice::Refused(peer, why) => {
                        output::notice(&json!({"event": "refused_client", "peer": peer, "why": why}))
                    }
                    Notice::Event(peer, SimulatorReport::Device(event)) => {
                        if let FanucEvent::Server(ServerEvent::OutOfStep(error)) = &event {
                            // The device closes the connection next.
                            violation = Some(format!("the client violates the protocol: {error}"));
                        }
                        shown.print(&event, Some(peer));
                        Ok(())
                    }
                    Notice::Disconnected(peer, ending) => {
                        let why = violation.take().unwrap_or_else(|| reason(ending));
                        disconnected(trace, peer, &why)
                    }
                    _ => Ok(()),
                };
                drop(printed); // a script that reads no more does not stop the simulator
                Ok(())
            })
        }
        Endpoint::Pty(_) => {
            let device = connection(&controller, settings.on_line())?;
            let (names, baud) = (["fanuc", "fanuc"], settings.baud);
            options.serve(names, baud, device, control::own(), |line, mut robot| {
                start(line.clock())?;
                on_line(
                    &mut robot,
                    line,
                    Presence::Always,
                    || true,
                    |_, notice| {
                        if let Notice::Event(_, SimulatorReport::Device(event)) = notice {
                            shown.print(&event, None);
                        }
                        Ok(())
                    },
                )
            })
        }
        Endpoint::Connect(_) => bail!("a FANUC controller is a server: use --listen, or --pty for RTU"),
    }
}

/// Returns the event of a background task that would write registers that the programs use; `None` if it writes other
/// registers.
fn overwritten(programs: &Programs, first: u32) -> Option<Value> {
    let last = first + BACKGROUND_REGISTERS - 1;
    let mut used = programs.values().flat_map(|program| program.registers());
    let number = used.find(|number| (first..=last).contains(number))?;
    let what = format!(
        "the background task does not run: it would write R[{first}] to R[{last}], and the program uses R[{number}]; set telemetry=N to write R[N] and those after it"
    );
    Some(json!({"event": "not_modelled", "what": what, "count": 1}))
}

/// The number of registers that the background task writes.
const BACKGROUND_REGISTERS: u32 = 19;

/// Makes the robot that runs a program; the parts of the program that are not simulated are the first of its events.
///
/// # Errors
/// If a file cannot be read, or has another content than required.
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

/// Lets the program run even while there are no requests, and prints its reports.
///
/// # Errors
/// If the system has no room for a thread.
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

/// Creates one connection, without a record of writes.
///
/// # Errors
/// A configuration that cannot work.
pub fn connection(controller: &Shared, config: ServerConfig) -> Result<Simulator<FanucController>> {
    Ok(Simulator::new(FanucController::new(config, Arc::clone(controller))?).keeping_nothing())
}

/// The printed accesses of clients.
#[derive(Debug)]
struct AccessPrinter {
    /// The assignments of the holding registers, if there are any.
    mapping: Option<Mapping>,
}

impl AccessPrinter {
    /// Prints the lines of an event: a read, a write, registers without an assignment, a refusal, corrupt bytes.
    fn print(&self, event: &FanucEvent, peer: Option<&str>) {
        let put = |kind: &str, fields: &dyn Fn() -> Value| {
            // For most requests nothing is printed: their lines are not made.
            if !admits(kind) {
                return;
            }
            let mut line = Map::new();
            line.insert("event".into(), kind.into());
            if let Some(peer) = peer {
                line.insert("peer".into(), peer.into());
            }
            if let Value::Object(fields) = fields() {
                line.extend(fields);
            }
            drop(log(&line.into())); // a script that reads no more does not stop the simulator
        };
        match event {
            FanucEvent::Read { table, address, count } => {
                put("read", &|| json!({"table": table, "address": address, "count": count}));
            }
            FanucEvent::Role(role) => put("role", &|| match role {
                Ok(role) => json!({"role": role}),
                Err(error) => json!({"role": null, "why": error.to_string()}),
            }),
            FanucEvent::Written(write) => put("write", &|| control::show(write)),
            FanucEvent::Refused { unit, function, exception, values } => put("refused", &|| {
                let code = u8::from(*exception);
                let Some((table, address, count)) = values else {
                    return json!({"unit": unit, "function": function, "exception": code, "why": exception.to_string()});
                };
                let why = match exception {
                    Exception::IllegalDataAddress => {
                        format!("{exception}: the table ends at {}", Tables::len(*table).saturating_sub(1))
                    }
                    _ => exception.to_string(),
                };
                json!({
                    "unit": unit, "function": function, "table": table, "address": address, "count": count,
                    "exception": code, "why": why,
                })
            }),
            FanucEvent::Server(ServerEvent::Refused { unit, function }) => {
                put("too_many", &|| json!({"unit": unit, "function": function}));
            }
            FanucEvent::Server(ServerEvent::Corrupt(error)) => put("corrupt", &|| json!({"error": error})),
            _ => {}
        }
        if let (None, FanucEvent::Written(Write::Registers(address, values))) = (&self.mapping, event)
            && *address < TelemetryBlock::QUANTITY
        {
            let count = values.len().min((TelemetryBlock::QUANTITY - address).into());
            put("overwritten", &|| {
                let why = "the background task writes its telemetry here, every 8 ms: write to registers from PDU address 37 on";
                json!({"table": Table::HoldingRegisters, "address": address, "count": count, "why": why})
            });
        }
        if let Some((address, count)) = self.unassigned(event) {
            put("unassigned", &|| {
                let why = format!("no assignment covers $ADDRESS {}", address + 1);
                json!({"table": Table::HoldingRegisters, "address": address, "count": count, "why": why})
            });
        }
    }

    /// Returns the first register of an access without an assignment, and the number of registers from there to the end of
    /// the access.
    fn unassigned(&self, event: &FanucEvent) -> Option<(usize, usize)> {
        let (address, count) = match event {
            FanucEvent::Read { table: Table::HoldingRegisters, address, count } => {
                (*address, (*count).into())
            }
            FanucEvent::Written(Write::Registers(address, values)) => (*address, values.len()),
            _ => return None,
        };
        let (start, end) = (usize::from(address), usize::from(address) + count);
        let first = self.mapping.as_ref()?.first_unassigned(start..end)?;
        Some((first, end - first))
    }
}
