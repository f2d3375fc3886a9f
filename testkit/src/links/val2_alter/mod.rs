//! VAL II ALTER: its host with any controller, and its controller with any host. Each meets the assumptions of the other
//! one. The line loses, corrupts and delays messages, either end is restarted and called late, and controllers interpret
//! omitted words in any way.

mod any_controller;
mod any_host;
mod any_robot;
mod line_to_controller;
mod line_to_host;
mod machines;
mod margins;
pub mod rows;
mod world;

pub use any_host::AnyHost;
pub use any_robot::AnyController;
pub use margins::margins;
pub use world::TICK;

use crate::model::{EndWithPeer, MustFail, Pair, Setting, Table, at, both, draw};
use robot_session::end::Rules;
use val2_alter::{controller, host};

use world::{
    DONE, FITS, INFORMED, INVENTED_MODE, NESTED, ONCE, OUTCOME, REFUSED, SILENCE, SILENT, STALE, TRIES,
    UNASKED, WORDS, ZEROS,
};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("val2-alter", 200), Table::of::<rows::Controller>("val2-alter", 100)];

/// A host and controllers of other makers.
pub const ANY_CONTROLLER: Pair = Pair {
    name: "val2-alter host × any controller",
    settings: |_| {
        let [rules, late, later, anything] =
            [any_controller::RULES, any_controller::LATE, any_controller::LATER, any_controller::ANYTHING];
        vec![
            Setting::walked(at(true), any_controller(true)).on(rules),
            Setting::new("keeps the rules, replies have any words", free()).on(rules),
            Setting::new(TAKES_LATE, late_controller()).on(late),
            Setting::new(LATER, later_controller()).on(later),
            Setting::walked(at(false), any_controller(false)).on(anything),
        ]
    },
    must_fail: || {
        use any_controller::{AGAIN, DELAYED, INTERRUPTED, REJECTED};
        use host::Rule;
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_controller(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(keeps_rules), system)
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
            without("host: requests to repeat are forgotten", REFUSED, false, Rule::Forget),
        ]);
        let later = |name, property, rule| {
            let mut system = later_controller();
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, LATER, system)
        };
        let words = "host: where replies may be late, a word is zero when no other comes";
        cases.extend([
            later(words, WORDS, Rule::WordsLate),
            later("host: replies may be late", DONE, Rule::InTime),
        ]);
        let mut hasty = any_controller(true);
        hasty.peer.config.max_delay = core::time::Duration::ZERO;
        cases.push(MustFail::walked("assumption: no delay above max_delay", DELAYED, at(true), hasty));
        cases
    },
    diagrams: || {
        draw("val2-alter", &["host"], &both(any_controller, any_controller::RULES, any_controller::ANYTHING))
    },
    refined: || vec![small().refined()],
};

/// A controller and hosts of other makers.
pub const ANY_HOST: Pair = Pair {
    name: "val2-alter controller × any host",
    settings: |_| {
        let mut settings = both(any_host, any_host::RULES, any_host::ANYTHING);
        let mut full = any_host(false);
        full.peer.has_room = false;
        settings.push(Setting::new("does anything, no room for reports", full).on(any_host::FULL));
        settings
    },
    must_fail: || {
        use controller::Rule;
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_host(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(keeps_rules), system)
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
    diagrams: || draw("val2-alter", &["controller"], &both(any_host, any_host::RULES, any_host::ANYTHING)),
    refined: || vec![EndWithPeer { late: false, breaks: false, ..any_host(true) }.refined()],
};

const TAKES_LATE: &str = "keeps them, takes late replies";

const LATER: &str = "keeps the rules, replies are late by a cycle";

/// Returns a controller about which only the rules are known, or nothing.
pub fn any_controller(keeps_rules: bool) -> EndWithPeer<AnyController> {
    let host = world::host();
    // When a target is too old is seen with a controller that does anything.
    let target_timeout = if keeps_rules { core::time::Duration::MAX } else { host.target_timeout };
    let config = val2_alter::HostConfig { target_timeout, ..host };
    let peer = AnyController { config, keeps_rules, takes_late: false, delay: 1, is_free: false };
    // With one that keeps the rules each answer is sent at once, and may be late on the line.
    EndWithPeer { late: !keeps_rules, ..EndWithPeer::new(peer) }
}

/// Returns a controller with any behaviour, and a host that is called in time, has no subroutine, and keeps its connection.
fn small() -> EndWithPeer<AnyController> {
    let system = any_controller(false);
    let config = val2_alter::HostConfig {
        subroutine: false,
        target_timeout: core::time::Duration::MAX,
        ..system.peer.config
    };
    EndWithPeer { late: false, breaks: false, peer: AnyController { config, ..system.peer } }
}

/// Returns a controller that follows the rules, and a host whose replies have any words.
fn free() -> EndWithPeer<AnyController> {
    let system = any_controller(true);
    EndWithPeer { peer: AnyController { is_free: true, ..system.peer }, ..system }
}

/// Replies that are sent late, too, to a controller that takes them.
fn late_controller() -> EndWithPeer<AnyController> {
    let system = free();
    EndWithPeer { late: true, breaks: false, peer: AnyController { takes_late: true, ..system.peer } }
}

/// Returns a line on which two replies may be under way, as the host assumes.
fn later_controller() -> EndWithPeer<AnyController> {
    // A message is late by one tick besides.
    delayed(4, TICK * 5)
}

/// Returns a line on which a reply is late by this many ticks, and a host that assumes `max_delay`.
fn delayed(delay: u8, max_delay: core::time::Duration) -> EndWithPeer<AnyController> {
    let system = free();
    let config = val2_alter::HostConfig { max_delay, ..system.peer.config };
    EndWithPeer { breaks: false, peer: AnyController { config, delay, ..system.peer }, ..system }
}

/// Returns a host about which only the rules are known, or nothing.
pub fn any_host(keeps_rules: bool) -> EndWithPeer<AnyHost> {
    EndWithPeer::new(AnyHost { config: world::controller(), keeps_rules, has_room: true })
}
