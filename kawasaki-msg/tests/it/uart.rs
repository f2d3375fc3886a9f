//! A robot with a UART: bytes come in pieces, one after the other, and a packet takes longer than an exchange.

use core::time::Duration;
use std::collections::VecDeque;

use kawasaki_msg::motion::boxed;
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{JobKind, Line, Pc, PcConfig, Point, Robot, RobotConfig};

const JOBS: u16 = 500;
/// The time of a byte at 115200 baud.
const BYTE: Duration = Duration::from_micros(87);
const MOTION: Duration = Duration::from_millis(10);

/// A line of one direction: each byte with the time at which it has come.
struct Wire {
    byte: Duration,
    bytes: VecDeque<(Duration, u8)>,
}

impl Wire {
    fn new(byte: Duration) -> Self {
        Self { byte, bytes: VecDeque::new() }
    }

    fn send(&mut self, now: Duration, bytes: &[u8]) {
        let mut at = self.bytes.back().map_or(now, |(at, _)| now.max(*at));
        for byte in bytes {
            at += self.byte;
            self.bytes.push_back((at, *byte));
        }
    }

    fn receive(&mut self, now: Duration, most: usize) -> Vec<u8> {
        let come = self.bytes.iter().take(most).take_while(|(at, _)| *at <= now).count();
        self.bytes.drain(..come).map(|(_, byte)| byte).collect()
    }
}

/// Runs an order over a line on which a byte takes `byte`, to a robot that reads `piece` bytes at once; returns the maximum
/// number of bytes on their way to it.
fn run(byte: Duration, piece: usize, config: RobotConfig) -> usize {
    let (jobs, mut motion) = boxed::<Line>(64, 9999).unwrap();
    let mut robot = Robot::new(config, jobs).unwrap();
    let mut pc = Pc::new(PcConfig { silence: Duration::MAX, ..PcConfig::tcp() }).unwrap();
    let line = |x| Line { kind: JobKind::Draw, start: Point::new(x, 0), end: Point::new(x + 100, 0) };
    let drawing: Vec<Line> = (0..JOBS.into()).map(line).collect();
    pc.start(50, &drawing[..]).unwrap();
    let (mut to_robot, mut to_pc) = (Wire::new(byte), Wire::new(byte));
    let (mut now, mut moves_until, mut buffer) = (Duration::ZERO, Duration::ZERO, [0; 4096]);
    let (mut executed, mut most) = (Vec::new(), 0);
    robot.handle_timeout(now);
    robot.handle_connected(now);
    pc.handle_connected(now);
    while pc.order().is_some() {
        assert!(
            now < Duration::from_secs(300),
            "{} of {JOBS} executed, {most} bytes on their way",
            executed.len()
        );
        now += byte;
        if now >= moves_until
            && let Some(job) = motion.take()
        {
            moves_until = now + MOTION;
            executed.push(job.complete().number);
        }
        let bytes = to_robot.receive(now, piece);
        if !bytes.is_empty() {
            robot.handle_input(now, &bytes);
        }
        robot.handle_timeout(now);
        while robot.poll_event().is_some() {}
        if let Some(length) = robot.poll_transmit(now, &mut buffer) {
            to_pc.send(now, &buffer[..length]);
        }
        let bytes = to_pc.receive(now, 4096);
        if !bytes.is_empty() {
            pc.handle_input(now, &bytes);
        }
        pc.handle_timeout(now);
        while pc.poll_event().is_some() {}
        if let Some(length) = pc.poll_transmit(now, &mut buffer) {
            to_robot.send(now, &buffer[..length]);
        }
        most = most.max(to_robot.bytes.len());
    }
    assert_eq!(executed, (1..=JOBS).collect::<Vec<_>>());
    most
}

/// An answer in the middle of a packet would request more than the line carries, and jobs that are on their way: no order
/// would end.
#[test]
fn a_packet_that_comes_in_pieces_is_one_answer() {
    for piece in [1, 16, 128] {
        assert!(run(BYTE, piece, RobotConfig::tcp()) <= 4096, "one packet at a time");
    }
    // At 9600 baud a packet of each end takes longer than the default.
    let config = RobotConfig { reply_timeout: Duration::from_secs(10), ..RobotConfig::tcp() };
    assert!(run(12 * BYTE, 1, config) <= 4096, "one packet at a time");
}

/// A peer that is never silent does not prevent the robot from sending.
#[test]
fn an_answer_without_an_end_is_waited_for_as_long_as_for_none() {
    let (writer, _motion) = boxed::<Line>(64, 9999).unwrap();
    let mut robot = Robot::new(RobotConfig::tcp(), writer).unwrap();
    let mut buffer = [0; 4096];
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.poll_transmit(Duration::ZERO, &mut buffer).unwrap();
    for (byte, millis) in b"<Huuhaa$0##>".iter().cycle().zip(1..) {
        let now = Duration::from_millis(millis);
        robot.handle_input(now, &[*byte]);
        robot.handle_timeout(now);
        if robot.poll_transmit(now, &mut buffer).is_some() {
            return assert_eq!(now, RobotConfig::tcp().reply_timeout);
        }
    }
}
