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
use crate::links::fanuc_hmi_modbus::simulate::robot;
use cellwire_sim::fanuc::{Tables, TelemetryFaults};

/// Runs a program without a robot, on a clock of its own, and draws its path.
///
/// The same simulation as `cellwire simulate fanuc --program`: a test bench, not a controller. Prints one JSON line for each thing that
/// is not modelled, and for each event of the program. The exit status is 1 when the program stops with an alarm, or still runs
/// after --seconds.
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
}

/// The interpolation period.
const PERIOD: Duration = Duration::from_millis(8);

pub(super) fn run(args: &Args) -> Result<bool> {
    let mut settings = ProgramSettings {
        robot: args.robot.clone(),
        inputs: args.inputs.clone(),
        telemetry: 0,
        ..Default::default()
    };
    if let Some(joints) = &args.joints {
        let joints = joints.as_slice().try_into().ok();
        settings.joints = joints.context("--joints needs six numbers, with commas between them")?;
    }
    let mut robot = robot(&args.program, &settings, WordOrder::LowFirst)?;
    let (mut tables, faults) = (Tables::empty(), TelemetryFaults::default());
    let (mut samples, mut good) = (Vec::new(), true);
    let mut number = 0;
    loop {
        let at = PERIOD * number;
        robot.run(at, number, &faults, &mut tables);
        for event in robot.machine.events() {
            good &= event.get("event").is_none_or(|event| event != "alarm");
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
        if at >= args.seconds {
            good = false;
            let line = robot
                .machine
                .line()
                .map_or_else(String::new, |(program, line)| format!(" in {program}:{line}"));
            remark(&format!("error: the program still runs after {} s,{line}", args.seconds.as_secs_f64()));
            break;
        }
        number += 1;
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
