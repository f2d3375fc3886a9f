//! VAL II ALTER: host and controller on a serial line that loses, corrupts and delays messages, with restarts of either end,
//! late polls, noise, controllers that make any sense of words that are left out, and controllers that go on without a reply.

mod any_host;
mod machines;
mod pair;
pub mod rows;
mod rules;
mod setup;
mod world;

pub use any_host::AnyHost;
pub use pair::{Act, Fate};
pub use setup::{Alter, TICK};
pub use world::{Message, Reply, World};

use crate::model::{Against, Depth, Diagram, MustFail, Pair, Setting, Table, draw};
use robot_session::Rules;
use val2_alter::{Mode, controller};

use world::{INFORMED, NESTED, TRIES, UNASKED};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("val2-alter", 200), Table::of::<rows::Controller>("val2-alter", 100)];

/// The link's ends.
pub const PAIR: Pair = Pair {
    name: "val2-alter host × controller",
    settings,
    must_fail: rules::must_fail,
    diagrams,
    refined: Vec::new,
};

/// A controller and hosts that are not ours.
pub const ANY_HOST: Pair = Pair {
    name: "val2-alter controller × any host",
    settings: |_| {
        vec![
            Setting::new("keeps the rules", any_host(true)).on(any_host::RULES),
            Setting::new("does anything", any_host(false)).on(any_host::ANYTHING),
        ]
    },
    must_fail: || {
        use controller::Rule;
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_host(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            let setting = if keeps_rules { "keeps the rules" } else { "does anything" };
            MustFail::new(name, property, setting, system)
        };
        vec![
            without("controller: an interruption is reported", INFORMED, true, Rule::ReportInterruption),
            without(
                "controller: no reply before the request has left",
                any_host::TAKEN,
                true,
                Rule::AfterRequest,
            ),
            without("controller: the first reply of a window", any_host::TAKEN, true, Rule::FirstReply),
            without("controller: a missing reply ends ALTER", any_host::REPORTED, true, Rule::EndOnMissing),
            without("controller: one subroutine at a time", NESTED, false, Rule::OneSubroutine),
            without("controller: a start message is sent again", TRIES, true, Rule::Attempts),
            without("controller: no move in an interruption", UNASKED, true, Rule::RestInterrupted),
        ]
    },
    diagrams: Vec::new,
    refined: Vec::new,
};

fn any_host(keeps_rules: bool) -> Against<AnyHost> {
    let gap = Some(core::time::Duration::from_millis(4));
    let config = val2_alter::ControllerConfig { gap, ..Alter::new(Mode(19)).controller };
    Against::new(AnyHost { config, keeps_rules })
}

fn settings(depth: Depth) -> Vec<Setting> {
    let (faults, jobs) = if depth == Depth::Quick { (2, 1) } else { (4, 2) };
    let each = |(name, system): (&str, Alter)| {
        // Only where late replies are taken does one exception meet the reply of another.
        let jobs = if system.operator { 2 } else { jobs };
        // With four faults a controller of ours goes on, too: noise hides from it that a reply is missing.
        let system = Alter { faults, jobs, late_once: system.is_in_time(), ..system };
        Setting::new(format!("{name}, {jobs} exceptions, a stop, {faults} faults of any kind"), system)
    };
    let [by, to] = [Mode(19), Mode(18)].map(Alter::new);
    [
        ("cumulative", by),
        ("non-cumulative", to),
        ("non-cumulative, words in an interruption are not kept", Alter { takes_all: false, ..to }),
        ("cumulative, a controller that takes late replies and goes on", by.goes_on()),
        ("cumulative, a controller that interrupts ALTER by itself", Alter { interrupts: true, ..by }),
        ("cumulative, the start is repeated once", by.repeats_once()),
        ("cumulative, delays of a cycle, and the host knows", by.late_lines()),
    ]
    .map(each)
    .into()
}

fn diagrams() -> Vec<Diagram> {
    draw("val2-alter", &["host", "controller"], &settings(Depth::Quick))
}
