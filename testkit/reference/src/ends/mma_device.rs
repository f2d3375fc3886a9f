//! A platform's end of its connection.

use core::time::Duration;

use anyhow::{Result, bail};
use mmacell_proto::device::machine::{self, DeviceLink, DeviceMachine};
use mmacell_proto::{
    Device, DeviceClosing, DeviceConfig, DeviceEvent, ErrorCode, Order, PlatformPose, Rejection, SessionError,
};
use serde_json::{Map, Value};
use testkit::links::mmacell_proto::rows;

use super::{About, Fields, Maker, Noted, cell, event, kind, names, show, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<MmaDevice>::boxed(Device::new(configuration(config, rule)?)?)),
    rules: names::<mmacell_proto::device::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<DeviceConfig> {
    let mut made = DeviceConfig { rules: without(rule), ..DeviceConfig::DEFAULT };
    let mut fields = Fields(config.clone());
    fields.take("accepts", &mut made.accepts)?;
    fields.take("writes", &mut made.writes)?;
    fields.take("refusal", &mut made.refusal)?;
    fields.end()?;
    Ok(made)
}

type Session = Device<PlatformPose>;

struct MmaDevice;

impl About for MmaDevice {
    type End = Session;
    type Rows = rows::Device;

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

    fn cells(
        machine: &DeviceMachine<PlatformPose>,
        at: Duration,
        input: &machine::Input<PlatformPose>,
    ) -> Vec<String> {
        [cell::<rows::Device>(machine, at, input), cell::<rows::Moved>(machine, at, input)].concat()
    }
}
