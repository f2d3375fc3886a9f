//! The central controller: the task over three sessions. No sockets and no clock: bytes and times come in.

use std::collections::VecDeque;
use std::time::Duration;

use mmacell_proto::controller::{self, Closing, Controller};
use mmacell_proto::state::Connection;
use mmacell_proto::task::{self, Device, Failure, Output, Step, Task};
use mmacell_proto::{Command, NoPose, PlatformPose, Pose, RobotPose};

use super::cell::{Cell, Which};
use crate::report::Samples;

/// The set-up of the simulated cell.
pub const CONFIG: task::Config = task::Config {
    robot_home: RobotPose::from_units([0, 0, 100_000, 0]),
    platform_home: PlatformPose::ORIGIN,
    camera_1: Some(RobotPose::from_units([-120_000, 0, 60_000, 0])),
    camera_2: Some(RobotPose::from_units([120_000, 0, 60_000, 0])),
    percent: 80,
    ..task::Config::DEFAULT
};

/// The two times of a run: the cell may run faster than the clock on the wall, the protocol's deadlines do not.
#[derive(Debug, Clone, Copy)]
pub struct Now {
    /// By which replies are awaited.
    pub wall: Duration,
    /// By which axes move.
    pub cell: Duration,
}

/// The task, its sessions and what they did.
#[derive(Debug)]
pub struct Central {
    task: Task,
    robot: Session<RobotPose>,
    platform: Session<PlatformPose>,
    periphery: Session<NoPose>,
    /// Orders that wait for their turn on the third connection: the task knows two devices behind it.
    waiting: VecDeque<(Device, Command<NoPose>)>,
    /// Whose order is under way there.
    asked: Option<Device>,
    switch: bool,
    parts: Option<u64>,
    /// What happened.
    pub log: Log,
}

/// What a run did.
#[derive(Debug, Default)]
pub struct Log {
    /// Each step and when it began, in cell time.
    pub steps: Vec<(Duration, Step)>,
    /// Parts that the task believes in their place.
    pub placed: u64,
    /// Faults, and what they were.
    pub faults: Vec<(Device, Failure)>,
    /// Steps 7 that began with the vacuum on.
    pub vacuum_left_on: u64,
    /// Commands that were answered.
    pub exchanges: u64,
    /// Command to reply, on the wall's clock.
    pub turn_around: Samples,
    /// Motions that the devices agreed to: robot, platform.
    pub agreed: [u64; 2],
    /// Motions that they refused.
    pub refused: u64,
    /// Motions whose connection broke before the reply.
    pub unknown: [u64; 2],
    /// Connections that were opened again.
    pub reconnections: u64,
}

#[derive(Debug)]
struct Session<P> {
    controller: Controller<P>,
    sent_at: Duration,
}

impl Central {
    /// A controller that places so many parts; `None`: until told to finish.
    pub fn new(parts: Option<u64>) -> Self {
        Self {
            task: Task::new(CONFIG),
            robot: Session::new(),
            platform: Session::new(),
            periphery: Session::new(),
            waiting: VecDeque::new(),
            asked: None,
            switch: false,
            parts,
            log: Log::default(),
        }
    }

    /// A connection has been opened.
    pub fn connected(&mut self, now: Now, which: Which) {
        match which {
            Which::Robot => self.robot = Session::new(),
            Which::Platform => self.platform = Session::new(),
            Which::Periphery => {
                self.periphery = Session::new();
                (self.asked, self.waiting) = (None, VecDeque::new());
            }
        }
        which
            .devices()
            .iter()
            .for_each(|device| self.task.handle_event(now.cell, task::Event::Ready(*device)));
    }

    /// A connection has ended.
    pub fn disconnected(&mut self, which: Which) {
        match which {
            Which::Robot => self.robot.controller.handle_disconnect(),
            Which::Platform => self.platform.controller.handle_disconnect(),
            Which::Periphery => self.periphery.controller.handle_disconnect(),
        }
    }

    /// Bytes from a device.
    pub fn hear(&mut self, now: Now, which: Which, bytes: &[u8]) {
        match which {
            Which::Robot => self.robot.controller.handle_input(now.wall, bytes),
            Which::Platform => self.platform.controller.handle_input(now.wall, bytes),
            Which::Periphery => self.periphery.controller.handle_input(now.wall, bytes),
        }
    }

    /// Bytes for a device; empty when there are none.
    pub fn say(&mut self, now: Now, which: Which) -> Vec<u8> {
        match which {
            Which::Robot => self.robot.say(now.wall),
            Which::Platform => self.platform.say(now.wall),
            Which::Periphery => self.periphery.say(now.wall),
        }
    }

    /// Does everything that can be done now. The cell is looked at, not touched: its switch, and what its cameras see.
    pub fn run(&mut self, now: Now, cell: &Cell) {
        self.robot.controller.handle_timeout(now.wall);
        self.platform.controller.handle_timeout(now.wall);
        self.periphery.controller.handle_timeout(now.wall);
        self.task.handle_timeout(now.cell);
        loop {
            let switch = cell.parts().switch();
            if core::mem::replace(&mut self.switch, switch) != switch {
                self.task.handle_event(now.cell, task::Event::Switch { high: switch });
            }
            let mut idle = true;
            while let Some(event) = self.robot.controller.poll_event() {
                self.log.note(0, &event, now.wall.saturating_sub(self.robot.sent_at));
                self.tell(now, Device::Robot, &event);
                idle = false;
            }
            while let Some(event) = self.platform.controller.poll_event() {
                self.log.note(1, &event, now.wall.saturating_sub(self.platform.sent_at));
                self.tell(now, Device::Platform, &event);
                idle = false;
            }
            while let Some(event) = self.periphery.controller.poll_event() {
                self.log.note(2, &event, now.wall.saturating_sub(self.periphery.sent_at));
                self.tell_periphery(now, cell, &event);
                idle = false;
            }
            while let Some(output) = self.task.poll_output(now.cell) {
                self.obey(now, cell, output);
                idle = false;
            }
            if self.asked.is_none()
                && let Some((device, command)) = self.waiting.pop_front()
            {
                self.asked = Some(device);
                if self.periphery.controller.send(command).is_err() {
                    self.periphery_lost(now);
                }
                idle = false;
            }
            if idle {
                return;
            }
        }
    }

    /// When to run again, if nothing is heard: on the wall's clock, and on the cell's.
    pub fn due(&self) -> (Option<Duration>, Option<Duration>) {
        let wall = [
            self.robot.controller.poll_timeout(),
            self.platform.controller.poll_timeout(),
            self.periphery.controller.poll_timeout(),
        ];
        (wall.into_iter().flatten().min(), self.task.poll_timeout())
    }

    /// Whether a connection has to be opened again.
    pub fn is_broken(&self, which: Which) -> bool {
        let connection = match which {
            Which::Robot => self.robot.controller.connection(),
            Which::Platform => self.platform.controller.connection(),
            Which::Periphery => self.periphery.controller.connection(),
        };
        connection == Connection::Closed && !matches!(self.task.step(), Step::Closing | Step::Finished)
    }

    /// Where the task is.
    pub fn step(&self) -> Step {
        self.task.step()
    }

    /// No further part after this one.
    pub fn finish(&mut self) {
        self.parts = Some(0);
    }

    fn obey(&mut self, now: Now, cell: &Cell, output: Output) {
        let sent = match output {
            Output::Entered(step) => {
                self.entered(now, cell, step);
                Ok(())
            }
            Output::Robot(command) => self.robot.controller.send(command),
            Output::Platform(command) => self.platform.controller.send(command),
            Output::Conditioning(command) => {
                self.waiting.push_back((Device::Conditioning, command));
                Ok(())
            }
            Output::Acquire { camera } => {
                self.waiting.push_back((Device::Vision, Command::Acquire { camera }));
                Ok(())
            }
            Output::Grip { gripper, open } => {
                self.waiting.push_back((Device::Gripper, Command::Grip { gripper, open }));
                Ok(())
            }
            _ => Ok(()),
        };
        if sent.is_err() {
            let device = if matches!(output, Output::Robot(_)) { Device::Robot } else { Device::Platform };
            self.task.handle_event(now.cell, task::Event::Failed { device, failure: Failure::Lost });
        }
    }

    fn entered(&mut self, now: Now, cell: &Cell, step: Step) {
        self.log.steps.push((now.cell, step));
        let event = match step {
            Step::GoCamera1 => {
                self.log.vacuum_left_on += u64::from(cell.parts().vacuum());
                return;
            }
            Step::Placed => {
                self.log.placed += 1;
                let more = self.parts.is_none_or(|parts| self.log.placed < parts);
                if more { task::Event::Next } else { task::Event::Finish }
            }
            Step::Faulted => {
                self.log.faults.extend(self.task.failure());
                task::Event::Recover
            }
            _ => return,
        };
        self.task.handle_event(now.cell, event);
    }

    fn tell<P: Pose>(&mut self, now: Now, device: Device, event: &controller::Event<P>) {
        if let Some(event) = task::Event::from_controller(device, event) {
            self.task.handle_event(now.cell, event);
        }
    }

    fn tell_periphery(&mut self, now: Now, cell: &Cell, event: &controller::Event<NoPose>) {
        let event = match (event, self.asked.take()) {
            (controller::Event::Done { command: Command::Acquire { camera: 1 } }, _) => {
                let (platform, pick) = cell.parts().part();
                task::Event::PartFound { platform, pick }
            }
            (controller::Event::Done { command: Command::Acquire { .. } }, _) => {
                task::Event::SlotFound { place: cell.parts().place() }
            }
            (controller::Event::Closed { reason: Closing::Agreed, .. }, _) => return,
            (controller::Event::Closed { .. }, _) => return self.periphery_lost(now),
            (event, Some(device)) => return self.tell(now, device, event),
            (_, None) => return,
        };
        self.task.handle_event(now.cell, event);
    }

    fn periphery_lost(&mut self, now: Now) {
        (self.asked, self.waiting) = (None, VecDeque::new());
        for device in Which::Periphery.devices() {
            let event = task::Event::Failed { device: *device, failure: Failure::Lost };
            self.task.handle_event(now.cell, event);
        }
    }
}

impl<P: Pose> Session<P> {
    fn new() -> Self {
        Self { controller: Controller::new(controller::Config::DEFAULT), sent_at: Duration::ZERO }
    }

    fn say(&mut self, now: Duration) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut buffer = [0; 64];
        while let Some(len) = self.controller.poll_transmit(now, &mut buffer) {
            bytes.extend_from_slice(buffer.get(..len).unwrap_or_default());
            self.sent_at = now;
        }
        bytes
    }
}

impl Log {
    fn note<P: Pose>(&mut self, connection: usize, event: &controller::Event<P>, turn_around: Duration) {
        let motions = |counts: &mut [u64; 2], command: &Command<P>| {
            if let (Command::Move { .. }, Some(count)) = (command, counts.get_mut(connection)) {
                *count += 1;
            }
        };
        match event {
            controller::Event::Done { command } => motions(&mut self.agreed, command),
            controller::Event::Refused { command: Command::Move { .. }, .. } => self.refused += 1,
            controller::Event::Closed { unknown, .. } => {
                if let Some(command) = unknown {
                    motions(&mut self.unknown, command);
                }
                return;
            }
            _ => {}
        }
        self.exchanges += 1;
        self.turn_around.add(turn_around);
    }
}
