//! VAL II ALTER: host and controller on a serial line that loses, corrupts and delays messages, with restarts of either end,
//! late polls, noise, and controllers that make any sense of words that are left out.

mod pair;

use core::time::Duration;

pub use pair::{Act, Alter, World};

use crate::model::{Depth, MustFail, Pair, Setting, draw};
use pair::{INVENTED_MODE, ONCE, SILENT, STALE, UNASKED, WORDS, ZEROS};
use val2_alter::machine::{ControllerRule, HostRule};
use val2_alter::{HostConfig, Mode};

/// The link's ends.
pub const PAIR: Pair = Pair { name: "val2-alter host × controller", settings, must_fail, diagrams };

fn settings(depth: Depth) -> Vec<Setting> {
    let (faults, jobs) = if depth == Depth::Quick { (1, 1) } else { (2, 2) };
    let each = |(name, mode, takes_all): (&str, Mode, bool)| {
        let system = Alter { faults, jobs, takes_all, ..Alter::new(mode) };
        Setting::new(format!("{name}, {jobs} exceptions, a stop, {faults} faults of any kind"), system)
    };
    [
        ("cumulative", Mode(19), true),
        ("cumulative, words in an interruption are not kept", Mode(19), false),
        ("non-cumulative", Mode(18), true),
        ("non-cumulative, words in an interruption are not kept", Mode(18), false),
    ]
    .map(each)
    .into()
}

fn must_fail() -> Vec<MustFail> {
    let base = Alter { faults: 2, jobs: 1, ..Alter::new(Mode(19)) };
    let host = |rule: &'static str, without, property| {
        let config = HostConfig { without: Some(without), ..base.host };
        MustFail::new(rule, property, "cumulative, 1 exception, 2 faults", Alter { host: config, ..base })
    };
    let two = Alter { jobs: 2, ..base };
    let controller = |rule: &'static str, without, property| {
        let mut system = two;
        system.controller.without = Some(without);
        MustFail::new(rule, property, "cumulative, 2 exceptions, 2 faults", system)
    };
    let other_mode = Alter { other_mode: true, ..base };
    let other = HostConfig { without: Some(HostRule::Mode), ..base.host };
    let late = HostConfig { max_delay: Duration::ZERO, ..base.host };
    let uncertain = HostConfig { without: Some(HostRule::WordsInterrupted), ..base.host };
    vec![
        MustFail::new(
            "words during an interruption are uncertain",
            WORDS,
            "words in an interruption are not kept",
            Alter { host: uncertain, takes_all: false, ..base },
        ),
        host("a word is zero only when the zero was read", HostRule::WordsUntilRead, WORDS),
        host("words that may be other than zero are sent", HostRule::WordsKept, WORDS),
        host("an error code counts only in sequence", HostRule::InSequence, ONCE),
        host("an exception that was read is not sent again", HostRule::SendOnce, ONCE),
        host("a stop is done when the zeros were read", HostRule::ZerosRead, ZEROS),
        host("after a stop no message is answered", HostRule::Silent, SILENT),
        host("a target is not for ever", HostRule::Stale, STALE),
        MustFail::new(
            "only the configured mode is accepted",
            INVENTED_MODE,
            "another mode",
            Alter { host: other, ..other_mode },
        ),
        MustFail::new(
            "max_delay is the delay (assumption)",
            ONCE,
            "max_delay 0, 3 faults",
            Alter { host: late, faults: 3, ..base },
        ),
        controller("the arm does not move in an interruption", ControllerRule::RestInterrupted, UNASKED),
    ]
}

fn diagrams() -> Vec<crate::model::Diagram> {
    draw("val2-alter", &["host", "controller"], &settings(Depth::Quick))
}
