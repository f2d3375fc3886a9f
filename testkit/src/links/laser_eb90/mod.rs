//! laser-eb90: its host with any controller, and its controller with any host.

mod any_controller;
mod any_host;
mod line_to_controller;
mod line_to_host;
mod machines;
mod margins;
mod pieces;
pub mod rows;

use core::time::Duration;
pub use margins::margins;

use laser_eb90::controller::Rule as ControllerRule;
use laser_eb90::host::Rule as HostRule;
use laser_eb90::{ControllerConfig, HostConfig};
use robot_session::end::Rules;

use self::any_controller::AnyController;
use self::any_host::AnyHost;
use crate::model::{EndWithPeer, MustFail, Pair, Setting, Table, at, both, draw};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("laser-eb90", 160), Table::of::<rows::Controller>("laser-eb90", 64)];

/// An interpreted instruction and an immediate one.
const CUT: u16 = 0x0101;
const SWITCH: u16 = 0x0201;

/// A controller and hosts of other makers.
pub const ANY_HOST: Pair = Pair {
    name: "laser-eb90 controller × any host",
    settings: |_| both(any_host, any_host::RULES, any_host::ANYTHING),
    must_fail: || {
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_host(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(keeps_rules), system)
        };
        let mut mixed = any_host(true);
        mixed.peer.refuses_mixed = false;
        vec![
            MustFail::walked("a mixed frame is refused", any_host::WHOLE, at(true), mixed),
            without("IgnoreRest", any_host::ONE_ANSWER, true, ControllerRule::IgnoreRest),
            without("IgnoreShort", any_host::ONE_ANSWER, true, ControllerRule::IgnoreShort),
            without("TrustSilence", any_host::INNER, true, ControllerRule::TrustSilence),
            without("TrustSilence", any_host::INNER, false, ControllerRule::TrustSilence),
        ]
    },
    diagrams: || draw("laser-eb90", &["controller"], &both(any_host, any_host::RULES, any_host::ANYTHING)),
    refined: || [true, false].map(|keeps_rules| any_host(keeps_rules).refined()).into(),
};

/// A host and controllers of other makers.
pub const ANY_CONTROLLER: Pair = Pair {
    name: "laser-eb90 host × any controller",
    settings: |_| controllers(),
    must_fail: || {
        let rules = |name: &'static str, property, change: fn(&mut HostConfig)| {
            let mut system = any_controller(true, false);
            change(&mut system.peer.config);
            MustFail::walked(name, property, "keeps the rules", system)
        };
        let without = |name: &'static str, property, keeps_rules, rule| {
            let mut system = any_controller(keeps_rules, false);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(keeps_rules), system)
        };
        use any_controller::{DONE, ECHOED, ONCE, REFUSED};
        let mut unsure = insists();
        unsure.peer.config.rules = Rules::without(HostRule::UnansweredIsUnknown);
        vec![
            MustFail::walked("UnansweredIsUnknown", REFUSED, INSISTS, unsure),
            without("ConfirmLate", ECHOED, true, HostRule::ConfirmLate),
            rules("max_pause", DONE, |host| host.max_pause = Duration::ZERO),
            rules("settle", DONE, |host| host.settle = Duration::ZERO),
            rules("reply_time", ONCE, |host| host.reply_time = Duration::ZERO),
            rules("not controller_drops_partial", ONCE, |host| host.controller_drops_partial = true),
            rules("longest_frame", DONE, |host| host.longest_frame = 0),
            rules("earlier_execution", DONE, |host| host.earlier_execution = Duration::ZERO),
            without("DrainFirst", DONE, true, HostRule::DrainFirst),
            without("FinalCodes", ONCE, true, HostRule::FinalCodes),
            without("FailedIsUnknown", REFUSED, true, HostRule::FailedIsUnknown),
            without("OutlastExecution", DONE, true, HostRule::OutlastExecution),
            without("CompareWord", any_controller::CLAIMED, false, HostRule::CompareWord),
        ]
    },
    diagrams: || draw("laser-eb90", &["host"], &controllers()),
    refined: || {
        let systems = [(true, false), (true, true), (false, false)];
        let systems = systems.map(|(keeps_rules, drops)| any_controller(keeps_rules, drops));
        systems.iter().chain(&[insists(), reports()]).map(EndWithPeer::refined).collect()
    },
};

/// Every setting of the host.
fn controllers() -> Vec<Setting> {
    let (rules, anything) = (any_controller::RULES, any_controller::ANYTHING);
    let late = EndWithPeer { late: true, breaks: false, ..any_controller(true, false) };
    vec![
        Setting::new("keeps the rules", any_controller(true, false)).on(rules),
        Setting::new("keeps the rules, the host is late", late).on(rules),
        Setting::new("keeps the rules, drops first halves", any_controller(true, true)).on(rules),
        Setting::new(INSISTS, insists()).on(any_controller::INSISTS),
        Setting::new(REPORTS, reports()).on(rules),
        Setting::new("does anything", any_controller(false, false)).on(anything),
    ]
}

const REPORTS: &str = "keeps the rules, pauses twice as long, but the driver reports when a frame has left";

/// A host whose driver reports when a frame has left.
fn reports() -> EndWithPeer<AnyController> {
    let mut system = any_controller(true, false);
    (system.breaks, system.peer.reports, system.peer.real.pause) = (false, true, 2);
    system
}

const INSISTS: &str = "keeps the rules, the host resends on silence";

/// Returns a host that sends a frame again if no answer comes.
fn insists() -> EndWithPeer<AnyController> {
    let mut system = any_controller(true, false);
    system.peer.config.resend_on_silence = true;
    system
}

/// Returns a controller about which only the rules are known, or nothing.
pub fn any_controller(keeps_rules: bool, drops: bool) -> EndWithPeer<AnyController> {
    EndWithPeer { late: !keeps_rules, ..EndWithPeer::new(AnyController::new(keeps_rules, drops)) }
}

/// Two ticks are a silence. A connection that breaks within a frame forgets what was answered: that is the other setting's.
pub fn any_host(keeps_rules: bool) -> EndWithPeer<AnyHost> {
    let config = ControllerConfig { tick: Duration::ZERO, ..ControllerConfig::default() };
    EndWithPeer {
        breaks: !keeps_rules,
        ..EndWithPeer::new(AnyHost { config, keeps_rules, refuses_mixed: true })
    }
}
