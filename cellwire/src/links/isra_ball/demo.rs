//! `cellwire demo isra-ball`: the teleoperation cell, seen from the ball.

use anyhow::Result;
use isra_ball::timing;

use crate::demo::DemoOptions;
use crate::links::val2_alter::cell_config;
use crate::report::{Budget, Report};
use crate::teleop::cell::{self, CellRecord};

/// Runs the cell.
///
/// # Errors
/// When there are no pseudo-terminals, or a setting is none of this demo's.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let config = cell_config("isra-ball", options)?;
    let CellRecord { ball, host, line_faults: [_, line_faults, _], .. } =
        cell::run(&config, &options.progress)?;
    let polls = isra_ball::Config::default();
    let title = "a hand on the ball steers the robot: one poll in its cycle of 28 ms, at 9600 baud";
    let mut report = Report::new("isra-ball", title);
    let answered = host.fresh + host.old;
    report.fact("polls", "polls", answered + host.ball_missed);
    report.fact("fresh", "packets with new values", host.fresh);
    report.fact("old", "packets with old values", host.old);
    report.fact("missed", "polls without a packet", host.ball_missed);
    report.fact("late", "packets after the next poll", host.ball_late);
    report.fact("damaged", "damaged packets, or pieces of one", host.ball_damaged);
    report.fact("line_faults", "bytes damaged on the line", line_faults);
    report.fact("stale", "times without new values for 100 ms", host.ball_stale);
    report.fact("key_presses", "gripper keys sent on", host.clamps.len());
    report.fact("key_presses_refused", "gripper keys while ALTER was off", host.clamps_refused);
    let budget = Budget { time: polls.period, source: "§3.4: the robot's cycle" };
    report.timing("exchange", "poll to packet", &host.exchange, Some(budget));
    report.require(answered > host.ball_missed, || {
        format!("{answered} polls were answered, {} were not", host.ball_missed)
    });
    // A packet too late for its poll looks like the answer to the next one: they have no numbers.
    let fastest = host.exchange.at(0.0);
    report.require(host.ball_missed > 0 || fastest >= timing::exchange_time(polls.baud), || {
        format!("a packet came in {fastest:?}, faster than the line carries it")
    });
    // The last one may be on the line when the run ends.
    let (sent, arrived) = (ball.fresh + ball.old, answered + host.ball_late + host.ball_damaged);
    report.require(config.faults || sent <= arrived + 1, || {
        format!("the ball sent {sent} packets, {arrived} arrived, whole or not")
    });
    Ok(report)
}
