//! The simulated graphics workstation on a line.

use std::sync::atomic::AtomicBool;

use anyhow::Result;
use cellwire_sim::viewer::Drawn;
use cellwire_sim::{Settings as _, Told, Viewer};
use serde_json::{Value, json};
use val2_viewer::{PosePacket, WorkstationConfig, WorkstationEvent};

use crate::io::line::Line;
use crate::io::output::log;
use crate::links::device::{SimulateOptions, on_line, serve};
use cellwire_links::settings;

/// `cellwire simulate viewer`.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("viewer", Viewer::default(), &options.settings)?;
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
    let mut screen = Viewer { config, ..Viewer::default() }.simulator()?.keeping_nothing();
    on_line(line, &mut screen, stop, |event| match event {
        Ok(Told::Device(WorkstationEvent::Pose(packet) | WorkstationEvent::Unasked(packet))) => {
            report(pose(&packet))
        }
        Ok(Told::Device(WorkstationEvent::Corrupt(error))) => {
            report(json!({"event": "corrupt", "error": error}))
        }
        Ok(Told::Device(WorkstationEvent::Missed)) => report(json!({"event": "missed"})),
        Ok(Told::Device(WorkstationEvent::HoldEnded)) => report(json!({"event": "hold_ended"})),
        _ => Ok(()),
    })?;
    Ok(screen.device().drawn())
}

fn pose(packet: &PosePacket) -> Value {
    let [.., x, y, z] = packet.pose;
    // 1/32 mm, shown to a hundredth.
    let position = [x, y, z].map(|word| (f64::from(word) / 32.0 * 100.0).round() / 100.0);
    json!({"event": "pose", "count": packet.count, "position_mm": position})
}
