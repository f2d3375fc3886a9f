//! Kawasaki: PC and robot over TCP and UDP.

mod any_pc;
mod any_robot;
mod machines;
mod margins;
mod pair;
mod peers;
pub mod rows;
mod step;
mod text;
mod world;

use core::num::NonZeroU16;
use core::time::Duration;
pub use margins::margins;

use kawasaki_msg::pc::Rule as PcRule;
use kawasaki_msg::robot::Rule as RobotRule;
use kawasaki_msg::{Acks, PcConfig, RecoveryLimits, RobotConfig, Takeover};
use robot_session::end::Rules;

pub use any_pc::{AnyPc, Behaviour};
pub use any_robot::AnyRobot;
pub use machines::{Pc, Robot};
pub use peers::{ANY_PC, ANY_ROBOT};
pub(crate) use peers::{any_pc, hostile_pc, hostile_robot, late_pc};
pub use world::TICK;
pub use world::{Act, Faults, Flags, InFlight, ReportedStart, SentMessage, Setup, Start, Tag, World};

use crate::model::{Depth, Diagram, MustFail, Pair, STANDSTILL, Setting, Table, draw};
use pair::{NO_ALARM, NOT_EXECUTED, TWICE};

/// The tables of the link's machines.
pub const TABLES: &[Table] =
    &[Table::of::<rows::Pc>("kawasaki-msg", 248), Table::of::<rows::Robot>("kawasaki-msg", 480)];

/// PC and robot over TCP.
pub const TCP: Pair = Pair {
    name: "kawasaki-msg pc × robot, tcp",
    settings: over_tcp,
    must_fail: tcp_must_fail,
    diagrams,
    refined: Vec::new,
};

/// The same over UDP.
pub const UDP: Pair = Pair {
    name: "kawasaki-msg pc × robot, udp",
    settings: over_udp,
    must_fail: udp_must_fail,
    diagrams: Vec::new,
    refined: Vec::new,
};

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

/// Returns a pair over TCP with short times of a few ticks each.
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
        // Only a repeated status repairs a corrupt acknowledgement.
        status_period: if faults.corrupt_up { TICK * 4 } else { Duration::MAX },
        ..RobotConfig::tcp()
    };
    let pc = PcConfig {
        max_number: 3,
        reply_delay: Duration::ZERO,
        silence: TICK * 6,
        start_retries: 2,
        ..PcConfig::tcp()
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

/// Returns a pair over UDP, whose orders all have new numbers.
fn udp(jobs: u32, faults: Faults) -> Setup {
    let tcp = tcp(&[1, 2], jobs, faults);
    let robot = RobotConfig { datagrams: true, max_number: 6, status_period: TICK * 4, ..tcp.robot };
    Setup { robot, pc: PcConfig { datagrams: true, max_number: 6, ..tcp.pc }, ..tcp }
}

/// Jobs overtake one another, and each is acknowledged individually.
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

fn users(faults: Faults, most: u8, users: u8) -> Faults {
    Faults { most, users, ..faults }
}

fn over_tcp(depth: Depth) -> Vec<Setting> {
    let mut settings = vec![
        Setting::new("starts 1, 1 of 2 jobs, no fault, a user", tcp(&[1, 1], 2, users(ALL, 0, 1))),
        Setting::new("starts 1, 1 of 2 jobs, 1 fault of any kind", tcp(&[1, 1], 2, ALL)),
        Setting::new("starts 1, 2 of 3 jobs, 1 fault of any kind", tcp(&[1, 2], 3, ALL)),
        Setting::new(
            "starts 1, 1 of 3 jobs, every 2nd acknowledged, 1 fault of any kind",
            every_second(tcp(&[1, 1], 3, ALL)),
        ),
        Setting::new(
            "jobs overtake, starts 1, 1 of 2 jobs, 1 fault of any kind",
            overtaking(tcp(&[1, 1], 2, ALL)),
        ),
        Setting::new(
            "takeover by end, starts 1, 2 of 2 jobs, 1 fault of any kind",
            takeover(tcp(&[1, 2], 2, ALL), Takeover::End),
        ),
        Setting::new(
            "no takeover, starts 1, 2 of 2 jobs, 1 fault of any kind",
            takeover(tcp(&[1, 2], 2, ALL), Takeover::Never),
        ),
        Setting::new(
            "foreign orders end, starts 1, 1 of 2 jobs, 1 fault of any kind",
            foreign(tcp(&[1, 1], 2, ALL)),
        ),
    ];
    if depth == Depth::Deep {
        settings.extend([
            Setting::new(
                "starts 1, 1 of 3 jobs, 1 fault of any kind, a user",
                tcp(&[1, 1], 3, users(ALL, 1, 1)),
            ),
            Setting::new("starts 1, 1 of 2 jobs, 3 faults of any kind", tcp(&[1, 1], 2, users(ALL, 3, 0))),
            Setting::new("starts 1, 2 of 3 jobs, 2 faults of any kind", tcp(&[1, 2], 3, users(ALL, 2, 0))),
            Setting::new(
                "jobs overtake, starts 1, 1 of 3 jobs, 1 fault of any kind, a user",
                overtaking(tcp(&[1, 1], 3, users(ALL, 1, 1))),
            ),
        ]);
    }
    settings
}

fn over_udp(depth: Depth) -> Vec<Setting> {
    let lossy = Faults { most: 1, lose: true, repeat: true, ..Faults::default() };
    let mut settings =
        vec![Setting::new("starts 1, 2 of 2 jobs, 1 datagram lost or repeated", udp(2, lossy))];
    if depth == Depth::Deep {
        settings.extend([
            Setting::new(
                "start 1 of 1 job, 1 fault of any kind",
                Setup { starts: vec![1], ..udp(1, DATAGRAMS) },
            ),
            Setting::new("starts 1, 2 of 2 jobs, 1 fault of any kind", udp(2, DATAGRAMS)),
            Setting::new(
                "start 1 of 1 job, 2 faults of any kind",
                Setup { starts: vec![1], ..udp(1, users(DATAGRAMS, 2, 0)) },
            ),
        ]);
    }
    settings
}

fn tcp_must_fail() -> Vec<MustFail> {
    let pc = |rule, setup: Setup| Setup { pc: PcConfig { rules: Rules::without(rule), ..setup.pc }, ..setup };
    let user = |most| users(ALL, most, 1);
    let calm = tcp(&[1, 1], 2, users(Faults::default(), 0, 1));
    vec![
        MustFail::new(
            "acknowledgements of the current order count (PC)",
            NO_ALARM,
            "starts 1, 1 of 2 jobs, no fault, a user",
            Setup { filters_acks: true, ..calm.clone() },
        ),
        MustFail::new(
            "LearnIdentity (PC)",
            pair::COUNTED,
            "jobs overtake, starts 1, 1 of 3 jobs, 1 fault of any kind, a user",
            pc(PcRule::LearnIdentity, overtaking(tcp(&[1, 1], 3, user(1)))),
        ),
        MustFail::new(
            "CancelWaits (PC)",
            STANDSTILL,
            "starts 1, 1 of 2 jobs, no fault, a user",
            pc(PcRule::CancelWaits, calm),
        ),
        MustFail::new(
            "StartOnce (PC)",
            STANDSTILL,
            "starts 1 of 2 jobs, 1 fault of any kind, a user",
            pc(PcRule::StartOnce, tcp(&[1], 2, user(1))),
        ),
        MustFail::new(
            "DoubtCorrupt (PC)",
            NOT_EXECUTED,
            "jobs overtake, starts 1 of 3 jobs, 1 fault of any kind, a user",
            pc(PcRule::DoubtCorrupt, overtaking(tcp(&[1], 3, user(1)))),
        ),
        MustFail::new(
            "Window (PC)",
            TWICE,
            "1 of 4 jobs in packets of 3, numbers to 3, 2 faults of any kind",
            pc(PcRule::Window, Setup { batch: 3, ..tcp(&[1], 4, users(ALL, 2, 0)) }),
        ),
    ]
}

fn udp_must_fail() -> Vec<MustFail> {
    let robot = |rule, setup: Setup| Setup {
        robot: RobotConfig { rules: Rules::without(rule), ..setup.robot },
        ..setup
    };
    let pc = |rule, setup: Setup| Setup { pc: PcConfig { rules: Rules::without(rule), ..setup.pc }, ..setup };
    let late = Faults { most: 2, repeat: true, delay: true, restart_robot: true, ..Faults::default() };
    let unread = Faults { most: 4, late_poll: true, repeat: false, ..late };
    vec![
        MustFail::new(
            "NewStarts (robot)",
            TWICE,
            "starts 1, 2 of 1 job, 2 datagrams repeated or late",
            robot(RobotRule::NewStarts, udp(1, Faults { restart_robot: false, ..late })),
        ),
        MustFail::new(
            "IgnoreStarts (robot)",
            TWICE,
            "start 1 of 1 job, 2 datagrams repeated or late or a restart",
            robot(RobotRule::IgnoreStarts, Setup { starts: vec![1], ..udp(1, late) }),
        ),
        MustFail::new(
            "DrainStarts (robot)",
            TWICE,
            "start 1 of 1 job, 4 datagrams late or polls late or a restart",
            robot(RobotRule::DrainStarts, Setup { starts: vec![1], ..udp(1, unread) }),
        ),
        MustFail::new(
            "LateReports (PC)",
            pair::WHOLE,
            "starts 1, 2 of 2 jobs, 1 datagram late",
            pc(PcRule::LateReports, udp(2, Faults { most: 1, delay: true, ..Faults::default() })),
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
