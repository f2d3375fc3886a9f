//! `cellwire alter`: the operator's screen of the teleoperation host.

use std::io::IsTerminal;

use anyhow::{Result, ensure};
use val2_alter::Mode;

use crate::cell::operator;
use crate::cell::teleop::{LIMITS, Mapping, PortConfig, TeleopConfig, Traces, host_config};
use crate::io::serial;
use crate::io::trace::TraceArgs;

/// Steers a robot with a control ball over ALTER: the operator's screen.
///
/// Keys: A answers the robot's ALTER and Esc comes to rest and ends it, V refuses it; K tests the ball, W the workstation, T the
/// ports at several baud rates; O has the options (ports, ball type, the last bytes of each line, display, gripper); Q quits.
///
/// The screen is drawn by a thread of its own and never delays a reply. Try it against `cellwire simulate puma`, `simulate
/// ball` and `simulate viewer`.
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
        polls: isra_ball::HostConfig { baud: args.ball_baud, ..isra_ball::HostConfig::default() },
        mapping: Mapping::for_limits(&LIMITS, args.speed),
    };
    let start = |name| args.trace.start_kept(name);
    let traces =
        Traces { robot: start("host-robot"), ball: start("host-ball"), viewer: start("host-viewer") };
    operator::run(config, traces)?;
    Ok(true)
}
