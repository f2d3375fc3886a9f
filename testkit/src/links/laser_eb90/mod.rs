//! laser-eb90: a host and a controller on a serial line.

mod any_controller;
mod any_host;
mod line_to_host;
mod machines;
mod margins;
mod pair;
pub mod rows;
mod step;
pub mod world;

use core::time::Duration;
pub use margins::margins;

use laser_eb90::controller::Rule as ControllerRule;
use laser_eb90::host::Rule as HostRule;
use laser_eb90::{ControllerConfig, HostConfig};
use robot_session::end::Rules;

use self::any_controller::AnyController;
use self::any_host::AnyHost;
use self::world::{Content, Faults, Reader, Setup};
use crate::model::{Against, Depth, MustFail, Pair, Setting, Table, at, both, draw};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Host>("laser-eb90", 160), Table::of::<rows::Controller>("laser-eb90", 64)];

/// A host and a controller on a serial line.
pub const PAIR: Pair =
    Pair { name: "laser-eb90 host × controller", settings, must_fail, diagrams, refined: Vec::new };

/// A controller and hosts of other makers.
pub const ANY_HOST: Pair = Pair {
    name: "laser-eb90 controller × any host",
    settings: |_| both(any_host, any_host::RULES, any_host::ANYTHING),
    must_fail: || {
        let without = |name, property, keeps_rules, rule| {
            let mut system = any_host(keeps_rules);
            system.peer.config.rules = Rules::without(rule);
            MustFail::new(name, property, at(keeps_rules), system)
        };
        vec![
            without("IgnoreRest", any_host::ONE_ANSWER, true, ControllerRule::IgnoreRest),
            without("IgnoreShort", any_host::ONE_ANSWER, true, ControllerRule::IgnoreShort),
            without("TrustSilence", any_host::INNER, true, ControllerRule::TrustSilence),
            without("TrustSilence", any_host::INNER, false, ControllerRule::TrustSilence),
        ]
    },
    diagrams: Vec::new,
    refined: Vec::new,
};

/// A host and controllers of other makers.
pub const ANY_CONTROLLER: Pair = Pair {
    name: "laser-eb90 host × any controller",
    settings: |_| {
        let (rules, anything) = (any_controller::RULES, any_controller::ANYTHING);
        let late = Against { late: true, breaks: false, ..any_controller(true, false) };
        vec![
            Setting::new("keeps the rules", any_controller(true, false)).on(rules),
            Setting::new("keeps the rules, the host is late", late).on(rules),
            Setting::new("keeps the rules, drops first halves", any_controller(true, true)).on(rules),
            Setting::new(INSISTS, insists()).on(any_controller::INSISTS),
            Setting::new("does anything", any_controller(false, false)).on(anything),
        ]
    },
    must_fail: || {
        let rules = |name: &'static str, property, change: fn(&mut HostConfig)| {
            let mut system = any_controller(true, false);
            change(&mut system.peer.config);
            MustFail::walked(name, property, "keeps the rules", system)
        };
        let without = |name: &'static str, property, keeps_rules, rule| {
            let mut system = any_controller(keeps_rules, false);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(keeps_rules), system)
        };
        use pair::{DONE, ECHOED, ONCE, REFUSED};
        let mut unsure = insists();
        unsure.peer.config.rules = Rules::without(HostRule::UnansweredIsUnknown);
        vec![
            MustFail::walked("UnansweredIsUnknown", REFUSED, INSISTS, unsure),
            without("ConfirmLate", ECHOED, true, HostRule::ConfirmLate),
            rules("max_pause", DONE, |host| host.max_pause = Duration::ZERO),
            rules("settle", DONE, |host| host.settle = Duration::ZERO),
            rules("reply_time", ONCE, |host| host.reply_time = Duration::ZERO),
            rules("not controller_drops_partial", ONCE, |host| host.controller_drops_partial = true),
            rules("longest_frame", DONE, |host| host.longest_frame = 0),
            rules("earlier_execution", DONE, |host| host.earlier_execution = Duration::ZERO),
            without("DrainFirst", DONE, true, HostRule::DrainFirst),
            without("FinalCodes", ONCE, true, HostRule::FinalCodes),
            without("FailedIsUnknown", REFUSED, true, HostRule::FailedIsUnknown),
            without("OutlastExecution", DONE, true, HostRule::OutlastExecution),
            without("CompareWord", any_controller::CLAIMED, false, HostRule::CompareWord),
        ]
    },
    diagrams: Vec::new,
    refined: || {
        let systems = [(true, false), (true, true), (false, false)];
        systems.map(|(keeps_rules, drops)| any_controller(keeps_rules, drops).refined()).into()
    },
};

const INSISTS: &str = "keeps the rules, the host resends on silence";

/// Returns a host that sends a frame again if no answer comes.
fn insists() -> Against<AnyController> {
    let mut system = any_controller(true, false);
    system.peer.config.resend_on_silence = true;
    system
}

/// Returns a controller about which only the rules are known, or nothing.
pub fn any_controller(keeps_rules: bool, drops: bool) -> Against<AnyController> {
    Against { late: !keeps_rules, ..Against::new(AnyController::new(keeps_rules, drops)) }
}

/// Returns a host about which only the rules are known, or nothing. Two ticks are a silence. A connection that breaks within
/// a frame forgets the answers: the other setting covers that.
fn any_host(keeps_rules: bool) -> Against<AnyHost> {
    let config = ControllerConfig { tick: Duration::ZERO, ..ControllerConfig::default() };
    Against { breaks: !keeps_rules, ..Against::new(AnyHost { config, keeps_rules }) }
}

/// The faults of a line, apart from pauses and lateness.
const LINE: Faults = Faults {
    most: 1,
    pause: 0,
    cut: true,
    lose: true,
    corrupt: true,
    noise: true,
    lose_answer: true,
    corrupt_answer: true,
    late: 0,
    late_polls: true,
    queue_full: true,
    fail: false,
    crash: true,
    disconnect: true,
    restart: true,
};

/// Our controller.
pub const OURS: Reader = Reader {
    keeps: false,
    swallows: false,
    answers_headless: true,
    answers_rest: false,
    refuses_mixed: true,
};
const TWICE: Reader = Reader { answers_rest: true, ..OURS };
const KEEPS: Reader = Reader { keeps: true, ..TWICE };
const READERS: [(&str, Reader); 5] = [
    ("our controller", OURS),
    ("one that answers each half", TWICE),
    ("one that does not answer headless bytes", Reader { answers_headless: false, ..TWICE }),
    ("one that keeps the first half", KEEPS),
    ("one that keeps it and loses the next frame with it", Reader { swallows: true, ..KEEPS }),
];

/// The rules of a controller that answers each half of a frame, and accepts a frame after corrupt bytes.
const ANSWERS_REST: Rules<ControllerRule> =
    Rules::without_both(ControllerRule::IgnoreRest, ControllerRule::TrustSilence);

const INTERPRETED: [Content; 2] = [Content::Interpreted; 2];
const IMMEDIATE: [Content; 2] = [Content::Immediate; 2];

/// Ticks of 50 ms, 9600 baud, a batch of seven: 230 ms on the line. A frame may pause for 300 ms, an answer be 50 ms late.
pub fn setup(reader: Reader, jobs: &[Content], most: u8) -> Setup {
    let tick = Duration::from_millis(50);
    let (pause, late) = (6, 1);
    // An answer is late on the line, and the controller is called late, as often as there are faults.
    let lateness = late + u32::from(most);
    let immediate = jobs.iter().any(|job| *job != Content::Interpreted);
    let host = HostConfig {
        // A byte takes 1 ms.
        baud: 10_000,
        longest_frame: 250,
        answer_timeout: tick * 5,
        execution_timeout: tick * 8,
        settle: tick * (2 + lateness),
        max_pause: tick * pause,
        reply_time: tick * (1 + lateness),
        earlier_execution: if immediate { tick * 8 } else { Duration::ZERO },
        controller_drops_partial: !reader.keeps,
        backoff: tick * 2,
        full_timeout: tick * 6,
        ..HostConfig::default()
    };
    Setup {
        tick,
        line: 5,
        answer: 1,
        execution: 3,
        host,
        // A coarse tick holds cycle and answer together.
        controller: ControllerConfig {
            tick: Duration::ZERO,
            silence: tick,
            rules: if reader.answers_rest { ANSWERS_REST } else { Rules::ALL },
            ..ControllerConfig::default()
        },
        reader,
        reports_transmitted: false,
        jobs: jobs.to_vec(),
        faults: Faults { most, pause: pause as u8, late: late as u8, fail: immediate, ..LINE },
    }
}

/// Returns the same with pauses twice as long as assumed; the driver reports when a frame has left. The host does not wait
/// this long for frames of an earlier host, so it neither crashes nor disconnects here.
fn reporting(reader: Reader, jobs: &[Content], most: u8) -> Setup {
    let mut setup = setup(reader, jobs, most);
    setup.reports_transmitted = true;
    setup.faults.pause *= 2;
    (setup.faults.crash, setup.faults.disconnect) = (false, false);
    setup
}

fn settings(depth: Depth) -> Vec<Setting> {
    let (most, frames) = match depth {
        Depth::Quick => (2, 2),
        Depth::Deep => (3, 3),
    };
    let mut settings = Vec::new();
    for (name, reader) in READERS {
        for (what, content) in [("interpreted", Content::Interpreted), ("immediate", Content::Immediate)] {
            let jobs = vec![content; frames];
            let bounds = format!("{frames} {what} frames, {most} faults");
            settings.push(Setting::new(format!("{name}: {bounds}"), setup(reader, &jobs, most)));
            let name = format!("{name}: {bounds}, pauses twice as long, but reported");
            settings.push(Setting::new(name, reporting(reader, &jobs, most)));
        }
    }
    let mut insists = setup(OURS, &vec![Content::Interpreted; frames], most);
    insists.host.resend_on_silence = true;
    settings.push(Setting::new(format!("our controller: resends on silence, {most} faults"), insists));
    let mixed = [Content::Mixed, Content::Interpreted];
    settings.push(Setting::new(
        format!("our controller: a mixed frame, {most} faults"),
        setup(OURS, &mixed, most),
    ));
    settings
}

/// Returns a case for each rule of the machines that is removed: by its setting, or by its name.
fn must_fail() -> Vec<MustFail> {
    use HostRule::{
        CompareWord, ConfirmLate, DrainFirst, FailedIsUnknown, FinalCodes, OutlastExecution,
        UnansweredIsUnknown,
    };
    use pair::{DONE, DONE_WHOLE, ECHOED, ONCE, REFUSED};
    let (keeps, ours) = ("a controller that keeps the first half", "our controller");
    let configured = |rule, property, name: &str, mut setup: Setup, change: fn(&mut Setup)| {
        change(&mut setup);
        let name = format!("{name}, faults: {}", setup.faults.most);
        MustFail::new(rule, property, name, setup)
    };
    let host = |rule: HostRule, name, property, setup: Setup, at: &str| {
        let mut setup = setup;
        setup.host.rules = Rules::without(rule);
        configured(name, property, at, setup, |_| {})
    };
    let interpreted = |reader, most| setup(reader, &INTERPRETED, most);
    let immediate = |reader, most| setup(reader, &IMMEDIATE, most);
    let mut insists = interpreted(OURS, 2);
    insists.host.resend_on_silence = true;
    insists.host.resends = 1;
    let mut long = immediate(KEEPS, 2);
    long.execution = 7;
    let mut different = setup(OURS, &[Content::Immediate, Content::Interpreted], 1);
    different.execution = 20;
    vec![
        configured("max_pause", DONE, keeps, interpreted(KEEPS, 1), |s| s.host.max_pause = Duration::ZERO),
        configured("settle", ONCE, "one that answers each half", interpreted(TWICE, 2), |s| {
            s.host.settle = Duration::ZERO
        }),
        configured("reply_time", ONCE, keeps, interpreted(KEEPS, 3), |s| {
            (s.faults.pause, s.host.max_pause) = (2, s.tick * 2);
            s.host.reply_time = Duration::ZERO;
        }),
        configured("not controller_drops_partial", ONCE, keeps, interpreted(KEEPS, 2), |s| {
            s.host.controller_drops_partial = true;
        }),
        configured("longest_frame", DONE, ours, interpreted(OURS, 1), |s| {
            (s.host.longest_frame, s.host.max_pause) = (0, Duration::ZERO);
            s.faults.pause = 0;
        }),
        configured("earlier_execution", DONE, ours, immediate(OURS, 1), |s| {
            (s.execution, s.host.execution_timeout) = (20, s.tick * 22);
            s.host.earlier_execution = Duration::ZERO;
        }),
        host(DrainFirst, "DrainFirst", DONE, interpreted(OURS, 1), ours),
        host(ConfirmLate, "ConfirmLate", ECHOED, interpreted(KEEPS, 1), keeps),
        host(FinalCodes, "FinalCodes", ONCE, immediate(OURS, 1), ours),
        host(FailedIsUnknown, "FailedIsUnknown", REFUSED, immediate(OURS, 1), ours),
        host(OutlastExecution, "OutlastExecution", DONE, long, keeps),
        host(UnansweredIsUnknown, "UnansweredIsUnknown", REFUSED, insists, ours),
        host(CompareWord, "CompareWord", DONE, different, "our controller, an execution longer than assumed"),
        configured("IgnoreShort", ONCE, ours, interpreted(OURS, 2), |s| {
            s.controller.rules = Rules::without(ControllerRule::IgnoreShort);
        }),
        configured("a mixed frame is refused", DONE_WHOLE, ours, setup(OURS, &[Content::Mixed], 0), |s| {
            s.reader.refuses_mixed = false;
        }),
    ]
}

fn diagrams() -> Vec<crate::model::Diagram> {
    let jobs = [Content::Interpreted, Content::Immediate];
    let settings = [OURS, KEEPS].map(|reader| Setting::new("diagram", setup(reader, &jobs, 1)));
    draw("laser-eb90", &["host", "controller"], &settings)
}
