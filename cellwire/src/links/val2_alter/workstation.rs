//! The simulated graphics workstation: draws the arm five times a second, each picture from one packet.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use serde_json::{Value, json};
use val2_alter::viewer::{PosePacket, Viewer, ViewerError};

use super::layout::Layout;
use crate::device::serve;
use crate::line::{Clock, Line};
use crate::priority::{self, Rank};
use crate::settings::Settings;
use crate::simulate::{SimulateOptions, log};

/// The source's line to the workstation (§5).
pub const BAUD: u32 = 19_200;
/// Drawing takes about 0.2 s (§5).
const DRAWING: Duration = Duration::from_millis(200);

/// The operator pauses a picture that has stood still for so long.
const PATIENCE: Duration = Duration::from_millis(1500);

/// What a workstation has seen.
#[derive(Debug, Clone, Copy, Default)]
pub struct Drawn {
    /// Requests sent.
    pub asked: u64,
    /// Poses received.
    pub poses: u64,
    /// Poses that never came, by the gaps in their count.
    pub gaps: u64,
    /// Damaged lines.
    pub damaged: u64,
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
    let baud = Settings::new("viewer", &options.settings, &["baud"])?.baud(BAUD)?;
    serve("viewer", "viewer", options, baud, |line, clock| {
        run(line, clock, &AtomicBool::new(false), |event| log(&to_json(&event)))?;
        Ok(())
    })
}

/// Draws until told to stop, or until the connection is gone.
///
/// # Errors
/// When a picture cannot be told.
pub fn run(
    line: &mut Line,
    clock: Clock,
    stop: &AtomicBool,
    mut tell: impl FnMut(Result<PosePacket, ViewerError>) -> Result<()>,
) -> Result<Drawn> {
    priority::raise(Rank::Hardware);
    let mut viewer = Viewer::default();
    let mut drawn = Drawn::default();
    let (mut picture, mut last_count, mut at_once) = (Duration::ZERO, None, 0);
    let mut moved = Duration::ZERO;
    let mut out = [0; 1];
    while !stop.load(Ordering::Relaxed) && line.wait(picture) {
        while let Some((_, byte)) = line.receive() {
            viewer.handle_input(&[byte]);
        }
        while let Some(event) = viewer.poll_event() {
            tell(event)?;
            let Ok(PosePacket { count, .. }) = event else {
                drawn.damaged += 1;
                continue;
            };
            drawn.poses += 1;
            moved = clock.now();
            at_once += 1;
            drawn.most_at_once = drawn.most_at_once.max(at_once);
            let expected = last_count.map_or(count, |last: u16| last.wrapping_add(1));
            drawn.gaps += u64::from(count.wrapping_sub(expected));
            last_count = Some(count);
        }
        let now = clock.now();
        if now >= picture {
            picture = now + DRAWING;
            if line.is_connected() {
                viewer.draw(now);
                at_once = 0;
            }
            if drawn.asked > 0 && now > moved + PATIENCE {
                drawn.pauses += 1;
                picture = now + Viewer::PAUSE;
                moved = picture;
            }
        }
        if viewer.poll_transmit(&mut out).is_some() {
            line.send(&out);
            drawn.asked += 1;
        }
    }
    Ok(drawn)
}

fn to_json(event: &Result<PosePacket, ViewerError>) -> Value {
    match event {
        Ok(packet) => {
            let pose = Layout::COLUMNS.pose(&packet.pose);
            let position = pose.p.map(|mm| (mm * 100.0).round() / 100.0);
            json!({"event": "pose", "count": packet.count, "position_mm": position})
        }
        Err(error) => json!({"event": "damaged", "error": error}),
    }
}
