//! The commands of `--control` to the simulated ends.

use cellwire_sim::Device as _;
use cellwire_sim::kawasaki::{Kawasaki, Pc};
use kawasaki_msg::Job;
use serde_json::{Map, Value, json};

use crate::devices::control::{Command, OwnCommands, fields};
use cellwire_links::kawasaki_msg::layout::{AnyWork, Layout};

/// Returns the commands of `--control`: the order of the PC, which executes orders.
pub(super) fn pc() -> OwnCommands<Pc<AnyWork>> {
    OwnCommands {
        commands: const {
            &[Command::get(
                "the number of the order, null without one, and the number of its jobs that are executed",
            )]
        },
        execute: |pc, args| {
            args.none()?;
            let session = pc.session();
            Ok(fields([("order", session.order().into()), ("executed", session.executed().into())]))
        },
        show: Box::new(|event| serde_json::to_value(event).unwrap_or_default()),
    }
}

/// Returns the commands of `--control`: the jobs of the robot.
pub(super) fn robot(layout: Layout) -> OwnCommands<Kawasaki<AnyWork>> {
    OwnCommands {
        commands: const {
            &[Command::get(
                "the number of jobs that the robot holds, the job that is being executed included",
            )]
        },
        execute: |robot, args| {
            args.none()?;
            Ok(fields([("held", robot.held().into())]))
        },
        show: Box::new(move |Job { order, number, work, .. }| {
            let values = layout.fields().iter().enumerate();
            let values: Map<String, Value> =
                values.map(|(place, field)| (field.name.clone(), layout.show(place, work).into())).collect();
            json!({"order": order, "number": number, "job": values})
        }),
    }
}
