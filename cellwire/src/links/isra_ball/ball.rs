//! The simulated ball.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use isra_ball::{Ball, BallConfig, BallEvent, BallStatistics};
use robot_session::{Driver, Session as _, Transport as _};
use serde_json::{Value, json};

use super::hand::grip;
use super::options::BallSettings;
use crate::io::drive::turn;
use crate::io::line::Line;
use crate::io::output::log;
use crate::io::priority::{self, Rank};
use crate::links::device::SimulateOptions;
use crate::links::device::serve;
use cellwire_links::settings;

/// The ball's processor makes new values this often, which the source does not give. A poll before that gets old ones.
const MEASURING: Duration = Duration::from_millis(10);

/// `cellwire simulate ball`.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("ball", BallSettings::default(), &options.settings)?;
    serve("ball", "ball", options, settings.baud, |line, _| {
        run(line, settings.config, &AtomicBool::new(false), |event| log(&event))?;
        Ok(())
    })
}

/// Answers polls until it is to stop, or until the connection is gone.
///
/// # Errors
/// When an event cannot be logged.
pub fn run(
    line: &mut Line,
    config: BallConfig,
    stop: &AtomicBool,
    mut report: impl FnMut(Value) -> Result<()>,
) -> Result<BallStatistics> {
    priority::raise(Rank::Hardware);
    let mut ball = Ball::new(config)?;
    let mut driver = Driver::new(line);
    let mut next_measure = Duration::ZERO;
    let mut connected = false;
    while !stop.load(Ordering::Relaxed) {
        let now = driver.transport_mut().now();
        if driver.transport_mut().is_connected() != connected {
            connected = !connected;
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
        let wait = Some(next_measure.saturating_sub(now));
        let goes_on = turn(&mut driver, &mut ball, wait, |_, event| match event {
            BallEvent::Unknown(byte) => report(json!({"event": "unknown", "byte": byte})),
            _ => Ok(()),
        })?;
        if !goes_on {
            break;
        }
    }
    Ok(ball.statistics())
}
