//! The AS program against a PC that sends exactly a test's messages: the stories of `kawasaki-msg/tests/jobs.rs`, stories of
//! its own, and tests that each of its rules is needed.

use core::num::NonZeroU16;
use core::time::Duration;
use std::panic::{AssertUnwindSafe, catch_unwind};

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{Acks, Bounds, Point, RecoveryLimits, RobotConfig, RobotEvent};
use testkit::controller::{AsRobot, Controller as _};

const MS: Duration = Duration::from_millis(1);
/// A robot that never takes a step of recovery.
const PATIENT: RobotConfig = RobotConfig { patience: Duration::from_secs(500), ..RobotConfig::tcp() };
const END: &[u8] = b"<TilausLoppuu$2#50#>";
const FILLER: &[u8] = b"<Huuhaa$0##>";

/// A text of the program, and its replacement.
type Change = (&'static str, &'static str);

/// A robot in order 50 whose PC is the test.
struct Bench {
    now: Duration,
    robot: AsRobot,
}

impl Bench {
    fn new(change: Option<Change>, config: RobotConfig, capacity: usize, max_number: u16) -> Self {
        Self::within(Bounds::WIDEST, change, RobotConfig { max_number, ..config }, capacity)
    }

    fn within(bounds: Bounds, change: Option<Change>, config: RobotConfig, capacity: usize) -> Self {
        let robot = match change {
            None => AsRobot::within(bounds, config, capacity, 1),
            Some(change) => AsRobot::altered(bounds, config, capacity, 1, change),
        };
        let mut bench = Self { now: Duration::ZERO, robot };
        bench.begin();
        bench
    }

    /// Begins order 50.
    fn begin(&mut self) {
        self.robot.handle_timeout(self.now);
        assert_eq!(self.robot.poll_event(), Some(RobotEvent::Connect));
        self.robot.handle_connected(self.now);
        assert_eq!(self.cycle(b"<TilausAlkaa$4#50$1#>"), "<Tila$6#0$0$$$#>");
        assert_eq!(self.cycle(FILLER), "<TilausKuittaus$2#50#><Tila$7#50$2$$$#><TyoPyynto$4#50$1#>");
    }

    /// Runs a cycle of the robot; returns its packet, which is answered with `answer`.
    fn cycle(&mut self, answer: &[u8]) -> String {
        let (mut out, begin) = ([0; 4096], self.now);
        let length = loop {
            self.now += 20 * MS;
            self.robot.handle_timeout(self.now);
            if let Some(length) = self.robot.poll_transmit(self.now, &mut out) {
                break length;
            }
            assert!(self.now < begin + 3000 * MS, "no packet");
        };
        assert_eq!(self.robot.poll_transmit(self.now, &mut out), None, "one packet in a cycle");
        self.robot.handle_input(self.now + 3 * MS, answer);
        String::from_utf8(out[..length].to_vec()).unwrap()
    }

    /// Ends the connection, and opens another.
    fn reconnect(&mut self) {
        self.robot.handle_disconnected(self.now);
        while core::iter::from_fn(|| self.robot.poll_event()).all(|event| event != RobotEvent::Connect) {
            self.now += 100 * MS;
            self.robot.handle_timeout(self.now);
        }
        self.robot.handle_connected(self.now);
    }

    fn execute(&mut self) -> u16 {
        self.robot.execute(self.now, false).expect("a job waits").number
    }

    /// Returns the numbers of the jobs that are not executed, in sequence.
    fn queued(&mut self) -> Vec<u16> {
        core::iter::from_fn(|| self.robot.execute(self.now, false)).map(|job| job.number).collect()
    }

    fn stage(&self) -> f32 {
        self.robot.real("x.stage")
    }
}

fn job_to(number: u16, x: i32) -> String {
    let data = format!("50${number}$1$0$0${x}$100");
    format!("<Tyo${}#{data}#>", data.len())
}

fn jobs(numbers: impl IntoIterator<Item = u16>) -> Vec<u8> {
    numbers.into_iter().map(|number| job_to(number, 100)).collect::<String>().into_bytes()
}

/// Tests §7.2: the rest of the packet is destroyed, including its end; when the queue has drained, the jobs are requested
/// again.
fn a_full_queue(change: Option<Change>) {
    let mut bench = Bench::new(change, RobotConfig { low_water: Some(1), ..PATIENT }, 3, 9999);
    bench.cycle(&[jobs(1..=4), END.to_vec()].concat());
    assert_eq!(bench.stage(), 1.0);
    assert_eq!(bench.cycle(FILLER), "<TyoTauko$4#50$3#>");
    assert_eq!(bench.execute(), 1);
    assert!(!bench.cycle(FILLER).contains("TyoPyynto"), "two are left");
    assert_eq!(bench.execute(), 2);
    bench.cycle(FILLER);
    assert!(bench.cycle(&[jobs(4..=5), END.to_vec()].concat()).ends_with("<TyoPyynto$4#50$4#>"), "last + 1");
    assert_eq!((bench.stage(), bench.queued()), (3.0, vec![3, 4, 5]));
}

/// Tests n = 3, highest number 5: jobs 1, 2, 3; full; 4, 5 and then 1 again.
fn numbers_wrap(change: Option<Change>) {
    let mut bench = Bench::new(change, RobotConfig { low_water: Some(2), ..PATIENT }, 3, 5);
    bench.cycle(&jobs(1..=4));
    for (done, next) in [(1, 4), (2, 5), (3, 1)] {
        assert_eq!(bench.execute(), done);
        bench.cycle(FILLER);
        bench.cycle(&jobs([next]));
    }
    assert_eq!(bench.queued(), [4, 5, 1]);
}

/// Tests that repeated jobs are harmless, and that the rest of the packet is lost after other jobs that are not the next
/// one.
fn what_follows_a_failed_message_is_destroyed(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    bench.cycle(&jobs([1, 1, 2]));
    for failed in [
        "<Tyo$14#50$5$1$0$0$1$1#>",
        "<Tyo$15#50$3$1$0$0$0$0#>",
        "<Tyo$9#50$3$1$0$0#>",
        "<Tyo$12#50$3$1$0$$0#>",
        "<Tyo$13#50$3$1$0$$0$0#>",
        "<Tyo$16#50$3$1$0$0.5$0$0#>",
        "<Tyo$14#50$3$3$0$0$0$0#>",
        "<Tyo$14#51$3$1$0$0$0$0#>",
        "<Tuntematon$1#1#>",
        "<TilausAlkaa$1#5#>",
        "<Tyo$14#50$3",
        "<Tyo14#50$3$1$0$0$0$0#>",
        "<Tyo$14#50$3$1$0$0$0$0>",
        "roskaa",
        "<",
    ] {
        // The packet comes in two reads.
        bench.cycle(&[failed.as_bytes(), b"<Tyo$14#50$3$1$0$"].concat());
        bench.robot.handle_input(bench.now + 4 * MS, &[b"0$1$1#>", jobs([3]).as_slice(), END].concat());
        assert_eq!((bench.robot.real("x.last"), bench.stage()), (2.0, 1.0), "{failed}");
        assert!(bench.cycle(FILLER).ends_with("<TyoPyynto$4#50$3#>"));
    }
    bench.cycle(&jobs(3..=4));
    assert_eq!(bench.queued(), [1, 2, 3, 4]);
}

/// Tests that an end must come twice if jobs are missing, each time as the answer to a request.
fn an_end_in_place_of_missing_jobs(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    bench.cycle(&jobs([1, 3]));
    assert!(bench.cycle(END).ends_with("<TyoPyynto$4#50$2#>"));
    assert_eq!(bench.stage(), 1.0);
    assert!(bench.cycle(END).ends_with("<TyoPyynto$4#50$2#>"));
    assert_eq!(bench.stage(), 3.0);
}

/// Tests that jobs may be missing after a new connection: an end that comes first belongs to the old connection.
fn an_end_after_a_new_connection(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    bench.cycle(&jobs([1]));
    bench.reconnect();
    assert!(bench.cycle(END).starts_with("<Tila$8#50$2$1$$#>"));
    assert_eq!(bench.stage(), 1.0);
    bench.robot.clear_queue().unwrap();
    bench.cycle(END);
    assert!(bench.stage() < 3.0, "not while the list is cleared");
}

/// Tests §6.3: resend, pause, clear, alarm, as long as the PC does not send the job.
fn the_recovery_ends_in_an_alarm(change: Option<Change>) {
    let recovery = RecoveryLimits { resends: 2, pauses: 1, clears: 1 };
    let config = RobotConfig { recovery, pause: MS * 2500, silent_cycles: 0, ..RobotConfig::tcp() };
    let bad = [job_to(3, 99_999_999).into_bytes(), jobs([4])].concat();
    for answer in [&bad, &jobs([1]), &jobs([9]), FILLER, b"<<<", b""] {
        let mut bench = Bench::new(change, config, 8, 9999);
        bench.cycle(&jobs([1, 2]));
        assert_eq!([bench.execute(), bench.execute()], [1, 2]);
        let begin = bench.now;
        while bench.stage() != 5.0 {
            assert!(bench.now <= begin + config.alarm_bound(), "{:?}", bench.robot.printed());
            bench.cycle(answer);
        }
        let steps: Vec<_> = bench.robot.printed().iter().filter_map(|line| line.split(' ').next()).collect();
        let steps: Vec<_> =
            steps.into_iter().filter(|word| ["resend", "pause", "clear", "alarm"].contains(word)).collect();
        assert_eq!(steps, ["resend", "resend", "pause", "clear", "alarm"]);
        assert!(bench.robot.machine().signal(2004), "for the motion program and the operator");
        bench.robot.clear_queue().unwrap();
        for _ in 0..4 {
            bench.cycle(FILLER);
        }
        assert!(!bench.robot.machine().signal(2004));
        assert!(bench.cycle(&jobs(3..=5)).ends_with("<TyoPyynto$4#50$3#>"));
        assert_eq!(bench.queued(), [3, 4, 5]);
    }
}

/// Tests that a PC that closes each connection before it has sent anything makes no progress either.
fn connections_that_end_are_steps(change: Option<Change>) {
    let config = RobotConfig { patience: Duration::from_secs(500), ..RobotConfig::tcp() };
    let mut bench = Bench::new(change, config, 8, 9999);
    bench.cycle(&jobs([1]));
    assert_eq!(bench.execute(), 1);
    for _ in 0..8 {
        bench.reconnect();
        bench.now += MS;
        bench.robot.handle_timeout(bench.now);
    }
    assert_eq!(bench.stage(), 5.0, "{:?}", bench.robot.printed());
}

fn a_long_job_is_no_standstill(change: Option<Change>) {
    let mut bench = Bench::new(change, RobotConfig::tcp(), 8, 9999);
    bench.cycle(&jobs([1]));
    for _ in 0..50 {
        bench.cycle(&jobs([7]));
    }
    assert_eq!((bench.robot.real("x.fails"), bench.execute(), bench.stage()), (0.0, 1, 1.0));
}

/// Tests that the job being executed is not removed, and not requested again.
fn a_cleared_list(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    bench.cycle(&jobs(1..=6));
    bench.execute();
    bench.robot.clear_queue().unwrap();
    bench.cycle(FILLER);
    bench.cycle(FILLER);
    assert_eq!((bench.stage(), bench.execute()), (2.0, 2));
    for _ in 0..3 {
        bench.cycle(FILLER);
    }
    assert!(bench.cycle(&jobs(3..=8)).ends_with("<TyoPyynto$4#50$3#>"));
    assert_eq!(bench.queued(), [3, 4, 5, 6, 7, 8]);
}

fn acknowledgements(change: Option<Change>) {
    let every = |every| Acks::Cumulative { every: NonZeroU16::new(every).unwrap() };
    let mut bench = Bench::new(change, RobotConfig { acks: every(3), ..PATIENT }, 8, 9999);
    bench.cycle(&jobs(1..=8));
    (0..7).for_each(|_| _ = bench.execute());
    bench.cycle(FILLER);
    assert_eq!(bench.robot.real("x.toack"), 1.0, "the seventh waits for two more");
    let config = RobotConfig { acks: every(10), status_period: Duration::from_secs(1000), ..PATIENT };
    let mut bench = Bench::new(change, config, 4, 9999);
    bench.cycle(&jobs(1..=5));
    bench.cycle(FILLER);
    bench.execute();
    assert_eq!(bench.cycle(FILLER), "<TyoKuittaus$4#50$1#>", "there is nothing else to send");
    assert_eq!(bench.cycle(FILLER), "<Huuhaa$0##>");
}

/// Tests that 400 acknowledgements, which do not fit a packet, continue in the next string when one is full.
fn many_acknowledgements(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 400, 9999);
    for packet in jobs(1..=400).chunks(4000) {
        bench.cycle(packet);
    }
    assert_eq!(bench.queued().len(), 400);
    let packets: Vec<String> = (0..5).map(|_| bench.cycle(FILLER)).collect();
    let acks: Vec<usize> = packets.iter().map(|packet| packet.matches("TyoKuittaus").count()).collect();
    assert_eq!(acks.iter().sum::<usize>(), 400, "{acks:?}");
    assert!(packets.iter().all(|packet| packet.len() <= 4096), "{acks:?}");
}

/// Tests that a real of 24 bits suffices: after hours the program still resolves a millisecond.
fn a_clock_that_runs_for_hours(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    for _ in 0..40_000 {
        bench.cycle(FILLER);
    }
    assert!(bench.robot.real("x.now") < 1001.0);
    let ready = bench.robot.real("x.t.ready");
    bench.now += Duration::from_secs(1);
    bench.robot.handle_timeout(bench.now);
    assert!(bench.robot.real("x.t.over") - ready > 0.9, "{ready}");
}

/// Tests that a late answer is attributed to its own cycle, so that the next ones are not late too.
fn a_late_answer(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    bench.cycle(b"");
    bench.cycle(FILLER);
    assert_eq!(bench.robot.real("x.wait"), -1.0, "that was the earlier one's");
    bench.robot.handle_input(bench.now + 5 * MS, &jobs([1]));
    assert_eq!((bench.robot.real("x.wait"), bench.queued()), (0.0, vec![1]));
}

fn blanks_zeros_and_more_fields_in_the_header(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    bench.cycle(b"<Tyo$ 19 # 50$ 1$1$ 0$-5 $0$0#><Tyo$x$y$014#50$2$1$0$0$1$1#>");
    let drawn = bench.robot.execute(bench.now, false).unwrap();
    assert_eq!((drawn.work.start, bench.queued()), (Point::new(0, -5), vec![2]));
}

fn coordinates_have_limits(change: Option<Change>) {
    let bounds = Bounds { min: Point::new(0, 0), max: Point::new(1000, 1000) };
    let mut bench = Bench::within(bounds, change, PATIENT, 8);
    for (number, x, taken) in [(1, 1000, true), (2, 1001, false), (2, -1, false), (2, 0, true)] {
        bench.cycle(job_to(number, x).as_bytes());
        assert_eq!(bench.robot.real("x.last") == f32::from(number), taken, "{x}");
        bench.cycle(FILLER);
    }
}

/// Tests that half a message of the last connection has no effect.
fn a_job_that_is_cut_off(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    let first = jobs([1]);
    for cut in (1..first.len()).step_by(5) {
        bench.reconnect();
        bench.cycle(FILLER);
        bench.cycle(&first[..cut]);
        bench.reconnect();
        bench.cycle(&first[cut..]);
        assert_eq!(bench.robot.real("x.last"), 0.0, "after {cut} bytes");
    }
}

/// Tests a motion program that was stopped in the middle of a job and restarted: the order is over, and no job is drawn
/// again.
fn a_motion_program_that_was_stopped(change: Option<Change>) {
    let mut bench = Bench::new(change, PATIENT, 8, 9999);
    bench.cycle(&jobs(1..=3));
    assert_eq!(bench.execute(), 1);
    bench.robot.restart_motion();
    for _ in 0..4 {
        bench.cycle(FILLER);
    }
    assert_eq!((bench.robot.order(), bench.queued()), (None, vec![]));
    assert!(bench.robot.printed().contains(&"over 50 1".into()), "{:?}", bench.robot.printed());
    bench.cycle(b"<TilausAlkaa$4#50$1#>");
    bench.cycle(FILLER);
    bench.cycle(&jobs(1..=2));
    assert_eq!(bench.queued(), [1, 2]);
}

type Story = fn(Option<Change>);

const STORIES: [Story; 17] = [
    a_full_queue,
    numbers_wrap,
    what_follows_a_failed_message_is_destroyed,
    an_end_in_place_of_missing_jobs,
    an_end_after_a_new_connection,
    the_recovery_ends_in_an_alarm,
    connections_that_end_are_steps,
    a_long_job_is_no_standstill,
    a_cleared_list,
    acknowledgements,
    many_acknowledgements,
    a_clock_that_runs_for_hours,
    a_late_answer,
    blanks_zeros_and_more_fields_in_the_header,
    coordinates_have_limits,
    a_job_that_is_cut_off,
    a_motion_program_that_was_stopped,
];

#[test]
fn the_program_does_what_the_session_does() {
    STORIES.iter().for_each(|story| story(None));
}

/// Each rule taken out of the program, and a story that shows it.
#[test]
fn each_rule_is_needed() {
    const NEVER: &str = "IF FALSE THEN";
    let cases: [(&str, Change, Story); 14] = [
        (
            "what follows a failed message is destroyed",
            ("IF x.stage == 1 AND x.gap <> 1 THEN", "IF x.stage == 1 THEN"),
            what_follows_a_failed_message_is_destroyed,
        ),
        (
            "an end fills no gap",
            ("IF x.stage == 1 AND x.gap >= 1 AND x.gap <= 3 THEN", NEVER),
            an_end_in_place_of_missing_jobs,
        ),
        (
            "the rest of a full packet is destroyed",
            ("    x.r.pause = TRUE\n  END\n  x.gap = 1", "    x.r.pause = TRUE\n  END"),
            a_full_queue,
        ),
        (
            "jobs are missing after a new connection",
            ("    CALL cw.end.pause\n    x.gap = 1", "    CALL cw.end.pause"),
            an_end_after_a_new_connection,
        ),
        ("steps by the clock", ("IF x.rec AND x.now >= x.t.step THEN", NEVER), the_recovery_ends_in_an_alarm),
        (
            "a connection that ends is a step",
            (
                "  x.rec = FALSE\n  IF x.open == 0 THEN\n    CALL cw.step",
                "  x.rec = FALSE\n  IF FALSE THEN\n    CALL cw.step",
            ),
            connections_that_end_are_steps,
        ),
        (
            "no step while a job is being executed",
            ("IF x.open == 0 AND NOT x.rec THEN", "IF NOT x.rec THEN"),
            a_long_job_is_no_standstill,
        ),
        ("the motion task clears the list", ("WHILE x.ok[x.rd] == 1 DO", "WHILE FALSE DO"), a_cleared_list),
        ("a list that is cleared is waited for", (".settled = NOT x.clr", ".settled = TRUE"), a_cleared_list),
        ("the clock is set back", ("IF x.now < 1000 THEN", "IF TRUE THEN"), a_clock_that_runs_for_hours),
        ("a late answer is an earlier cycle's", ("IF x.late > 0 THEN", NEVER), a_late_answer),
        (
            "nothing of a connection is left for the next",
            ("  $x.in = \"\"\n  x.wait = FALSE", "  x.wait = FALSE"),
            a_job_that_is_cut_off,
        ),
        (
            "a packet has a limit",
            (".ok = x.len + LEN (.$m) <= cw.packet", ".ok = TRUE"),
            many_acknowledgements,
        ),
        (
            "a job that was half done is not begun again",
            ("    SIGNAL cw.s.reset\n    WAIT x.clr", "    WAIT TRUE"),
            a_motion_program_that_was_stopped,
        ),
    ];
    for (_, (from, to), story) in &cases {
        // The program can be loaded as before, and the story is true with all rules.
        let _ = AsRobot::altered(Bounds::WIDEST, PATIENT, 8, 1, (from, to));
        story(None);
    }
    std::panic::set_hook(Box::new(|_| {}));
    let kept: Vec<_> = cases
        .iter()
        .filter(|(_, change, story)| catch_unwind(AssertUnwindSafe(|| story(Some(*change)))).is_ok())
        .map(|(rule, ..)| rule)
        .collect();
    let _ = std::panic::take_hook();
    assert!(kept.is_empty(), "not needed: {kept:?}");
}

/// A job that is executed between the look at the list and its report would be asked for, and executed, again.
#[test]
fn the_list_is_looked_at_before_what_is_executed_is_collected() {
    let late = ("  .settled = NOT x.clr\n  CALL cw.collect\n", "  CALL cw.collect\n  .settled = NOT x.clr\n");
    let repeats = |change: Option<Change>| {
        (0..400).any(|seed| {
            let config = RobotConfig { max_number: 99, ..PATIENT };
            let robot = match change {
                None => AsRobot::begin(config, 8, seed),
                Some(change) => AsRobot::altered(Bounds::WIDEST, config, 8, seed, change),
            };
            let mut bench = Bench { now: Duration::ZERO, robot };
            bench.begin();
            bench.cycle(&jobs(1..=3));
            bench.robot.clear_queue().unwrap();
            bench.cycle(FILLER);
            // The next pass of the communication task, and the end of the job, at the same time.
            bench.now += 40 * MS;
            assert_eq!(bench.robot.execute(bench.now, false).map(|job| job.number), Some(1));
            let mut drawn = 1;
            for _ in 0..6 {
                bench.cycle(FILLER);
                drawn += bench.queued().len();
            }
            assert_eq!(bench.stage(), 1.0);
            bench.robot.real("x.last") != drawn as f32
        })
    };
    assert!(!repeats(None));
    assert!(repeats(Some(late)), "not needed");
}

#[test]
fn without_a_motion_task_no_order_is_taken() {
    let mut bench = Bench { now: Duration::ZERO, robot: AsRobot::begin(RobotConfig::tcp(), 4, 1) };
    bench.robot.stop_motion();
    bench.robot.handle_timeout(bench.now);
    bench.robot.handle_connected(bench.now);
    bench.cycle(b"<TilausAlkaa$4#50$1#>");
    assert!(bench.cycle(FILLER).starts_with("<TilausKuittaus$1#0#>"));
    bench.robot.restart_motion();
    bench.cycle(FILLER);
    bench.cycle(b"<TilausAlkaa$4#50$1#>");
    assert!(bench.cycle(FILLER).starts_with("<TilausKuittaus$2#50#>"));
}
