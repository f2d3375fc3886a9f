//! The robot and the orientation platform of the MM&A cell: axes that move at the speed of the override, and motions that fail.

mod axes;

use core::time::Duration;

use mmacell_proto::{
    Device as Session, DeviceClosing, DeviceConfig, DeviceEvent, ErrorCode, Order, PlatformPose, Rejection,
    RobotPose,
};

use self::axes::Axes;
pub use self::axes::Simulated;
use crate::device::{Device, DeviceRecord, Error};
use crate::faults::{Fault, Script};
use crate::settings::Settings;
use crate::simulator::Simulator;

/// The robot's settings.
pub type MmaRobot = Mma<RobotPose>;

/// The platform's settings.
pub type MmaPlatform = Mma<PlatformPose>;

/// The reason for which a device closes the connection.
const CLOSES: &str = "the connection ended by CLO, or by more commands than can be kept";

/// A robot's or a platform's settings.
#[derive(Debug, Clone, Copy)]
pub struct Mma<P> {
    /// The configuration of the session.
    pub config: DeviceConfig,
    /// The factor by which it is faster than a real device: 1 to 10 000.
    pub speed: u32,
    /// The faults of its motions.
    pub faults: MotionFaults,
    /// The period of lost replies: every n-th is lost; 0: none.
    pub mute_every: u64,
    /// The period of disconnections: the connection ends in place of every n-th reply; 0: never.
    pub drop_every: u64,
    /// The pose at first, and after a reset.
    pub home: P,
}

impl<P: Simulated> Default for Mma<P> {
    fn default() -> Self {
        let faults = MotionFaults { refuse_code: 1, ..MotionFaults::default() };
        let home = P::HOME;
        Self { config: DeviceConfig::DEFAULT, speed: 1, faults, mute_every: 0, drop_every: 0, home }
    }
}

/// The periods of faulty motions: every n-th motion is faulty; 0: none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct MotionFaults {
    /// The period of motions that stop half-way with an error of servo motor 1.
    pub fail_every: u64,
    /// The period of motions that stop half-way, unnoticed by the device.
    pub stall_every: u64,
    /// The period of motions that are refused with `refuse_code`.
    pub refuse_every: u64,
    /// The error number of the refusals: any but 0 that fits its field.
    pub refuse_code: i32,
}

impl<P: Simulated> Settings for Mma<P> {
    type Device = MmaDevice<P>;

    fn device(&self) -> Result<MmaDevice<P>, Error> {
        MmaDevice::new(*self)
    }

    fn simulator(&self) -> Result<Simulator<MmaDevice<P>>, Error> {
        let simulator = Simulator::new(self.device()?);
        let script = Script::new().every_answer(self.drop_every, Fault::Close);
        simulator.faults().follow(script.every_answer(self.mute_every, Fault::Drop));
        Ok(simulator)
    }
}

#[cfg(feature = "spec")]
mod spec {
    use robot_session::spec::{Configure, FieldVisitor};

    use super::{Mma, MotionFaults};

    impl<P> Configure for Mma<P> {
        fn configure(&mut self, fields: &mut impl FieldVisitor) {
            let Self { config, speed, faults, mute_every, drop_every, home: _ } = self;
            let about = "how many times faster than real time the axes move";
            fields.whole("speed", 1..=10_000, "times", about, speed);
            faults.configure(fields);
            let about = "every how many replies one is lost; 0: never";
            fields.whole("mute_every", 0..=u64::MAX, "replies", about, mute_every);
            let about = "every how many replies the connection ends instead of one; 0: never";
            fields.whole("drop_every", 0..=u64::MAX, "replies", about, drop_every);
            config.configure(fields);
        }
    }

    impl Configure for MotionFaults {
        fn configure(&mut self, fields: &mut impl FieldVisitor) {
            let Self { fail_every, stall_every, refuse_every, refuse_code } = self;
            let about = "after how many motions one stops half-way with an error of servo motor 1; 0: never";
            fields.whole("fail_every", 0..=u64::MAX, "motions", about, fail_every);
            let about = "after how many motions one stops half-way without an error; 0: never";
            fields.whole("stall_every", 0..=u64::MAX, "motions", about, stall_every);
            let about = "after how many motions one is refused; 0: never";
            fields.whole("refuse_every", 0..=u64::MAX, "motions", about, refuse_every);
            fields.whole("refuse_code", 1..=32767, "", "the error number of that refusal", refuse_code);
        }
    }
}

/// The end of the motion that is under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum MotionOutcome {
    /// The motion ends at its target.
    Arrives,
    /// The motion ends half-way, with an error.
    Fails,
    /// The motion ends half-way, without an error.
    Stalls,
}

/// A motion that has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Motion<P> {
    /// The pose that was commanded.
    pub to: P,
    /// The pose at which it has ended.
    pub at: P,
}

/// An event of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum MmaEvent<P> {
    /// The device moves to this pose.
    Move(P),
    /// The device moves home, after a reset.
    Home,
    /// The servo motors are switched on (true) or off.
    Servo(bool),
    /// The override is this many percent.
    Override(u8),
    /// A motion was refused with this number.
    Refused(ErrorCode),
    /// A command was refused by the protocol.
    Rejected(Rejection),
    /// The connection has ended, for this reason.
    Closed(DeviceClosing),
}

/// A robot or a platform.
#[derive(Debug)]
pub struct MmaDevice<P: Simulated> {
    session: Session<P>,
    settings: Mma<P>,
    axes: Axes<P>,
    /// Motions that were commanded, refused ones included.
    asked: u64,
    motions: u64,
    fate: MotionOutcome,
    /// The goal of the motion that is under way.
    to: Option<P>,
    /// Whether the session has the pose of the axes at rest.
    is_known: bool,
}

impl<P: Simulated> MmaDevice<P> {
    /// Creates a device at home, at rest, with its servo motors off.
    ///
    /// # Errors
    /// The configuration cannot work, or a motion is to be refused with a number that has no form.
    pub fn new(settings: Mma<P>) -> Result<Self, Error> {
        let MotionFaults { refuse_every, refuse_code, .. } = settings.faults;
        if refuse_every > 0 && !ErrorCode::from(refuse_code).has_form(&settings.config.writes) {
            let why =
                format!("refuse_code={refuse_code} is not an error number: not 0, and within its field");
            return Err(Error::settings(why));
        }
        let mut session = Session::new(settings.config).map_err(Error::settings)?;
        session.set_pose(settings.home);
        let axes = Axes::new(settings.home);
        Ok(Self {
            session,
            settings,
            axes,
            asked: 0,
            motions: 0,
            fate: MotionOutcome::Arrives,
            to: None,
            is_known: false,
        })
    }

    /// Returns the pose of the device.
    pub fn pose(&self) -> P {
        self.axes.pose()
    }

    /// Returns whether the device moves.
    pub fn moves(&self) -> bool {
        !self.axes.stand()
    }

    /// Returns the number of motions that it has begun because of `MOV`.
    pub fn motions(&self) -> u64 {
        self.motions
    }

    /// Decides how the motion that is under way ends.
    pub fn end_motion(&mut self, fate: MotionOutcome) {
        self.fate = fate;
    }

    /// Returns the time of the axes, which run at the speed of the settings.
    fn of_axes(&self, now: Duration) -> Duration {
        now.saturating_mul(self.settings.speed)
    }

    /// Ends the motion.
    fn rest(&mut self, at: Duration, notes: &mut DeviceRecord<MmaEvent<P>, Motion<P>>) {
        if let Some(to) = self.to.take() {
            notes.executed(at, Motion { to, at: self.axes.pose() });
        }
        self.fate = MotionOutcome::Arrives;
    }

    fn decide(&mut self, now: Duration, order: Order<P>, notes: &mut DeviceRecord<MmaEvent<P>, Motion<P>>) {
        // A count from 1 is never a multiple of 0.
        let every = u64::is_multiple_of;
        let MotionFaults { fail_every, stall_every, refuse_every, refuse_code } = self.settings.faults;
        if let Order::Move { .. } = order {
            self.asked += 1;
            if every(self.asked, refuse_every) {
                let error = ErrorCode::from(refuse_code);
                // It was checked that the number has a form.
                let _ = self.session.refuse(order, error);
                return notes.event(MmaEvent::Refused(error));
            }
        }
        if self.session.accept(order).is_err() {
            return;
        }
        let axes_now = self.of_axes(now);
        self.is_known = false;
        match order {
            Order::Move { target } => {
                self.motions += 1;
                self.rest(now, notes);
                self.fate = match self.motions {
                    n if every(n, fail_every) => MotionOutcome::Fails,
                    n if every(n, stall_every) => MotionOutcome::Stalls,
                    _ => MotionOutcome::Arrives,
                };
                self.to = Some(target);
                self.axes.go(axes_now, target);
                notes.event(MmaEvent::Move(target));
            }
            Order::Stop => {
                self.axes.stop(axes_now);
                self.rest(now, notes);
            }
            Order::Home => {
                self.rest(now, notes);
                self.to = Some(self.settings.home);
                self.axes.go(axes_now, self.settings.home);
                notes.event(MmaEvent::Home);
            }
            Order::Servo { on } => {
                if !on {
                    self.axes.stop(axes_now);
                    self.rest(now, notes);
                }
                notes.event(MmaEvent::Servo(on));
            }
            Order::Override { percent } => {
                self.axes.set_override(axes_now, percent);
                notes.event(MmaEvent::Override(percent));
            }
            _ => {}
        }
    }
}

impl<P: Simulated> Device for MmaDevice<P> {
    type Session = Session<P>;
    type Event = MmaEvent<P>;
    type Work = Motion<P>;

    fn session(&self) -> &Session<P> {
        &self.session
    }

    fn session_mut(&mut self) -> &mut Session<P> {
        &mut self.session
    }

    fn take(
        &mut self,
        now: Duration,
        event: DeviceEvent<P>,
        notes: &mut DeviceRecord<MmaEvent<P>, Motion<P>>,
    ) {
        match event {
            DeviceEvent::Asked { order } => self.decide(now, order, notes),
            DeviceEvent::Closed { reason } => {
                notes.event(MmaEvent::Closed(reason));
                notes.close(CLOSES);
            }
            DeviceEvent::Rejected { reason } => notes.event(MmaEvent::Rejected(reason)),
            _ => {}
        }
    }

    fn advance(&mut self, now: Duration, notes: &mut DeviceRecord<MmaEvent<P>, Motion<P>>) {
        if self.is_known {
            return;
        }
        let ended = self.due().map_or(now, |at| at.min(now));
        self.axes.advance(self.of_axes(now));
        if self.fate != MotionOutcome::Arrives && self.axes.stop_half_way() {
            if self.fate == MotionOutcome::Fails {
                self.session.fail(ErrorCode::Servo1);
            }
            self.rest(ended, notes);
        }
        self.session.set_pose(self.axes.pose());
        if self.axes.stand() {
            self.rest(ended, notes);
            self.session.arrived();
            self.is_known = true;
        }
    }

    fn due(&self) -> Option<Duration> {
        self.to?;
        let share = if self.fate == MotionOutcome::Arrives { 1.0 } else { 0.5 };
        // Rounded up: the axes are there then.
        Some(self.axes.passes(share)? / self.settings.speed + Duration::from_nanos(1))
    }

    /// Restarts the device: its pose is unchanged, and its servo motors are off.
    fn restart(&mut self, now: Duration) {
        self.axes.stop(self.of_axes(now));
        let pose = self.axes.pose();
        // The same settings have worked before.
        if let Ok(session) = Session::new(self.settings.config) {
            self.session = session;
        }
        self.session.set_pose(pose);
        (self.to, self.fate, self.is_known) = (None, MotionOutcome::Arrives, false);
    }

    /// Ends the motion at its current position, without an error.
    fn forget(&mut self, now: Duration) {
        self.axes.stop(self.of_axes(now));
        (self.to, self.fate, self.is_known) = (None, MotionOutcome::Arrives, false);
    }
}

#[cfg(test)]
mod tests {
    use robot_session::{Session as _, Step, Steps};

    use super::*;
    use crate::SimulatorReport;

    const S: Duration = Duration::from_secs(1);
    const NONE: MotionFaults =
        MotionFaults { fail_every: 0, stall_every: 0, refuse_every: 0, refuse_code: 1 };

    fn robot(faults: MotionFaults) -> Simulator<MmaDevice<RobotPose>> {
        let home = RobotPose::ORIGIN;
        let mut robot = MmaRobot { faults, home, ..MmaRobot::default() }.simulator().unwrap();
        robot.handle_connected(Duration::ZERO);
        robot
    }

    fn reply(robot: &mut Simulator<MmaDevice<RobotPose>>, now: Duration, line: &str) -> String {
        let mut replies = String::new();
        robot.handle_input(now, line.as_bytes());
        let mut steps = Steps::NEW;
        loop {
            match steps.next(robot, now, &mut [0; 64]) {
                Step::Write(bytes) => replies.push_str(core::str::from_utf8(bytes).unwrap()),
                Step::Event(SimulatorReport::Close(why)) => replies.push_str(why),
                Step::Event(_) => {}
                Step::Wait { .. } => return replies,
            }
        }
    }

    #[test]
    fn a_motion_takes_its_time_and_shows_in_the_status() {
        let mut robot = robot(NONE);
        assert_eq!(
            reply(&mut robot, S, "MOVA+250.000+000.000+000.000+00.0000\r\n"),
            "ER+00001\r\n",
            "the servo motors are off"
        );
        assert_eq!(reply(&mut robot, S, "SRVON\r\nMOVA+250.000+000.000+000.000+00.0000\r\n"), "OK\r\nOK\r\n");
        let half = "OKT+125.000+000.000+000.000+00.0000T+00100+00000\r\n";
        assert_eq!(reply(&mut robot, S + S * 3 / 4, "STA\r\n"), half);
        let there = "OKF+250.000+000.000+000.000+00.0000T+00100+00000\r\n";
        assert_eq!(reply(&mut robot, S * 9, "STA\r\n"), there);
        assert_eq!(robot.device().motions(), 1);
        let done = robot.poll_executed().unwrap();
        assert_eq!((done.at, done.work.at), (S + S * 3 / 2 + Duration::from_nanos(1), done.work.to));
    }

    #[test]
    fn every_second_motion_stops_half_way_until_a_reset_brings_it_home() {
        let mut robot = robot(MotionFaults { fail_every: 2, ..NONE });
        reply(&mut robot, S, "SRVON\r\nMOVA+000.000+000.000+000.000+00.0000\r\n");
        reply(&mut robot, S, "MOVA+250.000+000.000+000.000+00.0000\r\n");
        let failed = "OKF+125.000+000.000+000.000+00.0000F+00100+00002\r\n";
        assert_eq!(reply(&mut robot, S * 2, "STA\r\n"), failed);
        assert_eq!(reply(&mut robot, S * 2, "RST\r\n"), "OK\r\n");
        assert_eq!(robot.device().motions(), 2);
        let home = "OKF+000.000+000.000+000.000+00.0000T+00100+00000\r\n";
        assert_eq!(reply(&mut robot, S * 9, "STA\r\n"), home);
        assert_eq!(robot.device().motions(), 2, "what a reset begins is no `MOV`");
    }

    #[test]
    fn a_stop_and_servo_motors_that_are_switched_off_end_a_motion_where_it_is() {
        let half = RobotPose::from_mm_rad(125.0, 0.0, 0.0, 0.0);
        for (command, servo) in [("STP\r\n", 'T'), ("SRVOF\r\n", 'F')] {
            let mut robot = robot(NONE);
            let go = "SRVON\r\nMOVA+250.000+000.000+000.000+00.0000\r\n";
            assert_eq!(reply(&mut robot, S, go), "OK\r\nOK\r\n");
            // The servo motors are on already: the command has no effect.
            assert_eq!(reply(&mut robot, S + S / 2, "SRVON\r\n"), "OK\r\n");
            assert!(robot.device().moves());
            assert_eq!(reply(&mut robot, S + S * 3 / 4, command), "OK\r\n");
            assert!(!robot.device().moves());
            let there = format!("OKF+125.000+000.000+000.000+00.0000{servo}+00100+00000\r\n");
            assert_eq!(reply(&mut robot, S * 9, "STA\r\n"), there);
            let done = robot.poll_executed().unwrap();
            assert_eq!((done.at, done.work.at), (S + S * 3 / 4, half));
        }
    }

    #[test]
    fn a_motion_stalls_or_is_refused_with_any_number() {
        let mut robot =
            robot(MotionFaults { stall_every: 1, refuse_every: 2, refuse_code: -7, fail_every: 0 });
        let go = "MOVA+250.000+000.000+000.000+00.0000\r\n";
        assert_eq!(reply(&mut robot, S, &format!("SRVON\r\n{go}")), "OK\r\nOK\r\n");
        let half = "OKF+125.000+000.000+000.000+00.0000T+00100+00000\r\n";
        assert_eq!(reply(&mut robot, S * 9, "STA\r\n"), half, "at rest, and no error");
        assert_eq!(reply(&mut robot, S * 9, go), "ER-00007\r\n");
        assert_eq!(robot.device().motions(), 1);
        let zero = MotionFaults { refuse_every: 1, refuse_code: 0, ..NONE };
        let error = MmaRobot { faults: zero, ..MmaRobot::default() }.device().unwrap_err();
        assert_eq!(error.to_string(), "refuse_code=0 is not an error number: not 0, and within its field");
    }

    #[test]
    fn a_set_fault_mutes_or_drops_and_clo_closes() {
        let settings = MmaRobot { mute_every: 2, drop_every: 3, ..MmaRobot::default() };
        let mut robot = settings.simulator().unwrap();
        robot.handle_connected(S);
        assert_eq!(reply(&mut robot, S, "STP\r\n"), "OK\r\n");
        assert_eq!(reply(&mut robot, S, "STP\r\n"), "");
        assert_eq!(reply(&mut robot, S, "STP\r\n"), "the set fault: the connection ends before the reply");
        robot.handle_disconnected(S);
        robot.handle_connected(S);
        assert_eq!(reply(&mut robot, S, "STP\r\n"), "", "the fourth");
        assert_eq!(reply(&mut robot, S, "CLO\r\n"), ["OK\r\n", CLOSES].concat());
    }
}
