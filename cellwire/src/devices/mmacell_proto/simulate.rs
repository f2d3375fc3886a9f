//! `cellwire simulate mma-robot` and `mma-platform`: a device to test a central controller against.

use anyhow::Result;
use cellwire_sim::host::{ConnectionEnd, Notice};
use cellwire_sim::mma::{Mma, MmaDevice, MmaEvent, MotionOutcome, Simulated};
use cellwire_sim::{Fault, MmaPlatform, MmaRobot, Settings as _, SimulatorReport};
use robot_session::spec::Configure;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::devices::control::{Command, Fields, OwnCommands, fields};
use crate::devices::device::SimulateOptions;
use crate::devices::host::{connected, disconnected, reason};
use cellwire_io::clock::Clock;
use cellwire_io::output::{admits, log, notice, remark};
use cellwire_links::settings;

/// Runs the robot until interrupted.
///
/// # Errors
/// If the endpoint cannot be opened, or a setting is not one of this device's.
pub fn robot(options: &SimulateOptions) -> Result<()> {
    simulate("mma-robot", MmaRobot::default(), options)
}

/// Runs the platform until interrupted.
///
/// # Errors
/// If the endpoint cannot be opened, or a setting is not one of this device's.
pub fn platform(options: &SimulateOptions) -> Result<()> {
    simulate("mma-platform", MmaPlatform::default(), options)
}

fn simulate<P: Simulated + Serialize>(
    name: &'static str,
    settings: Mma<P>,
    options: &SimulateOptions,
) -> Result<()>
where
    Mma<P>: Configure,
{
    let settings = settings::read(name, settings, &options.settings)?;
    let device = settings.simulator()?.keeping_nothing();
    options.serve_tcp(name, Clock::start(), device, own(), |trace, event| match event {
        Notice::Connected(peer) => connected(peer),
        Notice::Refused(peer, why) if admits("refused_client") => {
            remark(&format!("refused the client {peer}: {why}"));
            Ok(())
        }
        Notice::Event(_, told) => print(&told),
        Notice::Disconnected(peer, ending) => {
            let why = match ending {
                ConnectionEnd::ByPeer | ConnectionEnd::Replaced => {
                    "the central controller closed the connection, or another one replaced it".into()
                }
                ConnectionEnd::Stalled => "the central controller does not read".into(),
                ending => reason(ending),
            };
            disconnected(trace, peer, &why)
        }
        _ => Ok(()),
    })
}

/// Returns the commands of `--control`: the end of a motion, and the pose.
fn own<P: Simulated + Serialize>() -> OwnCommands<MmaDevice<P>> {
    OwnCommands {
        commands: const {
            &[
                Command {
                    name: "end_motion",
                    about: "the `fate` of the motion that is under way: arrives, fails (half-way, with an error) or stalls (half-way, without one)",
                    examples: &[r#"{"do":"end_motion","fate":"stalls"}"#],
                },
                Command::get("the pose in mm and rad, whether the device moves, and the number of motions"),
            ]
        },
        execute: |device, args| {
            if args.name == "end_motion" {
                let End { fate } = args.read()?;
                if !device.moves() {
                    return Err("no motion is under way; send a motion first".into());
                }
                device.end_motion(match fate {
                    MotionEnd::Arrives => MotionOutcome::Arrives,
                    MotionEnd::Fails => MotionOutcome::Fails,
                    MotionEnd::Stalls => MotionOutcome::Stalls,
                });
                return Ok(Fields::new());
            }
            args.none()?;
            Ok(fields([
                ("pose", json!(device.pose())),
                ("moves", device.moves().into()),
                ("motions", device.motions().into()),
            ]))
        },
        show: Box::new(|motion| json!({"to": motion.to, "at": motion.at})),
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct End {
    fate: MotionEnd,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
enum MotionEnd {
    Arrives,
    Fails,
    Stalls,
}

fn print<P: Simulated + Serialize>(told: &SimulatorReport<MmaEvent<P>>) -> Result<()> {
    let print = match told {
        SimulatorReport::Device(MmaEvent::Refused(_) | MmaEvent::Rejected(_)) => notice,
        _ => log,
    };
    show(told).map_or(Ok(()), |line| print(&line))
}

fn show<P: Simulated + Serialize>(told: &SimulatorReport<MmaEvent<P>>) -> Option<Value> {
    Some(match told {
        SimulatorReport::Fault(Fault::Drop) => json!({"event": "muted"}),
        SimulatorReport::Device(MmaEvent::Move(to)) => json!({"event": "move", "to": to}),
        SimulatorReport::Device(MmaEvent::Home) => json!({"event": "home"}),
        SimulatorReport::Device(MmaEvent::Servo(on)) => json!({"event": "servo", "on": on}),
        SimulatorReport::Device(MmaEvent::Override(percent)) => {
            json!({"event": "override", "percent": percent})
        }
        SimulatorReport::Device(MmaEvent::Refused(error)) => json!({"event": "refused", "error": error}),
        SimulatorReport::Device(MmaEvent::Rejected(reason)) => {
            json!({"event": "rejected", "reason": reason.to_string()})
        }
        SimulatorReport::Device(MmaEvent::Closed(reason)) => {
            json!({"event": "closed", "reason": format!("{reason:?}").to_lowercase()})
        }
        _ => return None,
    })
}
