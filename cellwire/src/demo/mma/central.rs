//! The central controller: the task over three sessions. No sockets and no clock: bytes and times come in.

use std::collections::VecDeque;
use std::time::Duration;

use anyhow::Result;
use mmacell_proto::robot_session::Session as _;
use mmacell_proto::{
    Central as Session, CentralConfig, CentralEvent, CloseReason, Command, NoPose, PlatformPose, Pose,
    RobotPose, Unfinished,
};
use mmacell_task::{Device, Event, Failure, Output, Step, Task, TaskConfig};
use robot_session::{Step as Settled, Steps};

use super::cell::{Cell, CellConnection};
use super::motions::Motions;
use crate::io::samples::Samples;

/// The two times of a run: the cell may run faster than the clock on the wall, the protocol's deadlines do not.
#[derive(Debug, Clone, Copy)]
pub struct RunTimes {
    /// The time of the wall clock, for awaiting replies.
    pub wall: Duration,
    /// The time of the cell, for the motion of axes.
    pub cell: Duration,
}

/// The task, its sessions and their history.
#[derive(Debug)]
pub struct Central {
    task: Task,
    robot: End<RobotPose>,
    platform: End<PlatformPose>,
    periphery: End<NoPose>,
    /// Orders that wait for their turn on the third connection: it leads to two devices of the task.
    waiting: VecDeque<(Device, Command<NoPose>)>,
    /// The device whose command is in progress on the third connection.
    asked: Option<Device>,
    switch: bool,
    parts: Option<u64>,
    /// The log of the run.
    pub log: Log,
}

/// The log of a run.
#[derive(Debug, Default)]
pub struct Log {
    /// Each step and when it began, in cell time.
    pub steps: Vec<(Duration, Step)>,
    /// Parts that the task believes in their place.
    pub placed: u64,
    /// Faults that the task has reported.
    pub faults: u64,
    /// Parts that were missed or lost as often as they may be.
    pub unpicked: u64,
    /// Steps 7 that began with the vacuum on.
    pub vacuum_left_on: u64,
    /// Commands that the devices answered.
    pub exchanges: u64,
    /// Command to reply, on the wall's clock.
    pub turn_around: Samples,
    /// The motions of robot and platform.
    pub motions: [Motions; 2],
    /// Motions that the devices refused.
    pub refused: u64,
    /// Connections that were opened again.
    pub reconnections: u64,
}

#[derive(Debug)]
struct End<P: Pose> {
    session: Session<P>,
    sent_at: Duration,
    outgoing: Vec<u8>,
}

impl Central {
    /// Creates a controller that places this many parts; `None`: until [`finish`](Self::finish). The cell runs `speed` times
    /// faster than the clock on the wall, by which replies take their time.
    ///
    /// # Errors
    /// Never, with the defaults of the protocol.
    pub fn new(parts: Option<u64>, speed: u32, config: TaskConfig, session: CentralConfig) -> Result<Self> {
        let order_timeout = config.order_timeout.saturating_mul(speed);
        let motion_timeout = config.motion_timeout.saturating_mul(speed);
        Ok(Self {
            task: Task::new(TaskConfig { order_timeout, motion_timeout, ..config }),
            robot: End::new(session)?,
            platform: End::new(session)?,
            periphery: End::new(session)?,
            waiting: VecDeque::new(),
            asked: None,
            switch: false,
            parts,
            log: Log::default(),
        })
    }

    /// Called when a connection was opened.
    pub fn connected(&mut self, now: RunTimes, which: CellConnection) {
        match which {
            CellConnection::Robot => self.robot.connect(now.wall),
            CellConnection::Platform => self.platform.connect(now.wall),
            CellConnection::Periphery => self.periphery.connect(now.wall),
        }
    }

    /// Called when a connection has ended.
    pub fn disconnected(&mut self, now: RunTimes, which: CellConnection) {
        match which {
            CellConnection::Robot => self.robot.session.handle_disconnected(now.wall),
            CellConnection::Platform => self.platform.session.handle_disconnected(now.wall),
            CellConnection::Periphery => self.periphery.session.handle_disconnected(now.wall),
        }
    }

    /// Called when bytes of a device have arrived.
    pub fn receive(&mut self, now: RunTimes, which: CellConnection, bytes: &[u8]) {
        match which {
            CellConnection::Robot => self.robot.session.handle_input(now.wall, bytes),
            CellConnection::Platform => self.platform.session.handle_input(now.wall, bytes),
            CellConnection::Periphery => self.periphery.session.handle_input(now.wall, bytes),
        }
    }

    /// Returns the bytes for a device; empty if there are no bytes to send.
    pub fn transmit(&mut self, which: CellConnection) -> Vec<u8> {
        core::mem::take(match which {
            CellConnection::Robot => &mut self.robot.outgoing,
            CellConnection::Platform => &mut self.platform.outgoing,
            CellConnection::Periphery => &mut self.periphery.outgoing,
        })
    }

    /// Does everything that can be done now. It only reads the cell: its switch, and the results of its cameras.
    pub fn run(&mut self, now: RunTimes, cell: &Cell) {
        self.robot.session.handle_timeout(now.wall);
        self.platform.session.handle_timeout(now.wall);
        self.periphery.session.handle_timeout(now.wall);
        self.task.handle_timeout(now.cell);
        loop {
            let switch = cell.parts().switch();
            if core::mem::replace(&mut self.switch, switch) != switch {
                self.task.handle_event(now.cell, Event::Switch { high: switch });
            }
            let mut idle = true;
            for (event, turn_around) in self.robot.settle(now.wall) {
                self.log.note(Some((0, cell.robot().motions())), &event, turn_around);
                self.report(now, CellConnection::Robot, Device::Robot, &event);
                idle = false;
            }
            for (event, turn_around) in self.platform.settle(now.wall) {
                self.log.note(Some((1, cell.platform().motions())), &event, turn_around);
                self.report(now, CellConnection::Platform, Device::Platform, &event);
                idle = false;
            }
            for (event, turn_around) in self.periphery.settle(now.wall) {
                self.log.note(None, &event, turn_around);
                self.report_periphery(now, cell, &event);
                idle = false;
            }
            while let Some(output) = self.task.poll_output(now.cell) {
                self.carry_out(now, cell, output);
                idle = false;
            }
            if self.asked.is_none()
                && let Some((device, command)) = self.waiting.pop_front()
            {
                self.asked = Some(device);
                if self.periphery.session.request(command).is_err() {
                    self.periphery_lost(now);
                }
                idle = false;
            }
            if idle {
                return;
            }
        }
    }

    /// Returns the time at which to run again, if no bytes arrive: on the wall clock, and on the cell's clock.
    pub fn due(&self) -> (Option<Duration>, Option<Duration>) {
        let wall = [
            self.robot.session.poll_timeout(),
            self.platform.session.poll_timeout(),
            self.periphery.session.poll_timeout(),
        ];
        (wall.into_iter().flatten().min(), self.task.poll_timeout())
    }

    /// Returns whether a connection must be opened again.
    pub fn is_broken(&self, which: CellConnection) -> bool {
        let connected = match which {
            CellConnection::Robot => self.robot.session.is_connected(),
            CellConnection::Platform => self.platform.session.is_connected(),
            CellConnection::Periphery => self.periphery.session.is_connected(),
        };
        !connected && !matches!(self.task.step(), Step::Closing | Step::Finished)
    }

    /// Returns the step of the task.
    pub fn step(&self) -> Step {
        self.task.step()
    }

    /// Ends after this part.
    pub fn finish(&mut self) {
        self.parts = Some(0);
    }

    fn carry_out(&mut self, now: RunTimes, cell: &Cell, output: Output) {
        let sent = match output {
            Output::Entered(step) => {
                self.entered(now, cell, step);
                Ok(())
            }
            Output::Robot(command) => self.robot.session.request(command),
            Output::Platform(command) => self.platform.session.request(command),
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
            self.task.handle_event(now.cell, Event::Failed { device, failure: Failure::Lost });
        }
    }

    fn entered(&mut self, now: RunTimes, cell: &Cell, step: Step) {
        self.log.steps.push((now.cell, step));
        let event = match step {
            Step::GoCamera1 => {
                self.log.vacuum_left_on += u64::from(cell.parts().vacuum());
                return;
            }
            Step::Placed => {
                self.log.placed += 1;
                let more = self.parts.is_none_or(|parts| self.log.placed < parts);
                if more { Event::Next } else { Event::Finish }
            }
            Step::Unpicked => {
                self.log.unpicked += 1;
                Event::Next
            }
            Step::Faulted => {
                self.log.faults += u64::from(self.task.fault().is_some());
                Event::Recover
            }
            _ => return,
        };
        self.task.handle_event(now.cell, event);
    }

    fn report<P: Pose>(
        &mut self,
        now: RunTimes,
        which: CellConnection,
        device: Device,
        event: &CentralEvent<P>,
    ) {
        if *event == CentralEvent::Connected {
            which.devices().iter().for_each(|device| self.task.handle_event(now.cell, Event::Ready(*device)));
        }
        if let Some(event) = Event::from_central(device, event) {
            self.task.handle_event(now.cell, event);
        }
    }

    fn report_periphery(&mut self, now: RunTimes, cell: &Cell, event: &CentralEvent<NoPose>) {
        if *event == CentralEvent::Connected {
            return self.report(now, CellConnection::Periphery, Device::Conditioning, event);
        }
        let event = match (event, self.asked.take()) {
            (CentralEvent::Done { command: Command::Acquire { camera: 1 } }, _) => {
                let (platform, pick) = cell.parts().part();
                Event::PartFound { platform, pick }
            }
            (CentralEvent::Done { command: Command::Acquire { .. } }, _) => {
                Event::SlotFound { place: cell.parts().place() }
            }
            (CentralEvent::Closed { reason, .. }, _) if *reason != CloseReason::Agreed => {
                return self.periphery_lost(now);
            }
            (event, Some(device)) => return self.report(now, CellConnection::Periphery, device, event),
            (_, None) => return,
        };
        self.task.handle_event(now.cell, event);
    }

    fn periphery_lost(&mut self, now: RunTimes) {
        (self.asked, self.waiting) = (None, VecDeque::new());
        for device in CellConnection::Periphery.devices() {
            let event = Event::Failed { device: *device, failure: Failure::Lost };
            self.task.handle_event(now.cell, event);
        }
    }
}

impl<P: Pose> End<P> {
    fn new(config: CentralConfig) -> Result<Self> {
        Ok(Self { session: Session::new(config)?, sent_at: Duration::ZERO, outgoing: Vec::new() })
    }

    fn connect(&mut self, now: Duration) {
        self.outgoing.clear();
        self.session.handle_connected(now);
    }

    /// Returns the events, each with the time since the last command; moves the bytes to send to `outgoing`.
    fn settle(&mut self, now: Duration) -> Vec<(CentralEvent<P>, Duration)> {
        let Self { session, sent_at, outgoing } = self;
        let (mut events, mut buffer) = (Vec::new(), [0; 64]);
        let mut steps = Steps::NEW;
        loop {
            match steps.next(session, now, &mut buffer) {
                Settled::Event(event) => events.push((event, now.saturating_sub(*sent_at))),
                Settled::Write(bytes) => {
                    outgoing.extend_from_slice(bytes);
                    *sent_at = now;
                }
                Settled::Wait { .. } => return events,
            }
        }
    }
}

impl Log {
    /// Notes an event; `begun`: the device, and how many motions it has begun.
    fn note<P: Pose>(&mut self, begun: Option<(usize, u64)>, event: &CentralEvent<P>, turn_around: Duration) {
        let motions = begun.and_then(|(device, begun)| Some((self.motions.get_mut(device)?, begun)));
        match event {
            CentralEvent::Done { command: Command::Move { .. } } => {
                if let Some((motions, begun)) = motions {
                    motions.agree(begun);
                }
            }
            CentralEvent::Refused { command: Command::Move { .. }, .. } => self.refused += 1,
            CentralEvent::Closed { reason, unfinished } => {
                if let (Unfinished::Unknown(Command::Move { .. }), Some((motions, _))) = (unfinished, motions)
                {
                    motions.lose_reply();
                }
                if *reason != CloseReason::Agreed {
                    return;
                }
            }
            CentralEvent::Connected => return,
            _ => {}
        }
        self.exchanges += 1;
        self.turn_around.add(turn_around);
    }
}
