//! `cellwire laser`: the PC's end of a laser robot.

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::{Subcommand, ValueEnum};
use indicatif::ProgressBar;
use serde_json::json;

use super::settings::connect_settings;
use super::work::{self, Work, WorkArgs, say_resumed};
use crate::cell::run::Operator;
use crate::cell::run::laser::{Coordinate, Ended, Journal, Program, Runner, Settings};
use crate::io::bell::Bell;
use crate::io::journal::{Outcome, Tally};
use crate::io::output::{log, remark};
use crate::io::port::AnyPort;
use cellwire_links::settings;

/// Runs programs on a laser robot over its serial line (EB 90 frames).
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cellwire laser run part.nc --dry-run --draw plan.svg        what would be cut
  cellwire laser run part.svg --dry-run --draw plan.svg       the strokes of a drawing
  cellwire laser run part.nc --port /dev/ttyS0 --settings laser.toml     on Windows: --port COM1
  cellwire simulate laser --pty /tmp/laser                    a robot to try it on";

#[derive(Debug, Subcommand)]
enum Command {
    Run(RunArgs),
}

/// Runs a program, each instruction once: G-code, an SVG drawing, or CSV with a command word and its floats per line.
///
/// G-code: G0 to G3, G4 P0, G17, G20, G21, G90, G91, M2, M3, M4, M5, M30, with X Y Z A B C I J R F S. G1 to G3 cut after M3 or M4, until
/// M5 or while S is 0; otherwise they move with the laser off, as G0 does. F and S that the plant's words do not carry (setting
/// program.values) are refused without --allow not-carried. docs/files.md lists the words without an effect, and everything refused.
///
/// SVG: strokes are cut in their true size, in mm. X and Y are 0 at the lower left corner of the page; Y points up. The width and the
/// height of the <svg> need a unit of length (mm, cm, in, pt, pc). Curves and arcs become chords (setting program.tolerance). Clips
/// are applied. Text, images, masks, shapes without a stroke, translucent strokes, lines outside of the page, and all that the reader
/// does not understand are refused by name: docs/troubleshooting.md has the list. DXF drawings are converted first, by
/// docs/dxf-to-svg.py.
///
/// Prints one line of JSON for each frame: the instructions that the controller has queued. A journal beside the program records the
/// outcome of every instruction; after any interruption the same command resumes. If it is unknown whether
/// instructions were queued, it stops and asks: check the machine and type `done`, `repeat` or `stop`. `pause`, `continue` and
/// `stop` can be typed at any time, and take effect after the frame in flight.
///
/// Ctrl-C, SIGTERM and a closed terminal are `stop`, and wait 30 s at most for the outcome of the frame in flight; a second signal ends
/// the command at once, and leaves that frame unknown: up to seven instructions. The end of standard input is not a stop.
///
/// "Done" means queued: after a stop the controller executes its queue, and one that loses it (a power cut) has not executed all of it.
///
/// Exit status: 0 every instruction is done; 1 stopped, or refused; 2 not started; 3 the connection was lost; 7 the journal could not be
/// written; 130 ended at once.
#[derive(Debug, clap::Args)]
struct RunArgs {
    /// The program: .csv, .svg, or G-code
    file: PathBuf,
    /// The controller: the name of a serial port, or HOST:PORT of a serial device server
    #[arg(long, value_name = "PORT", required_unless_present = "dry_run")]
    port: Option<String>,
    /// Run a program although not all of it has its effect; each part is reported. Without WHAT: drawing
    #[arg(
        long,
        value_enum,
        value_name = "WHAT",
        num_args = 0..=1,
        default_missing_value = "drawing",
        display_order = 0
    )]
    allow: Vec<Allow>,
    #[command(flatten)]
    work: WorkArgs,
}

/// The effects of a program that a run may lack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Allow {
    /// Parts of a drawing that cannot be cut are left out, and without a size in mm it has 96 pixels per inch
    Drawing,
    /// F and S of G-code that the plant's words do not carry
    NotCarried,
}

/// Returns true when every instruction is done.
pub fn run(args: &Args) -> Result<bool> {
    let Command::Run(args) = &args.command;
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
    if let Some(file) = &args.work.draw {
        program.draw(file, &mapping)?;
    }
    if args.work.dry_run {
        let (frames, time) = program.estimate(&host);
        let bounds = program.bounds(&mapping).map(|(least, most)| json!({"least": least, "most": most}));
        log(&json!({
            "program": args.file, "instructions": program.instructions.len(), "frames": frames,
            "seconds_on_the_line": (time.as_secs_f64() * 10.0).round() / 10.0, "mm": bounds,
            "not_carried": not_carried,
        }))?;
        return Ok(true);
    }
    if !not_carried.is_empty() {
        log(&json!({"event": "not_carried", "values": not_carried}))?;
    }
    let (fingerprint, parts) = (program.fingerprint(), program.instructions.len());
    let work = Work { file: &args.file, what: "program", fingerprint, parts };
    let run =
        |journal: &mut Journal, progress: &ProgressBar| execute(args, &program, journal, progress, host);
    let ran = args.work.run(work, run, |journal| outcomes(&program, journal))?;
    let count = |outcome| ran.journal.count(outcome);
    let line = json!({
        "event": "ended", "why": match ran.ended.0 {
            Ended::Complete => "complete",
            Ended::Stopped => "stopped",
            Ended::Refused => "refused",
        },
        "done": count(Outcome::Done), "unknown": count(Outcome::Unknown), "refused": count(Outcome::Refused),
        "not_sent": count(Outcome::NotSent), "machine": machine(ran.ended.1, &ran.journal.tally()),
        "journal": ran.journal.path(),
    });
    Ok(ran.say(&line)?.0 == Ended::Complete)
}

/// How the run has ended, and how many instructions were done before it.
fn execute(
    args: &RunArgs,
    program: &Program,
    journal: &mut Journal,
    progress: &ProgressBar,
    host: laser_eb90::HostConfig,
) -> Result<(Ended, usize)> {
    let typed = work::operator(Bell::default())?;
    say_resumed(journal)?;
    let before = journal.count(Outcome::Done);
    let (notify, progress) =
        (&mut |event| log(&event), &mut work::shown(progress, journal, |tally| machine(before, tally)));
    let operator = Operator::new(typed, notify, progress);
    // A question is asked when its answer can be used.
    let port = args.port.as_deref().unwrap_or_default();
    let port = AnyPort::open(port, host.baud, args.work.set.dialing(None, args.work.connect)?)?;
    let mut runner = Runner::new(program, journal, host, operator);
    if !runner.settle_unknown("an earlier run ended before the answer")? {
        return Ok((Ended::Stopped, before));
    }
    Ok((runner.run(port)?, before))
}

/// The parts that the controller may still execute: done means queued, unknown may be, and no message reports the execution.
fn machine(before: usize, tally: &Tally) -> String {
    match tally.done.saturating_sub(before) + tally.unknown {
        0 => "nothing was queued".into(),
        queued => format!("the controller may still execute up to {queued} queued instructions"),
    }
}

/// `number,line,word,outcome` of every instruction.
fn outcomes(program: &Program, journal: &Journal) -> String {
    let mut text = String::from("number,line,word,outcome\n");
    for (number, (instruction, outcome)) in (1..).zip(program.instructions.iter().zip(&*journal.outcomes())) {
        let outcome = outcome.name();
        text.push_str(&format!("{number},{},{:#06x},{outcome}\n", instruction.line, instruction.word));
    }
    text
}

/// What can be set.
pub fn settings() -> Vec<settings::Setting> {
    [settings::list(Settings::at_baud(laser_eb90::timing::BAUD)), connect_settings()].concat()
}
