//! mmacell-proto: a central controller and a device over TCP.

mod any_central;
mod any_device;
mod margins;
pub mod rows;
mod world;

use core::time::Duration;
pub use margins::margins;

use mmacell_proto::central::Rule as CentralRule;
use mmacell_proto::device::Rule as DeviceRule;
use mmacell_proto::{CentralConfig, DeviceConfig};

use robot_session::end::Rules;

pub use self::any_central::AnyCentral;
pub use self::any_device::AnyDevice;
use crate::model::{EndWithPeer, MustFail, Pair, STANDSTILL, Table, at, both, draw};

/// The tables of the link's machines.
pub const TABLES: &[Table] = &[
    Table::of::<rows::Central>("mmacell-proto", 64),
    Table::of::<rows::Progress>("mmacell-proto", 64),
    Table::of::<rows::Device>("mmacell-proto", 44),
    Table::of::<rows::Moved>("mmacell-proto", 44),
];

/// A central controller and devices of other makers.
pub const ANY_DEVICE: Pair = Pair {
    name: "mmacell-proto central × any device",
    settings: |_| both(any_device, any_device::RULES, any_device::ANYTHING),
    must_fail: || {
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_device(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(keeps_rules), system)
        };
        let with = |name, property, change: fn(&mut CentralConfig)| {
            let mut system = any_device(true);
            change(&mut system.peer.config);
            MustFail::walked(name, property, at(true), system)
        };
        vec![
            without("CentralRule::UnknownWhenSent", world::NOT_DONE, true, CentralRule::UnknownWhenSent),
            without("CentralRule::AbortEnds", world::NOT_DONE, true, CentralRule::AbortEnds),
            without("CentralRule::ServoOn", world::ARRIVED, true, CentralRule::ServoOn),
            without("CentralRule::ForgetTarget", world::NO_TARGET, true, CentralRule::ForgetTarget),
            without("CentralRule::ForgetMotion", world::NO_TARGET, true, CentralRule::ForgetMotion),
            without("CentralRule::StrayEnds", world::STRAY, false, CentralRule::StrayEnds),
            with("CentralConfig::tolerance", world::ARRIVED, |config| config.tolerance = u32::MAX),
            with("CentralConfig::settle", world::NOT_MISSED, |config| config.settle = Duration::ZERO),
            with("CentralConfig::timeout", STANDSTILL, |config| config.timeout = Duration::MAX),
            {
                let mut system = any_device(true);
                system.peer.repeats = true;
                MustFail::walked("assumption: no reply is repeated late", world::DONE, at(true), system)
            },
            without("CentralRule::UnknownWhenSent", world::NOT_DONE, false, CentralRule::UnknownWhenSent),
            without("CentralRule::ServoOn", world::ARRIVED, false, CentralRule::ServoOn),
        ]
    },
    diagrams: || {
        draw("mmacell-proto", &["central"], &both(any_device, any_device::RULES, any_device::ANYTHING))
    },
    refined: || [true, false].map(|keeps_rules| any_device(keeps_rules).refined()).into(),
};

/// A device and central controllers of other makers.
pub const ANY_CENTRAL: Pair = Pair {
    name: "mmacell-proto device × any central",
    settings: |_| both(any_central, any_central::RULES, any_central::ANYTHING),
    must_fail: || {
        let without = |name, property, rule| {
            let mut system = any_central(true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, "keeps the rules", system)
        };
        vec![
            without("DeviceRule::TakeOver", any_central::ANSWERED, DeviceRule::TakeOver),
            without("DeviceRule::AcceptPending", world::PENDING, DeviceRule::AcceptPending),
            without("DeviceRule::AcceptPossible", world::IN_FAULT, DeviceRule::AcceptPossible),
            without("DeviceRule::OneMotion", world::ONE_MOTION, DeviceRule::OneMotion),
            without("DeviceRule::ServoFirst", world::SERVO_OFF, DeviceRule::ServoFirst),
        ]
    },
    diagrams: || {
        draw("mmacell-proto", &["device"], &both(any_central, any_central::RULES, any_central::ANYTHING))
    },
    refined: || [true, false].map(|keeps_rules| any_central(keeps_rules).refined()).into(),
};

/// Returns a device about which only the rules are known, or nothing.
pub const fn any_device(keeps_rules: bool) -> EndWithPeer<AnyDevice> {
    let config =
        CentralConfig { timeout: Duration::from_millis(100), settle: world::TICK, ..CentralConfig::DEFAULT };
    EndWithPeer::new(AnyDevice { config, keeps_rules, repeats: false })
}

/// Returns a central controller about which only the rules are known, or nothing.
pub const fn any_central(keeps_rules: bool) -> EndWithPeer<AnyCentral> {
    EndWithPeer::new(AnyCentral { config: DeviceConfig::DEFAULT, keeps_rules })
}
