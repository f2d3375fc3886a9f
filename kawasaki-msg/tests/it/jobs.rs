//! Jobs: their errors, the reactions to these, flow control, acknowledgements. The PC here sends exactly the answers of the
//! test.
#![allow(clippy::cast_possible_truncation)]

use core::num::NonZeroU16;
use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{
    Acks, Bounds, Decimal, DecodeError, FieldError, FieldFault, Job, Line, MessageError, Name, Phase, Point,
    RecoveryLimits, RecoveryStep, Robot, RobotConfig, RobotEvent, SessionError,
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
        Self::within(Bounds::WIDEST, config, capacity, max_number)
    }

    fn within(bounds: Bounds, config: RobotConfig, capacity: usize, max_number: u16) -> Self {
        let (writer, reader) = robot_work_queue::boxed(capacity, max_number).unwrap();
        let config = RobotConfig { max_number, ..config };
        let robot = <Robot<_>>::with_ranges(config, writer, bounds).unwrap();
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
    job_to(number, 100)
}

fn job_to(number: u16, x: i32) -> String {
    let data = format!("50${number}$1$0$0${x}$100");
    format!("<Tyo${}#{data}#>", data.len())
}

pub(crate) fn jobs(numbers: impl IntoIterator<Item = u16>) -> Vec<u8> {
    numbers.into_iter().map(job).collect::<String>().into_bytes()
}

fn whole(units: i32) -> Decimal {
    Decimal { units, places: 0 }
}

fn field(name: &str, fault: FieldFault) -> MessageError {
    MessageError::Field(FieldError { field: Name::of(name), fault })
}

fn rejected(events: &[RobotEvent]) -> Vec<MessageError> {
    let errors = events.iter().filter_map(|e| match e {
        RobotEvent::Rejected(error) => Some(*error),
        _ => None,
    });
    errors.collect()
}

/// §7.2: of five messages three fit: "the rest of the packet is destroyed, and after the queue has drained a resend is asked
/// for".
#[test]
fn a_full_queue_discards_the_rest_and_asks_again_when_it_has_drained() {
    let mut bench = Bench::new(RobotConfig { low_water: Some(1), ..PATIENT }, 3, 9999);
    bench.cycle(&jobs(1..=5));
    assert_eq!(bench.queued_numbers(), [1, 2, 3]);
    assert_eq!(
        bench.events(),
        [
            RobotEvent::Rejected(MessageError::QueueFull { number: 4 }),
            RobotEvent::QueueFull { last: Some(3) }
        ]
    );
    assert_eq!(bench.robot.statistics().discarded, 2);
    assert_eq!(bench.cycle(b"<Huuhaa$0##>"), "<Tila$8#50$2$3$$#><TyoTauko$4#50$3#>");
    assert_eq!(bench.execute(), 1);
    assert!(!bench.cycle(b"<Huuhaa$0##>").contains("TyoPyynto"), "two are left");
    assert_eq!(bench.execute(), 2);
    assert!(bench.cycle(&jobs(4..=5)).ends_with("<TyoPyynto$4#50$4#>"), "last + 1");
    assert_eq!(bench.events(), [RobotEvent::QueueDrained { next: 4 }]);
    assert_eq!(bench.queued_numbers(), [3, 4, 5]);
}

/// n = 3, highest number 5: jobs 1, 2, 3; full; 4, 5 and then 1 again in the slots that became free.
#[test]
fn numbers_wrap_in_the_ring() {
    let mut bench = Bench::new(RobotConfig { low_water: Some(2), ..PATIENT }, 3, 5);
    bench.cycle(&jobs(1..=4));
    for next in [4, 5, 1] {
        bench.execute();
        bench.cycle(&jobs([next]));
        assert_eq!(bench.queued_numbers().last(), Some(&next));
    }
    assert_eq!(bench.queued_numbers(), [4, 5, 1]);
    assert_eq!(bench.robot.queued(), 6);
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

#[test]
fn a_coordinate_out_of_range_is_refused() {
    let bounds = Bounds { min: Point::new(0, 0), max: Point::new(1000, 1000) };
    let mut bench = Bench::within(bounds, PATIENT, 8, 9999);
    let packet = [job(1), job_to(2, 1000), job_to(3, 1001), job(4)].concat();
    bench.cycle(packet.as_bytes());
    assert_eq!(bench.queued_numbers(), [1, 2]);
    let out_of_range = |found| {
        let [found, min, max] = [found, 0, 1000].map(whole);
        field("x2", FieldFault::OutOfRange { found, min, max })
    };
    let error = out_of_range(1001);
    assert_eq!(rejected(&bench.events()), [error]);
    assert_eq!(error.to_string(), "field 'x2' is 1001, not from 0 to 1000");
    bench.cycle(job_to(3, -1).as_bytes());
    assert_eq!(rejected(&bench.events()), [out_of_range(-1)]);
    bench.cycle(&jobs([3, 4]));
    assert_eq!(bench.queued_numbers(), [1, 2, 3, 4], "the session goes on");
}

#[test]
fn a_job_whose_parameters_are_incomplete_is_refused() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    let not_a_number = FieldFault::NotANumber { min: whole(-9_999_999), max: whole(9_999_999) };
    let kind = FieldFault::OutOfRange { found: whole(3), min: whole(1), max: whole(2) };
    for (message, error) in [
        ("<Tyo$10#50$1$1$0$0#>", field("x2", FieldFault::Missing)),
        ("<Tyo$4#50$1#>", field("kind", FieldFault::Missing)),
        ("<Tyo$2#50#>", MessageError::FieldCount { expected: 3, found: 1 }),
        ("<Tyo$16#50$1$1$0$0$0$0$0#>", MessageError::FieldCount { expected: 7, found: 8 }),
        ("<Tyo$13#50$1$1$0$$0$0#>", field("y1", not_a_number)),
        ("<Tyo$16#50$1$1$0$0.5$0$0#>", field("y1", not_a_number)),
        ("<Tyo$14#50$1$3$0$0$0$0#>", field("kind", kind)),
        ("<Tyo$14#50$0$1$0$0$0$0#>", MessageError::OutOfRange { field: 1, found: 0, min: 1, max: 9999 }),
        ("<Tyo$14#51$1$1$0$0$0$0#>", MessageError::WrongOrder { active: 50, found: 51 }),
    ] {
        bench.cycle(message.as_bytes());
        assert_eq!(rejected(&bench.events()), [error], "{message}");
        assert_eq!(bench.queued_numbers(), [0_u16; 0]);
        bench.cycle(b"<Huuhaa$0##>");
        assert_eq!(bench.events(), []);
    }
}

#[test]
fn blanks_around_numbers_are_no_error() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    bench.cycle(b"<Tyo$ 19 # 50$ 1$1$ 0$-5 $0$0#>");
    assert_eq!(bench.events(), []);
    assert_eq!(bench.reader.take().unwrap().work.start, Point::new(0, -5));
}

/// §7.2, §12: the messages after a failed message in a packet are destroyed, including the order's end.
#[test]
fn what_follows_a_failed_message_is_destroyed() {
    let wrong_length = b"<Tyo$15#50$9$1$0$0$0$0#>".as_slice();
    let unknown = b"<Tuntematon$1#1#>".as_slice();
    for (failed, first) in [(wrong_length, "corrupt"), (unknown, "unknown")] {
        let mut bench = Bench::new(PATIENT, 8, 9999);
        bench.cycle(&[&jobs([1]), failed, &jobs([2]), unknown, b"<TilausLoppuu$2#50#>"].concat());
        let events = bench.events();
        match events[0] {
            RobotEvent::Corrupt(DecodeError::Length { expected: 15, found: 14, .. }) => {
                assert_eq!(first, "corrupt");
            }
            RobotEvent::Rejected(error @ MessageError::UnknownName { name }) => {
                assert_eq!((first, name.to_string()), ("unknown", "Tuntematon".into()));
                assert_eq!(error.to_string(), "there is no message named 'Tuntematon'");
            }
            _ => panic!("{events:?}"),
        }
        assert_eq!(events.len(), 1, "what follows is not reported one by one");
        assert_eq!((bench.queued_numbers(), bench.robot.phase()), (vec![1], Phase::Active));
        // The rest of the packet in a segment of its own.
        bench.robot.handle_input(bench.now + 8 * MS, &[jobs([2]), jobs([3])].concat());
        assert_eq!(bench.queued_numbers(), [1], "it belongs to the packet");
        assert!(bench.cycle(&jobs([2, 3])).ends_with("<TyoPyynto$4#50$2#>"));
        assert_eq!(bench.queued_numbers(), [1, 2, 3]);
    }
}

/// §7.2's own example: the queue fills up in the middle of a packet whose last message is the order's end.
#[test]
fn an_end_that_follows_a_full_queue_is_destroyed() {
    let mut bench = Bench::new(RobotConfig { low_water: Some(1), ..PATIENT }, 3, 9999);
    bench.cycle(&[jobs(1..=5), b"<TilausLoppuu$2#50#>".to_vec()].concat());
    assert_eq!((bench.queued_numbers(), bench.robot.phase()), (vec![1, 2, 3], Phase::Active));
    bench.cycle(b"<Huuhaa$0##>");
    bench.execute();
    bench.execute();
    assert!(bench.cycle(&[jobs(4..=5), b"<TilausLoppuu$2#50#>".to_vec()].concat()).contains("TyoPyynto"));
    assert_eq!((bench.queued_numbers(), bench.robot.phase()), (vec![3, 4, 5], Phase::Ending));
}

/// An end while jobs are missing is the rest of the packet, or the PC has no more of them: it must come again.
#[test]
fn an_end_in_place_of_missing_jobs_has_to_come_twice() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    bench.cycle(&jobs([1, 3]));
    let end = b"<TilausLoppuu$2#50#>";
    assert!(bench.cycle(end).ends_with("<TyoPyynto$4#50$2#>"));
    let error = MessageError::JobsMissing { order: 50, expected: 2 };
    assert_eq!(rejected(&bench.events()).last(), Some(&error));
    assert_eq!(error.to_string(), "the end of order 50 came before job 2");
    bench.robot.handle_input(bench.now + 5 * MS, end);
    assert_eq!(bench.robot.phase(), Phase::Active, "not to the same request");
    assert!(bench.cycle(end).ends_with("<TyoPyynto$4#50$2#>"));
    assert_eq!(bench.robot.phase(), Phase::Ending);
}

/// An end that answers a packet before the request, because packets were not answered in time, is not one of the two.
#[test]
fn a_late_end_does_not_count_as_an_answer_to_the_request_for_missing_jobs() {
    let end = b"<TilausLoppuu$2#50#>";
    // At most as many as silent cycles, if these have a limit.
    for (silent_cycles, overdue, late) in [(5, 0, 0), (5, 2, 2), (5, 7, 5), (0, 7, 7), (1, 3, 1)] {
        let mut bench = Bench::new(RobotConfig { silent_cycles, ..PATIENT }, 8, 9999);
        for _ in 0..overdue {
            bench.cycle(b"");
        }
        bench.cycle(&jobs([1, 3]));
        for at in 0..=late {
            bench.cycle(end);
            assert_eq!(bench.robot.phase(), Phase::Active, "{silent_cycles} {overdue}: end {at}");
        }
        bench.cycle(end);
        assert_eq!(bench.robot.phase(), Phase::Ending, "{silent_cycles} {overdue}");
    }
}

/// The skipped bytes are reported when the next message begins: in a read of its own, and that may be a job.
#[test]
fn garbage_before_a_job_is_reported_when_the_job_comes_and_costs_it() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    let offset = "<TilausAlkaa$4#50$1#><Huuhaa$0##>".len();
    bench.cycle(b"roskaa");
    assert_eq!(bench.events(), []);
    bench.cycle(&jobs([1]));
    assert_eq!(bench.events(), [RobotEvent::Corrupt(DecodeError::Garbage { offset, length: 6 })]);
    assert_eq!(bench.queued_numbers(), [0_u16; 0], "a job may have been in it");
    bench.cycle(&jobs([1]));
    assert_eq!(bench.queued_numbers(), [1]);
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

#[test]
fn a_message_of_the_wrong_side_is_reported() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    bench.cycle(b"<TyoKuittaus$4#50$1#>");
    assert_eq!(rejected(&bench.events()), [MessageError::NotExpected { role: kawasaki_msg::Role::JobAck }]);
}

/// §6.3: resend, pause, clear the queue; "if the error cannot be mended in the background program, the motion program is told".
#[test]
fn the_recovery_ends_in_an_alarm() {
    let recovery = RecoveryLimits { resends: 2, pauses: 1, clears: 1 };
    let config = RobotConfig { recovery, pause: MS * 2500, ..RobotConfig::tcp() };
    let bound = config.alarm_bound();
    assert_eq!(bound, Duration::from_millis(5 * 2000 + 2500));
    // The recovery does not stall, whatever the PC does except sending the job.
    let bad = [job_to(3, 99_999_999), job(4)].concat();
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

/// Executing a long job is progress, whatever the PC sends meanwhile.
#[test]
fn a_job_that_takes_long_is_no_standstill() {
    let mut bench = Bench::new(RobotConfig::tcp(), 8, 9999);
    bench.cycle(&jobs([1]));
    bench.events();
    for _ in 0..50 {
        bench.cycle(&jobs([7]));
        assert!(!bench.events().iter().any(|event| matches!(event, RobotEvent::Recovery { .. })));
    }
    assert_eq!((bench.execute(), bench.robot.phase()), (1, Phase::Active));
}

#[test]
fn what_is_executed_is_not_asked_for_again_when_the_queue_is_cleared() {
    let mut bench = Bench::new(PATIENT, 8, 9999);
    bench.cycle(&jobs(1..=6));
    bench.execute();
    bench.execute();
    bench.robot.clear_queue().unwrap();
    assert!(bench.reader.take().is_none());
    bench.cycle(b"<Huuhaa$0##>");
    bench.cycle(b"<Huuhaa$0##>");
    assert!(bench.cycle(&jobs(3..=8)).ends_with("<TyoPyynto$4#50$3#>"));
    assert_eq!(bench.queued_numbers(), [3, 4, 5, 6, 7, 8]);
}

#[test]
fn every_job_is_acknowledged_or_every_third() {
    let every = |every| Acks::Cumulative { every: NonZeroU16::new(every).unwrap() };
    let mut bench = Bench::new(RobotConfig { acks: every(1), ..PATIENT }, 8, 9999);
    bench.cycle(&jobs(1..=4));
    (0..3).for_each(|_| _ = bench.execute());
    assert!(
        bench
            .cycle(b"<Huuhaa$0##>")
            .starts_with("<TyoKuittaus$4#50$1#><TyoKuittaus$4#50$2#><TyoKuittaus$4#50$3#><Tila")
    );

    let mut bench = Bench::new(RobotConfig { acks: every(3), ..PATIENT }, 8, 9999);
    bench.cycle(&jobs(1..=8));
    (0..7).for_each(|_| _ = bench.execute());
    let packet = bench.cycle(b"<Huuhaa$0##>");
    assert!(packet.starts_with("<TyoKuittaus$4#50$3#><TyoKuittaus$4#50$6#><Tila"), "{packet}");
}

/// §11.2: "at least when it has nothing else to send".
#[test]
fn what_is_left_is_acknowledged_when_there_is_nothing_else_to_send() {
    let acks = Acks::Cumulative { every: NonZeroU16::new(10).unwrap() };
    let config = RobotConfig { acks, status_period: Duration::from_secs(1000), ..PATIENT };
    let mut bench = Bench::new(config, 4, 9999);
    bench.cycle(&jobs(1..=5));
    bench.cycle(b"<Huuhaa$0##>"); // pause
    bench.execute();
    assert_eq!(bench.cycle(b"<Huuhaa$0##>"), "<TyoKuittaus$4#50$1#>");
    assert_eq!(bench.cycle(b"<Huuhaa$0##>"), "<Huuhaa$0##>");
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
