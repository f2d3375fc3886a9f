//! val2-viewer: its host and its workstation, with every fault of a serial line, and each with any peer.

mod any_host;
mod any_workstation;
mod hold;
mod margins;
mod pair;
mod refine;
pub mod rows;
mod world;

use core::time::Duration;
pub use margins::margins;

pub use world::{Act, Exchange, Fate, Packet, State, TICK};

use robot_session::end::Rules;
use val2_viewer::{HostConfig, WorkstationConfig, host, workstation};

pub use any_host::AnyHost;
pub use any_workstation::AnyWorkstation;

use crate::model::{
    Against, Depth, Diagram, MustFail, Pair, Refined, STANDSTILL, Setting, Table, both, draw,
};
use any_host::{MISSED, PAIRED};
use hold::{HELD, MAX_HOLD, RESUMED};
use pair::{ASKED, CREDIT, ENDED, FRESH, ONE_OUTCOME, PACED, PILED, STALE};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("val2-viewer", 64), Table::of::<rows::Workstation>("val2-viewer", 80)];

/// The link's ends.
pub const PAIR: Pair =
    Pair { name: "val2-viewer host × workstation", settings, must_fail, diagrams, refined };

/// A host and workstations that are not ours.
pub const ANY_WORKSTATION: Pair = Pair {
    name: "val2-viewer host × any workstation",
    settings: |_| both(any_workstation, any_workstation::RULES, any_workstation::ANYTHING),
    must_fail: || {
        let without = |name, property, rule| {
            let mut system = any_workstation(true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, "keeps the rules", system)
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
    diagrams: Vec::new,
    refined: Vec::new,
};

/// A workstation and hosts that are not ours.
pub const ANY_HOST: Pair = Pair {
    name: "val2-viewer workstation × any host",
    settings: |_| both(any_host, any_host::RULES, any_host::ANYTHING),
    must_fail: || {
        use workstation::Rule;
        let without = |name, property, rule| {
            let mut system = any_host(true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, "keeps the rules", system)
        };
        let mut paired = any_host(true);
        paired.peer.is_paired = true;
        vec![
            without("workstation: a credit of one", CREDIT, Rule::Credit),
            without("workstation: a corrupt line was the answer", any_host::ENDED, Rule::CorruptIsAnswer),
            without("workstation: noise was not the answer", any_host::ENDED, Rule::NoiseIsNoAnswer),
            without("workstation: a picture becomes stale", STALE, Rule::Expire),
            without("workstation: the end of a request is reported", ONE_OUTCOME, Rule::ReportEnd),
            without("workstation: a connection begins with a credit", ONE_OUTCOME, Rule::AskFirst),
            without("workstation: a request that is not answered is reported", MISSED, Rule::ReportOverdue),
            without("workstation: it is reported once", ONE_OUTCOME, Rule::MissOnce),
            without("workstation: a late answer shows a host", any_host::ENDED, Rule::LateIsAlive),
            without("workstation: XOFF holds", HELD, Rule::Hold),
            without("workstation: XOFF again holds for longer", HELD, Rule::Prolong),
            without("workstation: XON lets it go on", RESUMED, Rule::Resume),
            without("workstation: a hold ends", STANDSTILL, Rule::EndHold),
            without("workstation: a connection begins without an XOFF", RESUMED, Rule::ForgetHold),
            MustFail::new("assumption: requests and packets are paired", PAIRED, "keeps the rules", paired),
        ]
    },
    diagrams: Vec::new,
    refined: Vec::new,
};

const fn ticks(ticks: u8) -> Duration {
    Duration::from_millis(100 * ticks as u64)
}

fn any_workstation(keeps_rules: bool) -> Against<AnyWorkstation> {
    let config = HostConfig { max_hold: ticks(MAX_HOLD), ..Exchange::free().host };
    Against::new(AnyWorkstation { config, keeps_rules })
}

fn any_host(keeps_rules: bool) -> Against<AnyHost> {
    let config = WorkstationConfig {
        pause: ticks(any_host::PAUSE),
        stale_after: ticks(any_host::STALE_AFTER),
        max_hold: ticks(MAX_HOLD),
        ..WorkstationConfig::default()
    };
    Against::new(AnyHost { config, keeps_rules, is_paired: false })
}

fn settings(depth: Depth) -> Vec<Setting> {
    let faults = match depth {
        Depth::Quick => 2,
        Depth::Deep => 3,
    };
    let all = |exchange: Exchange| Exchange { faults, ..exchange };
    let first = format!("{faults} faults, the source's first");
    vec![
        Setting::new("no faults, a display that goes on", Exchange::steady()),
        Setting::new(format!("{faults} faults, pauses, ALTER that ends and begins"), all(Exchange::free())),
        Setting::new(format!("{first} workstation"), all(Exchange::first_workstation())),
        Setting::new(format!("{first} host"), all(Exchange::first_host())),
    ]
}

fn must_fail() -> Vec<MustFail> {
    let free = Exchange { faults: 2, ..Exchange::free() };
    let name = "2 faults, pauses, ALTER that ends and begins";
    let host = |what, property, rule| MustFail::new(what, property, name, free.without_at_host(rule));
    let workstation =
        |what, property, rule| MustFail::new(what, property, name, free.without_at_workstation(rule));
    vec![
        host("host: drain first", PILED, host::Rule::DrainFirst),
        host("host: an interval between packets", PACED, host::Rule::Pace),
        host("host: a pose becomes too old", FRESH, host::Rule::Expire),
        host("host: a request ends with its connection", ASKED, host::Rule::ForgetRequest),
        workstation("workstation: a credit of one", CREDIT, workstation::Rule::Credit),
        workstation("workstation: ask again after a pause", STANDSTILL, workstation::Rule::AskAgain),
        workstation("workstation: a corrupt line was the answer", ENDED, workstation::Rule::CorruptIsAnswer),
        workstation("workstation: noise was not the answer", ENDED, workstation::Rule::NoiseIsNoAnswer),
        workstation("workstation: a picture becomes stale", STALE, workstation::Rule::Expire),
        workstation(
            "workstation: the end of a request is reported",
            ONE_OUTCOME,
            workstation::Rule::ReportEnd,
        ),
        workstation("workstation: the end of a picture is reported", STALE, workstation::Rule::ReportEnd),
        workstation(
            "workstation: a connection begins with a credit",
            ONE_OUTCOME,
            workstation::Rule::AskFirst,
        ),
    ]
}

fn refined() -> Vec<Refined> {
    [Exchange::steady(), Exchange::free(), Exchange::first_workstation()].iter().map(refine::refine).collect()
}

fn diagrams() -> Vec<Diagram> {
    // What our own ends do to each other has no XOFF.
    let any = [ANY_WORKSTATION, ANY_HOST].iter().flat_map(|pair| (pair.settings)(Depth::Quick));
    draw("val2-viewer", &["host", "workstation"], &any.collect::<Vec<_>>())
}
