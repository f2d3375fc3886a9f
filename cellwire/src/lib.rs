//! The parts of the `cellwire` tool: it and `cellwire-bridge` are the only crates of the workspace that open a socket or a port.
//!
//! This is a library only for its tests and for `cellwire-bridge`. The tool is the interface; the API of this library may change at any time.

#![allow(clippy::std_instead_of_core, reason = "the tool is a program with std")]

pub mod cell;
pub mod command;
pub mod io;
pub mod links;

use std::process::ExitCode;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use self::cell::telemetry::plausibility::Implausible;
use self::command::{
    alter, capture, decode, demo, encode, extcap, fanuc, identify, ls, manual, modbus, ports, replay, run,
    settings, simulate, tap, vectors,
};
use self::io::drive::Lost;
use self::io::files;
use self::io::journal::Unwritten;
use self::io::output::{self, remark};
use cellwire_links::settings::Setting;

/// Tests robot links without a robot: runs them end to end, reads and writes their bytes, and simulates the devices.
///
/// LINK is the name of a link's crate, such as kawasaki-msg. Bytes are hex unless --format selects another form; messages are
/// JSON objects, one per line, so that decode, jq and encode can be combined in a pipe.
#[derive(Parser)]
#[command(version, propagate_version = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
Examples:
  cellwire demo                                        every link end to end, one table each
  cellwire demo kawasaki-msg --faults --out drawn.svg  a picture drawn over a connection that breaks
  cellwire decode kawasaki-msg --format raw capture    the messages, one JSON object per line
  cellwire identify --format pcap capture.pcapng       which link it is, and which options match the bytes
  cellwire ls make path.csv --mode dynamic             a robot program of spline moves from a trajectory
  cellwire alter --robot /dev/ttyS0 --ball /dev/ttyS1  the operator's screen of a teleoperation cell; COM1, COM2 on Windows
  cellwire ports                                       the serial ports of this machine, with their adapters
  cellwire simulate kawasaki-pc --listen 127.0.0.1:9105   a PC to test a robot against

Exit status:
  0 success   1 corrupt input, or a failed check   2 the command could not be run
  3 a connection was lost   4 standard output was closed, or could not be written
  5 implausible telemetry was recorded   6 a Modbus server refused a request
  7 a journal, a table or a recording could not be written
  8 a Modbus server may have executed a request without a reply   130 a signal ended the command";

#[derive(Subcommand)]
enum Command {
    Demo(demo::Args),
    Decode(decode::Args),
    Encode(encode::Args),
    Identify(identify::Args),
    Simulate(simulate::Args),
    Tap(tap::Args),
    Replay(replay::Args),
    Capture(capture::Args),
    Extcap(extcap::Args),
    Modbus(modbus::Args),
    Ports(ports::Args),
    Fanuc(fanuc::Args),
    Run(run::Args),
    Ls(ls::Args),
    Vectors(vectors::Args),
    Alter(alter::Args),
    Completions(manual::Completions),
    Man(manual::Man),
}

/// Runs the command. Exit status: 0 success, 1 corrupt input or a failed check, 2 the command could not be run, 3 a connection was
/// lost, 4 standard output could not be written, or the run stopped as it was closed, 5 implausible telemetry was recorded, 6 a Modbus server refused a request,
/// 7 a journal, a table or a recording could not be written, 8 a Modbus server may have executed a request without a reply.
pub fn main() -> ExitCode {
    #[cfg(windows)]
    io::windows::exact_waits();
    let outcome = match parse().command {
        Command::Demo(args) => demo::run(&args),
        Command::Decode(args) => decode::run(&args),
        Command::Encode(args) => encode::run(&args),
        Command::Identify(args) => identify::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Tap(args) => tap::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Capture(args) => capture::run(&args),
        Command::Extcap(args) => extcap::run(&args),
        Command::Modbus(args) => modbus::run(&args),
        Command::Ports(args) => ports::run(&args),
        Command::Fanuc(args) => fanuc::run(&args),
        Command::Run(args) => run::run(&args),
        Command::Ls(args) => ls::run(&args),
        Command::Vectors(args) => vectors::run(&args),
        Command::Alter(args) => alter::run(&args),
        Command::Completions(args) => manual::completions(args.shell, command_line()).map(|()| true),
        Command::Man(args) => manual::man(&args.folder, command_line()).map(|()| true),
    };
    let status = match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) if output::is_closed(&error) => ExitCode::SUCCESS, // `cellwire decode … | head`
        Err(error) => {
            remark(&format!("error: {error:#}"));
            ExitCode::from(match () {
                () if error.is::<modbus::Unknown>() => 8,
                () if error.is::<Lost>() => 3,
                () if error.is::<output::Unwritten>() => 4,
                () if error.is::<Implausible>() => 5,
                () if error.is::<modbus::Refused>() => 6,
                () if error.is::<Unwritten>() || error.is::<files::Unwritten>() => 7,
                () => 2,
            })
        }
    };
    output::finish();
    status
}

fn parse() -> Cli {
    match Cli::from_arg_matches(&command_line().get_matches()) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    }
}

/// Makes the settings of a command.
type Settings = fn() -> Vec<Setting>;

/// The command line; the help of a command lists the settings of the link or device that is named beside it. What no argument names is
/// left as it is derived: a start would take twice as long.
fn command_line() -> clap::Command {
    let arguments: Vec<String> = std::env::args_os().filter_map(|text| text.into_string().ok()).collect();
    let mut command = Cli::command();
    // The manual has a page for each.
    let named = |name| arguments.iter().any(|argument| argument == name || argument == "man");
    for name in ["decode", "encode", "tap", "replay", "simulate", "demo", "alter"] {
        if named(name) {
            command = command.mut_subcommand(name, |it| it.after_long_help(settings::help(name, &arguments)));
        }
    }
    let settings: [(&str, &str, Settings); 9] = [
        ("run", "kawasaki", || run::settings("kawasaki")),
        ("run", "laser", || run::settings("laser")),
        ("run", "mma", || run::settings("mma")),
        ("modbus", "send", modbus::settings),
        ("modbus", "scan", modbus::settings),
        ("modbus", "poll", modbus::settings),
        ("fanuc", "log", fanuc::settings),
        ("fanuc", "read", fanuc::settings),
        ("fanuc", "write", fanuc::settings),
    ];
    for (name, inner, settings) in settings.into_iter().filter(|(name, inner, _)| named(name) && named(inner))
    {
        command =
            command.mut_subcommand(name, |it| it.mut_subcommand(inner, |it| with_settings(it, &settings())));
    }
    command
}

/// The command, whose long help ends with these settings.
fn with_settings(command: clap::Command, settings: &[Setting]) -> clap::Command {
    let before = command.get_after_help().map(|text| format!("{text}\n\n")).unwrap_or_default();
    // Those of the command itself come first: a plant's tables are long.
    let (tables, own): (Vec<_>, Vec<_>) =
        settings.iter().cloned().partition(|it| it.name.contains('.') || it.name == "job");
    let (own, tables) = (settings::lines(&own), settings::lines(&tables));
    let between = if own.is_empty() || tables.is_empty() {
        ""
    } else {
        "\nIn tables, for a settings file rather than --set:\n\n"
    };
    command.after_long_help(format!("{before}Settings, for --set and --settings:\n\n{own}{between}{tables}"))
}
