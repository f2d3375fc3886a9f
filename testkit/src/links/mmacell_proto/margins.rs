//! The tolerance of the central controller for wrong assumptions about its device: its session on a virtual clock,
//! with the default settings.

use core::time::Duration;

use mmacell_proto::{Central, CentralConfig, CentralEvent, Command, Mode, Progress, RobotPose};
use robot_session::Session as _;

use crate::model::Margin;

const MS: Duration = Duration::from_millis(1);
const END: &str = "mmacell-proto central";

/// Returns the assumptions of the central controller about time.
pub fn margins() -> Vec<Margin> {
    let CentralConfig { timeout, settle, .. } = CentralConfig::DEFAULT;
    vec![
        Margin::around([END, "timeout", "a reply takes so long"], timeout, is_answered),
        Margin::around([END, "settle", "a motion begins so long after its OK"], settle, is_seen),
    ]
}

/// Returns the events when a command is answered with `reply` after the time `after`.
fn exchange(
    central: &mut Central<RobotPose>,
    at: Duration,
    command: Command<RobotPose>,
    after: Duration,
    reply: &[u8],
) -> Vec<CentralEvent<RobotPose>> {
    central.request(command).expect("it is idle");
    assert!(central.poll_transmit(at, &mut [0; 64]).is_some());
    central.handle_timeout(at + after);
    central.handle_input(at + after, reply);
    core::iter::from_fn(|| central.poll_event()).collect()
}

fn connected() -> Central<RobotPose> {
    let mut central = Central::new(CentralConfig::DEFAULT).expect("the default can work");
    central.handle_connected(Duration::ZERO);
    while central.poll_event().is_some() {}
    central
}

fn is_answered(after: Duration) -> Option<&'static str> {
    let events = exchange(&mut connected(), Duration::ZERO, Command::Stop, after, b"OK\r\n");
    (events != [CentralEvent::Done { command: Command::Stop }]).then_some("the outcome of a command is known")
}

fn is_seen(begins: Duration) -> Option<&'static str> {
    let mut central = connected();
    let pose = RobotPose::from_units([1000, 0, 0, 0]);
    let go = Command::Move { mode: Mode::Absolute, pose };
    exchange(&mut central, Duration::ZERO, go, Duration::ZERO, b"OK\r\n");
    // The status is polled until the motion begins, the last time just before.
    let times = (1..).map(|n| MS / 20 * n).take_while(|at| *at < begins);
    for at in times {
        let status = b"OKF+000.000+000.000+000.000+00.0000T+00100+00000\r\n";
        let events = exchange(&mut central, at, Command::Status, Duration::ZERO, status);
        if events
            .iter()
            .any(|event| matches!(event, CentralEvent::Status { motion: Progress::Missed(_), .. }))
        {
            return Some("a motion that begins is not missed");
        }
    }
    None
}
