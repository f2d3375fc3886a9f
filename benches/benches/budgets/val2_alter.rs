//! val2-alter: a request in, six limited axes out, within the window of 15 or 17 ms.

mod by_hand;

use std::hint::black_box;
use std::time::Duration;

use benches::{Budget, Count, Link, Ratio};
use robot_session::{Decoder as _, Session as _};
use val2_alter::{
    Accumulation, Decoder, ErrorCode, Frame, Framing, Host, HostConfig, HostMessage, Limiter, Limits,
    Message, Motion, MotionPhase, Reply, RobotMessage, SegmentStatus, Transform, timing,
};

use crate::streams;

pub const LINK: Link = Link {
    name: "val2-alter",
    counts: COUNTS,
    ratios: &[
        Ratio { what: SESSION, times: 2.5, of: &[STREAM] },
        Ratio { what: streams::RANDOM, times: 3.0, of: &[streams::RANDOM_WHOLE] },
        Ratio { what: streams::WORST, times: 3.0, of: &[streams::WORST_WHOLE] },
    ],
    budgets,
};

const STREAM: &str = "the same from a stream, through the decoder";
const SESSION: &str = "the same through the host session, with its deadline and its events";

const COUNTS: &[Count] = &[
    row("turn-around: decode a 36-byte request, limit six axes, encode six values", Some(350.0), turn_around),
    row("… by hand, 16 bytes at a time", None, |rounds| by_hand::turn(&REQUEST, TARGET, rounds)),
    row("the same with every DLE that can be: 64 bytes in, 33 out", Some(900.0), worst_turn_around),
    row("… by hand, byte by byte", None, |rounds| by_hand::turn(&worst_request(), [0x1010; 6], rounds)),
    row(STREAM, None, stream),
    row(SESSION, None, session),
    streams::valid(REQUEST.len() as f64, |rounds| streams::push(rounds, decoder(), &REQUEST, 1)),
    streams::noisy(streams::RANDOM_WHOLE, |rounds| {
        streams::push_whole(rounds, decoder(), &streams::noise());
    }),
    streams::noisy_bytes(streams::RANDOM, |rounds| {
        streams::push_noise(rounds, decoder(), &streams::noise());
    }),
    streams::noisy(streams::WORST_WHOLE, |rounds| {
        streams::push_whole(rounds, decoder(), &streams::repeated(WORST));
    }),
    streams::noisy_bytes(streams::WORST, |rounds| {
        streams::push_noise(rounds, decoder(), &streams::repeated(WORST));
    }),
    streams::LIMIT,
];

const fn row(what: &'static str, goal: Option<f64>, run: fn(u64)) -> Count {
    Count { what, goal, units: 1.0, unit: "op", run }
}

/// Start marks: each begins a frame that becomes too long.
const WORST: &[u8] = &[0x10, 0x10, 0x02];

fn decoder() -> Decoder<RobotMessage> {
    Decoder::new(Framing::DEFAULT)
}

/// 30 data bytes without a DLE: 36 bytes on the line.
const REQUEST: [u8; 36] = [
    0x10, 0x10, 0x02, 0x80, 0x02, 0x01, 0x00, 0x00, 0x20, 0x00, 0x40, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
    0x00, 0xC0, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0xC0, 0x00, 0x32, 0x30, 0xED, 0x20, 0x00, 0x10,
    0x03, 0xD2,
];
const START: [u8; 8] = [0x10, 0x10, 0x02, 0xA0, 0x17, 0x10, 0x03, 0xB7];
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
    let mut decoder = decoder();
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
