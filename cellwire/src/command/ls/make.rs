//! `cellwire ls make`.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::ValueEnum;
use fanuc_ls::CommentRule;

use cellwire_io::output::remark;
use cellwire_motion::{Acceleration, Limits, Report, Resampling, Sampling, SpeedStep, Trajectory};

use super::{ArmArgs, limits, rules, write};

/// Makes an LS program of spline moves from a joint trajectory.
///
/// TRAJECTORY.csv has seven columns: time in seconds, J1 to J6 in degrees; a header line is skipped. The program
/// moves to the first sample (J, 2 %), then through the points with S (the Spline Motion option) at the trajectory's
/// speed. The controller's path between two points is not published: a published test measured an error of
/// 4 mm and 0.5 degrees at 100 mm/s. Test it slowly first.
///
/// A trajectory beyond the joint ranges or speeds of --limits is refused.
/// Without --limits the limits are 720 degrees and 2000 degrees per second.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The trajectory
    trajectory: PathBuf,
    /// How points are chosen
    #[arg(long, value_enum)]
    mode: Mode,
    /// --mode distance: the distance between points, in mm
    #[arg(long, value_name = "MM", conflicts_with = "deg", allow_negative_numbers = true)]
    mm: Option<f64>,
    /// --mode distance: the rotation between points, in degrees
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    deg: Option<f64>,
    /// --mode time: the time between points, in seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    step: Option<f64>,
    /// --mode dynamic: the shortest time between points, at the greatest acceleration [default: 0.05]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    min: Option<f64>,
    /// --mode dynamic: the longest time between points, without acceleration [default: 0.5]
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    max: Option<f64>,
    /// --mode dynamic: the acceleration to use [default: either]
    #[arg(long, value_enum)]
    by: Option<Unit>,
    /// The resolution of speeds; the lowest speed is 1 mm/s
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
    /// The speed of the approach to the first point, in %
    #[arg(long, value_name = "PERCENT", default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=100))]
    approach: u8,
    #[command(flatten)]
    arm: ArmArgs,
    /// The robot description, JSON: {"joints": [{"min": -170, "max": 170, "speed": 450}, ...]}, six joints in degrees
    /// and degrees per second, J3 from the horizontal; "arm": {"shoulder": 50, "upper_arm": 330, "elbow": 35, "forearm": 335,
    /// "flange": 80} in mm replaces --arm
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,
    /// The longest program name; 8 on old controllers
    #[arg(long, value_name = "N", default_value_t = 36)]
    name_limit: usize,
    /// Truncate a comment of more than 16 characters instead of refusing it
    #[arg(long)]
    truncate_comment: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Mode {
    /// At equal distances (--mm) or equal turns (--deg)
    Distance,
    /// At equal times (--step)
    Time,
    /// Every --min to --max seconds, depending on acceleration
    Dynamic,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Unit {
    Translation,
    Rotation,
    /// Translation or rotation, whichever is closer to its maximum
    Either,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SpeedArg {
    /// In whole mm/s
    Whole,
    /// In tenths of mm/s
    Tenth,
}

pub(super) fn make(args: &Args) -> Result<()> {
    let sampling = args.sampling()?;
    let limits = args.limits.as_deref().map_or(Ok(Limits::ANY), limits)?;
    let arm = args.arm.arm(limits.arm)?;
    let trajectory = args.arm.trajectory(&args.trajectory)?;
    limits.check(&trajectory).with_context(|| args.trajectory.display().to_string())?;
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
    let mut rules = rules(args.name_limit);
    if args.truncate_comment {
        rules.comment = CommentRule::Truncate;
    }
    let (program, report) = resampling.program(&name, &args.comment, &trajectory, &arm, &rules)?;
    let path = write(&program, &rules, args.out.as_deref(), true)?;
    remark(made(&trajectory, &report, &path).trim_end());
    Ok(())
}

impl Args {
    /// Returns the sampling from the mode's own options; rejects those of another mode rather than ignoring them.
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
        let steps = [
            ("--mm", self.mm),
            ("--deg", self.deg),
            ("--step", self.step),
            ("--min", self.min),
            ("--max", self.max),
        ];
        for (option, step) in steps {
            // A value that is not a number above 0 is refused with the others.
            let is_too_long = step.is_some_and(|step| step > 1e6);
            ensure!(!is_too_long, "{option}: give a number above 0, and 1000000 at most");
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
                by: match self.by.unwrap_or(Unit::Either) {
                    Unit::Translation => Acceleration::Translation,
                    Unit::Rotation => Acceleration::Rotation,
                    Unit::Either => Acceleration::Either,
                },
            },
        })
    }
}

/// Returns the report about program and trajectory, for people.
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
            "  warning    {} below 1 mm/s, the lowest speed: rotations in place and rests will be too fast\n",
            report.slow_moves
        );
    }
    text
}

/// Returns the file's name as a program's name: upper-case letters, digits and `_`, beginning with a letter.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().to_uppercase());
    let name: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if name.starts_with(|c: char| c.is_ascii_alphabetic()) { name } else { format!("P_{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_gives_its_program_a_name() {
        for (path, name) in
            [("path.csv", "PATH"), ("a/weld-1.csv", "WELD_1"), ("7.csv", "P_7"), ("ž.csv", "P__")]
        {
            assert_eq!(name_of(Path::new(path)), name);
        }
    }
}
