//! Kawasaki: a packet of 4096 bytes full of jobs, parsed, checked and queued; and built; each also by hand, for one layout.

mod by_hand;
mod exchange;
#[path = "../work/kawasaki.rs"]
mod work;

use core::any::Any;
use core::hint::black_box;
use core::time::Duration;
use std::time::Instant;

use benches::{Budget, Count, Link, Ratio, Timing};
use kawasaki_msg::robot_session::{Decoder as _, Session as _};
use kawasaki_msg::{
    AddResult, Charset, Decoder, Dialect, FieldVisitor, Job, JobKind, Limits, Line, Packet, Point, Robot,
    RobotConfig, Text, Unfit, Work, Writer, timing,
};
use robot_work_queue::Reader;

use super::streams::{self, Decoding};
use work::line;

/// The goals of each packet are ratios to the loop by hand for its one layout: the link carries 31 packets a second, and one
/// grammar for every table and every layout is worth more than their speed.
pub(super) const LINK: Link = Link {
    name: "kawasaki-msg",
    counts: COUNTS,
    ratios: &[
        Ratio { what: exchange::BY_SESSION, times: 2.0, of: &[exchange::BY_CODEC] },
        Ratio { what: QUEUE_LINES, times: 1.85, of: &[QUEUE_LINES_BY_HAND] },
        Ratio { what: QUEUE_PALLETS, times: 1.6, of: &[QUEUE_PALLETS_BY_HAND] },
        Ratio { what: QUEUE_SHORT, times: 3.2, of: &[QUEUE_SHORT_BY_HAND] },
        Ratio { what: FIND, times: 1.0, of: &[FIND_BY_HAND] },
        Ratio { what: BUILD_LINES, times: 1.65, of: &[BUILD_LINES_BY_HAND] },
        Ratio { what: BUILD_PALLETS, times: 1.25, of: &[BUILD_PALLETS_BY_HAND] },
        Ratio { what: BUILD_SHORT, times: 2.35, of: &[BUILD_SHORT_BY_HAND] },
    ],
    streams: &[streams::rows::<Lines>()],
    budgets,
    ..Link::EMPTY
};

const QUEUE_LINES: &str = "a packet of lines: parsed, checked, queued";
const QUEUE_LINES_BY_HAND: &str = "… lines by a loop by hand";
const QUEUE_PALLETS: &str = "a packet of pallet moves: six decimals, a text, a number";
const QUEUE_PALLETS_BY_HAND: &str = "… pallet moves by a loop by hand";
const QUEUE_SHORT: &str = "a packet of the shortest jobs: one digit";
const QUEUE_SHORT_BY_HAND: &str = "… the shortest by a loop by hand";
const FIND: &str = "a packet of lines: messages found and checked only";
const FIND_BY_HAND: &str = "… found by a loop by hand";
const BUILD_LINES: &str = "a packet of lines, built";
const BUILD_LINES_BY_HAND: &str = "… lines built by a loop by hand";
const BUILD_PALLETS: &str = "a packet of pallet moves, built";
const BUILD_PALLETS_BY_HAND: &str = "… pallet moves built by a loop by hand";
const BUILD_SHORT: &str = "a packet of the shortest jobs, built";
const BUILD_SHORT_BY_HAND: &str = "… the shortest built by a loop by hand";

/// The jobs that fit a packet of 4096 bytes, and the bytes of each packet: `packet` makes them.
const JOBS: u16 = 98;
const BYTES: usize = 4071;
const PALLET_BYTES: usize = 4052;
const SHORT_BYTES: usize = 4091;

/// The shortest jobs, of 16 bytes each, are nearly all table and machine.
const COUNTS: &[Count] = &[
    queued(QUEUE_LINES, BYTES, |rounds| queue(rounds, line, BYTES)).timed("queue-lines", Timing::OURS),
    queued(QUEUE_LINES_BY_HAND, BYTES, |rounds| by_hand::queue::<Line>(rounds, packet(line)))
        .timed("queue-lines", Timing::BY_HAND),
    queued(QUEUE_PALLETS, PALLET_BYTES, |rounds| queue(rounds, pallet_move, PALLET_BYTES))
        .timed("queue-pallets", Timing::OURS),
    queued(QUEUE_PALLETS_BY_HAND, PALLET_BYTES, |rounds| {
        by_hand::queue::<PalletMove>(rounds, packet(pallet_move))
    })
    .timed("queue-pallets", Timing::BY_HAND),
    queued(QUEUE_SHORT, SHORT_BYTES, |rounds| queue(rounds, short, SHORT_BYTES))
        .timed("queue-shortest", Timing::OURS),
    queued(QUEUE_SHORT_BY_HAND, SHORT_BYTES, |rounds| by_hand::queue::<Short>(rounds, packet(short)))
        .timed("queue-shortest", Timing::BY_HAND),
    Count::byte(FIND, BYTES, find_messages).timed("decode", Timing::OURS),
    Count::byte(FIND_BY_HAND, BYTES, find_by_hand).timed("decode", Timing::BY_HAND),
    Count::byte("the longest message, received byte by byte", 4096, grow_a_message).goal(200.0),
    Count::byte(BUILD_LINES, BYTES, |rounds| build_packets(rounds, line)).timed("encode-lines", Timing::OURS),
    Count::byte(BUILD_LINES_BY_HAND, BYTES, |rounds| build_by_hand(rounds, line))
        .timed("encode-lines", Timing::BY_HAND),
    Count::byte(BUILD_PALLETS, PALLET_BYTES, |rounds| build_packets(rounds, pallet_move))
        .timed("encode-pallets", Timing::OURS),
    Count::byte(BUILD_PALLETS_BY_HAND, PALLET_BYTES, |rounds| build_by_hand(rounds, pallet_move))
        .timed("encode-pallets", Timing::BY_HAND),
    Count::byte(BUILD_SHORT, SHORT_BYTES, |rounds| build_packets(rounds, short))
        .timed("encode-shortest", Timing::OURS),
    Count::byte(BUILD_SHORT_BY_HAND, SHORT_BYTES, |rounds| build_by_hand(rounds, short))
        .timed("encode-shortest", Timing::BY_HAND),
    Count::op(exchange::BY_SESSION, exchange::by_session)
        .rounds(exchange::RECORDED / 2)
        .timed("pc", Timing::OURS),
    Count::op(exchange::BY_CODEC, exchange::by_codec)
        .rounds(exchange::RECORDED / 2)
        .timed("pc", "the codec alone"),
    Count::op("a robot's exchange: 98 jobs reported, a packet of lines queued", exchange::by_robot)
        .rounds(exchange::RECORDED / 2)
        .timed("robot", Timing::OURS),
];

/// The queues that are prepared, for twice the packets that are counted.
const QUEUES: usize = 32;

const fn queued(what: &'static str, bytes: usize, run: fn(u64) -> (Duration, Box<dyn Any>)) -> Count {
    Count::byte_prepared(what, bytes, QUEUES as u64 / 2, run)
}

struct Lines;

impl Decoding for Lines {
    type Decoder = Decoder;
    const LEN: usize = BYTES;
    const FRAMES: usize = JOBS as usize;

    fn decoder() -> Decoder {
        Decoder::new(Charset::Ascii)
    }

    fn valid() -> Vec<u8> {
        packet(line).0
    }

    /// Returns the longest message, which consists of marks except for its last byte.
    fn worst() -> Vec<u8> {
        let mut noise = b"<X$1015#".to_vec();
        noise.resize(streams::NOISE, b'$');
        noise
    }
}

fn budgets() -> Vec<Budget> {
    let job = BYTES / usize::from(JOBS);
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
fn queue<W: Work + Send + 'static>(
    rounds: u64,
    work: impl Fn(u16) -> W,
    bytes: usize,
) -> (Duration, Box<dyn Any>) {
    let (packet, jobs) = packet(work);
    assert_eq!(packet.len(), bytes);
    let mut robots: Vec<_> = (0..QUEUES).map(|_| robot::<W>()).collect();
    let used = robots.get_mut(..rounds as usize).expect("no more rounds than robots");
    let start = Instant::now();
    for (robot, _) in &mut *used {
        robot.handle_input(Duration::from_millis(32), black_box(&packet));
        black_box(robot);
    }
    let time = start.elapsed();
    for (robot, _) in used {
        assert_eq!(robot.queued(), u32::from(jobs));
    }
    (time, Box::new(robots))
}

fn find_messages(rounds: u64) {
    let (packet, jobs) = packet(line);
    assert_eq!((jobs, packet.len()), (JOBS, BYTES));
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

/// Finds the messages by hand, and checks their marks, lengths and characters: no stream, no errors.
fn find_by_hand(rounds: u64) {
    let (packet, _) = packet(line);
    for _ in 0..rounds {
        let (mut rest, mut found) = (black_box(&packet[..]), 0);
        while let Some([name, data, after]) = by_hand::find(rest) {
            black_box((name, data));
            (rest, found) = (after, found + 1);
        }
        assert_eq!((rest.len(), found), (0, JOBS));
    }
}

/// Decodes a message that grows byte by byte. Examined bytes are not examined again: otherwise every byte would be, with
/// every byte that comes.
fn grow_a_message(rounds: u64) {
    let text = "x".repeat(4086);
    let mut wire = [0; 4096];
    let mut writer = Writer::new(&mut wire, Charset::Ascii, "X");
    writer.data();
    writer.text(&text);
    assert_eq!(writer.finish(), Ok(wire.len()));
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

fn build_packets<W: Work>(rounds: u64, work: impl Fn(u16) -> W) {
    let mut buffer = [0; 4096];
    for _ in 0..rounds {
        let mut packet = Packet::new(black_box(&mut buffer), Limits::TCP, Dialect::DEFAULT);
        black_box(build(&mut packet, &work));
    }
}

fn build_by_hand<W: Work + by_hand::Layout>(rounds: u64, work: impl Fn(u16) -> W + Copy) {
    assert_eq!(by_hand::build(rounds, work), packet(work).0);
}

/// Returns a packet full of jobs, and their number.
fn packet<W: Work>(work: impl Fn(u16) -> W) -> (Vec<u8>, u16) {
    let mut buffer = [0; 4096];
    let mut packet = Packet::new(&mut buffer, Limits::TCP, Dialect::DEFAULT);
    let jobs = build(&mut packet, work);
    (packet.as_bytes().to_vec(), jobs)
}

fn build<W: Work>(packet: &mut Packet<'_>, work: impl Fn(u16) -> W) -> u16 {
    let ranges = W::Ranges::default();
    let mut number = 1;
    loop {
        let job = Job { order: 50, number, work: work(number) };
        match packet.push_job(&black_box(job), &ranges) {
            Ok(AddResult::Added) => number += 1,
            _ => return number - 1,
        }
    }
}

/// Six joints in thousandths of a degree, a tool, a speed in per cent.
#[derive(Debug, Clone, Copy, Default)]
struct PalletMove {
    joints: [i32; 6],
    tool: Text<8>,
    speed: u8,
}

impl Work for PalletMove {
    type Ranges = ();

    fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> Result<(), Unfit> {
        for (joint, name) in self.joints.iter_mut().zip(["j1", "j2", "j3", "j4", "j5", "j6"]) {
            fields.decimal(name, joint, 3, -360_000..=360_000)?;
        }
        fields.text("tool", &mut self.tool, 1..=8)?;
        fields.whole("speed", &mut self.speed, 1..=100)
    }
}

fn pallet_move(number: u16) -> PalletMove {
    let joint = |n: i32| (i32::from(number) * 7919 + n * 60_007) % 360_000 - 180_000;
    let tool = if number.is_multiple_of(3) { "gripper" } else { "vacuum" };
    PalletMove {
        joints: [1, 2, 3, 4, 5, 6].map(joint),
        tool: Text::new(tool).expect("short"),
        speed: (number % 100) as u8 + 1,
    }
}

/// The layout with the least work for each byte of a message.
#[derive(Debug, Clone, Copy, Default)]
struct Short(u8);

impl Work for Short {
    type Ranges = ();

    fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> Result<(), Unfit> {
        fields.whole("digit", &mut self.0, 0..=9)
    }
}

fn short(number: u16) -> Short {
    Short((number % 10) as u8)
}

fn robot<W: Work + Send + 'static>() -> (Robot<'static, W>, Reader<'static, Job<W>>) {
    let (writer, reader) = robot_work_queue::boxed(256, 9999).expect("a queue");
    let mut robot = Robot::new(RobotConfig::tcp(), writer).expect("a robot");
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.handle_input(Duration::ZERO, b"<TilausAlkaa$4#50$1#>");
    assert_eq!(robot.order(), Some(50));
    robot.poll_transmit(Duration::ZERO, &mut [0; 4096]).expect("a packet");
    (robot, reader)
}
