use core::time::Duration;

use mmacell_proto::{BLOW, Command, Mode, PlatformPose, RobotPose, VACUUM};

use crate::channel::{Channel, Flight};
use crate::config::TaskConfig;
use crate::event::{Event, Failure, Fault};
use crate::output::{Device, Output};
use crate::step::{Step, Trigger, Wait};

/// Runs the task: events in, orders out.
///
/// 1. Report events by [`handle_event`](Self::handle_event); [`Event::from_central`] translates the events of a
///    [`Central`](mmacell_proto::Central). Call [`handle_timeout`](Self::handle_timeout) when the time of
///    [`poll_timeout`](Self::poll_timeout) has come.
/// 2. Execute the outputs of [`poll_output`](Self::poll_output) until it returns `None`.
///
/// The task gives an order to a device only when the last one to the same device is answered, so each can be sent at once.
/// While it waits for the end of a motion, it requests the status every [`TaskConfig::poll`], and continues when the device
/// has [arrived](mmacell_proto::Progress::Arrived): a device that is at rest elsewhere has failed. Up to eight
/// [`Output::Entered`] wait to be polled; then the oldest is dropped.
#[derive(Debug, Clone)]
pub struct Task {
    config: TaskConfig,
    step: Step,
    channels: [Channel; 5],
    switch: bool,
    /// The switch has gone high since the vacuum was ordered on.
    risen: bool,
    /// Whether the switch has gone low since the robot was sent to the place.
    fallen: bool,
    /// Picks of this part that have failed.
    attempts: u32,
    found: Option<bool>,
    part: (PlatformPose, RobotPose),
    place: RobotPose,
    asked: Option<Trigger>,
    failed: bool,
    fault: Option<Fault>,
    /// The time at which a dwell time ends.
    elapses: Option<Duration>,
    /// The time at which the step has taken too long.
    overdue: Option<Duration>,
    entered: [Option<Step>; 8],
}

impl Task {
    /// Creates a task at step 1.
    pub fn new(config: TaskConfig) -> Self {
        let mut task = Self {
            config,
            step: Step::AwaitDevices,
            channels: [Channel::IDLE; 5],
            switch: false,
            risen: false,
            fallen: false,
            attempts: 0,
            found: None,
            part: (PlatformPose::ORIGIN, RobotPose::ORIGIN),
            place: RobotPose::ORIGIN,
            asked: None,
            failed: false,
            fault: None,
            elapses: None,
            overdue: None,
            entered: [None; 8],
        };
        task.enter(Duration::ZERO, Step::AwaitDevices);
        task
    }

    /// Called when an event has come.
    pub fn handle_event(&mut self, now: Duration, event: Event) {
        match event {
            Event::Ready(device) => self.channel(device).ready = true,
            Event::Done(device) => self.channel(device).answered(),
            Event::Status { device, motion } => {
                let poll_at = now.saturating_add(self.config.poll);
                let channel = self.channel(device);
                let is_poll = channel.flight == Flight::Poll;
                channel.answered();
                if is_poll {
                    channel.poll_at = poll_at;
                    if let Err(failure) = channel.observe(motion) {
                        self.fail(Fault::Device { device, failure });
                    }
                }
            }
            Event::Failed { device, failure } => {
                let channel = self.channel(device);
                channel.answered();
                if failure == Failure::Lost {
                    *channel = Channel::IDLE;
                }
                self.fail(Fault::Device { device, failure });
            }
            Event::PartFound { platform, pick } => {
                if self.seen(Step::FindPart, true) {
                    self.part = (platform, pick);
                }
            }
            Event::SlotFound { place } => {
                if self.seen(Step::FindSlot, true) {
                    self.place = place;
                }
            }
            Event::NotFound => {
                self.seen(self.step, false);
            }
            Event::Switch { high } => {
                self.risen |= high && !self.switch;
                self.fallen |= !high && self.switch;
                self.switch = high;
            }
            Event::Abort => self.fail(Fault::Aborted),
            Event::Next => self.asked = Some(Trigger::Next),
            Event::Finish => self.asked = Some(Trigger::Finish),
            Event::Recover => self.asked = Some(Trigger::Recover),
        }
        self.advance(now);
    }

    /// Called when the time that [`poll_timeout`](Self::poll_timeout) returned has come.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.advance(now);
    }

    /// Returns the next output.
    pub fn poll_output(&mut self, now: Duration) -> Option<Output> {
        if let [Some(step), ..] = self.entered {
            self.entered.rotate_left(1);
            if let Some(last) = self.entered.last_mut() {
                *last = None;
            }
            return Some(Output::Entered(step));
        }
        if let Some(order) = self.channels.iter_mut().find_map(Channel::take_order) {
            return Some(order);
        }
        let device =
            *self.watched().iter().find(|device| self.poll_at(**device).is_some_and(|at| at <= now))?;
        self.channel(device).flight = Flight::Poll;
        Some(match device {
            Device::Platform => Output::Platform(Command::Status),
            _ => Output::Robot(Command::Status),
        })
    }

    /// Returns the time of the next call of [`handle_timeout`](Self::handle_timeout) and
    /// [`poll_output`](Self::poll_output), if nothing happens before.
    pub fn poll_timeout(&self) -> Option<Duration> {
        let polls = self.watched().iter().filter_map(|device| self.poll_at(*device));
        polls.chain(self.elapses).chain(self.overdue).min()
    }

    /// Returns the current step of the task.
    pub fn step(&self) -> Step {
        self.step
    }

    /// Returns the fault that led to the last [`Step::Faulted`].
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    fn fail(&mut self, fault: Fault) {
        self.failed = true;
        if self.step.next(Trigger::Failed).is_some() {
            self.fault = Some(fault);
        }
    }

    fn advance(&mut self, now: Duration) {
        while let Some((trigger, step)) =
            self.step.transitions().iter().find(|(trigger, _)| self.holds(now, *trigger))
        {
            self.asked = self.asked.filter(|asked| asked != trigger);
            match (trigger, self.step) {
                (Trigger::High, Step::GoPick) | (Trigger::TimedOut, Step::CheckReleased) => {
                    self.fault = Some(Fault::SwitchHigh { step: self.step });
                }
                (Trigger::TimedOut, step) => {
                    self.fault = Some(Fault::Timeout { step });
                    // Only this ends these: a connection's session ends the others.
                    self.channel(Device::Vision).answered();
                    self.channel(Device::Gripper).answered();
                }
                _ => {}
            }
            self.enter(now, *step);
        }
        self.failed = false;
    }

    fn holds(&self, now: Duration, trigger: Trigger) -> bool {
        match trigger {
            Trigger::Failed => self.failed,
            // The devices are stopped first.
            Trigger::Finish if self.step == Step::Faulted => {
                self.asked == Some(trigger) && self.all_stopped()
            }
            Trigger::Finish | Trigger::Next => self.asked == Some(trigger),
            Trigger::Recover => self.asked == Some(trigger) && self.all_ready(),
            Trigger::Low => !self.switch,
            Trigger::High => self.switch,
            Trigger::Risen => self.risen,
            Trigger::Fallen => self.fallen,
            Trigger::NotFound => self.found == Some(false),
            Trigger::Found => self.found == Some(true),
            Trigger::Ready => self.all_ready(),
            Trigger::Elapsed => self.elapses.is_some_and(|at| at <= now),
            Trigger::TimedOut => self.overdue.is_some_and(|at| at <= now),
            Trigger::AtRest => self.all_at_rest(),
            Trigger::Exhausted => self.all_at_rest() && self.attempts >= self.config.attempts,
            Trigger::Answered => self.all_answered(),
        }
    }

    fn enter(&mut self, now: Duration, step: Step) {
        self.step = step;
        self.failed = false;
        self.found = None;
        let dwell = match step {
            Step::GripDwell => Some(self.config.grip_dwell),
            Step::PlaceDwell => Some(self.config.place_dwell),
            Step::Blow => Some(self.config.blow),
            _ => None,
        };
        self.elapses = dwell.map(|dwell| now.saturating_add(dwell));
        let limit = match step.waits_for() {
            Wait::Caller | Wait::Time => None,
            Wait::Devices => Some(self.config.ready_timeout),
            Wait::Replies => Some(self.config.order_timeout),
            Wait::Motion => Some(self.config.motion_timeout),
        };
        // `Duration::MAX` means no timeout.
        self.overdue = limit.and_then(|limit| now.checked_add(limit)).filter(|at| *at < Duration::MAX);
        match step {
            Step::VacuumOn => self.risen = false,
            Step::GoPlace => self.fallen = false,
            Step::GiveUp => self.attempts = self.attempts.saturating_add(1),
            Step::Placed | Step::Unpicked | Step::NothingFound | Step::Resetting => self.attempts = 0,
            _ => {}
        }
        for channel in &mut self.channels {
            channel.begin_step(now);
        }
        self.note(step);
        self.give_orders(step);
    }

    fn give_orders(&mut self, step: Step) {
        let to = |pose| Command::Move { mode: Mode::Absolute, pose };
        let turn = |pose| Command::Move { mode: Mode::Absolute, pose };
        match step {
            Step::ServosOn => self.order_both(Command::Servo { on: true }, Command::Servo { on: true }),
            Step::SetOverride => {
                let percent = self.config.percent;
                self.order_both(Command::Override { percent }, Command::Override { percent });
            }
            Step::GoHome => self.order_both(to(self.config.robot_home), turn(self.config.platform_home)),
            Step::GoCamera1 => self.config.camera_1.into_iter().for_each(|pose| self.order_robot(to(pose))),
            Step::FindPart => self.order(Device::Vision, Output::Acquire { camera: 1 }),
            Step::TurnPlatform => self.order(Device::Platform, Output::Platform(turn(self.part.0))),
            Step::GoCamera2 => self.config.camera_2.into_iter().for_each(|pose| self.order_robot(to(pose))),
            Step::FindSlot => self.order(Device::Vision, Output::Acquire { camera: 2 }),
            Step::GoPick => self.order_robot(to(self.part.1)),
            Step::VacuumOn => self.grip(VACUUM, true),
            Step::StopAtPart => self.order_robot(Command::Stop),
            Step::GoPlace => self.order_robot(to(self.place)),
            Step::GiveUp => {
                self.order_robot(Command::Stop);
                self.grip(VACUUM, false);
            }
            Step::Release => {
                self.grip(VACUUM, false);
                self.grip(BLOW, true);
            }
            Step::BlowOff => self.grip(BLOW, false),
            Step::Faulted | Step::Resetting => {
                if step == Step::Faulted {
                    self.order_both(Command::Stop, Command::Stop);
                } else {
                    self.order_both(Command::Reset, Command::Reset);
                }
                self.grip(VACUUM, false);
                self.grip(BLOW, false);
            }
            Step::Closing => {
                self.order_both(Command::Close, Command::Close);
                self.order(Device::Conditioning, Output::Conditioning(Command::Close));
            }
            Step::AwaitDevices
            | Step::DevicesReady
            | Step::AwaitHome
            | Step::AwaitCamera1
            | Step::AwaitCamera2
            | Step::AwaitPick
            | Step::GripDwell
            | Step::CheckGrip
            | Step::AwaitPlace
            | Step::PlaceDwell
            | Step::Blow
            | Step::CheckReleased
            | Step::Placed
            | Step::Unpicked
            | Step::NothingFound
            | Step::Finished => {}
        }
    }

    /// Returns the devices that are polled in this step for whether they move.
    fn watched(&self) -> &'static [Device] {
        match self.step {
            Step::AwaitHome | Step::AwaitCamera2 | Step::Resetting => &[Device::Robot, Device::Platform],
            Step::AwaitCamera1 | Step::AwaitPick | Step::StopAtPart | Step::AwaitPlace | Step::GiveUp => {
                &[Device::Robot]
            }
            Step::Faulted if self.asked == Some(Trigger::Finish) => &[Device::Robot, Device::Platform],
            _ => &[],
        }
    }

    fn poll_at(&self, device: Device) -> Option<Duration> {
        let channel = self.channels.get(device as usize)?;
        (channel.ready && channel.is_free() && !channel.at_rest).then_some(channel.poll_at)
    }

    fn seen(&mut self, step: Step, found: bool) -> bool {
        let channel = self.channel(Device::Vision);
        let wanted = channel.flight == Flight::Order;
        channel.answered();
        let wanted = wanted && step == self.step && matches!(step, Step::FindPart | Step::FindSlot);
        if wanted {
            self.found = Some(found);
        }
        wanted
    }

    fn order_both(&mut self, robot: Command<RobotPose>, platform: Command<PlatformPose>) {
        self.order_robot(robot);
        self.order(Device::Platform, Output::Platform(platform));
    }

    fn order_robot(&mut self, command: Command<RobotPose>) {
        self.order(Device::Robot, Output::Robot(command));
    }

    fn grip(&mut self, gripper: i32, open: bool) {
        self.order(Device::Gripper, Output::Grip { gripper, open });
    }

    /// Gives an order to a device, unless the device is absent.
    fn order(&mut self, device: Device, order: Output) {
        let networked = matches!(device, Device::Robot | Device::Platform | Device::Conditioning);
        let channel = self.channel(device);
        if (!networked || channel.ready)
            && let Some(free) = channel.orders.iter_mut().find(|order| order.is_none())
        {
            *free = Some(order);
        }
    }

    fn note(&mut self, step: Step) {
        if self.entered.last().is_some_and(Option::is_some) {
            self.entered.rotate_left(1);
            self.entered.last_mut().into_iter().for_each(|last| *last = None);
        }
        if let Some(free) = self.entered.iter_mut().find(|entered| entered.is_none()) {
            *free = Some(step);
        }
    }

    fn all_ready(&self) -> bool {
        let [robot, platform, conditioning, ..] = &self.channels;
        robot.ready && platform.ready && conditioning.ready
    }

    fn all_at_rest(&self) -> bool {
        let at_rest = |device: &Device| self.channels.get(*device as usize).is_some_and(|c| c.at_rest);
        self.all_answered() && self.watched().iter().all(at_rest)
    }

    /// Returns whether the orders are answered, and all present devices are at rest, in any position.
    fn all_stopped(&self) -> bool {
        let [robot, platform, ..] = &self.channels;
        self.all_answered() && [robot, platform].iter().all(|device| !device.ready || device.at_rest)
    }

    fn all_answered(&self) -> bool {
        self.channels.iter().all(|channel| channel.orders[0].is_none() && channel.flight != Flight::Order)
    }

    #[expect(clippy::indexing_slicing, reason = "there is a channel for each of the five devices")]
    fn channel(&mut self, device: Device) -> &mut Channel {
        &mut self.channels[device as usize]
    }
}
