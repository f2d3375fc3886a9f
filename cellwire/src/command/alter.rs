//! `cellwire alter`: the operator's screen of the teleoperation host.

use std::io::IsTerminal;

use anyhow::{Result, ensure};
use val2_alter::{Accumulation, Mode};

use crate::cell::operator;
use crate::cell::teleop::latch::LatchConfig;
use crate::cell::teleop::{LIMITS, PortConfig, Profile, TeleopConfig, Traces, host_config, polls};
use crate::io::trace::TraceArgs;
use crate::io::{interrupt, serial};

/// Steers a robot with a control ball over ALTER: the operator's screen.
///
/// Space and Esc stop the arm, whatever is shown: its values go to zero, and ALTER ends. A answers the robot's ALTER, V refuses it;
/// K tests the ball, W the workstation, T the ports at several baud rates; O has the options (ports, ball type, the last bytes of
/// each line, display, gripper); Q quits. Ctrl-C and signals come to rest first; a second one ends at once.
///
/// The hand moves the arm only when it is armed: after a start, an interruption, a stop, old values or a lost input it must
/// rest for 0.3 s first.
///
/// Neither the screen nor the disk delays a reply. Try it against `cellwire simulate puma`, `simulate ball` and `simulate viewer`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The robot controller's port
    #[arg(long, value_name = "PORT")]
    robot: String,
    /// The control ball's port
    #[arg(long, value_name = "PORT")]
    ball: String,
    /// The graphics workstation's port
    #[arg(long, value_name = "PORT")]
    viewer: Option<String>,
    /// The baud rate of the robot's port
    #[arg(long, value_name = "N", default_value_t = val2_alter::timing::BAUD, value_parser = serial::baud_rate())]
    robot_baud: u32,
    /// The mode of the robot's ALTER instruction: another one is refused
    #[arg(long, value_name = "N", default_value_t = Mode::CUMULATIVE_23.0, value_parser = clap::value_parser!(u8).range(0..=31))]
    mode: u8,
    /// The baud rate of the ball's port
    #[arg(long, value_name = "N", default_value_t = isra_ball::timing::BAUD, value_parser = serial::baud_rate())]
    ball_baud: u32,
    /// The baud rate of the workstation's port
    #[arg(long, value_name = "N", default_value_t = val2_viewer::timing::BAUD, value_parser = serial::baud_rate())]
    viewer_baud: u32,
    /// The speed that full force asks for, in percent of 100 mm/s and 30 °/s
    #[arg(long, value_name = "PERCENT", default_value_t = 100, value_parser = clap::value_parser!(u16).range(1..=100))]
    speed: u16,
    /// The robot's program names a subroutine for the gripper: keys 1 and 2 of the ball close and open it
    #[arg(long)]
    clamp: bool,
    /// Enter has to confirm that the hand may move the arm, each time that it has rested; always so in non-cumulative modes
    #[arg(long)]
    confirm: bool,
    /// The arm moves only while a key of the input is held
    #[arg(long)]
    hold_to_run: bool,
    /// The key for --hold-to-run
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u8).range(1..=32))]
    hold_key: u8,
    #[command(flatten)]
    trace: TraceArgs,
}

/// Runs until the operator quits.
///
/// # Errors
/// When there is no terminal, or a port cannot be opened.
pub fn run(args: &Args) -> Result<bool> {
    ensure!(std::io::stdout().is_terminal(), "the operator's screen needs a terminal");
    let config = TeleopConfig {
        robot: PortConfig { path: args.robot.clone(), baud: args.robot_baud },
        ball: PortConfig { path: args.ball.clone(), baud: args.ball_baud },
        viewer: args.viewer.clone().map(|path| PortConfig { path, baud: args.viewer_baud }),
        alter: val2_alter::HostConfig {
            baud: args.robot_baud,
            mode: Mode(args.mode),
            limits: LIMITS,
            subroutine: args.clamp,
            policy: val2_alter::Policy::Ignore,
            ..host_config()
        },
        polls: polls(args.ball_baud),
        profile: Profile { hold_key: args.hold_key, ..Profile::for_limits(LIMITS, args.speed) },
        latch: LatchConfig {
            // Armed, the arm leaves the offset that it holds.
            confirm: args.confirm || Mode(args.mode).accumulation() == Accumulation::NonCumulative,
            hold_to_run: args.hold_to_run,
            ..LatchConfig::default()
        },
    };
    let start = |name| args.trace.start_kept(name);
    let traces =
        Traces { robot: start("host-robot"), ball: start("host-ball"), viewer: start("host-viewer") };
    if !operator::run(config, traces)? {
        std::process::exit(interrupt::INTERRUPTED);
    }
    Ok(true)
}
