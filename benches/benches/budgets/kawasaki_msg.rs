//! Kawasaki: a packet of 4096 bytes full of jobs, parsed, checked and queued; and built.

use core::hint::black_box;
use core::time::Duration;

use benches::{Budget, Count, Link};
use kawasaki_msg::robot_session::{Decoder as _, Session as _};
use kawasaki_msg::{Charset, Decoder, Job, JobKind, Limits, Line, Message, Packet, Params, Point, Room};
use kawasaki_msg::{Dialect, Robot, RobotConfig, Role, Value, timing};
use robot_work_queue::Reader;

pub const LINK: Link = Link { name: "kawasaki-msg", counts: COUNTS, budgets };

/// The jobs that fit a packet of 4096 bytes, and its bytes: see `the_packet`.
const JOBS: u16 = 98;
const BYTES: f64 = 4071.0;

const COUNTS: &[Count] = &[
    Count {
        what: "a packet of jobs: parsed, checked, queued",
        goal: Some(6.0),
        units: BYTES,
        unit: "byte",
        run: queue_packets,
    },
    Count {
        what: "as many lines that do not begin where the last one ended",
        goal: None,
        units: BYTES,
        unit: "byte",
        run: queue_scattered,
    },
    Count {
        what: "the same packet: messages found and checked only",
        goal: None,
        units: BYTES,
        unit: "byte",
        run: find_messages,
    },
    Count {
        what: "the longest message, which comes byte by byte",
        goal: Some(200.0),
        units: 4096.0,
        unit: "byte",
        run: grow_a_message,
    },
    Count { what: "the same packet, built", goal: None, units: BYTES, unit: "byte", run: build_packets },
];

fn budgets() -> Vec<Budget> {
    let job = BYTES as usize / usize::from(JOBS);
    vec![
        Budget {
            what: format!("2000 jobs of {job} bytes, one exchange a packet"),
            takes: timing::transfer_time(2000, job, Limits::TCP.packet),
            window: timing::WORK_CYCLE * 2000,
            source: "§9.4, appendix 2",
        },
        Budget {
            what: "one exchange and the longest unpacking".into(),
            takes: timing::EXCHANGE + timing::UNPACK_MAX,
            window: timing::WORK_CYCLE,
            source: "§12.1",
        },
    ]
}

/// Robots in an order, each with an empty queue: a packet is the same for all, whatever its numbers.
fn queue_packets(rounds: u64) {
    queue(rounds, &the_packet(1));
}

fn queue_scattered(rounds: u64) {
    queue(rounds, &the_packet(2));
}

fn queue(rounds: u64, packet: &[u8]) {
    const MOST: usize = 1000;
    let mut robots: Vec<_> = (0..MOST).map(|_| robot()).collect();
    assert!(rounds <= MOST as u64);
    for (robot, _) in robots.iter_mut().take(rounds as usize) {
        robot.handle_input(Duration::from_millis(32), black_box(packet));
        black_box(&robot);
    }
    for (robot, _) in robots.iter().take(rounds as usize) {
        assert!(robot.queued() >= u32::from(JOBS) - 1);
    }
    core::mem::forget(robots); // dropping what is queued is no part of it
}

fn find_messages(rounds: u64) {
    let packet = the_packet(1);
    let mut decoder = Decoder::new(Charset::Ascii);
    for _ in 0..rounds {
        assert_eq!(decoder.push(black_box(&packet)), packet.len());
        let mut found = 0;
        while let Some(message) = decoder.next_frame() {
            found += u16::from(black_box(message).is_ok());
        }
        assert_eq!(found, JOBS);
    }
}

/// What was looked at is not looked at again: else every byte of it would be, with every byte that comes.
fn grow_a_message(rounds: u64) {
    let text = "x".repeat(4086);
    let fields = [Value::Text(&text)];
    let mut wire = [0; 4096];
    let length = Message::new("X", &fields).encode(Charset::Ascii, &mut wire);
    assert_eq!(length, Ok(wire.len()));
    let mut decoder = Decoder::new(Charset::Ascii);
    for _ in 0..rounds {
        let mut found = 0;
        for byte in black_box(&wire) {
            assert_eq!(decoder.push(core::slice::from_ref(byte)), 1);
            found += u16::from(decoder.next_frame().is_some());
        }
        assert_eq!(found, 1);
    }
}

fn build_packets(rounds: u64) {
    let mut buffer = [0; 4096];
    for _ in 0..rounds {
        let mut packet = Packet::new(black_box(&mut buffer), Limits::TCP, Charset::Ascii);
        black_box(build(&mut packet, 1));
    }
}

fn the_packet(step: i32) -> Vec<u8> {
    let mut buffer = [0; 4096];
    let mut packet = Packet::new(&mut buffer, Limits::TCP, Charset::Ascii);
    let jobs = build(&mut packet, step);
    let bytes = packet.as_bytes().to_vec();
    assert!(step != 1 || (jobs, bytes.len() as f64) == (JOBS, BYTES));
    bytes
}

/// Lines on a board of 800 mm by 600 mm in front of the robot, as many as fit, each from one point to the next if `step` is 1.
fn build(packet: &mut Packet<'_>, step: i32) -> u16 {
    let dialect = Dialect::DEFAULT;
    let at = |n: i32| Point::new(40_000 + n * 7919 % 80_000, n * 6007 % 60_000 - 30_000);
    let mut number = 1;
    loop {
        let n = i32::from(number);
        let kind = if n % 5 == 0 { JobKind::Move } else { JobKind::Draw };
        let job = Job { number, line: Line { kind, start: at(n * step), end: at(n * step + 1) } };
        let params = Params::from_job(50, black_box(job));
        match dialect.write(Role::Job, &params, |message| packet.push(message)) {
            Ok(Room::Added) => number += 1,
            _ => return number - 1,
        }
    }
}

fn robot() -> (Robot<'static>, Reader<'static, Job>) {
    let (writer, reader) = robot_work_queue::boxed(128, 9999).expect("a queue");
    let mut robot = Robot::new(RobotConfig::TCP, writer).expect("a robot");
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.handle_input(Duration::ZERO, b"<TilausAlkaa$4#50$1#>");
    assert_eq!(robot.order(), Some(50));
    robot.poll_transmit(Duration::ZERO, &mut [0; 4096]).expect("a packet");
    (robot, reader)
}
