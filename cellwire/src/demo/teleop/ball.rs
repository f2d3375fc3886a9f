//! `cellwire demo ball`: the teleoperation cell, seen from the ball.

use anyhow::Result;
use isra_ball::timing;

use super::cell::{CellConfig, CellRecord};
use crate::demo::{DemoOptions, MustFail};
use crate::report::{Budget, Report, were};
use cellwire_links::settings::{self, Configure, FieldVisitor};

/// The settings of the demo.
#[derive(Debug, Default)]
pub struct Settings(CellConfig);

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        self.0.polls.configure(fields);
        self.0.ball.configure(fields);
    }
}

/// Runs the cell.
///
/// # Errors
/// If there are no pseudo-terminals, or a setting is unknown to this demo.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let Settings(config) = settings::read("ball", Settings::default(), &options.settings)?;
    let mut record = super::run(&config, options)?;
    if options.spoils(MustFail::Lost) {
        // One packet that arrived is removed, and each packet that may be lost is.
        let [sent, explained] = packets(&record);
        record.ball.fresh += explained.saturating_sub(sent);
        let host = &mut record.host;
        let arrived = if host.fresh > 0 { &mut host.fresh } else { &mut host.old };
        *arrived = arrived.saturating_sub(1);
        host.ball_missed += 1;
    }
    Ok(report(&config, &record))
}

/// Returns the number of packets that the ball sent, and the maximum that it can have sent if none was lost without a
/// reason: those that arrived, complete or partial; one on the line at the end of the run; and two for each corrupted byte,
/// since it may join two packets.
fn packets(CellRecord { ball, host, line_faults: [_, faults, _], .. }: &CellRecord) -> [u64; 2] {
    [ball.fresh + ball.old, host.fresh + host.old + host.ball_late + host.ball_corrupt + 1 + 2 * faults]
}

pub(super) fn report(config: &CellConfig, record: &CellRecord) -> Report {
    let CellRecord { host, line_faults: [_, line_faults, _], .. } = record;
    let title = format!(
        "a hand on the ball steers the robot: one poll per cycle of 28 ms, at {} baud",
        config.polls.baud
    );
    let mut report = Report::new("ball", title).moves("a hand pushes the ball");
    let answered = host.fresh + host.old;
    let [sent, explained] = packets(record);
    let lost = sent.saturating_sub(explained);
    report.stream(answered, host.ball_missed.max(lost), lost == 0);
    report.fact("polls", "polls", answered + host.ball_missed);
    report.fact("fresh", "packets with new values", host.fresh);
    report.fact("old", "packets with old values", host.old);
    report.fact("missed", "polls without a packet", host.ball_missed);
    report.fact("late", "packets that are not replies", host.ball_late);
    report.fact("corrupt", "corrupt or partial packets", host.ball_corrupt);
    report.fact("line_faults", "bytes corrupted on the line", *line_faults);
    report.fact("stale", "times the values were older than 150 ms", host.ball_stale);
    report.fact("key_presses", "gripper keys forwarded", host.gripper_keys.len());
    report.fact("key_presses_refused", "gripper keys while ALTER was off", host.gripper_keys_refused);
    let budget = Budget { time: config.polls.period, source: "§3.4: the robot's cycle" };
    // A packet is not awaited longer than that.
    let mut exchange = host.exchange.clone();
    (0..host.ball_missed).for_each(|_| exchange.add(2 * budget.time));
    let label = "poll to packet; no packet counts as two periods";
    report.timing("exchange", label, &exchange, Some(budget));
    report.require(answered > 0, || format!("no poll was answered, of {}", host.ball_missed));
    // A packet too late for its poll looks like the answer to the next one: they have no numbers.
    let fastest = host.exchange.at(0.0);
    report.require(host.ball_missed > 0 || fastest >= timing::exchange_time(config.polls.baud), || {
        format!("a packet came in {fastest:?}, faster than the line rate")
    });
    report.require(lost == 0, || {
        let beyond =
            if *line_faults > 0 { ", more than the faults of the line can have destroyed" } else { "" };
        format!("{} lost between ball and host{beyond}", were(lost, "packet"))
    });
    report
}
