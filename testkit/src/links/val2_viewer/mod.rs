//! val2-viewer: its host with any workstation, and its workstation with any host. Each meets the assumptions of the other
//! one.

mod any_host;
mod any_workstation;
mod hold;
mod margins;
pub mod rows;
mod world;

use core::time::Duration;
pub use margins::margins;

use robot_session::end::Rules;
use val2_viewer::{HostConfig, WorkstationConfig, host, workstation};

pub use any_host::AnyHost;
pub use any_workstation::AnyWorkstation;

use crate::model::{EndWithPeer, MustFail, Pair, STANDSTILL, Setting, Table, at, both, draw};
use any_host::{MISSED, PAIRED};
use hold::{HELD, MAX_HOLD, RESUMED};
use world::{ASKED, ASKS, CREDIT, FRESH, ONE_OUTCOME, PACED, PILED, STALE, TICK};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("val2-viewer", 64), Table::of::<rows::Workstation>("val2-viewer", 80)];

/// A host and workstations of other makers.
pub const ANY_WORKSTATION: Pair = Pair {
    name: "val2-viewer host × any workstation",
    settings: |_| both(any_workstation, any_workstation::RULES, any_workstation::ANYTHING),
    must_fail: || {
        let without = |name, property, rule| {
            let mut system = any_workstation(true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(true), system)
        };
        vec![
            without("host: drain first", PILED, host::Rule::DrainFirst),
            without("host: an interval between packets", PACED, host::Rule::Pace),
            without("host: a pose becomes too old", FRESH, host::Rule::Expire),
            without("host: a request ends with its connection", ASKED, host::Rule::ForgetRequest),
            without("host: XOFF holds", HELD, host::Rule::Hold),
            without("host: XOFF again holds for longer", HELD, host::Rule::Prolong),
            without("host: XON lets it go on", RESUMED, host::Rule::Resume),
            without("host: a hold ends", STANDSTILL, host::Rule::EndHold),
            without("host: a connection begins without an XOFF", RESUMED, host::Rule::ForgetHold),
        ]
    },
    diagrams: || {
        draw(
            "val2-viewer",
            &["host"],
            &both(any_workstation, any_workstation::RULES, any_workstation::ANYTHING),
        )
    },
    refined: || [true, false].map(|keeps_rules| any_workstation(keeps_rules).refined()).into(),
};

/// A workstation and hosts of other makers.
pub const ANY_HOST: Pair = Pair {
    name: "val2-viewer workstation × any host",
    settings: |_| {
        let mut settings = both(any_host, any_host::RULES, any_host::ANYTHING);
        settings.push(Setting::new("answers in time, nothing goes wrong", prompt()).on(any_host::PROMPT));
        settings
    },
    must_fail: || {
        use workstation::Rule;
        let without = |name, property, rule| {
            let mut system = any_host(true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(true), system)
        };
        let mut paired = any_host(true);
        paired.peer.is_paired = true;
        vec![
            without("workstation: a credit of one", CREDIT, Rule::Credit),
            without("workstation: ask again after a pause", ASKS, Rule::AskAgain),
            without("workstation: a corrupt line was the answer", any_host::ENDED, Rule::CorruptIsAnswer),
            without("workstation: noise was not the answer", any_host::ENDED, Rule::NoiseIsNoAnswer),
            without("workstation: a picture becomes stale", STALE, Rule::Expire),
            without("workstation: the end of a request is reported", ONE_OUTCOME, Rule::ReportEnd),
            without("workstation: the end of a picture is reported", STALE, Rule::ReportEnd),
            without("workstation: a connection begins with a credit", ONE_OUTCOME, Rule::AskFirst),
            without("workstation: a request that is not answered is reported", MISSED, Rule::ReportOverdue),
            without("workstation: it is reported once", ONE_OUTCOME, Rule::MissOnce),
            without("workstation: a late answer shows a host", any_host::ENDED, Rule::LateIsAlive),
            without("workstation: XOFF holds", HELD, Rule::Hold),
            without("workstation: XOFF again holds for longer", HELD, Rule::Prolong),
            without("workstation: XON lets it go on", RESUMED, Rule::Resume),
            without("workstation: a hold ends", STANDSTILL, Rule::EndHold),
            without("workstation: a connection begins without an XOFF", RESUMED, Rule::ForgetHold),
            MustFail::walked("assumption: requests and packets are paired", PAIRED, at(true), paired),
        ]
    },
    diagrams: || draw("val2-viewer", &["workstation"], &both(any_host, any_host::RULES, any_host::ANYTHING)),
    refined: || [true, false].map(|keeps_rules| any_host(keeps_rules).refined()).into(),
};

fn ticks(ticks: u8) -> Duration {
    TICK * u32::from(ticks)
}

/// Returns a workstation about which only the rules are known, or nothing.
pub fn any_workstation(keeps_rules: bool) -> EndWithPeer<AnyWorkstation> {
    let config = HostConfig {
        interval: ticks(any_workstation::INTERVAL),
        max_age: ticks(any_workstation::MAX_AGE),
        max_hold: ticks(MAX_HOLD),
        ..HostConfig::default()
    };
    EndWithPeer::new(AnyWorkstation { config, keeps_rules })
}

/// Returns a host about which only the rules are known, or nothing.
pub fn any_host(keeps_rules: bool) -> EndWithPeer<AnyHost> {
    let config = WorkstationConfig {
        pause: ticks(any_host::PAUSE),
        stale_after: ticks(any_host::STALE_AFTER),
        max_hold: ticks(MAX_HOLD),
        ..WorkstationConfig::default()
    };
    EndWithPeer::new(AnyHost { config, keeps_rules, is_paired: false, is_prompt: false })
}

/// Returns a host that answers in time, on a line without faults.
fn prompt() -> EndWithPeer<AnyHost> {
    let peer = AnyHost { is_prompt: true, ..any_host(true).peer };
    EndWithPeer { peer, late: false, breaks: false }
}
