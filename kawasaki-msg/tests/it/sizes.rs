//! The messages that a session of a certain size holds, and its equality with a larger one.

use core::time::Duration;

use kawasaki_msg::robot_session::{Decoder as _, Session as _};
use kawasaki_msg::{
    Acks, AddResult, Bounds, Charset, ConfigError, DecodeError, Decoder, Dialect, Entry, Field, Job, JobKind,
    LargePc, Limits, Line, Packet, Pc, PcConfig, Point, Robot, RobotConfig, RobotEvent, Role,
};

type Lines = &'static [Line];

fn table(constant: &str) -> &'static [Entry] {
    let mut table: Vec<Entry> = Dialect::DEFAULT.entries().to_vec();
    let filler = table.iter_mut().find(|entry| entry.role == Role::Filler).unwrap();
    filler.fields = vec![Field::Constant(constant.to_owned().leak())].leak();
    table.leak()
}

fn robot<const MESSAGE: usize>(
    config: RobotConfig,
    capacity: usize,
) -> Result<Robot<'static, Line, MESSAGE>, ConfigError> {
    let (writer, _) = robot_work_queue::boxed(capacity, config.max_number).unwrap();
    Robot::with_ranges(config, writer, Bounds::default())
}

#[test]
fn a_table_with_a_message_that_is_too_long_is_refused_at_once() {
    // "<Huuhaa$…#", the constant with a separator, and the bytes counted for a length of four digits.
    let (fits, long) = ("x".repeat(256 - 14), "x".repeat(256 - 13));
    for (constant, refused) in [(&fits, false), (&long, true)] {
        let dialect = Dialect::new(table(constant)).unwrap();
        let error = refused.then_some(ConfigError::LongMessages { longest: 257, held: 256 });
        let (pc, tcp) =
            (PcConfig { dialect, ..PcConfig::tcp() }, RobotConfig { dialect, ..RobotConfig::tcp() });
        assert_eq!(Pc::<Lines>::new(pc).err(), error);
        assert_eq!(robot::<256>(tcp, 256).err(), error);
        assert!(robot::<257>(tcp, 256).is_ok());
        assert!(LargePc::<Lines>::with_ranges(pc, Bounds::default()).is_ok());
    }
}

#[test]
fn a_queue_in_which_jobs_cannot_be_told_apart_is_refused_at_once() {
    for (capacity, refused) in [(1024, false), (1025, true), (9998, true)] {
        let error = refused.then_some(ConfigError::LongQueue { capacity, limit: 1024 });
        let config = RobotConfig { acks: Acks::Individual, ..RobotConfig::tcp() };
        assert_eq!(robot::<256>(config, capacity).err(), error);
        assert!(robot::<256>(RobotConfig::tcp(), capacity).is_ok());
    }
}

#[test]
fn a_message_that_is_too_long_costs_nothing_after_it() {
    let mut decoder = Decoder::<32>::sized(Charset::Ascii);
    let long = format!("<Tila$40#{}#>", "0".repeat(40));
    let endless = format!("<{}", "x".repeat(40));
    let mut found = Vec::new();
    let stream = format!("{long}<Huuhaa$0##>{endless}<Huuhaa$0##>");
    let mut rest = stream.as_bytes();
    while !rest.is_empty() {
        rest = &rest[decoder.push(rest)..];
        while let Some(frame) = decoder.next_frame() {
            found.push(frame.map(|message| message.name.chars().collect::<String>()));
        }
    }
    let huuhaa = Ok("Huuhaa".to_owned());
    let too_long = |offset| Err(DecodeError::TooLong { offset, limit: 32 });
    assert_eq!(found, [too_long(1), huuhaa.clone(), too_long(63), huuhaa]);
}

/// Returns the jobs that a robot queues of a packet that comes in two pieces, and its events.
fn queued<const MESSAGE: usize>(packet: &[u8], cut: usize) -> (Vec<Job<Line>>, Vec<RobotEvent>) {
    let (writer, reader) = robot_work_queue::boxed(256, 9999).unwrap();
    let mut robot =
        Robot::<Line, MESSAGE>::with_ranges(RobotConfig::tcp(), writer, Bounds::default()).unwrap();
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    for piece in [&packet[..cut], &packet[cut..]] {
        robot.handle_input(Duration::ZERO, piece);
    }
    let events = core::iter::from_fn(|| robot.poll_event()).collect();
    (reader.iter().map(|(_, job)| *job).collect(), events)
}

#[test]
fn a_robot_of_any_size_queues_the_same() {
    let mut buffer = [0; 4096];
    let mut packet = Packet::new(&mut buffer[..1200], Limits::TCP, Dialect::DEFAULT);
    let (ranges, mut number) = (<Line as kawasaki_msg::Work>::Ranges::default(), 1);
    let line = |n: u16| Line {
        kind: JobKind::Draw,
        start: Point::new(i32::from(n) * -977, 5),
        end: Point::new(i32::from(n) * 7919, 0),
    };
    while packet.push_job(&Job { order: 50, number, work: line(number) }, &ranges) == Ok(AddResult::Added) {
        number += 1;
    }
    let jobs = packet.as_bytes().to_vec();
    let all = [b"<TilausAlkaa$4#50$1#>", &jobs[..]].concat();
    for corrupt in [None, Some(400), Some(all.len() - 30)] {
        let mut all = all.clone();
        corrupt.into_iter().for_each(|at| all[at] = b'<');
        for cut in 0..=all.len() {
            let large = queued::<4096>(&all, cut);
            assert_eq!(queued::<256>(&all, cut), large, "cut at {cut}");
            assert_eq!(queued::<96>(&all, cut), large, "cut at {cut}");
            assert!(corrupt.is_some() || large.0.len() == usize::from(number - 1));
        }
    }
}
