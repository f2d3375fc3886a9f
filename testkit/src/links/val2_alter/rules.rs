//! What each rule of the machines is needed for.

use core::time::Duration;

use robot_session::end::Rules;
use val2_alter::{HostConfig, Mode};
use val2_alter::{controller, host};

use super::setup::Alter;
use super::world::{
    DONE, FITS, INFORMED, INVENTED_MODE, NESTED, NOT_DONE, ONCE, OUTCOME, REFUSED, SILENCE, SILENT, STALE,
    TRIES, UNASKED, WORDS, ZEROS,
};
use crate::model::{MustFail, STANDSTILL};

pub(super) fn must_fail() -> Vec<MustFail> {
    let base = Alter { faults: 2, jobs: 1, ..Alter::new(Mode(19)) };
    let mut cases: Vec<_> = hosts(base).into();
    cases.extend(controllers(base));
    let assumes = HostConfig { max_delay: Duration::ZERO, ..base.host };
    let system = Alter { host: assumes, faults: 3, ..base };
    cases.push(MustFail::new(
        "assumption: no delay above max_delay",
        ONCE,
        "a delay of a quarter of a cycle, 3 faults",
        system,
    ));
    cases
}

fn hosts(base: Alter) -> [MustFail; 16] {
    use host::Rule;
    let case = |rule, property, setting, without, system: Alter| {
        let host = HostConfig { rules: Rules::without(without), ..system.host };
        MustFail::new(rule, property, format!("{setting}, 1 exception, 2 faults"), Alter { host, ..system })
    };
    let plain = "cumulative";
    let not_kept = Alter { takes_all: false, ..base };
    let other_mode = Alter { other_mode: true, ..base };
    let interrupts = Alter { interrupts: true, ..base };
    [
        case("host: only the configured mode", INVENTED_MODE, "another mode", Rule::Mode, other_mode),
        case("host: a word is zero when the zero was read", WORDS, plain, Rule::WordsUntilRead, base),
        case(
            "host: words in an interruption are uncertain",
            WORDS,
            "words in an interruption are not kept",
            Rule::WordsInterrupted,
            not_kept,
        ),
        case("host: words that may not be zero are sent", WORDS, plain, Rule::WordsKept, base),
        case("host: replies may be late", DONE, "delays of a cycle", Rule::InTime, base.late_lines()),
        case("host: an error code counts in sequence", ONCE, plain, Rule::InSequence, base),
        case(
            "host: a reply that was not read may be late",
            NOT_DONE,
            "a controller that takes late replies and goes on",
            Rule::Unread,
            base.goes_on(),
        ),
        case("host: an exception that was read is not sent again", ONCE, plain, Rule::SendOnce, base),
        case(
            "host: no exception in an interruption",
            DONE,
            "a controller that interrupts by itself",
            Rule::NotInterrupted,
            interrupts,
        ),
        case("host: a stop is done when zeros were read", ZEROS, plain, Rule::ZerosRead, base),
        case("host: after a stop nothing is answered", SILENT, plain, Rule::Silent, base),
        case("host: a target expires", STALE, plain, Rule::Stale, base),
        case("host: a start message ends the ALTER before", OUTCOME, plain, Rule::Restart, base),
        case("host: silence ends ALTER", SILENCE, plain, Rule::Lost, base),
        case("host: a reply that is too late is not sent", FITS, plain, Rule::Late, base),
        case(
            "host: requests to repeat are forgotten",
            REFUSED,
            "one repetition",
            Rule::Forget,
            base.repeats_once(),
        ),
    ]
}

fn controllers(base: Alter) -> [MustFail; 7] {
    use controller::Rule;
    let case = |rule, property, setting, without, mut system: Alter| {
        system.controller.rules = Rules::without(without);
        MustFail::new(rule, property, setting, system)
    };
    let plain = "cumulative, 1 exception, 2 faults";
    let three = Alter { faults: 3, ..base };
    let two = Alter { jobs: 2, ..base };
    // A host that sends exceptions at any time.
    let host = HostConfig { rules: Rules::without(host::Rule::NotInterrupted), ..base.host };
    let pushes = Alter { host, interrupts: true, ..base };
    // A host for which an error code is the last word on a reply.
    let host = HostConfig { rules: Rules::without(host::Rule::Unread), ..base.host };
    let trusts = Alter { host, ..three };
    [
        case("controller: an interruption is reported", INFORMED, plain, Rule::ReportInterruption, base),
        case(
            "controller: no reply before the request has left",
            DONE,
            "cumulative, 1 exception, 3 faults",
            Rule::AfterRequest,
            three,
        ),
        case(
            "controller: the first reply of a window",
            NOT_DONE,
            "a host that trusts error codes, 3 faults",
            Rule::FirstReply,
            trusts,
        ),
        case("controller: a missing reply ends ALTER", STANDSTILL, plain, Rule::EndOnMissing, base),
        case(
            "controller: one subroutine at a time",
            NESTED,
            "a host that sends exceptions at any time, 2 faults",
            Rule::OneSubroutine,
            pushes,
        ),
        case("controller: a start message is sent again", TRIES, plain, Rule::Attempts, base),
        case(
            "controller: no move in an interruption",
            UNASKED,
            "cumulative, 2 exceptions, 2 faults",
            Rule::RestInterrupted,
            two,
        ),
    ]
}
