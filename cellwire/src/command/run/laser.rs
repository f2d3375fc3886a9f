//! `cellwire run laser`: the PC's end of a laser robot.

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::ValueEnum;
use indicatif::ProgressBar;
use serde_json::json;

use super::work::{self, RunInput, WorkArgs, ended, say_resumed};
use crate::command::settings::connect_settings;
use crate::io::journal::{Outcome, Tally};
use crate::run::Console;
use crate::run::laser::{Coordinate, Journal, Program, RunEnd, Runner, Settings};
use cellwire_io::bell::Bell;
use cellwire_io::output::{log, ready, remark};
use cellwire_io::port::AnyPort;
use cellwire_links::settings;

/// Runs a program on a laser robot (EB 90 frames), each instruction once
///
/// G-code: G0 to G3, G4 P0, G17, G20, G21, G90, G91, M2 to M5, M30, with X Y Z A B C I J R F S. G1 to G3 cut from M3 or M4
/// to M5 while S is not 0; otherwise they move with the laser off, as G0 does. F and S that the plant's words do not carry
/// (setting program.values) are refused without --allow not-carried.
///
/// SVG: strokes are cut in their true size. X and Y are 0 at the lower left corner of the page; Y points up. The width and
/// the height of the <svg> need a unit (mm, cm, in, pt, pc). Curves and arcs become chords (setting program.tolerance). What
/// cannot be cut, or is not understood, is refused by name. docs/files.md lists it.
///
/// A journal beside the program has the outcome of each instruction: after any interruption the same command goes on. If
/// nobody knows whether a frame was queued, it asks: check the machine, and type `done`, `repeat` or `stop`. Without a
/// keyboard it stops, and --unknown answers in the next run.
///
/// Ctrl-C, SIGTERM and a closed terminal stop after the frame in flight, which takes 30 s at most; a second signal ends the
/// command at once, and leaves up to seven instructions unknown. The end of standard input is not a stop.
///
/// "Done" means queued: after a stop the controller executes its queue, and one that loses its power has not executed all of it.
#[derive(Debug, clap::Args)]
#[command(after_help = AFTER, override_usage = USAGE)]
pub(super) struct Args {
    /// G-code, .svg with lines and curves, or .csv with a word and its floats per line
    file: PathBuf,
    /// /dev/ttyS0, COM1, or HOST:PORT of a serial device server
    #[arg(long, value_name = "PORT", required_unless_present = "dry_run")]
    serial: Option<String>,
    /// Run it although a part has no effect, which is reported
    #[arg(long, value_enum, value_name = "WHAT")]
    allow: Vec<Allow>,
    #[command(flatten)]
    work: WorkArgs,
}

const USAGE: &str = "\
cellwire run laser [OPTIONS] <FILE> --serial <PORT>
       cellwire run laser [OPTIONS] <FILE> --dry-run";

const AFTER: &str = "\
Type while it runs:
  pause, continue, stop  After the frame in flight
  done, repeat, stop     The answer when a frame may or may not be executed

Exit status: 0 all done   1 stopped or refused   2 not begun   3 connection lost
  7 the journal could not be written   130 ended at once

Examples:
  cellwire run laser part.nc --dry-run --picture part.svg
  cellwire run laser part.nc --serial /dev/ttyS0 --settings laser.toml
  cellwire simulate laser --pty laser.port      a robot to try it on";

/// The effects of a program that a run may lack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Allow {
    /// Parts of a drawing that cannot be cut are left out, and without a size in mm it has 96 pixels per inch
    Drawing,
    /// F and S of G-code that the plant's words do not carry
    NotCarried,
}

/// Returns true when every instruction is done.
pub(super) fn run(args: &Args) -> Result<bool> {
    args.work.events.choose();
    let given = args.work.set.read(&self::settings())?;
    // Some defaults follow from the rate.
    let baud = settings::read("laser", Settings::at_baud(laser_eb90::timing::BAUD), &given)?.host.baud;
    let Settings { host, mapping } = settings::read("laser", Settings::at_baud(baud), &given)?;
    let program = Program::read(&args.file, &mapping, &host, args.allow.contains(&Allow::Drawing))?;
    for warning in &program.warnings {
        remark(&format!("warning: {} {warning}", args.file.display()));
    }
    let not_carried: Vec<Coordinate> = program.not_carried.iter().map(|(value, _)| *value).collect();
    if let Some((value, line)) = program.not_carried.first() {
        let values: Vec<_> = mapping.values.iter().chain(&not_carried).collect();
        ensure!(
            args.allow.contains(&Allow::NotCarried),
            "{}: line {line}: the robot does not get {value:?}; send it with --set 'program.values={}' if its command words have a float for it, or run without it with --allow not-carried",
            args.file.display(),
            json!(values)
        );
    }
    let (fingerprint, parts) = (program.fingerprint(), program.instructions.len());
    let lines = program.instructions.iter().map(|instruction| instruction.line).collect();
    let (file, unit) = (&args.file, program.unit);
    let work = RunInput { robot: "laser", file, what: "program", fingerprint, parts, lines, unit };
    let earlier: Option<Journal> = args.work.look(&work);
    if let Some(file) = &args.work.picture {
        let outcomes = earlier.as_ref().map(Journal::outcomes).unwrap_or_default();
        program.draw(file, &mapping, &outcomes)?;
    }
    if args.work.dry_run {
        let (frames, time) = program.estimate(&host);
        log(&json!({
            "program": args.file, "instructions": program.instructions.len(), "frames": frames,
            "seconds_on_the_line": (time.as_secs_f64() * 10.0).round() / 10.0, "mm": program.bounds(&mapping),
            "not_carried": not_carried,
        }))?;
        args.work.tell(&work, earlier.as_ref())?;
        return Ok(true);
    }
    if !not_carried.is_empty() {
        log(&json!({"event": "not_carried", "values": not_carried}))?;
    }
    let run =
        |journal: &mut Journal, progress: &ProgressBar| execute(args, &program, journal, progress, host);
    let ran = args.work.run(work, run)?;
    let why = match ran.ended.0 {
        RunEnd::Complete => "complete",
        RunEnd::Stopped => "stopped",
        RunEnd::Refused => "refused",
    };
    let line = ended(&ran.journal, why, &machine(ran.ended.1, &ran.journal.tally()));
    Ok(ran.say(&line)?.0 == RunEnd::Complete)
}

/// Runs the program; returns how the run has ended, and the number of instructions that were done before it.
fn execute(
    args: &Args,
    program: &Program,
    journal: &mut Journal,
    progress: &ProgressBar,
    host: laser_eb90::HostConfig,
) -> Result<(RunEnd, usize)> {
    let typed = work::operator(Bell::default())?;
    say_resumed(journal)?;
    let before = journal.count(Outcome::Done);
    let (notify, progress) =
        (&mut |event| log(&event), &mut args.work.shown(progress, journal, |tally| machine(before, tally)));
    let console = Console::new(typed, notify, progress);
    // A question is asked when its answer can be used.
    let place = args.serial.as_deref().unwrap_or_default();
    let port = AnyPort::open(place, host.baud, args.work.set.dialing(None, args.work.connect)?)?;
    ready("laser", "serial", place)?;
    let mut runner = Runner::new(program, journal, host, console);
    if !runner.settle_earlier(args.work.unknown)? {
        return Ok((RunEnd::Stopped, before));
    }
    Ok((runner.run(port)?, before))
}

/// Returns the parts that the controller may still execute: done parts are queued, unknown ones may be, and no message
/// reports their execution.
fn machine(before: usize, tally: &Tally) -> String {
    match tally.done.saturating_sub(before) + tally.unknown {
        0 => "nothing was queued".into(),
        queued => {
            let earlier = if before > 0 { ", and those of earlier runs" } else { "" };
            format!("the controller may still execute up to {queued} queued instructions{earlier}")
        }
    }
}

/// Returns the settings of a run.
pub(super) fn settings() -> Vec<settings::Setting> {
    [settings::list(Settings::at_baud(laser_eb90::timing::BAUD)), connect_settings()].concat()
}
