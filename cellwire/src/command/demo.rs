//! `cellwire demo`: each link end to end, over real sockets and pseudo-terminals.

use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context as _, Result};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde_json::{Map, Value};

use super::settings::SetArgs;
use crate::demo::table::{self, DemoResult, Layout};
use crate::demo::{self, DemoOptions, MustFail};
use crate::devices::link_parser;
use crate::io::line::Lines;
use cellwire_io::input::time;
use cellwire_io::interrupt::{self, Policy};
use cellwire_io::output::{counted, quoted, remark, stdout, terminal_columns};
use cellwire_io::trace::TraceArgs;
use cellwire_links::LINKS;
use cellwire_links::link::Link;

/// Runs every link against its simulated robot
///
/// A real client session and a simulated controller, over loopback TCP and pseudo-terminals. Prints a row for each link. A
/// signal ends the demo at once, and the simulated devices with it. The exit status is 0 only if nothing was lost or
/// repeated. A deadline that is missed at the 99th percentile is LATE; it fails the demo only with --check-times, since
/// other programs on this machine can cause delays.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The links to run [default: all]
    #[arg(value_parser = link_parser())]
    links: Vec<&'static Link>,
    /// End each link after this time [default: each link's own short run]
    #[arg(long = "for", value_name = "TIME", value_parser = time(Duration::from_millis(100)..=MAX_DURATION))]
    duration: Option<Duration>,
    /// Inject the faults that the link's transport can have
    #[arg(long)]
    faults: bool,
    /// Fail when a 99th percentile is above its budget: for an otherwise idle machine
    #[arg(long)]
    check_times: bool,
    /// Corrupt the record of the run to prove that the check fails, also with --faults (one LINK only)
    #[arg(long, value_name = "HOW")]
    must_fail: Option<MustFail>,
    /// The seed of the injected faults; the same seed gives the same faults
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print one JSON object per link
    #[arg(long, conflicts_with = "verbose")]
    json: bool,
    /// Print every figure of each link
    #[arg(long)]
    verbose: bool,
    /// Write pictures of what moved into this folder: LINK.svg; for fanuc, a folder with plots, program and recording
    #[arg(long, value_name = "FOLDER")]
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
const MAX_DURATION: Duration = Duration::from_secs(600);

/// Returns true when all checks of every link passed.
pub fn run(args: &Args) -> Result<bool> {
    let links = if args.links.is_empty() { LINKS.iter().collect() } else { args.links.clone() };
    if links.len() != 1 {
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
    if let Some(folder) = &args.out {
        // Before the run: afterwards its result would be lost.
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make --out {}", folder.display()))?;
    }
    let known = links.first().map_or_else(Vec::new, |link| demo::settings(link.short));
    let settings = args.set.read(&known)?;
    interrupt::on_interrupt(Policy::End)?;
    let (mut all, mut out): (Vec<DemoResult>, _) = (Vec::new(), stdout());
    let layout = Layout::new(terminal_columns());
    let mut rest = links.as_slice();
    while let Some((link, others)) = rest.split_first() {
        // One run of the cell shows its three links.
        let is_cell = rest.iter().take(3).map(|link| link.short).eq(["alter", "viewer", "ball"]);
        let options = options(args, link.short, settings.clone());
        let reports = if is_cell {
            rest = rest.get(3..).unwrap_or_default();
            demo::teleop::all(&options).map(Vec::from)
        } else {
            rest = others;
            demo::run(link.short, &options).map(|report| vec![report])
        };
        let reports = reports?;
        options.progress.finish_and_clear();
        for report in reports {
            let check_times = args.check_times || args.must_fail == Some(MustFail::Late);
            let picture = options.out.clone().filter(|_| report.summary().0 == link.short);
            let judged = DemoResult { report, check_times, picture };
            if all.is_empty() && !args.json {
                let links = counted(links.len(), "robot link");
                write!(out, "{links}, simulated. Nothing real moves.\n\n{}", layout.head())?;
            }
            tell(args, layout, &judged, &mut out)?;
            all.push(judged);
        }
    }
    if !args.json {
        end(args, layout, &all, &mut out)?;
    }
    Ok(all.iter().all(DemoResult::is_good))
}

/// Returns the options of a link's demo. Its progress line is cleared when a signal ends the demo.
fn options(args: &Args, link: &'static str, settings: Map<String, Value>) -> DemoOptions {
    let progress = progress_line(link, args.json);
    let at = progress.clone();
    interrupt::before_exit(move || {
        if !at.is_finished() {
            let (done, of) = (at.position(), at.length().map_or_else(String::new, |of| format!(" of {of}")));
            at.finish_and_clear();
            remark(&format!("{link}: interrupted at {done}{of}; its devices were simulated, and have ended"));
        }
    });
    let name = if link == "fanuc" { link.into() } else { format!("{link}.svg") };
    DemoOptions {
        seconds: args.duration,
        faults: args.faults,
        seed: args.seed,
        out: args.out.as_ref().map(|folder| folder.join(name)),
        must_fail: args.must_fail,
        drawing: args.drawing.clone(),
        trace: args.trace.clone(),
        settings,
        lines: Lines::HERE,
        progress,
    }
}

/// Prints the result of a link.
fn tell(args: &Args, layout: Layout, judged: &DemoResult, out: &mut impl Write) -> Result<()> {
    if args.json {
        return Ok(writeln!(out, "{}", judged.to_json())?);
    }
    write!(out, "{}", judged.row(layout, &again(args, judged.report.summary().0)))?;
    if args.verbose {
        writeln!(out, "\n{}", judged.report.figures())?;
    }
    Ok(())
}

/// Returns the command that repeats the run of the link, and prints every figure.
fn again(args: &Args, link: &str) -> String {
    let mut words = vec!["cellwire".into(), "demo".into(), link.into()];
    let path = |path: &PathBuf| path.display().to_string();
    if args.faults {
        words.push("--faults".into());
    }
    words.extend(["--seed".into(), args.seed.to_string()]);
    for (option, value) in [
        ("--for", args.duration.map(|time| humantime::format_duration(time).to_string().replace(' ', ""))),
        ("--must-fail", args.must_fail.map(|how| how.name().into())),
        ("--drawing", args.drawing.as_ref().map(path)),
    ] {
        words.extend(value.into_iter().flat_map(|value| [option.into(), value]));
    }
    if args.check_times {
        words.push("--check-times".into());
    }
    words.extend(args.set.words());
    words.push("--verbose".into());
    let words = words.iter().map(|word: &String| quoted(word));
    words.collect::<Vec<_>>().join(" ")
}

/// Prints the common result of all rows.
fn end(args: &Args, layout: Layout, all: &[DemoResult], out: &mut impl Write) -> Result<()> {
    let pictures = table::pictures(layout, args.out.as_deref(), all);
    write!(out, "\n{}\n{}\n{pictures}", table::verdict(layout, all), layout.legend(all))?;
    match table::failed(all) {
        Some(failed) => write!(out, "\n{}", layout.wrapped(&failed, 0))?,
        None if all.len() > 1 => write!(out, "\n{}", layout.next())?,
        None => {}
    }
    Ok(out.flush()?)
}

fn progress_line(name: &'static str, quiet: bool) -> ProgressBar {
    let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
    let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}{of} {msg} [{elapsed}]");
    // Without a length nothing is done of it, and the bar is empty.
    let bar = ProgressBar::with_draw_target(None, target).with_prefix(name);
    let of = |state: &ProgressState, text: &mut dyn core::fmt::Write| {
        let _ = state.len().map(|length| write!(text, "/{length}"));
    };
    let bar = match style {
        Ok(style) => bar.with_style(style.with_key("of", of)),
        Err(_) => bar,
    };
    // The time continues while a link has nothing to count, or is still being opened.
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
