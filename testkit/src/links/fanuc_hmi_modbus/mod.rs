//! Modbus: a client and a server over TCP and on a serial line.

mod pair;

use fanuc_hmi_modbus::{ClientConfig, Framing, Rule, ServerConfig};

use self::pair::{COSTS, ENDS, FOREIGN_REPLY, Job, OTHER_UNIT, STALE, Setup, TICK};
use crate::model::{Depth, Diagram, MustFail, Pair, Setting, draw};

/// Over TCP, with transactions in the frames.
pub const TCP: Pair = Pair {
    name: "fanuc-hmi-modbus client × server, tcp",
    settings: |depth| match depth {
        Depth::Quick => vec![
            Setting::new("3 requests, 2 in flight, 1 fault", tcp(3, 2, 1)),
            Setting::new("3 requests one by one, 2 faults", tcp(3, 1, 2)),
        ],
        Depth::Deep => vec![
            Setting::new("3 requests, 2 in flight, 2 faults", tcp(3, 2, 2)),
            Setting::new("4 requests one by one, 3 faults", tcp(4, 1, 3)),
        ],
    },
    must_fail: tcp_must_fail,
    diagrams: || Vec::new(),
};

/// RTU on a serial line: one request at a time, and nothing in a reply says what it answers.
pub const RTU: Pair = Pair {
    name: "fanuc-hmi-modbus client × server, rtu",
    settings: |depth| match depth {
        Depth::Quick => vec![
            Setting::new("3 requests, 2 faults", rtu(&[Job::Unicast; 3], 2)),
            Setting::new("a broadcast, an absent unit, 1 fault", rtu(&MIXED, 1)),
        ],
        Depth::Deep => vec![
            Setting::new("4 requests, 2 faults", rtu(&[Job::Unicast; 4], 2)),
            Setting::new("a broadcast, an absent unit, 2 faults", rtu(&MIXED, 2)),
        ],
    },
    must_fail: rtu_must_fail,
    diagrams,
};

const MIXED: [Job; 4] = [Job::Unicast, Job::Broadcast, Job::Absent, Job::Unicast];

fn tcp(jobs: usize, in_flight: usize, faults: u8) -> Setup {
    let client = ClientConfig { in_flight, timeout: TICK, ..ClientConfig::tcp() };
    Setup { client, server: ServerConfig::tcp(), jobs: vec![Job::Unicast; jobs], faults, tcp: true }
}

fn rtu(jobs: &[Job], faults: u8) -> Setup {
    let framing = Framing::Rtu { silence: TICK };
    let client = ClientConfig {
        framing,
        timeout: 2 * TICK,
        settle: 2 * TICK,
        turnaround: 3 * TICK,
        broadcast: true,
        ..ClientConfig::tcp()
    };
    let server = ServerConfig { framing, unit: Some(1), broadcast: true, ..ServerConfig::tcp() };
    Setup { client, server, jobs: jobs.to_vec(), faults, tcp: false }
}

fn without(mut setup: Setup, rule: Rule) -> Setup {
    setup.client.without = Some(rule);
    setup.server.without = Some(rule);
    setup
}

fn tcp_must_fail() -> Vec<MustFail> {
    let case = |name, rule, property, setup: Setup| {
        MustFail::new(name, property, "3 requests", without(setup, rule))
    };
    let mut few = tcp(4, 1, 2);
    few.client.transactions = 1;
    vec![
        case("MatchTransaction", Rule::MatchTransaction, FOREIGN_REPLY, tcp(3, 2, 2)),
        case("FreshTransaction", Rule::FreshTransaction, FOREIGN_REPLY, few),
        case("CheckReply", Rule::CheckReply, FOREIGN_REPLY, tcp(3, 1, 1)),
        case("EndAtDisconnect", Rule::EndAtDisconnect, ENDS, tcp(3, 1, 1)),
        case("DropQueued", Rule::DropQueued, STALE, tcp(3, 1, 1)),
        case("DropReplies", Rule::DropReplies, FOREIGN_REPLY, tcp(3, 1, 2)),
    ]
}

fn rtu_must_fail() -> Vec<MustFail> {
    let unicast = || rtu(&[Job::Unicast; 3], 2);
    let mixed = || rtu(&MIXED, 1);
    let case = |name, property, setup: Setup| MustFail::new(name, property, "up to 4 requests", setup);
    let mut two = unicast();
    two.client.in_flight = 2;
    let mut no_settle = unicast();
    no_settle.client.settle = core::time::Duration::ZERO;
    let mut no_turnaround = rtu(&[Job::Broadcast, Job::Unicast], 1);
    no_turnaround.client.turnaround = core::time::Duration::ZERO;
    vec![
        case("settle", FOREIGN_REPLY, no_settle),
        case("turnaround", COSTS, no_turnaround),
        case("OneInFlight", FOREIGN_REPLY, without(two, Rule::OneInFlight)),
        case("CheckReply", FOREIGN_REPLY, without(unicast(), Rule::CheckReply)),
        case("DrainFirst", FOREIGN_REPLY, without(unicast(), Rule::DrainFirst)),
        case("ReadBeforeSend", FOREIGN_REPLY, without(rtu(&[Job::Unicast; 3], 4), Rule::ReadBeforeSend)),
        case("WaitForSilence", COSTS, without(unicast(), Rule::WaitForSilence)),
        case("CutAtSilence", COSTS, without(unicast(), Rule::CutAtSilence)),
        case("CheckUnit", OTHER_UNIT, without(mixed(), Rule::CheckUnit)),
        case(
            "NoReplyToBroadcast",
            FOREIGN_REPLY,
            without(rtu(&[Job::Broadcast, Job::Unicast], 2), Rule::NoReplyToBroadcast),
        ),
        case("ReplyAfterSilence", COSTS, without(unicast(), Rule::ReplyAfterSilence)),
    ]
}

fn diagrams() -> Vec<Diagram> {
    let settings = [Setting::new("tcp", tcp(3, 2, 1)), Setting::new("rtu", rtu(&MIXED, 1))];
    draw("fanuc-hmi-modbus", &["client", "server"], &settings)
}
