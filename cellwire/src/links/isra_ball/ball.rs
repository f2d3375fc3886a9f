//! The simulated ball.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use isra_ball::{Ball, BallEvent, Packet, Status, timing};
use serde_json::{Value, json};

use super::hand::grip;
use crate::device::serve;
use crate::line::{Clock, Line};
use crate::priority::{self, Rank};
use crate::settings::Settings;
use crate::simulate::{SimulateOptions, log};

/// The ball's processor makes new values this often, which the source does not say. A poll before that gets old ones.
const MEASURING: Duration = Duration::from_millis(10);

/// What a ball has done.
#[derive(Debug, Clone, Copy, Default)]
pub struct BallCounts {
    /// Polls answered with new values.
    pub fresh: u64,
    /// Polls answered with the ones before.
    pub old: u64,
    /// Bytes that were no poll.
    pub unknown: u64,
}

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

/// Answers polls until told to stop, or until the connection is gone.
///
/// # Errors
/// When an event cannot be told.
pub fn run(
    line: &mut Line,
    clock: Clock,
    stop: &AtomicBool,
    mut tell: impl FnMut(Value) -> Result<()>,
) -> Result<BallCounts> {
    priority::raise(Rank::Hardware);
    let mut ball = Ball::new(0, 0)?;
    let mut counts = BallCounts::default();
    let mut out = [0; Packet::LEN];
    let mut next_measure = Duration::ZERO;
    let mut connected = false;
    while !stop.load(Ordering::Relaxed) && line.wait(next_measure) {
        let now = clock.now();
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
            match event {
                BallEvent::Reply(packet) if packet.status == Status::Fresh => counts.fresh += 1,
                BallEvent::Reply(_) => counts.old += 1,
                BallEvent::Unknown(byte) => {
                    counts.unknown += 1;
                    tell(json!({"event": "unknown", "byte": byte}))?;
                }
                _ => {}
            }
        }
        if line.is_connected() != connected {
            connected = line.is_connected();
            tell(json!({"event": if connected { "connected" } else { "disconnected" }}))?;
        }
    }
    Ok(counts)
}
