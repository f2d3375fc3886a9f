//! `cargo bench -p benches --bench codecs [-- FILTER]`: the time of reading and writing one typical frame of each link, by
//! criterion. One file per link.

mod fanuc_hmi_modbus;
mod fanuc_ls;
mod isra_ball;
mod kawasaki_msg;
mod laser_eb90;
mod mmacell_proto;
mod val2_alter;
mod val2_viewer;
mod work_queue;

use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput};

fn main() {
    let mut criterion = Criterion::default()
        .warm_up_time(Duration::from_millis(500))
        .measurement_time(Duration::from_secs(1))
        .without_plots()
        .configure_from_args();
    for bench in [
        fanuc_hmi_modbus::bench,
        fanuc_ls::bench,
        isra_ball::bench,
        kawasaki_msg::bench,
        laser_eb90::bench,
        mmacell_proto::bench,
        val2_alter::bench,
        val2_viewer::bench,
        work_queue::bench,
    ] {
        bench(&mut criterion);
    }
    criterion.final_summary();
}

/// The group of a link's benches; its frame has `bytes` bytes on the wire.
fn group<'c>(criterion: &'c mut Criterion, link: &str, bytes: usize) -> BenchmarkGroup<'c, WallTime> {
    let mut group = criterion.benchmark_group(link);
    group.throughput(Throughput::Bytes(bytes as u64));
    group
}
