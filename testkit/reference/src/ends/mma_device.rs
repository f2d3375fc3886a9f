//! A platform's end of its connection.

use core::time::Duration;

use anyhow::{Result, bail};
use mmacell_proto::device::DeviceRule;
use mmacell_proto::device::machine::{Axes, DeviceLink};
use mmacell_proto::{
    Command, Decoder, Device, DeviceClosing, DeviceConfig, DeviceEvent, ErrorCode, Order, PlatformPose,
    Rejection, SessionError,
};
use robot_session::Decoder as _;
use serde_json::{Map, Value};

use super::{Do, Driven, Fields, Hooks, Maker, event, kind, show, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(Driven::<MmaDevice>(Device::new(configuration(config, without)?)?))),
    rules: || {
        ["TakeOver", "AcceptPending", "AcceptPossible", "OneMotion", "ServoFirst"].map(String::from).to_vec()
    },
};

const RULES: [DeviceRule; 5] = [
    DeviceRule::TakeOver,
    DeviceRule::AcceptPending,
    DeviceRule::AcceptPossible,
    DeviceRule::OneMotion,
    DeviceRule::ServoFirst,
];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<DeviceConfig> {
    let mut made = DeviceConfig::DEFAULT;
    let mut fields = Fields(config.clone());
    fields.take("accepts", &mut made.accepts)?;
    fields.take("writes", &mut made.writes)?;
    fields.take("refusal", &mut made.refusal)?;
    fields.end()?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(made)
}

type Session = Device<PlatformPose>;

struct MmaDevice;

impl Hooks for MmaDevice {
    type Session = Session;

    fn call(device: &mut Session, _: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        // The order that is asked; without one, one that is not.
        let order = match device.machine().link {
            DeviceLink::Asked { order } => order,
            _ => Order::Stop,
        };
        let result = match name {
            "accept" => device.accept(order),
            "accept_another" => device.accept(Order::Acquire { camera: 77 }),
            "refuse" => device.refuse(order, serde_json::from_value::<ErrorCode>(argument)?),
            "set_pose" => {
                device.set_pose(serde_json::from_value(argument)?);
                Ok(())
            }
            "arrived" => {
                device.arrived();
                Ok(())
            }
            "fail" => {
                device.fail(serde_json::from_value(argument)?);
                Ok(())
            }
            _ => bail!("a device has no call {name}"),
        };
        Ok(result.map_err(|error| match error {
            SessionError::NotPending => kind("not_pending"),
            SessionError::NotPossible => kind("not_possible"),
            SessionError::Encode(error) => show(&error),
            _ => kind("not_a_device's"),
        }))
    }

    fn event(_: &Session, happened: DeviceEvent<PlatformPose>) -> Result<String> {
        Ok(match happened {
            DeviceEvent::Asked { order } => event("asked").value("order", &order)?.end(),
            DeviceEvent::Closed { reason } => {
                let reason = if reason == DeviceClosing::Agreed { "agreed" } else { "overrun" };
                event("closed").value("reason", reason)?.end()
            }
            DeviceEvent::Rejected { reason } => {
                let object = event("rejected");
                match reason {
                    Rejection::Malformed(error) => {
                        object.value("reason", "malformed")?.raw("error", show(&error))
                    }
                    Rejection::NotNow { state } => {
                        object.value("reason", "not_now")?.value("state", state)?
                    }
                    Rejection::OutOfRange => object.value("reason", "out_of_range")?,
                    Rejection::NoPose => object.value("reason", "no_pose")?,
                    _ => bail!("a reason without a name"),
                }
                .end()
            }
            DeviceEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(device: &Session) -> String {
        match device.machine().link {
            DeviceLink::Down => "Down",
            DeviceLink::Idle => "Idle",
            DeviceLink::Asked { order: Order::Close } => "Asked { order: Close }",
            DeviceLink::Asked { .. } => "Asked { order: Move { target: there } }",
            DeviceLink::Answering { .. } => "Answering { reply: Ok }",
            DeviceLink::Leaving => "Leaving",
            DeviceLink::Ended => "Ended",
        }
        .into()
    }

    fn cells(before: &Session, after: &Session, _: Duration, input: &Do, refused: bool) -> Vec<String> {
        let pending = match before.machine().link {
            DeviceLink::Asked { order } => Some(order),
            _ => None,
        };
        let (input, axes) = match input {
            Do::Connected => ("Connected", None),
            Do::Disconnected => ("Disconnected", None),
            Do::Timeout | Do::Transmitted | Do::Nothing => return Vec::new(),
            Do::Input(_) if after.is_ended() && !before.is_ended() => ("Overrun", None),
            Do::Input(bytes) => match received(before, bytes) {
                Some(input) if matches!(before.machine().link, DeviceLink::Idle) => (input, None),
                _ => return Vec::new(),
            },
            Do::Call { name, .. } => match (name.as_str(), pending) {
                ("accept", Some(order @ Order::Close)) => ("Accept(Close)", Some(accepted(order))),
                ("accept", Some(order)) => ("Accept(Move { target: there })", Some(accepted(order))),
                ("refuse", Some(_)) if !refused => ("Refuse(Move { target: there }, Servo1)", None),
                ("set_pose", _) => ("Pose(None)", None),
                ("arrived", _) => ("Arrived", Some("Arrived".into())),
                ("fail", _) => ("Failed(Servo1)", Some("Failed(Servo1)".into())),
                _ => return Vec::new(),
            },
        };
        let state = match before.machine().axes {
            Axes::Fault { .. } => "Fault { error: Servo2 }".to_owned(),
            other => format!("{other:?}"),
        };
        let axes = axes.map(|input| format!("{state}: {input}"));
        axes.into_iter().chain([format!("{}: {input}", Self::state(before))]).collect()
    }

    fn transmit_cells(before: &Session, _: Duration, sent: bool) -> Vec<String> {
        if sent { vec![format!("{}: Transmit", Self::state(before))] } else { Vec::new() }
    }
}

/// The input of the axes, as the matrix prints it.
fn accepted(order: Order<PlatformPose>) -> String {
    match order {
        Order::Override { .. } => "Accept(Override { percent: 1 })".into(),
        Order::Move { .. } => "Accept(Move { target: there })".into(),
        Order::Acquire { .. } => "Accept(Acquire { camera: 1 })".into(),
        Order::Grip { .. } => "Accept(Grip { gripper: 0, open: true })".into(),
        other => format!("Accept({other:?})"),
    }
}

/// The input of a step that has one line.
fn received(device: &Session, bytes: &[u8]) -> Option<&'static str> {
    let accepts = device.config().accepts;
    let mut decoder = Decoder::new(accepts);
    if decoder.push(bytes) < bytes.len() {
        return None;
    }
    let command = decoder.next_frame()?.and_then(|line| Command::<PlatformPose>::decode(line, &accepts));
    if decoder.next_frame().is_some() {
        return None;
    }
    Some(match command {
        Err(_) => "Corrupt(Incomplete)",
        Ok(Command::Status) => "Command(Status)",
        Ok(_) => "Command(Move { mode: Absolute, pose: there })",
    })
}
