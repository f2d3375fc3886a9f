//! Modbus TCP beside three other crates, each doing the same work: read 38 holding registers.

mod by_hand;
mod codec;
#[path = "../work/modbus.rs"]
mod work;

use std::hint::black_box;
use std::time::Duration;

use benches::{Budget, Count, Link, Ratio, Timing};
use cellwire_motion::{Tracker, dpm};
use fanuc_hmi_modbus::{Decoder, Frame, Framing, Side, TelemetryBlock, timing};

use super::streams::{self, Decoding, Names};

pub(super) const LINK: Link = Link {
    name: "fanuc-hmi-modbus",
    counts: &[
        Count::op("decode a reply of 38 registers, copy them", work::decode).goal(115.0).timed_bytes(
            "decode",
            Timing::OURS,
            REPLY,
        ),
        Count::op("… by hand", by_hand::decode).timed_bytes("decode", Timing::BY_HAND, REPLY),
        Count::op("– modbus-core 0.2", work::decode_modbus_core).timed_bytes("decode", MODBUS_CORE, REPLY),
        Count::op("– rmodbus 0.13", work::decode_rmodbus).timed_bytes("decode", RMODBUS, REPLY),
        Count::op("serve a read of 38 registers", work::serve).goal(120.0).timed_bytes(
            "serve",
            Timing::OURS,
            REQUEST + REPLY,
        ),
        Count::op("… by hand", by_hand::serve).timed_bytes("serve", Timing::BY_HAND, REQUEST + REPLY),
        Count::op("– modbus-core 0.2, copying by hand", work::serve_modbus_core).timed_bytes(
            "serve",
            MODBUS_CORE,
            REQUEST + REPLY,
        ),
        Count::op("– rmodbus 0.13", work::serve_rmodbus).timed_bytes("serve", RMODBUS, REQUEST + REPLY),
        Count::op("encode the request", work::encode).goal(32.5).timed_bytes("encode", Timing::OURS, REQUEST),
        Count::op("– modbus-core 0.2", work::encode_modbus_core).timed_bytes("encode", MODBUS_CORE, REQUEST),
        Count::op("– rmodbus 0.13", work::encode_rmodbus).timed_bytes("encode", RMODBUS, REQUEST),
        Count::op(EXCHANGE, codec::exchange).timed("client", "the codec alone"),
        Count::op(CLIENT, work::exchange).timed("client", Timing::OURS),
        Count::op("– tokio-modbus 0.17, its codec being private", work::exchange_tokio_modbus)
            .timed("client", "tokio-modbus 0.17"),
        Count::op(ANSWER, codec::serve).timed("server", "the codec alone"),
        Count::op(SERVER, work::server_session).timed("server", Timing::OURS),
        Count::op("the telemetry block from its registers", telemetry),
        Count::op("a sample of the motion from a block", track),
        Count::op("DPM offsets of six axes for a period", offsets),
    ],
    ratios: &[
        Ratio { what: CLIENT, times: 2.0, of: &[EXCHANGE] },
        Ratio { what: SERVER, times: 2.0, of: &[ANSWER] },
    ],
    streams: &[streams::rows::<OverTcp>(), streams::rows::<OverRtu>()],
    budgets,
    ..Link::EMPTY
};

const MODBUS_CORE: &str = "modbus-core 0.2";
const RMODBUS: &str = "rmodbus 0.13";

const EXCHANGE: &str = "request, reply from a stream, copy: the codec alone";
const CLIENT: &str = "the client session: request, transmit, input, event, copy";
const ANSWER: &str = "request from a stream, reply: the codec alone";
const SERVER: &str = "the server session: input, event, transmit";

/// The bytes of the request over TCP, and those of its reply.
const REQUEST: usize = 12;
const REPLY: usize = 9 + 2 * work::N;

struct OverTcp;

impl Decoding for OverTcp {
    type Decoder = Decoder;
    const LEN: usize = REPLY;
    const FRAMES: usize = 1;
    const NAMES: Names = Names {
        work: "decoder-tcp",
        whole: "TCP: replies in one piece",
        bytes: "TCP: replies, one byte a push",
        by_hand: "… by hand, TCP: each byte kept and compared",
        random: "TCP: random bytes",
        worst: "TCP: the worst noise",
    };

    fn decoder() -> Decoder {
        Decoder::new(Framing::Tcp, Side::Server)
    }

    fn valid() -> Vec<u8> {
        work::reply_bytes()
    }

    /// Returns short frames of another protocol: a corruption every eight bytes.
    fn worst() -> Vec<u8> {
        streams::repeated(&[0, 0, 0, 1, 0, 2, 1, 3])
    }
}

struct OverRtu;

impl Decoding for OverRtu {
    type Decoder = Decoder;
    const LEN: usize = 5 + 2 * work::N;
    const FRAMES: usize = 1;
    const NAMES: Names = Names {
        work: "decoder-rtu",
        whole: "RTU: replies in one piece",
        bytes: "RTU: replies, one byte a push",
        by_hand: "… by hand, RTU: each byte kept and compared",
        random: "RTU: random bytes",
        worst: "RTU: the worst noise",
    };

    fn decoder() -> Decoder {
        Decoder::new(Framing::Rtu { silence: timing::silence(19_200) }, Side::Server)
    }

    fn valid() -> Vec<u8> {
        let tcp = work::reply_bytes();
        let (frame, _) = Frame::decode_tcp(&tcp).expect("good").expect("whole");
        let mut bytes = Vec::new();
        Frame { transaction: None, ..frame }.append_to(&mut bytes).expect("it fits");
        bytes
    }

    /// Returns bytes each of which begins a frame, every third one of the maximum length.
    fn worst() -> Vec<u8> {
        streams::repeated(&[3, 3, 0xF7])
    }
}

fn telemetry(rounds: u64) {
    let registers: [u16; 37] = core::array::from_fn(|i| i as u16 * 257);
    for _ in 0..rounds {
        black_box(TelemetryBlock::from_registers(black_box(&registers), black_box(Default::default())));
    }
}

fn budgets() -> Vec<Budget> {
    let row = |baud: u32, window| Budget {
        what: format!("the telemetry block over RTU at {baud} baud, in the period of the background task"),
        takes: timing::read_time(TelemetryBlock::QUANTITY, baud),
        window,
        source: "Background Task, Table 2",
    };
    vec![row(230_400, Duration::from_millis(8)), row(460_800, Duration::from_millis(8))]
}

fn track(rounds: u64) {
    let mut tracker = Tracker::new();
    for counter in 0..rounds {
        let quaternion = [0.9, 0.1, 0.2, 0.3 + (counter % 7) as f32 * 1e-4];
        let block = TelemetryBlock { life_counter: counter as u32, quaternion, ..Default::default() };
        black_box(tracker.push(black_box(&block)));
    }
}

fn offsets(rounds: u64) {
    let axis = Some(dpm::Axis { max_per_path: 1e9, ..dpm::Axis::new(0.001) });
    let mut modifier = dpm::Modifier::new(dpm::Config::new([axis; 6])).expect("a good axis");
    for _ in 0..rounds {
        modifier.demand(Duration::ZERO, black_box([1.5, -2.5, 3.5, 0.1, -0.2, 0.3])).expect("numbers");
        black_box(modifier.next_period(black_box(Duration::ZERO)));
    }
}
