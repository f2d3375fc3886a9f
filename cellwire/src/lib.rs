//! The parts of the `cellwire` tool, for its tests: the API of this library may change at any time.

#![allow(clippy::std_instead_of_core, reason = "the tool is a program with std")]

pub mod alter;
pub mod command;
pub mod demo;
pub mod devices;
mod fine;
pub mod io;
pub mod report;
pub mod run;
pub mod telemetry;

use std::env;
use std::process::ExitCode;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

use self::command::{
    capture, decode, encode, extcap, fanuc, identify, ls, modbus, ports, replay, settings, simulate, tap,
    vectors,
};
use self::io::journal::JournalWriteError;
use self::telemetry::Implausible;
use cellwire_io::bar;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::output::{self, remark};
use cellwire_io::{files, manual};

/// Tests robot links without a robot, and runs jobs on real ones
#[derive(Parser)]
#[command(version, propagate_version = true, max_term_width = 80, after_help = ENDING)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

/// The first part of the output of `cellwire --help`.
const HELP: &str = "\
Tests robot links without a robot, and runs jobs on real ones

Usage: cellwire <COMMAND>

Try it; nothing else is needed
  demo      Run every link against its simulated robot
  simulate  Be a robot that your own program talks to

Look at a link
  ports     List the serial ports of this machine
  tap       Show and record what two ends say: in between, or only listening
  identify  Find out which link a recording is, and its settings
  decode    Turn bytes or a recording into messages, one JSON object per line
  encode    Turn messages into bytes
  replay    Play one end of a recording against your program

Work with a machine
  run       Run a file of jobs on a kawasaki, laser or mma, each job once
  alter     Steer an arm with a ball, a 3D mouse, a game pad or the keyboard
  fanuc     Log a FANUC's telemetry, compare it; read and write variables
  modbus    Send Modbus requests; scan for units; poll values
  ls        Check, edit, make and simulate FANUC LS programs

About cellwire
  settings  Print the settings of a command as a file for --settings
  help      Explain a command, such as: cellwire help run laser

Links: kawasaki, alter, viewer, ball, fanuc, laser, mma; or their crates' names
Also: capture, certificates, completions, extcap, man, vectors

Options:
  -h, --help     Print this; after a command -h is short, --help is all of it
  -V, --version  Print the version
";

const ENDING: &str = "\
Examples:
  cellwire demo laser --out sheet.svg
  cellwire simulate fanuc --listen 5020
  cellwire decode kawasaki monday.pcapng
  cellwire run laser part.nc --dry-run --picture part.svg

Exit status:
  0 done   1 a check failed, or stopped   2 not begun   3 the connection is lost
  4 standard output could not be written   5 implausible telemetry
  6 a Modbus server refused   7 a file could not be written
  8 a request may have been executed   130 ended by a signal";

#[derive(Subcommand)]
enum Command {
    Demo(command::demo::Args),
    Decode(decode::Args),
    Encode(encode::Args),
    Identify(identify::Args),
    Simulate(simulate::Args),
    Tap(tap::Args),
    Replay(replay::Args),
    #[command(hide = true)]
    Capture(capture::Args),
    #[command(hide = true)]
    Extcap(extcap::Args),
    Modbus(modbus::Args),
    Ports(ports::Args),
    Fanuc(fanuc::Args),
    Run(command::run::Args),
    Ls(ls::Args),
    #[command(hide = true)]
    Vectors(vectors::Args),
    Alter(command::alter::Args),
    Settings(settings::Args),
    #[command(hide = true)]
    Certificates(command::certificates::Args),
    #[command(hide = true)]
    Completions(manual::Completions),
    #[command(hide = true)]
    Man(manual::Man),
}

/// Runs the command. Exit status: 0 success, 1 corrupt input or a failed check, 2 the command could not be run, 3 a
/// connection was lost, 4 standard output could not be written, or the run stopped as it was closed, 5 implausible telemetry
/// was recorded, 6 a Modbus server refused a request, 7 a journal, a table or a recording could not be written, 8 a Modbus
/// server may have executed a request without a reply.
pub fn main() -> ExitCode {
    #[cfg(windows)]
    cellwire_io::windows::exact_waits();
    let outcome = match parse().command {
        Command::Demo(args) => command::demo::run(&args),
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
        Command::Run(args) => command::run::run(&args),
        Command::Ls(args) => ls::run(&args),
        Command::Vectors(args) => vectors::run(&args),
        Command::Alter(args) => command::alter::run(&args),
        Command::Settings(args) => settings::run(&args),
        Command::Certificates(args) => command::certificates::run(&args),
        Command::Completions(args) => manual::completions(args.shell, command_line()).map(|()| true),
        Command::Man(args) => manual::man(&args.folder, command_line()).map(|()| true),
    };
    bar::clear_bar();
    let status = match outcome.map_err(settings::located) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) if output::is_closed(&error) => ExitCode::SUCCESS, // `cellwire decode … | head`
        Err(error) => {
            remark(&format!("error: {error:#}"));
            ExitCode::from(match () {
                () if error.is::<modbus::Unknown>() => 8,
                () if error.is::<ConnectionLost>() => 3,
                () if output::is_unwritten(&error) => 4,
                () if error.is::<Implausible>() => 5,
                () if error.is::<modbus::RefusedRequest>() => 6,
                () if error.is::<JournalWriteError>() || error.is::<files::FileWriteError>() => 7,
                () => 2,
            })
        }
    };
    output::finish();
    status
}

fn parse() -> Cli {
    let matches = command_line().try_get_matches().map_err(|mut error| {
        let words: Vec<String> = env::args().skip(1).collect();
        suggest(&mut error, &words);
        error
    });
    match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => cli,
        Err(error) => error.exit(),
    }
}

/// Adds the probable meaning of these words of the command line to an error: clap suggests names with a similar spelling.
fn suggest(error: &mut clap::Error, words: &[String]) {
    let (is_help, words) = match words.split_first() {
        Some((first, others)) if first == "help" => (true, others),
        _ => (false, words),
    };
    let mut line = command_line();
    line.build();
    let (mut command, mut path) = (&line, String::new());
    for word in words {
        let Some(inner) = command.find_subcommand(word) else { break };
        (command, path) = (inner, format!("{path} {word}"));
    }
    let tip = |tip: String| ContextValue::StyledStrs(vec![tip.into()]);
    match (error.get(ContextKind::InvalidSubcommand), error.get(ContextKind::InvalidArg)) {
        (Some(ContextValue::String(name)), _) if is_help && command.get_positionals().next().is_some() => {
            let settings = format!("`cellwire settings{path} {name}` prints its settings");
            let about = tip(format!("`cellwire help{path}` explains {name}; {settings}"));
            error.insert(ContextKind::Suggested, about);
        }
        (Some(ContextValue::String(name)), _) => {
            let command = match name.as_str() {
                "laser" | "mma" | "kawasaki" => format!("run {name}"),
                "read" | "write" => "send".to_owned(),
                "draw" => "run".to_owned(),
                _ => return,
            };
            error.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![command]));
        }
        (_, Some(ContextValue::String(name))) if error.kind() == ErrorKind::UnknownArgument => {
            let has = |long: &str| command.get_arguments().any(|it| it.get_long() == Some(long));
            let name = name.clone();
            error.remove(ContextKind::Suggested); // "to pass '--name' as a value, use '-- --name'"
            if matches!(name.as_str(), "--connect" | "--tcp" | "--port") && has("serial") && !has("connect") {
                error.remove(ContextKind::SuggestedArg);
                error.insert(ContextKind::Suggested, tip("--serial takes HOST:PORT too".to_owned()));
            } else if let Some(setting) = settings::named(&name)
                && has("set")
            {
                error.remove(ContextKind::SuggestedArg);
                error.insert(ContextKind::Suggested, tip(format!("it is a setting: --set {setting}=VALUE")));
            }
            error.insert(ContextKind::Usage, ContextValue::StyledStr(command.clone().render_usage()));
        }
        _ => {}
    }
}

/// Returns the command line.
fn command_line() -> clap::Command {
    Cli::command().override_help(format!("{HELP}\n{ENDING}\n"))
}

#[cfg(test)]
mod tests {
    use cellwire_links::LINKS;
    use clap::CommandFactory as _;

    use super::Cli;
    use super::devices::DEVICES;

    fn values(command: &clap::Command, add: &mut dyn FnMut(String)) {
        let possible = command.get_arguments().flat_map(clap::Arg::get_possible_values);
        possible.for_each(|value| add(value.get_name().to_owned()));
        command.get_subcommands().for_each(|inner| values(inner, add));
    }

    #[test]
    fn a_value_is_spelled_alike_as_an_option_and_as_a_setting() {
        let settings = LINKS.iter().flat_map(|link| (link.settings)());
        let settings = settings.chain(DEVICES.iter().flat_map(|device| (device.settings)()));
        let choices: Vec<String> =
            settings.flat_map(|it| it.choices).filter_map(|it| it.as_str().map(str::to_owned)).collect();
        let (mut seen, mut other) = (0, Vec::new());
        values(&Cli::command(), &mut |value| {
            seen += usize::from(choices.contains(&value));
            let spelled = value.replace('-', "_");
            if spelled != value && choices.contains(&spelled) {
                other.push(value);
            }
        });
        assert_eq!(other, [""; 0]);
        assert!(seen > 0, "{choices:?}");
    }
}
