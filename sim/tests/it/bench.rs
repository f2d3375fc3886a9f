//! The virtual clock of two ends: when what is sent arrives, when a connection is made, where the clock stops.

use core::time::Duration;

use cellwire_sim::{Fault, Script};

use crate::gadget::{Gadget, Line, bench};

const MS: Duration = Duration::from_millis(1);
const NOW: Duration = Duration::ZERO;

#[test]
fn a_byte_takes_its_time_in_both_directions() {
    let gadget = Gadget { line: Line::sending(&[(2 * MS, "AB")]), ..Gadget::default() };
    let mut bench = bench(Line::sending(&[(MS, "CD")]), gadget);
    (bench.wire.latency, bench.wire.baud) = (3 * MS, Some(10_000));
    let mut stops = Vec::new();
    bench.run_until(20 * MS, |bench| {
        stops.push(bench.now());
        false
    });
    assert_eq!(bench.session().log, ["0ns connected", "7ms AB"]);
    assert_eq!(bench.device().line.log, ["0ns connected", "6ms CD"]);
    assert_eq!(stops, [0, 1, 2, 6, 7, 20].map(|ms| ms * MS), "the clock stops at what is due");
}

#[test]
fn there_is_no_connection_to_a_device_without_power() {
    let mut bench = bench(Line::default(), Gadget::default());
    bench.faults().restart(5 * MS);
    let mut stops = Vec::new();
    bench.run_until(9 * MS, |bench| {
        stops.push(bench.now());
        false
    });
    assert_eq!(bench.session().log, ["5ms connected"]);
    assert_eq!(stops, [0, 5, 9].map(|ms| ms * MS), "the clock stops at what is due");
}

#[test]
fn everything_that_is_due_is_done_before_the_caller_looks() {
    let gadget = Gadget { line: Line::sending(&[(2 * MS, "AB")]), ..Gadget::default() };
    let mut bench = bench(Line::default(), gadget);
    bench.wire.reconnect = NOW;
    bench.faults().follow(Script::new().answer(1, Fault::Close));
    assert!(!bench.run_until(5 * MS, |bench| !bench.session().is_connected), "it reconnects at once");
    assert_eq!(bench.session().log, ["0ns connected", "2ms disconnected", "2ms connected"]);
}
