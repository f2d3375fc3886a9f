//! `cellwire fanuc evaluate`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result};

use super::print;
use crate::command::ls::ArmArgs;
use crate::report::Report;
use crate::telemetry::plot;
use crate::telemetry::recording::{self, Comparison, ComparisonError};
use cellwire_io::input::time;
use cellwire_io::output::remark;

/// Compares a log with the planned trajectory.
///
/// Fits the delay between the two (within ± the time of --within, so the log may begin before the motion), then
/// gives the errors of position, orientation and their speeds, and draws them with --out. Samples while nothing moves,
/// or before or after the motion, are left out. Brackets show the 95 % interval over other parts of the same
/// motion. The trajectory and the controller must use the same frame: the world frame, with the
/// tool frame given by --tool. The exit status is 1 when no delay is found.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The trajectory: time in seconds, J1 to J6 in degrees
    trajectory: PathBuf,
    /// The table that `fanuc log` wrote
    recording: PathBuf,
    /// The maximum delay
    #[arg(long, value_name = "TIME", default_value = "10s", value_parser = time(Duration::from_millis(100)..=Duration::from_secs(3600)))]
    within: Duration,
    /// Draw position, orientation and their errors into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    arm: ArmArgs,
}

pub(super) fn evaluate(args: &Args) -> Result<bool> {
    let arm = args.arm.arm(None)?;
    let trajectory = args.arm.trajectory(&args.trajectory)?;
    let path = &args.recording;
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let recorded = recording::read_states(&text).with_context(|| path.display().to_string())?;
    let mut report =
        Report::new("fanuc", format!("{} against {}", path.display(), args.trajectory.display()));
    let reference = recording::reference(&trajectory, &arm);
    let comparison = match Comparison::new(reference, recorded, args.within.as_secs_f64()) {
        Ok(comparison) => comparison,
        Err(error @ ComparisonError::DelayNotFound { .. }) => {
            report.fact("delay_ms", "best-fit delay", "not found");
            report.require(false, || error.to_string());
            print(&report, args.json)?;
            remark(&format!("error: {error}"));
            return Ok(false);
        }
        Err(error) => return Err(error.into()),
    };
    comparison.report(&mut report, comparison.delay);
    if let Some(folder) = &args.out {
        for path in plot::draw(folder, &comparison)? {
            remark(&path.display().to_string());
        }
    }
    print(&report, args.json)?;
    Ok(true)
}
