//! `cellwire kawasaki`: the PC's end of a Kawasaki robot.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Result, ensure};
use clap::Subcommand;
use indicatif::ProgressBar;
use serde_json::json;

use super::settings::{SetArgs, connect_settings};
use super::work::{self, Work, WorkArgs, say_resumed};
use crate::cell::run::Operator;
use crate::cell::run::kawasaki::{Ended, Jobs, Journal, Runner, Settings};
use crate::io::bell::Bell;
use crate::io::input::seconds;
use crate::io::journal::{Outcome, Tally};
use crate::io::output::{log, ready};
use crate::io::trace::TraceArgs;
use crate::links::device::Endpoint;
use crate::links::kawasaki_msg::meeting::Meeting;
use cellwire_links::settings;

/// Runs orders on a Kawasaki robot: drawings, and jobs of any kind.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cellwire kawasaki draw logo.svg --dry-run --draw plan.svg        what would be drawn
  cellwire kawasaki draw logo.svg --listen 192.168.0.2:9105
  cellwire kawasaki run pallet.csv --settings plant.toml --listen 192.168.0.2:9105
  cellwire simulate kawasaki-robot --connect 127.0.0.1:9105        a robot to try it on";

#[derive(Debug, Subcommand)]
enum Command {
    Draw(DrawArgs),
    Run(TableArgs),
}

const DRAW: &str = concat!(
    "\
Draws the outlines of an SVG file with a robot, each line once.

The picture is scaled to the setting `board`; its origin is the upper left corner of the board, with
Y pointing down.

",
    include_str!("kawasaki.txt")
);

const TABLE: &str = concat!(
    "\
Runs the jobs of a table on a robot, each once.

The first line of JOBS.csv names fields of a job, in any order; each other line is a job. The fields
are configured for the plant: the tables [[job]] of its settings, in wire order.

  [[job]]
  name = \"j1\"
  kind = \"decimal\"         # or \"whole\", or \"text\" with length = [LEAST, MOST]
  places = 3
  range = [-180.0, 180.0]
  default = 0.0            # for a missing column or an empty cell

Without them a job is a line of a drawing: kind (1 draws, 2 moves), x1, y1, x2, y2 in hundredths of
a millimetre. Every invalid line is reported before anything is sent.

",
    include_str!("kawasaki.txt")
);

/// Draws the outlines of an SVG file with a robot, each line once.
#[derive(Debug, clap::Args)]
#[command(long_about = DRAW)]
struct DrawArgs {
    /// The picture
    #[arg(value_name = "FILE.svg")]
    file: PathBuf,
    /// Skip elements that a pen cannot draw, such as text or masks; each is reported
    #[arg(long, display_order = 0)]
    allow: bool,
    #[command(flatten)]
    run: RunArgs,
}

/// Runs the jobs of a table on a robot, each once.
#[derive(Debug, clap::Args)]
#[command(long_about = TABLE)]
struct TableArgs {
    /// The table
    #[arg(value_name = "JOBS.csv")]
    file: PathBuf,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Debug, clap::Args)]
struct RunArgs {
    /// Listen on this address, where the robot connects; a port alone means 127.0.0.1
    #[arg(long, value_name = "ADDR", conflicts_with = "connect_to", display_order = 1)]
    listen: Option<String>,
    /// Connect to this address, where a robot listens
    #[arg(long = "connect", value_name = "ADDR", display_order = 2)]
    connect_to: Option<String>,
    /// End after this many seconds without a robot; 0: never
    #[arg(long, value_name = "N", default_value = "60", value_parser = seconds(0.0..=1e6))]
    robot_timeout: Duration,
    #[command(flatten)]
    trace: TraceArgs,
    #[command(flatten)]
    work: WorkArgs,
}

/// Returns true when every job is done.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Command::Draw(DrawArgs { file, allow, run }) => {
            execute(file, run, |settings| Jobs::from_picture(file, &settings.plant, settings.sheet(), *allow))
        }
        Command::Run(TableArgs { file, run }) => {
            execute(file, run, |settings| Jobs::from_table(file, &settings.plant))
        }
    }
    .map_err(|error| args.command.set().located(error))
}

impl Command {
    fn set(&self) -> &SetArgs {
        match self {
            Self::Draw(args) => &args.run.work.set,
            Self::Run(args) => &args.run.work.set,
        }
    }
}

fn execute(file: &Path, args: &RunArgs, read: impl FnOnce(&Settings) -> Result<Jobs>) -> Result<bool> {
    let is_somewhere = args.work.dry_run || args.listen.is_some() || args.connect_to.is_some();
    ensure!(
        is_somewhere,
        "give --listen ADDR if the robot connects, --connect ADDR if it listens, or --dry-run"
    );
    let settings = settings::read("kawasaki", Settings::default(), &args.work.set.read(&self::settings())?)?;
    let config = settings.plant.pc(settings.config)?;
    let jobs = read(&settings)?;
    if let Some(file) = &args.work.draw {
        jobs.draw(file, settings.sheet())?;
    }
    if args.work.dry_run {
        if file.extension().is_some_and(|it| it.eq_ignore_ascii_case("csv")) {
            writeln!(std::io::stdout().lock(), "{}", jobs.table())?;
        }
        log(&jobs.summary(config.limits.packet))?;
        return Ok(true);
    }
    let (fingerprint, parts) = (jobs.fingerprint(), jobs.work.len());
    let work = Work { file, what: "file of jobs", fingerprint, parts };
    let run = |journal: &mut Journal, progress: &ProgressBar| {
        serve(args, &settings, config, &jobs, journal, progress)
    };
    let ran = args.work.run(work, run, |journal| outcomes(&jobs, journal))?;
    let count = |outcome| ran.journal.count(outcome);
    let active = if let Ended::Refused { active } = ran.ended { Some(active) } else { None };
    let line = json!({
        "event": "ended", "why": match ran.ended {
            Ended::Complete => "complete",
            Ended::Stopped => "stopped",
            Ended::Refused { .. } => "refused",
        },
        "done": count(Outcome::Done), "unknown": count(Outcome::Unknown), "not_sent": count(Outcome::NotSent),
        "machine": machine(&ran.journal.tally()), "active_order": active, "journal": ran.journal.path(),
    });
    Ok(ran.say(&line)? == Ended::Complete)
}

fn serve(
    args: &RunArgs,
    settings: &Settings,
    config: kawasaki_msg::PcConfig<'static>,
    jobs: &Jobs,
    journal: &mut Journal,
    progress: &ProgressBar,
) -> Result<Ended> {
    let typed = work::operator(Bell::default())?;
    let endpoint = match (&args.listen, &args.connect_to) {
        (Some(address), _) => Endpoint::Listen(address.clone()),
        (None, address) => Endpoint::Connect(address.clone().unwrap_or_default()),
    };
    let dialing = args.work.set.dialing(None, args.work.connect)?;
    let (mut meeting, kind, place) = Meeting::of_pc(&endpoint, config.datagrams, config.dialect, dialing)?;
    ready("kawasaki", kind, &place)?;
    say_resumed(journal)?;
    let trace = args.trace.start("kawasaki-pc");
    let (notify, progress) = (&mut |event| log(&event), &mut work::shown(progress, journal, machine));
    let operator = Operator::new(typed, notify, progress);
    let absence = (!args.robot_timeout.is_zero()).then_some(args.robot_timeout);
    let runner = Runner::new(jobs, config, journal, settings.order, absence, operator);
    runner.run(&mut meeting, &trace)
}

/// The jobs that the robot still draws.
fn machine(tally: &Tally) -> String {
    match tally.queued {
        0 => "the robot has no jobs of this file queued".into(),
        queued => format!("the robot may still execute up to {queued} queued jobs"),
    }
}

/// `number,line,outcome` of every job.
fn outcomes(jobs: &Jobs, journal: &Journal) -> String {
    let mut text = String::from("number,line,outcome\n");
    for (number, (line, outcome)) in (1..).zip(jobs.lines.iter().zip(&*journal.outcomes())) {
        let outcome = outcome.name();
        text.push_str(&format!("{number},{line},{outcome}\n"));
    }
    text
}

/// What can be set.
pub fn settings() -> Vec<settings::Setting> {
    [settings::list(Settings::default()), connect_settings()].concat()
}
