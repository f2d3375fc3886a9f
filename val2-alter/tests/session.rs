//! Both ends on a line with the transmission times of its baud rate, and on one that damages what it carries.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::time::Duration;

use testkit::link::{Delivery, End as Side, Faults, Link};
use val2_alter::state::{ControllerInput, HostInput};
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, ControllerState, End, ErrorCode, Exception, Frame,
    Framing, Host, HostConfig, HostEvent, HostMessage, HostState, Limits, Message, Mode, Motion, MotionPhase,
    Policy, SegmentStatus, Select, SessionError, Start, StartCode, Unselected, timing,
};

const MS: Duration = Duration::from_millis(1);
const CYCLE: Duration = timing::CYCLE;

/// A controller and a host on one line.
struct Cell {
    link: Link,
    now: Duration,
    host: Host,
    controller: Controller,
    host_is_alive: bool,
    host_events: Vec<HostEvent>,
    controller_events: Vec<ControllerEvent>,
    /// The values that moved the arm, a row a reply.
    applied: Vec<[i16; 6]>,
    /// When the controller sent each of its messages.
    sent: Vec<(Duration, Vec<u8>)>,
}

impl Cell {
    fn new(host: HostConfig, controller: ControllerConfig) -> Self {
        Self::with_faults(host, controller, 1, Faults { latency: Duration::ZERO, ..Faults::NONE })
    }

    fn with_faults(host: HostConfig, controller: ControllerConfig, seed: u64, faults: Faults) -> Self {
        Self {
            link: Link::new(seed, faults.at_baud(controller.baud)),
            now: Duration::ZERO,
            host: Host::new(host),
            controller: Controller::new(controller),
            host_is_alive: true,
            host_events: Vec::new(),
            controller_events: Vec::new(),
            applied: Vec::new(),
            sent: Vec::new(),
        }
    }

    fn start(&mut self) {
        self.controller.start(self.now).unwrap();
    }

    /// Runs both ends until `until`, and `each` before every reply.
    fn run(&mut self, until: Duration) {
        loop {
            self.step();
            let host = if self.host_is_alive { self.host.poll_timeout() } else { None };
            let next = [self.link.next_delivery(), host, self.controller.poll_timeout()];
            match next.into_iter().flatten().min() {
                Some(next) if next <= until => self.now = self.now.max(next),
                _ => break self.now = until,
            }
        }
        self.step();
    }

    fn cycles(&mut self, count: u32) {
        self.run(self.now + CYCLE * count);
    }

    fn step(&mut self) {
        let mut out = [0; Frame::MAX_LEN];
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(Side::A, self.now) {
            self.controller.handle_input(self.now, &bytes);
        }
        self.controller.handle_timeout(self.now);
        while let Some(event) = self.controller.poll_event() {
            if let ControllerEvent::Reply(_) = event {
                self.applied.push(self.controller.values());
            }
            self.controller_events.push(event);
        }
        while let Some(len) = self.controller.poll_transmit(self.now, &mut out) {
            self.sent.push((self.now, out[..len].to_vec()));
            self.link.send(Side::A, self.now, &out[..len]);
        }
        while let Some(event) = self.controller.poll_event() {
            self.controller_events.push(event);
        }
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(Side::B, self.now) {
            if self.host_is_alive {
                self.host.handle_input(self.now, &bytes);
            }
        }
        if self.host_is_alive {
            self.host.handle_timeout(self.now);
            while let Some(event) = self.host.poll_event() {
                self.host_events.push(event);
            }
            while let Some(len) = self.host.poll_transmit(self.now, &mut out) {
                self.link.send(Side::B, self.now, &out[..len]);
            }
            while let Some(event) = self.host.poll_event() {
                self.host_events.push(event);
            }
        }
    }

    fn last_motion(&self) -> Motion {
        let motion = |event: &HostEvent| match event {
            HostEvent::Motion(motion) => Some(*motion),
            _ => None,
        };
        self.host_events.iter().rev().find_map(motion).unwrap()
    }
}

fn running(host: HostConfig, controller: ControllerConfig) -> Cell {
    let mut cell = Cell::new(host, controller);
    cell.start();
    cell.cycles(2);
    assert_eq!((cell.host.state(), cell.controller.state()), (HostState::Running, ControllerState::Running));
    cell
}

fn plain() -> (HostConfig, ControllerConfig) {
    (HostConfig { limits: Limits::NONE, ..HostConfig::default() }, ControllerConfig::default())
}

fn x(value: i16) -> [i16; 6] {
    [value, 0, 0, 0, 0, 0]
}

#[test]
fn a_start_message_then_one_standard_message_every_28_ms() {
    let (host, controller) = plain();
    let mut cell = Cell::new(host, controller);
    cell.start();
    cell.cycles(10);
    assert_eq!(cell.host_events[0], HostEvent::Start(Start::new(Mode(23), Default::default())));
    assert_eq!(cell.controller_events[0], ControllerEvent::Started);
    let times: Vec<_> = cell.sent.iter().map(|(at, _)| at.as_millis()).collect();
    assert_eq!(times, [0, 28, 56, 84, 112, 140, 168, 196, 224, 252, 280]);
    assert_eq!((cell.host.stats().cycles, cell.host.stats().replies), (9, 9));
    assert_eq!(cell.host.stats().missed, 0);
    assert_eq!(cell.controller.stats().replies, 9);
}

#[test]
fn an_increment_moves_the_arm_by_its_value_in_each_cycle() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    let x_before = cell.controller.pose().p[0];
    cell.host.set_target(x(80));
    cell.cycles(10);
    // Mode 23 is tool coordinates, and the tool's x axis is the world's: ten times 2.5 mm.
    assert_eq!(cell.controller.pose().p[0] - x_before, 25.0);
    // The message that was heard last left before the tenth reply.
    let transform = cell.last_motion().transform.unwrap();
    assert_eq!(f64::from(transform.0[9]), (x_before + 22.5) * 32.0);
}

#[test]
fn without_an_answer_the_controller_tries_three_times() {
    for attempts in [3, 4] {
        let (host, controller) = plain();
        let host = HostConfig { policy: Policy::Ignore, ..host };
        let mut cell = Cell::new(host, ControllerConfig { attempts, ..controller });
        cell.start();
        cell.cycles(20);
        let times: Vec<_> = cell.sent.iter().map(|(at, _)| at.as_millis()).collect();
        assert_eq!(times, [0, 28, 56, 84][..usize::from(attempts)]);
        assert_eq!(cell.controller_events.last(), Some(&ControllerEvent::BadReply(ErrorCode::Timeout)));
        assert!(cell.controller_events.contains(&ControllerEvent::GaveUp));
        assert_eq!(cell.controller.state(), ControllerState::Off);
        // The attempts behind the first say why they were made.
        assert_eq!(cell.sent[1].1[3], 0xA6);
    }
}

#[test]
fn a_host_may_refuse() {
    let (host, controller) = plain();
    let mut cell = Cell::new(HostConfig { policy: Policy::Refuse, ..host }, controller);
    cell.start();
    cell.cycles(5);
    assert_eq!(cell.controller_events, [ControllerEvent::Refused]);
    assert_eq!((cell.sent.len(), cell.host.state()), (1, HostState::Idle));
}

#[test]
fn a_damaged_start_message_is_asked_for_again() {
    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    let damaged = b"\x10\x10\x02\xA0\x17\x10\x03\xB8";
    for _ in 0..3 {
        host.handle_input(MS, damaged);
        assert_eq!(host.poll_transmit(MS, &mut out), Some(7));
        assert_eq!(&out[..7], b"\x10\x10\x02\x01\x10\x03\x01");
    }
    // Enough: the controller has given up after its third attempt.
    host.handle_input(MS, damaged);
    assert_eq!(host.poll_transmit(MS, &mut out), None);
    // Bytes outside any frame are no start message.
    host.set_policy(Policy::Accept);
    let mut other = Host::new(HostConfig::default());
    other.handle_input(MS, b"noise\x10\x10\x02");
    assert_eq!((other.stats().damaged, other.poll_transmit(MS, &mut out)), (1, None));
    // A good one begins anew.
    host.handle_input(MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    assert_eq!(host.poll_transmit(MS, &mut out), Some(7));
    assert_eq!(&out[..7], b"\x10\x10\x02\x00\x10\x03\x00");
    assert_eq!(host.state(), HostState::Running);
    host.handle_input(MS, b"\x10\x10\x02\xE0\x10\x03\xE0");
    host.handle_input(MS, damaged);
    assert_eq!(host.poll_transmit(MS, &mut out), Some(7));
}

#[test]
fn a_repeat_counts_as_an_attempt() {
    let mut controller = Controller::new(ControllerConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).unwrap();
    for attempt in 0..3 {
        let now = CYCLE * attempt;
        assert_eq!(controller.poll_transmit(now, &mut out), Some(8), "attempt {attempt}");
        controller.handle_input(now + 5 * MS, b"\x10\x10\x02\x01\x10\x03\x01");
    }
    assert_eq!(controller.poll_event(), Some(ControllerEvent::GaveUp));
    assert_eq!(controller.poll_transmit(CYCLE * 3, &mut out), None);
    assert_eq!(controller.start(CYCLE * 4), Ok(()));
    assert_eq!(controller.start(CYCLE * 4), Err(SessionError::AlreadyStarted));
}

/// A controller in its first cycle, at 28 ms, whose message has just left.
fn in_first_cycle(config: ControllerConfig) -> Controller {
    let mut controller = Controller::new(config);
    let mut out = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).unwrap();
    controller.poll_transmit(Duration::ZERO, &mut out).unwrap();
    controller.handle_input(5 * MS, b"\x10\x10\x02\x00\x10\x03\x00");
    assert_eq!(controller.poll_event(), Some(ControllerEvent::Started));
    controller.poll_transmit(CYCLE, &mut out).unwrap();
    controller
}

#[test]
fn a_bad_reply_gives_the_code_of_the_next_message_and_a_missing_one_ends_alter() {
    let too_long = [b"\x10\x10\x02".as_slice(), &[0; 15], b"\x10\x03\x00"].concat();
    let cases: [(&[u8], u8); 12] = [
        (b"\x10\x10\x02\x00\x00\x10\x03\x00", 0x80),
        (b"\x10\x10\x02\x00\x00\x10\x03\x01", 0x81),
        (b"\x10\x10\x02\x00\x01\x10\x03\x01", 0x82), // selects X, sends none
        (b"\x10\x10\x02\x00\x40\x10\x03\x40", 0x82), // selects what is no axis
        (b"\x10\x10\x02\x00\x10\x03\x00", 0x82),     // the answer to a start message
        (&too_long, 0x83),
        (b"\x10\x10\x02\x00\x00", 0x84),
        (b"\x10\x10\x02\x00\x10", 0x84),
        (b"\x10\x02\x00\x00\x10\x03\x00", 0x85), // one DLE in front
        (b"\x10\x10\x02\x00\x10\x04\x00", 0x85), // no end mark
        (b"", 0xE6),
        // Damage in front of a good reply costs nothing.
        (b"\x55\x10\x10\x02\x00\x00\x10\x03\x00", 0x80),
    ];
    for (reply, control) in cases {
        let mut controller = in_first_cycle(ControllerConfig::default());
        let mut out = [0; Frame::MAX_LEN];
        controller.handle_input(CYCLE + 12 * MS, reply);
        let closes = controller.poll_timeout().unwrap();
        controller.handle_timeout(closes);
        assert_eq!(controller.poll_timeout(), Some(CYCLE * 2), "{reply:02X?}");
        assert_eq!(controller.poll_transmit(CYCLE * 2 - MS, &mut out), None);
        let len = controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
        assert_eq!(out[3], control, "{reply:02X?} gives {:02X?}", &out[..len]);
        let state = if control == 0xE6 { ControllerState::Off } else { ControllerState::Running };
        assert_eq!(controller.state(), state);
    }
}

#[test]
fn the_window_is_15_ms_cumulative_and_17_ms_non_cumulative() {
    for (mode, window) in [(19, 15 * MS), (18, 17 * MS)] {
        let controller = in_first_cycle(ControllerConfig { mode: Mode(mode), ..Default::default() });
        // The message has 12 bytes.
        assert_eq!(controller.poll_timeout(), Some(CYCLE + timing::transmission(12, 38_400) + window));
        let mut late = controller.clone();
        late.handle_input(late.poll_timeout().unwrap(), b"\x10\x10\x02\x00\x00\x10\x03\x00");
        assert_eq!(late.state(), ControllerState::Ending);
        let mut in_time = controller.clone();
        in_time
            .handle_input(in_time.poll_timeout().unwrap() - MS / 1000, b"\x10\x10\x02\x00\x00\x10\x03\x00");
        assert_eq!(in_time.state(), ControllerState::Running);
    }
}

#[test]
fn a_killed_host_ends_alter_with_error_6_and_the_arm_stands_still() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    cell.host.set_target(x(80));
    cell.cycles(5);
    cell.host_is_alive = false;
    // The reply that is on its way still counts; from then on nothing moves.
    cell.cycles(1);
    let pose = cell.controller.pose();
    cell.cycles(50);
    assert_eq!(cell.controller.pose(), pose);
    assert_eq!(cell.controller.state(), ControllerState::Off);
    assert_eq!(cell.controller_events.last(), Some(&ControllerEvent::Ended(ErrorCode::Timeout)));
    assert_eq!(cell.sent.last().unwrap().1, b"\x10\x10\x02\xE6\x10\x03\xE6");

    // Started again without restarting anything else: a new host knows nothing of the old one.
    cell.host = Host::new(host);
    cell.host_is_alive = true;
    cell.start();
    cell.cycles(3);
    assert_eq!(cell.controller.pose(), pose, "the target is zero after a start");
    cell.host.set_target(x(80));
    cell.cycles(3);
    assert_eq!(cell.controller.pose().p[0] - pose.p[0], 7.5);
}

#[test]
fn a_missed_cycle_is_counted_and_the_next_start_is_taken() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    // The host is away for two cycles, then goes on with what has arrived meanwhile.
    cell.host_is_alive = false;
    let asleep = cell.now;
    while cell.now < asleep + CYCLE * 3 / 2 {
        // Nobody reads: what arrives waits in the operating system.
        let mut out = [0; Frame::MAX_LEN];
        cell.now += MS;
        cell.controller.handle_timeout(cell.now);
        while let Some(len) = cell.controller.poll_transmit(cell.now, &mut out) {
            cell.link.send(Side::A, cell.now, &out[..len]);
        }
    }
    cell.host_is_alive = true;
    let stats = cell.host.stats();
    cell.cycles(2);
    assert_eq!(cell.controller.state(), ControllerState::Off);
    assert!(cell.host_events.contains(&HostEvent::End(End { error: ErrorCode::Timeout })));
    assert_eq!((cell.host.state(), cell.host.stats().ends), (HostState::Idle, stats.ends + 1));
    cell.start();
    cell.cycles(5);
    assert_eq!(cell.host.state(), HostState::Running);
    assert_eq!((cell.host.stats().starts, cell.controller.stats().starts), (2, 2));
}

#[test]
fn the_deadline_is_the_window_less_the_reply() {
    let mut host = Host::new(HostConfig { limits: Limits::NONE, ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    let motion = b"\x10\x10\x02\x80\x02\x01\x00\x00\x20\x10\x03\xA3";
    let start = |host: &mut Host, now| {
        host.handle_input(now, b"\x10\x10\x02\xA0\x13\x10\x03\xB3");
        host.poll_transmit(now, &mut [0; Frame::MAX_LEN]).unwrap();
        while host.poll_event().is_some() {}
    };
    start(&mut host, MS);
    let arrived = 28 * MS;
    host.handle_input(arrived, motion);
    let deadline = arrived + 15 * MS - timing::transmission(20, 38_400);
    assert_eq!((host.reply_by(), host.poll_timeout()), (Some(deadline), Some(deadline)));
    host.poll_event();
    let in_time = host.clone().poll_transmit(deadline, &mut out);
    assert_eq!(in_time, Some(20));

    // A reply with doubled DLEs must begin sooner.
    host.set_target([0x1010; 6]);
    let mut late = host.clone();
    assert_eq!(late.poll_transmit(deadline, &mut out), None);
    assert_eq!((late.poll_event(), late.stats().missed), (Some(HostEvent::Missed), 1));
    assert_eq!(late.poll_transmit(deadline, &mut out), None);

    host.handle_timeout(deadline);
    assert_eq!((host.poll_event(), host.stats().missed), (Some(HostEvent::Missed), 1));
    assert_eq!(host.poll_transmit(deadline, &mut out), None);
    assert_eq!(host.poll_timeout(), Some(arrived + CYCLE * 4));

    // The next one is answered again, and two at once are one missed and one answered.
    host.handle_input(56 * MS, &[motion.as_slice(), motion].concat());
    assert!(host.poll_transmit(56 * MS, &mut out).is_some());
    assert_eq!((host.stats().cycles, host.stats().replies, host.stats().missed), (3, 1, 2));

    host.handle_timeout(56 * MS + CYCLE * 4);
    assert_eq!((host.state(), host.stats().lost), (HostState::Idle, 1));
    assert_eq!(host.poll_timeout(), None);
}

#[test]
fn letting_go_of_the_ball_never_exceeds_the_acceleration() {
    let limits = Limits { velocity: [60; 6], acceleration: [7; 6] };
    let (host, controller) = plain();
    let mut cell = running(HostConfig { limits, ..host }, controller);
    for target in [x(127), [-127, 127, 0, 50, -3, 9], [0; 6], [i16::MAX; 6], [i16::MIN; 6], [0; 6]] {
        cell.host.set_target(target);
        cell.cycles(13);
    }
    assert!(cell.applied.len() > 70);
    let mut last = [0; 6];
    for values in &cell.applied {
        for (value, last) in values.iter().zip(last) {
            assert!((value - last).abs() <= 7 && value.abs() <= 60, "{last} then {value}");
        }
        last = *values;
    }
    assert!(cell.applied.iter().any(|values| values[0] == 60), "the velocity is reached");
}

#[test]
fn a_stop_ramps_to_zero_and_then_falls_silent() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let (host, controller) = plain();
    let mut cell = running(HostConfig { limits, ..host }, controller);
    cell.host.set_target(x(50));
    cell.cycles(4);
    cell.applied.clear();
    cell.host.stop();
    assert_eq!((cell.host.state(), cell.host.policy()), (HostState::Stopping, Policy::Ignore));
    cell.host.set_target(x(50)); // has no effect any more
    cell.cycles(8);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    assert_eq!(values, [30, 10, 0]);
    assert!(cell.host_events.contains(&HostEvent::Stopped));
    assert_eq!(cell.controller_events.last(), Some(&ControllerEvent::Ended(ErrorCode::Timeout)));
    assert_eq!((cell.host.state(), cell.host.stats().missed), (HostState::Idle, 0));

    cell.start();
    cell.cycles(5);
    assert_eq!(cell.controller.state(), ControllerState::Off, "a stopped host does not answer");
    cell.host.set_policy(Policy::Accept);
    cell.start();
    cell.cycles(2);
    assert_eq!(cell.host.state(), HostState::Running);
}

#[test]
fn a_non_cumulative_offset_is_gone_to_and_come_back_from() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let (host, controller) = plain();
    let controller = ControllerConfig { mode: Mode::NON_CUMULATIVE_22, ..controller };
    let mut cell = running(HostConfig { limits, ..host }, controller);
    cell.applied.clear();
    cell.host.set_target(x(200));
    cell.cycles(9);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    assert_eq!(values, [20, 60, 110, 160, 190, 200, 200, 200, 200]);
    assert_eq!(cell.controller.pose().p[0], 400.0 + 200.0 / 32.0);
    cell.applied.clear();
    cell.host.stop();
    cell.cycles(12);
    let values: Vec<_> = cell.applied.iter().map(|values| values[0]).collect();
    assert_eq!(values, [180, 140, 90, 40, 10, 0, 0]);
    assert_eq!(cell.controller.pose().p[0], 400.0);
    assert_eq!(cell.controller.state(), ControllerState::Off);
}

#[test]
fn an_exception_starts_the_subroutine_once() {
    let (host, controller) = plain();
    let host = HostConfig { subroutine: true, ..host };
    let mut cell = running(host, ControllerConfig { subroutine: true, ..controller });
    cell.host.set_target(x(10));
    cell.host.exception(Exception::CloseGripper).unwrap();
    let pending = SessionError::ExceptionPending { pending: 253 };
    assert_eq!(cell.host.exception(Exception::OpenGripper), Err(pending));
    cell.cycles(4);
    let exceptions: Vec<_> =
        cell.controller_events.iter().filter(|e| matches!(e, ControllerEvent::Exception(_))).collect();
    assert_eq!(exceptions, [&ControllerEvent::Exception(Exception::CloseGripper)]);
    assert_eq!(cell.controller.state(), ControllerState::Interrupted);
    assert_eq!(
        (cell.host.state(), cell.last_motion().phase),
        (HostState::Interrupted, MotionPhase::Interrupted)
    );
    assert_eq!(cell.host.exception(Exception::OpenGripper), Err(SessionError::NotRunning));
    assert_eq!(cell.host.values(), [0; 6]);
    let pose = cell.controller.pose();
    cell.cycles(4);
    assert_eq!(cell.controller.pose(), pose, "the arm stands while the subroutine runs");
    cell.controller.resume();
    cell.cycles(3);
    assert_eq!((cell.host.state(), cell.host.values()), (HostState::Running, x(10)));
    assert_ne!(cell.controller.pose(), pose);
}

#[test]
fn without_a_subroutine_an_exception_is_refused_here_and_aborts_there() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    assert_eq!(cell.host.exception(Exception::CloseGripper), Err(SessionError::NoSubroutine));
    // A host that is wrong about it.
    cell.host.set_subroutine(true);
    cell.host.exception(Exception::Other(5)).unwrap();
    cell.cycles(3);
    let end = [ControllerEvent::Aborted(Exception::Other(5)), ControllerEvent::Ended(ErrorCode::None)];
    assert_eq!(cell.controller_events[cell.controller_events.len() - 2..], end);
    assert!(cell.host_events.contains(&HostEvent::End(End { error: ErrorCode::None })));
}

#[test]
fn an_exception_that_was_not_read_is_sent_again() {
    let mut host = Host::new(HostConfig { subroutine: true, limits: Limits::NONE, ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    let mut turn = |host: &mut Host, bytes: &[u8]| {
        host.handle_input(MS, bytes);
        let len = host.poll_transmit(MS, &mut out).unwrap();
        let (frame, _) = Frame::decode(&out[..len], Framing::DEFAULT).unwrap().unwrap();
        HostMessage::decode(frame.data(), Framing::DEFAULT).unwrap()
    };
    let good = b"\x10\x10\x02\x80\x02\x01\x00\x00\x20\x10\x03\xA3";
    let rejected = b"\x10\x10\x02\x81\x02\x01\x00\x00\x20\x10\x03\xA4";
    assert_eq!(
        turn(&mut host, b"\x10\x10\x02\xA0\x17\x10\x03\xB7"),
        HostMessage::StartReply(StartCode::Accept)
    );
    host.exception(Exception::OpenGripper).unwrap();
    let mut exceptions = Vec::new();
    for bytes in [good, rejected, rejected, good, rejected] {
        let HostMessage::Reply(reply) = turn(&mut host, bytes) else { panic!() };
        exceptions.push(u8::from(reply.exception));
    }
    assert_eq!(exceptions, [254, 254, 254, 0, 0]);
    assert_eq!(host.stats().rejected, 3);
}

#[test]
fn after_a_cycle_in_which_it_stood_the_arm_begins_again_from_rest() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let mut host = Host::new(HostConfig { limits, ..HostConfig::default() });
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    host.poll_transmit(MS, &mut out).unwrap();
    host.set_target(x(50));
    let mut values = Vec::new();
    let mut now = MS;
    for (error, late) in [(0, 0), (0, 0), (0, 0), (1, 0), (0, 0), (0, 12), (0, 0), (0, 0)] {
        let frame = [0x10, 0x10, 0x02, 0x80 | error, 2, 1, 0, 0, 32, 0x10, 0x03, 0xA3 + error];
        now += CYCLE;
        host.handle_input(now, &frame);
        values.push(host.poll_transmit(now + MS * late, &mut out).map_or(0, |_| host.values()[0]));
    }
    assert_eq!(values, [20, 40, 50, 20, 40, 0, 20, 40]);
}

#[test]
fn values_that_are_not_transmitted_are_what_both_ends_agree_on() {
    for mode in [22, 23] {
        for unselected in [Unselected::ByMode, Unselected::Hold, Unselected::Zero] {
            let mut poses = Vec::new();
            for select in [Select::All, Select::Needed] {
                let (host, controller) = plain();
                let host = HostConfig { select, unselected, baud: 19_200, ..host };
                let controller =
                    ControllerConfig { mode: Mode(mode & !4), baud: 19_200, unselected, ..controller };
                let mut cell = running(host, controller);
                for target in [x(5), x(5), [1, 2, 3, 4, 5, 6], [0, 0, 3, 0, 5, 0], [0; 6], x(-9)] {
                    cell.host.set_target(target);
                    cell.cycles(2);
                }
                assert_eq!(cell.host.stats().missed, 0);
                poses.push((cell.controller.pose(), cell.applied));
            }
            assert_eq!(poses[0], poses[1], "mode {mode}, {unselected:?}");
        }
    }
    // Word for word, an increment that is not transmitted repeats for ever.
    let mut controller =
        in_first_cycle(ControllerConfig { unselected: Unselected::Hold, ..Default::default() });
    controller.handle_input(CYCLE + MS, b"\x10\x10\x02\x00\x01\x50\x00\x10\x03\x51");
    let mut out = [0; Frame::MAX_LEN];
    for cycle in 2..5 {
        controller.poll_transmit(CYCLE * cycle, &mut out).unwrap();
        controller.handle_input(CYCLE * cycle + MS, b"\x10\x10\x02\x00\x00\x10\x03\x00");
    }
    assert_eq!(controller.pose().p[0], 400.0 + 4.0 * 2.5);
}

#[test]
fn without_mode_bit_4_only_the_exception_counts() {
    let (host, controller) = plain();
    let controller = ControllerConfig { mode: Mode(7), subroutine: true, ..controller };
    let mut cell = running(HostConfig { subroutine: true, ..host }, controller);
    let pose = cell.controller.pose();
    cell.host.set_target(x(80));
    cell.cycles(4);
    assert_eq!(cell.controller.pose(), pose);
    cell.host.exception(Exception::CloseGripper).unwrap();
    cell.cycles(2);
    assert_eq!(cell.controller.state(), ControllerState::Interrupted);
}

#[test]
fn the_program_may_end_alter() {
    let (host, controller) = plain();
    let mut cell = running(host, controller);
    cell.controller.set_segment(SegmentStatus::Finished, 7, Motion::DONE);
    cell.cycles(2);
    let motion = cell.last_motion();
    assert_eq!((motion.segment_status, motion.segment, motion.fraction()), (SegmentStatus::Finished, 7, 1.0));
    cell.controller.finish();
    cell.cycles(2);
    assert_eq!(cell.sent.last().unwrap().1, b"\x10\x10\x02\xE0\x10\x03\xE0");
    assert_eq!(cell.host_events.last(), Some(&HostEvent::End(End { error: ErrorCode::None })));
}

#[test]
fn a_new_start_begins_on_the_path_at_rest_and_without_a_target() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    for mode in [Mode::NON_CUMULATIVE_22, Mode::CUMULATIVE_23] {
        let (host, controller) = plain();
        let mut cell = running(HostConfig { limits, ..host }, ControllerConfig { mode, ..controller });
        cell.host.set_target(x(50));
        cell.cycles(6);
        assert_eq!(cell.host.values(), x(50));
        cell.controller.finish();
        cell.cycles(2);
        let pose = cell.controller.pose();
        cell.start();
        cell.cycles(4);
        assert_eq!((cell.host.state(), cell.host.values()), (HostState::Running, [0; 6]), "{mode:?}");
        assert_eq!(cell.controller.pose(), pose, "{mode:?}");
        cell.host.set_target(x(50));
        cell.cycles(1);
        assert_eq!(cell.host.values(), x(20), "{mode:?}");
    }
}

#[test]
fn an_offset_is_held_while_the_subroutine_runs() {
    let limits = Limits { velocity: [50; 6], acceleration: [20; 6] };
    let (host, controller) = plain();
    let controller = ControllerConfig { mode: Mode::NON_CUMULATIVE_22, subroutine: true, ..controller };
    let mut cell = running(HostConfig { limits, subroutine: true, ..host }, controller);
    cell.host.set_target(x(300));
    cell.cycles(8);
    cell.host.exception(Exception::CloseGripper).unwrap();
    cell.cycles(8);
    assert_eq!((cell.host.state(), cell.host.values()), (HostState::Interrupted, x(300)));
    assert_eq!(cell.controller.values(), x(300));
}

#[test]
fn after_a_rejected_reply_all_six_values_are_sent() {
    let config = HostConfig {
        select: Select::Needed,
        unselected: Unselected::Hold,
        limits: Limits::NONE,
        ..HostConfig::default()
    };
    let mut host = Host::new(config);
    let mut out = [0; Frame::MAX_LEN];
    host.handle_input(MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    host.poll_transmit(MS, &mut out).unwrap();
    host.set_target(x(80));
    let mut lengths = Vec::new();
    for error in [0, 0, 1, 0] {
        let frame = [0x10, 0x10, 0x02, 0x80 | error, 2, 1, 0, 0, 32, 0x10, 0x03, 0xA3 + error];
        host.handle_input(MS, &frame);
        lengths.push(host.poll_transmit(MS, &mut out).unwrap());
    }
    assert_eq!(lengths, [10, 8, 20, 8]);
}

#[test]
fn a_late_controller_keeps_its_raster_and_every_window() {
    let reply = b"\x10\x10\x02\x00\x00\x10\x03\x00";
    let mut out = [0; Frame::MAX_LEN];
    let mut sent = Vec::new();
    let mut controller = in_first_cycle(ControllerConfig { mode: Mode(19), ..Default::default() });
    // It is late by 3 ms, then by 20 ms.
    for late in [3, 0, 20, 0, 0] {
        controller.handle_input(controller.poll_timeout().unwrap() - MS, reply);
        let now = controller.poll_timeout().unwrap() + MS * late;
        controller.poll_transmit(now, &mut out).unwrap();
        sent.push(now.as_micros() / 1000);
    }
    // 132 ms and a window of 15 ms behind 12 bytes are 150 ms: later than the raster, which goes on from there.
    assert_eq!(sent, [59, 84, 132, 150, 178]);
}

#[test]
fn the_controller_takes_the_first_good_reply_and_reports_the_first_damage() {
    let mut out = [0; Frame::MAX_LEN];
    let good = |value: u8| [0x10, 0x10, 0x02, 0, 1, value, 0, 0x10, 0x03, 1 + value];
    let bad_sum = b"\x10\x10\x02\x00\x00\x10\x03\x01";
    let bad_format = b"\x10\x10\x02\x00\x40\x10\x03\x40";

    let mut controller = in_first_cycle(ControllerConfig::default());
    controller.handle_input(CYCLE + 12 * MS, &[good(32), good(64)].concat());
    assert_eq!((controller.values(), controller.stats().replies), (x(32), 1));
    controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
    controller.handle_input(CYCLE * 2 + 12 * MS, &[bad_sum.as_slice(), bad_format].concat());
    controller.poll_transmit(CYCLE * 3, &mut out).unwrap();
    assert_eq!((out[3], controller.values()), (0x81, [0; 6]));
    controller.handle_input(CYCLE * 3 + 12 * MS, &good(64));
    controller.poll_transmit(CYCLE * 4, &mut out).unwrap();
    assert_eq!((out[3], controller.values()), (0x80, x(64)));

    // A gap breaks a reply off; the next one in the same window counts.
    controller.handle_input(CYCLE * 4 + 11 * MS, b"\x10\x10\x02\x00\x01");
    let whole = controller.clone();
    for (gap, value) in [(5, 32), (1, 96)] {
        let mut controller = whole.clone();
        let rest = b"\x60\x00\x10\x03\x61\x10\x10\x02\x00\x01\x20\x00\x10\x03\x21";
        controller.handle_input(CYCLE * 4 + (11 + gap) * MS, rest);
        assert_eq!(controller.values(), x(value), "{gap} ms");
    }

    // The program ends ALTER in the window: what comes then moves nothing.
    let mut controller = whole.clone();
    let pose = controller.pose();
    controller.finish();
    controller.handle_input(CYCLE * 4 + 12 * MS, &good(96));
    assert_eq!((controller.pose(), controller.values()), (pose, [0; 6]));
    assert_eq!(controller.state(), ControllerState::Ending);
}

#[test]
fn the_first_standard_message_knows_nothing_of_the_attempts() {
    let mut controller = Controller::new(ControllerConfig::default());
    let mut out = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).unwrap();
    controller.poll_transmit(Duration::ZERO, &mut out).unwrap();
    controller.poll_transmit(CYCLE, &mut out).unwrap();
    assert_eq!(out[3], 0xA6);
    controller.handle_input(CYCLE + 3 * MS, b"\x10\x10\x02\x00\x10\x03\x00");
    controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
    assert_eq!(out[3], 0x80);
}

#[test]
fn words_are_zero_at_first_in_every_start() {
    let config = ControllerConfig { unselected: Unselected::Hold, ..Default::default() };
    let mut controller = in_first_cycle(config);
    let mut out = [0; Frame::MAX_LEN];
    controller.handle_input(CYCLE + MS, b"\x10\x10\x02\x00\x01\x50\x00\x10\x03\x51");
    assert_eq!(controller.values(), x(80));
    controller.finish();
    controller.poll_transmit(CYCLE * 2, &mut out).unwrap();
    controller.start(CYCLE * 3).unwrap();
    assert_eq!(controller.values(), [0; 6]);
    controller.poll_transmit(CYCLE * 3, &mut out).unwrap();
    controller.handle_input(CYCLE * 3 + MS, b"\x10\x10\x02\x00\x10\x03\x00");
    controller.poll_transmit(CYCLE * 4, &mut out).unwrap();
    controller.handle_input(CYCLE * 4 + MS, b"\x10\x10\x02\x00\x00\x10\x03\x00");
    assert_eq!((controller.values(), controller.stats().replies), ([0; 6], 2));
}

#[test]
fn an_event_queue_that_nobody_reads_drops_the_oldest() {
    let mut host = Host::new(HostConfig::default());
    host.handle_input(MS, b"\x10\x10\x02\xA0\x17\x10\x03\xB7");
    for _ in 0..20 {
        host.handle_input(MS, b"\x10\x10\x02\xE0\x10\x03\xE0");
    }
    assert_eq!(host.stats().events_lost, 5);
    let left = core::iter::from_fn(|| host.poll_event()).collect::<Vec<_>>();
    assert_eq!(left, [HostEvent::End(End { error: ErrorCode::None }); 16]);
}

#[test]
fn a_gap_ends_a_frame() {
    let frame = b"\x10\x10\x02\xA0\x17\x10\x03\xB7";
    for (gap, heard) in [(Some(4 * MS), false), (None, true), (Some(40 * MS), true)] {
        let mut host = Host::new(HostConfig { gap, ..HostConfig::default() });
        host.handle_input(MS, &frame[..5]);
        host.handle_input(6 * MS, &frame[5..]);
        assert_eq!(host.state() == HostState::Starting, heard, "{gap:?}");
    }
}

/// A line that flips, loses and inserts bytes, and falls silent: the cell takes ALTER up again each time, and nothing that
/// moves the arm breaks a limit.
#[test]
fn a_bad_line_is_survived() {
    let limits = Limits { velocity: [60; 6], acceleration: [7; 6] };
    let faults = Faults { latency: Duration::ZERO, max_delay: 3 * MS, ..Faults::SERIAL };
    let (mut cycles, mut starts, mut damaged) = (0, 0, 0);
    for seed in 0..20 {
        let (host, controller) = plain();
        let mut cell = Cell::with_faults(HostConfig { limits, ..host }, controller, seed, faults);
        for round in 0..200 {
            if cell.controller.state() == ControllerState::Off {
                cell.start();
            }
            cell.host.set_target([[100; 6], [0; 6], [-100; 6]][round % 3]);
            cell.cycles(5);
        }
        assert!(cell.applied.iter().flatten().all(|value| value.abs() <= 60), "seed {seed}");
        cycles += cell.host.stats().replies;
        starts += cell.host.stats().starts;
        damaged += cell.link.counts().damage();
        assert!(cell.controller.pose().orthonormality() < 1e-12);
        assert_eq!(cell.host.stats().events_lost, 0);
    }
    println!("{cycles} replies, {starts} starts, {damaged} faults");
    assert!(cycles > 10_000 && starts > 500 && damaged > 2_000, "{cycles} {starts} {damaged}");
}

#[test]
fn every_state_and_input_is_defined() {
    let mut matrix = String::new();
    for state in HostState::ALL {
        for input in HostInput::ALL {
            matrix += &format!("host        {state:?} + {input:?} = {:?}\n", state.on(input));
        }
    }
    for state in ControllerState::ALL {
        for input in ControllerInput::ALL {
            matrix += &format!("controller  {state:?} + {input:?} = {:?}\n", state.on(input));
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/state_matrix.txt");
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(path, &matrix).unwrap();
    }
    assert_eq!(matrix, std::fs::read_to_string(path).unwrap());
}
