//! `cellwire fanuc`: the telemetry of a real robot, logged and compared with the plan; its registers, typed.

mod evaluate;
mod log;
mod variable;
mod write;

use std::io::Write;

use anyhow::Result;
use clap::{Subcommand, ValueEnum};
use fanuc_hmi_modbus::{ClientConfig, WordOrder};

use super::settings::client_help;
use crate::report::Report;
use cellwire_io::output::stdout;
use cellwire_links::fanuc_hmi_modbus::client_settings_of;
use cellwire_links::settings::Setting;

/// Reads the telemetry and registers of a FANUC controller over Modbus TCP (HMI Device Communication).
///
/// Telemetry needs a background task on the controller (`cellwire ls background` writes it) and the `$SNPX_ASG` lines that
/// map registers `R[1]` to `R[19]` to 37 Modbus registers from 0. Without a robot: `cellwire simulate fanuc --listen
/// 127.0.0.1:5020`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cellwire fanuc log 10.0.0.9:502 --csv run.csv                record a run
  cellwire fanuc log 10.0.0.9:502 --csv a.csv --limits r.json  find bad poses
  cellwire fanuc evaluate path.csv run.csv --out plots         check a run
  cellwire fanuc read 10.0.0.9:502 position --address 100      a PR[n]
  cellwire fanuc write 10.0.0.9:502 string --address 400 --size 10 '\"PART 7\"'

log waits for a controller that is off, and reconnects; a name without an address ends it at once.

Exit status of log:
  0 success   1 no samples   2 the command could not be run   3 no connection at the end
  5 implausible telemetry: its rows have a note, and the final table counts them
  7 the file could not be written

Exit status of read and write:
  0 success   1 no usable reply to a read, or the controller holds a different value after a write
  2 the command could not be run   3 the connection was lost, and nothing was written
  6 the controller refuses   8 the write may have been executed: there is no reply, or it could not be read back";

#[derive(Debug, Subcommand)]
enum Command {
    Log(log::Args),
    Evaluate(evaluate::Args),
    Read(variable::ReadArgs),
    Write(write::WriteArgs),
}

/// Executes the command; returns false if no usable value was read.
///
/// # Errors
/// When the controller cannot be reached, or a file cannot be read or written.
pub fn run(args: &Args) -> Result<bool> {
    match &args.command {
        Command::Log(args) => log::log(args),
        Command::Evaluate(args) => evaluate::evaluate(args),
        Command::Read(args) => variable::read(args),
        Command::Write(args) => write::write(args),
    }
}

/// Returns the settings of the session with the controller.
pub fn settings() -> Vec<Setting> {
    client_help(client_settings_of([ClientConfig::tcp(), ClientConfig::rtu_over_tcp()]), &USES)
}

/// The settings of the link's bytes that the commands use.
const USES: [&str; 4] = ["framing", "word_order", "unit", "address"];

/// Word order of 32-bit values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
enum OrderArg {
    LowFirst,
    HighFirst,
}

impl From<OrderArg> for WordOrder {
    fn from(order: OrderArg) -> Self {
        match order {
            OrderArg::LowFirst => Self::LowFirst,
            OrderArg::HighFirst => Self::HighFirst,
        }
    }
}

fn print(report: &Report, as_json: bool) -> Result<()> {
    let mut out = stdout();
    if as_json {
        writeln!(out, "{}", report.to_json())?
    } else {
        write!(out, "{}", report.figures())?
    }
    Ok(())
}
