//! The cycle: which end may send when, the messages when there is nothing to report, and the reaction to silence.
#![allow(clippy::cast_possible_truncation)]

use core::time::Duration;

use crate::kawasaki_rig::{JobSupplier, MS, Rig, expected, picture, sent};
use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::robot_session::end::End as _;
use kawasaki_msg::{
    Dialect, Entry, Field, MessageError, Pc, PcConfig, PcEvent, Phase, Robot, RobotConfig, RobotEvent, Role,
    SessionError, Supply,
};
use testkit::link::Faults;

const LIMIT: Duration = Duration::from_secs(100);

fn pc(config: PcConfig) -> Pc<JobSupplier> {
    let mut pc = Pc::new(config).unwrap();
    pc.handle_connected(Duration::ZERO);
    pc
}

fn answer(pc: &mut Pc<JobSupplier>, now: Duration) -> Option<String> {
    let mut out = [0; 4096];
    pc.poll_transmit(now, &mut out).map(|length| String::from_utf8(out[..length].to_vec()).unwrap())
}

#[test]
fn without_an_order_both_say_something_in_every_cycle() {
    let mut rig = Rig::new(1, Faults::NONE, 8, 9999);
    rig.run_for(Duration::from_secs(10));
    assert!(
        rig.from_robot.len() > 250 && rig.from_robot.len() <= 313,
        "one in 32 ms: {}",
        rig.from_robot.len()
    );
    assert!(rig.from_pc.len().abs_diff(rig.from_robot.len()) <= 1, "each is answered once");
    assert!(rig.from_robot.iter().chain(&rig.from_pc).all(|packet| !packet.is_empty()));
    assert!(sent(&rig.from_robot, "Huuhaa").len() > 250);
    // The status comes once a second, and its reply with it.
    let statuses = sent(&rig.from_robot, "Tila").len();
    assert!((10..=12).contains(&statuses), "{statuses}");
    assert_eq!(sent(&rig.from_pc, "Tila").len(), statuses);
    assert_eq!(
        sent(&rig.from_pc, "Huuhaa").len(),
        rig.from_pc.len() - statuses,
        "filler only if there is no reply"
    );
}

/// §10.4: "The PC may not send data unless the robot has sent something first."
#[test]
fn the_pc_is_silent_until_it_has_heard_something() {
    let mut pc = pc(PcConfig::tcp());
    pc.start(1, picture(1, 10)).unwrap();
    for second in 0..5 {
        let now = Duration::from_secs(second);
        pc.handle_timeout(now);
        assert_eq!(answer(&mut pc, now), None);
    }
    let now = Duration::from_secs(5);
    pc.handle_input(now, b"<Tila$6#0$0$$$#>");
    assert_eq!(answer(&mut pc, now + MS), None, "not sooner than 2 ms: the robot may not be listening");
    assert_eq!(pc.poll_timeout(), Some(now + 2 * MS));
    assert_eq!(answer(&mut pc, now + 2 * MS).unwrap(), "<Tila$6#1$1$$$#><TilausAlkaa$3#1$1#>");
    assert_eq!(answer(&mut pc, now + 3 * MS), None, "one answer");
}

/// §11.3: an acknowledgement (no reply defined) and a request (reply defined) in one packet.
#[test]
fn the_whole_packet_is_read_before_it_is_answered() {
    let mut pc = pc(PcConfig::tcp());
    pc.start(1, picture(1, 4)).unwrap();
    let mut now = Duration::ZERO;
    let mut say = |pc: &mut Pc<JobSupplier>, pieces: &[&[u8]]| {
        now += 32 * MS;
        for piece in pieces {
            now += 3 * MS;
            assert_eq!(answer(pc, now), None, "the packet is not whole yet");
            pc.handle_input(now, piece);
        }
        answer(pc, now + 2 * MS).unwrap()
    };
    say(&mut pc, &[b"<Tila$6#0$0$$$#>"]);
    say(&mut pc, &[b"<TilausKuittaus$1#1#>"]);
    let jobs = say(&mut pc, &[b"<TyoPyynto$3#1$1#>"]);
    assert_eq!(jobs.matches("<Tyo$").count(), 4);
    let again = say(&mut pc, &[b"<TyoKuittaus$3#1$1#><TyoPyy", b"nto$3#1$3#>"]);
    assert!(again.starts_with("<Tyo$") && again.matches("<Tyo$").count() == 2, "no filler: {again}");
    // The same request twice, in one read: one answer.
    let once = say(&mut pc, &[b"<TyoPyynto$3#1$3#><TyoPyynto$3#1$3#>"]);
    assert_eq!(once, again, "nothing of an earlier answer is sent twice");
    // No reply is defined for an acknowledgement: filler.
    assert_eq!(say(&mut pc, &[b"<TyoKuittaus$3#1$2#>"]), "<Huuhaa$0##>");
    assert_eq!(pc.executed(), 2);
}

/// §10.4: "The robot waits a certain time for an answer; if none comes, it goes back to the start of its cycle."
#[test]
fn an_answer_is_waited_for_but_not_for_ever() {
    let (writer, _reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut robot = Robot::<kawasaki_msg::Line>::new(RobotConfig::tcp(), writer).unwrap();
    let mut out = [0; 4096];
    assert_eq!(robot.poll_timeout(), Some(Duration::ZERO));
    assert_eq!(robot.poll_event(), None);
    robot.handle_timeout(Duration::ZERO);
    assert_eq!(robot.poll_event(), Some(RobotEvent::Connect));
    assert_eq!(
        (robot.machine().link, robot.poll_timeout()),
        (kawasaki_msg::robot::machine::Link::Connecting { reported: true }, None)
    );
    robot.handle_connected(Duration::ZERO);
    let second = Duration::from_secs(1);
    for cycle in 1..5 {
        assert!(robot.poll_transmit(second * (cycle - 1), &mut out).is_some());
        assert_eq!(robot.poll_timeout(), Some(second * cycle));
        robot.handle_timeout(second * cycle - MS);
        assert_eq!(robot.poll_transmit(second * cycle - MS, &mut out), None);
        assert_eq!(robot.poll_event(), None);
        robot.handle_timeout(second * cycle);
        assert_eq!(robot.poll_event(), Some(RobotEvent::NoReply));
    }
    robot.poll_transmit(second * 4, &mut out).unwrap();
    robot.handle_timeout(second * 5);
    assert_eq!(robot.poll_event(), Some(RobotEvent::NoReply));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Disconnect), "the fifth cycle without an answer");
    robot.handle_disconnected(second * 5);
    assert_eq!(robot.poll_timeout(), Some(second * 6));
    robot.handle_timeout(second * 6);
    assert_eq!(robot.poll_event(), Some(RobotEvent::Connect));
    assert_eq!(robot.statistics().unanswered, 5);
}

#[test]
fn an_answer_within_the_time_begins_the_next_cycle_after_32_ms() {
    let (writer, _reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let mut robot = Robot::<kawasaki_msg::Line>::new(RobotConfig::tcp(), writer).unwrap();
    let mut out = [0; 4096];
    robot.handle_timeout(Duration::ZERO);
    robot.handle_connected(Duration::ZERO);
    robot.poll_transmit(Duration::ZERO, &mut out).unwrap();
    robot.handle_input(5 * MS, b"<Huuhaa$0##><Huu");
    assert_eq!(robot.poll_timeout(), Some(Duration::from_secs(1)), "the answer is not whole");
    robot.handle_input(6 * MS, b"haa$0##>");
    assert_eq!(robot.poll_timeout(), Some(32 * MS));
    assert_eq!(robot.poll_transmit(31 * MS, &mut out), None);
    assert!(robot.poll_transmit(32 * MS, &mut out).is_some());
    robot.handle_input(72 * MS, b"<Huuhaa$0##>");
    assert_eq!(
        robot.poll_timeout(),
        Some(74 * MS),
        "a late answer makes the next cycle wait for its end alone"
    );
    let exchange = robot.statistics().exchange;
    assert_eq!((exchange.last(), exchange.mean()), (Some(40 * MS), Some(23 * MS)));
    robot.record_unpack(27 * MS);
    assert_eq!(robot.statistics().unpack.last(), Some(27 * MS));
    assert_eq!(robot.statistics().packets, 2);
}

#[test]
fn a_damaged_end_does_not_hold_the_answer_up() {
    for (tail, rest) in [("<X$1#1#", "x"), ("<X$1", "#1#>?"), ("<X$1#1", ">"), ("<X$1#", "<Huuhaa$0##>")] {
        let mut pc = pc(PcConfig::tcp());
        pc.handle_input(Duration::ZERO, b"<Huuhaa$0##>");
        pc.handle_input(Duration::ZERO, tail.as_bytes());
        assert_eq!(answer(&mut pc, 10 * MS), None, "{tail} may still become whole");
        pc.handle_input(10 * MS, rest.as_bytes());
        assert_eq!(answer(&mut pc, 20 * MS).unwrap(), "<Huuhaa$0##>", "{tail}{rest}");
    }
}

#[test]
fn a_silent_robot_is_given_up() {
    let mut pc = pc(PcConfig::tcp());
    assert_eq!(pc.poll_timeout(), Some(Duration::from_secs(10)));
    pc.handle_timeout(Duration::from_secs(10));
    assert_eq!(pc.poll_event(), Some(PcEvent::Disconnect));
    pc.handle_disconnected(Duration::from_secs(10));
    assert_eq!((pc.machine().link, pc.poll_timeout()), (kawasaki_msg::pc::machine::Link::Listening, None));
}

#[test]
fn a_buffer_too_short_for_any_message_sends_nothing_and_loses_nothing() {
    let mut pc = pc(PcConfig::tcp());
    pc.handle_input(Duration::ZERO, b"<Tila$6#0$0$$$#>");
    let now = 10 * MS;
    assert_eq!(pc.poll_transmit(now, &mut [0; 5]), None);
    assert_eq!(answer(&mut pc, now).unwrap(), "<Tila$6#0$0$$$#>");
}

#[test]
fn jobs_that_are_not_worked_out_yet_are_waited_for() {
    let mut rig = Rig::new(1, Faults::NONE, 64, 9999);
    let ready = std::rc::Rc::new(core::cell::Cell::new(10));
    let known = ready.clone();
    let source: JobSupplier = Box::new(move |index| match index {
        100.. => Supply::End,
        _ if index >= known.get() => Supply::Later,
        _ => Supply::Job(crate::kawasaki_rig::line(9, index)),
    });
    rig.pc.start(9, source).unwrap();
    rig.run_for(Duration::from_secs(2));
    assert_eq!((rig.lines(), rig.pc.phase()), (expected(9, 10), Phase::Active));
    ready.set(100);
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines(), expected(9, 100));
}

#[test]
fn a_command_goes_past_the_queue() {
    // §11.1: "later more messages past the queue can be added, such as delays or speeds".
    let mut table = Dialect::DEFAULT.entries().to_vec();
    table.push(Entry {
        role: Role::Command(7),
        name: "Nopeus",
        header: &[],
        fields: &[Field::Order, Field::Value],
    });
    let dialect = Dialect::new(table.leak()).unwrap();
    let (robot, pc) =
        (RobotConfig { dialect, ..RobotConfig::tcp() }, PcConfig { dialect, ..PcConfig::tcp() });
    let mut rig = Rig::with(1, Faults::NONE, 8, 9999, robot, pc);
    rig.pc.start(50, picture(50, 100)).unwrap();
    rig.run_until(LIMIT, |rig| rig.executed.len() >= 20);
    rig.pc.command(7, -80).unwrap();
    assert_eq!(rig.pc.command(8, 1), Err(SessionError::UnknownCommand { id: 8 }));
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(sent(&rig.from_pc, "Nopeus"), ["<Nopeus$6#50$-80#>"]);
    let reported = RobotEvent::Command { id: 7, value: Some(-80) };
    assert_eq!(rig.robot_events.iter().filter(|e| **e == reported).count(), 1);
    for _ in 0..4 {
        rig.pc.command(7, 1).unwrap();
    }
    assert_eq!(rig.pc.command(7, 1), Err(SessionError::TooManyCommands { waiting: 4 }));
}

#[test]
fn other_names_in_another_order_of_fields_work_as_well() {
    let mut table = Dialect::DEFAULT.entries().to_vec();
    for entry in &mut table {
        let (name, fields): (&str, &[Field]) = match entry.role {
            Role::Job => ("Piirto", &[Field::Work, Field::Unused, Field::Number, Field::Order]),
            Role::Status => {
                ("S", &[Field::Ended, Field::Executed, Field::Queued, Field::Phase, Field::Order])
            }
            Role::Filler => ("Ping", &[Field::Unused]),
            _ => continue,
        };
        (entry.name, entry.fields) = (name, fields);
    }
    let dialect = Dialect::new(table.leak()).unwrap();
    let robot = RobotConfig { dialect, ..RobotConfig::tcp() };
    let pc = PcConfig { dialect, max_number: 100, ..PcConfig::tcp() };
    let mut rig = Rig::with(3, Faults::TCP, 16, 100, robot, pc);
    rig.pc.start(50, picture(50, 300)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines(), expected(50, 300));
    assert!(!sent(&rig.from_pc, "Piirto").is_empty() && !sent(&rig.from_pc, "Ping").is_empty());
    let odd = |event: &PcEvent| matches!(event, PcEvent::Rejected(_) | PcEvent::Corrupt(_));
    assert!(!rig.pc_events.iter().any(odd), "{:?}", rig.pc_events);
}

#[test]
fn damage_is_told_and_the_session_goes_on() {
    let mut pc = pc(PcConfig::tcp());
    pc.handle_input(Duration::ZERO, b"<Tila$5#0$0$$$#><Tuntematon$0##>roskaa<Huuhaa$0##>");
    let events: Vec<_> = core::iter::from_fn(|| pc.poll_event()).collect();
    assert!(matches!(
        events[0],
        PcEvent::Corrupt(kawasaki_msg::DecodeError::Length { expected: 5, found: 6, .. })
    ));
    assert!(matches!(events[1], PcEvent::Rejected(MessageError::UnknownName { .. })));
    assert!(matches!(events[2], PcEvent::Corrupt(kawasaki_msg::DecodeError::Garbage { length: 6, .. })));
    assert_eq!(events.len(), 3);
    assert_eq!(answer(&mut pc, 10 * MS).unwrap(), "<Huuhaa$0##>");
}

#[test]
fn a_flood_of_damage_leaves_room_for_what_matters() {
    let mut pc = pc(PcConfig::tcp());
    pc.start(1, picture(1, 1)).unwrap();
    for _ in 0..10 {
        pc.handle_input(Duration::ZERO, &b"<<<<<<<<".repeat(1000));
    }
    pc.handle_input(Duration::ZERO, b"<Tila$6#0$0$$$#>");
    answer(&mut pc, 2 * MS).unwrap();
    pc.handle_input(3 * MS, b"<TilausKuittaus$1#1#>");
    let events: Vec<_> = core::iter::from_fn(|| pc.poll_event()).collect();
    assert_eq!(events.iter().filter(|e| matches!(e, PcEvent::Corrupt(_))).count(), 30);
    assert!(events.contains(&PcEvent::OrderStarted { order: 1 }));
    assert_eq!(pc.statistics().dropped_notices, 80_000 - 30);
}
