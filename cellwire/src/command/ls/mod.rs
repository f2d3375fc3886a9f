//! `cellwire ls`: LS programs checked, made from trajectories, and the background task that feeds the telemetry.

mod background;
mod check;
mod difference;
mod edit;
mod fmt;
mod lsp;
mod make;
mod run;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use clap::{Subcommand, ValueEnum};
use fanuc_ls::{Program, Rules};

use cellwire_io::files;
use cellwire_io::output::{remark, stdout};
use cellwire_motion::{Arm, Dimensions, Limits, Pose, Trajectory};

/// FANUC teach pendant programs as text: LS files.
///
/// A controller with the ASCII upload option loads them; for others, compile them to TP first (WinOLPC, RoboGuide). The
/// file must have the program's name.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

/// Lists the LS files of a folder with their findings; the exit status is 1 if one has errors
#[derive(Debug, clap::Args)]
struct ListArgs {
    /// The folder
    folder: PathBuf,
}

const EXAMPLES: &str = "\
Examples:
  cellwire ls list backup                             the LS files of a folder
  cellwire ls check WELD.LS                           report errors and warnings
  cellwire ls edit WELD.LS --speed '100mm/sec=80mm/sec'   show the changes; --write applies them
  cellwire ls fmt WELD.LS --write                     the layout of a controller
  cellwire ls make path.csv --mode dynamic            denser points where the motion changes
  cellwire ls make path.csv --mode distance --mm 5    a point every 5 mm
  cellwire ls run WELD.LS --out plots                 simulate, and draw the path
  cellwire ls background                              the task that `cellwire fanuc log` reads
  cellwire ls lsp                                     the language server that an editor starts";

#[derive(Debug, Subcommand)]
enum Command {
    List(ListArgs),
    Check(check::Args),
    Edit(edit::Args),
    Fmt(fmt::Args),
    Make(Box<make::Args>),
    Background(background::Args),
    Run(run::Args),
    Lsp(lsp::Args),
}

/// Executes the command; returns false if a file was rejected.
///
/// # Errors
/// When a file cannot be read or written, or arguments do not fit together.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Command::List(args) => check::summarize(&args.folder),
        Command::Check(args) => check::check(args),
        Command::Edit(args) => edit::edit(args),
        Command::Fmt(args) => fmt::fmt(args),
        Command::Make(args) => make::make(args).map(|()| true),
        Command::Background(args) => background::background(args).map(|()| true),
        Command::Run(args) => run::run(args),
        Command::Lsp(args) => lsp::lsp(args),
    }
}

/// The robot's arm, and the origin from which a trajectory counts.
#[derive(Debug, Clone, clap::Args)]
pub struct ArmArgs {
    #[command(flatten)]
    geometry: GeometryArgs,
    /// The reference of J3 in the trajectory: the horizontal, as FANUC shows it, or the upper arm
    #[arg(long, value_enum, default_value_t = J3::Horizontal)]
    j3: J3,
}

/// The robot's arm.
#[derive(Debug, Clone, clap::Args)]
pub struct GeometryArgs {
    /// The arm's dimensions in mm: J1 to J2 out, J2 to J3, J3 up to the forearm's axis, J3 to the wrist's centre, wrist to flange
    /// [default: the LR Mate 200iD's, 50,330,35,335,80]
    #[arg(long, value_name = "A,B,C,D,E", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    arm: Option<Vec<f64>>,
    /// The tool frame, X,Y,Z in mm and W,P,R in degrees, seen from the flange [default: the flange]
    #[arg(long, value_name = "X,Y,Z,W,P,R", value_delimiter = ',', num_args = 1, allow_hyphen_values = true)]
    tool: Option<Vec<f64>>,
}

impl GeometryArgs {
    /// Returns the arm with its tool; without --arm the arm of the robot's description, if there is one.
    ///
    /// # Errors
    /// When a number is missing.
    pub fn arm(&self, described: Option<Dimensions>) -> Result<Arm> {
        // Longer arms are typing errors, and no path could be computed.
        for (option, numbers) in [("--arm", &self.arm), ("--tool", &self.tool)] {
            let is_real = |number: &f64| (-100_000.0..=100_000.0).contains(number);
            let wrong = numbers.iter().flatten().find(|number| !is_real(number));
            ensure!(wrong.is_none(), "{option}: give numbers between -100000 and 100000");
        }
        let mut arm = described.map_or(Arm::LR_MATE_200ID, |arm| arm.arm(Pose::IDENTITY));
        if let Some(dimensions) = &self.arm {
            let &[shoulder, upper_arm, elbow, forearm, flange] = dimensions.as_slice() else {
                bail!("--arm needs five numbers, with commas between them");
            };
            arm = Arm { shoulder, upper_arm, elbow, forearm, flange, ..arm };
        }
        if let Some(tool) = &self.tool {
            let tool = <[f64; 6]>::try_from(tool.as_slice());
            arm.tool =
                Pose::from_xyzwpr(tool.ok().context("--tool needs six numbers, with commas between them")?);
        }
        Ok(arm)
    }
}

impl ArmArgs {
    /// Returns the arm with its tool.
    ///
    /// # Errors
    /// When a number is missing.
    pub fn arm(&self, described: Option<Dimensions>) -> Result<Arm> {
        self.geometry.arm(described)
    }

    /// Reads a trajectory from its file.
    ///
    /// # Errors
    /// When it cannot be read, or is not a trajectory.
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

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum J3 {
    Horizontal,
    UpperArm,
}

/// Reads a robot description from its file.
///
/// # Errors
/// When it cannot be read, or is not a robot description.
pub fn limits(path: &Path) -> Result<Limits> {
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    Limits::from_json(&text).with_context(|| path.display().to_string())
}

/// Returns the default rules with this limit for the length of a program's name.
fn rules(name_limit: usize) -> Rules {
    let mut rules = Rules::default();
    rules.name_limit = name_limit;
    rules
}

/// Writes a program to a file, or to NAME.LS where none is given; returns its name. Unless `replaces`, NAME.LS takes no
/// other program's place.
fn write(program: &Program, rules: &Rules, out: Option<&Path>, replaces: bool) -> Result<String> {
    let text = program.to_text(rules)?;
    if out == Some(Path::new("-")) {
        stdout().write_all(text.as_bytes())?;
        return Ok("standard output".into());
    }
    let path = out.map_or_else(|| PathBuf::from(format!("{}.LS", program.name)), Path::to_path_buf);
    let keeps = out.is_none() && !replaces;
    if keeps && fs::read(&path).is_ok_and(|earlier| earlier != text.as_bytes()) {
        bail!("{} exists and is another program; --out FILE replaces a file", path.display());
    }
    files::write(&path, text.as_bytes())?;
    if !same_name(&path, &program.name) {
        remark(&format!(
            "warning: the program is named {}: the file on the controller must have the same name",
            program.name
        ));
    }
    Ok(path.display().to_string())
}

fn same_name(path: &Path, name: &str) -> bool {
    path.file_stem().is_none_or(|stem| stem.eq_ignore_ascii_case(name))
}
