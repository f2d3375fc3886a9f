//! val2-viewer: its host and its workstation, with every fault of a serial line.

mod pair;
mod refine;
pub mod rows;
mod world;

pub use world::{Act, Exchange, Fate, Packet, State, TICK};

use val2_viewer::{host, workstation};

use crate::model::{Depth, Diagram, MustFail, Pair, Refined, STANDSTILL, Setting, Table, draw};
use pair::{ASKED, CREDIT, ENDED, FRESH, ONE_OUTCOME, PACED, PILED, STALE};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("val2-viewer", 48), Table::of::<rows::Workstation>("val2-viewer", 48)];

/// The link's ends.
pub const PAIR: Pair =
    Pair { name: "val2-viewer host × workstation", settings, must_fail, diagrams, refined };

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
    draw("val2-viewer", &["host", "workstation"], &settings(Depth::Quick))
}
