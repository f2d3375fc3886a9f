//! The run: the task between two sessions, the periphery, and an operator.

use std::sync::mpsc;
use std::time::Duration;

use anyhow::{Result, bail};
use mmacell_proto::{CentralEvent, PlatformPose, Pose, RobotPose};
use mmacell_task::{Device, Event, Failure, Output, Step, Task};
use robot_session::now;
use serde_json::json;

use super::Journal;
use super::connection::{Arrival, Connection, Inbox, WAITING};
use super::periphery::{Periphery, PeripheryEvent};
use super::settings::Settings;
use crate::io::journal::{Outcome, Span};
use crate::run::{Console, END_WITHIN, KEYBOARD_WITHIN, ResumeAnswer, ResumeChoice, STOP_WITHIN};
use cellwire_io::bell::Bell;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::tcp::Dialing;
use cellwire_io::tls::Tls;

/// The addresses of the devices.
#[derive(Debug, Clone)]
pub struct Addresses {
    /// The address of the robot's controller.
    pub robot: String,
    /// The address of the platform's controller.
    pub platform: String,
    /// The settings by which connections are opened.
    pub dialing: Dialing,
    /// The TLS of the connections; `None` without.
    pub tls: Option<Tls>,
}

/// The end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunEnd {
    /// Every part of the work is placed.
    Complete,
    /// The operator has stopped it, or a question was not answered.
    Stopped(FinalState),
}

/// The state of the devices at the end, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FinalState {
    /// The devices report that they are at rest.
    AtRest,
    /// The devices may still finish their last motion.
    MayMove,
    /// The devices were not asked.
    NotAsked,
}

/// A task that is run.
#[allow(missing_debug_implementations, reason = "it holds what notifies")]
pub struct Runner<'a> {
    journal: &'a mut Journal,
    console: Console<'a>,
    /// Rung for the operator's input, for events of a connection, and for lines of the periphery.
    bell: Bell,
    part: usize,
    /// A part is placed, and the next is not to begin yet.
    held: bool,
    /// The task waits for the answer to a question.
    question: bool,
    /// The time at which the run ends even if the devices do not answer, since they were ordered to stop at once.
    end_by: Option<Duration>,
}

impl<'a> Runner<'a> {
    /// Creates a run that continues at the end of the journal. The operator's words and the periphery share the bell.
    pub fn new(journal: &'a mut Journal, console: Console<'a>, bell: Bell) -> Self {
        let (part, held, question, end_by) = (0, false, false, None);
        Self { journal, console, bell, part, held, question, end_by }
    }

    /// Settles the part that an earlier run has begun: by `answer` if it is given, otherwise by the operator's; returns
    /// false if the operator stops.
    ///
    /// # Errors
    /// If the journal cannot be written.
    pub fn settle_begun(&mut self, answer: Option<ResumeChoice>) -> Result<bool> {
        while let Some(part) = self.journal.first(Outcome::Unknown) {
            self.part = part;
            let answered = match answer.and_then(|answer| answer.done(part, 1)) {
                Some(done) => Some(ResumeAnswer { first: part, count: 1, done }),
                None if self
                    .ask("an earlier run ended while the robot was at this part: clear the gripper") =>
                {
                    self.console.answer()
                }
                None => None,
            };
            let Some(answered) = answered else { return Ok(false) };
            self.answer(answered)?;
        }
        Ok(true)
    }

    fn answer(&mut self, answered: ResumeAnswer) -> Result<()> {
        self.question = false;
        self.note(if answered.done > 0 { Outcome::Done } else { Outcome::NotSent })?;
        self.console.notify_answered(answered);
        Ok(())
    }

    /// Runs until every part is placed, or until it is stopped.
    ///
    /// # Errors
    /// A device that cannot be reached; a connection that was lost and not regained before the end; a journal that cannot be
    /// written.
    pub fn run(
        &mut self,
        settings: &Settings,
        addresses: &Addresses,
        periphery: &mut dyn Periphery,
    ) -> Result<RunEnd> {
        let Some(first) = self.journal.first(Outcome::NotSent) else { return Ok(RunEnd::Complete) };
        self.part = first;
        let (arrivals, inbox) = mpsc::sync_channel(WAITING);
        let sender = Inbox { arrivals, bell: self.bell.clone() };
        let Addresses { robot, platform, dialing, tls } = addresses;
        let mut robot: Connection<RobotPose> =
            Connection::open(Device::Robot, robot, *dialing, tls.clone(), settings.central, &sender)?;
        let mut platform: Connection<PlatformPose> =
            Connection::open(Device::Platform, platform, *dialing, tls.clone(), settings.central, &sender)?;
        let mut task = Task::new(settings.task);
        // The periphery has no session of the cell's protocol.
        task.handle_event(now(), Event::Ready(Device::Conditioning));
        let mut failed = None;
        loop {
            if let Err(error) = self.settle(&mut task, &mut robot, &mut platform, periphery, failed.is_some())
            {
                // The devices come to rest first.
                failed = failed.or(Some(error));
                self.abort(&mut task);
                continue;
            }
            let is_late = self.end_by.is_some_and(|at| now() >= at);
            let retries = match task.step() {
                Step::Finished => break,
                // Nothing moves yet.
                Step::AwaitDevices if self.console.stopping => break,
                _ if is_late => break,
                Step::Closing => [None; 2],
                _ => [robot.reconnect(), platform.reconnect()],
            };
            let deadlines = [
                task.poll_timeout(),
                robot.timeout(),
                platform.timeout(),
                periphery.due(),
                self.end_by.or_else(|| self.console.due(STOP_WITHIN)),
            ];
            match deadlines.into_iter().chain(retries).flatten().min() {
                Some(at) => self.bell.wait_for(at.saturating_sub(now())),
                None => self.bell.wait(),
            }
            for arrival in inbox.try_iter().take(WAITING) {
                let arrival: Arrival = arrival;
                if arrival.from == Device::Robot { robot.arrived(arrival) } else { platform.arrived(arrival) }
            }
        }
        if let Some(failed) = failed {
            return Err(failed);
        }
        let lost = robot.why_lost().or(platform.why_lost());
        match (self.journal.first(Outcome::NotSent), self.journal.first(Outcome::Unknown), lost) {
            (None, None, _) => Ok(RunEnd::Complete),
            (_, _, Some(why)) => Err(ConnectionLost(why.into()).into()),
            _ => Ok(RunEnd::Stopped(match task.step() {
                Step::Finished => FinalState::AtRest,
                Step::AwaitDevices => FinalState::NotAsked,
                _ => FinalState::MayMove,
            })),
        }
    }

    /// Does all work that is due now. A failed run accepts no more events of the periphery.
    fn settle(
        &mut self,
        task: &mut Task,
        robot: &mut Connection<RobotPose>,
        platform: &mut Connection<PlatformPose>,
        periphery: &mut dyn Periphery,
        has_failed: bool,
    ) -> Result<()> {
        self.listen(task)?;
        task.handle_timeout(now());
        for _ in 0..WAITING {
            let mut idle = true;
            for event in robot.settle() {
                report(task, Device::Robot, &event);
                idle = false;
            }
            for event in platform.settle() {
                report(task, Device::Platform, &event);
                idle = false;
            }
            if !has_failed && let Some(happened) = periphery.poll() {
                self.periphery(task, happened)?;
                idle = false;
            }
            while let Some(output) = task.poll_output(now()) {
                self.carry_out(task, output, robot, platform, periphery)?;
                if has_failed && matches!(output, Output::Grip { .. }) {
                    // A periphery that is not listened to any more is not waited for.
                    task.handle_event(now(), Event::Done(Device::Gripper));
                }
                idle = false;
            }
            if idle {
                return Ok(());
            }
        }
        // The rest has its turn after the operator.
        self.bell.ring();
        Ok(())
    }

    /// Returns whether the part under way is not waited for: after a word, or after a signal if the robot has not touched
    /// the part, or is late.
    fn is_to_abort(&self) -> bool {
        let is_untouched = || self.journal.outcomes().get(self.part) == Some(&Outcome::NotSent);
        let console = &self.console;
        console.aborting
            || console.has_waited(STOP_WITHIN)
            || console.has_waited(Duration::ZERO) && is_untouched()
    }

    /// Tells the devices to stop, and limits the wait for that.
    fn abort(&mut self, task: &mut Task) {
        self.console.stopping = true;
        self.limit_end();
        task.handle_event(now(), Event::Abort);
    }

    /// Limits the wait for devices that were ordered to stop.
    fn limit_end(&mut self) {
        self.end_by.get_or_insert_with(|| now().saturating_add(END_WITHIN));
    }

    fn periphery(&mut self, task: &mut Task, happened: PeripheryEvent) -> Result<()> {
        let event = match happened {
            PeripheryEvent::Part(platform, pick) => Event::PartFound { platform, pick },
            PeripheryEvent::Slot(place) => Event::SlotFound { place },
            PeripheryEvent::Nothing => Event::NotFound,
            PeripheryEvent::ValveSet => Event::Done(Device::Gripper),
            PeripheryEvent::Switch(high) => Event::Switch { high },
            PeripheryEvent::Failed(why) => {
                self.console.notify(json!({"event": "periphery", "why": why}));
                Event::Failed { device: Device::Vision, failure: Failure::Aborted }
            }
            PeripheryEvent::Lost => bail!(ConnectionLost("the connection to the periphery was lost".into())),
        };
        task.handle_event(now(), event);
        Ok(())
    }

    fn carry_out(
        &mut self,
        task: &mut Task,
        output: Output,
        robot: &mut Connection<RobotPose>,
        platform: &mut Connection<PlatformPose>,
        periphery: &mut dyn Periphery,
    ) -> Result<()> {
        let refused = match output {
            Output::Entered(step) => {
                return self.entered(task, step, robot.why_lost().or(platform.why_lost()));
            }
            Output::Robot(command) => (!robot.request(command)).then_some(Device::Robot),
            Output::Platform(command) => (!platform.request(command)).then_some(Device::Platform),
            Output::Conditioning(_) => {
                task.handle_event(now(), Event::Done(Device::Conditioning));
                None
            }
            Output::Acquire { camera } => {
                periphery.acquire(camera, self.part);
                None
            }
            Output::Grip { gripper, open } => {
                periphery.set_valve(gripper, open);
                None
            }
            _ => None,
        };
        if let Some(device) = refused {
            task.handle_event(now(), Event::Failed { device, failure: Failure::Lost });
        }
        Ok(())
    }

    fn entered(&mut self, task: &mut Task, step: Step, lost: Option<&str>) -> Result<()> {
        self.console.notify(json!({"event": "step", "step": step, "part": self.part + 1}));
        match step {
            // From now on the robot may have touched the part.
            Step::GoPick => self.note(Outcome::Unknown)?,
            Step::Placed => {
                self.note(Outcome::Done)?;
                self.console.notify(json!({"event": "placed", "part": self.part + 1}));
                self.next(task);
            }
            Step::Unpicked => _ = self.ask("the part was missed or lost in every attempt"),
            Step::NothingFound => _ = self.ask("a camera found nothing"),
            Step::Faulted if self.console.stopping => {
                self.limit_end();
                task.handle_event(now(), Event::Finish);
            }
            Step::Faulted => {
                let why = match (lost, task.fault()) {
                    (Some(why), _) => why.into(),
                    (None, Some(fault)) => fault.to_string(),
                    (None, None) => "a fault".into(),
                };
                self.ask(&why);
            }
            _ => {}
        }
        Ok(())
    }

    /// Begins the next part, the end, or a pause.
    fn next(&mut self, task: &mut Task) {
        let event = match self.journal.first(Outcome::NotSent) {
            Some(part) if !self.console.stopping => {
                self.part = part;
                self.held = self.console.paused;
                if self.held {
                    return;
                }
                if task.step() == Step::Faulted { Event::Recover } else { Event::Next }
            }
            _ => Event::Finish,
        };
        task.handle_event(now(), event);
    }

    fn note(&mut self, outcome: Outcome) -> Result<()> {
        self.journal.note(&Span { outcome, first: self.part, count: 1 })?;
        self.console.progress(self.journal.tally());
        Ok(())
    }

    /// Asks the operator for the outcome of the part; returns false if there can be no answer.
    fn ask(&mut self, why: &str) -> bool {
        self.question = true;
        let part = self.part;
        let event = json!({"event": "", "part": part + 1, "why": why});
        self.console.ask((part, 1), KEYBOARD_WITHIN, event)
    }

    /// Executes the operator's requests since the last call. Without an operator the run stops at the next question.
    fn listen(&mut self, task: &mut Task) -> Result<()> {
        while let Some(answered) = self.console.listen(Duration::ZERO) {
            self.answer(answered)?;
            self.next(task);
        }
        if self.question && !self.console.asks() || self.held && self.console.stopping {
            (self.question, self.held) = (false, false);
            self.limit_end();
            task.handle_event(now(), Event::Finish);
        } else if self.held && !self.console.paused {
            self.next(task);
        }
        if self.end_by.is_none() && self.is_to_abort() {
            self.abort(task);
            self.console.notify(json!({"event": "aborting"}));
        }
        Ok(())
    }
}

fn report<P: Pose>(task: &mut Task, device: Device, event: &CentralEvent<P>) {
    if *event == CentralEvent::Connected {
        task.handle_event(now(), Event::Ready(device));
    }
    if let Some(event) = Event::from_central(device, event) {
        task.handle_event(now(), event);
    }
}
