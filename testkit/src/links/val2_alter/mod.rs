//! VAL II ALTER: host and controller on a serial line that loses, corrupts and delays messages, with restarts of either end,
//! late polls, noise, controllers that make any sense of words that are left out, and controllers that go on without a reply.

mod any_controller;
mod any_host;
mod any_robot;
mod machines;
mod margins;
mod pair;
pub mod rows;
mod rules;
mod setup;
mod world;

pub use any_host::AnyHost;
pub use any_robot::AnyController;
pub use margins::margins;
pub use pair::{Act, Fate};
pub use setup::{Alter, TICK};
pub use world::{Message, Reply, World};

use crate::model::{Against, Depth, Diagram, MustFail, Pair, Setting, Table, at, both, draw};
use robot_session::end::Rules;
use val2_alter::{HostConfig, Mode, controller, host};

use world::{
    FITS, INFORMED, INVENTED_MODE, NESTED, ONCE, OUTCOME, SILENCE, SILENT, STALE, TRIES, UNASKED, WORDS,
    ZEROS,
};

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

/// A host and controllers that are not ours.
pub const ANY_CONTROLLER: Pair = Pair {
    name: "val2-alter host × any controller",
    settings: |_| {
        vec![
            Setting::new("keeps the rules", any_controller(true)).on(any_controller::RULES),
            Setting::new(TAKES_LATE, late_controller()).on(any_controller::LATE),
            Setting::new(LATER, later_controller()).on(any_controller::LATER),
            Setting::new("does anything", any_controller(false)).on(any_controller::ANYTHING),
        ]
    },
    must_fail: || {
        use any_controller::{AGAIN, DELAYED, INTERRUPTED, REJECTED};
        use host::Rule;
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_controller(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, at(keeps_rules), system)
        };
        let mut cases = vec![
            without("host: a word is zero when the zero was read", WORDS, true, Rule::WordsUntilRead),
            without("host: words in an interruption are uncertain", WORDS, true, Rule::WordsInterrupted),
            without("host: words that may not be zero are sent", WORDS, true, Rule::WordsKept),
            without("host: an error code counts in sequence", ONCE, true, Rule::InSequence),
            without(
                "host: a reply is rejected by the message that follows it",
                REJECTED,
                true,
                Rule::Rejected,
            ),
            without("host: an exception that was read is not sent again", ONCE, true, Rule::SendOnce),
            without("host: no exception in an interruption", INTERRUPTED, true, Rule::NotInterrupted),
            without("host: a stop is done when zeros were read", ZEROS, true, Rule::ZerosRead),
            without("host: only the configured mode", INVENTED_MODE, false, Rule::Mode),
            without("host: an error code counts in sequence", AGAIN, false, Rule::InSequence),
            without("host: a reply that was not read may be late", AGAIN, false, Rule::Unread),
            without("host: an exception that was read is not sent again", AGAIN, false, Rule::SendOnce),
            without("host: no exception in an interruption", INTERRUPTED, false, Rule::NotInterrupted),
            without("host: after a stop nothing is answered", SILENT, false, Rule::Silent),
            without("host: a target expires", STALE, false, Rule::Stale),
            without("host: an overdue target is not followed", STALE, false, Rule::FreshInUse),
            without("host: a start message ends the ALTER before", OUTCOME, false, Rule::Restart),
            without("host: silence ends ALTER", SILENCE, false, Rule::Lost),
            without("host: a reply that is too late is not sent", FITS, false, Rule::Late),
        ];
        let late = |name, property, rule| {
            let mut system = late_controller();
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, TAKES_LATE, system)
        };
        let words = "host: words are uncertain while an exception may be late";
        cases.extend([
            late("host: a reply that was not read may be late", ONCE, Rule::Unread),
            late(words, ZEROS, Rule::WordsUnread),
            late(words, WORDS, Rule::WordsUnread),
        ]);
        let mut unknowing = later_controller();
        unknowing.peer.config.rules = Rules::without(Rule::WordsLate);
        let name = "host: where replies may be late, a word is zero when no other comes";
        cases.push(MustFail::new(name, WORDS, LATER, unknowing));
        let mut hasty = any_controller(true);
        hasty.peer.config.max_delay = core::time::Duration::ZERO;
        cases.push(MustFail::new("assumption: no delay above max_delay", DELAYED, at(true), hasty));
        cases
    },
    diagrams: Vec::new,
    refined: Vec::new,
};

/// A controller and hosts that are not ours.
pub const ANY_HOST: Pair = Pair {
    name: "val2-alter controller × any host",
    settings: |_| both(any_host, any_host::RULES, any_host::ANYTHING),
    must_fail: || {
        use controller::Rule;
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_host(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, at(keeps_rules), system)
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

const TAKES_LATE: &str = "keeps them, takes late replies";

const LATER: &str = "keeps the rules, replies are late by a cycle";

fn any_controller(keeps_rules: bool) -> Against<AnyController> {
    let host = HostConfig { silence_cycles: 2, ..Alter::new(Mode(18)).host };
    // When a target is too old is seen with a controller that does anything.
    let target_timeout = if keeps_rules { core::time::Duration::MAX } else { host.target_timeout };
    let config = HostConfig { target_timeout, ..host };
    // With one that keeps the rules each answer is sent at once, and may be late on the line.
    Against {
        late: !keeps_rules,
        ..Against::new(AnyController { config, keeps_rules, takes_late: false, delay: 1 })
    }
}

/// Replies that are sent late, too, to a controller that takes them.
fn late_controller() -> Against<AnyController> {
    let system = any_controller(true);
    Against { late: true, breaks: false, peer: AnyController { takes_late: true, ..system.peer } }
}

/// A line on which two replies may be under way, and the host knows.
fn later_controller() -> Against<AnyController> {
    let system = any_controller(true);
    // A message is late by one tick besides.
    let config = HostConfig { max_delay: TICK * 5, ..system.peer.config };
    Against { breaks: false, peer: AnyController { config, delay: 4, ..system.peer }, ..system }
}

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
        // With four faults this project's controller goes on, too: noise hides from it that a reply is missing.
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
