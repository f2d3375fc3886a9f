//! The simulated graphics workstation: draws the arm five times a second, each picture from one packet.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use robot_session::{Driver, Session as _, Transport as _};
use serde_json::{Value, json};
use val2_viewer::{PosePacket, Workstation, WorkstationConfig, WorkstationEvent, timing};

use super::options::ViewerSettings;
use crate::io::drive::turn;
use crate::io::line::Line;
use crate::io::output::log;
use crate::io::priority::{self, Rank};
use crate::links::device::SimulateOptions;
use crate::links::device::serve;
use cellwire_links::settings;

/// What a workstation has seen.
#[derive(Debug, Clone, Copy, Default)]
pub struct Drawn {
    /// Requests sent.
    pub asked: u64,
    /// Poses received.
    pub poses: u64,
    /// Poses that never came, by the gaps in their count.
    pub gaps: u64,
    /// Corrupt lines, or pieces of one.
    pub damaged: u64,
    /// Times that the picture was stale.
    pub stale: u64,
    /// Times that the operator paused a picture that stood still, which makes it ask again (§9.4).
    pub pauses: u64,
    /// The most poses that came between two pictures: more than one is a backlog.
    pub most_at_once: u64,
}

/// `cellwire simulate viewer`.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("viewer", ViewerSettings::default(), &options.settings)?;
    serve("viewer", "viewer", options, settings.baud, |line, _| {
        run(line, settings.config, &AtomicBool::new(false), |event| log(&event))?;
        Ok(())
    })
}

/// Draws until it is to stop, or until the connection is gone.
///
/// # Errors
/// When an event cannot be logged.
pub fn run(
    line: &mut Line,
    config: WorkstationConfig,
    stop: &AtomicBool,
    mut report: impl FnMut(Value) -> Result<()>,
) -> Result<Drawn> {
    priority::raise(Rank::Hardware);
    let mut workstation = Workstation::new(config)?;
    let mut driver = Driver::new(line);
    let (mut drawn, mut last_count, mut at_once) = (Drawn::default(), None, 0);
    let (mut connected, mut picture, mut moved) = (false, Duration::ZERO, Duration::ZERO);
    while !stop.load(Ordering::Relaxed) {
        let now = driver.transport_mut().now();
        if driver.transport_mut().is_connected() != connected {
            connected = !connected;
            if connected {
                workstation.handle_connected(now);
                moved = now;
            } else {
                workstation.handle_disconnected(now);
            }
        }
        if now >= picture {
            workstation.draw(now);
            (picture, at_once) = (now + timing::CYCLE, 0);
            if connected && now > moved + config.stale_after {
                drawn.pauses += 1;
                picture = now + config.pause;
                moved = picture;
            }
        }
        let wait = Some(picture.saturating_sub(now));
        let goes_on = turn(&mut driver, &mut workstation, wait, |_, event| match event {
            WorkstationEvent::Pose(packet) | WorkstationEvent::Unasked(packet) => {
                drawn.gaps += last_count.map_or(0, |last| u64::from(packet.lost_since(last)));
                (last_count, moved) = (Some(packet.count), now);
                at_once += 1;
                drawn.most_at_once = drawn.most_at_once.max(at_once);
                report(pose(&packet))
            }
            WorkstationEvent::Corrupt(error) => report(json!({"event": "corrupt", "error": error})),
            WorkstationEvent::Missed => report(json!({"event": "missed"})),
            WorkstationEvent::HoldEnded => report(json!({"event": "hold_ended"})),
            _ => Ok(()),
        })?;
        if !goes_on {
            break;
        }
    }
    let seen = workstation.statistics();
    let poses = seen.poses + seen.unasked;
    Ok(Drawn { asked: seen.requests, poses, damaged: seen.corrupt, stale: seen.stale, ..drawn })
}

fn pose(packet: &PosePacket) -> Value {
    let [.., x, y, z] = packet.pose;
    // 1/32 mm, shown to a hundredth.
    let position = [x, y, z].map(|word| (f64::from(word) / 32.0 * 100.0).round() / 100.0);
    json!({"event": "pose", "count": packet.count, "position_mm": position})
}
