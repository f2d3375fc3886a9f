//! Kawasaki: PC and robot over TCP and UDP.

mod any_pc;
mod any_robot;
mod machines;
mod pair;
mod refine;
mod step;
mod world;

use core::num::NonZeroU16;
use core::time::Duration;

use kawasaki_msg::pc::PcRule;
use kawasaki_msg::robot::RobotRule;
use kawasaki_msg::{Acks, PcConfig, RecoveryLimits, RobotConfig, Takeover};

pub use any_pc::{AnyPc, Peer};
pub use any_robot::AnyRobot;
pub use machines::{Pc, Robot};
pub use refine::{Refined, refine};
pub use world::TICK;
pub use world::{Act, Faults, Flags, InFlight, Reported, Sent, Setup, Start, Tag, World};

use crate::model::{Depth, Diagram, MustFail, Pair, STANDSTILL, Setting, draw};
use any_pc::{BOUND, EARLY_END, WRONG_COUNT};
use pair::{FAST, NO_ALARM, NOT_EXECUTED, TWICE};

/// The link's ends.
pub const PAIR: Pair = Pair { name: "kawasaki-msg pc × robot", settings, must_fail, diagrams };

const LINE: Faults = Faults {
    most: 1,
    split: true,
    lose: true,
    repeat: false,
    delay: true,
    corrupt: true,
    corrupt_up: true,
    late_poll: true,
    restart_pc: false,
    restart_robot: false,
    users: 0,
};
const ALL: Faults = Faults { restart_pc: true, restart_robot: true, ..LINE };
const DATAGRAMS: Faults = Faults { split: false, repeat: true, corrupt: false, corrupt_up: false, ..ALL };

/// A pair over TCP with short times: each a few ticks.
fn tcp(starts: &[u16], jobs: u32, faults: Faults) -> Setup {
    let robot = RobotConfig {
        max_number: 3,
        recovery: RecoveryLimits { resends: 1, pauses: 1, clears: 1 },
        patience: TICK * 3,
        pause: TICK * 2,
        reply_timeout: TICK * 2,
        exchange: TICK,
        silent_cycles: 2,
        reconnect_delay: TICK,
        // Only a status that comes again mends an acknowledgement that was corrupt.
        status_period: if faults.corrupt_up { TICK * 4 } else { Duration::MAX },
        ..RobotConfig::TCP
    };
    let pc = PcConfig {
        max_number: 3,
        reply_delay: Duration::ZERO,
        silence: TICK * 6,
        start_retries: 2,
        ..PcConfig::TCP
    };
    Setup {
        robot,
        pc,
        starts: starts.to_vec(),
        jobs,
        batch: 2,
        capacity: 2,
        low_water: 1,
        faults,
        filters_acks: false,
    }
}

/// The same over UDP, where every order has a new number.
fn udp(jobs: u32, faults: Faults) -> Setup {
    let tcp = tcp(&[1, 2], jobs, faults);
    let robot = RobotConfig { datagrams: true, max_number: 6, status_period: TICK * 4, ..tcp.robot };
    Setup { robot, pc: PcConfig { datagrams: true, max_number: 6, ..tcp.pc }, ..tcp }
}

/// Jobs overtake one another, and each is acknowledged by itself.
fn overtaking(setup: Setup) -> Setup {
    let robot = RobotConfig { acks: Acks::Individual, ..setup.robot };
    Setup { robot, pc: PcConfig { cumulative_acks: false, ..setup.pc }, ..setup }
}

fn every_second(setup: Setup) -> Setup {
    let acks = Acks::Cumulative { every: NonZeroU16::MIN.saturating_add(1) };
    Setup { robot: RobotConfig { acks, ..setup.robot }, ..setup }
}

fn takeover(setup: Setup, takeover: Takeover) -> Setup {
    Setup { pc: PcConfig { takeover, ..setup.pc }, ..setup }
}

fn foreign(setup: Setup) -> Setup {
    Setup { robot: RobotConfig { end_foreign_order: true, ..setup.robot }, ..setup }
}

/// A robot and a PC that is not ours.
fn any(peer: Peer, faults: u8) -> AnyPc {
    let Setup { robot, capacity, low_water, .. } = tcp(&[1], 3, Faults::default());
    let robot = RobotConfig { max_number: 6, ..robot };
    AnyPc { robot, peer, jobs: 3, capacity, low_water, faults, late: false }
}

/// A PC and a robot that is not ours.
fn any_robot(jobs: u32, users: u8) -> AnyRobot {
    let pc = PcConfig { silence: TICK * 3, ..tcp(&[1], jobs, Faults::default()).pc };
    AnyRobot { pc, starts: 2, jobs, batch: 2, users }
}

fn users(faults: Faults, most: u8, users: u8) -> Faults {
    Faults { most, users, ..faults }
}

fn settings(depth: Depth) -> Vec<Setting> {
    let mut settings = vec![
        Setting::new("TCP, starts 1, 1 of 2 jobs, no fault, a user", tcp(&[1, 1], 2, users(ALL, 0, 1))),
        Setting::new("TCP, starts 1, 1 of 2 jobs, 1 fault of any kind", tcp(&[1, 1], 2, ALL)),
        Setting::new("TCP, starts 1, 2 of 3 jobs, 1 fault of any kind", tcp(&[1, 2], 3, ALL)),
        Setting::new(
            "TCP, starts 1, 1 of 3 jobs, every 2nd acknowledged, 1 fault of any kind",
            every_second(tcp(&[1, 1], 3, ALL)),
        ),
        Setting::new(
            "TCP, jobs overtake, starts 1, 1 of 2 jobs, 1 fault of any kind",
            overtaking(tcp(&[1, 1], 2, ALL)),
        ),
        Setting::new(
            "TCP, takeover by end, starts 1, 2 of 2 jobs, 1 fault of any kind",
            takeover(tcp(&[1, 2], 2, ALL), Takeover::End),
        ),
        Setting::new(
            "TCP, no takeover, starts 1, 2 of 2 jobs, 1 fault of any kind",
            takeover(tcp(&[1, 2], 2, ALL), Takeover::Never),
        ),
        Setting::new(
            "TCP, foreign orders end, starts 1, 1 of 2 jobs, 1 fault of any kind",
            foreign(tcp(&[1, 1], 2, ALL)),
        ),
        Setting::new(
            "UDP, starts 1, 2 of 2 jobs, 1 datagram lost or repeated",
            udp(2, Faults { most: 1, lose: true, repeat: true, ..Faults::default() }),
        ),
    ];
    let late = AnyPc { late: true, ..any(Peer::Any, 0) };
    let foreign = any(Peer::Any, 0);
    let foreign = AnyPc { robot: RobotConfig { end_foreign_order: true, ..foreign.robot }, ..foreign };
    let udp_robot = any(Peer::Any, 0);
    let udp_robot = AnyPc { robot: RobotConfig { datagrams: true, ..udp_robot.robot }, ..udp_robot };
    let (lossy, insists) = (Peer::Lossy { insists: false }, Peer::Lossy { insists: true });
    settings.extend([
        Setting::new("robot × a PC that keeps the rules, 3 jobs, 2 faults", any(lossy, 2)),
        Setting::new("robot × one that sends the end whenever all is sent, 1 fault", any(insists, 1)),
        Setting::new("robot × a PC that does anything, 3 jobs", any(Peer::Any, 0)),
        Setting::new("robot × a PC that does anything, foreign orders end", foreign),
        Setting::new("robot × a PC that does anything, datagrams", udp_robot),
        Setting::new("robot × a PC that does anything, late polls", late),
        Setting::new("robot × a PC that withholds the next job", any(Peer::Withholds, 0)),
        Setting::new("PC × a robot that does anything, 2 jobs", any_robot(2, 1)),
    ]);
    if depth == Depth::Deep {
        settings.extend([
            Setting::new("PC × a robot that does anything, 4 jobs", any_robot(4, 2)),
            Setting::new(
                "TCP, starts 1, 1 of 3 jobs, 1 fault of any kind, a user",
                tcp(&[1, 1], 3, users(ALL, 1, 1)),
            ),
            Setting::new(
                "TCP, starts 1, 1 of 2 jobs, 2 faults of any kind",
                tcp(&[1, 1], 2, users(ALL, 2, 0)),
            ),
            Setting::new(
                "TCP, jobs overtake, starts 1, 1 of 3 jobs, 1 fault of any kind, a user",
                overtaking(tcp(&[1, 1], 3, users(ALL, 1, 1))),
            ),
            Setting::new(
                "UDP, start 1 of 1 job, 1 fault of any kind",
                Setup { starts: vec![1], ..udp(1, DATAGRAMS) },
            ),
            Setting::new("UDP, starts 1, 2 of 2 jobs, 1 fault of any kind", udp(2, DATAGRAMS)),
        ]);
    }
    settings
}

/// The pairs that are walked over bytes: over TCP, where jobs overtake one another, and over UDP.
pub fn refined() -> Vec<Setup> {
    let lossy = Faults { most: 1, lose: true, repeat: true, delay: true, ..Faults::default() };
    let numbers = |setup: Setup, max_number| Setup {
        robot: RobotConfig { max_number, ..setup.robot },
        pc: PcConfig { max_number, ..setup.pc },
        // A place is free when those before it are.
        capacity: 4,
        ..setup
    };
    vec![
        tcp(&[1, 1], 2, users(ALL, 0, 1)),
        tcp(&[1, 1], 2, ALL),
        every_second(tcp(&[1], 3, ALL)),
        numbers(overtaking(tcp(&[1], 2, ALL)), 6),
        udp(2, Faults { delay: false, ..lossy }),
    ]
}

fn must_fail() -> Vec<MustFail> {
    let pc = |rule, setup: Setup| Setup { pc: PcConfig { without: Some(rule), ..setup.pc }, ..setup };
    let user = |most| users(ALL, most, 1);
    let robot =
        |rule, system: AnyPc| AnyPc { robot: RobotConfig { without: Some(rule), ..system.robot }, ..system };
    let datagrams =
        |rule, setup: Setup| Setup { robot: RobotConfig { without: Some(rule), ..setup.robot }, ..setup };
    let late = Faults { most: 2, repeat: true, delay: true, restart_robot: true, ..Faults::default() };
    let lossy = Peer::Lossy { insists: false };
    vec![
        MustFail::new(
            "DestroyRest (robot)",
            EARLY_END,
            "a PC that keeps the rules, 3 jobs, 2 faults",
            robot(RobotRule::DestroyRest, any(lossy, 2)),
        ),
        MustFail::new(
            "EndFillsGap (robot)",
            EARLY_END,
            "a PC that keeps the rules, 3 jobs, 2 faults",
            robot(RobotRule::EndFillsGap, any(lossy, 2)),
        ),
        MustFail::new(
            "GapAtConnection (robot)",
            EARLY_END,
            "a PC that sends the end whenever all is sent, 1 fault",
            robot(RobotRule::GapAtConnection, any(Peer::Lossy { insists: true }, 1)),
        ),
        MustFail::new(
            "StepsByClock (robot)",
            BOUND,
            "a PC that does anything, 3 jobs",
            robot(RobotRule::StepsByClock, any(Peer::Any, 0)),
        ),
        MustFail::new(
            "ClosingIsStep (robot)",
            BOUND,
            "a PC that does anything, 3 jobs",
            robot(RobotRule::ClosingIsStep, any(Peer::Any, 0)),
        ),
        MustFail::new(
            "SlowInRest (robot)",
            FAST,
            "a PC that does anything, 3 jobs",
            robot(RobotRule::SlowInRest, any(Peer::Any, 0)),
        ),
        MustFail::new(
            "SettledTwice (robot)",
            WRONG_COUNT,
            "a PC that does anything, 3 jobs",
            robot(RobotRule::SettledTwice, any(Peer::Any, 0)),
        ),
        MustFail::new(
            "NewStarts (robot)",
            TWICE,
            "UDP, starts 1, 2 of 1 job, 2 datagrams repeated or late",
            datagrams(RobotRule::NewStarts, udp(1, Faults { restart_robot: false, ..late })),
        ),
        MustFail::new(
            "IgnoreStarts (robot)",
            TWICE,
            "UDP, start 1 of 1 job, 2 datagrams repeated or late or a restart",
            datagrams(RobotRule::IgnoreStarts, Setup { starts: vec![1], ..udp(1, late) }),
        ),
        MustFail::new(
            "LateReports (PC)",
            pair::WHOLE,
            "UDP, starts 1, 2 of 2 jobs, 1 datagram late",
            pc(PcRule::LateReports, udp(2, Faults { most: 1, delay: true, ..Faults::default() })),
        ),
        MustFail::new(
            "acknowledgements of the current order count (PC)",
            NO_ALARM,
            "TCP, starts 1, 1 of 2 jobs, no fault, a user",
            Setup { filters_acks: true, ..tcp(&[1, 1], 2, users(Faults::default(), 0, 1)) },
        ),
        MustFail::new(
            "LearnIdentity (PC)",
            pair::COUNTED,
            "TCP, jobs overtake, starts 1, 1 of 3 jobs, 1 fault of any kind, a user",
            pc(PcRule::LearnIdentity, overtaking(tcp(&[1, 1], 3, user(1)))),
        ),
        MustFail::new(
            "CancelWaits (PC)",
            STANDSTILL,
            "TCP, starts 1, 1 of 2 jobs, no fault, a user",
            pc(PcRule::CancelWaits, tcp(&[1, 1], 2, users(Faults::default(), 0, 1))),
        ),
        MustFail::new(
            "StartOnce (PC)",
            STANDSTILL,
            "TCP, starts 1 of 2 jobs, 1 fault of any kind, a user",
            pc(PcRule::StartOnce, tcp(&[1], 2, user(1))),
        ),
        MustFail::new(
            "DoubtCorrupt (PC)",
            NOT_EXECUTED,
            "TCP, jobs overtake, starts 1 of 3 jobs, 1 fault of any kind, a user",
            pc(PcRule::DoubtCorrupt, overtaking(tcp(&[1], 3, user(1)))),
        ),
        MustFail::new(
            "Window (PC)",
            TWICE,
            "TCP, 1 of 4 jobs in packets of 3, numbers to 3, 2 faults of any kind",
            pc(PcRule::Window, Setup { batch: 3, ..tcp(&[1], 4, users(ALL, 2, 0)) }),
        ),
    ]
}

fn diagrams() -> Vec<Diagram> {
    let settings = [
        Setting::new("faults", tcp(&[1, 1], 2, ALL)),
        Setting::new("a user", tcp(&[1, 2], 3, users(ALL, 0, 2))),
    ];
    draw("kawasaki-msg", &["robot", "pc"], &settings)
}
