//! `cellwire demo alter`: the teleoperation cell, seen from the robot.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::Result;
use val2_alter::{AXES, ErrorCode, HostConfig, Scale, timing};

use super::cell::{CellConfig, CellRecord};
use crate::demo::{DemoOptions, MustFail};
use crate::devices::val2_alter::puma::error_text;
use crate::report::{Budget, Report, micros, times};
use cellwire_io::output::counted;
use cellwire_links::settings::{self, Configure, FieldVisitor};

/// Messages so shortly before the end of a run may stay unanswered.
const SETTLING: Duration = Duration::from_secs(1);

/// The settings of the demo: the host's end, and the differences of the robot's end.
#[derive(Debug, Default)]
pub struct Settings(CellConfig);

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let CellConfig { alter, controller, .. } = &mut self.0;
        alter.configure(fields);
        // Both ends of a line agree, unless they are set apart.
        (controller.framing, controller.baud, controller.mode) = (alter.framing, alter.baud, alter.mode);
        fields.group("robot", |fields| controller.configure(fields));
    }
}

/// Runs the cell.
///
/// # Errors
/// If there are no pseudo-terminals, or a setting is unknown to this demo.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let Settings(config) = settings::read("alter", Settings::default(), &options.settings)?;
    let mut record = super::run(&config, options)?;
    if options.spoils(MustFail::Lost) {
        // A cycle without a reply, for which ALTER ended; and it was not resumed.
        record.puma.missed += 1;
        record.puma.ends.insert(0, (Duration::ZERO, ErrorCode::Timeout));
        record.ends_before_stop += 1;
        record.puma.starts = record.puma.starts.min(to_take_up(&record));
    }
    if options.spoils(MustFail::Limit) {
        record.puma.judge.extremes.add([0; AXES], [i16::MAX; AXES]);
    }
    Ok(report(&config, &record))
}

pub(super) fn report(config: &CellConfig, record: &CellRecord) -> Report {
    let CellRecord { puma, host, .. } = record;
    let mut report = Report::new(
        "alter",
        format!(
            "a ball steers a robot, mode {} at {} baud, and a workstation draws it",
            config.alter.mode.0, config.alter.baud
        ),
    )
    .moves("a ball steers an arm");
    report.fact("cycles", "cycles of 28 ms", puma.cycles);
    report.fact("kept", "kept", puma.turn_around.count());
    // The host falls silent at the end: that cycle is missed on purpose.
    let planned = puma.ends.len() - record.ends_before_stop;
    let missed = puma.missed.saturating_sub(planned as u64);
    report.fact("missed", "missed", missed);
    report.stream(puma.turn_around.count(), missed + puma.bad_replies, false);
    report.fact("bad_replies", "replies corrupt or cut off by the window", puma.bad_replies);
    report.fact("stalls", "times the host was delayed", host.stalls);
    report.fact("ends", "ended by the controller", ends(record));
    report.fact("taken_up_again", "resumed", puma.starts.saturating_sub(1));
    report.fact(
        "priority",
        "priority of the replies",
        if host.has_priority { "real time" } else { "normal" },
    );
    let mut every_cycle = puma.turn_around.clone();
    for _ in puma.without.iter().filter(|at| **at < record.stopped_at) {
        every_cycle.add(timing::CYCLE);
    }
    let p999 = micros(every_cycle.at(0.999).min(timing::CYCLE));
    report.fact("turn_around_p999_us", "turn-around p99.9, µs; a missed cycle counts as 28000", p999);
    report.fact(
        "least_margin_us",
        "shortest remaining window in answered cycles, µs",
        micros(puma.margin.at(0.0)),
    );

    judge_limits(&mut report, config, record);

    let pressed = |closes| host.gripper_keys.iter().filter(|(_, clamp)| *clamp == closes).count();
    let moved = |closes| puma.gripper.iter().filter(|grip| **grip == closes).count();
    report.fact(
        "gripper_closed",
        "gripper closed / key presses",
        format!("{} of {}", moved(true), pressed(true)),
    );
    report.fact(
        "gripper_opened",
        "gripper opened / key presses",
        format!("{} of {}", moved(false), pressed(false)),
    );
    report.fact("drift_mm", "arm moved while ALTER was off, mm", puma.drift);
    report.fact("stray_replies", "replies too late for their window", puma.strays);
    report.fact("simulator_late_us", "delay of the simulator itself, µs in total", micros(puma.stood));
    report.fact("line_faults", "bytes corrupted on the lines", record.line_faults.iter().sum::<u64>());

    let budget = puma.window.map(|time| Budget { time, source: "§3.4" });
    report.timing("turn_around", "request to reply; a missed cycle counts as 28 ms", &every_cycle, budget);
    report.timing("host", "of that, host session and computer", &puma.thinking, None);
    // A reply that the host gave up counts as a whole cycle, except for injected stalls.
    let mut host_own = host.thinking.clone();
    for _ in host.stalls..host.missed {
        host_own.add(timing::CYCLE);
    }
    report.timing("host_own", "host by its own clock", &host_own, slack(config));

    promises(&mut report, record, missed);
    report
}

/// Returns the time that a window leaves to the host when the request and its reply are as long as possible.
fn slack(config: &CellConfig) -> Option<Budget> {
    let HostConfig { mode, baud, framing, .. } = config.alter;
    let worst = timing::Budget::worst_case(mode.accumulation(), baud, mode.has_transform(), AXES, framing);
    worst.slack().map(|time| Budget { time, source: "§3.4, longest messages" })
}

/// Returns whether an event happened long enough before the end of the run to be answered.
fn is_settled(record: &CellRecord, at: Duration) -> bool {
    at + SETTLING < record.stopped_at
}

/// Returns the number of ends of ALTER that the host must have resumed.
fn to_take_up(record: &CellRecord) -> u64 {
    record.puma.ends.iter().filter(|(at, _)| is_settled(record, *at)).count() as u64
}

/// Checks every cycle: one without a good reply has an injected fault, or was late.
fn promises(report: &mut Report, record: &CellRecord, missed: u64) {
    let CellRecord { puma, host, .. } = record;
    report.require(puma.starts > 0, || "ALTER never ran".into());
    let lost = missed + puma.bad_replies;
    // A host that sleeps misses one cycle, which ends ALTER; so does a byte that is corrupt on either way.
    let [line_faults, _, _] = record.line_faults;
    let inserted = host.stalls + line_faults;
    report.in_time(lost <= inserted, || {
        let cycles = counted(puma.cycles, "cycle");
        format!(
            "{lost} of {cycles} {} lost, {inserted} by injected faults",
            if lost == 1 { "was" } else { "were" }
        )
    });
    report.require(puma.turn_around.count() > 0, || "no cycle was answered".into());
    report.require(puma.drift == 0.0, || format!("the arm moved {} mm while ALTER was off", puma.drift));
    let ended = to_take_up(record);
    report.require(puma.starts > ended, || {
        let resumed = match puma.starts.saturating_sub(1) {
            0 => "never resumed".into(),
            starts => format!("resumed only {}", times(starts)),
        };
        format!("ALTER ended {}, but was {resumed}", times(ended))
    });
    if host.stalls == 0 && record.line_faults == [0; 3] && record.ends_before_stop == 0 {
        let pressed: Vec<bool> = host.gripper_keys.iter().map(|(_, closes)| *closes).collect();
        let due = host.gripper_keys.iter().take_while(|(at, _)| is_settled(record, *at)).count();
        report.require(pressed.starts_with(&puma.gripper) && puma.gripper.len() >= due, || {
            format!("the gripper moved {:?}, but its keys were pressed {pressed:?}", puma.gripper)
        });
    }
}

fn ends(record: &CellRecord) -> String {
    let mut reasons = BTreeMap::<&str, u32>::new();
    for (_, error) in record.puma.ends.iter().take(record.ends_before_stop) {
        *reasons.entry(error_text(*error)).or_default() += 1;
    }
    let text: Vec<_> = reasons.iter().map(|(reason, count)| format!("{count} × {reason}")).collect();
    if text.is_empty() { "0".into() } else { text.join(", ") }
}

/// Reports the values of the hand, the values for the robot, and the limits, along X in physical units; checks all axes.
fn judge_limits(report: &mut Report, config: &CellConfig, record: &CellRecord) {
    let limits = config.alter.limits;
    let asked = record.host.cycles.asked();
    let sent = record.puma.judge.extremes;
    let cycle = timing::CYCLE.as_secs_f64();
    let mm = |units: u32, per: f64| (f64::from(units) / Scale::PUMA_562.per_mm / per).round();
    let row = |asked: u32, sent: u32, limit: u16, per: f64| {
        format!("{} requested, {} sent, limit {}", mm(asked, per), mm(sent, per), mm(limit.into(), per))
    };
    let velocity = row(asked.velocity[0], sent.velocity[0], limits.velocity[0], cycle);
    report.fact("velocity_x", "highest velocity along X, mm/s", velocity);
    let acceleration =
        row(asked.acceleration[0], sent.acceleration[0], limits.acceleration[0], cycle * cycle);
    report.fact("acceleration_x", "highest acceleration along X, mm/s²", acceleration);
    report.require(sent.keeps(&limits), || format!("the robot got {sent:?}, the limits are {limits:?}"));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::val2_alter::judge::ReceivedReply;
    use crate::io::samples::Samples;

    const MS: Duration = Duration::from_millis(1);

    fn failures(change: impl FnOnce(&mut CellRecord)) -> Vec<String> {
        list("failures", change)
    }

    fn over_budget(change: impl FnOnce(&mut CellRecord)) -> Vec<String> {
        list("over_budget", change)
    }

    fn list(key: &str, change: impl FnOnce(&mut CellRecord)) -> Vec<String> {
        let mut record = CellRecord { stopped_at: 10_000 * MS, ..CellRecord::default() };
        record.puma.starts = 1;
        for cycle in 1..=100u8 {
            let values = [8, 0, 0, 0, 0, 0];
            let taken = ReceivedReply { session: 1, cycle: cycle.into(), values };
            record.puma.judge.add(taken, val2_alter::Accumulation::Cumulative);
            record.puma.turn_around.add(6 * MS);
            record.host.thinking.add(MS / 20);
        }
        change(&mut record);
        let report = report(&CellConfig::default(), &record);
        if key == "failures" { report.failures().to_vec() } else { report.over_budget().collect() }
    }

    /// Makes the record miss one cycle, after which ALTER ends.
    fn miss(record: &mut CellRecord) {
        record.puma.missed += 1;
        record.puma.without.push(5000 * MS);
        record.puma.ends.push((5000 * MS, ErrorCode::Timeout));
        record.ends_before_stop += 1;
    }

    #[test]
    fn every_cycle_counts() {
        assert_eq!(over_budget(|_| ()), [""; 0]);
        let lost = "1 of 0 cycles was lost, 0 by injected faults";
        let taken_up = |record: &mut CellRecord| {
            miss(record);
            record.puma.starts = 2;
        };
        assert_eq!((over_budget(taken_up), failures(taken_up)), (vec![lost.to_owned()], Vec::new()));
        assert_eq!(failures(miss), ["ALTER ended once, but was never resumed"]);
        let again = |record: &mut CellRecord| (0..3).for_each(|_| miss(record));
        let resumed = |record: &mut CellRecord| {
            again(record);
            record.puma.starts = 2;
        };
        assert_eq!(failures(resumed), ["ALTER ended 3 times, but was resumed only once"]);
        assert_eq!(over_budget(|record| record.puma.bad_replies = 1), [lost]);
    }

    #[test]
    fn a_slow_host_is_reported() {
        let slow = |record: &mut CellRecord| (0..4).for_each(|_| record.host.thinking.add(5 * MS));
        let own = "host by its own clock: p99 is 5.00 ms, the budget 2.74 ms (§3.4, longest messages)";
        assert_eq!(over_budget(slow), [own]);
        let gives_up = |record: &mut CellRecord| record.host.missed = 4;
        assert!(over_budget(gives_up)[0].starts_with("host by its own clock: p99 is 28"));
        let asleep = |record: &mut CellRecord| (record.host.missed, record.host.stalls) = (4, 4);
        assert_eq!(over_budget(asleep), [""; 0]);
    }

    #[test]
    fn limits_gripper_and_kept_cycles_are_judged() {
        let fast = |record: &mut CellRecord| record.puma.judge.extremes.add([8, 0, 0, 0, 0, 0], [17; AXES]);
        assert!(failures(fast)[0].starts_with("the robot got Extremes"));
        let press = |at| move |record: &mut CellRecord| record.host.gripper_keys.push((at * MS, true));
        assert_eq!(failures(press(5000)), ["the gripper moved [], but its keys were pressed [true]"]);
        assert_eq!(failures(press(9990)), [""; 0], "too late for the run");
        assert_eq!(
            failures(|record| record.puma.turn_around = Samples::default()),
            ["no cycle was answered"]
        );
    }
}
