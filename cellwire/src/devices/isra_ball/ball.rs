//! The simulated ball on a line.

use anyhow::Result;
use cellwire_sim::ball::{Grip, HeldBall};
use cellwire_sim::host::Notice;
use cellwire_sim::{Settings as _, Simulator, SimulatorReport, TeachBall};
use isra_ball::{BallEvent, BallStatistics, Keys};
use robot_session::Session as _;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::devices::control::{Command, Fields, OwnCommands, fields};
use crate::devices::device::SimulateOptions;
use crate::devices::on_line::{Presence, on_line};
use crate::io::line::Line;
use cellwire_io::output::notice;
use cellwire_links::settings;

/// Runs `cellwire simulate ball`.
///
/// # Errors
/// If the endpoint cannot be opened, or a setting is not one of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("ball", TeachBall::default(), &options.settings)?;
    options.serve(["ball", "ball"], settings.baud, settings.simulator()?, own(), |line, ball| {
        run(line, ball, || true, |event| notice(&event)).map(drop)
    })
}

/// Returns the commands of `--control`: the grip on the ball.
fn own() -> OwnCommands<HeldBall> {
    const SET: &str = "the ball measures `grip`, with `force` and `moment` of three axes from -128 to 127 (default 0) and the `keys` 1 to 8 that are down; null: the simulated hand moves it again";
    OwnCommands {
        commands: const {
            &[
                Command {
                    name: "set",
                    about: SET,
                    examples: &[r#"{"do":"set","grip":{"force":[0,0,50],"keys":[1]}}"#],
                },
                Command::get("the grip that the ball measured last"),
            ]
        },
        execute: |ball, args| {
            if args.name == "set" {
                let Set { grip } = args.read()?;
                let grip = grip.map(|BallValues { force, moment, keys }| {
                    let down = keys.iter().try_fold(Keys::NONE, |down, key| {
                        (1..=8).contains(key).then(|| down.with(*key)).ok_or("`keys` are 1 to 8")
                    })?;
                    Ok::<_, String>(Grip { force, moment, keys: down })
                });
                ball.hold(grip.transpose()?);
                return Ok(Fields::new());
            }
            args.none()?;
            let Grip { force, moment, keys } = ball.grip();
            let keys: Vec<u8> = keys.iter().collect();
            Ok(fields([("grip", json!({"force": force, "moment": moment, "keys": keys}))]))
        },
        show: Box::new(|work| match *work {}),
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Set {
    #[serde(deserialize_with = "Option::deserialize")]
    grip: Option<BallValues>,
}

#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[derive(Default)]
struct BallValues {
    force: [i8; 3],
    moment: [i8; 3],
    keys: Vec<u8>,
}

/// Answers polls while `goes_on`, or until the connection is gone.
///
/// # Errors
/// If an event cannot be logged.
pub fn run(
    line: &mut Line,
    mut ball: Simulator<HeldBall>,
    goes_on: impl FnMut() -> bool,
    mut report: impl FnMut(Value) -> Result<()>,
) -> Result<BallStatistics> {
    on_line(&mut ball, line, Presence::OfClient, goes_on, |_, notice| match notice {
        Notice::Event(_, SimulatorReport::Device(BallEvent::Reply(packet))) => {
            report(json!({"event": "reply", "message": packet}))
        }
        Notice::Event(_, SimulatorReport::Device(BallEvent::Unknown(byte))) => {
            report(json!({"event": "unknown", "byte": byte}))
        }
        Notice::Connected(_) => report(json!({"event": "connected"})),
        Notice::Disconnected(..) => report(json!({"event": "disconnected"})),
        _ => Ok(()),
    })?;
    Ok(ball.statistics())
}
