//! `cellwire alter`: the operator's screen of the teleoperation host.

use std::io::IsTerminal;
use std::path::PathBuf;

use anyhow::{Context as _, Result, ensure};
use cellwire_motion::latch::LatchConfig;
use val2_alter::Accumulation;

use super::settings::SetArgs;
use crate::alter::input::InputConfig;
use crate::alter::operator::{self, Settings};
use crate::alter::{PortConfig, TeleopConfig, Traces};
use cellwire_io::trace::TraceArgs;
use cellwire_io::{input, interrupt, serial};
use cellwire_links::settings;

/// Steers a robot over ALTER with a control ball, a 3D mouse, a game pad or the keyboard: the operator's screen.
///
/// Space and Esc stop the arm on every screen: its values go to zero, and ALTER ends. A accepts the robot's ALTER, V refuses it;
/// K tests the ball, W the workstation, T the ports at several baud rates; O has the options (ports, the last bytes of
/// each line, display, gripper, input profile); Q quits. Ctrl-C and signals bring the arm to rest first; a second one ends
/// at once.
///
/// The hand moves the arm only when armed: after a start, an interruption, a stop, stale values or a lost input it must
/// be released for 0.3 s first.
///
/// The screen and the disk never delay a reply. Try it with `cellwire simulate puma`, `simulate ball` and `simulate viewer`.
#[derive(Debug, clap::Args)]
#[command(override_usage = USAGE)]
pub struct Args {
    /// The robot controller's port
    #[arg(long, value_name = "PORT")]
    robot: String,
    #[command(flatten)]
    input: InputArgs,
    /// Record the input to this file while ALTER runs, for --play
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// The graphics workstation's port
    #[arg(long, value_name = "PORT")]
    viewer: Option<String>,
    /// The baud rate of the workstation's port
    #[arg(long, value_name = "N", default_value_t = val2_viewer::timing::BAUD, value_parser = serial::baud_rate())]
    viewer_baud: u32,
    /// Require Enter before the hand moves the arm, each time it has rested; always on in non-cumulative modes
    #[arg(long)]
    confirm: bool,
    /// The arm moves only while a key of the input is held: the setting profile.hold_key
    #[arg(long)]
    hold_to_run: bool,
    /// A TOML file with the input profile: dead zone, gain, filter, axes; see the settings of profile below
    #[arg(long, value_name = "FILE")]
    profile: Option<PathBuf>,
    #[command(flatten)]
    set: SetArgs,
    #[command(flatten)]
    trace: TraceArgs,
}

const USAGE: &str = "\
cellwire alter [OPTIONS] --robot <PORT> --ball <PORT>
       cellwire alter [OPTIONS] --robot <PORT> --keyboard|--spacenav|--hid
       cellwire alter [OPTIONS] --robot <PORT> --evdev <DEVICE>|--play <FILE>";

/// The device that moves the hand.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct InputArgs {
    /// The port of the ISRA control ball
    #[arg(long, value_name = "PORT")]
    ball: Option<String>,
    /// The keyboard: arrows X and Y, page up and down Z, with Shift rotations about these axes, Home and End RZ; a key acts
    /// while it repeats
    #[arg(long)]
    keyboard: bool,
    /// A 3Dconnexion device, through the socket of spacenavd
    #[arg(long, value_name = "SOCKET", num_args = 0..=1, default_missing_value = "/var/run/spnav.sock")]
    spacenav: Option<PathBuf>,
    /// A 3Dconnexion device as a HID device, on every platform: the only one, or the one with NAME in its name or path
    #[arg(long, value_name = "NAME", num_args = 0..=1, default_missing_value = "")]
    hid: Option<String>,
    /// A game pad, a joystick or a 3D mouse of the Linux input system, such as /dev/input/by-id/…-event-joystick
    #[arg(long, value_name = "DEVICE")]
    evdev: Option<PathBuf>,
    /// A recording of --record, played from the start of ALTER
    #[arg(long, value_name = "FILE")]
    play: Option<PathBuf>,
}

impl InputArgs {
    fn config(&self, baud: u32) -> InputConfig {
        match self {
            Self { ball: Some(path), .. } => InputConfig::Ball(PortConfig { path: path.clone(), baud }),
            Self { spacenav: Some(path), .. } => InputConfig::Spacenav(path.clone()),
            Self { hid: Some(name), .. } => InputConfig::Hid(name.clone()),
            Self { evdev: Some(path), .. } => InputConfig::Evdev(path.clone()),
            Self { play: Some(path), .. } => InputConfig::Play(path.clone()),
            Self { .. } => InputConfig::Keyboard,
        }
    }
}

impl Args {
    /// Returns the settings of the profile, overridden by the given ones.
    fn settings(&self) -> Result<Settings> {
        let mut settings = Settings::default();
        if let Some(file) = &self.profile {
            let given = toml::from_str(&input::text(file)?)
                .with_context(|| format!("{} is not valid TOML", file.display()))?;
            settings.profile = settings::read("a profile", settings.profile, &given)?;
        }
        settings = settings::read("alter", settings, &self.set.read(&settings::list(settings))?)?;
        settings.profile.limits = settings.alter.limits;
        Ok(settings)
    }
}

/// Runs until the operator quits.
///
/// # Errors
/// If there is no terminal, a port cannot be opened, or a setting has no such value.
pub fn run(args: &Args) -> Result<bool> {
    ensure!(std::io::stdout().is_terminal(), "the operator's screen needs a terminal");
    let Settings { alter, polls, viewer, profile } = args.settings()?;
    let config = TeleopConfig {
        robot: PortConfig { path: args.robot.clone(), baud: alter.baud },
        input: args.input.config(polls.baud),
        record: args.record.clone(),
        viewer: args.viewer.clone().map(|path| PortConfig { path, baud: args.viewer_baud }),
        viewer_host: viewer,
        latch: LatchConfig {
            // Armed, the arm leaves the offset that it holds.
            confirm: args.confirm || alter.mode.accumulation() == Accumulation::NonCumulative,
            hold_to_run: args.hold_to_run,
            ..LatchConfig::default()
        },
        alter,
        polls,
        profile,
    };
    let start = |name| args.trace.start_kept(name);
    let traces =
        Traces { robot: start("host-robot"), ball: start("host-ball"), viewer: start("host-viewer") };
    if !operator::run(config, traces)? {
        std::process::exit(interrupt::INTERRUPTED);
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use val2_alter::Mode;

    use super::Args;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn a_setting_overrides_the_profile() {
        let folder = tempfile::tempdir().unwrap();
        let (profile, settings) = (folder.path().join("hand.toml"), folder.path().join("alter.toml"));
        std::fs::write(&profile, "speed = 20\nhold_key = 3").unwrap();
        std::fs::write(&settings, "mode = 5\nbaud = 19200").unwrap();
        let files = ["--profile", profile.to_str().unwrap(), "--settings", settings.to_str().unwrap()];
        let read = |options: &[&str]| {
            let words = ["alter", "--robot", "r", "--keyboard"].iter().chain(&files).chain(options);
            Command::try_parse_from(words).unwrap().args.settings().unwrap()
        };
        let found = read(&[]);
        assert_eq!((found.profile.speed, found.profile.hold_key), (20, 3));
        assert_eq!((found.alter.mode, found.alter.baud), (Mode(5), 19_200));
        let found = read(&["--set", "profile.speed=5", "--set", "mode=23", "--set", "baud=9600"]);
        assert_eq!((found.profile.speed, found.profile.hold_key), (5, 3));
        assert_eq!((found.alter.mode, found.alter.baud), (Mode(23), 9600));
    }
}
