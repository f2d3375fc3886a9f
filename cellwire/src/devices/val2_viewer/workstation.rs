//! The simulated graphics workstation on a line.

use anyhow::Result;
use cellwire_sim::host::Notice;
use cellwire_sim::viewer::{Screen, WorkstationCounts};
use cellwire_sim::{Settings as _, Simulator, SimulatorReport, Viewer};
use serde_json::{Value, json};
use val2_viewer::{PosePacket, WorkstationEvent};

use crate::devices::control::{Command, OwnCommands, fields};
use crate::devices::device::SimulateOptions;
use crate::devices::on_line::{Presence, on_line};
use crate::io::line::Line;
use cellwire_io::output::notice;
use cellwire_links::settings;

/// Runs `cellwire simulate viewer`.
///
/// # Errors
/// If the endpoint cannot be opened, or a setting is not one of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("viewer", Viewer::default(), &options.settings)?;
    let screen = settings.simulator()?.keeping_nothing();
    options.serve(["viewer", "viewer"], settings.baud, screen, own(), |line, screen| {
        run(line, screen, || true, |event| notice(&event)).map(drop)
    })
}

/// Returns the commands of `--control`: the counts of the workstation. The workstation executes each pose that it draws.
fn own() -> OwnCommands<Screen> {
    OwnCommands {
        commands: const {
            &[Command::get(
                "the counts of the workstation: requests sent, poses received, gaps in their numbers, corrupt lines, stale pictures, pauses by the operator, the most poses between two pictures",
            )]
        },
        execute: |screen, args| {
            args.none()?;
            let WorkstationCounts { asked, poses, gaps, damaged, stale, pauses, most_at_once } =
                screen.drawn();
            Ok(fields([
                ("asked", asked.into()),
                ("poses", poses.into()),
                ("gaps", gaps.into()),
                ("damaged", damaged.into()),
                ("stale", stale.into()),
                ("pauses", pauses.into()),
                ("most_at_once", most_at_once.into()),
            ]))
        },
        show: Box::new(|packet| json!({"count": packet.count, "position_mm": position_mm(packet)})),
    }
}

/// Draws while `goes_on`, or until the connection is gone.
///
/// # Errors
/// If an event cannot be logged.
pub fn run(
    line: &mut Line,
    mut screen: Simulator<Screen>,
    goes_on: impl FnMut() -> bool,
    mut report: impl FnMut(Value) -> Result<()>,
) -> Result<WorkstationCounts> {
    on_line(&mut screen, line, Presence::OfClient, goes_on, |_, notice| {
        let Notice::Event(_, SimulatorReport::Device(event)) = notice else { return Ok(()) };
        match event {
            WorkstationEvent::Pose(packet) | WorkstationEvent::Unasked(packet) => report(pose(&packet)),
            WorkstationEvent::Corrupt(error) => report(json!({"event": "corrupt", "error": error})),
            WorkstationEvent::Missed => report(json!({"event": "missed"})),
            WorkstationEvent::HoldEnded => report(json!({"event": "hold_ended"})),
            _ => Ok(()),
        }
    })?;
    Ok(screen.device().drawn())
}

fn pose(packet: &PosePacket) -> Value {
    json!({"event": "pose", "count": packet.count, "position_mm": position_mm(packet)})
}

fn position_mm(packet: &PosePacket) -> [f64; 3] {
    let [.., x, y, z] = packet.pose;
    // 1/32 mm, shown to a hundredth.
    [x, y, z].map(|word| (f64::from(word) / 32.0 * 100.0).round() / 100.0)
}
