//! What the operator sees, and what the keys do.

use std::collections::VecDeque;
use std::time::Duration;

use isra_ball::Packet;
use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use val2_alter::{AXES, ExceptionOutcome, HostState, Motion, Policy, Start};

use crate::cell::teleop::{Notification, Order, PortConfig, Traces, lost_text};
use crate::io::samples::Samples;
use crate::io::trace::Trace;
use crate::links::val2_alter::puma::error_text;

const MESSAGES: usize = 200;
/// The tests of ball and workstation take so long.
const TEST: Duration = Duration::from_secs(3);
/// Corrupt bytes are messages so far apart at least.
const DAMAGE: Duration = Duration::from_secs(1);

/// The ports, for the operator to read.
pub(super) struct Ports {
    pub(super) robot: PortConfig,
    pub(super) ball: PortConfig,
    pub(super) viewer: Option<PortConfig>,
}

/// What a key asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Command {
    Order(Order),
    Probe,
}

/// What the lower part of the screen shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum View {
    Main,
    Options,
    /// The last bytes of a line: robot, ball or viewer.
    Debug(usize),
}

#[derive(Default)]
pub(super) struct Counts {
    pub(super) cycles: u64,
    pub(super) missed: u64,
    pub(super) rejected: u64,
    pub(super) corrupt: u64,
    pub(super) packets: u64,
    pub(super) ball_missed: u64,
    pub(super) ball_corrupt: u64,
    pub(super) asked: u64,
    pub(super) poses: u64,
}

pub(super) struct Model {
    pub(super) ports: Ports,
    pub(super) traces: Traces,
    pub(super) view: View,
    pub(super) state: HostState,
    pub(super) policy: Policy,
    pub(super) clamp: bool,
    pub(super) start: Option<Start>,
    pub(super) motion: Option<Motion>,
    /// The control byte that came last, in words.
    pub(super) control: (&'static str, u8, &'static str),
    pub(super) ball: Option<Packet>,
    pub(super) exchange: Duration,
    pub(super) ball_is_stale: bool,
    pub(super) demand: [i16; AXES],
    pub(super) values: [i16; AXES],
    pub(super) thinking: Samples,
    pub(super) counts: Counts,
    pub(super) messages: VecDeque<(Duration, String)>,
    pub(super) drawn: u64,
    tests: Vec<Test>,
    damage_said: Duration,
    quitting: Option<Duration>,
    now: Duration,
}

/// A test that runs, and the counts at its beginning.
struct Test {
    what: &'static str,
    until: Duration,
    packets: u64,
    missed: u64,
    corrupt: u64,
    asked: u64,
    poses: u64,
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
    pub(super) fn new(ports: Ports, traces: Traces, clamp: bool) -> Self {
        Self {
            ports,
            traces,
            view: View::Main,
            state: HostState::Disconnected,
            policy: Policy::Ignore,
            clamp,
            start: None,
            motion: None,
            control: ("–", 0, "–"),
            ball: None,
            exchange: Duration::ZERO,
            ball_is_stale: false,
            demand: [0; AXES],
            values: [0; AXES],
            thinking: Samples::default(),
            counts: Counts::default(),
            messages: VecDeque::new(),
            drawn: 0,
            tests: Vec::new(),
            damage_said: Duration::ZERO,
            quitting: None,
            now: Duration::ZERO,
        }
    }

    /// Takes what the host reported.
    pub(super) fn take(&mut self, at: Duration, notification: Notification) {
        self.now = self.now.max(at);
        match notification {
            Notification::PortOpen(name, path) => self.show(format!("{name}: {path} opened")),
            Notification::PortLost(name, why) => self.show(format!("{name}: {why}")),
            Notification::Priority(true) => self.show("replies at real-time priority".into()),
            Notification::Priority(false) => self.show("replies at normal priority: no right to more".into()),
            Notification::Start(start) => {
                self.control = ("starting", start.control(), error_text(start.error));
                self.start = Some(start);
                if self.policy != Policy::Ignore {
                    let answer = if self.policy == Policy::Accept { "accepted" } else { "refused" };
                    self.show(format!("start, mode {}: {answer}", start.mode.0));
                }
            }
            Notification::Motion(motion) => {
                let phase = match motion.phase {
                    val2_alter::MotionPhase::Running => "running",
                    val2_alter::MotionPhase::Interrupted => "interrupted",
                };
                self.control = (phase, motion.control(), error_text(motion.error));
                self.motion = Some(motion);
            }
            Notification::Reply { demand, values, thinking } => {
                (self.demand, self.values) = (demand, values);
                self.thinking.add(thinking);
                self.counts.cycles += 1;
            }
            Notification::End(end) => {
                self.control = ("ended", end.control(), error_text(end.error));
                self.values = [0; AXES];
                self.show(format!("the robot ended ALTER: {}", error_text(end.error)));
            }
            Notification::Missed => {
                self.counts.missed += 1;
                self.show("a reply was too late".into());
            }
            Notification::Rejected(code) => {
                self.counts.rejected += 1;
                self.show(format!("reply not read: {}", error_text(code)));
            }
            Notification::Corrupt(error) => {
                self.counts.corrupt += 1;
                self.say_damage(format!("robot: {error}"));
            }
            Notification::Lost(reason) => self.show(lost_text(reason).into()),
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
            Notification::Ball(packet, took) => {
                if core::mem::take(&mut self.ball_is_stale) {
                    self.show("the ball is back".into());
                }
                self.show_ball(packet, took);
            }
            Notification::BallOld(packet, took) => self.show_ball(packet, took),
            // The poll that a late packet answers has been counted as missed.
            Notification::BallLate => {}
            Notification::BallMissed => self.counts.ball_missed += 1,
            Notification::BallCorrupt(error) => {
                self.counts.ball_corrupt += 1;
                self.say_damage(format!("ball: {error}"));
            }
            Notification::BallStale => {
                self.ball_is_stale = true;
                self.show("no new values from the ball: to rest".into());
            }
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

    /// What a key does.
    pub(super) fn key(&mut self, key: KeyEvent, now: Duration) -> Option<Command> {
        self.now = now;
        let interrupt = key.modifiers.contains(KeyModifiers::CONTROL) && key.code == KeyCode::Char('c');
        let code = if interrupt { KeyCode::Char('q') } else { key.code };
        match (self.view, code) {
            (View::Options, KeyCode::Char(digit @ '1'..='5')) => self.option(digit),
            (View::Options, _) => {
                self.view = View::Main;
                None
            }
            (View::Debug(line), KeyCode::Tab) => {
                self.view = View::Debug((line + 1) % 3);
                None
            }
            (View::Debug(_), KeyCode::Esc) => {
                self.view = View::Main;
                None
            }
            (View::Main | View::Debug(_), KeyCode::Char(letter)) => self.letter(letter.to_ascii_lowercase()),
            (View::Main, KeyCode::Esc) => self.end_alter(),
            _ => None,
        }
    }

    /// Whether the operator has asked to quit, and the robot is at rest or does not come to rest.
    pub(super) fn may_quit(&self) -> bool {
        self.quitting.is_some_and(|until| {
            matches!(self.state, HostState::Disconnected | HostState::Idle | HostState::Silent)
                || until <= self.now
        })
    }

    /// The line that a debug view shows.
    pub(super) fn debugged(&self, line: usize) -> (&'static str, &Trace) {
        match line {
            0 => ("robot", &self.traces.robot),
            1 => ("ball", &self.traces.ball),
            _ => ("viewer", &self.traces.viewer),
        }
    }

    fn letter(&mut self, letter: char) -> Option<Command> {
        match letter {
            'w' if self.ports.viewer.is_none() => {
                self.show("workstation test: there is none; use --viewer PORT".into());
                None
            }
            'w' => self.begin_test("workstation"),
            'k' => self.begin_test("ball"),
            't' if !matches!(self.state, HostState::Disconnected | HostState::Idle) => {
                self.show("port test: not while ALTER runs".into());
                None
            }
            't' => {
                self.show("port test: listening, some seconds".into());
                Some(Command::Probe)
            }
            'a' => {
                self.policy = Policy::Accept;
                self.show("waiting for the robot; Esc ends ALTER".into());
                Some(Command::Order(Order::Policy(Policy::Accept)))
            }
            'v' => {
                self.policy = Policy::Refuse;
                self.show("ALTER will be refused".into());
                Some(Command::Order(Order::Policy(Policy::Refuse)))
            }
            'o' => {
                self.view = View::Options;
                None
            }
            'q' => {
                self.quitting = Some(self.now + Duration::from_secs(2));
                self.end_alter()
            }
            _ => None,
        }
    }

    fn option(&mut self, digit: char) -> Option<Command> {
        self.view = View::Main;
        match digit {
            '1' => {
                let viewer = self.ports.viewer.as_ref();
                let ports = [
                    Some(("robot", &self.ports.robot)),
                    Some(("ball", &self.ports.ball)),
                    viewer.map(|v| ("viewer", v)),
                ];
                let lines: Vec<_> = ports
                    .into_iter()
                    .flatten()
                    .map(|(name, p)| format!("{name}: {} at {} baud", p.path, p.baud))
                    .collect();
                lines.into_iter().for_each(|line| self.show(line));
            }
            '2' => self.show("ball type ISRA; DIMENSION 6 is described nowhere".into()),
            '3' => self.view = View::Debug(0),
            '4' => self.show(format!(
                "{} pictures, own thread; replies p99 {:.2} ms",
                self.drawn,
                self.thinking.at(0.99).as_secs_f64() * 1e3
            )),
            _ => {
                self.clamp = !self.clamp;
                let state = if self.clamp { "on: the program must name a subroutine" } else { "off" };
                self.show(format!("clamp {state}"));
                return Some(Command::Order(Order::GripperKeys(self.clamp)));
            }
        }
        None
    }

    fn end_alter(&mut self) -> Option<Command> {
        self.policy = Policy::Ignore;
        self.show("ALTER: coming to rest".into());
        Some(Command::Order(Order::Stop))
    }

    fn begin_test(&mut self, what: &'static str) -> Option<Command> {
        let counts = &self.counts;
        self.tests.push(Test {
            what,
            until: self.now + TEST,
            packets: counts.packets,
            missed: counts.ball_missed,
            corrupt: counts.ball_corrupt,
            asked: counts.asked,
            poses: counts.poses,
        });
        self.show(format!("{what} test: {} s", TEST.as_secs()));
        None
    }

    fn show_ball(&mut self, packet: Packet, took: Duration) {
        self.counts.packets += 1;
        (self.ball, self.exchange) = (Some(packet), took);
    }

    /// A bad line is reported once a second; all of it is counted.
    fn say_damage(&mut self, message: String) {
        if self.now >= self.damage_said + DAMAGE {
            self.damage_said = self.now;
            self.show(message);
        }
    }

    fn show(&mut self, message: String) {
        if self.messages.len() == MESSAGES {
            self.messages.pop_front();
        }
        self.messages.push_back((self.now, message));
    }
}

#[cfg(test)]
pub(super) mod tests {
    use val2_alter::{End, ErrorCode};

    use super::*;
    use crate::io::trace::TraceArgs;

    const MS: Duration = Duration::from_millis(1);

    pub(crate) fn model() -> Model {
        let port = |path: &str, baud| PortConfig { path: path.into(), baud };
        let trace = |name| TraceArgs::off().start_kept(name);
        let ports = Ports { robot: port("/dev/r", 38_400), ball: port("/dev/b", 9600), viewer: None };
        let traces = Traces { robot: trace("r"), ball: trace("b"), viewer: trace("v") };
        Model::new(ports, traces, false)
    }

    fn press(model: &mut Model, code: KeyCode) -> Option<Command> {
        model.key(KeyEvent::new(code, KeyModifiers::NONE), MS)
    }

    fn last(model: &Model) -> &str {
        model.messages.back().map_or("", |(_, text)| text)
    }

    #[test]
    fn a_answers_esc_comes_to_rest_and_v_refuses() {
        let mut model = model();
        let order = |order| Some(Command::Order(order));
        assert_eq!(press(&mut model, KeyCode::Char('a')), order(Order::Policy(Policy::Accept)));
        assert_eq!(press(&mut model, KeyCode::Esc), order(Order::Stop));
        assert_eq!(press(&mut model, KeyCode::Char('V')), order(Order::Policy(Policy::Refuse)));
        assert_eq!(model.policy, Policy::Refuse);
    }

    #[test]
    fn quitting_waits_until_the_robot_is_at_rest() {
        let mut model = model();
        model.take(MS, Notification::State(HostState::Running));
        assert_eq!(press(&mut model, KeyCode::Char('q')), Some(Command::Order(Order::Stop)));
        assert!(!model.may_quit());
        model.take(2 * MS, Notification::State(HostState::Silent));
        assert!(model.may_quit());
    }

    #[test]
    fn a_robot_that_does_not_come_to_rest_keeps_nobody_here_for_ever() {
        let mut model = model();
        model.take(MS, Notification::State(HostState::Running));
        let interrupt = KeyEvent::new(KeyCode::Char('c'), KeyModifiers::CONTROL);
        assert_eq!(model.key(interrupt, MS), Some(Command::Order(Order::Stop)));
        model.pass_time(2000 * MS);
        assert!(!model.may_quit());
        model.pass_time(2001 * MS);
        assert!(model.may_quit());
    }

    #[test]
    fn ports_are_tested_only_without_alter() {
        let mut model = model();
        assert_eq!(press(&mut model, KeyCode::Char('t')), Some(Command::Probe));
        model.take(MS, Notification::State(HostState::Running));
        assert_eq!(press(&mut model, KeyCode::Char('t')), None);
        assert_eq!(last(&model), "port test: not while ALTER runs");
    }

    #[test]
    fn the_ball_test_counts_for_three_seconds() {
        let mut model = model();
        model.take(MS, Notification::BallMissed);
        press(&mut model, KeyCode::Char('k'));
        model.take(MS, Notification::BallMissed);
        model.pass_time(3000 * MS);
        assert_eq!(last(&model), "ball test: 3 s");
        model.pass_time(3001 * MS);
        assert_eq!(last(&model), "ball: 0 packets, 1 missed, 0 corrupt");
        press(&mut model, KeyCode::Char('w'));
        assert_eq!(last(&model), "workstation test: there is none; use --viewer PORT");
    }

    #[test]
    fn the_options_do_what_the_source_lists() {
        let mut model = model();
        let mut option = |digit| {
            press(&mut model, KeyCode::Char('o'));
            let command = press(&mut model, KeyCode::Char(digit));
            (command, model.view, last(&model).to_owned())
        };
        assert_eq!(option('1'), (None, View::Main, "ball: /dev/b at 9600 baud".into()));
        assert!(option('2').2.starts_with("ball type ISRA"));
        assert_eq!(option('4').2, "0 pictures, own thread; replies p99 0.00 ms");
        let on = "clamp on: the program must name a subroutine";
        assert_eq!(option('5'), (Some(Command::Order(Order::GripperKeys(true))), View::Main, on.into()));
        assert_eq!(option('5').0, Some(Command::Order(Order::GripperKeys(false))));
        assert_eq!(option('3').1, View::Debug(0));
        press(&mut model, KeyCode::Tab);
        assert_eq!(model.view, View::Debug(1));
        assert_eq!((press(&mut model, KeyCode::Esc), model.view), (None, View::Main));
    }

    #[test]
    fn the_end_of_alter_is_reported() {
        let mut model = model();
        model.take(MS, Notification::End(End { error: ErrorCode::Timeout }));
        assert_eq!(last(&model), "the robot ended ALTER: timeout");
        assert_eq!(model.control, ("ended", 0xE6, "timeout"));
    }
}
