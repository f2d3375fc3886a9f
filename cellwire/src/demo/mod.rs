//! The demos: each link end to end, a simulated device and a client put together, and what is measured and drawn.

pub mod fanuc;
pub mod kawasaki;
pub mod laser;
pub mod mma;
mod options;
pub mod table;
pub mod teleop;

use anyhow::{Result, bail};

pub use options::{DemoOptions, MustFail};

use crate::report::Report;
use cellwire_links::settings::{self, Setting};

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
        link: "kawasaki",
        must_fail: &[MustFail::Lost, MustFail::Repeated, MustFail::Late],
        run: kawasaki::demo,
        settings: || settings::list(kawasaki::Settings::default()),
    },
    Demo {
        link: "alter",
        must_fail: &[MustFail::Lost, MustFail::Limit, MustFail::Late],
        run: teleop::robot,
        settings: || settings::list(teleop::RobotSettings::default()),
    },
    Demo {
        link: "viewer",
        must_fail: &[MustFail::Repeated],
        run: teleop::viewer,
        settings: || settings::list(teleop::ViewerSettings::default()),
    },
    Demo {
        link: "ball",
        must_fail: &[MustFail::Lost, MustFail::Late],
        run: teleop::ball,
        settings: || settings::list(teleop::BallSettings::default()),
    },
    Demo {
        link: "fanuc",
        must_fail: &[MustFail::Lost, MustFail::Limit, MustFail::Late],
        run: fanuc::demo,
        settings: || settings::list(fanuc::Settings::default()),
    },
    Demo {
        link: "laser",
        must_fail: &[MustFail::Lost, MustFail::Repeated, MustFail::Late],
        run: laser::demo,
        settings: || settings::list(laser::Settings::default()),
    },
    Demo {
        link: "mma",
        must_fail: &[MustFail::Lost, MustFail::Repeated],
        run: mma::demo,
        settings: || settings::list(mma::Settings::default()),
    },
];

/// Runs the demo of the link of this name.
///
/// # Errors
/// When it cannot be set up: a port in use, a file that does not exist.
pub fn run(link: &str, options: &DemoOptions) -> Result<Report> {
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
