//! `cellwire ls background`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::Result;
use fanuc_hmi_modbus::Assignment;

use super::{rules, write};
use crate::telemetry::task::BackgroundTask;
use cellwire_io::files;
use cellwire_io::output::remark;

/// Writes the background task that copies the tool's pose and speed to registers for `cellwire fanuc log`.
///
/// It is the source's listing with your register numbers. Run it as a background task (BG Logic) with the given period;
/// it does not move the robot. Its 19 registers are read over Modbus as 37 from PDU address 0, which needs three slots of
/// `$SNPX_ASG`: these are printed too.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The program's name
    #[arg(long, default_value = "BG_TELEMETRY")]
    name: String,
    /// The period of the background task, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 8)]
    period: u64,
    /// The register of the life counter, followed by 18 more
    #[arg(long, value_name = "N", default_value_t = 1)]
    first: u16,
    /// The first of 13 scratch registers of the task
    #[arg(long, value_name = "N", default_value_t = 30)]
    scratch: u16,
    /// The motion group to observe
    #[arg(long, value_name = "N", default_value_t = 1)]
    group: u8,
    /// The file to write, - for standard output [default: NAME.LS]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write the three slots into this file too, as SETVAR lines of a command file; the simulator's setting `assignments`
    /// reads it
    #[arg(long, value_name = "FILE")]
    assignments: Option<PathBuf>,
    /// The longest program name; 8 on old controllers
    #[arg(long, value_name = "N", default_value_t = 36)]
    name_limit: usize,
}

pub(super) fn background(args: &Args) -> Result<()> {
    let task = BackgroundTask {
        name: args.name.clone(),
        period: Duration::from_millis(args.period),
        first: args.first,
        scratch: args.scratch,
        group: args.group,
        ..BackgroundTask::default()
    };
    let rules = rules(args.name_limit);
    let path = write(&task.program(&rules)?, &rules, args.out.as_deref(), false)?;
    let Args { first, scratch, period, .. } = args;
    remark(&format!(
        "{path}: R[{first}] to R[{}] every {period} ms; R[{scratch}] to R[{}] are scratch",
        first + 18,
        scratch + 12
    ));
    remark(slots(*first).trim_end());
    if let Some(path) = &args.assignments {
        let mut lines = String::new();
        for ((slot, name), assignment) in (1..).zip(names(*first)).zip(Assignment::TELEMETRY) {
            Assignment { var_name: &name, ..assignment }.print(slot, &mut lines)?;
        }
        files::write(path, lines.as_bytes())?;
        remark(&format!("{}: the same as SETVAR lines", path.display()));
    }
    Ok(())
}

/// Returns the variables of the three slots.
fn names(first: u16) -> [String; 3] {
    [format!("R[{first}]"), format!("R[{}]@1.1", first + 1), format!("R[{}]", first + 2)]
}

/// Returns the settings of the controller with which the registers from `first` on are the telemetry block.
fn slots(first: u16) -> String {
    let mut text = String::from(
        "  on the controller, instead of its first slot (from public programs: the source does not show its own), then restart it:\n  \
         $SNPX_ASG  $ADDRESS  $SIZE  $VAR_NAME     $MULTIPLY\n",
    );
    for ((slot, name), assignment) in (1..).zip(names(first)).zip(Assignment::TELEMETRY) {
        let Assignment { address, size, multiply, .. } = assignment;
        text += &format!("  {slot:>9}  {address:>8}  {size:>5}  {name:<12}  {:>9}\n", multiply.value());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slots_name_the_registers_of_the_task() {
        let shown = slots(1);
        for assignment in Assignment::TELEMETRY {
            assert!(shown.contains(&format!("  {}  ", assignment.var_name)), "{shown}");
        }
        assert!(
            slots(101).ends_with("          3         4     34  R[103]                0\n"),
            "{}",
            slots(101)
        );
    }
}
