use core::time::Duration;

use super::channel::{Channel, Flight};
use super::{Device, Event, Failure, Output, Step, Trigger};
use crate::{BLOW, Command, Mode, PlatformPose, RobotPose, VACUUM};

/// Runs the task: events in, orders out.
///
/// 1. Tell it what happens by [`handle_event`](Self::handle_event); [`Event::from_controller`] translates the events of a
///    [`Controller`](crate::Controller). Call [`handle_timeout`](Self::handle_timeout) when the time of
///    [`poll_timeout`](Self::poll_timeout) has come.
/// 2. Carry out what [`poll_output`](Self::poll_output) gives until it gives `None`.
///
/// It gives an order to a device only when the last one to the same device is answered, so each can be sent at once. While it
/// waits for a motion to end it asks for the status every [`Config::poll`]. Up to eight [`Output::Entered`] wait to be polled;
/// then the oldest is dropped.
#[derive(Debug, Clone)]
pub struct Task {
    config: Config,
    step: Step,
    channels: [Channel; 5],
    switch: bool,
    found: Option<bool>,
    part: (PlatformPose, RobotPose),
    place: RobotPose,
    asked: Option<Trigger>,
    failed: bool,
    failure: Option<(Device, Failure)>,
    elapses: Option<Duration>,
    entered: [Option<Step>; 8],
}

/// What the source leaves to the set-up of the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// Home of the robot.
    pub robot_home: RobotPose,
    /// Home of the platform.
    pub platform_home: PlatformPose,
    /// Where the robot makes room for camera 1; `None` where it need not (§6 step 7).
    pub camera_1: Option<RobotPose>,
    /// Where the robot makes room for camera 2; `None` where it need not (§6 step 11).
    pub camera_2: Option<RobotPose>,
    /// Override of robot and platform, 0 to 100 %.
    pub percent: u8,
    /// The length of the blow that frees the part: "a few milliseconds" (§6 step 21). Default: 5 ms.
    pub blow: Duration,
    /// How often a moving device is asked for its status. Default: 20 ms.
    pub poll: Duration,
}

impl Task {
    /// A task at step 1.
    pub fn new(config: Config) -> Self {
        let mut task = Self {
            config,
            step: Step::AwaitDevices,
            channels: [Channel::IDLE; 5],
            switch: false,
            found: None,
            part: (PlatformPose::ORIGIN, RobotPose::ORIGIN),
            place: RobotPose::ORIGIN,
            asked: None,
            failed: false,
            failure: None,
            elapses: None,
            entered: [None; 8],
        };
        task.enter(Duration::ZERO, Step::AwaitDevices);
        task
    }

    /// Something has happened.
    pub fn handle_event(&mut self, now: Duration, event: Event) {
        match event {
            Event::Ready(device) => self.channel(device).ready = true,
            Event::Done(device) => self.channel(device).answered(),
            Event::Status { device, moving } => {
                let poll_at = now.saturating_add(self.config.poll);
                let channel = self.channel(device);
                if channel.flight == Flight::Poll {
                    channel.at_rest = !moving;
                    channel.poll_at = poll_at;
                }
                channel.answered();
            }
            Event::Failed { device, failure } => {
                let channel = self.channel(device);
                channel.answered();
                if failure == Failure::Lost {
                    *channel = Channel::IDLE;
                }
                self.failed = true;
                self.failure = Some((device, failure));
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
            Event::Switch { high } => self.switch = high,
            Event::Next => self.asked = Some(Trigger::Next),
            Event::Finish => self.asked = Some(Trigger::Finish),
            Event::Recover => self.asked = Some(Trigger::Recover),
        }
        self.advance(now);
    }

    /// The time has come that [`poll_timeout`](Self::poll_timeout) gave.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.advance(now);
    }

    /// What is to be done next.
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

    /// When to call [`handle_timeout`](Self::handle_timeout) and [`poll_output`](Self::poll_output) again, if nothing happens.
    pub fn poll_timeout(&self) -> Option<Duration> {
        let polls = self.watched().iter().filter_map(|device| self.poll_at(*device));
        polls.chain(self.elapses).min()
    }

    /// Where the task is.
    pub fn step(&self) -> Step {
        self.step
    }

    /// What brought it to [`Step::Faulted`] last.
    pub fn failure(&self) -> Option<(Device, Failure)> {
        self.failure
    }

    fn advance(&mut self, now: Duration) {
        while let Some((trigger, step)) =
            self.step.transitions().iter().find(|(trigger, _)| self.holds(now, *trigger))
        {
            self.asked = self.asked.filter(|asked| asked != trigger);
            self.enter(now, *step);
        }
        self.failed = false;
    }

    fn holds(&self, now: Duration, trigger: Trigger) -> bool {
        match trigger {
            Trigger::Failed => self.failed,
            Trigger::Finish | Trigger::Next => self.asked == Some(trigger),
            Trigger::Recover => self.asked == Some(trigger) && self.all_ready(),
            Trigger::Low => !self.switch,
            Trigger::High => self.switch,
            Trigger::NotFound => self.found == Some(false),
            Trigger::Found => self.found == Some(true),
            Trigger::Ready => self.all_ready(),
            Trigger::Elapsed => self.elapses.is_some_and(|at| at <= now),
            Trigger::AtRest => {
                let at_rest =
                    |device: &Device| self.channels.get(*device as usize).is_some_and(|c| c.at_rest);
                self.all_answered() && self.watched().iter().all(at_rest)
            }
            Trigger::Answered => self.all_answered(),
        }
    }

    fn enter(&mut self, now: Duration, step: Step) {
        self.step = step;
        self.failed = false;
        self.found = None;
        self.elapses = (step == Step::Blow).then(|| now.saturating_add(self.config.blow));
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
            | Step::CheckGrip
            | Step::AwaitPlace
            | Step::Blow
            | Step::Placed
            | Step::NothingFound
            | Step::Finished => {}
        }
    }

    /// Who is asked, in this step, whether it moves.
    fn watched(&self) -> &'static [Device] {
        match self.step {
            Step::AwaitHome | Step::AwaitCamera2 | Step::Resetting => &[Device::Robot, Device::Platform],
            Step::AwaitCamera1 | Step::AwaitPick | Step::StopAtPart | Step::AwaitPlace | Step::GiveUp => {
                &[Device::Robot]
            }
            _ => &[],
        }
    }

    fn poll_at(&self, device: Device) -> Option<Duration> {
        let channel = self.channels.get(device as usize)?;
        (channel.is_free() && !channel.at_rest).then_some(channel.poll_at)
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

    /// An order to a device that is not there is not given.
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

    fn all_answered(&self) -> bool {
        self.channels.iter().all(|channel| channel.orders[0].is_none() && channel.flight != Flight::Order)
    }

    #[expect(clippy::indexing_slicing, reason = "there is a channel for each of the five devices")]
    fn channel(&mut self, device: Device) -> &mut Channel {
        &mut self.channels[device as usize]
    }
}

impl Config {
    /// Times as documented; no camera needs room, and home is the origin.
    pub const DEFAULT: Self = Self {
        robot_home: RobotPose::ORIGIN,
        platform_home: PlatformPose::ORIGIN,
        camera_1: None,
        camera_2: None,
        percent: 100,
        blow: Duration::from_millis(5),
        poll: Duration::from_millis(20),
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}
