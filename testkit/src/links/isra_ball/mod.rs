//! isra-ball: its host and its ball, with every fault of a serial line, and each with any peer.

mod any_ball;
mod any_host;
mod margins;
mod pair;
mod refine;
pub mod rows;
mod world;

pub use any_ball::AnyBall;
pub use any_host::AnyHost;
pub use margins::margins;
pub use world::{Act, Exchange, Fate, State, TICK};

use isra_ball::{ball, host};
use robot_session::end::Rules;

use crate::model::{Against, Depth, Diagram, MustFail, Pair, Refined, Setting, Table, at, both, draw};
use any_ball::{ANSWERED, APART, DRAINED, MARKED, PROVED, WINDOW};
use pair::{AGE, ASKED, CLAIMED, ONE_OUTCOME, PAIRED, STALE};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("isra-ball", 112), Table::of::<rows::Ball>("isra-ball", 2)];

/// The link's ends.
pub const PAIR: Pair = Pair { name: "isra-ball host × ball", settings, must_fail, diagrams, refined };

/// A host and balls that are not ours.
pub const ANY_BALL: Pair = Pair {
    name: "isra-ball host × any ball",
    settings: |_| both(any_ball, any_ball::RULES, any_ball::ANYTHING),
    must_fail: || {
        use host::Rule;
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_ball(keeps_rules);
            system.peer.config = system.peer.config.without(rule);
            MustFail::new(name, property, at(keeps_rules), system)
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
    diagrams: Vec::new,
    refined: Vec::new,
};

/// A ball and hosts that are not ours.
pub const ANY_HOST: Pair = Pair {
    name: "isra-ball ball × any host",
    settings: |_| both(any_host, any_host::RULES, any_host::ANYTHING),
    must_fail: || {
        use ball::Rule;
        let without = |name, property, rule| {
            let mut system = any_host(true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, "keeps the rules", system)
        };
        vec![
            without("ball: values that were sent are old", any_host::MARKED, Rule::MarkOld),
            without("ball: a poll ends with its connection", ASKED, Rule::ForgetPoll),
        ]
    },
    diagrams: Vec::new,
    refined: Vec::new,
};

fn any_ball(keeps_rules: bool) -> Against<AnyBall> {
    Against::new(AnyBall { config: Exchange::steady().config, keeps_rules })
}

fn any_host(keeps_rules: bool) -> Against<AnyHost> {
    Against::new(AnyHost { config: isra_ball::BallConfig::default(), keeps_rules })
}

/// The greatest lag that is explored, in ticks: four periods.
const LAGS: u8 = 12;

fn settings(depth: Depth) -> Vec<Setting> {
    let faults = match depth {
        Depth::Quick => 2,
        Depth::Deep => 3,
    };
    let steady = Exchange { faults, ..Exchange::steady() };
    let slow = Exchange { faults, ..Exchange::slow() };
    let noisy = Exchange { noise: true, sleeps: false, ..steady };
    let mut settings = vec![
        Setting::new("no faults, a ball that measures always", Exchange { faults: 0, ..steady }),
        Setting::new(format!("{faults} faults, a ball that measures always"), steady),
        Setting::new(format!("{faults} faults, a ball that may not measure"), slow),
        Setting::new(format!("{faults} faults, noise that is a poll, a host that is called in time"), noisy),
    ];
    settings.extend((1..=LAGS).map(|lag| {
        let faults = faults - 1;
        let name = format!("faults {faults}, every packet {lag} ticks late, which is not in time");
        Setting::new(name, Exchange { faults, ..Exchange::late(lag) })
    }));
    if depth == Depth::Deep {
        let all = Exchange { noise: true, ..slow };
        settings.push(Setting::new(format!("{faults} faults, noise, a ball that may not measure"), all));
    }
    settings
}

fn must_fail() -> Vec<MustFail> {
    use host::Rule;
    let slow = Exchange { faults: 2, ..Exchange::slow() };
    let host = |rule, exchange: Exchange| Exchange { config: exchange.config.without(rule), ..exchange };
    let noisy = Exchange { noise: true, sleeps: false, ..slow };
    let patient = Exchange { config: slow.config.patient(), delay: 3, faults: 0, ..Exchange::steady() };
    let late = Exchange { delay: slow.delay + 5, faults: 0, ..slow };
    let ball =
        |rule| Exchange { ball: isra_ball::BallConfig { rules: Rules::without(rule), ..slow.ball }, ..slow };
    let two = "2 faults, a ball that may not measure";
    vec![
        MustFail::new("host: drain first", PAIRED, two, host(Rule::DrainFirst, slow)),
        MustFail::new(
            "host: await the reply",
            CLAIMED,
            "no faults, packets up to 3 ticks late",
            host(Rule::AwaitReply, patient),
        ),
        MustFail::new(
            "host: polls without a reply are farther apart",
            AGE,
            "no faults, every packet 6 ticks late, which is not in time",
            host(host::Rule::Uneven, Exchange::late(6)),
        ),
        MustFail::new(
            "host: no reply before the line can carry it",
            AGE,
            "the same, noise, a host that is called in time",
            host(Rule::NotBefore, noisy),
        ),
        MustFail::new("host: the age of values is proved", AGE, two, host(Rule::ProveAge, slow)),
        MustFail::new("host: the age counts from the poll", AGE, two, host(Rule::AgeFromPoll, slow)),
        MustFail::new("host: old values are not new", AGE, two, host(Rule::OldIsNotNew, slow)),
        MustFail::new("host: the end of a poll is reported", ONE_OUTCOME, two, host(Rule::ReportEnd, slow)),
        MustFail::new("host: the end of values is reported", STALE, two, host(Rule::ReportEnd, slow)),
        MustFail::new(
            "host: a reply proves nothing on the next connection",
            AGE,
            two,
            host(Rule::ForgetReply, slow),
        ),
        MustFail::new("ball: values that were sent are old", AGE, two, ball(ball::Rule::MarkOld)),
        MustFail::new("ball: a poll ends with its connection", ASKED, two, ball(ball::Rule::ForgetPoll)),
        MustFail::new(
            "assumption: no delay above max_delay",
            PAIRED,
            "no faults, packets up to 6 ticks late",
            late,
        ),
    ]
}

fn refined() -> Vec<Refined> {
    let noisy = Exchange { noise: true, faults: 2, ..Exchange::steady() };
    let exchanges = [Exchange { faults: 0, ..Exchange::slow() }, Exchange::slow(), noisy];
    exchanges.iter().map(refine::refine).collect()
}

fn diagrams() -> Vec<Diagram> {
    draw("isra-ball", &["host", "ball"], &settings(Depth::Quick))
}
