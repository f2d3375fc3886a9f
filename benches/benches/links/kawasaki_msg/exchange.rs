//! The exchanges of both ends. A PC decodes the robot's packet, which acknowledges the jobs of the packet before, and builds
//! a packet full of jobs; the robot queues it. And the codec alone for the PC's share.

use core::hint::black_box;
use core::time::Duration;
use std::sync::OnceLock;

use super::{JOBS, line};
use kawasaki_msg::motion::Motion;
use kawasaki_msg::robot_session::{Decoder as _, Session};
use kawasaki_msg::{
    AddResult, Charset, Decoder, Dialect, Job, JobSource, LargeRobot, Limits, Line, Packet, Pc, PcConfig,
    RobotConfig, Supply, Work,
};

pub(super) const BY_SESSION: &str = "a PC's exchange: 98 jobs acknowledged, a packet of lines sent";
pub(super) const BY_CODEC: &str = "… by the codec alone";

/// The exchanges that are recorded first. A longer run repeats them with new ends.
pub(super) const RECORDED: u64 = 100;
const CYCLE: Duration = Duration::from_millis(32);
/// From the robot's packet to the answer.
const DELAY: Duration = Duration::from_millis(2);
/// The jobs of a packet when the numbers have four digits: those of the last exchanges.
const FEWEST: usize = JOBS as usize - 5;

/// The packets of both ends in a cycle.
struct Exchange {
    robot: Vec<u8>,
    pc: Vec<u8>,
}

fn pc() -> Pc<impl JobSource<Work = Line>> {
    let source = |index: u32| Supply::Job(line((index % 9999) as u16 + 1));
    let mut pc = Pc::new(PcConfig::tcp()).expect("a PC");
    pc.start(50, source).expect("no order is active");
    pc.handle_connected(Duration::ZERO);
    pc
}

/// Returns the length of the answer to the robot's packet, after all events were polled.
fn answer(pc: &mut Pc<impl JobSource>, now: Duration, packet: &[u8], out: &mut [u8]) -> usize {
    pc.handle_input(now, packet);
    pc.handle_timeout(now + DELAY);
    let length = pc.poll_transmit(now + DELAY, out).expect("each packet is answered");
    while let Some(event) = pc.poll_event() {
        black_box(event);
    }
    length
}

fn robot() -> (LargeRobot<'static, Line>, Motion<'static, Line>) {
    let (jobs, motion) = kawasaki_msg::motion::boxed(256, 9999).expect("a queue");
    let mut robot = LargeRobot::with_ranges(RobotConfig::tcp(), jobs, Default::default()).expect("a robot");
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    (robot, motion)
}

/// Writes the robot's packet of a cycle.
fn report(robot: &mut LargeRobot<'_, Line>, now: Duration, out: &mut [u8]) -> usize {
    robot.handle_timeout(now);
    robot.poll_transmit(now, out).expect("the robot sends in each cycle")
}

/// Queues the PC's packet, and executes all its jobs.
fn execute(
    robot: &mut LargeRobot<'_, Line>,
    motion: &mut Motion<'_, Line>,
    now: Duration,
    packet: &[u8],
) -> usize {
    robot.handle_input(now + 2 * DELAY, packet);
    let mut executed = 0;
    while let Some(job) = motion.take() {
        black_box(&*job);
        job.complete();
        executed += 1;
    }
    while let Some(event) = robot.poll_event() {
        black_box(event);
    }
    executed
}

/// Returns the exchanges of an order, one per cycle. The robot executes all queued jobs in every cycle.
fn recorded() -> &'static [Exchange] {
    static EXCHANGES: OnceLock<Vec<Exchange>> = OnceLock::new();
    EXCHANGES.get_or_init(|| {
        let ((mut robot, mut motion), mut pc, mut out) = (robot(), pc(), [0; 4096]);
        let cycles = (1..=RECORDED as u32).map(|cycle| CYCLE * cycle);
        let exchanges = cycles.map(|now| {
            let length = report(&mut robot, now, &mut out);
            let robot_packet = out[..length].to_vec();
            let length = answer(&mut pc, now, &robot_packet, &mut out);
            execute(&mut robot, &mut motion, now, &out[..length]);
            Exchange { robot: robot_packet, pc: out[..length].to_vec() }
        });
        let exchanges = exchanges.collect();
        assert!(pc.executed() as usize >= least(RECORDED as usize), "{} jobs", pc.executed());
        exchanges
    })
}

/// Returns the least number of jobs of this many exchanges, the first of which begin the order.
fn least(exchanges: usize) -> usize {
    exchanges.saturating_sub(5) * FEWEST
}

/// Returns the recorded exchanges, again and again.
fn runs(rounds: u64) -> impl Iterator<Item = &'static [Exchange]> {
    let recorded = recorded();
    (0..rounds)
        .step_by(recorded.len())
        .map(move |before| &recorded[..recorded.len().min((rounds - before) as usize)])
}

pub(super) fn by_session(rounds: u64) {
    for exchanges in runs(rounds) {
        let (mut pc, mut out) = (pc(), [0; 4096]);
        let mut now = Duration::ZERO;
        for exchange in exchanges {
            now += CYCLE;
            black_box(answer(&mut pc, now, black_box(&exchange.robot), black_box(&mut out)));
        }
        assert!(pc.sent() as usize >= least(exchanges.len()), "{} jobs", pc.sent());
    }
}

pub(super) fn by_robot(rounds: u64) {
    for exchanges in runs(rounds) {
        let ((mut robot, mut motion), mut out) = (robot(), [0; 4096]);
        let (mut now, mut executed) = (Duration::ZERO, 0);
        for exchange in exchanges {
            now += CYCLE;
            black_box(report(&mut robot, now, black_box(&mut out)));
            executed += execute(&mut robot, &mut motion, now, black_box(&exchange.pc));
        }
        assert!(executed >= least(exchanges.len()), "{executed} jobs");
    }
}

/// Finds each message, and reads it by the table; writes as many jobs as the session sends.
pub(super) fn by_codec(rounds: u64) {
    for exchanges in runs(rounds) {
        let (dialect, mut decoder, mut out) = (Dialect::DEFAULT, Decoder::new(Charset::Ascii), [0; 4096]);
        let (mut index, ranges) = (0, <Line as Work>::Ranges::default());
        for Exchange { robot, .. } in exchanges {
            assert_eq!(decoder.push(black_box(robot)), robot.len());
            while let Some(message) = decoder.next_frame() {
                black_box(dialect.read(&message.expect("a message"))).expect("one of the table's");
            }
            let mut answer = Packet::new(black_box(&mut out), Limits::TCP, dialect);
            loop {
                let number = (index % 9999) as u16 + 1;
                let job = Job { order: 50, number, work: line(number) };
                match answer.push_job(&black_box(job), &ranges) {
                    Ok(AddResult::Added) => index += 1,
                    _ => break,
                }
            }
        }
    }
}
