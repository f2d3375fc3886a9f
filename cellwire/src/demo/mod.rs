//! The demos: each link end to end, a simulated device and a client put together, and the measurements and drawings of the
//! run.

pub mod fanuc;
pub mod kawasaki;
pub mod laser;
pub mod mma;
mod operator;
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
    /// Entries of `must_fail` that cannot fail with faults: there is no deadline.
    only_without_faults: &'static [MustFail],
    run: fn(&DemoOptions) -> Result<Report>,
    settings: fn() -> Vec<Setting>,
}

/// Every demo, one for each link.
static DEMOS: [Demo; 7] = [
    Demo {
        link: "kawasaki",
        must_fail: &[MustFail::Lost, MustFail::Repeated, MustFail::Late],
        only_without_faults: &[],
        run: kawasaki::demo,
        settings: || settings::list(kawasaki::Settings::default()),
    },
    Demo {
        link: "alter",
        must_fail: &[MustFail::Lost, MustFail::Limit, MustFail::Late],
        only_without_faults: &[],
        run: teleop::robot,
        settings: || settings::list(teleop::RobotSettings::default()),
    },
    Demo {
        link: "viewer",
        must_fail: &[MustFail::Repeated],
        only_without_faults: &[],
        run: teleop::viewer,
        settings: || settings::list(teleop::ViewerSettings::default()),
    },
    Demo {
        link: "ball",
        must_fail: &[MustFail::Lost, MustFail::Late],
        only_without_faults: &[],
        run: teleop::ball,
        settings: || settings::list(teleop::BallSettings::default()),
    },
    Demo {
        link: "fanuc",
        must_fail: &[MustFail::Lost, MustFail::Limit, MustFail::Late],
        only_without_faults: &[MustFail::Late],
        run: fanuc::demo,
        settings: || settings::list(fanuc::Settings::default()),
    },
    Demo {
        link: "laser",
        must_fail: &[MustFail::Lost, MustFail::Repeated, MustFail::Late],
        only_without_faults: &[],
        run: laser::demo,
        settings: || settings::list(laser::Settings::default()),
    },
    Demo {
        link: "mma",
        must_fail: &[MustFail::Lost, MustFail::Repeated],
        only_without_faults: &[],
        run: mma::demo,
        settings: || settings::list(mma::Settings::default()),
    },
];

/// Runs the demo of the link of this name.
///
/// # Errors
/// If it cannot be set up: a port in use, a file that does not exist.
pub fn run(link: &str, options: &DemoOptions) -> Result<Report> {
    let Some(demo) = DEMOS.iter().find(|demo| demo.link == link) else { bail!("{link} has no demo") };
    let can = |how: &MustFail| !(options.faults && demo.only_without_faults.contains(how));
    let known: Vec<MustFail> = demo.must_fail.iter().copied().filter(can).collect();
    if let Some(how) = options.must_fail.filter(|how| !known.contains(how)) {
        let with = if demo.must_fail.contains(&how) { " with --faults" } else { "" };
        let known: Vec<_> = known.into_iter().map(MustFail::name).collect();
        bail!("the demo of {link} has no --must-fail {}{with}: it has {}", how.name(), known.join(", "));
    }
    let mut report = (demo.run)(options)?;
    if options.spoils(MustFail::Late) {
        report.allow_no_time();
    }
    if let Some(how) = options.must_fail {
        let is_seen = !report.is_good() || (how == MustFail::Late && !report.is_in_time());
        report.require(is_seen, || {
            format!(
                "--must-fail {} found nothing to spoil in this run: give it more time with --for",
                how.name()
            )
        });
    }
    Ok(report)
}

/// Returns the settings of the demo of the link of this name.
pub fn settings(link: &str) -> Vec<Setting> {
    DEMOS.iter().find(|demo| demo.link == link).map_or_else(Vec::new, |demo| (demo.settings)())
}
