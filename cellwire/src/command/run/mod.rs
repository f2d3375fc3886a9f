//! `cellwire run`: a file of jobs on a robot, each job once.

mod kawasaki;
mod laser;
mod mma;
mod work;

use anyhow::Result;
use clap::Subcommand;

use cellwire_links::settings::Setting;

/// Runs a file of jobs on a robot, each job once
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cellwire run laser part.nc --dry-run --picture part.svg
  cellwire run kawasaki logo.svg --listen 192.168.0.2:9105
  cellwire run mma plate.toml --robot 192.168.0.1:2001 --platform 192.168.0.2:2002

After any interruption the same command goes on: a journal beside the file has
the outcome of each job.";

#[derive(Debug, Subcommand)]
enum Command {
    Kawasaki(kawasaki::Args),
    Laser(laser::Args),
    Mma(mma::Args),
}

/// Returns true when every job is done.
///
/// # Errors
/// When the file or a setting is refused, a device cannot be reached, a connection is lost, or the journal cannot be written.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Command::Kawasaki(args) => kawasaki::run(args),
        Command::Laser(args) => laser::run(args),
        Command::Mma(args) => mma::run(args),
    }
}

/// Returns the settings of a run on this robot; `None` if there is no such robot.
pub fn settings(robot: &str) -> Option<Vec<Setting>> {
    Some(match robot {
        "kawasaki" => kawasaki::settings(),
        "laser" => laser::settings(),
        "mma" => mma::settings(),
        _ => return None,
    })
}
