//! A PC's exchange: the robot's packet, which acknowledges the jobs of the packet before, is read, and a packet full of jobs is built;
//! and what the codec alone takes for both.

use core::hint::black_box;
use core::time::Duration;

use kawasaki_msg::robot_session::{Decoder as _, Session};
use kawasaki_msg::{
    Charset, Decoder, Dialect, Job, JobSource, LargeRobot, Limits, Line, Packet, Pc, PcConfig, RobotConfig,
    Room, Supply, Work,
};

use super::{JOBS, line};

pub const BY_SESSION: &str = "a PC's exchange: 98 jobs acknowledged, a packet of lines sent";
pub const BY_CODEC: &str = "… by the codec alone";

/// Of this many rounds one is an exchange: the robot's packets are recorded first, always the same number of them.
pub const ROUNDS: f64 = 10.0;
/// Those of 1000 rounds.
const EXCHANGES: usize = 100;
const CYCLE: Duration = Duration::from_millis(32);
/// From the robot's packet to the answer.
const DELAY: Duration = Duration::from_millis(2);
/// The jobs of a packet when the numbers have four digits: those of the last exchanges.
const FEWEST: usize = JOBS as usize - 5;

fn pc() -> Pc<'static, impl JobSource<Work = Line>> {
    let source = |index: u32| Supply::Job(line((index % 9999) as u16 + 1));
    let mut pc = Pc::new(PcConfig::TCP).expect("a PC");
    pc.start(50, source).expect("no order is active");
    pc.handle_connected(Duration::ZERO);
    pc
}

/// The answer to what the robot has sent, and the end of all that is to be reported.
fn answer(pc: &mut Pc<'_, impl JobSource>, now: Duration, packet: &[u8], out: &mut [u8]) -> usize {
    pc.handle_input(now, packet);
    pc.handle_timeout(now + DELAY);
    let length = pc.poll_transmit(now + DELAY, out).expect("each packet is answered");
    while let Some(event) = pc.poll_event() {
        black_box(event);
    }
    length
}

/// The robot's packets, one each cycle. It executes all that it has queued in every cycle.
fn record() -> Vec<Vec<u8>> {
    let (jobs, mut reader) = kawasaki_msg::motion::boxed(256, 9999).expect("a queue");
    let mut robot = LargeRobot::<Line>::sized(RobotConfig::TCP, jobs).expect("a robot");
    let (mut pc, mut out) = (pc(), [0; 4096]);
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    let cycles = (1..=EXCHANGES as u32).map(|cycle| CYCLE * cycle);
    let packets = cycles.map(|now| {
        robot.handle_timeout(now);
        let length = robot.poll_transmit(now, &mut out).expect("the robot speaks in each cycle");
        let packet = out[..length].to_vec();
        let length = answer(&mut pc, now, &packet, &mut out);
        robot.handle_input(now + 2 * DELAY, &out[..length]);
        while let Some(job) = reader.take() {
            job.complete();
        }
        while robot.poll_event().is_some() {}
        packet
    });
    let packets = packets.collect();
    assert!(pc.executed() as usize > (EXCHANGES - 5) * FEWEST, "{} jobs", pc.executed());
    packets
}

fn exchanges(rounds: u64) -> usize {
    let exchanges = rounds as usize / ROUNDS as usize;
    assert!(exchanges <= EXCHANGES);
    exchanges
}

pub fn by_session(rounds: u64) {
    let (packets, mut pc, mut out) = (record(), pc(), [0; 4096]);
    let mut now = Duration::ZERO;
    for packet in packets.iter().take(exchanges(rounds)) {
        now += CYCLE;
        black_box(answer(&mut pc, now, black_box(packet), black_box(&mut out)));
    }
    assert!(pc.sent() as usize > (exchanges(rounds) - 5) * FEWEST, "{} jobs", pc.sent());
}

/// Each message is found, and read by the table; as many jobs as the session sends are written.
pub fn by_codec(rounds: u64) {
    let (packets, mut out) = (record(), [0; 4096]);
    let (dialect, mut decoder) = (Dialect::DEFAULT, Decoder::new(Charset::Ascii));
    let (mut index, ranges) = (0, <Line as Work>::Ranges::default());
    for packet in packets.iter().take(exchanges(rounds)) {
        assert_eq!(decoder.push(black_box(packet)), packet.len());
        while let Some(message) = decoder.next_frame() {
            black_box(dialect.read(&message.expect("a message"))).expect("one of the table's");
        }
        let mut answer = Packet::new(black_box(&mut out), Limits::TCP, Charset::Ascii);
        loop {
            let number = (index % 9999) as u16 + 1;
            let job = Job { order: 50, number, work: line(number) };
            match answer.push_job(&dialect, &black_box(job), &ranges) {
                Ok(Room::Added) => index += 1,
                _ => break,
            }
        }
    }
}
