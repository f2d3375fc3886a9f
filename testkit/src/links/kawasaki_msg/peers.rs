//! Each end with PCs and robots of other makers.

use core::num::NonZeroU16;

use kawasaki_msg::pc::Rule as PcRule;
use kawasaki_msg::robot::Rule as RobotRule;
use kawasaki_msg::{Acks, PcConfig, RecoveryLimits, RobotConfig};
use robot_session::end::Rules;

use super::any_pc::{self as pcs, AnyPc, Behaviour, EARLY_END, WRONG_COUNT};
use super::any_robot::{self as robots, AnyRobot};
use super::pair::{NO_ALARM, ONE_OUTCOME, TWICE};
use super::tcp;
use super::world::{Faults, Setup, TICK};
use crate::model::{Depth, EndWithPeer, MustFail, Pair, PeerAssumptions, Refined, Setting};

/// The robot and PCs of other makers.
pub const ANY_PC: Pair = Pair {
    name: "kawasaki-msg robot × any pc",
    settings: with_any_pc,
    must_fail: any_pc_must_fail,
    diagrams: Vec::new,
    refined: any_pc_refined,
};

/// The PC and robots of other makers.
pub const ANY_ROBOT: Pair = Pair {
    name: "kawasaki-msg pc × any robot",
    settings: with_any_robot,
    must_fail: any_robot_must_fail,
    diagrams: Vec::new,
    refined: any_robot_refined,
};

/// Returns a PC with this behaviour.
fn any(behaviour: Behaviour, faults: u8) -> AnyPc {
    let Setup { robot, capacity, .. } = tcp(&[1], 3, Faults::default());
    let robot = RobotConfig { max_number: 6, ..robot };
    AnyPc { robot, behaviour, jobs: 3, capacity, faults, late: false }
}

fn over_datagrams(system: AnyPc) -> AnyPc {
    AnyPc { robot: RobotConfig { datagrams: true, ..system.robot }, ..system }
}

/// Returns a robot with any behaviour.
fn any_robot(jobs: u32, users: u8) -> AnyRobot {
    let pc = PcConfig {
        dialect: robots::with_command(),
        silence: TICK * 3,
        ..tcp(&[1], jobs, Faults::default()).pc
    };
    AnyRobot { pc, starts: 2, jobs, users }
}

fn individually(robot: AnyRobot) -> AnyRobot {
    AnyRobot { pc: PcConfig { cumulative_acks: false, ..robot.pc }, ..robot }
}

fn in_datagrams(robot: AnyRobot) -> AnyRobot {
    AnyRobot { pc: PcConfig { datagrams: true, ..robot.pc }, ..robot }
}

fn lossy(insists: bool) -> Behaviour {
    Behaviour::Lossy { insists, only_late: false }
}

const LATE: &str = "one that sends the end whenever all is sent, 3 late answers";

/// Returns a PC that answers late, for a robot with enough recovery steps for as many late answers.
fn late(answers: u8) -> AnyPc {
    let system = any(Behaviour::Lossy { insists: true, only_late: true }, answers);
    let recovery = RecoveryLimits { resends: 9, ..system.robot.recovery };
    AnyPc { robot: RobotConfig { recovery, ..system.robot }, ..system }
}

fn with_any_pc(_: Depth) -> Vec<Setting> {
    let free = any(Behaviour::Any, 0);
    let with = |robot| AnyPc { robot, ..free.clone() };
    let rules = PeerAssumptions {
        keeps: "KM-3, KM-94, KM-95, KM-96",
        free: "how many jobs a packet has, whether it repeats the end; the line corrupts, splits, delays and breaks",
        shows: &[],
        properties: &[TWICE, pcs::SKIPPED, EARLY_END, WRONG_COUNT, pcs::HEALTHY, NO_ALARM, pcs::BOUND],
    };
    let anything = PeerAssumptions {
        keeps: "",
        free: "any message at any time",
        shows: &[],
        properties: &[TWICE, pcs::SKIPPED, EARLY_END, WRONG_COUNT, pcs::HEALTHY, pcs::BOUND, pcs::OLD_START],
    };
    let kept = vec![
        // With three lost connections in a row the steps of recovery are used up, one of each here, and the alarm is right.
        Setting::new("one that keeps the rules, 3 jobs, 2 faults", any(lossy(false), 2).system()),
        // Assumption: a PC to which a job is requested again sends it and the following ones before the end, as the source's
        // does. If a PC does not, a late job closes the gap, and the end that follows is executed. At 3 faults two answers
        // that are both split come after the next packet, one piece after each request: the robot cannot distinguish the
        // pieces from answers.
        Setting::new("one that sends the end whenever all is sent, 2 faults", any(lossy(true), 2).system()),
    ];
    let end_foreign = with(RobotConfig { end_foreign_order: true, ..free.robot });
    let datagrams = over_datagrams(free.clone());
    let late = AnyPc { late: true, ..free.clone() };
    let free = vec![
        Setting::new("one that does anything, 3 jobs", free.system()),
        Setting::new("one that does anything, foreign orders end", end_foreign.system()),
        Setting::new("one that does anything, datagrams", datagrams.system()),
        Setting::new("one that does anything, late polls", late.system()),
        Setting::new("one that withholds the next job", any(Behaviour::Withholds, 0).system()),
    ];
    let free = free.into_iter().map(|setting| setting.on(anything));
    let late = Setting::new(LATE, self::late(3).system()).on(PeerAssumptions {
        free: "how many jobs a packet has, whether it repeats the end, when it answers",
        ..rules
    });
    kept.into_iter().map(|setting| setting.on(rules)).chain([late]).chain(free).collect()
}

fn with_any_robot(depth: Depth) -> Vec<Setting> {
    let anything = PeerAssumptions {
        keeps: "",
        free: "any message at any time",
        shows: &[
            ("KM-3", robots::SPOKEN),
            ("KM-94", robots::ENDED),
            ("KM-95", robots::REQUESTED),
            ("KM-96", robots::REQUESTED),
        ],
        properties: &[
            robots::AGAIN,
            robots::COUNTS,
            robots::REPORTED,
            robots::NUMBERS,
            robots::SPOKEN,
            robots::REQUESTED,
            robots::ENDED,
            robots::SILENCE,
            ONE_OUTCOME,
        ],
    };
    let [overtaking, datagrams] = [individually(any_robot(2, 1)), in_datagrams(any_robot(2, 1))];
    let mut settings = vec![
        Setting::new("one that does anything, 2 jobs", any_robot(2, 1).system()).on(anything),
        Setting::new("one that does anything, 2 jobs that overtake", overtaking.system()).on(anything),
        Setting::new("one that does anything, 2 jobs, datagrams", datagrams.system()).on(anything),
    ];
    if depth == Depth::Deep {
        settings.push(Setting::new("one that does anything, 8 jobs", any_robot(8, 2).system()).on(anything));
    }
    settings
}

/// Returns a robot with a PC that keeps the rules, and sends the end whenever all is sent or not.
pub(crate) fn any_pc(insists: bool) -> EndWithPeer<AnyPc> {
    any(lossy(insists), 2).system()
}

/// Returns the same with a PC that answers late.
pub(crate) fn late_pc() -> EndWithPeer<AnyPc> {
    late(3).system()
}

/// Returns a robot with a PC that does anything.
pub(crate) fn hostile_pc(datagrams: bool) -> EndWithPeer<AnyPc> {
    let pc = any(Behaviour::Any, 0);
    if datagrams { over_datagrams(pc).system() } else { pc.system() }
}

/// Returns a PC with a robot that does anything.
pub(crate) fn hostile_robot() -> EndWithPeer<AnyRobot> {
    any_robot(4, 1).system()
}

fn any_pc_refined() -> Vec<Refined> {
    // Late calls, so that the length of a stall is not counted.
    let free = AnyPc { jobs: 1, late: true, ..any(Behaviour::Any, 0) };
    let acks = |acks| {
        let pc = any(lossy(false), 1);
        AnyPc { robot: RobotConfig { acks, ..pc.robot }, ..pc }
    };
    let every_second = Acks::Cumulative { every: NonZeroU16::MIN.saturating_add(1) };
    let systems = [acks(every_second), acks(Acks::Individual), free.clone(), over_datagrams(free)];
    systems.map(|system| system.system().refined()).into()
}

fn any_robot_refined() -> Vec<Refined> {
    let robot = any_robot(1, 1);
    let overtaking = AnyRobot { starts: 1, ..individually(any_robot(2, 0)) };
    [robot.clone(), overtaking, in_datagrams(robot)].map(|robot| robot.system().refined()).into()
}

fn any_pc_must_fail() -> Vec<MustFail> {
    let case = |name, property, setting, rule, system: AnyPc| {
        let robot = RobotConfig { rules: Rules::without(rule), ..system.robot };
        MustFail::walked(name, property, setting, AnyPc { robot, ..system }.system())
    };
    let free = |name, property, rule| {
        case(name, property, "one that does anything, 3 jobs", rule, any(Behaviour::Any, 0))
    };
    let datagrams = |name, rule| {
        let system = over_datagrams(any(Behaviour::Any, 0));
        case(name, pcs::OLD_START, "one that does anything, datagrams", rule, system)
    };
    let rules = "one that keeps the rules, 3 jobs, 2 faults";
    let insists = "one that sends the end whenever all is sent, 2 faults";
    vec![
        case("DestroyRest (robot)", EARLY_END, rules, RobotRule::DestroyRest, any(lossy(false), 2)),
        case("EndFillsGap (robot)", EARLY_END, LATE, RobotRule::EndFillsGap, late(3)),
        case("GapAtConnection (robot)", EARLY_END, insists, RobotRule::GapAtConnection, any(lossy(true), 2)),
        case("CountUnanswered (robot)", EARLY_END, LATE, RobotRule::CountUnanswered, late(3)),
        free("StepsByClock (robot)", pcs::BOUND, RobotRule::StepsByClock),
        free("ClosingIsStep (robot)", pcs::BOUND, RobotRule::ClosingIsStep),
        free("SettledTwice (robot)", WRONG_COUNT, RobotRule::SettledTwice),
        datagrams("NewStarts (robot)", RobotRule::NewStarts),
        datagrams("IgnoreStarts (robot)", RobotRule::IgnoreStarts),
    ]
}

fn any_robot_must_fail() -> Vec<MustFail> {
    let system = any_robot(4, 1);
    let pc = PcConfig { rules: Rules::without(PcRule::Window), ..system.pc };
    vec![MustFail::walked(
        "Window (PC)",
        robots::NUMBERS,
        "one that does anything, 4 jobs",
        AnyRobot { pc, ..system }.system(),
    )]
}
