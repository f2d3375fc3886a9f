//! The simulated laser robot: its controller on a line, and the motion task that reads the queue.

use std::io;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use laser_eb90::{Controller, ControllerConfig, ControllerEvent, Instruction, Item, Items, Refusal};
use robot_session::{Driver, Received, Sent, Session as _, Transport, Wait};
use robot_work_queue::{NoWake, Reader, Wake};
use serde_json::{Value, json};

use super::options::LaserSettings;
use crate::io::bell::Bell;
use crate::io::drive::turn;
use crate::io::line::{Clock, Line};
use crate::io::output::log;
use crate::io::priority::{self, Rank};
use crate::io::samples::Samples;
use crate::io::serial::READ_TIMEOUT;
use crate::links::device::SimulateOptions;
use crate::links::device::serve;
use cellwire_links::settings;

/// Executes nothing until [`GO_ON`].
pub const HALT: u16 = 0x0201;
/// Executes again.
pub const GO_ON: u16 = 0x0202;
/// Empties the queue.
pub const CLEAR: u16 = 0x0203;
/// Answers three shorts: how often the controller has started, how many instructions its queue holds at most, and how many it
/// holds now.
pub const STATUS: u16 = 0x0301;
/// Answers the floats of the instruction that was executed last.
pub const POSITION: u16 = 0x0302;

/// How a simulated robot behaves.
#[derive(Debug, Clone, Copy)]
pub struct Robot {
    /// Its session.
    pub config: ControllerConfig,
    /// How many instructions the queue holds.
    pub queue: usize,
    /// How long an instruction takes to execute.
    pub execution: Duration,
    /// How often it has been started, this time included.
    pub boot: i16,
}

impl Default for Robot {
    fn default() -> Self {
        let (config, execution) = (ControllerConfig::default(), Duration::from_millis(1));
        Self { config, queue: 64, execution, boot: 1 }
    }
}

/// An interpreted instruction, as it came.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Job {
    /// The command word.
    pub word: u16,
    /// The items that follow it, unstuffed.
    pub parameters: Vec<u8>,
}

impl From<Instruction<'_>> for Job {
    fn from(instruction: Instruction<'_>) -> Self {
        Self { word: instruction.word, parameters: instruction.parameters.as_bytes().to_vec() }
    }
}

/// What a robot has done.
#[derive(Debug, Default)]
pub struct RobotCounts {
    /// Error codes sent.
    pub refused: u64,
    /// What the robot does in a cycle, from when it has the processor until its answer is on the line.
    pub work: Samples,
    /// From the end of the cycle to the answer on the line: how late the machine gave it the processor.
    pub answer: Samples,
}

impl RobotCounts {
    /// Adds what was counted before or after a restart.
    pub fn add(&mut self, other: &Self) {
        self.refused += other.refused;
        self.work.merge(&other.work);
        self.answer.merge(&other.answer);
    }
}

/// Jobs are numbered up to this: above the longest queue.
const NUMBERS: u16 = 10_000;

/// `cellwire simulate laser`.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let LaserSettings { config, baud, queue, execution } =
        settings::read("laser", LaserSettings::default(), &options.settings)?;
    let robot = Robot { config, queue, execution, boot: 1 };
    serve("laser", "laser", options, baud, |line, clock| {
        run(robot, line, clock, &Switch::default(), |event| log(&event), &Mutex::default())?;
        Ok(())
    })
}

/// How a robot is stopped.
#[derive(Debug, Default)]
pub struct Switch {
    off: AtomicBool,
    killed: AtomicBool,
}

impl Switch {
    /// It receives nothing more, and executes what is queued.
    pub fn turn_off(&self) {
        self.off.store(true, Ordering::Relaxed);
    }

    /// It stops in the middle of everything and forgets what is queued.
    pub fn kill(&self) {
        self.killed.store(true, Ordering::Relaxed);
        self.turn_off();
    }

    /// Whether it was stopped so.
    pub fn was_killed(&self) -> bool {
        self.killed.load(Ordering::Relaxed)
    }

    fn is_off(&self) -> bool {
        self.off.load(Ordering::Relaxed)
    }
}

/// Answers frames and executes what is queued until it is switched off, or until the connection is gone. `executed` takes what
/// was executed, in that order.
///
/// # Errors
/// When an event cannot be reported, or the queue cannot be as long as asked.
pub fn run(
    robot: Robot,
    line: &mut Line,
    clock: Clock,
    switch: &Switch,
    notify: impl FnMut(Value) -> Result<()>,
    executed: &Mutex<Vec<Job>>,
) -> Result<RobotCounts> {
    let (bell, halted, done) = (Bell::default(), AtomicBool::new(false), AtomicBool::new(false));
    let ring = bell.clone();
    let (writer, reader) =
        robot_work_queue::boxed_with::<Job, _, _>(robot.queue, NUMBERS, move || ring.ring(), NoWake)?;
    let motion = Motion { robot, switch, bell: &bell, halted: &halted, done: &done, executed };
    let mut task = Communication { motion, clock, notify, refused: 0 };
    let controller = Controller::new(robot.config, writer)?;
    priority::raise(Rank::Hardware);
    thread::scope(|scope| {
        let builder = thread::Builder::new().name("motion".into());
        let motion = builder
            .spawn_scoped(scope, move || motion.run(reader))
            .context("cannot start a thread that executes instructions")?;
        let outcome = task.run(controller, line);
        done.store(true, Ordering::Relaxed);
        bell.ring();
        if let Err(panic) = motion.join() {
            std::panic::resume_unwind(panic);
        }
        outcome
    })
}

/// The line, and how long the robot takes in a cycle.
struct Measured<'a> {
    line: &'a mut Line,
    clock: Clock,
    /// When the robot had the processor.
    woken: Duration,
    counts: RobotCounts,
}

impl Transport for Measured<'_> {
    fn now(&self) -> Duration {
        self.line.now()
    }

    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        let received = Transport::receive(self.line, buffer, wait);
        self.woken = self.clock.now();
        received
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.line.send(bytes);
        let sent = self.clock.now();
        self.counts.work.add(sent.saturating_sub(self.woken));
        self.counts.answer.add(sent.saturating_sub(self.line.now()));
        Ok(Sent::Buffered)
    }
}

/// The communication task: what the controller's session reports.
struct Communication<'a, F> {
    motion: Motion<'a>,
    clock: Clock,
    notify: F,
    refused: u64,
}

impl<F: FnMut(Value) -> Result<()>> Communication<'_, F> {
    fn run<R: Wake>(
        &mut self,
        mut controller: Controller<'_, Job, R>,
        line: &mut Line,
    ) -> Result<RobotCounts> {
        let clock = self.clock;
        let measured = Measured { line, clock, woken: clock.now(), counts: RobotCounts::default() };
        let mut driver = Driver::new(measured);
        controller.handle_connected(driver.transport_mut().now());
        while !self.motion.switch.is_off() {
            let handler = |controller: &mut _, event| self.take(controller, event);
            if !turn(&mut driver, &mut controller, Some(READ_TIMEOUT), handler)? {
                break;
            }
        }
        let counts = core::mem::take(&mut driver.transport_mut().counts);
        Ok(RobotCounts { refused: self.refused, ..counts })
    }

    fn take<R: Wake>(
        &mut self,
        controller: &mut Controller<'_, Job, R>,
        event: ControllerEvent,
    ) -> Result<()> {
        match event {
            ControllerEvent::Queued { count } => (self.notify)(json!({"event": "queued", "count": count})),
            ControllerEvent::Refused(refusal) => {
                self.refused += 1;
                (self.notify)(json!({"event": "refused", "refusal": refusal}))
            }
            ControllerEvent::Execute { class, word } => {
                let items = controller.instruction().map(|instruction| instruction.parameters);
                (self.notify)(json!({"event": class, "word": word, "items": items}))?;
                self.execute(controller, word)
            }
            _ => Ok(()),
        }
    }

    /// Executes an immediate instruction or a query, and has it answered.
    fn execute<R: Wake>(&mut self, controller: &mut Controller<'_, Job, R>, word: u16) -> Result<()> {
        let now = self.clock.now();
        match word {
            HALT | GO_ON => {
                self.motion.halted.store(word == HALT, Ordering::Relaxed);
                self.motion.bell.ring();
                controller.answer(now, |_| Ok(()))?;
            }
            CLEAR => {
                controller.queue_mut().clear();
                controller.answer(now, |_| Ok(()))?;
            }
            STATUS => {
                let queue = controller.queue_mut();
                let [capacity, held] = [queue.capacity(), queue.capacity() - queue.free()].map(short);
                let status = [self.motion.robot.boot, capacity, held];
                controller.answer(now, |values| values.i16(&status).map(drop))?;
            }
            POSITION => {
                let at = self.motion.position();
                controller.answer(now, |values| values.f32(&at).map(drop))?;
            }
            _ => controller.refuse(now, Refusal::UnknownCommand)?,
        }
        Ok(())
    }
}

/// The motion task: executes one instruction after the other.
#[derive(Clone, Copy)]
struct Motion<'a> {
    robot: Robot,
    switch: &'a Switch,
    /// There is something to look at.
    bell: &'a Bell,
    halted: &'a AtomicBool,
    /// The communication task has ended: nothing more is queued.
    done: &'a AtomicBool,
    executed: &'a Mutex<Vec<Job>>,
}

impl Motion<'_> {
    fn run<W: Wake>(self, mut reader: Reader<'_, Job, W>) {
        while !self.switch.was_killed() {
            let done = self.done.load(Ordering::Relaxed);
            let halted = self.halted.load(Ordering::Relaxed);
            // Halted, it takes nothing, but sees that the queue was emptied.
            match if halted { reader.take_where(|_, _| false) } else { reader.take() } {
                Some(job) => {
                    thread::sleep(self.robot.execution);
                    if let Ok(mut executed) = self.executed.lock() {
                        executed.push(job.complete());
                    }
                }
                None if done => return,
                None => self.bell.wait(),
            }
        }
    }

    /// The floats of the instruction that was executed last.
    fn position(&self) -> Vec<f32> {
        let Ok(executed) = self.executed.lock() else { return Vec::new() };
        let parameters = executed.last().map(|job| job.parameters.as_slice()).unwrap_or_default();
        let floats =
            Items::new(parameters, &self.robot.config.profile).flatten().filter_map(|item| match item {
                Item::F32(values) => Some(values.iter()),
                _ => None,
            });
        floats.flatten().collect()
    }
}

fn short(count: usize) -> i16 {
    i16::try_from(count).unwrap_or(i16::MAX)
}
