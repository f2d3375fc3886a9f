//! mmacell-proto: a central controller and a device over TCP.

mod pair;

use core::time::Duration;

use mmacell_proto::central::CentralRule;
use mmacell_proto::device::DeviceRule;
use mmacell_proto::{CentralConfig, DeviceConfig};

pub use self::pair::{Act, Setup, World};
use crate::model::{Depth, MustFail, Pair, Setting, draw};

/// A central controller and a device over TCP.
pub const PAIR: Pair = Pair { name: "mmacell-proto central × device", settings, must_fail, diagrams };

/// Two motions and so many faults. A reply may take two ticks, a motion one to show.
pub fn setup(faults: u8) -> Setup {
    Setup {
        central: CentralConfig { timeout: 2 * pair::TICK, settle: pair::TICK, ..CentralConfig::DEFAULT },
        device: DeviceConfig::DEFAULT,
        jobs: 2,
        faults,
    }
}

fn settings(depth: Depth) -> Vec<Setting> {
    let most = match depth {
        Depth::Quick => 1,
        Depth::Deep => 2,
    };
    (0..=most)
        .map(|faults| Setting::new(format!("2 motions, {faults} faults of any kind"), setup(faults)))
        .collect()
}

fn must_fail() -> Vec<MustFail> {
    let central = |rule: &'static str, property, change: fn(&mut CentralConfig)| {
        let mut setup = setup(2);
        change(&mut setup.central);
        MustFail::new(rule, property, "2 motions, 2 faults", setup)
    };
    let device = |rule: &'static str, property, without| {
        let mut setup = setup(2);
        setup.device.without = Some(without);
        MustFail::new(rule, property, "2 motions, 2 faults", setup)
    };
    vec![
        central("CentralConfig::tolerance", pair::ARRIVED, |config| config.tolerance = u32::MAX),
        central("CentralRule::ServoOn", pair::ARRIVED, |config| config.without = Some(CentralRule::ServoOn)),
        central("CentralConfig::settle", pair::NOT_MISSED, |config| config.settle = Duration::ZERO),
        central("CentralConfig::timeout", crate::model::STANDSTILL, |config| config.timeout = Duration::MAX),
        central("CentralRule::UnknownWhenSent", pair::NOT_DONE, |config| {
            config.without = Some(CentralRule::UnknownWhenSent);
        }),
        central("CentralRule::ForgetMotion", pair::NO_TARGET, |config| {
            config.without = Some(CentralRule::ForgetMotion);
        }),
        central("CentralRule::ForgetTarget", pair::NO_TARGET, |config| {
            config.without = Some(CentralRule::ForgetTarget);
        }),
        device("DeviceRule::TakeOver", pair::DONE, DeviceRule::TakeOver),
        device("DeviceRule::AcceptPending", pair::DONE, DeviceRule::AcceptPending),
        device("DeviceRule::AcceptPossible", pair::IN_FAULT, DeviceRule::AcceptPossible),
        device("DeviceRule::OneMotion", pair::ONE_MOTION, DeviceRule::OneMotion),
    ]
}

fn diagrams() -> Vec<crate::model::Diagram> {
    draw("mmacell-proto", &["central", "device"], &settings(Depth::Quick))
}
