//! The commands of `--control` to the simulated PUMA.

use cellwire_sim::puma::{MarkIii, Pose};
use serde::Deserialize;
use serde_json::json;
use val2_alter::ControllerState;

use super::script;
use crate::devices::control::{Command, Fields, OwnCommands, fields};

/// Returns the commands of `--control`: the incidents of the program, and the position of the arm.
pub(super) fn own() -> OwnCommands<MarkIii> {
    OwnCommands {
        commands: const {
            &[
                Command {
                    name: "incident",
                    about: "an incident of the setting `script`, without a time: now, or as soon as ALTER runs",
                    examples: &[r#"{"do":"incident","incident":"interrupt 1s"}"#],
                },
                Command::get("the state of the controller, and the position of the arm in mm"),
            ]
        },
        execute: |robot, args| {
            if args.name == "incident" {
                let IncidentArgs { incident } = args.read()?;
                robot.incident(script::incident(&incident).map_err(|error| format!("{error:#}"))?);
                return Ok(Fields::new());
            }
            args.none()?;
            let state = match robot.controller().state() {
                ControllerState::Disconnected => "disconnected",
                ControllerState::Off => "off",
                ControllerState::Starting => "starting",
                ControllerState::Running => "running",
                ControllerState::Interrupted => "interrupted",
                ControllerState::Ending => "ending",
            };
            let position = json!(position(&robot.pose()));
            Ok(fields([("state", state.into()), ("position_mm", position)]))
        },
        show: Box::new(|moved| json!({"values": moved.values, "position_mm": position(&moved.pose)})),
    }
}

/// Returns the position of a pose in mm, to a thousandth.
pub(super) fn position(pose: &Pose) -> [f64; 3] {
    pose.p.map(|mm| (mm * 1000.0).round() / 1000.0)
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct IncidentArgs {
    incident: String,
}
