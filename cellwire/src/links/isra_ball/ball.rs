//! The simulated ball.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use isra_ball::robot_session::Session as _;
use isra_ball::{Ball, BallConfig, BallEvent, BallStatistics, Packet, timing};
use serde_json::{Value, json};

use super::hand::grip;
use crate::device::serve;
use crate::line::{Clock, Line};
use crate::priority::{self, Rank};
use crate::settings::Settings;
use crate::simulate::{SimulateOptions, log};

/// The ball's processor makes new values this often, which the source does not give. A poll before that gets old ones.
const MEASURING: Duration = Duration::from_millis(10);

/// `cellwire simulate ball`.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let baud = Settings::new("ball", &options.settings, &["baud"])?.baud(timing::BAUD)?;
    serve("ball", "ball", options, baud, |line, clock| {
        run(line, clock, &AtomicBool::new(false), |event| log(&event))?;
        Ok(())
    })
}

/// Answers polls until it is to stop, or until the connection is gone.
///
/// # Errors
/// When an event cannot be logged.
pub fn run(
    line: &mut Line,
    clock: Clock,
    stop: &AtomicBool,
    mut report: impl FnMut(Value) -> Result<()>,
) -> Result<BallStatistics> {
    priority::raise(Rank::Hardware);
    let mut ball = Ball::new(BallConfig::default())?;
    let mut out = [0; Packet::LEN];
    let mut next_measure = Duration::ZERO;
    let mut connected = false;
    while !stop.load(Ordering::Relaxed) && line.wait(next_measure) {
        let now = clock.now();
        if line.is_connected() != connected {
            connected = line.is_connected();
            if connected {
                ball.handle_connected(now)
            } else {
                ball.handle_disconnected(now)
            }
            report(json!({"event": if connected { "connected" } else { "disconnected" }}))?;
        }
        if now >= next_measure {
            let grip = grip(now);
            ball.measure(grip.force, grip.moment, grip.keys);
            next_measure = now + MEASURING;
        }
        while let Some((at, byte)) = line.receive() {
            ball.handle_input(at, &[byte]);
        }
        if ball.poll_transmit(now, &mut out).is_some() {
            line.send(&out);
        }
        while let Some(event) = ball.poll_event() {
            if let BallEvent::Unknown(byte) = event {
                report(json!({"event": "unknown", "byte": byte}))?;
            }
        }
    }
    Ok(ball.statistics())
}
