//! `cellwire run mma`: the central controller of an MM&A cell.

use std::path::PathBuf;

use anyhow::Result;
use indicatif::ProgressBar;
use mmacell_task::Step;
use serde_json::json;

use super::work::{self, RunInput, WorkArgs, ended, say_resumed};
use crate::command::settings::connect_settings;
use crate::run::Console;
use crate::run::mma::{
    Addresses, FinalState, Journal, Line, Part, Periphery, RunEnd, Runner, Settings, SimulatedPeriphery,
};
use cellwire_io::bell::Bell;
use cellwire_io::input;
use cellwire_io::output::{announce, log};
use cellwire_io::tls::TlsArgs;
use cellwire_links::settings;

/// The devices were not seen at rest.
const MAY_MOVE: &str = "a device may still finish its last motion";

/// Runs the pick-and-place task of an MM&A micro-manipulation cell, each part once
///
/// TASK.toml has the settings of this command; simulated cameras report its parts:
///
///   [task]
///   robot_home = [0.0, 0.0, 100.0, 0.0]     # mm, mm, mm, rad
///   [[part]]
///   platform = [0.05, -0.02]                # rad
///   pick = [-120.0, 40.0, 10.0, 0.0]
///   place = [120.0, 40.0, 12.0, 1.57]
///
/// A journal beside the task has the outcome of each part: after any interruption
/// the same command goes on. If the outcome of a part is unknown, or a device
/// fails, it asks: check the cell, and type `done` (the part is in its place),
/// `repeat` or `stop`. Without a keyboard it stops, and --unknown answers in the
/// next run.
///
/// Ctrl-C, SIGTERM and a closed terminal are `stop`, and `abort` if the robot has
/// not gone to the part yet, or does not place it within 30 s; the devices then
/// get 5 s. A second signal ends the command at once: a device then finishes its
/// last motion. The end of standard input is not a stop.
///
/// Cameras, valves and vacuum switch are simulated, or connected over TCP with
/// lines of text. The controller writes `acquire 1`, `acquire 2`, `vacuum on`,
/// `vacuum off`, `blow on` or `blow off`. The periphery answers a picture with
/// `part [rad,rad] [mm,mm,mm,rad]` (camera 1), `slot [mm,mm,mm,rad]` (camera 2) or
/// `none`, a valve with `ok`, and either with `error TEXT` on failure. It writes
/// `switch high` and `switch low` whenever the vacuum switch changes.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment, after_help = AFTER, override_usage = USAGE)]
pub(super) struct Args {
    /// The task: a TOML file with the parts and the settings of this command
    #[arg(value_name = "TASK.toml")]
    file: PathBuf,
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
    tls: TlsArgs,
    #[command(flatten)]
    work: WorkArgs,
}

const USAGE: &str = "\
cellwire run mma [OPTIONS] <TASK.toml> --robot <ADDR> --platform <ADDR>
       cellwire run mma [OPTIONS] <TASK.toml> --dry-run";

const AFTER: &str = "\
Type while it runs:
  pause, continue, stop  After the current part; abort: at once
  done, repeat, stop     The answer when a part may or may not be placed

Exit status: 0 all placed   1 stopped   2 not begun   3 connection lost
  7 the journal could not be written   130 ended at once

Examples:
  cellwire run mma plate.toml --dry-run --picture plate.svg
  cellwire run mma plate.toml --robot 192.168.0.1:2001 --platform 192.168.0.2:2002
  cellwire simulate mma-robot --listen 2001      a device to try it on";

/// Returns true when every part is placed.
pub(super) fn run(args: &Args) -> Result<bool> {
    args.work.events.choose();
    let given = args.work.set.read_over(Some(&args.file), &self::settings())?;
    let settings = settings::read("the task", Settings::default(), &given)?;
    let parts = settings.count(args.periphery.is_none())?;
    let (fingerprint, lines) = (settings.fingerprint(), lines(&input::text(&args.file)?));
    let work =
        RunInput { robot: "mma", file: &args.file, what: "task", fingerprint, parts, lines, unit: "line" };
    let earlier: Option<Journal> = args.work.look(&work);
    if let Some(file) = &args.work.picture {
        settings.draw(file, &earlier.as_ref().map(Journal::outcomes).unwrap_or_default())?;
    }
    if args.work.dry_run {
        dry_run(args, &settings, parts, &work.lines)?;
        args.work.tell(&work, earlier.as_ref())?;
        return Ok(true);
    }
    let run = |journal: &mut Journal, progress: &ProgressBar| execute(args, &settings, journal, progress);
    let ran = args.work.run(work, run)?;
    let is_complete = ran.ended == RunEnd::Complete;
    let machine = match ran.ended {
        RunEnd::Complete | RunEnd::Stopped(FinalState::AtRest) => "at rest",
        RunEnd::Stopped(FinalState::MayMove) => MAY_MOVE,
        RunEnd::Stopped(FinalState::NotAsked) => "the devices were not asked",
    };
    let line = ended(&ran.journal, if is_complete { "complete" } else { "stopped" }, machine);
    ran.say(&line)?;
    Ok(is_complete)
}

/// The steps of a part, in sequence.
const STEPS: [Step; 10] = [
    Step::GoCamera1,
    Step::FindPart,
    Step::TurnPlatform,
    Step::GoCamera2,
    Step::FindSlot,
    Step::GoPick,
    Step::VacuumOn,
    Step::GoPlace,
    Step::Release,
    Step::Placed,
];

/// Prints the settings of all motions, then each part with its line. Real cameras alone know where parts are.
fn dry_run(args: &Args, settings: &Settings, parts: usize, lines: &[u64]) -> Result<()> {
    let task = &settings.task;
    log(&json!({
        "task": args.file,
        "parts": parts,
        "override_percent": task.percent,
        "robot_home": task.robot_home,
        "platform_home": task.platform_home,
        "camera_1": task.camera_1,
        "camera_2": task.camera_2,
        "attempts": task.attempts,
        "periphery": args.periphery.as_deref().unwrap_or("simulated"),
        "steps": STEPS,
    }))?;
    if args.periphery.is_some() {
        return Ok(());
    }
    let lines = lines.iter().map(Some).chain(core::iter::repeat(None));
    for ((number, part), line) in (1..).zip(&settings.part).zip(lines).take(parts) {
        let Part { platform, pick, place } = part;
        log(&json!({"part": number, "line": line, "platform": platform, "pick": pick, "place": place}))?;
    }
    Ok(())
}

fn execute(
    args: &Args,
    settings: &Settings,
    journal: &mut Journal,
    progress: &ProgressBar,
) -> Result<RunEnd> {
    let bell = Bell::default();
    let typed = work::operator(bell.clone())?;
    say_resumed(journal)?;
    let (notify, progress) =
        (&mut |event| log(&event), &mut args.work.shown(progress, journal, |_| MAY_MOVE.into()));
    let console = Console::new(typed, notify, progress);
    let mut runner = Runner::new(journal, console, bell.clone());
    if !runner.settle_begun(args.work.unknown)? {
        return Ok(RunEnd::Stopped(FinalState::NotAsked));
    }
    let dialing = args.work.set.dialing(Some(&args.file), args.work.connect)?;
    let address = |given: &Option<String>| given.clone().unwrap_or_default();
    let (robot, platform, tls) = (address(&args.robot), address(&args.platform), args.tls.client()?);
    let addresses = Addresses { robot, platform, dialing, tls };
    let mut periphery: Box<dyn Periphery> = match &args.periphery {
        Some(address) => Box::new(Line::open(address, dialing, addresses.tls.as_ref(), bell)?),
        None => Box::new(SimulatedPeriphery::new(settings.part.clone(), settings.vacuum)),
    };
    announce(&json!({"ready": "mma", "robot": addresses.robot, "platform": addresses.platform}))?;
    runner.run(settings, &addresses, &mut *periphery)
}

/// Returns the lines of a task that begin its parts.
fn lines(task: &str) -> Vec<u64> {
    let begins = |(_, line): &(u64, &str)| line.split('#').next().is_some_and(|it| it.trim() == "[[part]]");
    (1..).zip(task.lines()).filter(begins).map(|(number, _)| number).collect()
}

/// Returns the settings.
pub(super) fn settings() -> Vec<settings::Setting> {
    [settings::list(Settings::default()), connect_settings()].concat()
}
