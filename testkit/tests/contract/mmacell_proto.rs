use core::time::Duration;

use mmacell_proto::{CentralConfig, Command, DeviceConfig, ErrorCode, Order, RobotPose};
use testkit::contract::End;
use testkit::rng::Rng;

const LINK: &str = "mmacell-proto";

pub struct Central;

impl End for Central {
    type Session = mmacell_proto::Central<RobotPose>;
    const NAME: &'static str = "mmacell-proto central";

    fn new(endless: bool) -> Self::Session {
        let long =
            CentralConfig { timeout: Duration::MAX, settle: Duration::MAX, ..CentralConfig::default() };
        mmacell_proto::Central::new(if endless { long } else { CentralConfig::default() }).unwrap()
    }

    fn request(central: &mut Self::Session, now: Duration, rng: &mut Rng) {
        // Busy, or not connected: nothing changes then.
        let _ = match rng.below(6) {
            0 => {
                central.abort(now);
                Ok(())
            }
            1 => central.request(Command::Stop),
            2 => central.request(Command::Servo { on: rng.chance(0.5) }),
            3 => central.request(Command::Close),
            _ => central.request(Command::Status),
        };
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, Some("robot"), rng)
    }
}

pub struct Device;

impl End for Device {
    type Session = mmacell_proto::Device<RobotPose>;
    const NAME: &'static str = "mmacell-proto device";

    fn new(_: bool) -> Self::Session {
        mmacell_proto::Device::new(DeviceConfig::default()).unwrap()
    }

    fn request(device: &mut Self::Session, _: Duration, rng: &mut Rng) {
        let order = Order::Servo { on: rng.chance(0.5) };
        // Not pending: nothing changes then.
        let _ = match rng.below(4) {
            0 => {
                device.arrived();
                Ok(())
            }
            1 => device.refuse(order, ErrorCode::from(7)),
            _ => device.accept(order),
        };
    }

    fn message(rng: &mut Rng) -> Vec<u8> {
        super::any_frame(LINK, Some("central"), rng)
    }
}
