//! The state of the operator's screen, and the handling of keys.

use std::collections::VecDeque;
use std::time::Duration;

use cellwire_motion::latch::{Cause, Latch};
use isra_ball::Packet;
use robot_session::EchoError;
use val2_alter::{
    AXES, End, ErrorCode, ExceptionOutcome, HostConfig, HostState, Mode, Motion, Policy, SegmentStatus,
    Start, timing,
};

use crate::alter::input::{InputConfig, Sample};
use crate::alter::window::{advice, axes_that_fit};
use crate::alter::{Notification, PortConfig, Profile, Traces, lost_text};
use crate::devices::val2_alter::puma::error_text;
use crate::io::samples::Samples;
use cellwire_io::trace::Trace;

const MESSAGES: usize = 200;
/// Corrupt bytes are messages so far apart at least.
const DAMAGE: Duration = Duration::from_secs(1);
/// ALTER that ends after fewer replies has ended soon.
const SHORT_ALTER_CYCLES: u64 = 100;

/// The ports, for the operator to read.
pub(super) struct Ports {
    pub(super) robot: PortConfig,
    pub(super) input: InputConfig,
    pub(super) viewer: Option<PortConfig>,
}

/// The contents of the lower part of the screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum View {
    Main,
    Options,
    /// The meaning of the keys.
    Keys,
    /// The last bytes of a line: robot, ball or viewer.
    Debug(usize),
}

#[derive(Default)]
pub(super) struct Counts {
    pub(super) cycles: u64,
    pub(super) missed: u64,
    /// Replies that the robot could not read, by error code.
    pub(super) rejected: [u64; 8],
    /// Replies in which an axis had to wait.
    pub(super) held: u64,
    pub(super) corrupt: u64,
    /// Messages that were read later than is assumed.
    pub(super) delayed: u64,
    pub(super) packets: u64,
    pub(super) ball_missed: u64,
    pub(super) ball_corrupt: u64,
    /// The number of the ball's packets that were not a reply.
    pub(super) ball_late: u64,
    pub(super) asked: u64,
    pub(super) poses: u64,
}

pub(super) struct Model {
    pub(super) ports: Ports,
    pub(super) traces: Traces,
    pub(super) view: View,
    pub(super) state: HostState,
    pub(super) latch: Latch,
    /// The mode that is accepted.
    pub(super) mode: Mode,
    /// The axes that fit a reply.
    pub(super) axes: usize,
    /// The advice if not all axes fit.
    pub(super) advice: Option<String>,
    /// The mode of a start that was refused last, unless ALTER has begun since.
    pub(super) refused: Option<Mode>,
    /// The reason why the robot is lost.
    pub(super) lost: Option<&'static str>,
    pub(super) policy: Policy,
    pub(super) clamp: bool,
    pub(super) start: Option<Start>,
    pub(super) motion: Option<Motion>,
    motion_at: Duration,
    /// The control byte that came last, in words.
    pub(super) control: (&'static str, u8, &'static str),
    pub(super) ball: Option<Packet>,
    pub(super) hand: Option<Sample>,
    pub(super) profile: Profile,
    pub(super) exchange: Duration,
    pub(super) ball_is_stale: bool,
    /// The workstation holds its line.
    pub(super) viewer_holds: bool,
    pub(super) demand: [i16; AXES],
    pub(super) values: [i16; AXES],
    pub(super) thinking: Samples,
    pub(super) counts: Counts,
    pub(super) messages: VecDeque<(Duration, String)>,
    pub(super) drawn: u64,
    pub(super) tests: Vec<Test>,
    damage_said: Duration,
    ball_late_at: Option<Duration>,
    has_ended: bool,
    late_ends: LateEnds,
    pub(super) now: Duration,
}

/// Ends of ALTER by a timeout of the robot, although the replies left in time.
#[derive(Default)]
struct LateEnds {
    /// The ends in a row.
    count: u32,
    /// The replies, and the late ones, at the last end.
    cycles: u64,
    missed: u64,
}

/// A test that runs, and the counts at its beginning.
pub(super) struct Test {
    pub(super) what: &'static str,
    pub(super) until: Duration,
    pub(super) packets: u64,
    pub(super) missed: u64,
    pub(super) corrupt: u64,
    pub(super) asked: u64,
    pub(super) poses: u64,
}

impl Test {
    fn result(&self, counts: &Counts) -> String {
        match self.what {
            "ball" => format!(
                "ball: {} packets, {} missed, {} corrupt",
                counts.packets - self.packets,
                counts.ball_missed - self.missed,
                counts.ball_corrupt - self.corrupt
            ),
            what => format!(
                "{what}: asked {}, got {} poses",
                counts.asked - self.asked,
                counts.poses - self.poses
            ),
        }
    }
}

impl Model {
    pub(super) fn new(ports: Ports, traces: Traces, alter: &HostConfig, profile: Profile) -> Self {
        Self {
            ports,
            traces,
            view: View::Main,
            state: HostState::Idle,
            latch: Latch::NEW,
            mode: alter.mode,
            axes: axes_that_fit(alter),
            advice: advice(alter),
            refused: None,
            lost: None,
            policy: Policy::Ignore,
            clamp: alter.subroutine,
            start: None,
            motion: None,
            motion_at: Duration::ZERO,
            control: ("–", 0, "–"),
            ball: None,
            hand: None,
            profile,
            exchange: Duration::ZERO,
            ball_is_stale: false,
            viewer_holds: false,
            demand: [0; AXES],
            values: [0; AXES],
            thinking: Samples::default(),
            counts: Counts::default(),
            messages: VecDeque::new(),
            drawn: 0,
            tests: Vec::new(),
            damage_said: Duration::ZERO,
            ball_late_at: None,
            has_ended: false,
            late_ends: LateEnds::default(),
            now: Duration::ZERO,
        }
    }

    /// Handles a report of the host.
    pub(super) fn take(&mut self, at: Duration, notification: Notification) {
        self.now = self.now.max(at);
        match notification {
            Notification::PortOpen(name, path) => self.show(format!("{name}: {path} opened")),
            Notification::SlowAdapter(name, advice) => self.show(format!("{name}: {advice}")),
            Notification::PortLost(name, why) => {
                if name == "robot" {
                    self.lost = Some("its port is gone");
                }
                self.show(format!("{name}: {why}"));
            }
            Notification::Priority(true) => self.show("replies at real-time priority".into()),
            Notification::Priority(false) => {
                self.show("replies at normal priority: no permission for more".into())
            }
            Notification::Start(start) => {
                self.control = ("starting", start.control(), error_text(start.error));
                self.take_start(start);
            }
            Notification::Motion(motion) => {
                let phase = match motion.phase {
                    val2_alter::MotionPhase::Running => "running",
                    val2_alter::MotionPhase::Interrupted => "interrupted",
                };
                self.control = (phase, motion.control(), error_text(motion.error));
                (self.motion, self.motion_at, self.lost) = (Some(motion), at, None);
            }
            Notification::Reply { demand, values, thinking, held } => {
                (self.demand, self.values) = (demand, values);
                self.thinking.add(thinking);
                self.counts.cycles += 1;
                if held {
                    self.take_held();
                }
            }
            Notification::End(end) => {
                self.control = ("ended", end.control(), error_text(end.error));
                self.values = [0; AXES];
                self.show(format!("the robot ended ALTER: {}", error_text(end.error)));
                self.take_end(end);
            }
            Notification::Delayed => {
                self.counts.delayed += 1;
                self.say_damage("robot: a message came later than max_delay".into());
            }
            Notification::Missed => {
                self.values = [0; AXES];
                self.counts.missed += 1;
                self.show("a reply was too late".into());
            }
            Notification::Rejected(code) => {
                self.values = [0; AXES];
                if let Some(count) = self.counts.rejected.get_mut(usize::from(u8::from(code) & 7)) {
                    *count += 1;
                }
                self.show(format!("reply not read: {}", error_text(code)));
            }
            Notification::Corrupt(error) => {
                self.counts.corrupt += 1;
                self.say_damage(format!("robot: {error}"));
            }
            Notification::Lost(reason) => {
                self.values = [0; AXES];
                self.lost = Some(lost_text(reason));
                self.show(lost_text(reason).into());
            }
            Notification::Latch(latch) => self.take_latch(latch),
            Notification::Ended => self.has_ended = true,
            Notification::Stopped => self.show("at rest; no reply any more".into()),
            Notification::State(state) => self.state = state,
            Notification::Gripper(exception, Ok(())) => {
                self.show(format!("gripper: exception {}", u8::from(exception)))
            }
            Notification::Gripper(_, Err(error)) => self.show(format!("gripper: {error}")),
            Notification::GripperOutcome(exception, outcome) => {
                let outcome = match outcome {
                    ExceptionOutcome::Done => "done",
                    ExceptionOutcome::NotDone => "not done",
                    ExceptionOutcome::Unknown(_) => "unknown",
                };
                self.show(format!("gripper: exception {}: {outcome}", u8::from(exception)));
            }
            Notification::Hand(sample) => self.hand = Some(sample),
            Notification::Ball(packet, took) => {
                self.ball_is_stale = false;
                self.show_ball(packet, took);
            }
            Notification::BallOld(packet, took) => self.show_ball(packet, took),
            Notification::BallLate => {
                self.counts.ball_late += 1;
                self.ball_late_at = Some(at);
                self.say_damage("ball: it answers late, and no packet counts".into());
            }
            Notification::BallMissed => self.counts.ball_missed += 1,
            Notification::BallCorrupt(error) => {
                self.counts.ball_corrupt += 1;
                self.say_damage(format!("ball: {error}"));
            }
            Notification::Echo("robot", EchoError::NotSet { .. }) => self.show(
                "robot: the line returns what is sent: ALTER needs four wires (RS-422), without an echo of the adapter".into(),
            ),
            Notification::Echo(name, EchoError::NotSet { .. }) => {
                self.show(format!("{name}: the line returns what is sent: set {name}.echo=true"));
            }
            Notification::Echo(name, error) => self.say_damage(format!("{name}: {error}")),
            Notification::BallStale => {
                self.ball_is_stale = true;
            }
            Notification::ViewerHolds(holds) => self.viewer_holds = holds,
            Notification::PoseAsked => self.counts.asked += 1,
            Notification::Pose => self.counts.poses += 1,
            Notification::Probed { port, baud, good, corrupt } => {
                self.show(format!("{port} at {baud}: {good} good, {corrupt} corrupt"));
            }
            Notification::ProbeRefused => self.show("port test: not while ALTER runs".into()),
            Notification::Trace(path) => self.show(format!("trace written: {}", path.display())),
        }
    }

    /// Ends tests whose time is over.
    pub(super) fn pass_time(&mut self, now: Duration) {
        self.now = now;
        for test in self.tests.extract_if(.., |test| test.until <= now).collect::<Vec<_>>() {
            self.show(test.result(&self.counts));
        }
    }

    /// Returns whether the host has ended.
    pub(super) fn has_ended(&self) -> bool {
        self.has_ended
    }

    /// Returns a text if the host ended too early: the latch's `end_within` or `farewell` was over before.
    pub(super) fn unfinished(&self) -> Option<&'static str> {
        match self.state {
            HostState::Running | HostState::Interrupted | HostState::Stopping => {
                Some("ended before the values were zero: without replies the robot ends ALTER")
            }
            HostState::Silent => Some("ended before the robot reported the end of ALTER"),
            HostState::Disconnected | HostState::Idle | HostState::Starting => None,
        }
    }

    /// Returns the age of the shown position, if it is older than a cycle and a half: the next message is missing.
    pub(super) fn position_age(&self) -> Option<Duration> {
        self.motion?;
        let age = self.now.saturating_sub(self.motion_at);
        (age > timing::CYCLE * 3 / 2).then_some(age)
    }

    /// Returns a word for the input's values if they are not live.
    pub(super) fn input_age(&self) -> Option<&'static str> {
        if matches!(self.latch, Latch::Disarmed(Cause::InputLost)) {
            return Some("GONE");
        }
        let fresh = self.hand.is_none_or(|hand| self.now < hand.fresh_until);
        (self.ball_is_stale || !fresh).then_some("OLD")
    }

    /// Returns the last segment status, and its meaning.
    pub(super) fn segment_text(&self) -> String {
        let words = |motion: Motion| {
            let status = motion.segment_status;
            format!("segment status {}, {}", u8::from(status), segment_words(status))
        };
        self.motion.map_or_else(String::new, words)
    }

    /// Returns whether the ball has sent a packet in the last second that was not a reply.
    pub(super) fn ball_is_late(&self) -> bool {
        self.ball_late_at.is_some_and(|at| self.now < at + DAMAGE)
    }

    /// Returns the line of a debug view.
    pub(super) fn debugged(&self, line: usize) -> (&'static str, &Trace) {
        match line {
            0 => ("robot", &self.traces.robot),
            1 => ("ball", &self.traces.ball),
            _ => ("viewer", &self.traces.viewer),
        }
    }

    fn take_start(&mut self, start: Start) {
        self.start = Some(start);
        let (found, expected) = (start.mode.0, self.mode.0);
        self.refused = None;
        match self.policy {
            Policy::Ignore => {}
            Policy::Accept if start.mode == self.mode => self.show(format!("start, mode {found}: accepted")),
            Policy::Accept => {
                self.refused = Some(start.mode);
                self.show(format!("start refused: the robot has mode {found}, expected {expected}"));
            }
            Policy::Refuse => self.show(format!("start, mode {found}: refused as configured")),
        }
    }

    /// Names the likely cause when ALTER ends by a timeout again soon after its start, and no reply left late.
    fn take_end(&mut self, end: End) {
        let Counts { cycles, missed, .. } = self.counts;
        let before = core::mem::replace(&mut self.late_ends, LateEnds { count: 0, cycles, missed });
        if end.error != ErrorCode::Timeout || missed > before.missed {
            return;
        }
        let is_soon = cycles - before.cycles < SHORT_ALTER_CYCLES;
        self.late_ends.count = if is_soon { before.count + 1 } else { 1 };
        if self.late_ends.count == 2 {
            self.show("the replies leave in time and arrive late: set the adapter's latency timer to 1 ms, see docs/alter.md".into());
        }
    }

    fn take_latch(&mut self, latch: Latch) {
        let before = core::mem::replace(&mut self.latch, latch);
        match latch {
            Latch::Disarmed(cause) if before.cause() != Some(cause) => {
                self.show(format!("disarmed: {}; release the input for 0.3 s", cause_text(cause)));
            }
            Latch::Ready { .. } => self.show("the input is at rest: Enter arms".into()),
            Latch::Halted => self.show(format!("{}: {}", cause_text(Cause::Halt), self.segment_text())),
            Latch::Armed { .. } => self.show("armed: the input moves the arm".into()),
            _ => {}
        }
    }

    /// Counts a reply in which an axis waited, because not all axes fit the window; shows a message the first time.
    fn take_held(&mut self) {
        if self.counts.held == 0 {
            self.show(format!(
                "at {} baud not all axes fit the window: one waits; use 38400 baud or mode 19",
                self.ports.robot.baud
            ));
        }
        self.counts.held += 1;
    }

    fn show_ball(&mut self, packet: Packet, took: Duration) {
        self.counts.packets += 1;
        (self.ball, self.exchange) = (Some(packet), took);
    }

    /// Reports a bad line at most once per second; all damage is counted.
    fn say_damage(&mut self, message: String) {
        if self.now >= self.damage_said + DAMAGE {
            self.damage_said = self.now;
            self.show(message);
        }
    }

    pub(super) fn show(&mut self, message: String) {
        if self.messages.len() == MESSAGES {
            self.messages.pop_front();
        }
        self.messages.push_back((self.now, message));
    }
}

/// Describes the reason why the arm does not follow the hand.
pub(super) fn cause_text(cause: Cause) -> &'static str {
    match cause {
        Cause::NoAlter => "no ALTER runs",
        Cause::Start => "ALTER has begun",
        Cause::Interruption => "ALTER was interrupted",
        Cause::Halt => "the robot has stopped the arm",
        Cause::OldValues => "the input sends no new values",
        Cause::InputLost => "the input is gone",
        Cause::KeyReleased => "the key was let go",
        Cause::Profile => "the profile has changed",
        Cause::Stop => "stopped",
    }
}

pub(super) fn segment_words(status: SegmentStatus) -> &'static str {
    match status {
        SegmentStatus::NoneYet => "none yet",
        SegmentStatus::Normal => "on the path",
        SegmentStatus::Finished => "finished",
        SegmentStatus::NullingUnplanned => "nulling",
        SegmentStatus::StoppedUnplanned => "stopped",
        SegmentStatus::Halt => "HALT",
        SegmentStatus::BrakingForBreak => "brake: BREAK",
        SegmentStatus::StoppedForBreak => "stop: BREAK",
        SegmentStatus::BrakingForFault => "brake: fault",
        SegmentStatus::StoppedForFault => "stop: fault",
        SegmentStatus::BrakingForSignal => "brake: sig.",
        SegmentStatus::StoppedForSignal => "stop: signal",
        SegmentStatus::NearTarget => "near target",
        SegmentStatus::Other(_) => "unknown",
    }
}

#[cfg(test)]
#[path = "model_tests.rs"]
pub(super) mod tests;
