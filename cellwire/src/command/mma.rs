//! `cellwire mma`: the central controller of an MM&A cell.

use std::path::PathBuf;

use anyhow::Result;
use clap::Subcommand;
use indicatif::ProgressBar;
use serde_json::json;

use super::settings::connect_settings;
use super::work::{self, Work, WorkArgs, say_resumed};
use crate::cell::run::Operator;
use crate::cell::run::mma::{Addresses, Ended, Journal, Line, Periphery, Runner, Settings, Simulated};
use crate::io::bell::Bell;
use crate::io::journal::Outcome;
use crate::io::output::log;
use cellwire_links::settings;

/// Runs the pick-and-place task of an MM&A micro-manipulation cell.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cellwire mma run --task plate.toml --dry-run --draw plate.svg
  cellwire mma run --task plate.toml --robot 192.168.0.1:2001 --platform 192.168.0.2:2002 --periphery 192.168.0.4:7000
  cellwire simulate mma-robot --listen 127.0.0.1:2001      a device to try it on";

/// The devices were not seen at rest.
const MAY_MOVE: &str = "a device may still finish its last motion";

#[derive(Debug, Subcommand)]
enum Command {
    Run(RunArgs),
}

/// Picks each part of a task from the platform and places it, each once.
///
/// TASK.toml has the settings below; simulated cameras report its parts:
///
///   [task]
///   robot_home = [0.0, 0.0, 100.0, 0.0]     # mm, mm, mm, rad
///   [[part]]
///   platform = [0.05, -0.02]                # rad
///   pick = [-120.0, 40.0, 10.0, 0.0]
///   place = [120.0, 40.0, 12.0, 1.57]
///
/// Prints one line of JSON for each step and each part. A journal beside the task records the
/// outcome of every part; after any interruption the same command resumes. If the outcome of a part
/// is unknown, or a device fails, it asks: check the cell and type `done` (the part is in its
/// place), `repeat` or `stop`. `pause`, `continue` and `stop` can be typed at any time and take
/// effect after the current part; `abort` stops everything immediately.
///
/// Ctrl-C, SIGTERM and a closed terminal are `stop`, and `abort` if the robot has not gone to the
/// part yet, or does not place it within 30 s; the devices then get 5 s. A second signal ends the
/// command at once: a device then finishes its last motion. The end of standard input is not a stop.
///
/// Cameras, valves and vacuum switch are simulated, or connected over TCP with lines of text. The
/// controller writes `acquire 1`, `acquire 2`, `vacuum on`, `vacuum off`, `blow on` or `blow off`.
/// The periphery answers a picture with `part [rad,rad] [mm,mm,mm,rad]` (camera 1),
/// `slot [mm,mm,mm,rad]` (camera 2) or `none`, a valve with `ok`, and either with `error TEXT`
/// on failure. It writes `switch high` and `switch low` whenever the vacuum switch changes.
///
/// Exit status: 0 every part is placed; 1 stopped; 2 not started; 3 a connection was lost; 7 the
/// journal could not be written; 130 ended at once.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
struct RunArgs {
    /// The task
    #[arg(long, value_name = "FILE")]
    task: PathBuf,
    /// The robot's controller: HOST:PORT, where the port is usually 2001
    #[arg(long, value_name = "ADDR", required_unless_present = "dry_run")]
    robot: Option<String>,
    /// The platform's controller: HOST:PORT, where the port is usually 2002
    #[arg(long, value_name = "ADDR", required_unless_present = "dry_run")]
    platform: Option<String>,
    /// Cameras, valves and vacuum switch: HOST:PORT [default: simulated]
    #[arg(long, value_name = "ADDR")]
    periphery: Option<String>,
    #[command(flatten)]
    work: WorkArgs,
}

/// Returns true when every part is placed.
pub fn run(args: &Args) -> Result<bool> {
    let Command::Run(args) = &args.command;
    let given = args.work.set.read_over(Some(&args.task), &self::settings())?;
    let settings = settings::read("the task", Settings::default(), &given)?;
    let parts = settings.count(args.periphery.is_none())?;
    if let Some(file) = &args.work.draw {
        settings.draw(file)?;
    }
    if args.work.dry_run {
        log(&json!({"task": args.task, "parts": parts}))?;
        return Ok(true);
    }
    let work = Work { file: &args.task, what: "task", fingerprint: settings.fingerprint(), parts };
    let run = |journal: &mut Journal, progress: &ProgressBar| execute(args, &settings, journal, progress);
    let ran = args.work.run(work, run, states)?;
    let (journal, is_complete) = (&ran.journal, ran.ended == Ended::Complete);
    let machine = if ran.ended == (Ended::Stopped { at_rest: false }) { MAY_MOVE } else { "at rest" };
    let line = json!({
        "event": "ended", "why": if is_complete { "complete" } else { "stopped" },
        "placed": journal.count(Outcome::Done), "begun": journal.count(Outcome::Unknown),
        "waiting": journal.count(Outcome::NotSent), "machine": machine, "journal": journal.path(),
    });
    ran.say(&line)?;
    Ok(is_complete)
}

fn execute(
    args: &RunArgs,
    settings: &Settings,
    journal: &mut Journal,
    progress: &ProgressBar,
) -> Result<Ended> {
    let bell = Bell::default();
    let typed = work::operator(bell.clone())?;
    say_resumed(journal)?;
    let (notify, progress) =
        (&mut |event| log(&event), &mut work::shown(progress, journal, |_| MAY_MOVE.into()));
    let operator = Operator::new(typed, notify, progress);
    let mut runner = Runner::new(journal, operator, bell.clone());
    if !runner.settle_begun()? {
        return Ok(Ended::Stopped { at_rest: true });
    }
    let dialing = args.work.set.dialing(Some(&args.task), args.work.connect)?;
    let address = |given: &Option<String>| given.clone().unwrap_or_default();
    let addresses = Addresses { robot: address(&args.robot), platform: address(&args.platform), dialing };
    let mut periphery: Box<dyn Periphery> = match &args.periphery {
        Some(address) => Box::new(Line::open(address, dialing, bell)?),
        None => Box::new(Simulated::new(settings.part.clone(), settings.vacuum)),
    };
    runner.run(settings, &addresses, &mut *periphery)
}

/// `part,state` of every part.
fn states(journal: &Journal) -> String {
    let mut text = String::from("part,state\n");
    for (number, state) in (1..).zip(journal.record()) {
        let state = match state {
            Outcome::NotSent => "waiting",
            Outcome::Done => "placed",
            other => other.name(),
        };
        text.push_str(&format!("{number},{state}\n"));
    }
    text
}

/// What can be set.
pub fn settings() -> Vec<settings::Setting> {
    [settings::list(Settings::default()), connect_settings()].concat()
}
