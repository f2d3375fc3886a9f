//! Scenarios: simulated devices and clients put together, with what is measured and drawn.

pub mod fanuc_hmi_modbus;
pub mod kawasaki_msg;
pub mod kawasaki_run;
pub mod laser_eb90;
pub mod laser_run;
pub mod mma_run;
pub mod mmacell_proto;
pub mod operator;
mod options;
pub mod report;
pub mod teleop;
pub mod word;

use anyhow::{Result, bail};

pub use options::{DemoOptions, MustFail};

use self::report::Report;
use crate::links::settings::{self, Setting};

/// Runs the demo of the link of this name.
///
/// # Errors
/// When it cannot be set up: a port in use, a file that does not exist.
pub fn demo(link: &str, options: &DemoOptions) -> Result<Report> {
    let known = must_fail(link);
    if let Some(how) = options.must_fail.filter(|how| !known.contains(how)) {
        let name = |how: &MustFail| format!("{how:?}").to_lowercase();
        let known: Vec<_> = known.iter().map(name).collect();
        bail!("the demo of {link} has no --must-fail {}: it has {}", name(&how), known.join(", "));
    }
    let mut report = run(link, options)?;
    if options.spoils(MustFail::Late) {
        report.allow_no_time();
    }
    Ok(report)
}

/// How the record of the link's demo can be spoilt.
fn must_fail(link: &str) -> &'static [MustFail] {
    use MustFail::{Late, Limit, Lost, Repeated};
    match link {
        "kawasaki-msg" | "laser-eb90" => &[Lost, Repeated, Late],
        "val2-alter" | "fanuc-hmi-modbus" => &[Lost, Limit, Late],
        "val2-viewer" => &[Repeated],
        "isra-ball" => &[Lost, Late],
        "mmacell-proto" => &[Lost, Repeated],
        _ => &[],
    }
}

fn run(link: &str, options: &DemoOptions) -> Result<Report> {
    match link {
        "kawasaki-msg" => kawasaki_msg::demo(options),
        "val2-alter" => teleop::demo::robot(options),
        "val2-viewer" => teleop::demo::viewer(options),
        "isra-ball" => teleop::demo::ball(options),
        "fanuc-hmi-modbus" => fanuc_hmi_modbus::demo(options),
        "laser-eb90" => laser_eb90::demo(options),
        "mmacell-proto" => mmacell_proto::demo(options),
        _ => bail!("{link} has no demo"),
    }
}

/// What can be set of the demo of the link of this name.
pub fn settings(link: &str) -> Vec<Setting> {
    match link {
        "kawasaki-msg" => settings::list(kawasaki_msg::Settings::default()),
        "val2-alter" => settings::list(teleop::demo::RobotSettings::default()),
        "val2-viewer" => settings::list(teleop::demo::ViewerSettings::default()),
        "isra-ball" => settings::list(teleop::demo::BallSettings::default()),
        "fanuc-hmi-modbus" => settings::list(fanuc_hmi_modbus::Settings::default()),
        "laser-eb90" => settings::list(laser_eb90::Settings::default()),
        "mmacell-proto" => settings::list(mmacell_proto::Settings::default()),
        _ => Vec::new(),
    }
}
