//! The counts of the sessions, and the contents of a reply in its window.

use core::time::Duration;

use robot_session::Session;
use val2_alter::timing::Budget;
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, ErrorCode, Exception, Frame, Framing, Host, HostConfig,
    HostEvent, HostMessage, Limits, List, Message, Mode, Motion, MotionPhase, Reply, RobotMessage, Start,
    StartCode,
};

const MS: Duration = Duration::from_millis(1);

fn wire<M: Message>(message: M, framing: Framing) -> Vec<u8> {
    let mut out = [0; Frame::MAX_LEN];
    let length = message.encode(framing, &mut out).unwrap();
    out[..length].to_vec()
}

fn sent(session: &mut impl Session, now: Duration) -> Option<Vec<u8>> {
    let mut out = [0; Frame::MAX_LEN];
    let length = session.poll_transmit(now, &mut out)?;
    Some(out[..length].to_vec())
}

fn events<S: Session>(session: &mut S) -> Vec<S::Event> {
    core::iter::from_fn(|| session.poll_event()).collect()
}

fn start(mode: Mode) -> RobotMessage {
    RobotMessage::Start(Start::new(mode, List::EMPTY))
}

fn motion() -> RobotMessage {
    RobotMessage::Motion(Motion {
        phase: MotionPhase::Running,
        error: ErrorCode::None,
        segment_status: 1.into(),
        segment: 1,
        percent: 0,
        transform: None,
    })
}

#[test]
fn a_controller_counts_each_message_and_what_becomes_of_it() {
    let [accept, reply] = [
        wire(HostMessage::StartReply(StartCode::Accept), Framing::DEFAULT),
        wire(HostMessage::Reply(Reply::NOTHING), Framing::DEFAULT),
    ];
    let mut controller = Controller::new(ControllerConfig::default()).unwrap();
    controller.handle_connected(Duration::ZERO);
    controller.start(Duration::ZERO).unwrap();
    assert!(sent(&mut controller, Duration::ZERO).is_some());
    controller.handle_input(5 * MS, &accept);
    assert!(sent(&mut controller, 28 * MS).is_some());
    controller.handle_input(40 * MS, &[&reply[..], &reply].concat());
    assert!(sent(&mut controller, 56 * MS).is_some());
    controller.handle_input(70 * MS, &[&reply[..reply.len() - 1], &[0x55]].concat());
    assert!(sent(&mut controller, 84 * MS).is_some());
    controller.handle_timeout(112 * MS);
    let counted = controller.statistics();
    assert_eq!((counted.attempts, counted.starts, counted.cycles), (1, 1, 3));
    assert_eq!((counted.replies, counted.strays, counted.bad_replies), (1, 1, 1));
    assert_eq!((counted.timeouts, counted.unexpected), (1, 0));
    assert_eq!(
        events(&mut controller),
        [
            ControllerEvent::Started,
            ControllerEvent::Reply { reply: Reply::NOTHING, values: [0; 6] },
            ControllerEvent::Stray(HostMessage::Reply(Reply::NOTHING)),
            ControllerEvent::BadReply(ErrorCode::Checksum),
            ControllerEvent::BadReply(ErrorCode::Timeout),
        ]
    );
}

#[test]
fn a_host_counts_each_message_and_each_reply() {
    let config = HostConfig::default();
    let mut host = Host::new(config).unwrap();
    host.handle_connected(Duration::ZERO);
    host.handle_input(Duration::ZERO, &wire(start(config.mode), config.framing));
    assert!(sent(&mut host, Duration::ZERO).is_some());
    for cycle in 1..=2 {
        host.handle_input(28 * cycle * MS, &wire(motion(), config.framing));
        assert!(sent(&mut host, 28 * cycle * MS).is_some());
    }
    let end = RobotMessage::End(val2_alter::End { error: ErrorCode::None });
    host.handle_input(84 * MS, &[wire(end, config.framing), wire(end, config.framing)].concat());
    let counted = host.statistics();
    assert_eq!((counted.starts, counted.cycles, counted.replies, counted.ends), (1, 2, 2, 2));
    assert_eq!((counted.missed, counted.lost, counted.corrupt, counted.unexpected), (0, 0, 0, 0));
}

/// Such bytes are not read, whatever they contain.
#[test]
fn bytes_without_a_connection_are_one_unexpected_input() {
    let accept = wire(HostMessage::StartReply(StartCode::Accept), Framing::DEFAULT);
    let mut controller = Controller::new(ControllerConfig::default()).unwrap();
    controller.handle_input(Duration::ZERO, &[&accept[..], &accept].concat());
    assert_eq!(controller.statistics().unexpected, 1);
    assert!(matches!(events(&mut controller)[..], [ControllerEvent::Unexpected(_)]));
    let mut host = Host::new(HostConfig::default()).unwrap();
    host.handle_input(Duration::ZERO, &[wire(motion(), Framing::DEFAULT), accept].concat());
    assert_eq!(host.statistics().unexpected, 1);
    assert!(matches!(events(&mut host)[..], [HostEvent::Unexpected(_)]));
}

/// Returns the reply at a time that leaves exactly `room` bytes in the window of the second message, after the first one has
/// started ALTER; and the number of replies in which a word waits.
fn reply_in(
    room: usize,
    config: HostConfig,
    exception: Exception,
    values: [i16; 6],
) -> Option<(Vec<u8>, u64)> {
    let mut host = Host::new(config).unwrap();
    host.handle_connected(Duration::ZERO);
    host.handle_input(Duration::ZERO, &wire(start(config.mode), config.framing));
    assert!(sent(&mut host, Duration::ZERO).is_some());
    let request = wire(motion(), config.framing);
    host.handle_input(28 * MS, &request);
    assert!(sent(&mut host, 28 * MS).is_some());
    host.set_target(56 * MS, values);
    host.exception(56 * MS, exception).unwrap();
    host.handle_input(56 * MS, &request);
    let budget = Budget::new(config.mode.accumulation(), config.baud, request.len(), room);
    let reply = sent(&mut host, 56 * MS + budget.slack().expect("the window is longer"))?;
    Some((reply, host.statistics().held))
}

/// Only a word that would end after the window is left out; if the exception does not fit, no reply is sent.
#[test]
fn a_reply_has_the_words_that_fit_its_window_and_ends_in_it() {
    let words = [[0x1010; 6], [1, 2, 3, 4, 5, 6], [0, 0, 0, 0, 7, 0], [16, 0, 0x1000, -1, 0x1010, 5]];
    let exceptions = [Exception::CloseGripper, Exception::Other(0x10)];
    for (stuffed_checksum, values, exception) in [false, true].into_iter().flat_map(|stuffed| {
        words.into_iter().flat_map(move |values| exceptions.map(|exception| (stuffed, values, exception)))
    }) {
        let framing = Framing { stuffed_checksum, ..Framing::DEFAULT };
        let config = HostConfig {
            framing,
            baud: 19_200,
            mode: Mode::CUMULATIVE_23.with_transform(false),
            limits: Limits::NONE,
            subroutine: true,
            reserve: Duration::ZERO,
            ..HostConfig::default()
        };
        // A checksum may become a DLE by what is left out.
        let longest = |values| {
            let reply = HostMessage::Reply(Reply { exception, values });
            let undoubled = Framing { stuffed_checksum: false, ..framing };
            reply.encoded_len(undoubled) + usize::from(stuffed_checksum)
        };
        // 28 bytes take 14.6 ms of the 15 ms.
        for room in 8..=28 {
            let Some((bytes, held)) = reply_in(room, config, exception, values) else {
                assert!(longest([None; 6]) > room, "{room}: {exception:?}");
                continue;
            };
            assert!(bytes.len() <= room, "{room}: {bytes:02X?}");
            let message = HostMessage::decode_frame(&bytes, framing).unwrap().unwrap().0;
            let HostMessage::Reply(reply) = message else { panic!("{message:?}") };
            assert_eq!(reply.exception, exception);
            let waits = reply.values.iter().zip(values).any(|(sent, value)| sent.is_none() && value != 0);
            assert_eq!(held, u64::from(waits), "{room}: {reply:?}");
            for axis in 0..6 {
                assert!(reply.values[axis].is_none_or(|value| value == values[axis]));
                let mut more = reply.values;
                more[axis] = Some(values[axis]);
                let fits = longest(more) <= room && values[axis] != 0;
                assert!(reply.values[axis].is_some() || !fits, "{room}: {reply:?}");
            }
        }
    }
}
