//! `cellwire demo val2-alter`: the teleoperation cell, seen from the robot.

use std::collections::BTreeMap;
use std::time::Duration;

use anyhow::Result;
use val2_alter::{Mode, Scale, timing};

use super::plot;
use super::puma::error_text;
use crate::demo::DemoOptions;
use crate::report::{Budget, Report};
use crate::settings::Settings;
use crate::teleop::LIMITS;
use crate::teleop::cell::{self, CellConfig, CellRecord};
use crate::teleop::verdict::{Extremes, speeds};

/// The hand's whole round, and a little more.
const OWN_RUN: Duration = Duration::from_millis(6500);

/// Runs the cell. Settings: `baud` (38400) and `mode` (23) of the robot's line.
///
/// # Errors
/// When there are no pseudo-terminals, or a setting is none of this demo's.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let config = cell_config("val2-alter", options)?;
    let record = cell::run(&config, &options.progress)?;
    if let Some(path) = &options.out {
        plot::draw(path, &speeds(&record.host.cycles, config.mode.accumulation()), &LIMITS)?;
    }
    Ok(report(&config, &record))
}

/// The cell as the command line wants it.
///
/// # Errors
/// When a setting is none of the cell's.
pub fn cell_config(link: &str, options: &DemoOptions) -> Result<CellConfig> {
    let settings = Settings::new(link, &options.settings, &["baud", "mode"])?;
    Ok(CellConfig {
        time: options.seconds.unwrap_or(OWN_RUN),
        baud: settings.number("baud", timing::BAUD)?,
        mode: Mode(settings.number("mode", Mode::CUMULATIVE_23.0)?),
        faults: options.faults,
        seed: options.seed,
        trace: options.trace.clone(),
    })
}

fn report(config: &CellConfig, record: &CellRecord) -> Report {
    let CellRecord { puma, host, drawn, .. } = record;
    let mut report = Report::new(
        "val2-alter",
        format!(
            "a ball steers a robot, mode {} at {} baud, and a workstation draws it",
            config.mode.0, config.baud
        ),
    );
    report.fact("cycles", "cycles of 28 ms", puma.cycles);
    report.fact("kept", "kept", puma.replies.len());
    // The host falls silent at the end: that cycle is missed on purpose.
    let planned = puma.ends.len() - record.ends_before_stop;
    let missed = puma.missed.saturating_sub(planned as u64);
    report.fact("missed", "missed", missed);
    report.fact("bad_replies", "replies damaged, or cut off by the window", puma.bad_replies);
    report.fact("stalls", "times the host was put to sleep", host.stalls);
    report.fact("ends", "ended by the controller", ends(record));
    report.fact("taken_up_again", "taken up again", puma.starts.saturating_sub(1));
    report.fact(
        "priority",
        "priority of the replies",
        if host.has_priority { "real time" } else { "normal" },
    );
    let mut every_cycle = puma.turn_around.clone();
    for _ in puma.without.iter().filter(|at| **at < record.stopped_at) {
        every_cycle.add(timing::CYCLE);
    }
    let p999 = micros(every_cycle.at(0.999));
    report.fact("turn_around_p999_us", "turn-around p99.9, a missed cycle being 28000, µs", p999);
    report.fact("least_margin_us", "least left of the window, µs", micros(puma.margin.at(0.0)));

    limits(&mut report, config, record);

    let pressed = |closes| host.clamps.iter().filter(|clamp| **clamp == closes).count();
    let moved = |closes| puma.gripper.iter().filter(|grip| **grip == closes).count();
    report.fact(
        "gripper_closed",
        "gripper closed, of key presses",
        format!("{} of {}", moved(true), pressed(true)),
    );
    report.fact(
        "gripper_opened",
        "gripper opened, of key presses",
        format!("{} of {}", moved(false), pressed(false)),
    );
    report.fact("poses", "poses drawn, of poses sent", format!("{} of {}", drawn.poses, host.poses));
    report.fact("most_poses_at_once", "most poses between two pictures", drawn.most_at_once);
    report.fact("drift_mm", "arm moved while ALTER was off, mm", puma.drift);
    report.fact("early_bytes", "reply bytes too late for their window", puma.early);
    report.fact("simulator_late_us", "the simulator was late itself, µs in all", micros(puma.stood));
    report.fact("line_faults", "bytes damaged on the lines", record.line_faults.iter().sum::<u64>());

    let budget = puma.window.map(|time| Budget { time, source: "§3.4" });
    report.timing("turn_around", "request to reply, with the line", &puma.turn_around, budget);
    report.timing("host", "of that, the host", &puma.thinking, None);
    report.timing("host_own", "the host by its own clock", &host.thinking, None);

    report.require(puma.starts > 0, || "ALTER never ran".into());
    report.require(puma.drift == 0.0, || format!("the arm moved {} mm while ALTER was off", puma.drift));
    report
        .require(drawn.most_at_once <= 1, || format!("{} poses came at once: a backlog", drawn.most_at_once));
    // The program begins again a moment after each end.
    let settled = record.stopped_at.saturating_sub(Duration::from_secs(1));
    let to_take_up = puma.ends.iter().filter(|(at, _)| *at < settled).count() as u64;
    report.require(puma.starts > to_take_up, || {
        format!("ALTER ended {to_take_up} times, and was taken up {} times", puma.starts)
    });
    if !config.faults && puma.ends.len() == planned {
        report.require(puma.gripper == host.clamps, || {
            format!("the gripper moved {:?}, its keys were pressed {:?}", puma.gripper, host.clamps)
        });
    }
    report
}

fn ends(record: &CellRecord) -> String {
    let mut reasons = BTreeMap::<&str, u32>::new();
    for (_, error) in record.puma.ends.iter().take(record.ends_before_stop) {
        *reasons.entry(error_text(*error)).or_default() += 1;
    }
    let text: Vec<_> = reasons.iter().map(|(reason, count)| format!("{count} × {reason}")).collect();
    if text.is_empty() { "0".into() } else { text.join(", ") }
}

/// What the hand asked for, what the robot got, and the limits, along X in physical units; judged in every axis.
fn limits(report: &mut Report, config: &CellConfig, record: &CellRecord) {
    let accumulation = config.mode.accumulation();
    let mut asked = Extremes::default();
    for pair in speeds(&record.host.cycles, accumulation).windows(2) {
        if let [before, after] = pair
            && before.session == after.session
        {
            asked.add(before.demand, after.demand);
        }
    }
    let sent = Extremes::of(&speeds(&record.puma.replies, accumulation));
    let cycle = timing::CYCLE.as_secs_f64();
    let mm = |units: u32, per: f64| (f64::from(units) / Scale::PUMA_562.per_mm / per).round();
    let row = |asked: u32, sent: u32, limit: u16, per: f64| {
        format!("{} asked, {} sent, limit {}", mm(asked, per), mm(sent, per), mm(limit.into(), per))
    };
    let velocity = row(asked.velocity[0], sent.velocity[0], LIMITS.velocity[0], cycle);
    report.fact("velocity_x", "highest velocity along X, mm/s", velocity);
    let acceleration =
        row(asked.acceleration[0], sent.acceleration[0], LIMITS.acceleration[0], cycle * cycle);
    report.fact("acceleration_x", "highest acceleration along X, mm/s²", acceleration);
    report.require(sent.keeps(&LIMITS), || format!("the robot got {sent:?}, the limits are {LIMITS:?}"));
}

fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}
