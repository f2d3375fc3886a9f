//! `cargo bench -p benches --bench codecs [-- FILTER] [--test]`: the time of each link's codec, decoder and sessions, and of
//! the queue.
//!
//! An id is `link/work/by`. The report of a work, `target/criterion/LINK_WORK/report/index.html`, compares our code with a
//! loop by hand and with other crates. Instructions and their goals are counted by `budgets`, from the same functions.

#[path = "../links/mod.rs"]
mod links;

use std::time::Duration;

use benches::{Count, Link, Timing};
use criterion::{Criterion, Throughput};

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(30)
        .nresamples(10_000)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args();
    links::LINKS.iter().for_each(|link| time(&mut criterion, link));
    criterion.final_summary();
}

/// Times a group for each work of the link, in the order of its rows.
fn time(criterion: &mut Criterion, link: &Link) {
    let mut rows: Vec<(&Count, Timing)> =
        link.rows().filter_map(|count| Some((count, count.timing?))).collect();
    while let Some(&(_, Timing { work, .. })) = rows.first() {
        let mut group = criterion.benchmark_group(format!("{}/{work}", link.name));
        for (count, timing) in rows.extract_if(.., |(_, timing)| timing.work == work) {
            group.throughput(throughput(count, timing));
            group.bench_function(timing.by, |bencher| bencher.iter_custom(|rounds| count.run.time(rounds)));
        }
        group.finish();
    }
}

fn throughput(count: &Count, timing: Timing) -> Throughput {
    match (timing.bytes, count.each) {
        (Some(bytes), _) => Throughput::Bytes(bytes as u64),
        (None, "byte") => Throughput::Bytes(count.units as u64),
        (None, _) => Throughput::Elements(count.units as u64),
    }
}
