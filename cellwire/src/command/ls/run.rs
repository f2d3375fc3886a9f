//! `cellwire ls run`.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result};
use fanuc_hmi_modbus::WordOrder;

use crate::cell::telemetry::path::{self, Sample};
use crate::io::files;
use crate::io::input::seconds;
use crate::io::output::{log, remark};
use crate::links::fanuc_hmi_modbus::options::ProgramSettings;
use crate::links::fanuc_hmi_modbus::program::{Machine, Preset};
use crate::links::fanuc_hmi_modbus::simulate::robot;
use cellwire_sim::fanuc::{Tables, TelemetryFaults};

/// Runs a program without a robot, on a clock of its own, and draws its path.
///
/// The same simulation as `cellwire simulate fanuc --program`: a test bench, not a controller. Prints one JSON line for each thing that
/// is not modelled, and for each event of the program. The exit status is 1 when the program stops with an alarm, or still runs
/// after --seconds, or waits for what nothing will change.
///
/// As on a controller, a position of another frame than the selected one stops the program, a block without its end is refused, and a motion
/// with Skip whose condition was not met goes on at its label. What nothing selects is that of the first position.
///
/// Assumed: an instruction takes 1 ms, a motion gets its speed within 0.2 s (at ACC100), CNT100 begins the next one when the speed of this
/// one begins to fall, CNT50 at half of that time, a WAIT with TIMEOUT gives up after 30 s, and CONFIG names the turns of J4, J5 and
/// J6. The pose is in the world frame of a robot whose J1 and J2 meet its origin; one task runs, of one motion group with six axes.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The LS file; those that it calls are beside it
    program: PathBuf,
    /// The longest time that the program is given, in seconds
    #[arg(long, value_name = "N", default_value = "600", value_parser = seconds(0.1..=86_400.0))]
    seconds: Duration,
    /// Write path.csv and path.svg into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// The robot's description, as `ls make` takes it [default: an LR Mate 200iD]
    #[arg(long, value_name = "FILE")]
    robot: Option<String>,
    /// Where the robot is at the start, J1 to J6 in degrees
    #[arg(long, value_name = "J1,…,J6", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    joints: Option<Vec<f64>>,
    /// The inputs that are on, and when, in seconds: DI[1]:0-5,RI[2]:3-
    #[arg(long, value_name = "INPUTS")]
    inputs: Option<String>,
    /// What the controller has at the start, TOML: "R[1]" = 5, "PR[1]" = [X, Y, Z, W, P, R] or { joints = [...] }, "SR[1]", "UFRAME[1]",
    /// "UTOOL[1]", UFRAME_NUM = 1, UTOOL_NUM = 1, "DI[1]" = true, "GI[1]" = 5, "$NAME" = 1, and [macros] with "OPEN HAND" = "PROGRAM"
    #[arg(long, value_name = "FILE")]
    preset: Option<PathBuf>,
    /// Draw the path of the tool whatever an arm reaches: a share of the speed is one of 2000 mm/s
    #[arg(long, conflicts_with = "robot")]
    no_reach: bool,
}

/// The interpolation period.
const PERIOD: Duration = Duration::from_millis(8);

pub(super) fn run(args: &Args) -> Result<bool> {
    let mut settings = ProgramSettings {
        robot: args.robot.clone(),
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
    loop {
        let at = PERIOD * number;
        robot.run(at, number, &faults, &mut tables);
        for event in robot.machine.events() {
            good &= event.get("event").is_none_or(|event| event != "alarm");
            let why = event.get("why").and_then(|why| why.as_str()).unwrap_or("");
            reach |= why.contains(": it is ");
            log(&event)?;
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
        if in_vain || at >= args.seconds {
            good = false;
            remark(&format!("error: {}", unfinished(&robot.machine, at, in_vain)));
            break;
        }
        number += 1;
    }
    if reach {
        remark(
            "help: --robot FILE describes the robot, --joints where it begins; --no-reach draws the path without one",
        );
    }
    let last = samples.last().map_or(0.0, |sample| sample.time);
    remark(&format!("{:.3} s, {:.1} mm", last, path::length(&samples)));
    if let Some(folder) = &args.out {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        files::write(&folder.join("path.csv"), path::table(&samples).as_bytes())?;
        let title =
            args.program.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        files::write(&folder.join("path.svg"), path::draw(&title, &samples)?.as_bytes())?;
    }
    Ok(good)
}

/// Why a program has not ended: what it waits for, or where it goes around.
fn unfinished(machine: &Machine, at: Duration, in_vain: bool) -> String {
    let waiting = machine.waiting();
    if let (true, Some((what, since))) = (in_vain, &waiting) {
        return format!(
            "the program waits for {what} since {since:.3} s, and nothing will change it: give --inputs or --preset"
        );
    }
    let still = format!("the program still runs after {} s", at.as_secs_f64());
    let line = machine.line().map_or_else(String::new, |(program, line)| format!(", in {program}:{line}"));
    match (waiting, machine.loop_of()) {
        (Some((what, since)), _) => format!("{still}, and waits for {what} since {since:.3} s"),
        (None, Some((label, count))) => format!("{still}{line}: it has jumped to {label} {count} times"),
        (None, None) => format!("{still}{line}"),
    }
}
