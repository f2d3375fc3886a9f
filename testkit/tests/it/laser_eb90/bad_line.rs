//! Both ends on a line that corrupts bytes: the outcome of each instruction.

use core::time::Duration;
use std::collections::BTreeMap;

use laser_eb90::{HostConfig, HostEvent, Profile, Width};
use testkit::link::Faults;

use crate::laser_eb90::cell::{Cell, KNOWN, MS, cut};

const BYTE_IN_1000: Faults = Faults {
    flip: 0.0004,
    lose_byte: 0.0003,
    insert: 0.0003,
    split: 0.3,
    merge: 0.3,
    delay: 0.05,
    max_delay: Duration::from_millis(20),
    ..Faults::NONE
};

/// One byte in 1000 corrupt: every instruction is executed exactly once or reported unknown. Where the checksum cannot see
/// it, an instruction that nobody sent stands in for one that was.
#[test]
fn every_instruction_is_executed_once_or_reported_unknown() {
    let mut count = Count::default();
    for seed in 0..40 {
        run_over(seed, BYTE_IN_1000, Width::U8, 200, &mut count);
    }
    println!("{count:?}");
    assert_eq!(count.repeated, 0, "{count:?}");
    assert!(count.lost <= count.invented, "{count:?}");
    assert!(count.resends > 50 && count.unknown > 50, "the line was bad: {count:?}");
}

#[test]
fn a_line_that_also_falls_silent_loses_nothing_unreported() {
    let mut count = Count::default();
    for seed in 0..40 {
        run_over(seed, Faults::SERIAL, Width::U16Le, 100, &mut count);
    }
    println!("{count:?}");
    assert_eq!(count.repeated, 0, "{count:?}");
    assert!(count.lost <= count.invented, "{count:?}");
}

/// The host's knowledge of an instruction.
#[derive(Debug, Clone, Copy, PartialEq)]
enum HostKnowledge {
    Taken,
    Refused,
    Nothing,
}

/// The counts of a run over a bad line.
#[derive(Debug, Default)]
struct Count {
    sent: u32,
    unknown: u32,
    refused: u32,
    /// Executed, though it was not sent: corruption that the checksum could not see.
    invented: u32,
    /// Neither executed nor reported.
    lost: u32,
    /// Executed twice, or executed though reported as refused.
    repeated: u32,
    resends: u32,
}

/// Sends cuts over a bad line until `cuts` have been reported.
fn run_over(seed: u64, faults: Faults, checksum: Width, cuts: u32, count: &mut Count) {
    let profile = Profile { checksum, ..Profile::default() };
    let config = HostConfig { profile, baud: 115_200, ..KNOWN() };
    let mut cell = Cell::new(seed, faults.at_baud(115_200), config);
    let mut status: Vec<Option<HostKnowledge>> = vec![None; cuts as usize];
    let mut next = 0;
    while status.iter().any(Option::is_none) {
        while next < cuts && cell.submit(next).is_ok() {
            next += 1;
        }
        cell.run_for(MS * 5);
        for event in cell.events.drain(..) {
            let (first, number, known) = match event {
                HostEvent::Done { first, count: number, resends, unanswered: 0 } => {
                    count.resends += u32::from(resends);
                    (first, number, HostKnowledge::Taken)
                }
                HostEvent::Refused { first, count, .. } => (first, count, HostKnowledge::Refused),
                HostEvent::Unknown { first, count, .. } => (first, count, HostKnowledge::Nothing),
                other => panic!("{other:?}"),
            };
            for ticket in first..first + u64::from(number) {
                assert_eq!(status[usize::try_from(ticket).unwrap()].replace(known), None, "reported twice");
            }
        }
        if cell.host.is_held() {
            cell.host.resume();
        }
        assert!(cell.now < Duration::from_secs(10), "no progress: four seconds are enough");
    }
    cell.run_for(Duration::from_secs(1));
    let mut times = BTreeMap::<u32, u32>::new();
    for job in &cell.executed {
        if job.index < cuts && *job == cut(job.index) {
            *times.entry(job.index).or_default() += 1;
        } else {
            count.invented += 1;
        }
    }
    count.sent += cuts;
    for (index, known) in (0..).zip(status) {
        let times = times.get(&index).copied().unwrap_or(0);
        count.unknown += u32::from(known == Some(HostKnowledge::Nothing));
        count.refused += u32::from(known == Some(HostKnowledge::Refused));
        count.repeated += u32::from(times > 1 || (known == Some(HostKnowledge::Refused) && times > 0));
        count.lost += u32::from(known == Some(HostKnowledge::Taken) && times == 0);
    }
}
