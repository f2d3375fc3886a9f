//! `cellwire demo`: each link end to end, over real sockets and pseudo-terminals.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Result;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::settings::SetArgs;
use crate::cell::demo::{self, DemoOptions, MustFail};
use crate::io::input::time;
use crate::io::interrupt;
use crate::io::line::Lines;
use crate::io::output::remark;
use crate::io::trace::TraceArgs;
use crate::links::link_parser;
use cellwire_links::LINKS;
use cellwire_links::link::Link;

/// Runs links end to end: a simulated controller against a client session, over real loopback TCP and pseudo-terminals.
///
/// Prints a table for each link. A signal ends the demo at once, and the simulated devices with it. The exit status is 0 only if nothing was lost or repeated. A time above its budget at the 99th
/// percentile is reported; it fails the demo only with --check-times, since other programs on this machine can cause delays.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The links to run [default: all]
    #[arg(value_parser = link_parser())]
    links: Vec<&'static Link>,
    /// End each link after this time [default: each link's own short run]
    #[arg(long = "for", value_name = "TIME", value_parser = time(Duration::from_millis(100)..=MOST))]
    duration: Option<Duration>,
    /// Inject the faults that the link's transport can have
    #[arg(long)]
    faults: bool,
    /// Fail when a 99th percentile is above its budget: for an otherwise idle machine
    #[arg(long)]
    check_times: bool,
    /// Corrupt the record of the run to prove that the check fails (one LINK only)
    #[arg(long, value_name = "HOW")]
    must_fail: Option<MustFail>,
    /// The seed of the injected faults; the same seed gives the same faults
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print one JSON object per link instead of a table
    #[arg(long)]
    json: bool,
    /// Write the result of the demo (one LINK only) as an SVG file: the drawing, the cut, the commanded motion, or the timeline of the
    /// cell; for fanuc, plots, program and recording in a folder
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// The SVG file to draw, its outlines on an A3 sheet [default: a built-in picture] (kawasaki only)
    #[arg(long, value_name = "FILE")]
    drawing: Option<PathBuf>,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    set: SetArgs,
}

/// The longest demo.
const MOST: Duration = Duration::from_secs(1_000_000);

/// Returns true when all checks of every link passed.
pub fn run(args: &Args) -> Result<bool> {
    let links = if args.links.is_empty() { LINKS.iter().collect() } else { args.links.clone() };
    if links.len() != 1 {
        anyhow::ensure!(args.out.is_none(), "--out needs one LINK: each writes a different kind of result");
        anyhow::ensure!(args.must_fail.is_none(), "--must-fail needs one LINK: each fails in its own ways");
        anyhow::ensure!(
            args.set.is_empty(),
            "--set and --settings need one LINK: settings differ between links"
        );
    }
    anyhow::ensure!(
        args.drawing.is_none() || links.iter().all(|link| link.short == "kawasaki"),
        "--drawing is for kawasaki alone: cellwire demo kawasaki --drawing FILE"
    );
    if let Some(folder) = args.out.as_deref().and_then(Path::parent).filter(|path| *path != Path::new("")) {
        // Checked before the run: afterwards its result would be lost.
        anyhow::ensure!(folder.is_dir(), "cannot write --out: there is no folder {}", folder.display());
    }
    let known = links.first().map_or_else(Vec::new, |link| demo::settings(link.short));
    let settings = args.set.read(&known)?;
    interrupt::handle()?;
    let (mut all, mut out) = (true, std::io::stdout());
    for link in links {
        let progress = progress_line(link.short, args.json);
        let at = progress.clone();
        interrupt::before_exit(move || {
            if !at.is_finished() {
                let (done, of) = (at.position(), at.length().unwrap_or_default());
                at.finish_and_clear();
                remark(&format!(
                    "{}: interrupted at {done} of {of}; its devices were simulated, and have ended",
                    link.short
                ));
            }
        });
        let options = DemoOptions {
            seconds: args.duration,
            faults: args.faults,
            seed: args.seed,
            out: args.out.clone(),
            must_fail: args.must_fail,
            drawing: args.drawing.clone(),
            trace: args.trace.clone(),
            settings: settings.clone(),
            lines: Lines::HERE,
            progress: progress.clone(),
        };
        let report = demo::run(link.short, &options).map_err(|error| args.set.located(error))?;
        progress.finish_and_clear();
        let check_times = args.check_times || args.must_fail == Some(MustFail::Late);
        all &= report.is_good() && (report.is_in_time() || !check_times);
        if args.json {
            writeln!(out, "{}", report.to_json())?;
        } else {
            writeln!(out, "{report}")?;
        }
    }
    Ok(all)
}

fn progress_line(name: &'static str, quiet: bool) -> ProgressBar {
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {msg} [{elapsed}]");
    let bar = ProgressBar::with_draw_target(Some(0), target).with_prefix(name);
    let bar = match style {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    };
    // The time goes on where a link has nothing to count, or is still being opened.
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
