//! `cellwire demo viewer`: the teleoperation cell, seen from the workstation.

use anyhow::Result;

use super::cell::{CellConfig, CellRecord};
use crate::demo::{DemoOptions, MustFail};
use crate::report::{Report, were};
use cellwire_links::settings::{self, Configure, FieldVisitor};

/// The settings of the demo: the workstation, and the host that answers it.
#[derive(Debug, Default)]
pub struct Settings(CellConfig);

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        self.0.viewer.configure(fields);
        fields.group("host", |fields| self.0.viewer_host.configure(fields));
    }
}

/// Runs the cell.
///
/// # Errors
/// If there are no pseudo-terminals, or a setting is unknown to this demo.
pub fn demo(options: &DemoOptions) -> Result<Report> {
    let Settings(config) = settings::read("viewer", Settings::default(), &options.settings)?;
    let mut record = super::run(&config, options)?;
    if options.spoils(MustFail::Repeated) {
        record.drawn.most_at_once += 1;
    }
    Ok(report(&record))
}

pub(super) fn report(record: &CellRecord) -> Report {
    let CellRecord { drawn, host, line_faults: [_, _, line_faults], .. } = record;
    let title = "a workstation draws the robot, one pose per request";
    let mut report = Report::new("viewer", title).moves("a screen shows that arm");
    // The last one may be on the line when the run ends. A corrupt byte may join two lines.
    let explained = drawn.poses + 1 + 2 * line_faults;
    let lost = host.poses.saturating_sub(explained);
    report.stream(drawn.poses, host.poses.saturating_sub(drawn.poses + 1), lost == 0);
    report.fact("requests", "requests", drawn.asked);
    report.fact("sent", "poses sent", host.poses);
    report.fact("poses", "poses drawn", drawn.poses);
    report.fact("gaps", "missing poses", drawn.gaps);
    report.fact("corrupt", "corrupt or partial lines", drawn.damaged);
    report.fact("line_faults", "bytes corrupted on the line", *line_faults);
    report.fact("stale", "times the picture was stale", drawn.stale);
    report.fact("pauses", "times the operator paused it to request again", drawn.pauses);
    report.fact("most_at_once", "maximum of poses between two pictures", drawn.most_at_once);
    report.require(drawn.poses > 0, || "no pose was drawn".into());
    report.require(drawn.most_at_once <= 1, || {
        format!("{} poses arrived at once: a backlog", drawn.most_at_once)
    });
    report.require(lost == 0, || {
        let beyond =
            if *line_faults > 0 { ", more than the faults of the line can have destroyed" } else { "" };
        format!("{} lost between host and screen{beyond}", were(lost, "pose"))
    });
    report
}
