//! The simulated laser robot on a line.

use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use cellwire_sim::host::Notice;
pub use cellwire_sim::laser::STATUS;
use cellwire_sim::laser::{Job, LaserEvent, LaserRobot};
use cellwire_sim::{Device as _, Laser, Simulator, SimulatorReport};
use laser_eb90::{Item, Items};
use robot_session::{ReceiveOutcome, SendOutcome, Session as _, Transport, Wait};
use serde_json::{Value, json};

use crate::devices::control::{Command, OwnCommands, fields};
use crate::devices::device::SimulateOptions;
use crate::devices::on_line::{Presence, on_line};
use crate::io::line::Line;
use crate::io::samples::Samples;
use crate::io::table::AppendedTable;
use cellwire_io::clock::Clock;
use cellwire_io::output::log;
use cellwire_links::settings::{self, Configure, FieldVisitor};

/// The counts of a robot.
#[derive(Debug, Default)]
pub struct RobotCounts {
    /// The number of error codes that were sent.
    pub refused: u64,
    /// The time of the robot's work in a cycle, from when it has the processor until its answer is on the line.
    pub work: Samples,
    /// The times from the end of the cycle to the answer on the line: how late the computer gave it the processor.
    pub answer: Samples,
    /// The number of times that it was started again.
    pub restarts: u64,
    /// The instructions that it held when it was killed.
    pub forgotten: Vec<Job>,
}

impl RobotCounts {
    /// Adds the counts from before or after a restart.
    pub fn add(&mut self, other: &Self) {
        self.forgotten.extend_from_slice(&other.forgotten);
        self.refused += other.refused;
        self.work.merge(&other.work);
        self.answer.merge(&other.answer);
    }
}

/// Runs `cellwire simulate laser`.
///
/// # Errors
/// If the endpoint cannot be opened, or a setting is not one of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let LaserSettings { robot, record } =
        settings::read("laser", LaserSettings::default(), &options.settings)?;
    let open = |file: String| AppendedTable::open(Path::new(&file), "instructions", &[]);
    let mut record = record.map(open).transpose()?;
    let mut simulator = Simulator::new(LaserRobot::new(robot, 1)?);
    if record.is_none() {
        simulator = simulator.keeping_nothing();
    }
    options.serve(["laser", "laser"], robot.baud, simulator, own(&robot), |line, simulator| {
        let executed = |job| {
            if let Some(record) = &mut record {
                record.add(row(&job, &robot));
            }
        };
        run(&robot, simulator, line, &Switch::default(), |event| log(&event), executed).map(drop)
    })
}

/// The simulated robot of the tool.
#[derive(Debug, Default)]
pub struct LaserSettings {
    robot: Laser,
    /// A file for executed instructions.
    record: Option<String>,
}

impl Configure for LaserSettings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { robot, record } = self;
        let about = "a CSV file to which executed instructions are appended, as a program: `run laser FILE --dry-run --picture` draws it";
        fields.text("record", "a file", "none is written", about, record);
        robot.configure(fields);
    }
}

/// Returns an executed instruction as a row of a program.
fn row(Job { word, parameters }: &Job, robot: &Laser) -> Vec<String> {
    let mut row = vec![format!("{word:#06x}")];
    for item in Items::new(parameters, &robot.config.profile) {
        match item {
            Ok(Item::F32(values)) => row.extend(values.iter().map(|value| value.to_string())),
            Ok(Item::I16(values)) => row.extend(values.iter().map(|value| value.to_string())),
            Ok(Item::U8(values) | Item::Char(values)) => row.extend(values.iter().map(u8::to_string)),
            Err(_) => break,
        }
    }
    row
}

/// Returns the commands of `--control`: the length of the queue.
fn own(settings: &Laser) -> OwnCommands<LaserRobot> {
    let settings = *settings;
    OwnCommands {
        commands: const { &[Command::get("the number of instructions that the robot holds")] },
        execute: |robot, args| {
            args.none()?;
            Ok(fields([("held", robot.held().into())]))
        },
        show: Box::new(
            move |Job { word, parameters }| json!({"word": word, "items": Items::new(parameters, &settings.config.profile)}),
        ),
    }
}

/// How a robot is stopped.
#[derive(Debug, Default)]
pub struct Switch {
    off: AtomicBool,
    killed: AtomicBool,
}

impl Switch {
    /// Ends the reception; the robot executes the queued instructions.
    pub fn turn_off(&self) {
        self.off.store(true, Ordering::Relaxed);
    }

    /// Stops the robot in the middle of everything; it loses the queued instructions.
    pub fn kill(&self) {
        self.killed.store(true, Ordering::Relaxed);
        self.turn_off();
    }

    /// Returns whether the robot was stopped in this way.
    pub fn was_killed(&self) -> bool {
        self.killed.load(Ordering::Relaxed)
    }

    fn is_off(&self) -> bool {
        self.off.load(Ordering::Relaxed)
    }
}

/// Answers frames and executes the queue until the robot is switched off, or until the connection is gone. `executed`
/// receives the executed instructions in sequence.
///
/// # Errors
/// If an event cannot be reported.
pub fn run(
    settings: &Laser,
    mut robot: Simulator<LaserRobot>,
    line: &mut Line,
    switch: &Switch,
    mut notify: impl FnMut(Value) -> Result<()>,
    mut executed: impl FnMut(Job),
) -> Result<RobotCounts> {
    let clock = line.clock();
    let mut measured = MeasuredLine { line, clock, woken: clock.now(), counts: RobotCounts::default() };
    let mut keep = |robot: &mut Simulator<LaserRobot>| {
        core::iter::from_fn(|| robot.poll_executed()).for_each(|done| executed(done.work));
    };
    let mut refused = 0;
    on_line(
        &mut robot,
        &mut measured,
        Presence::Always,
        || !switch.is_off(),
        |robot, notice| match notice {
            Notice::Event(_, SimulatorReport::Device(event)) => {
                refused += u64::from(matches!(event, LaserEvent::Refused(_)));
                show(&event, settings).map_or(Ok(()), &mut notify)
            }
            Notice::Settled => {
                keep(robot);
                Ok(())
            }
            _ => Ok(()),
        },
    )?;
    keep(&mut robot);
    // The queued instructions are executed, without waiting for their times.
    while !switch.was_killed()
        && let Some(end) = robot.device().due()
    {
        robot.handle_timeout(end);
        keep(&mut robot);
    }
    let forgotten = if switch.was_killed() { robot.device().waiting().collect() } else { Vec::new() };
    Ok(RobotCounts { refused, forgotten, ..measured.counts })
}

fn show(event: &LaserEvent, settings: &Laser) -> Option<Value> {
    match event {
        LaserEvent::Queued(count) => Some(json!({"event": "queued", "count": count})),
        LaserEvent::Refused(refusal) => Some(json!({"event": "refused", "refusal": refusal})),
        LaserEvent::Executed(class, Job { word, parameters }) => {
            let items = Items::new(parameters, &settings.config.profile);
            Some(json!({"event": class, "word": word, "items": items}))
        }
        _ => None,
    }
}

/// The line, and how long the robot takes in a cycle.
struct MeasuredLine<'a> {
    line: &'a mut Line,
    clock: Clock,
    /// When the robot had the processor.
    woken: Duration,
    counts: RobotCounts,
}

impl AsMut<Line> for MeasuredLine<'_> {
    fn as_mut(&mut self) -> &mut Line {
        self.line
    }
}

impl Transport for MeasuredLine<'_> {
    fn now(&self) -> Duration {
        self.line.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        let received = Transport::receive(self.line, buffer, wait);
        self.woken = self.clock.now();
        received
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.line.send(bytes);
        let sent = self.clock.now();
        self.counts.work.add(sent.saturating_sub(self.woken));
        self.counts.answer.add(sent.saturating_sub(self.line.now()));
        Ok(SendOutcome::Buffered)
    }
}
