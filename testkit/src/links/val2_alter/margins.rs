//! The tolerance of the host for wrong assumptions about the controller, its line and its caller: the model in which
//! any fault may meet any other, and the session on a virtual clock.

use core::time::Duration;

use robot_session::Session as _;
use val2_alter::{
    ErrorCode, Frame, Framing, Host, HostConfig, HostEvent, Limits, List, Message as _, Motion, MotionPhase,
    RobotMessage, SegmentStatus, Start, Transform, timing,
};

use super::{TICK, delayed};
use crate::model::{Margin, Setting, Step};

const MS: Duration = Duration::from_millis(1);
const END: &str = "val2-alter host";

/// Returns the assumptions of the host about time.
pub fn margins() -> Vec<Margin> {
    let HostConfig { gap, silence_cycles, target_timeout, reserve, max_delay, .. } = HostConfig::default();
    let gap = gap.unwrap_or(Duration::MAX);
    let silence = timing::CYCLE * silence_cycles;
    let late = |ms: &[u64], ticks: u8| {
        let step = |ms: &u64| {
            let assumed = Duration::from_millis(*ms);
            // A message is late by a tick besides, if a reply is late by more.
            let real = TICK * (u32::from(ticks) + u32::from(ticks > 1));
            Step::model(assumed, real, Setting::new("late", delayed(ticks, assumed)))
        };
        ms.iter().map(step).collect()
    };
    let times = |assumed: Duration, reals: &[Duration], check: fn(Duration) -> Option<&'static str>| {
        let step = |real: &Duration| {
            let real = *real;
            Step::new(assumed, real, move || check(real))
        };
        reals.iter().map(step).collect()
    };
    let cycles = |n: u32| timing::CYCLE * n;
    let lost = [cycles(1), cycles(2), cycles(3), silence - MS / 10, silence];
    let doubled: Vec<_> = (0..=16).map(|bytes| timing::transmission_time(bytes, SLOW)).collect();
    [
        ("max_delay", "a message, or its reply, is so late", late(&[10, 8, 7, 6, 5], 1)),
        ("max_delay", "both, by more than any reply can be in time", late(&[28, 21, 14, 12, 11, 10], 2)),
        ("max_delay", "the same, by more than a cycle", late(&[35, 28, 14, 12, 11, 10], 4)),
        (
            "max_delay",
            "a message is so late, and the next is not",
            times(max_delay, &around(max_delay), shows),
        ),
        ("gap", "so long a pause within a message", times(gap, &around(gap), pauses)),
        (
            "gap",
            "so long from the half of a message to a whole one",
            times(Duration::from_secs(1), &[MS, gap, 24 * MS, 999 * MS], follows_half),
        ),
        (
            "silence_cycles",
            "no message for so long, a cycle for each that is lost",
            times(silence, &lost, is_silent),
        ),
        (
            "target_timeout",
            "from one target to the next",
            times(target_timeout, &around(target_timeout), steers),
        ),
        (
            "reserve",
            "19200 baud: bytes that are doubled when axes move already",
            times(reserve, &doubled, doubles),
        ),
    ]
    .map(|(setting, real, steps)| Margin { end: END, setting, real, steps })
    .into()
}

fn around(assumed: Duration) -> [Duration; 4] {
    [assumed / 2, assumed - MS / 10, assumed, assumed + MS]
}

const SLOW: u32 = 19_200;

/// A host in an ALTER, and the time.
struct Cell {
    host: Host,
    now: Duration,
}

impl Cell {
    fn new(config: HostConfig) -> Self {
        let mut host = Host::new(config).expect("it can work");
        host.handle_connected(Duration::ZERO);
        let mut cell = Self { host, now: Duration::ZERO };
        let start = RobotMessage::Start(Start::new(config.mode, List::EMPTY));
        assert!(cell.ask(&bytes(&start)), "it is accepted");
        cell
    }

    /// Sends a message to the host; returns whether it is answered at once.
    fn ask(&mut self, bytes: &[u8]) -> bool {
        self.host.handle_input(self.now, bytes);
        self.answers()
    }

    fn answers(&mut self) -> bool {
        self.host.handle_timeout(self.now);
        let mut out = [0; Host::MAX_TRANSMIT];
        self.host.poll_transmit(self.now, &mut out).is_some()
    }

    /// Returns whether the host has reported such an event.
    fn reports(&mut self, is_it: fn(&HostEvent) -> bool) -> bool {
        core::iter::from_fn(|| self.host.poll_event()).any(|event| is_it(&event))
    }
}

fn bytes(message: &RobotMessage) -> Vec<u8> {
    let mut out = [0; Frame::MAX_LEN];
    let len = message.encode(Framing::DEFAULT, &mut out).expect("it is a message");
    out[..len].to_vec()
}

fn motion() -> Vec<u8> {
    bytes(&RobotMessage::Motion(Motion {
        phase: MotionPhase::Running,
        error: ErrorCode::None,
        segment_status: SegmentStatus::from(2),
        segment: 1,
        percent: 0,
        transform: Some(Transform([0; 12])),
    }))
}

fn shows(time: Duration) -> Option<&'static str> {
    let mut cell = Cell::new(HostConfig::default());
    for at in [timing::CYCLE, timing::CYCLE * 2 + time, timing::CYCLE * 3] {
        cell.now = at;
        let _ = cell.ask(&motion());
    }
    cell.reports(|event| *event == HostEvent::Delayed).then_some("no message is reported as delayed")
}

fn pauses(time: Duration) -> Option<&'static str> {
    let message = motion();
    for cut in 1..message.len() {
        let mut cell = Cell::new(HostConfig::default());
        let (head, rest) = message.split_at(cut);
        let _ = cell.ask(head);
        cell.now += time;
        if !cell.ask(rest) {
            return Some("a message in two pieces is answered");
        }
    }
    None
}

fn follows_half(time: Duration) -> Option<&'static str> {
    let message = motion();
    for cut in 1..message.len() {
        let mut cell = Cell::new(HostConfig {
            gap: Some(Duration::from_secs(1)),
            silence_cycles: 100,
            ..HostConfig::default()
        });
        let _ = cell.ask(&message[..cut]);
        cell.now += time;
        if !cell.ask(&message) {
            return Some("a message behind the half of another is answered");
        }
    }
    None
}

fn is_silent(time: Duration) -> Option<&'static str> {
    let mut cell = Cell::new(HostConfig::default());
    let _ = cell.ask(&motion());
    cell.now += time;
    (!cell.ask(&motion())).then_some("an ALTER that goes on is answered")
}

fn steers(time: Duration) -> Option<&'static str> {
    let mut cell = Cell::new(HostConfig::default());
    cell.host.set_target(cell.now, [50; 6]);
    cell.now += time;
    cell.host.handle_timeout(cell.now);
    let is_stale = cell.reports(|event| *event == HostEvent::TargetStale);
    is_stale.then_some("a target holds until the next")
}

/// Returns the property that breaks if as many axes move as fit, and additional bytes are to be sent in the next cycle.
fn doubles(time: Duration) -> Option<&'static str> {
    let config = HostConfig { baud: SLOW, limits: Limits::NONE, ..HostConfig::default() };
    let mut cell = Cell::new(config);
    let mut left =
        u32::try_from(time.as_nanos() / timing::transmission_time(1, SLOW).as_nanos()).unwrap_or(u32::MAX);
    for target in [
        [1; 6],
        core::array::from_fn(|_| {
            let bytes = left.min(2);
            left -= bytes;
            [1, 0x0110, 0x1010][bytes as usize]
        }),
    ] {
        cell.now += timing::CYCLE;
        cell.host.set_target(cell.now, target);
        if !cell.ask(&motion()) {
            return Some("axes that move have room for their words");
        }
    }
    None
}
