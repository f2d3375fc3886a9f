//! Scenarios: simulated devices and clients put together, with what is measured and drawn.

pub mod bridge;
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

/// The demo of a link.
struct Demo {
    link: &'static str,
    /// How its record can be spoilt.
    must_fail: &'static [MustFail],
    run: fn(&DemoOptions) -> Result<Report>,
    settings: fn() -> Vec<Setting>,
}

/// Every demo, one for each link.
static DEMOS: [Demo; 7] = [
    Demo {
        link: "kawasaki-msg",
        must_fail: &[MustFail::Lost, MustFail::Repeated, MustFail::Late],
        run: kawasaki_msg::demo,
        settings: || settings::list(kawasaki_msg::Settings::default()),
    },
    Demo {
        link: "val2-alter",
        must_fail: &[MustFail::Lost, MustFail::Limit, MustFail::Late],
        run: teleop::demo::robot,
        settings: || settings::list(teleop::demo::RobotSettings::default()),
    },
    Demo {
        link: "val2-viewer",
        must_fail: &[MustFail::Repeated],
        run: teleop::demo::viewer,
        settings: || settings::list(teleop::demo::ViewerSettings::default()),
    },
    Demo {
        link: "isra-ball",
        must_fail: &[MustFail::Lost, MustFail::Late],
        run: teleop::demo::ball,
        settings: || settings::list(teleop::demo::BallSettings::default()),
    },
    Demo {
        link: "fanuc-hmi-modbus",
        must_fail: &[MustFail::Lost, MustFail::Limit, MustFail::Late],
        run: fanuc_hmi_modbus::demo,
        settings: || settings::list(fanuc_hmi_modbus::Settings::default()),
    },
    Demo {
        link: "laser-eb90",
        must_fail: &[MustFail::Lost, MustFail::Repeated, MustFail::Late],
        run: laser_eb90::demo,
        settings: || settings::list(laser_eb90::Settings::default()),
    },
    Demo {
        link: "mmacell-proto",
        must_fail: &[MustFail::Lost, MustFail::Repeated],
        run: mmacell_proto::demo,
        settings: || settings::list(mmacell_proto::Settings::default()),
    },
];

/// Runs the demo of the link of this name.
///
/// # Errors
/// When it cannot be set up: a port in use, a file that does not exist.
pub fn demo(link: &str, options: &DemoOptions) -> Result<Report> {
    let Some(demo) = DEMOS.iter().find(|demo| demo.link == link) else { bail!("{link} has no demo") };
    let known = demo.must_fail;
    if let Some(how) = options.must_fail.filter(|how| !known.contains(how)) {
        let name = |how: &MustFail| format!("{how:?}").to_lowercase();
        let known: Vec<_> = known.iter().map(name).collect();
        bail!("the demo of {link} has no --must-fail {}: it has {}", name(&how), known.join(", "));
    }
    let mut report = (demo.run)(options)?;
    if options.spoils(MustFail::Late) {
        report.allow_no_time();
    }
    Ok(report)
}

/// What can be set of the demo of the link of this name.
pub fn settings(link: &str) -> Vec<Setting> {
    DEMOS.iter().find(|demo| demo.link == link).map_or_else(Vec::new, |demo| (demo.settings)())
}
