//! The whole cell on a virtual clock, over links that do nothing wrong and over links that break.

use core::time::Duration;

use mmacell_task::Step;
use testkit::link::{self, Delivery, Faults, Link};

use cellwire::demo::mma::cell::{self, Cell, CellConnection};
use cellwire::demo::mma::central::{Central, RunTimes};
use cellwire::demo::mma::figures::RunFigures;
use cellwire::demo::mma::verdict::{End, attempts, is_in_order, leaves_open};
use cellwire_sim::mma::MotionFaults;

/// The switch is looked at this often while the vacuum is on.
const SWITCH_CHECK_INTERVAL: Duration = Duration::from_millis(5);

fn run(parts: u64, seed: u64, faults: Faults, errors: bool) -> (Central, Cell) {
    let mut central =
        Central::new(Some(parts), 1, cell::CONFIG, mmacell_proto::CentralConfig::DEFAULT).unwrap();
    let device = mmacell_proto::DeviceConfig::DEFAULT;
    let mut cell = Cell::new(seed, errors, MotionFaults::default(), device).unwrap();
    let mut links = [0, 1, 2].map(|n| Link::new(seed + n, faults));
    let mut time = Duration::ZERO;
    let now = |time| RunTimes { wall: time, cell: time };
    for which in CellConnection::ALL {
        cell.connect(which, time);
        central.connected(now(time), which);
    }
    let mut last_step = (Step::AwaitDevices, time);
    while central.step() != Step::Finished {
        for (which, link) in CellConnection::ALL.into_iter().zip(&mut links) {
            while let Some(delivery) = link.receive(link::End::B, time) {
                if let Delivery::Bytes(bytes) = delivery {
                    let (reply, closes) = cell.receive(which, time, &bytes);
                    if !reply.is_empty() {
                        link.send(link::End::B, time, &reply);
                    }
                    if closes {
                        cell.connect(which, time);
                    }
                }
            }
            while let Some(delivery) = link.receive(link::End::A, time) {
                match delivery {
                    Delivery::Bytes(bytes) => central.receive(now(time), which, &bytes),
                    Delivery::Closed => central.disconnected(now(time), which),
                }
            }
        }
        cell.advance(time);
        central.run(now(time), &cell);
        for (which, link) in CellConnection::ALL.into_iter().zip(&mut links) {
            let bytes = central.transmit(which);
            if !bytes.is_empty() {
                link.send(link::End::A, time, &bytes);
            }
            if central.is_broken(which) {
                link.reconnect();
                cell.connect(which, time);
                central.connected(now(time), which);
            }
        }
        let (wall, task) = central.due();
        let deliveries = links.iter().filter_map(Link::next_delivery);
        let look = if cell.parts().vacuum() { SWITCH_CHECK_INTERVAL } else { Duration::from_secs(1) };
        let next = deliveries.chain(wall).chain(task).chain([time + look]).min().unwrap();
        time = next.max(time + Duration::from_micros(1));
        if last_step.0 != central.step() {
            last_step = (central.step(), time);
        }
        assert!(time - last_step.1 < Duration::from_secs(60), "the cell stalled in {:?}", last_step.0);
    }
    (central, cell)
}

fn check(central: &Central, cell: &Cell, parts: u64) {
    let (log, record) = (&central.log, &cell.parts().record);
    let tries = attempts(log.steps.iter().map(|(_, step)| *step));
    let open = tries.iter().filter(|(steps, end)| leaves_open(steps, *end)).count() as u64;
    assert_eq!((log.placed, log.vacuum_left_on), (parts, 0));
    assert!(record.carried_off <= open, "{} carried off, {open} open", record.carried_off);
    assert!((parts..=parts + open).contains(&record.placed), "{} placed, {open} open", record.placed);
    for (number, (steps, end)) in tries.iter().enumerate() {
        assert!(is_in_order(steps, *end), "attempt {number}: {steps:?} {end:?}");
    }
    let judged = RunFigures::of(log, record);
    assert_eq!((judged.attempts, judged.open, judged.cycles.count()), (tries.len() as u64, open, parts));
    assert_eq!((judged.let_go_elsewhere, judged.failures.as_slice()), (0, &[][..]));
    for (n, executed) in [cell.robot().motions(), cell.platform().motions()].into_iter().enumerate() {
        for span in log.motions[n].spans(executed) {
            let counts = span.count();
            assert_eq!((counts.lost, counts.repeated), (0, 0), "{span:?}");
        }
    }
}

#[test]
fn two_hundred_parts_with_misses_and_losses() {
    let (central, cell) = run(200, 1, Faults::NONE, false);
    check(&central, &cell, 200);
    let record = &cell.parts().record;
    assert!(record.missed > 6 && record.lost > 6, "{} missed, {} lost", record.missed, record.lost);
    assert_eq!(record.dropped, 0);
    // A look at the switch, and the way of the order to the valve.
    assert!(
        record.vacuum_after_fall <= SWITCH_CHECK_INTERVAL + 2 * Faults::NONE.latency,
        "{:?}",
        record.vacuum_after_fall
    );
    let tries = attempts(central.log.steps.iter().map(|(_, step)| *step));
    let given_up = tries.iter().filter(|(_, end)| *end == End::GivenUp).count() as u64;
    assert_eq!(given_up, record.missed + record.lost);
    assert_eq!(tries.len() as u64, 200 + given_up);
}

#[test]
fn every_part_is_placed_also_over_links_that_break_with_a_robot_that_fails() {
    let (mut faults_seen, mut unknown) = (0, 0);
    for seed in 0..8 {
        let faults = Faults { disconnect: 0.001, max_delay: Duration::from_millis(30), ..Faults::TCP };
        let (central, cell) = run(20, seed, faults, true);
        check(&central, &cell, 20);
        faults_seen += central.log.faults;
        let spans = central.log.motions.iter().flat_map(|motions| motions.spans(u64::MAX));
        unknown += spans.map(|span| span.count().unknown).sum::<u64>();
    }
    assert!(faults_seen > 8, "{faults_seen}");
    assert!(unknown > 0, "no motion's outcome was ever unknown");
}
