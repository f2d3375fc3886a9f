//! Modbus TCP beside three other crates, each doing the same work: read 38 holding registers.

#[path = "../work/modbus.rs"]
mod work;

use std::hint::black_box;
use std::time::Duration;

use benches::{Budget, Count, Link};
use cellwire_motion::{Tracker, dpm};
use fanuc_hmi_modbus::{TelemetryBlock, timing};

pub const LINK: Link = Link {
    name: "fanuc-hmi-modbus",
    counts: &[
        row("decode a reply of 38 registers, copy them", Some(115.0), work::decode),
        row("– modbus-core 0.2", None, work::decode_modbus_core),
        row("– rmodbus 0.13", None, work::decode_rmodbus),
        row("serve a read of 38 registers", Some(120.0), work::serve),
        row("– modbus-core 0.2, copying by hand", None, work::serve_modbus_core),
        row("– rmodbus 0.13", None, work::serve_rmodbus),
        row("encode the request", Some(32.5), work::encode),
        row("– modbus-core 0.2", None, work::encode_modbus_core),
        row("– rmodbus 0.13", None, work::encode_rmodbus),
        row("the client session: request, transmit, input, event, copy", None, work::exchange),
        row("– tokio-modbus 0.17, its codec being private", None, work::exchange_tokio_modbus),
        row("the server session: input, transmit", None, work::server_session),
        row("the telemetry block from its registers", None, telemetry),
        row("a sample of the motion from a block", None, track),
        row("DPM offsets of six axes for a period", None, offsets),
    ],
    ratios: &[],
    budgets,
};

const fn row(what: &'static str, goal: Option<f64>, run: fn(u64)) -> Count {
    Count { what, goal, units: 1.0, unit: "op", run }
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
