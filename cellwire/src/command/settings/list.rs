//! `cellwire settings`: the settings of each command.

use std::fmt::Write as _;
use std::io::Write as _;

use anyhow::{Result, bail};
use cellwire_identify::toml_text;
use cellwire_links::Link;
use cellwire_links::settings::{self, Setting, did_you_mean};
use serde_json::Value;

use crate::command::{fanuc, modbus, run};
use crate::devices::{DEVICES, device_by_name};
use crate::{alter::operator, demo};
use cellwire_io::output::stdout;
use cellwire_io::plain;

/// Prints the settings of a command as a file for --settings
///
/// Each line is a default, after a `#`: remove the `#` and change the value.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// The command, and the link, device or robot that it names
    #[arg(required = true, num_args = 1..=2, value_names = ["COMMAND", "OF"])]
    command: Vec<String>,
}

const EXAMPLES: &str = "\
Examples:
  cellwire settings simulate fanuc >fanuc.toml
  cellwire settings run laser
  cellwire settings decode kawasaki
  cellwire settings modbus poll";

/// The commands that have settings.
const COMMANDS: [&str; 10] =
    ["decode", "encode", "tap", "replay", "demo", "simulate", "run", "alter", "modbus", "fanuc"];

/// Prints the settings of the command.
///
/// # Errors
/// If there is no such command, or if it has no settings.
pub fn run(args: &Args) -> Result<bool> {
    let (command, of) =
        (args.command.first().map_or("", String::as_str), args.command.get(1).map(String::as_str));
    let (name, settings) = of_command(command, of)?;
    if settings.is_empty() {
        bail!("`cellwire {name}` has no settings");
    }
    let text = format!("# `cellwire {name}`: settings, for --settings FILE\n{}", file(&settings));
    stdout().write_all(text.as_bytes())?;
    Ok(true)
}

/// Returns the full name of a command, and its settings.
fn of_command(command: &str, of: Option<&str>) -> Result<(String, Vec<Setting>)> {
    let link = || match of {
        Some(name) => Link::by_name(name),
        None => bail!("`cellwire settings {command}` needs the name of a link, such as fanuc"),
    };
    Ok(match command {
        "decode" | "encode" | "tap" | "replay" => {
            let link = link()?;
            (format!("{command} {}", link.short), (link.settings)())
        }
        "demo" => {
            let link = link()?;
            (format!("{command} {}", link.short), demo::settings(link.short))
        }
        "simulate" => {
            let names: Vec<&str> = DEVICES.iter().map(|device| device.name).collect();
            let Some(name) = of else {
                bail!("`cellwire settings simulate` needs a device: {}", names.join(", "))
            };
            let device = device_by_name(name)?;
            (format!("simulate {}", device.name), (device.settings)())
        }
        "run" => match of.and_then(|robot| Some((format!("run {robot}"), run::settings(robot)?))) {
            Some(found) => found,
            None => {
                let meant = did_you_mean(of.unwrap_or_default(), &["kawasaki", "laser", "mma"]);
                bail!("`cellwire settings run` needs a robot: kawasaki, laser or mma{meant}")
            }
        },
        "alter" => ("alter".into(), settings::list(operator::Settings::default())),
        "modbus" => (format!("modbus {}", of.unwrap_or("send")), modbus::settings()),
        "fanuc" => (format!("fanuc {}", of.unwrap_or("log")), fanuc::settings()),
        _ => {
            let meant = did_you_mean(command, &COMMANDS);
            bail!("`{command}` has no settings; those that have: {}{meant}", COMMANDS.join(", "))
        }
    })
}

/// Returns the settings of the devices, the runs and the bytes of a link.
pub(super) fn of_link(link: &Link) -> Vec<Setting> {
    let is_of = |name: &str| name.split('-').next() == Some(link.short);
    let devices = DEVICES.iter().filter(|device| device.is_called(link.short) || is_of(device.name));
    let devices = devices.flat_map(|device| (device.settings)());
    devices.chain(run::settings(link.short).unwrap_or_default()).chain((link.settings)()).collect()
}

/// Returns the command of the command line as an argument of `cellwire settings`, and its settings.
pub(super) fn settings_of_command_line() -> Option<(String, Vec<Setting>)> {
    let arguments: Vec<String> = std::env::args_os().filter_map(|text| text.into_string().ok()).collect();
    let (command, rest) = arguments.get(1..)?.split_first()?;
    // The first argument that the command has settings for: an option or a file may be before it.
    let named = rest.iter().filter_map(|argument| of_command(command, Some(argument)).ok()).next();
    named.or_else(|| of_command(command, None).ok())
}

/// Returns the setting of the command line's command that has the name of this option.
pub fn named(option: &str) -> Option<String> {
    let name = option.trim_start_matches('-').replace('-', "_");
    let (_, settings) = settings_of_command_line()?;
    settings.into_iter().map(|setting| setting.name).find(|setting| *setting == name)
}

/// Returns the lines of a file of settings, each after a `#`; the settings in tables come last.
fn file(settings: &[Setting]) -> String {
    let (within, own): (Vec<_>, Vec<_>) = settings.iter().partition(|it| it.name.contains('.'));
    let (mut text, mut table) = (String::new(), "");
    for setting in own.into_iter().chain(within) {
        let (of, name) = setting.name.rsplit_once('.').unwrap_or(("", &setting.name));
        if of != table {
            table = of;
            let _ = write!(text, "\n[{table}]\n");
        }
        let value = toml_value(&setting.default).unwrap_or_default();
        let space = if value.is_empty() { "" } else { " " };
        let _ = write!(text, "# {} ({})\n#{name} ={space}{value}\n", setting.about, setting.values);
    }
    text
}

/// Returns a value as TOML; `None` for null.
pub(in crate::command) fn toml_value(value: &Value) -> Option<String> {
    Some(match value {
        Value::Null => return None,
        Value::String(text) if text.is_empty() => return None,
        Value::String(text) => toml_text(text),
        Value::Array(values) => {
            let values: Option<Vec<String>> = values.iter().map(toml_value).collect();
            format!("[{}]", values?.join(", "))
        }
        Value::Object(fields) => {
            let pair = |(name, value): (&String, &Value)| Some(format!("{name} = {}", toml_value(value)?));
            let pairs: Option<Vec<String>> = fields.iter().map(pair).collect();
            format!("{{ {} }}", pairs?.join(", "))
        }
        Value::Number(number) => plain::number(number),
        Value::Bool(is) => is.to_string(),
    })
}
