//! `cellwire ls run`.

use core::sync::atomic::{AtomicBool, Ordering};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result};
use fanuc_hmi_modbus::WordOrder;
use serde_json::Value;

use crate::devices::fanuc_hmi_modbus::options::ProgramSettings;
use crate::devices::fanuc_hmi_modbus::program::{Machine, Preset};
use crate::devices::fanuc_hmi_modbus::simulate::robot;
use crate::telemetry::path::{self, Sample};
use cellwire_io::files;
use cellwire_io::input::time;
use cellwire_io::output::{log, remark};
use cellwire_sim::fanuc::{Tables, TelemetryFaults};

/// Simulates a program on a virtual clock, and draws its path.
///
/// The same simulation as `cellwire simulate fanuc --set program=FILE`: a test bench, not a controller. Prints one JSON line
/// for each instruction that is not understood or not modelled, and for each event of the program. The exit status is 1 when
/// the program stops with an alarm, still runs after the time of --for, or waits for something that cannot happen.
///
/// As on a controller, a position in a frame other than the selected one stops the program, a block without its end is
/// refused, and a motion with Skip whose condition was not met continues at its label. Before any selection, the frames are
/// those of the first position.
///
/// Assumptions: an instruction takes 1 ms; a motion accelerates within 0.2 s (at ACC100); CNT100 begins the next motion when this
/// one begins to decelerate, CNT50 at half of that time; a WAIT with TIMEOUT gives up after 30 s; CONFIG has the turns of
/// J4, J5 and J6. The world frame has its origin where J1 and J2 meet; there is one task with one motion group of six axes.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The LS file; programs that it calls are in the same folder
    program: PathBuf,
    /// The time limit of the program
    #[arg(long = "for", value_name = "TIME", default_value = "600s", value_parser = time(Duration::from_millis(100)..=Duration::from_secs(86_400)))]
    duration: Duration,
    /// Write path.csv and path.svg into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The robot description, as for `ls make` [default: an LR Mate 200iD]
    #[arg(long, value_name = "FILE")]
    limits: Option<String>,
    /// The start position, J1 to J6 in degrees
    #[arg(long, value_name = "J1,…,J6", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    joints: Option<Vec<f64>>,
    /// Inputs that are on, with times in seconds: DI[1]:0-5,RI[2]:3-
    #[arg(long, value_name = "INPUTS")]
    inputs: Option<String>,
    /// Initial values, TOML: "R[1]" = 5, "PR[1]" = [X, Y, Z, W, P, R] or { joints = [...] }, "SR[1]", "UFRAME[1]",
    /// "UTOOL[1]", UFRAME_NUM = 1, UTOOL_NUM = 1, "DI[1]" = true, "GI[1]" = 5, "$NAME" = 1, and [macros] with "OPEN HAND" =
    /// "PROGRAM"
    #[arg(long, value_name = "FILE")]
    preset: Option<PathBuf>,
    /// Draw the tool path without an arm's limits; speeds in % refer to 2000 mm/s
    #[arg(long, conflicts_with = "limits")]
    no_reach: bool,
}

/// The interpolation period.
const PERIOD: Duration = Duration::from_millis(8);

pub(super) fn run(args: &Args) -> Result<bool> {
    let (samples, good) = simulate(args, &AtomicBool::new(false), &mut |line| match line {
        Line::Event(event) => log(&event),
        Line::Remark(text) => {
            remark(&text);
            Ok(())
        }
    })?;
    if let Some(folder) = &args.out {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        files::write(&folder.join("path.csv"), path::table(&samples).as_bytes())?;
        let title =
            args.program.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        files::write(&folder.join("path.svg"), path::draw(&title, &samples)?.as_bytes())?;
    }
    Ok(good)
}

/// Runs a program with the default settings and returns its output, 1 MB at most; ends early when `stop` is set.
///
/// # Errors
/// When the file is not a program that can be simulated.
pub(super) fn as_text(program: &Path, stop: &AtomicBool) -> Result<String> {
    let args = Args {
        program: program.to_path_buf(),
        duration: Duration::from_secs(600),
        out: None,
        limits: None,
        joints: None,
        inputs: None,
        preset: None,
        no_reach: false,
    };
    let mut text = String::new();
    simulate(&args, stop, &mut |line| {
        let line = match line {
            Line::Event(event) => event.to_string(),
            Line::Remark(text) => text,
        };
        if text.len() + line.len() < MAX_TEXT {
            text.push_str(&line);
            text.push('\n');
        }
        Ok(())
    })?;
    Ok(text)
}

/// The longest output of [`as_text`], in bytes.
const MAX_TEXT: usize = 1 << 20;

/// A line of the output.
enum Line {
    Event(Value),
    /// A sentence for the user, on standard error.
    Remark(String),
}

/// Simulates a program; the path, and whether the program has ended as it should.
fn simulate(
    args: &Args,
    stop: &AtomicBool,
    print: &mut dyn FnMut(Line) -> Result<()>,
) -> Result<(Vec<Sample>, bool)> {
    let mut settings = ProgramSettings {
        robot: args.limits.clone(),
        inputs: args.inputs.clone(),
        telemetry: 0,
        anywhere: args.no_reach,
        ..Default::default()
    };
    let preset = args.preset.as_deref().map_or_else(|| Ok(Preset::default()), Preset::read)?;
    settings.macros.clone_from(&preset.macros);
    if let Some(joints) = &args.joints {
        let joints = joints.as_slice().try_into().ok();
        settings.joints = joints.context("--joints needs six numbers, with commas between them")?;
    }
    let mut robot = robot(&args.program, &settings, WordOrder::LowFirst)?;
    let (mut tables, faults) = (Tables::empty(), TelemetryFaults::default());
    let mut reach = false;
    let file = args.preset.as_deref().unwrap_or(&args.program);
    preset.apply(&mut robot.machine, &mut tables).with_context(|| file.display().to_string())?;
    let (mut samples, mut good) = (Vec::new(), true);
    let mut number = 0;
    while !stop.load(Ordering::Relaxed) {
        let at = PERIOD * number;
        robot.run(at, number, &faults, &mut tables);
        for event in robot.machine.events() {
            good &= event.get("event").is_none_or(|event| event != "alarm");
            let why = event.get("why").and_then(|why| why.as_str()).unwrap_or("");
            reach |= why.contains(": it is ");
            print(Line::Event(event))?;
        }
        samples.push(Sample {
            time: at.as_secs_f64(),
            joints: robot.machine.joints(),
            pose: robot.machine.pose(),
        });
        if robot.machine.has_ended() {
            break;
        }
        let in_vain = robot.machine.waits_in_vain() && robot.inputs.are_settled(at);
        if in_vain || at >= args.duration {
            good = false;
            print(Line::Remark(format!("error: {}", unfinished(&robot.machine, at, in_vain))))?;
            break;
        }
        number += 1;
    }
    if reach {
        print(Line::Remark(
            "help: --limits FILE describes the robot, --joints its start position; --no-reach draws the path without an arm"
                .into(),
        ))?;
    }
    let last = samples.last().map_or(0.0, |sample| sample.time);
    print(Line::Remark(format!("{:.3} s, {:.1} mm", last, path::length(&samples))))?;
    Ok((samples, good))
}

/// Returns the reason for which a program has not ended: the condition that it waits for, or the loop that it repeats.
fn unfinished(machine: &Machine, at: Duration, in_vain: bool) -> String {
    let waiting = machine.waiting();
    if let (true, Some((what, since))) = (in_vain, &waiting) {
        return format!(
            "the program has waited for {what} since {since:.3} s, which cannot happen: give --inputs or --preset"
        );
    }
    let still = format!("the program still runs after {} s", at.as_secs_f64());
    let line = machine.line().map_or_else(String::new, |(program, line)| format!(", in {program}:{line}"));
    match (waiting, machine.loop_of()) {
        (Some((what, since)), _) => format!("{still}, and has waited for {what} since {since:.3} s"),
        (None, Some((label, count))) => format!("{still}{line}: it has jumped to {label} {count} times"),
        (None, None) => format!("{still}{line}"),
    }
}
