//! Modbus: a client and a server over TCP and on a serial line.

mod any_client;
mod any_server;
mod margins;
mod pair;
mod refine;
pub mod rows;
mod world;

use fanuc_hmi_modbus::client::Rule as Client;
use fanuc_hmi_modbus::server::Rule as Server;
use fanuc_hmi_modbus::{ClientConfig, Framing, ServerConfig};
pub use margins::margins;
use robot_session::end::Rules;

pub use self::any_client::AnyClient;
pub use self::any_server::AnyServer;
use self::world::{COLLISION, COSTS, ENDS, FOREIGN_REPLY, GIVEN_UP, Job, OTHER_UNIT, STALE, Setup, TICK};
use crate::model::{Against, Depth, Diagram, MustFail, Pair, Refined, STANDSTILL, Setting, Table, at, draw};

/// The tables of the link's machines.
pub const TABLES: &[Table] = &[
    Table::of::<rows::Client<rows::Tcp>>("fanuc-hmi-modbus", 144),
    Table::of::<rows::Client<rows::Rtu>>("fanuc-hmi-modbus", 144),
    Table::of::<rows::Client<rows::RtuOverTcp>>("fanuc-hmi-modbus", 144),
    Table::of::<rows::Server<rows::Tcp>>("fanuc-hmi-modbus", 32),
    Table::of::<rows::Server<rows::Rtu>>("fanuc-hmi-modbus", 32),
    Table::of::<rows::Server<rows::RtuOverTcp>>("fanuc-hmi-modbus", 32),
];

/// Over TCP, with transactions in the frames.
pub const TCP: Pair = Pair {
    name: "fanuc-hmi-modbus client × server, tcp",
    settings: |depth| match depth {
        Depth::Quick => vec![
            Setting::new("3 requests, 2 in flight, 2 faults", tcp(3, 2, 2)),
            Setting::new("3 requests one by one, 3 faults", tcp(3, 1, 3)),
        ],
        Depth::Deep => vec![
            Setting::new("4 requests, 2 in flight, 3 faults", tcp(4, 2, 3)),
            Setting::new("4 requests one by one, 4 faults", tcp(4, 1, 4)),
        ],
    },
    must_fail: tcp_must_fail,
    diagrams: Vec::new,
    refined: || refined(&[tcp(3, 2, 2), tcp(3, 1, 2)]),
};

/// RTU on a serial line: one request at a time, and a reply does not show its request.
pub const RTU: Pair = Pair {
    name: "fanuc-hmi-modbus client × server, rtu",
    settings: |depth| match depth {
        Depth::Quick => vec![
            Setting::new("3 requests, 4 faults", rtu(&[Job::Unicast; 3], 4)),
            Setting::new("a broadcast, an absent unit, 3 faults", rtu(&MIXED, 3)),
            Setting::new("the same, a server that needs silences", strict(rtu(&MIXED, 3))),
        ],
        Depth::Deep => vec![
            Setting::new("4 requests, 6 faults", rtu(&[Job::Unicast; 4], 6)),
            Setting::new("a broadcast, an absent unit, 5 faults", rtu(&MIXED, 5)),
            Setting::new("the same, a server that needs silences", strict(rtu(&MIXED, 5))),
        ],
    },
    must_fail: rtu_must_fail,
    diagrams,
    refined: || refined(&[rtu(&[Job::Unicast; 3], 3), rtu(&MIXED, 3)]),
};

/// RTU frames through a TCP connection: one request at a time, and neither a transaction nor a silence between frames.
pub const RTU_OVER_TCP: Pair = Pair {
    name: "fanuc-hmi-modbus client × server, rtu over tcp",
    settings: |depth| match depth {
        Depth::Quick => vec![
            Setting::new("3 requests, 3 faults", rtu_over_tcp(&[Job::Unicast; 3], 3)),
            Setting::new("a broadcast, an absent unit, 2 faults", rtu_over_tcp(&MIXED, 2)),
        ],
        Depth::Deep => vec![
            Setting::new("4 requests, 4 faults", rtu_over_tcp(&[Job::Unicast; 4], 4)),
            Setting::new("a broadcast, an absent unit, 4 faults", rtu_over_tcp(&MIXED, 4)),
        ],
    },
    must_fail: rtu_over_tcp_must_fail,
    diagrams: Vec::new,
    refined: || refined(&[rtu_over_tcp(&[Job::Unicast; 3], 2), rtu_over_tcp(&MIXED, 1)]),
};

/// A server, and clients and units of other makers.
pub const ANY_CLIENT: Pair = Pair {
    name: "fanuc-hmi-modbus server × any client",
    settings: |_| {
        let each = |(name, config)| {
            [(true, any_client::RULES), (false, any_client::ANYTHING)].map(|(keeps_rules, terms)| {
                let name = format!("{name}, {}", at(keeps_rules));
                Setting::new(name, any_client(config, keeps_rules)).on(terms)
            })
        };
        servers().into_iter().flat_map(each).collect()
    },
    must_fail: || {
        let without = |name, property, config: ServerConfig, rule| {
            let config = ServerConfig { rules: Rules::without(rule), ..config };
            MustFail::walked(name, property, at(true), any_client(config, true))
        };
        let line = || rtu(&[], 0).server;
        vec![
            without("CheckUnit", OTHER_UNIT, line(), Server::CheckUnit),
            without("NoReplyToBroadcast", any_client::UNANSWERED, line(), Server::NoReplyToBroadcast),
            without("ReplyAfterSilence", COLLISION, line(), Server::ReplyAfterSilence),
            without("AnswerLast", GIVEN_UP, line(), Server::AnswerLast),
            without("AwaitRest", any_client::REST, line(), Server::AwaitRest),
            without("DropReplies", any_client::ANSWERED, ServerConfig::tcp(), Server::DropReplies),
            without("WaitForPlace", any_client::TAKEN, ServerConfig::tcp(), Server::WaitForPlace),
        ]
    },
    diagrams: Vec::new,
    refined: || {
        let each = |(_, config)| [true, false].map(|keeps_rules| any_client(config, keeps_rules).refined());
        servers().into_iter().flat_map(each).collect()
    },
};

/// A client, and servers of other makers.
pub const ANY_SERVER: Pair = Pair {
    name: "fanuc-hmi-modbus client × any server",
    settings: |_| {
        let each = |name: &str, peer: AnyServer| {
            [(true, "keeps the rules", any_server::RULES), (false, "does anything", any_server::ANYTHING)]
                .map(|(keeps_rules, what, terms)| {
                    let system = Against::new(AnyServer { keeps_rules, ..peer });
                    Setting::new(format!("{name}, {what}"), system).on(terms)
                })
        };
        each("tcp, 2 in flight", any_server(tcp(0, 2, 0).client, 3))
            .into_iter()
            .chain(each("rtu", on_line()))
            .chain(each("rtu over tcp", any_server(rtu_over_tcp(&[], 0).client, 4)))
            .collect()
    },
    must_fail: || {
        let case = |name, property, peer: AnyServer| {
            let what = if peer.keeps_rules { "keeps the rules" } else { "does anything" };
            MustFail::new(name, property, what, Against::new(peer))
        };
        let without = |rule, peer: AnyServer| {
            let config = ClientConfig { rules: Rules::without(rule), ..peer.config };
            AnyServer { config, ..peer }
        };
        let tcp = || any_server(tcp(0, 2, 0).client, 3);
        let anything = AnyServer { keeps_rules: false, ..tcp() };
        let mut few = tcp();
        few.config.transactions = 2;
        let mut two = on_line();
        two.config.in_flight = 2;
        let mut no_settle = on_line();
        no_settle.config.settle = core::time::Duration::ZERO;
        vec![
            case("MatchTransaction", FOREIGN_REPLY, without(Client::MatchTransaction, tcp())),
            case("FreshTransaction", FOREIGN_REPLY, without(Client::FreshTransaction, few)),
            case("CheckReply", any_server::FITS, without(Client::CheckReply, anything)),
            case("DoubtException", any_server::DATA, without(Client::DoubtException, on_line())),
            case("AwaitRest", any_server::REST, without(Client::AwaitRest, on_line())),
            case("ProveEcho", any_server::PROVEN, without(Client::ProveEcho, on_line())),
            case("ProveReply", any_server::RETURNED, without(Client::ProveReply, on_line())),
            case("EndAtDisconnect", ENDS, without(Client::EndAtDisconnect, tcp())),
            case("DropQueued", STALE, without(Client::DropQueued, tcp())),
            case("OneInFlight", FOREIGN_REPLY, without(Client::OneInFlight, two)),
            case("DrainFirst", FOREIGN_REPLY, without(Client::DrainFirst, on_line())),
            case("WaitForSilence", COLLISION, without(Client::WaitForSilence, on_line())),
            case("settle", FOREIGN_REPLY, no_settle),
        ]
    },
    diagrams: Vec::new,
    refined: Vec::new,
};

/// Returns a server of each framing.
fn servers() -> [(&'static str, ServerConfig); 3] {
    let tcp = ServerConfig { unit: Some(1), broadcast: true, ..ServerConfig::tcp() };
    [("tcp", tcp), ("rtu", rtu(&[], 0).server), ("rtu over tcp", rtu_over_tcp(&[], 0).server)]
}

/// Returns a client about which only the rules are known, or nothing.
fn any_client(config: ServerConfig, keeps_rules: bool) -> Against<AnyClient> {
    Against::new(AnyClient { config, keeps_rules })
}

/// Returns a server that answers as late as the client assumes, over TCP up to `memory` requests later.
fn any_server(config: ClientConfig, memory: u8) -> AnyServer {
    AnyServer { config: ClientConfig { transactions: 7, ..config }, keeps_rules: true, memory }
}

fn on_line() -> AnyServer {
    any_server(rtu(&[], 0).client, 4)
}

const MIXED: [Job; 4] = [Job::Unicast, Job::Broadcast, Job::Absent, Job::Unicast];

fn tcp(jobs: usize, in_flight: usize, faults: u8) -> Setup {
    let client = ClientConfig { in_flight, timeout: TICK, ..ClientConfig::tcp() };
    Setup { client, server: ServerConfig::tcp(), jobs: vec![Job::Unicast; jobs], faults, strict: false }
}

fn rtu(jobs: &[Job], faults: u8) -> Setup {
    let framing = Framing::Rtu { silence: TICK };
    let client = ClientConfig {
        framing,
        timeout: 2 * TICK,
        // Every fault can make the reply a tick later.
        settle: u32::from(faults.max(2)) * TICK,
        turnaround: 3 * TICK,
        broadcast: true,
        ..ClientConfig::tcp()
    };
    let server = ServerConfig {
        framing,
        unit: Some(1),
        broadcast: true,
        frame_timeout: 2 * TICK,
        ..ServerConfig::tcp()
    };
    Setup { client, server, jobs: jobs.to_vec(), faults, strict: false }
}

fn strict(setup: Setup) -> Setup {
    Setup { strict: true, ..setup }
}

fn rtu_over_tcp(jobs: &[Job], faults: u8) -> Setup {
    let framing = Framing::RtuOverTcp { stall: TICK };
    let mut setup = rtu(jobs, faults);
    (setup.client.framing, setup.server.framing) = (framing, framing);
    setup
}

fn refined(setups: &[Setup]) -> Vec<Refined> {
    setups.iter().map(refine::refine).collect()
}

fn without(mut setup: Setup, rule: Client) -> Setup {
    setup.client.rules = Rules::without(rule);
    setup
}

fn server_without(mut setup: Setup, rule: Server) -> Setup {
    setup.server.rules = Rules::without(rule);
    setup
}

fn tcp_must_fail() -> Vec<MustFail> {
    let case = |name, property, setup: Setup| MustFail::new(name, property, "3 requests", setup);
    let mut few = tcp(4, 1, 2);
    few.client.transactions = 1;
    vec![
        case("MatchTransaction", FOREIGN_REPLY, without(tcp(3, 2, 2), Client::MatchTransaction)),
        case("FreshTransaction", FOREIGN_REPLY, without(few, Client::FreshTransaction)),
        case("CheckReply", FOREIGN_REPLY, without(tcp(3, 1, 1), Client::CheckReply)),
        case("EndAtDisconnect", ENDS, without(tcp(3, 1, 1), Client::EndAtDisconnect)),
        case("DropQueued", STALE, without(tcp(3, 1, 1), Client::DropQueued)),
        case("DropReplies", FOREIGN_REPLY, server_without(tcp(3, 1, 2), Server::DropReplies)),
        case("WaitForPlace", COSTS, server_without(tcp(3, 1, 2), Server::WaitForPlace)),
        MustFail::new("timeout", STANDSTILL, "3 requests", patient(tcp(3, 1, 1))),
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
    // A reply can be as late as the settle time just allows.
    let mut exact = rtu(&[Job::Unicast; 3], 4);
    exact.client.settle = 2 * TICK;
    let mut no_turnaround = rtu(&[Job::Broadcast, Job::Unicast], 1);
    no_turnaround.client.turnaround = core::time::Duration::ZERO;
    vec![
        case("settle", FOREIGN_REPLY, no_settle),
        case("turnaround", COSTS, strict(no_turnaround)),
        case("OneInFlight", FOREIGN_REPLY, without(two, Client::OneInFlight)),
        case("CheckReply", FOREIGN_REPLY, without(unicast(), Client::CheckReply)),
        case("DrainFirst", FOREIGN_REPLY, without(unicast(), Client::DrainFirst)),
        case("ReadBeforeSend", FOREIGN_REPLY, without(exact, Client::ReadBeforeSend)),
        case("WaitForSilence", COLLISION, without(unicast(), Client::WaitForSilence)),
        case("CutAtSilence", COSTS, without(unicast(), Client::CutAtSilence)),
        case("CheckUnit", OTHER_UNIT, server_without(mixed(), Server::CheckUnit)),
        case(
            "NoReplyToBroadcast",
            FOREIGN_REPLY,
            server_without(rtu(&[Job::Broadcast, Job::Unicast], 2), Server::NoReplyToBroadcast),
        ),
        case("ReplyAfterSilence", COLLISION, server_without(unicast(), Server::ReplyAfterSilence)),
    ]
}

fn rtu_over_tcp_must_fail() -> Vec<MustFail> {
    let unicast = || rtu_over_tcp(&[Job::Unicast; 3], 2);
    let case = |name, property, setup: Setup| MustFail::new(name, property, "3 requests", setup);
    let mut no_settle = unicast();
    no_settle.client.settle = core::time::Duration::ZERO;
    let mut two = unicast();
    two.client.in_flight = 2;
    vec![
        case("settle", FOREIGN_REPLY, no_settle),
        case("timeout", STANDSTILL, patient(unicast())),
        case("OneInFlight", FOREIGN_REPLY, without(two, Client::OneInFlight)),
        case("CutAtSilence", COSTS, without(unicast(), Client::CutAtSilence)),
        case("DropReplies", FOREIGN_REPLY, server_without(unicast(), Server::DropReplies)),
    ]
}

/// Returns a client without a timeout.
fn patient(mut setup: Setup) -> Setup {
    setup.client.timeout = core::time::Duration::MAX;
    setup
}

fn diagrams() -> Vec<Diagram> {
    let systems = [("tcp", tcp(3, 2, 1)), ("rtu", rtu(&MIXED, 1)), ("rtu over tcp", rtu_over_tcp(&MIXED, 1))];
    let settings = systems.map(|(name, setup)| Setting::new(name, setup));
    draw("fanuc-hmi-modbus", &["client", "server"], &settings)
}
