//! isra-ball: its host with any ball, and its ball with any host. Each meets the assumptions of the other one.

mod any_ball;
mod any_host;
mod margins;
pub mod rows;
mod world;

pub use any_ball::AnyBall;
pub use any_host::AnyHost;
pub use margins::margins;
pub use world::{Config, TICK};

use isra_ball::{BallConfig, ball, host};
use robot_session::end::Rules;

use crate::model::{EndWithPeer, MustFail, Pair, Setting, Table, at, both, draw};
use any_ball::{ANSWERED, APART, DRAINED, MARKED, PROVED, WINDOW};
use world::{AGE, ASKED, CLAIMED, ONE_OUTCOME, PAIRED, STALE};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("isra-ball", 112), Table::of::<rows::Ball>("isra-ball", 2)];

/// A host and any ball.
pub const ANY_BALL: Pair = Pair {
    name: "isra-ball host × any ball",
    settings: |_| {
        let mut settings = both(any_ball, any_ball::RULES, any_ball::ANYTHING);
        settings.push(Setting::new("answers at once, nothing goes wrong", prompt()).on(any_ball::PROMPT));
        settings.extend((1..=LAGS).flat_map(|lag| {
            [0, 1].map(|faults| {
                let name = format!("every packet {lag} ticks late, which is not in time, {faults} faults");
                Setting::new(name, late(lag, faults)).on(any_ball::LATE)
            })
        }));
        settings
    },
    must_fail: || {
        use host::Rule;
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_ball(keeps_rules);
            system.peer.config = system.peer.config.without(rule);
            MustFail::walked(name, property, at(keeps_rules), system)
        };
        vec![
            without("host: drain first", PAIRED, true, Rule::DrainFirst),
            without("host: await the reply", ANSWERED, true, Rule::AwaitReply),
            without("host: the age of values is proved", AGE, true, Rule::ProveAge),
            without("host: the age counts from the poll", AGE, true, Rule::AgeFromPoll),
            without("host: old values are not new", AGE, true, Rule::OldIsNotNew),
            without("host: the end of a poll is reported", ONE_OUTCOME, true, Rule::ReportEnd),
            without("host: the end of values is reported", STALE, true, Rule::ReportEnd),
            without("host: a reply proves nothing on the next connection", AGE, true, Rule::ForgetReply),
            {
                let mut system = prompt();
                (system.peer.config, system.peer.delay) =
                    (Config::WHOLE.patient().without(Rule::AwaitReply), 3);
                MustFail::walked("host: await the reply", CLAIMED, "packets up to 3 ticks late", system)
            },
            {
                let mut system = late(6, 0);
                system.peer.config = system.peer.config.without(Rule::Uneven);
                let setting = "every packet 6 ticks late, which is not in time";
                MustFail::walked("host: polls without a reply are farther apart", AGE, setting, system)
            },
            {
                let mut system = any_ball(true);
                system.peer.delay += 5;
                let setting = "packets up to 6 ticks late";
                MustFail::walked("assumption: no delay above max_delay", PAIRED, setting, system)
            },
            without("host: drain first", DRAINED, false, Rule::DrainFirst),
            without("host: await the reply", WINDOW, false, Rule::AwaitReply),
            without("host: polls without a reply are farther apart", APART, false, Rule::Uneven),
            without("host: no reply before the line can carry it", WINDOW, false, Rule::NotBefore),
            without("host: the age of values is proved", PROVED, false, Rule::ProveAge),
            without("host: the age counts from the poll", PROVED, false, Rule::AgeFromPoll),
            without("host: old values are not new", MARKED, false, Rule::OldIsNotNew),
            without("host: the end of a poll is reported", ONE_OUTCOME, false, Rule::ReportEnd),
            without("host: the end of values is reported", STALE, false, Rule::ReportEnd),
            without("host: a reply proves nothing on the next connection", PROVED, false, Rule::ForgetReply),
        ]
    },
    diagrams: || draw("isra-ball", &["host"], &both(any_ball, any_ball::RULES, any_ball::ANYTHING)),
    refined: || [true, false].map(|keeps_rules| any_ball(keeps_rules).refined()).into(),
};

/// A ball and any hosts of other makers.
pub const ANY_HOST: Pair = Pair {
    name: "isra-ball ball × any host",
    settings: |_| both(any_host, any_host::RULES, any_host::ANYTHING),
    must_fail: || {
        use ball::Rule;
        let without = |name, property, rule| {
            let mut system = any_host(true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, "keeps the rules", system)
        };
        vec![
            without("ball: values that were sent are old", any_host::MARKED, Rule::MarkOld),
            without("ball: a poll ends with its connection", ASKED, Rule::ForgetPoll),
        ]
    },
    diagrams: || draw("isra-ball", &["ball"], &both(any_host, any_host::RULES, any_host::ANYTHING)),
    refined: || [true, false].map(|keeps_rules| any_host(keeps_rules).refined()).into(),
};

/// Returns a ball about which only the rules are known, or nothing.
pub fn any_ball(keeps_rules: bool) -> EndWithPeer<AnyBall> {
    EndWithPeer::new(AnyBall::new(Config::WHOLE, keeps_rules))
}

/// Returns a host about which only the rules are known, or nothing.
pub fn any_host(keeps_rules: bool) -> EndWithPeer<AnyHost> {
    EndWithPeer::new(AnyHost { config: BallConfig::default(), keeps_rules })
}

/// The greatest lag that is explored, in ticks: four periods.
const LAGS: u8 = 12;

/// Returns a ball that answers every poll, without faults.
fn prompt() -> EndWithPeer<AnyBall> {
    let peer = AnyBall { prompt: Some(0), ..AnyBall::new(Config::WHOLE, true) };
    EndWithPeer { peer, late: false, breaks: false }
}

/// Returns the same with all packets this many ticks late.
fn late(lag: u8, faults: u8) -> EndWithPeer<AnyBall> {
    let peer =
        AnyBall { delay: 0, lag, prompt: Some(faults), ..AnyBall::new(Config::WHOLE.punctual(), true) };
    EndWithPeer { peer, late: false, breaks: faults > 0 }
}
