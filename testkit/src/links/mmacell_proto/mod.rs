//! mmacell-proto: a central controller and a device over TCP.

mod any_central;
mod any_device;
mod margins;
mod pair;
mod refine;
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
pub use self::world::{Act, Setup, World};
use crate::model::{Against, Depth, MustFail, Pair, Refined, Setting, Table, at, both, draw};

/// The tables of the link's machines.
pub const TABLES: &[Table] = &[
    Table::of::<rows::Central>("mmacell-proto", 64),
    Table::of::<rows::Progress>("mmacell-proto", 64),
    Table::of::<rows::Device>("mmacell-proto", 44),
    Table::of::<rows::Moved>("mmacell-proto", 44),
];

/// A central controller and a device over TCP.
pub const PAIR: Pair =
    Pair { name: "mmacell-proto central × device", settings, must_fail, diagrams, refined };

/// A central controller and devices that are not ours.
pub const ANY_DEVICE: Pair = Pair {
    name: "mmacell-proto central × any device",
    settings: |_| both(any_device, any_device::RULES, any_device::ANYTHING),
    must_fail: || {
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_device(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, at(keeps_rules), system)
        };
        vec![
            without("CentralRule::UnknownWhenSent", world::NOT_DONE, true, CentralRule::UnknownWhenSent),
            without("CentralRule::AbortEnds", world::NOT_DONE, true, CentralRule::AbortEnds),
            without("CentralRule::ServoOn", world::ARRIVED, true, CentralRule::ServoOn),
            without("CentralRule::ForgetTarget", world::NO_TARGET, true, CentralRule::ForgetTarget),
            without("CentralRule::ForgetMotion", world::NO_TARGET, true, CentralRule::ForgetMotion),
            without("CentralRule::UnknownWhenSent", world::NOT_DONE, false, CentralRule::UnknownWhenSent),
            without("CentralRule::ServoOn", world::ARRIVED, false, CentralRule::ServoOn),
        ]
    },
    diagrams: Vec::new,
    refined: Vec::new,
};

/// A device and central controllers that are not ours.
pub const ANY_CENTRAL: Pair = Pair {
    name: "mmacell-proto device × any central",
    settings: |_| both(any_central, any_central::RULES, any_central::ANYTHING),
    must_fail: || {
        let without = |name, property, rule| {
            let mut system = any_central(true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, "keeps the rules", system)
        };
        vec![
            without("DeviceRule::TakeOver", any_central::ANSWERED, DeviceRule::TakeOver),
            without("DeviceRule::AcceptPossible", world::IN_FAULT, DeviceRule::AcceptPossible),
            without("DeviceRule::OneMotion", world::ONE_MOTION, DeviceRule::OneMotion),
            without("DeviceRule::ServoFirst", world::SERVO_OFF, DeviceRule::ServoFirst),
        ]
    },
    diagrams: Vec::new,
    refined: Vec::new,
};

const fn any_device(keeps_rules: bool) -> Against<AnyDevice> {
    let config =
        CentralConfig { timeout: Duration::from_millis(100), settle: world::TICK, ..CentralConfig::DEFAULT };
    Against::new(AnyDevice { config, keeps_rules })
}

const fn any_central(keeps_rules: bool) -> Against<AnyCentral> {
    Against::new(AnyCentral { config: DeviceConfig::DEFAULT, keeps_rules })
}

/// How many motions, two at most, and this many faults. A reply may take two ticks, a motion one to show.
pub fn setup(jobs: u8, faults: u8) -> Setup {
    Setup {
        central: CentralConfig { timeout: 2 * world::TICK, settle: world::TICK, ..CentralConfig::DEFAULT },
        device: DeviceConfig::DEFAULT,
        jobs,
        faults,
        late_repeats: false,
    }
}

fn settings(depth: Depth) -> Vec<Setting> {
    let bounds: &[_] = match depth {
        Depth::Quick => &[(2, 0), (1, 1)],
        Depth::Deep => &[(1, 2), (2, 1), (2, 2)],
    };
    let name = |jobs, faults| format!("{jobs} motions, {faults} faults of any kind");
    bounds.iter().map(|(jobs, faults)| Setting::new(name(jobs, faults), setup(*jobs, *faults))).collect()
}

fn must_fail() -> Vec<MustFail> {
    let central = |rule: &'static str, property, change: fn(&mut CentralConfig)| {
        let mut setup = setup(2, 2);
        change(&mut setup.central);
        MustFail::new(rule, property, "2 motions, 2 faults", setup)
    };
    let device = |rule: &'static str, property, without| {
        let mut setup = setup(2, 2);
        setup.device.rules = Rules::without(without);
        MustFail::new(rule, property, "2 motions, 2 faults", setup)
    };
    vec![
        central("CentralConfig::tolerance", world::ARRIVED, |config| config.tolerance = u32::MAX),
        central("CentralRule::ServoOn", world::ARRIVED, |config| {
            config.rules = Rules::without(CentralRule::ServoOn)
        }),
        central("CentralConfig::settle", world::NOT_MISSED, |config| config.settle = Duration::ZERO),
        central("CentralConfig::timeout", crate::model::STANDSTILL, |config| config.timeout = Duration::MAX),
        central("CentralRule::UnknownWhenSent", world::NOT_DONE, |config| {
            config.rules = Rules::without(CentralRule::UnknownWhenSent);
        }),
        central("CentralRule::ForgetMotion", world::NO_TARGET, |config| {
            config.rules = Rules::without(CentralRule::ForgetMotion);
        }),
        central("CentralRule::ForgetTarget", world::NO_TARGET, |config| {
            config.rules = Rules::without(CentralRule::ForgetTarget);
        }),
        central("CentralRule::AbortEnds", world::NOT_DONE, |config| {
            config.rules = Rules::without(CentralRule::AbortEnds);
        }),
        central("CentralRule::StrayEnds", world::STRAY, |config| {
            config.rules = Rules::without(CentralRule::StrayEnds);
        }),
        device("DeviceRule::TakeOver", world::DONE, DeviceRule::TakeOver),
        device("DeviceRule::AcceptPending", world::DONE, DeviceRule::AcceptPending),
        device("DeviceRule::AcceptPossible", world::IN_FAULT, DeviceRule::AcceptPossible),
        device("DeviceRule::OneMotion", world::ONE_MOTION, DeviceRule::OneMotion),
        device("DeviceRule::ServoFirst", world::SERVO_OFF, DeviceRule::ServoFirst),
        MustFail::new(
            "assumption: no reply is repeated late",
            world::DONE,
            "2 motions, 2 faults",
            Setup { late_repeats: true, ..setup(2, 2) },
        ),
    ]
}

fn refined() -> Vec<Refined> {
    [setup(2, 0), setup(1, 1)].iter().map(refine::refine).collect()
}

fn diagrams() -> Vec<crate::model::Diagram> {
    draw("mmacell-proto", &["central", "device"], &settings(Depth::Quick))
}
