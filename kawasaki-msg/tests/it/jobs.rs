//! Jobs: the counts and texts of their errors, and the steps of the recovery. The PC here sends exactly the answers of the test.
#![allow(clippy::cast_possible_truncation)]

use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{
    Decimal, FieldError, FieldFault, Job, Line, MessageError, Name, Phase, RecoveryLimits, RecoveryStep,
    Robot, RobotConfig, RobotEvent, SessionError,
};
use robot_work_queue::Reader;

pub(crate) const MS: Duration = Duration::from_millis(1);
/// A robot that never takes a step of recovery.
pub(crate) const PATIENT: RobotConfig = RobotConfig { patience: Duration::MAX, ..RobotConfig::tcp() };

/// A robot in order 50 whose PC is the test.
pub(crate) struct Bench {
    pub(crate) now: Duration,
    pub(crate) robot: Robot<'static, Line>,
    pub(crate) reader: Reader<'static, Job<Line>>,
}

impl Bench {
    pub(crate) fn new(config: RobotConfig, capacity: usize, max_number: u16) -> Self {
        let (writer, reader) = robot_work_queue::boxed(capacity, max_number).unwrap();
        let config = RobotConfig { max_number, ..config };
        let robot = <Robot<_>>::new(config, writer).unwrap();
        let mut bench = Self { now: Duration::ZERO, robot, reader };
        bench.robot.handle_timeout(bench.now);
        assert_eq!(bench.events(), [RobotEvent::Connect]);
        bench.robot.handle_connected(bench.now);
        assert_eq!(bench.cycle(b"<TilausAlkaa$4#50$1#>"), "<Tila$6#0$0$$$#>");
        let started = "<TilausKuittaus$2#50#><Tila$7#50$2$$$#><TyoPyynto$4#50$1#>";
        assert_eq!(bench.cycle(b"<Huuhaa$0##>"), started);
        assert_eq!(bench.events(), [RobotEvent::OrderStarted { order: 50 }]);
        bench
    }

    /// Returns the bytes that the robot sends in this cycle, and answers them.
    pub(crate) fn cycle(&mut self, answer: &[u8]) -> String {
        self.now += Duration::from_secs(1);
        self.robot.handle_timeout(self.now);
        let mut out = [0; 4096];
        let length = self.robot.poll_transmit(self.now, &mut out).expect("a packet in every cycle");
        assert_eq!(self.robot.poll_transmit(self.now, &mut out), None, "one packet in a cycle");
        self.robot.handle_input(self.now + 3 * MS, answer);
        String::from_utf8(out[..length].to_vec()).unwrap()
    }

    fn events(&mut self) -> Vec<RobotEvent> {
        let all = core::iter::from_fn(|| self.robot.poll_event());
        all.filter(|e| !matches!(e, RobotEvent::NoReply | RobotEvent::PeerStatus { .. })).collect()
    }

    /// Executes the job that waits longest.
    pub(crate) fn execute(&mut self) -> u16 {
        let job = self.reader.take().expect("a job waits");
        let number = job.number;
        self.robot.job_done(self.now, number).unwrap();
        job.complete();
        number
    }

    pub(crate) fn queued_numbers(&self) -> Vec<u16> {
        self.reader.iter().map(|(_, job)| job.number).collect()
    }
}

/// Returns a job in the default table's form.
fn job(number: u16) -> String {
    let data = format!("50${number}$1$0$0$100$100");
    format!("<Tyo${}#{data}#>", data.len())
}

pub(crate) fn jobs(numbers: impl IntoIterator<Item = u16>) -> Vec<u8> {
    numbers.into_iter().map(job).collect::<String>().into_bytes()
}

#[test]
fn a_refusal_says_what_came_and_what_was_expected() {
    let [found, min, max] = [1001, 0, 1000].map(|units| Decimal { units, places: 0 });
    let fault = FieldFault::OutOfRange { found, min, max };
    for (error, text) in [
        (
            MessageError::Field(FieldError { field: Name::of("x2"), fault }),
            "field 'x2' is 1001, not from 0 to 1000",
        ),
        (
            MessageError::UnknownName { name: Name::of("Tuntematon") },
            "there is no message named 'Tuntematon'",
        ),
        (MessageError::JobsMissing { order: 50, expected: 2 }, "the end of order 50 came before job 2"),
    ] {
        assert_eq!(error.to_string(), text);
    }
}

#[test]
fn a_repeated_job_is_dropped_without_harm() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    bench.cycle(&jobs([1, 2, 2, 1, 3]));
    assert_eq!(bench.queued_numbers(), [1, 2, 3]);
    let error = MessageError::Repeated { expected: 3, found: 2 };
    let again = MessageError::Repeated { expected: 3, found: 1 };
    assert_eq!(bench.events(), [error, again].map(RobotEvent::Rejected), "and no recovery");
    assert_eq!(error.to_string(), "job 2 came again, job 3 is the next");
    assert_eq!(bench.robot.statistics().repeated, 2);
}

#[test]
fn a_job_out_of_order_is_asked_for_again() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    bench.cycle(&jobs([1, 3, 4, 5]));
    let error = MessageError::OutOfOrder { expected: 2, found: 3 };
    assert_eq!(bench.events(), [RobotEvent::Rejected(error)]);
    assert_eq!(bench.robot.statistics().discarded, 3);
    assert_eq!(error.to_string(), "job 3 came out of order, job 2 is the next");
    assert!(bench.cycle(&jobs([2, 3])).ends_with("<TyoPyynto$4#50$2#>"));
    assert_eq!(bench.queued_numbers(), [1, 2, 3]);
}

/// The job is read into a place that still has the values from the last connection.
#[test]
fn a_job_that_is_cut_off_is_not_made_whole_by_what_was_read_before() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    let reconnect = |bench: &mut Bench| {
        bench.robot.handle_disconnected(bench.now);
        bench.now += Duration::from_secs(2);
        bench.robot.handle_timeout(bench.now);
        bench.robot.handle_connected(bench.now);
        bench.cycle(b"<Huuhaa$0##>");
    };
    reconnect(&mut bench);
    bench.cycle(job(1).as_bytes());
    let second = job(2);
    for cut in 1..second.len() {
        reconnect(&mut bench);
        bench.cycle(&second.as_bytes()[..cut]);
        assert_eq!(bench.queued_numbers(), [1], "after {cut} bytes");
    }
    bench.robot.handle_input(bench.now + 4 * MS, &second.as_bytes()[second.len() - 1..]);
    assert_eq!(bench.queued_numbers(), [1, 2]);
}

/// §6.3: resend, pause, clear the queue; "if the error cannot be mended in the background program, the motion program is told".
#[test]
fn the_recovery_ends_in_an_alarm() {
    let recovery = RecoveryLimits { resends: 2, pauses: 1, clears: 1 };
    let config = RobotConfig { recovery, pause: MS * 2500, ..RobotConfig::tcp() };
    let bound = config.alarm_bound();
    assert_eq!(bound, Duration::from_millis(5 * 2000 + 2500));
    // The recovery does not stall, whatever the PC does except sending the job.
    let bad = job(3).replace("$100$", "$1x0$") + &job(4);
    for answer in [bad.as_bytes(), &jobs([1]), &jobs([9]), b"<Huuhaa$0##>", b"<<<", b""] {
        let mut bench = Bench::new(RobotConfig { silent_cycles: 0, ..config }, 8, 9999);
        bench.cycle(&jobs([1, 2]));
        assert_eq!([bench.execute(), bench.execute()], [1, 2]);
        bench.events();
        let begin = bench.now;
        let (mut steps, mut packets) = (Vec::new(), Vec::new());
        while bench.robot.phase() != Phase::Alarm {
            assert!(bench.now < begin + bound, "{steps:?}");
            packets.push(bench.cycle(answer));
            // An idle motion task checks its queue: that sweeps it.
            let _ = bench.reader.is_empty();
            for event in bench.events() {
                match event {
                    RobotEvent::Recovery { step, next } => {
                        assert_eq!(next, 3);
                        steps.push(step);
                    }
                    RobotEvent::Alarm { order, next } => {
                        assert_eq!((order, next), (50, 3));
                        steps.push(RecoveryStep::Alarm);
                    }
                    _ => {}
                }
            }
        }
        use RecoveryStep::{Alarm, Clear, Pause, Resend};
        assert_eq!(steps, [Resend, Resend, Pause, Clear, Alarm]);
        let pauses = packets.iter().filter(|packet| packet.contains("TyoTauko")).count();
        assert_eq!(pauses, 1, "{packets:#?}");
        // In alarm no jobs are requested; the status has it: phase 5.
        let packet = bench.cycle(&jobs([3]));
        assert!(packet.contains("<Tila$9#50$5$2$2$#>") && !packet.contains("TyoPyynto"), "{packet}");
        assert!(bench.queued_numbers().is_empty());
        // The motion program clears the queue when the cause is removed.
        bench.robot.clear_queue().unwrap();
        assert!(bench.reader.take().is_none());
        bench.cycle(b"<Huuhaa$0##>");
        bench.cycle(b"<Huuhaa$0##>");
        assert!(bench.cycle(&jobs(3..=5)).ends_with("<TyoPyynto$4#50$3#>"));
        assert_eq!(bench.queued_numbers(), [3, 4, 5]);
    }
}

#[test]
fn a_job_is_done_once_and_only_if_it_was_queued() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    bench.cycle(&jobs(1..=3));
    assert_eq!(bench.execute(), 1);
    for number in [0, 1, 4, 9999] {
        assert_eq!(bench.robot.job_done(bench.now, number), Err(SessionError::NotQueued { number }));
    }
    assert_eq!(bench.robot.statistics().executed, 1);
}

/// The motion task completes a job a moment after it has reported it as executed.
#[test]
fn a_queue_is_cleared_when_no_job_of_it_is_left() {
    let recovery = RecoveryLimits { resends: 0, pauses: 0, clears: 1 };
    let mut bench = Bench::new(RobotConfig { recovery, patience: MS * 2500, ..RobotConfig::tcp() }, 8, 9999);
    bench.cycle(&jobs([1]));
    let (_, none) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut reader = core::mem::replace(&mut bench.reader, none);
    let last = reader.take().expect("a job waits");
    bench.robot.job_done(bench.now, 1).unwrap();
    let clear = RobotEvent::Recovery { step: RecoveryStep::Clear, next: 2 };
    while !bench.events().contains(&clear) {
        bench.cycle(b"<Huuhaa$0##>");
    }
    let cleared = RobotEvent::QueueCleared { next: 2 };
    bench.cycle(b"<Huuhaa$0##>");
    assert!(!bench.events().contains(&cleared));
    last.complete();
    bench.cycle(b"<Huuhaa$0##>");
    bench.cycle(b"<Huuhaa$0##>");
    assert!(bench.events().contains(&cleared));
}
