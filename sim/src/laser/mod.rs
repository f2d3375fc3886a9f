//! The controller of a laser robot: it queues, executes one instruction after the other, and answers five words besides. And
//! its host.

mod host;

use core::time::Duration;

use laser_eb90::{
    Class, Controller, ControllerConfig, ControllerEvent, EncodeError, Instruction, Item, Items, Payload,
    Refusal, timing,
};
use robot_work_queue::{Reader, boxed};

pub use self::host::{Computer, LaserHost};
use crate::device::{Device, DeviceRecord, Error};
use crate::settings::Settings;

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

/// Jobs are numbered up to this: above the longest queue.
const NUMBERS: u16 = 10_000;

/// A laser robot's settings.
#[derive(Debug, Clone, Copy)]
pub struct Laser {
    /// The configuration of the session.
    pub config: ControllerConfig,
    /// The rate of the line in baud, if one is simulated.
    pub baud: u32,
    /// The capacity of the queue in instructions: 1 to 9999.
    pub queue: usize,
    /// The execution time of an instruction.
    pub execution: Duration,
}

impl Default for Laser {
    fn default() -> Self {
        let (config, execution) = (ControllerConfig::default(), Duration::from_millis(20));
        Self { config, baud: timing::BAUD, queue: 64, execution }
    }
}

impl Settings for Laser {
    type Device = LaserRobot;

    fn device(&self) -> Result<LaserRobot, Error> {
        LaserRobot::new(*self, 1)
    }
}

#[cfg(feature = "spec")]
impl robot_session::spec::Configure for Laser {
    fn configure(&mut self, fields: &mut impl robot_session::spec::FieldVisitor) {
        let Self { config, baud, queue, execution } = self;
        fields.baud(robot_session::spec::LINE, baud);
        fields.whole("queue", 1..=9999, "instructions", "how many the queue holds", queue);
        let hour = Duration::ZERO..=Duration::from_secs(3600);
        fields.time("execution", hour, "how long an instruction takes", execution);
        config.configure(fields);
    }
}

/// An interpreted instruction, as it came.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Job {
    /// The command word of the instruction.
    pub word: u16,
    /// The items that follow it, unstuffed: see [`Items`].
    pub parameters: Vec<u8>,
}

impl From<Instruction<'_>> for Job {
    fn from(instruction: Instruction<'_>) -> Self {
        Self { word: instruction.word, parameters: instruction.parameters.as_bytes().to_vec() }
    }
}

impl Job {
    /// Returns the floats among its parameters.
    pub fn floats(&self, config: &ControllerConfig) -> Vec<f32> {
        let items = Items::new(&self.parameters, &config.profile).flatten();
        let floats = items.filter_map(|item| match item {
            Item::F32(values) => Some(values.iter()),
            _ => None,
        });
        floats.flatten().collect()
    }
}

/// An event of a laser robot.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum LaserEvent {
    /// The number of instructions that were queued.
    Queued(u8),
    /// A frame, or corrupt bytes, were answered with an error code.
    Refused(Refusal),
    /// An immediate instruction or a query was executed.
    Executed(Class, Job),
}

/// A laser robot.
#[derive(Debug)]
pub struct LaserRobot {
    settings: Laser,
    boot: i16,
    controller: Controller<'static, Job>,
    queue: Reader<'static, Job>,
    halted: bool,
    /// The job in execution: its number, the job, and the time of its end.
    executing: Option<(u16, Job, Duration)>,
    /// The job that was executed last.
    last: Option<Job>,
}

impl LaserRobot {
    /// Creates a robot that has been started this often, including this time.
    ///
    /// # Errors
    /// Settings that cannot work.
    pub fn new(settings: Laser, boot: i16) -> Result<Self, Error> {
        let (writer, queue) = boxed(settings.queue, NUMBERS).map_err(Error::settings)?;
        let controller = Controller::new(settings.config, writer).map_err(Error::settings)?;
        Ok(Self { settings, boot, controller, queue, halted: false, executing: None, last: None })
    }

    /// Returns the number of instructions that it holds.
    pub fn held(&self) -> usize {
        self.queue.len()
    }

    /// Returns the queued instructions in sequence; a loss of power drops them.
    pub fn waiting(&self) -> impl Iterator<Item = Job> + '_ {
        self.queue.iter().map(|(_, job)| job.clone())
    }

    /// Executes an immediate instruction or a query, and has it answered.
    fn execute(&mut self, now: Duration, word: u16) -> Result<(), laser_eb90::SessionError> {
        let nothing = |_: &mut Payload<'_>| -> Result<(), EncodeError> { Ok(()) };
        match word {
            HALT | GO_ON => {
                self.halted = word == HALT;
                self.controller.answer(now, nothing)
            }
            CLEAR => {
                self.controller.queue_mut().clear();
                self.controller.answer(now, nothing)
            }
            STATUS => {
                let status = [self.boot, short(self.queue.capacity()), short(self.queue.len())];
                self.controller.answer(now, |values| values.i16(&status).map(drop))
            }
            POSITION => {
                let at = self.last.as_ref().map_or_else(Vec::new, |job| job.floats(&self.settings.config));
                self.controller.answer(now, |values| values.f32(&at).map(drop))
            }
            _ => self.controller.refuse(now, Refusal::UnknownCommand),
        }
    }
}

impl Device for LaserRobot {
    type Session = Controller<'static, Job>;
    type Event = LaserEvent;
    type Work = Job;

    fn session(&self) -> &Self::Session {
        &self.controller
    }

    fn session_mut(&mut self) -> &mut Self::Session {
        &mut self.controller
    }

    fn take(&mut self, now: Duration, event: ControllerEvent, notes: &mut DeviceRecord<LaserEvent, Job>) {
        match event {
            ControllerEvent::Queued { count } => notes.event(LaserEvent::Queued(count)),
            ControllerEvent::Refused(refusal) => notes.event(LaserEvent::Refused(refusal)),
            ControllerEvent::Execute { class, word } => {
                if let Some(instruction) = self.controller.instruction() {
                    notes.event(LaserEvent::Executed(class, instruction.into()));
                }
                // The instruction waits for an answer, and each of these fits.
                let answered = self.execute(now, word);
                debug_assert_eq!(answered, Ok(()));
            }
            _ => {}
        }
    }

    fn advance(&mut self, now: Duration, notes: &mut DeviceRecord<LaserEvent, Job>) {
        let mut begins = now;
        loop {
            if let Some((number, job, end)) = self.executing.take_if(|(_, _, end)| *end <= now) {
                if let Some(taken) = self.queue.take_where(|waiting, _| waiting == number) {
                    taken.complete();
                }
                notes.executed(end, job.clone());
                (self.last, begins) = (Some(job), end);
            }
            if !self.controller.queue_mut().is_settled() {
                // Halted, it sees that the queue was emptied all the same.
                let _ = self.queue.take_where(|_, _| false);
            }
            if self.executing.is_some() || self.halted {
                return;
            }
            let Some((number, job)) = self.queue.iter().next() else { return };
            let end = begins.saturating_add(self.settings.execution);
            self.executing = Some((number, job.clone(), end));
        }
    }

    fn due(&self) -> Option<Duration> {
        self.executing.as_ref().map(|(_, _, end)| *end)
    }

    fn restart(&mut self, _: Duration) {
        // The same settings have worked before.
        if let Ok(robot) = Self::new(self.settings, self.boot.wrapping_add(1)) {
            *self = robot;
        }
    }

    fn forget(&mut self, _: Duration) {
        self.controller.queue_mut().clear();
        self.executing = None;
        let _ = self.queue.take_where(|_, _| false);
    }
}

fn short(count: usize) -> i16 {
    i16::try_from(count).unwrap_or(i16::MAX)
}
