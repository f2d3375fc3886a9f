//! `cellwire ls`: LS programs checked, made from trajectories, and the background task that feeds the telemetry.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use clap::{Subcommand, ValueEnum};
use fanuc_ls::{
    Acceleration, Arm, BackgroundTask, CommentRule, DecodeError, MotionKind, Pose, Program, Report,
    Resampling, Rules, Sampling, SpeedStep, Trajectory, Warning,
};
use serde_json::{Value, json};

/// FANUC teach pendant programs as text: LS files.
///
/// A controller with the ASCII upload option loads them; others need them compiled to TP first (WinOLPC, RoboGuide). The
/// file's name must be the program's.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cellwire ls check WELD.LS                           is it a program, and a sound one
  cellwire ls make path.csv --mode dynamic            points dense where the motion changes
  cellwire ls make path.csv --mode distance --mm 5    a point every 5 mm
  cellwire ls background                              the task that `cellwire fanuc log` reads";

#[derive(Debug, Subcommand)]
enum Command {
    Check(CheckArgs),
    Make(MakeArgs),
    Background(BackgroundArgs),
}

/// Reads LS files and says what is wrong with them, by line and column.
///
/// The exit status is 1 if a file is no program, or would not be written as it is. Warnings (a point that is not used, a
/// comment of more than 16 characters) do not count.
#[derive(Debug, clap::Args)]
struct CheckArgs {
    /// The files
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Print one JSON object a file instead of text
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rules: RulesArgs,
}

/// Makes an LS program of spline moves from a trajectory of the joints.
///
/// TRAJECTORY.csv has seven columns: the time in seconds, J1 to J6 in degrees; a first line of names is passed over. The program
/// goes to the first sample (J, 2 %), then through the points with S (the Spline Motion option) at the speed that the
/// trajectory has between them. What the controller does between two points is not published: a published test measured
/// 4 mm and 0.5 degrees at 100 mm/s. Try it slowly first.
#[derive(Debug, clap::Args)]
struct MakeArgs {
    /// The trajectory
    trajectory: PathBuf,
    /// When a new point begins
    #[arg(long, value_enum)]
    mode: Mode,
    /// --mode distance: a point each time the tool has gone so far, in mm
    #[arg(long, value_name = "MM", conflicts_with = "deg")]
    mm: Option<f64>,
    /// --mode distance: a point each time the tool has turned so far, in degrees
    #[arg(long, value_name = "DEG")]
    deg: Option<f64>,
    /// --mode time: a point every so many seconds
    #[arg(long, value_name = "S")]
    step: Option<f64>,
    /// --mode dynamic: the shortest time between points, where the acceleration is greatest [default: 0.05]
    #[arg(long, value_name = "S")]
    min: Option<f64>,
    /// --mode dynamic: the longest time between points, where nothing accelerates [default: 0.5]
    #[arg(long, value_name = "S")]
    max: Option<f64>,
    /// --mode dynamic: the acceleration that counts [default: either]
    #[arg(long, value_enum)]
    by: Option<By>,
    /// How finely speeds are written; none is below 1 mm/s
    #[arg(long, value_enum, default_value_t = SpeedArg::Whole)]
    speed: SpeedArg,
    /// The program's name [default: the file's, in capitals]
    #[arg(long)]
    name: Option<String>,
    /// The program's comment, 16 characters at most
    #[arg(long, default_value = "")]
    comment: String,
    /// The file to write, - for standard output [default: NAME.LS]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The number of the user frame
    #[arg(long, value_name = "N", default_value_t = 0)]
    uframe: u16,
    /// The number of the tool frame
    #[arg(long, value_name = "N", default_value_t = 1)]
    utool: u16,
    /// The speed of the way to the first point, in %
    #[arg(long, value_name = "PERCENT", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=100))]
    approach: u8,
    #[command(flatten)]
    arm: ArmArgs,
    #[command(flatten)]
    rules: RulesArgs,
}

/// Writes the background task that puts the tool's pose and speed into registers for `cellwire fanuc log`.
///
/// It is the source's listing with your registers in it. Run it as a background task (BG Logic) with the period that it says;
/// it moves nothing. `R[1]` to `R[19]` are read over Modbus in 37 registers, which needs `$SNPX_ASG` lines: see the page of
/// fanuc-hmi-modbus.
#[derive(Debug, clap::Args)]
struct BackgroundArgs {
    /// The program's name
    #[arg(long, default_value = "BG_TELEMETRY")]
    name: String,
    /// The period of the background task, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 8)]
    period: u64,
    /// The register of the life counter; 18 more follow it
    #[arg(long, value_name = "N", default_value_t = 1)]
    first: u16,
    /// The first of 13 registers that the task keeps for itself
    #[arg(long, value_name = "N", default_value_t = 30)]
    scratch: u16,
    /// The motion group that is watched
    #[arg(long, value_name = "N", default_value_t = 1)]
    group: u8,
    /// The file to write, - for standard output [default: NAME.LS]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    rules: RulesArgs,
}

/// The robot's arm.
#[derive(Debug, Clone, clap::Args)]
pub struct ArmArgs {
    /// The arm's dimensions in mm: J1 to J2 out, J2 to J3, J3 up to the forearm's axis, J3 to the wrist's centre, wrist to flange
    /// [default: the LR Mate 200iD's, 50,330,35,335,80]
    #[arg(long, value_name = "A,B,C,D,E", value_delimiter = ',', num_args = 1)]
    arm: Option<Vec<f64>>,
    /// The tool frame, X,Y,Z in mm and W,P,R in degrees, seen from the flange [default: the flange]
    #[arg(long, value_name = "X,Y,Z,W,P,R", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    tool: Option<Vec<f64>>,
    /// What J3 of the trajectory counts from: the horizontal, as FANUC shows it, or the upper arm
    #[arg(long, value_enum, default_value_t = J3::Horizontal)]
    j3: J3,
}

impl ArmArgs {
    /// The arm with its tool.
    ///
    /// # Errors
    /// When a number is missing.
    pub fn arm(&self) -> Result<Arm> {
        let mut arm = Arm::LR_MATE_200ID;
        if let Some(dimensions) = &self.arm {
            let &[shoulder, upper_arm, elbow, forearm, flange] = dimensions.as_slice() else {
                bail!("--arm needs five numbers, with commas between them");
            };
            arm = Arm { shoulder, upper_arm, elbow, forearm, flange, ..arm };
        }
        if let Some(tool) = &self.tool {
            let tool =
                tool.first_chunk::<6>().context("--tool needs six numbers, with commas between them")?;
            arm.tool = Pose::from_xyzwpr(*tool);
        }
        Ok(arm)
    }

    /// A trajectory from its file.
    ///
    /// # Errors
    /// When it cannot be read, or is none.
    pub fn trajectory(&self, path: &Path) -> Result<Trajectory> {
        let text =
            std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
        let trajectory = Trajectory::from_csv(&text).with_context(|| path.display().to_string())?;
        Ok(match self.j3 {
            J3::Horizontal => trajectory,
            J3::UpperArm => trajectory.from_upper_arm(),
        })
    }
}

#[derive(Debug, Clone, clap::Args)]
struct RulesArgs {
    /// The longest name that the controller takes; old ones take 8
    #[arg(long, value_name = "N", default_value_t = 36)]
    name_limit: usize,
    /// Cut a comment of more than 16 characters instead of refusing it
    #[arg(long)]
    truncate_comment: bool,
}

impl RulesArgs {
    fn rules(&self) -> Rules {
        let mut rules = Rules::default();
        rules.name_limit = self.name_limit;
        rules.comment = if self.truncate_comment { CommentRule::Truncate } else { CommentRule::Refuse };
        rules
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// At equal distances (--mm) or equal turns (--deg)
    Distance,
    /// At equal times (--step)
    Time,
    /// Between --min and --max seconds, by the acceleration
    Dynamic,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum By {
    Translation,
    Rotation,
    /// Whichever is the greater share of its maximum
    Either,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SpeedArg {
    /// In whole mm/s
    Whole,
    /// In tenths of mm/s
    Tenth,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum J3 {
    Horizontal,
    UpperArm,
}

/// Does what the arguments say; false when a file was refused.
///
/// # Errors
/// When a file cannot be read or written, or arguments do not fit together.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Command::Check(args) => check(args),
        Command::Make(args) => make(args).map(|()| true),
        Command::Background(args) => background(args).map(|()| true),
    }
}

fn check(args: &CheckArgs) -> Result<bool> {
    let mut all = true;
    for path in &args.files {
        let (text, encoding) = read(path)?;
        let mut warnings = Vec::new();
        let program = Program::decode_with(&text, |warning| warnings.push(warning));
        let unwritable = program.as_ref().ok().and_then(|program| program.check(&args.rules.rules()).err());
        // A comment that is too long is told as a warning already: a controller reads it, and keeps 16 characters.
        let unwritable = unwritable.filter(|e| !matches!(e, fanuc_ls::EncodeError::CommentLength { .. }));
        all &= program.is_ok() && unwritable.is_none();
        let name = path.display().to_string();
        if args.json {
            println!("{}", object(&name, &program, &warnings, unwritable.map(|e| json!(e))));
            continue;
        }
        match &program {
            Err(error) => print!("{}", point_at(&name, &text, error)),
            Ok(program) => {
                println!("{name}: {}", summary(program));
                if encoding == Encoding::Latin1 {
                    println!("  note: not UTF-8; read as Latin-1");
                }
                if !same_name(path, program) {
                    println!(
                        "  warning: the program is named {}, the file is not: the controller wants both the same",
                        program.name
                    );
                }
                warnings.iter().for_each(|warning| println!("  warning: {warning}"));
            }
        }
        if let Some(error) = unwritable {
            println!("  error: {error}");
        }
    }
    Ok(all)
}

/// The error with the line that it is in, and a mark below the place.
fn point_at(name: &str, text: &str, error: &DecodeError) -> String {
    let line = text.lines().nth(error.line - 1).unwrap_or_default();
    // A tab takes one column, in the count as on the screen.
    let line = line.replace('\t', " ");
    let (number, before) = (error.line.to_string(), " ".repeat(error.column - 1));
    let margin = " ".repeat(number.len());
    format!(
        "{name}:{}:{}: {}\n {number} | {line}\n {margin} | {before}^\n",
        error.line, error.column, error.reason
    )
}

fn summary(program: &Program) -> String {
    use MotionKind::{Arc, Circular, Joint, Linear, Spline};
    let motions = [Joint, Linear, Circular, Arc, Spline].map(|kind| (kind.letter(), program.motions(kind)));
    let motions: Vec<String> =
        motions.iter().filter(|(_, n)| *n > 0).map(|(letter, n)| format!("{n} {letter}")).collect();
    let motions = if motions.is_empty() { "no motions".into() } else { motions.join(", ") };
    let comment = program.comment().filter(|comment| !comment.is_empty());
    let comment = comment.map(|comment| format!(" \"{comment}\"")).unwrap_or_default();
    let (lines, points) = (program.line_count(), program.positions.len());
    format!("{}{comment}, {lines} instructions ({motions}), {points} positions", program.name)
}

fn object(
    name: &str,
    program: &Result<Program, DecodeError>,
    warnings: &[Warning],
    unwritable: Option<Value>,
) -> Value {
    match program {
        Err(error) => json!({"file": name, "ok": false, "error": error, "reason": error.reason.to_string()}),
        Ok(program) => json!({
            "file": name, "ok": unwritable.is_none(), "name": program.name, "comment": program.comment(),
            "instructions": program.line_count(), "positions": program.positions.len(),
            "warnings": warnings, "error": unwritable,
        }),
    }
}

fn same_name(path: &Path, program: &Program) -> bool {
    path.file_stem().is_none_or(|stem| stem.eq_ignore_ascii_case(&program.name))
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Utf8,
    Latin1,
}

/// A text file; controllers write comments in whatever they are set to, and every byte is some character of Latin-1.
fn read(path: &Path) -> Result<(String, Encoding)> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(match String::from_utf8(bytes) {
        Ok(text) => (text, Encoding::Utf8),
        Err(error) => (error.into_bytes().into_iter().map(char::from).collect(), Encoding::Latin1),
    })
}

fn make(args: &MakeArgs) -> Result<()> {
    let sampling = args.sampling()?;
    let arm = args.arm.arm()?;
    let trajectory = args.arm.trajectory(&args.trajectory)?;
    let name = match &args.name {
        Some(name) => name.clone(),
        None => name_of(&args.trajectory),
    };
    let mut resampling = Resampling::new(sampling);
    resampling.speed = match args.speed {
        SpeedArg::Whole => SpeedStep::Whole,
        SpeedArg::Tenth => SpeedStep::Tenth,
    };
    (resampling.user_frame, resampling.user_tool, resampling.approach) =
        (args.uframe, args.utool, args.approach);
    let rules = args.rules.rules();
    let (program, report) = resampling.program(&name, &args.comment, &trajectory, &arm, &rules)?;
    let path = write(&program, &rules, args.out.as_deref())?;
    eprint!("{}", made(&trajectory, &report, &path));
    Ok(())
}

impl MakeArgs {
    /// What the mode's own options say; those of another mode are refused rather than ignored.
    fn sampling(&self) -> Result<Sampling> {
        let given = [
            ("--mm", Mode::Distance, self.mm.is_some()),
            ("--deg", Mode::Distance, self.deg.is_some()),
            ("--step", Mode::Time, self.step.is_some()),
            ("--min", Mode::Dynamic, self.min.is_some()),
            ("--max", Mode::Dynamic, self.max.is_some()),
            ("--by", Mode::Dynamic, self.by.is_some()),
        ];
        for (option, mode, given) in given {
            ensure!(!given || mode == self.mode, "{option} belongs to another --mode");
        }
        Ok(match self.mode {
            Mode::Distance => match (self.mm, self.deg) {
                (Some(mm), _) => Sampling::Distance(mm),
                (None, Some(deg)) => Sampling::Angle(deg),
                (None, None) => bail!("--mode distance needs --mm or --deg"),
            },
            Mode::Time => Sampling::Time(self.step.context("--mode time needs --step")?),
            Mode::Dynamic => Sampling::Dynamic {
                min: self.min.unwrap_or(0.05),
                max: self.max.unwrap_or(0.5),
                by: match self.by.unwrap_or(By::Either) {
                    By::Translation => Acceleration::Translation,
                    By::Rotation => Acceleration::Rotation,
                    By::Either => Acceleration::Either,
                },
            },
        })
    }
}

/// What the program has of the trajectory, for people.
fn made(trajectory: &Trajectory, report: &Report, path: &str) -> String {
    let mut text = format!(
        "{path}: {} spline moves from {} samples\n  path       {:.1} mm, {:.1}° in {:.3} s; at the speeds as written {:.3} s\n  \
         moves      up to {:.2} mm and {:.2}°, {:.3} to {:.3} s each\n  \
         rounding   of the speeds: {:.1} % in the mean, {:+.1} % at worst, on the way to P[{}]\n",
        report.moves,
        trajectory.samples().len(),
        report.length,
        report.rotation,
        report.planned_time,
        report.written_time,
        report.longest_move,
        report.greatest_turn,
        report.shortest_time,
        report.longest_time,
        report.mean_rounding * 100.0,
        report.worst_rounding * 100.0,
        report.worst_point,
    );
    if report.slow_moves > 0 {
        text += &format!(
            "  warning    {} below 1 mm/s, the slowest speed that is written: turns on the spot and rests come out too fast\n",
            report.slow_moves
        );
    }
    text
}

fn background(args: &BackgroundArgs) -> Result<()> {
    let task = BackgroundTask {
        name: args.name.clone(),
        period: Duration::from_millis(args.period),
        first: args.first,
        scratch: args.scratch,
        group: args.group,
        ..BackgroundTask::default()
    };
    let rules = args.rules.rules();
    let path = write(&task.program(&rules)?, &rules, args.out.as_deref())?;
    eprintln!(
        "{path}: R[{}] to R[{}] every {} ms; R[{}] to R[{}] are its own",
        args.first,
        args.first + 18,
        args.period,
        args.scratch,
        args.scratch + 12
    );
    Ok(())
}

/// Writes a program to a file, NAME.LS where none is given; what to call it.
fn write(program: &Program, rules: &Rules, out: Option<&Path>) -> Result<String> {
    let text = program.to_text(rules)?;
    if out == Some(Path::new("-")) {
        print!("{text}");
        return Ok("standard output".into());
    }
    let path = out.map_or_else(|| PathBuf::from(format!("{}.LS", program.name)), Path::to_path_buf);
    std::fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
    if !same_name(&path, program) {
        eprintln!(
            "warning: the program is named {}: the controller wants the file named so too",
            program.name
        );
    }
    Ok(path.display().to_string())
}

/// The file's name as a program's: capitals, digits and `_`, a letter first.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().to_uppercase());
    let name: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("P_{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_shown_below_its_line() {
        let text = "/PROG A\n/MN\n   1:L\tP[1] 100mm/s FINE ;\n/END\n";
        let error = Program::decode(text).unwrap_err();
        assert_eq!(
            point_at("A.LS", text, &error),
            "A.LS:3:16: expected a unit: %, sec, msec, mm/sec, cm/min, inch/min or deg/sec\n \
             3 |    1:L P[1] 100mm/s FINE ;\n   |                ^\n"
        );
    }

    #[test]
    fn a_file_gives_its_program_a_name() {
        for (path, name) in
            [("path.csv", "PATH"), ("a/weld-1.csv", "WELD_1"), ("7.csv", "P_7"), ("ž.csv", "P__")]
        {
            assert_eq!(name_of(Path::new(path)), name);
        }
    }
}
