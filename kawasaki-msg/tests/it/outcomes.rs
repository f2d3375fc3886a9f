//! Counts, the definition of a work cycle, and jobs that are acknowledged out of turn.

use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{
    Dialect, Entry, Field, JobKind, Line, Pc, PcConfig, Point, Robot, RobotConfig, RobotEvent, Role,
};

const MS: Duration = Duration::from_millis(1);
const SECOND: Duration = Duration::from_secs(1);

const COMMAND: Entry =
    Entry { role: Role::Command(7), name: "Nopeus", header: &[], fields: &[Field::Order, Field::Value] };

/// Returns the default table with a command 7.
fn dialect() -> Dialect {
    Dialect::new([Dialect::DEFAULT.entries(), &[COMMAND]].concat().leak()).unwrap()
}

/// A PC with a command 7 whose robot is the test.
struct Bench {
    now: Duration,
    pc: Pc<&'static [Line]>,
}

impl Bench {
    fn new(config: PcConfig) -> Self {
        let mut pc = Pc::new(PcConfig { dialect: dialect(), ..config }).unwrap();
        pc.handle_connected(Duration::ZERO);
        Self { now: Duration::ZERO, pc }
    }

    /// Passes a packet of the robot, and returns the PC's answer.
    fn cycle(&mut self, packet: &[u8]) -> String {
        self.now += SECOND;
        self.pc.handle_input(self.now, packet);
        let mut out = [0; 4096];
        let length = self.pc.poll_transmit(self.now + 2 * MS, &mut out).expect("an answer");
        String::from_utf8(out[..length].to_vec()).unwrap()
    }
}

/// "From one job executed to the next one of the same order": the mean would say how long nobody drew.
#[test]
fn the_pause_between_orders_is_no_work_cycle() {
    let (writer, mut reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut robot = Robot::<Line>::new(RobotConfig::tcp(), writer).unwrap();
    let mut now = Duration::ZERO;
    robot.handle_timeout(now);
    assert_eq!(robot.poll_event(), Some(RobotEvent::Connect));
    robot.handle_connected(now);
    let mut cycles = 0;
    for (order, pauses) in [(50, [100, 250]), (51, [70, 90])] {
        let mut packet = format!("<TilausAlkaa$4#{order}$1#>");
        for number in 1..=3 {
            packet += &format!("<Tyo$14#{order}${number}$1$0$0$1$1#>");
        }
        packet += &format!("<TilausLoppuu$2#{order}#>");
        robot.poll_transmit(now, &mut [0; 4096]).unwrap();
        robot.handle_input(now, packet.as_bytes());
        assert_eq!((robot.order(), robot.queued()), (Some(order), 3));
        for pause in [0].into_iter().chain(pauses) {
            now += pause * MS;
            let job = reader.take().expect("a job waits");
            robot.job_done(now, job.number).unwrap();
            job.complete();
        }
        robot.handle_timeout(now);
        assert_eq!(robot.order(), None, "it is over");
        while robot.poll_event().is_some() {}
        let times = robot.statistics().work_cycle;
        cycles += 2;
        assert_eq!((times.count(), times.last()), (cycles, Some(pauses[1] * MS)), "order {order}");
        now += 3600 * SECOND;
    }
    assert_eq!(robot.statistics().work_cycle.mean(), Some(510 * MS / 4));
}

const IDLE: &[u8] = b"<Tila$6#0$0$$$#>";
const STARTED: &[u8] = b"<TilausKuittaus$2#50#><TyoPyynto$4#50$1#>";
const LINE: Line = Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(1, 0) };

/// Returns a PC in order 50, whose job numbers go up to `max_number`, and whose jobs may overtake others.
fn overtaking(max_number: u16, jobs: &'static [Line]) -> Bench {
    let config = PcConfig { cumulative_acks: false, max_number, ..PcConfig::tcp() };
    let mut bench = Bench::new(config);
    bench.pc.start(50, jobs).unwrap();
    bench.cycle(IDLE);
    bench.cycle(STARTED);
    bench
}

/// A number stands for one of the jobs in flight, not for the one that has it a round later.
#[test]
fn a_job_is_known_to_be_executed_that_was_acknowledged() {
    let mut bench = overtaking(9, &[LINE; 6]);
    assert_eq!(bench.pc.sent(), 6);
    let executed = |bench: &Bench| (0..30).filter(|index| bench.pc.is_executed(*index)).collect::<Vec<_>>();
    assert!(executed(&bench).is_empty());
    bench.cycle(b"<TyoKuittaus$4#50$1#><TyoKuittaus$4#50$3#><TyoKuittaus$4#50$5#>");
    assert_eq!((bench.pc.executed(), executed(&bench)), (1, vec![0, 2, 4]));
    bench.cycle(b"<TyoKuittaus$4#50$2#>");
    assert_eq!((bench.pc.executed(), executed(&bench)), (3, vec![0, 1, 2, 4]));
}

#[test]
fn an_acknowledgement_that_comes_twice_counts_once() {
    let mut bench = overtaking(4, &[LINE; 9]);
    assert_eq!(bench.pc.sent(), 3, "as many as numbers tell apart");
    bench.cycle(b"<TyoKuittaus$4#50$1#><TyoKuittaus$4#50$1#><TyoPyynto$4#50$4#>");
    bench.cycle(b"<TyoKuittaus$4#50$2#><TyoPyynto$4#50$1#>");
    assert_eq!((bench.pc.executed(), bench.pc.sent()), (2, 5), "number 1 again");
    bench.cycle(b"<TyoKuittaus$4#50$3#><TyoKuittaus$4#50$4#>");
    assert_eq!(bench.pc.executed(), 4);
}

#[test]
fn both_ends_count_packets_corrupt_bytes_and_what_they_discard() {
    let mut bench = Bench::new(PcConfig::tcp());
    for count in 1..=2 {
        bench.cycle(b"x<Huuhaa$0##>");
        let statistics = bench.pc.statistics();
        assert_eq!((statistics.packets, statistics.corrupt), (count, count));
    }
    let (writer, _reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut robot =
        Robot::<Line>::new(RobotConfig { dialect: dialect(), ..RobotConfig::tcp() }, writer).unwrap();
    robot.handle_timeout(SECOND);
    robot.handle_connected(SECOND);
    robot.handle_input(SECOND, b"x<");
    robot.handle_input(SECOND, b"Huuhaa$0##>y<");
    robot.handle_input(SECOND, b"Nopeus$3#0$1#>");
    assert_eq!((robot.statistics().corrupt, robot.statistics().discarded), (2, 0));
    while robot.poll_event().is_some() {}
    // The outcomes are not polled: the last do not fit.
    (0..40).for_each(|_| robot.handle_input(SECOND, b"<Nopeus$3#0$1#>"));
    let events = core::iter::from_fn(|| robot.poll_event());
    let taken = events.filter(|event| matches!(event, RobotEvent::Command { .. })).count();
    assert_eq!(robot.statistics().discarded, 40 - u64::try_from(taken).unwrap());
    assert!(taken > 0 && taken < 39, "{taken}");
}
