//! val2-alter: a request in, six limited axes out, within the window of 15 or 17 ms.

mod by_hand;

use std::hint::black_box;
use std::time::Duration;

use benches::frames::{ALTER_REQUEST as REQUEST, ALTER_START as START};
use benches::{Budget, Count, Link, Ratio, Timing};
use robot_session::{Decoder as _, Session as _};
use val2_alter::{
    Accumulation, Controller, ControllerConfig, ControllerEvent, Decoder, ErrorCode, Frame, Framing, Host,
    HostConfig, HostMessage, Limiter, Limits, Message, Motion, MotionPhase, Reply, RobotMessage,
    SegmentStatus, StartCode, Transform, timing,
};

use super::streams::{self, Decoding};

pub(super) const LINK: Link = Link {
    name: "val2-alter",
    counts: &[
        Count::op("turn-around: decode a 36-byte request, limit six axes, encode six values", turn_around)
            .goal(350.0)
            .timed_bytes("turn-around", Timing::OURS, REQUEST.len() + REPLY_LEN),
        Count::op("… by hand, 16 bytes at a time", |rounds| by_hand::turn(&REQUEST, TARGET, rounds))
            .timed_bytes("turn-around", Timing::BY_HAND, REQUEST.len() + REPLY_LEN),
        Count::op("the same with every DLE that can be: 64 bytes in, 33 out", worst_turn_around)
            .goal(900.0)
            .timed_bytes("turn-around-stuffed", Timing::OURS, 64 + 33),
        Count::op("… by hand, byte by byte", |rounds| {
            by_hand::turn(&worst_request(), [0x1010; 6], rounds);
        })
        .timed_bytes("turn-around-stuffed", Timing::BY_HAND, 64 + 33),
        Count::op(STREAM, stream),
        Count::op(SESSION, session).timed("host", Timing::OURS),
        Count::op("controller: send the request, receive the reply", control)
            .timed("controller", Timing::OURS),
        Count::op("decode a request: its frame, its message", decode).timed_bytes(
            "decode",
            Timing::OURS,
            REQUEST.len(),
        ),
        Count::op("encode a reply of six values", encode).timed_bytes("encode", Timing::OURS, REPLY_LEN),
    ],
    ratios: &[Ratio { what: SESSION, times: 2.5, of: &[STREAM] }],
    streams: &[streams::rows::<Requests>()],
    budgets,
    ..Link::EMPTY
};

const STREAM: &str = "the same from a stream, through the decoder";
const SESSION: &str = "the same through the host session, with its deadline and its events";

struct Requests;

impl Decoding for Requests {
    type Decoder = Decoder<RobotMessage>;
    const LEN: usize = REQUEST.len();
    const FRAMES: usize = 1;

    fn decoder() -> Decoder<RobotMessage> {
        Decoder::new(Framing::DEFAULT)
    }

    fn valid() -> Vec<u8> {
        REQUEST.to_vec()
    }

    /// Returns start marks: each begins a frame that becomes too long.
    fn worst() -> Vec<u8> {
        streams::repeated(&[0x10, 0x10, 0x02])
    }
}

/// A reply of six values without a DLE.
const REPLY_LEN: usize = 20;
const TARGET: [i16; 6] = [80, -80, 0, 182, -182, 5];

fn turn_around(rounds: u64) {
    turn(&REQUEST, TARGET, rounds);
}

fn worst_turn_around(rounds: u64) {
    turn(&worst_request(), [0x1010; 6], rounds);
}

fn worst_request() -> Vec<u8> {
    let request = RobotMessage::Motion(Motion {
        phase: MotionPhase::Running,
        error: ErrorCode::None,
        segment_status: SegmentStatus::Normal,
        segment: 0x1010,
        percent: 0x1010,
        transform: Some(Transform([0x1010; 12])),
    });
    let mut bytes = [0; Frame::MAX_LEN];
    let len = request.encode(Framing::DEFAULT, &mut bytes).expect("it fits");
    assert_eq!(len, timing::max_request_len(true, Framing::DEFAULT));
    bytes[..len].to_vec()
}

fn turn(request: &[u8], target: [i16; 6], rounds: u64) {
    let mut limiter = Limiter::new(black_box(Limits::NONE));
    let mut out = [0; Frame::MAX_LEN];
    for _ in 0..rounds {
        let Ok(Some((message, _))) = RobotMessage::decode_frame(black_box(request), Framing::DEFAULT) else {
            panic!("a good request")
        };
        black_box(&message);
        let values = limiter.speeds(black_box(target));
        let reply = HostMessage::Reply(Reply::all(values));
        black_box(reply.encode(Framing::DEFAULT, black_box(&mut out)).expect("it fits"));
    }
}

fn stream(rounds: u64) {
    let mut decoder = Requests::decoder();
    let mut limiter = Limiter::new(black_box(Limits::GENTLE));
    let mut out = [0; Frame::MAX_LEN];
    for _ in 0..rounds {
        assert_eq!(decoder.push(black_box(&REQUEST)), REQUEST.len());
        black_box(&decoder.next_frame().expect("a whole request").expect("a good request"));
        assert_eq!(decoder.next_frame(), None);
        let reply = HostMessage::Reply(Reply::all(limiter.speeds(black_box(TARGET))));
        black_box(reply.encode(Framing::DEFAULT, black_box(&mut out)).expect("it fits"));
    }
}

fn session(rounds: u64) {
    let mut host = Host::new(HostConfig::default()).expect("it can work");
    let mut out = [0; Frame::MAX_LEN];
    let mut now = Duration::ZERO;
    host.handle_connected(now);
    host.handle_input(now, &START);
    host.poll_transmit(now, &mut out).expect("accepted");
    host.poll_event();
    for _ in 0..rounds {
        now += timing::CYCLE;
        host.handle_input(now, black_box(&REQUEST));
        host.set_target(now, black_box(TARGET));
        black_box(host.poll_event().expect("a standard message"));
        black_box(host.poll_transmit(now, black_box(&mut out)).expect("a reply"));
    }
}

/// Runs the controller's cycle: a request, and a reply in its window.
fn control(rounds: u64) {
    let mut controller = Controller::new(ControllerConfig::default()).expect("it can work");
    let accepted = encoded(HostMessage::StartReply(StartCode::Accept));
    let reply = encoded(HostMessage::Reply(Reply::all(TARGET)));
    assert_eq!(reply.len(), REPLY_LEN);
    let on_the_line = timing::transmission_time(REQUEST.len() + REPLY_LEN, timing::BAUD);
    let (mut out, mut now) = ([0; Frame::MAX_LEN], Duration::ZERO);
    controller.handle_connected(now);
    controller.start(now).expect("no ALTER runs");
    controller.poll_transmit(now, &mut out).expect("the start message");
    controller.handle_input(now + on_the_line, &accepted);
    assert_eq!(controller.poll_event(), Some(ControllerEvent::Started));
    for _ in 0..rounds {
        now += timing::CYCLE;
        controller.set_transform(black_box(Transform([2; 12])));
        assert_eq!(controller.poll_transmit(now, black_box(&mut out)), Some(REQUEST.len()));
        controller.handle_input(now + on_the_line, black_box(&reply));
        assert!(matches!(black_box(controller.poll_event()), Some(ControllerEvent::Reply { .. })));
    }
}

fn encoded(message: HostMessage) -> Vec<u8> {
    let mut out = [0; Frame::MAX_LEN];
    let length = message.encode(Framing::DEFAULT, &mut out).expect("it fits");
    out[..length].to_vec()
}

/// Decodes in two steps: with a second caller of `decode_frame`, the compiler would not inline it into the turn-around.
fn decode(rounds: u64) {
    for _ in 0..rounds {
        let request: &[u8] = black_box(&REQUEST);
        let Ok(Some((frame, _))) = Frame::decode(request, Framing::DEFAULT) else { panic!("a good frame") };
        black_box(&RobotMessage::decode(frame.data(), Framing::DEFAULT)).expect("a good request");
    }
}

fn encode(rounds: u64) {
    let mut out = [0; Frame::MAX_LEN];
    for _ in 0..rounds {
        let reply = HostMessage::Reply(Reply::all(black_box(TARGET)));
        assert_eq!(reply.encode(Framing::DEFAULT, black_box(&mut out)), Ok(REPLY_LEN));
    }
}

fn budgets() -> Vec<Budget> {
    let row = |accumulation, baud, reply_len, what: &str| Budget {
        what: format!("{what}, {accumulation:?}, at {baud} baud"),
        takes: timing::transmission_time(reply_len, baud),
        window: timing::window(accumulation),
        source: "§3.4",
    };
    let longest = timing::max_reply_len(6, Framing::DEFAULT);
    let mut rows = Vec::new();
    for accumulation in [Accumulation::Cumulative, Accumulation::NonCumulative] {
        for baud in [38_400, 19_200] {
            rows.push(row(accumulation, baud, 20, "six values without doubled DLEs"));
        }
        rows.push(row(accumulation, 38_400, longest, "the longest reply"));
    }
    // At 19200 baud the longest reply does not fit the cumulative window: a reply leaves out words that are zero.
    rows.push(row(
        Accumulation::Cumulative,
        19_200,
        timing::max_reply_len(4, Framing::DEFAULT),
        "the longest reply of four values",
    ));
    let tight = timing::Budget::worst_case(Accumulation::Cumulative, 38_400, true, 6, Framing::DEFAULT);
    rows.push(Budget {
        what: "the longest reply in what the longest request leaves of 28 ms, at 38400 baud".into(),
        takes: tight.reply,
        window: tight.window,
        source: "§3.4",
    });
    rows
}
