//! Modbus TCP beside three other crates, each doing the same work: read 38 holding registers.

mod by_hand;
mod codec;
#[path = "../work/modbus.rs"]
mod work;

use std::hint::black_box;
use std::time::Duration;

use benches::{Budget, Count, Link, Ratio};
use cellwire_motion::{Tracker, dpm};
use fanuc_hmi_modbus::{Decoder, Frame, Rtu, Side, Tcp, TelemetryBlock, timing};

use crate::streams;

pub const LINK: Link = Link {
    name: "fanuc-hmi-modbus",
    counts: &[
        row("decode a reply of 38 registers, copy them", Some(115.0), work::decode),
        row("… by hand", None, by_hand::decode),
        row("– modbus-core 0.2", None, work::decode_modbus_core),
        row("– rmodbus 0.13", None, work::decode_rmodbus),
        row("serve a read of 38 registers", Some(120.0), work::serve),
        row("… by hand", None, by_hand::serve),
        row("– modbus-core 0.2, copying by hand", None, work::serve_modbus_core),
        row("– rmodbus 0.13", None, work::serve_rmodbus),
        row("encode the request", Some(32.5), work::encode),
        row("– modbus-core 0.2", None, work::encode_modbus_core),
        row("– rmodbus 0.13", None, work::encode_rmodbus),
        row(EXCHANGE, None, codec::exchange),
        row(CLIENT, None, work::exchange),
        row("– tokio-modbus 0.17, its codec being private", None, work::exchange_tokio_modbus),
        row(ANSWER, None, codec::serve),
        row(SERVER, None, work::server_session),
        row("the telemetry block from its registers", None, telemetry),
        row("a sample of the motion from a block", None, track),
        row("DPM offsets of six axes for a period", None, offsets),
        Count { what: "TCP: replies, one byte a push", ..streams::valid(REPLY as f64, tcp_replies) },
        streams::noisy(TCP_RANDOM_WHOLE, |rounds| streams::push_whole(rounds, tcp(), &streams::noise())),
        streams::noisy_bytes(TCP_RANDOM, |rounds| streams::push_noise(rounds, tcp(), &streams::noise())),
        streams::noisy(TCP_WORST_WHOLE, |rounds| {
            streams::push_whole(rounds, tcp(), &streams::repeated(TCP_WORST_NOISE));
        }),
        streams::noisy_bytes(TCP_WORST, |rounds| {
            streams::push_noise(rounds, tcp(), &streams::repeated(TCP_WORST_NOISE));
        }),
        Count { what: "RTU: replies, one byte a push", ..streams::valid(RTU_REPLY as f64, rtu_replies) },
        streams::noisy(RTU_RANDOM_WHOLE, |rounds| streams::push_whole(rounds, rtu(), &streams::noise())),
        streams::noisy_bytes(RTU_RANDOM, |rounds| streams::push_noise(rounds, rtu(), &streams::noise())),
        streams::noisy(RTU_WORST_WHOLE, |rounds| {
            streams::push_whole(rounds, rtu(), &streams::repeated(RTU_WORST_NOISE));
        }),
        streams::noisy_bytes(RTU_WORST, |rounds| {
            streams::push_noise(rounds, rtu(), &streams::repeated(RTU_WORST_NOISE));
        }),
        streams::LIMIT,
    ],
    ratios: &[
        Ratio { what: CLIENT, times: 2.0, of: &[EXCHANGE] },
        Ratio { what: SERVER, times: 2.0, of: &[ANSWER] },
        Ratio { what: TCP_RANDOM, times: 3.0, of: &[TCP_RANDOM_WHOLE] },
        Ratio { what: TCP_WORST, times: 3.0, of: &[TCP_WORST_WHOLE] },
        Ratio { what: RTU_RANDOM, times: 3.0, of: &[RTU_RANDOM_WHOLE] },
        Ratio { what: RTU_WORST, times: 3.0, of: &[RTU_WORST_WHOLE] },
    ],
    budgets,
};

const EXCHANGE: &str = "request, reply from a stream, copy: the codec alone";
const CLIENT: &str = "the client session: request, transmit, input, event, copy";
const ANSWER: &str = "request from a stream, reply: the codec alone";
const SERVER: &str = "the server session: input, event, transmit";

const TCP_RANDOM_WHOLE: &str = "TCP: random bytes";
const TCP_RANDOM: &str = "TCP: random bytes, one byte a push";
const TCP_WORST_WHOLE: &str = "TCP: the worst noise";
const TCP_WORST: &str = "TCP: the worst noise, one byte a push";
const RTU_RANDOM_WHOLE: &str = "RTU: random bytes";
const RTU_RANDOM: &str = "RTU: random bytes, one byte a push";
const RTU_WORST_WHOLE: &str = "RTU: the worst noise";
const RTU_WORST: &str = "RTU: the worst noise, one byte a push";

/// Short frames of another protocol: a corruption every eight bytes.
const TCP_WORST_NOISE: &[u8] = &[0, 0, 0, 1, 0, 2, 1, 3];
/// A frame begins with each byte, every third one as long as they can be.
const RTU_WORST_NOISE: &[u8] = &[3, 3, 0xF7];

const REPLY: usize = 9 + 2 * work::N;
const RTU_REPLY: usize = 5 + 2 * work::N;

const fn row(what: &'static str, goal: Option<f64>, run: fn(u64)) -> Count {
    Count { what, goal, units: 1.0, unit: "op", run }
}

fn tcp_replies(rounds: u64) {
    streams::push(rounds, tcp(), &work::reply_bytes(), 1);
}

fn rtu_replies(rounds: u64) {
    let tcp = work::reply_bytes();
    let (frame, _) = Frame::decode_tcp(&tcp).expect("good").expect("whole");
    let mut bytes = Vec::new();
    Frame { transaction: None, ..frame }.append_to(&mut bytes).expect("it fits");
    streams::push(rounds, rtu(), &bytes, 1);
}

fn tcp() -> Decoder<Tcp> {
    Decoder::new(Tcp, Side::Server)
}

fn rtu() -> Decoder<Rtu> {
    Decoder::new(Rtu, Side::Server)
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
