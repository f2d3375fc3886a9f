//! `cellwire fanuc`: the telemetry of a real robot, logged and compared with the plan.

use std::io::{LineWriter, Write};
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use clap::{Subcommand, ValueEnum};
use fanuc_hmi_modbus::typed::OrderProbe;
use fanuc_hmi_modbus::{TelemetryBlock, WordOrder};
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde_json::json;

use crate::cell::fanuc_hmi_modbus::logger::{Logger, Reading};
use crate::cell::fanuc_hmi_modbus::plot;
use crate::cell::fanuc_hmi_modbus::recording::{self, Comparison, Recording};
use crate::cell::report::Report;
use crate::command::ls::ArmArgs;
use crate::io::line::Clock;
use crate::io::output::remark;
use crate::io::samples::Samples;
use crate::io::tcp::ConnectArgs;
use crate::io::{files, tcp};

/// The telemetry of a FANUC controller over Modbus TCP (HMI Device Communication).
///
/// The controller runs a background task (`cellwire ls background` writes it) and has the `$SNPX_ASG` lines that show its
/// registers `R[1]` to `R[19]` as 37 Modbus registers from 0. Without a robot: `cellwire simulate fanuc --listen 127.0.0.1:5020`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cellwire fanuc log 192.168.0.10:502 --csv run.csv      log a run of the robot
  cellwire fanuc evaluate path.csv run.csv --out plots   how far was it from the plan";

#[derive(Debug, Subcommand)]
enum Command {
    Log(LogArgs),
    Evaluate(EvaluateArgs),
}

/// Logs the telemetry block of a controller every 8 ms, as a table.
///
/// Each line has the time by the robot's own life counter, what the controller reports, and the speeds without the controller's
/// jumps. The word order is found by watching the life counter. Runs until --seconds have passed, or until interrupted: what
/// was read is in the file by then.
#[derive(Debug, clap::Args)]
struct LogArgs {
    /// The controller: HOST:PORT, where the port is usually 502
    address: String,
    /// The file to write; where there is one, a number is put behind its name
    #[arg(long, value_name = "FILE")]
    csv: PathBuf,
    /// How long to log [default: until interrupted]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// The period of the background task, and of the log, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 8, value_parser = clap::value_parser!(u64).range(1..=60_000))]
    period: u64,
    /// The Modbus unit
    #[arg(long, value_name = "N", default_value_t = 1)]
    unit: u8,
    /// Which word of a value comes first
    #[arg(long, value_enum, default_value_t = OrderArg::Auto)]
    word_order: OrderArg,
    #[command(flatten)]
    connect: ConnectArgs,
    /// Print one JSON object at the end instead of a table
    #[arg(long)]
    json: bool,
}

/// Compares a log with the trajectory that the robot was to run.
///
/// Fits the delay between the two first (within 10 s either way, so the log may begin before the motion does), then gives the
/// errors of position, orientation and their speeds, and draws them with --out. The frame of the trajectory's arm must be
/// the one in which the controller shows its position: the world frame, with the tool's frame given by --tool.
#[derive(Debug, clap::Args)]
struct EvaluateArgs {
    /// The trajectory: time in seconds, J1 to J6 in degrees
    trajectory: PathBuf,
    /// The table that `fanuc log` wrote
    recording: PathBuf,
    /// Draw position, orientation and their errors into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    arm: ArmArgs,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum OrderArg {
    /// Found by watching the life counter
    Auto,
    LowFirst,
    HighFirst,
}

/// Does what the arguments ask for; false when nothing usable was read.
///
/// # Errors
/// When the controller cannot be reached, or a file cannot be read or written.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Command::Log(args) => log(args),
        Command::Evaluate(args) => evaluate(args),
    }
}

/// Blocks wait here until their word order is known.
struct Order {
    known: Option<WordOrder>,
    probe: OrderProbe,
    /// What the life counter shows, where that is not the order in which the blocks are read.
    contradicted: Option<WordOrder>,
    waiting: Vec<[u16; 37]>,
}

impl Order {
    /// The life counter has not shown it after so many blocks: it stands still, or is something else.
    const PATIENCE: usize = 500;

    /// The blocks that can be read now.
    fn push(&mut self, registers: &[u16; 37]) -> Result<Vec<TelemetryBlock>> {
        let [first, second, ..] = *registers;
        let found = self.probe.watch([first, second]);
        self.known = self.known.or(found);
        self.contradicted = found.filter(|_| found != self.known);
        self.waiting.push(*registers);
        let Some(order) = self.known else {
            ensure!(
                self.waiting.len() < Self::PATIENCE,
                "the life counter does not count (it reads {first:#06X} {second:#06X}): is the background task running, \
                 and does $SNPX_ASG show R[1] at address 1? --word-order logs it all the same"
            );
            return Ok(Vec::new());
        };
        Ok(self
            .waiting
            .drain(..)
            .map(|registers| TelemetryBlock::from_registers(&registers, order))
            .collect())
    }
}

fn log(args: &LogArgs) -> Result<bool> {
    let end = match args.seconds {
        Some(seconds) => {
            ensure!(seconds > 0.0 && seconds < 1e9, "--seconds must be above 0");
            Some(Duration::from_secs_f64(seconds))
        }
        None => None,
    };
    let period = Duration::from_millis(args.period);
    let clock = Clock::start();
    let mut logger =
        Logger::new(tcp::connect(&args.address, args.connect.timeout())?, args.unit, period, clock)?;
    let (file, csv) = files::create_new(&args.csv)?;
    let mut out = LineWriter::new(file); // whole lines, also when interrupted
    writeln!(out, "{}", recording::HEADER)?;
    let target =
        if args.json { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(10) };
    let progress = ProgressBar::with_draw_target(None, target);
    let known = match args.word_order {
        OrderArg::Auto => None,
        OrderArg::LowFirst => Some(WordOrder::LowFirst),
        OrderArg::HighFirst => Some(WordOrder::HighFirst),
    };
    let mut order = Order { known, probe: OrderProbe::default(), contradicted: None, waiting: Vec::new() };
    let (mut recording, mut turn_around) = (Recording::new(period), Samples::default());
    let (mut failed, mut why) = (0u64, None);
    let outcome = logger.run(end, |reading| {
        match reading {
            Reading::Failed(failure) => {
                failed += 1;
                progress.set_message(format!("no block: {failure}"));
                why = Some(failure.to_owned());
            }
            Reading::Registers(registers, took) => {
                turn_around.add(took);
                for block in order.push(registers)? {
                    let Some(sample) = recording.push(&block) else { continue };
                    recording::write_row(&mut out, &block, &sample)?;
                    let [x, y, z] = block.position;
                    let seconds = sample.time.as_secs_f64();
                    progress.set_message(format!("{seconds:7.2} s  X {x:.1}  Y {y:.1}  Z {z:.1} mm"));
                    recording.forget(); // the file has it
                }
            }
        }
        Ok(true)
    });
    progress.finish_and_clear();
    let counts = recording.counts();
    let mut report =
        Report::new("fanuc-hmi-modbus", format!("telemetry of {} in {}", args.address, csv.display()));
    report.fact("samples", "samples written", counts.samples);
    report.fact("repeated", "runs of the task read twice", counts.repeated);
    report.fact("gaps", "times that runs were missed", counts.gaps);
    report.fact("missed", "runs of the task not read", counts.missed);
    report.fact("restarts", "restarts of the life counter", counts.restarts);
    report.fact("failed", "requests without a block", failed);
    if let Some(found) = order.known {
        report.fact("word_order", "word order", json!(found));
    }
    report.timing("turn_around", "request to block", &turn_around, None);
    print(&report, args.json)?;
    outcome?;
    if let Some(order) = order.contradicted {
        let order = json!(order);
        remark(&format!(
            "warning: the life counter steps as if the word order were {order}: these values are wrong"
        ));
    }
    if let Some(why) = why.filter(|_| counts.samples == 0) {
        remark(&format!("error: not one sample: {why}"));
    }
    Ok(counts.samples > 0)
}

fn evaluate(args: &EvaluateArgs) -> Result<bool> {
    let arm = args.arm.arm()?;
    let trajectory = args.arm.trajectory(&args.trajectory)?;
    let path = &args.recording;
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    let recorded = recording::read_states(&text).with_context(|| path.display().to_string())?;
    let comparison = Comparison::new(recording::reference(&trajectory, &arm), recorded, 10.0)?;
    let mut report =
        Report::new("fanuc-hmi-modbus", format!("{} against {}", path.display(), args.trajectory.display()));
    comparison.report(&mut report, comparison.delay);
    if let Some(folder) = &args.out {
        for path in plot::draw(folder, &comparison)? {
            remark(&path.display().to_string());
        }
    }
    print(&report, args.json)?;
    Ok(true)
}

fn print(report: &Report, as_json: bool) -> Result<()> {
    let mut out = std::io::stdout().lock();
    if as_json {
        writeln!(out, "{}", report.to_json())?
    } else {
        write!(out, "{}", report.figures())?
    }
    Ok(())
}
