//! Modbus: a client with any server, and a server with any client, over TCP and on a serial line. Each follows the clauses that
//! the other one relies on.

mod any_client;
mod any_server;
mod line_to_client;
mod margins;
mod pieces;
mod requests;
pub mod rows;
mod world;

use core::time::Duration;

use fanuc_hmi_modbus::client::Rule as Client;
use fanuc_hmi_modbus::server::Rule as Server;
use fanuc_hmi_modbus::{ClientConfig, Framing, ServerConfig};
pub use margins::margins;
use robot_session::end::Rules;

pub use self::any_client::AnyClient;
use self::any_client::{ANSWERED, GIVEN_UP, OTHER_UNIT, TAKEN, UNANSWERED};
pub use self::any_server::AnyServer;
use self::any_server::{CUT, DATA_IS_NONE, ENDS, FITS, FOREIGN_REPLY, HEARD, PROVEN, REST, RETURNED, STALE};
use self::world::{COLLISION, FRAMINGS};
pub use self::world::{RTU, RTU_OVER_TCP};
use crate::model::{
    EndWithPeer, MustFail, Pair, PeerAssumptions, Refined, STANDSTILL, Setting, Table, Wired, at, draw,
};

/// The tables of the link's machines.
pub const TABLES: &[Table] = &[
    Table::of::<rows::Client<rows::Tcp>>("fanuc-hmi-modbus", 144),
    Table::of::<rows::Client<rows::Rtu>>("fanuc-hmi-modbus", 144),
    Table::of::<rows::Client<rows::RtuOverTcp>>("fanuc-hmi-modbus", 144),
    Table::of::<rows::Server<rows::Tcp>>("fanuc-hmi-modbus", 32),
    Table::of::<rows::Server<rows::Rtu>>("fanuc-hmi-modbus", 32),
    Table::of::<rows::Server<rows::RtuOverTcp>>("fanuc-hmi-modbus", 32),
];

/// A server, and clients and units of other makers.
pub const ANY_CLIENT: Pair = Pair {
    name: "fanuc-hmi-modbus server × any client",
    settings: |_| settings(any_client, any_client::RULES, any_client::ANYTHING),
    must_fail: || {
        let without = |name, property, framing, rule| {
            let mut system = any_client(framing, true);
            system.peer.config.rules = Rules::without(rule);
            MustFail::walked(name, property, at(true), system)
        };
        vec![
            without("CheckUnit", OTHER_UNIT, RTU, Server::CheckUnit),
            without("NoReplyToBroadcast", UNANSWERED, RTU, Server::NoReplyToBroadcast),
            without("ReplyAfterSilence", COLLISION, RTU, Server::ReplyAfterSilence),
            without("AnswerLast", GIVEN_UP, RTU, Server::AnswerLast),
            without("AwaitRest", any_client::REST, RTU, Server::AwaitRest),
            without("DropReplies", ANSWERED, Framing::Tcp, Server::DropReplies),
            without("DropReplies", ANSWERED, RTU_OVER_TCP, Server::DropReplies),
            without("WaitForPlace", TAKEN, Framing::Tcp, Server::WaitForPlace),
        ]
    },
    diagrams: || {
        let settings = settings(any_client, any_client::RULES, any_client::ANYTHING);
        draw("fanuc-hmi-modbus", &["server"], &settings)
    },
    refined: || refined(any_client),
};

/// A client, and servers of other makers.
pub const ANY_SERVER: Pair = Pair {
    name: "fanuc-hmi-modbus client × any server",
    settings: |_| settings(any_server, any_server::RULES, any_server::ANYTHING),
    must_fail: || {
        let case = |name, property, framing, keeps_rules, change: &dyn Fn(&mut ClientConfig)| {
            let mut system = any_server(framing, keeps_rules);
            change(&mut system.peer.config);
            MustFail::walked(name, property, at(keeps_rules), system)
        };
        let without = |name, property, framing, rule| {
            case(name, property, framing, true, &|config| config.rules = Rules::without(rule))
        };
        let two = |framing| {
            // A session refuses the configuration.
            let mut system = any_server(framing, true);
            system.peer.config.in_flight = 2;
            system.peer.config.rules = Rules::without(Client::OneInFlight);
            MustFail::new("OneInFlight", FOREIGN_REPLY, at(true), system)
        };
        let no_settle =
            |framing| case("settle", FOREIGN_REPLY, framing, true, &|config| config.settle = Duration::ZERO);
        let patient =
            |framing| case("timeout", STANDSTILL, framing, true, &|config| config.timeout = Duration::MAX);
        vec![
            without("MatchTransaction", FOREIGN_REPLY, Framing::Tcp, Client::MatchTransaction),
            case("FreshTransaction", FOREIGN_REPLY, Framing::Tcp, true, &|config| {
                (config.transactions, config.rules) = (2, Rules::without(Client::FreshTransaction));
            }),
            case("CheckReply", FITS, Framing::Tcp, false, &|config| {
                config.rules = Rules::without(Client::CheckReply);
            }),
            without("DoubtException", DATA_IS_NONE, RTU, Client::DoubtException),
            without("AwaitRest", REST, RTU, Client::AwaitRest),
            without("CutAtSilence", CUT, RTU, Client::CutAtSilence),
            case("CutAtSilence", CUT, RTU_OVER_TCP, false, &|config| {
                config.rules = Rules::without(Client::CutAtSilence);
            }),
            without("ProveEcho", PROVEN, RTU, Client::ProveEcho),
            without("ProveReply", RETURNED, RTU, Client::ProveReply),
            without("EndAtDisconnect", ENDS, Framing::Tcp, Client::EndAtDisconnect),
            without("DropQueued", STALE, Framing::Tcp, Client::DropQueued),
            two(RTU),
            two(RTU_OVER_TCP),
            without("DrainFirst", FOREIGN_REPLY, RTU, Client::DrainFirst),
            without("ReadBeforeSend", FOREIGN_REPLY, RTU, Client::ReadBeforeSend),
            without("WaitForSilence", COLLISION, RTU, Client::WaitForSilence),
            no_settle(RTU),
            no_settle(RTU_OVER_TCP),
            case("turnaround", HEARD, RTU, true, &|config| config.turnaround = Duration::ZERO),
            patient(Framing::Tcp),
            patient(RTU),
            patient(RTU_OVER_TCP),
        ]
    },
    diagrams: || {
        let settings = settings(any_server, any_server::RULES, any_server::ANYTHING);
        draw("fanuc-hmi-modbus", &["client"], &settings)
    },
    refined: || refined(any_server),
};

/// The settings of each framing: a peer that keeps the rules, and one that does anything.
fn settings<P: Wired>(
    system: fn(Framing, bool) -> EndWithPeer<P>,
    rules: PeerAssumptions,
    anything: PeerAssumptions,
) -> Vec<Setting> {
    let each = |(name, framing)| {
        [(true, rules), (false, anything)].map(|(keeps_rules, terms)| {
            Setting::new(format!("{name}, {}", at(keeps_rules)), system(framing, keeps_rules)).on(terms)
        })
    };
    FRAMINGS.into_iter().flat_map(each).collect()
}

/// The session of an end beside its machine, for the same settings.
fn refined<P: Wired>(system: fn(Framing, bool) -> EndWithPeer<P>) -> Vec<Refined> {
    let each = |(_, framing)| [true, false].map(|keeps_rules| system(framing, keeps_rules).refined());
    FRAMINGS.into_iter().flat_map(each).collect()
}

/// A client of which only the rules are known, or nothing.
pub fn any_client(framing: Framing, keeps_rules: bool) -> EndWithPeer<AnyClient> {
    let config: ServerConfig = world::server(framing);
    EndWithPeer::new(AnyClient { config, keeps_rules })
}

/// A server of which only the rules are known, or nothing. It answers as late as the client assumes, over TCP two requests later.
pub fn any_server(framing: Framing, keeps_rules: bool) -> EndWithPeer<AnyServer> {
    let memory = if framing == Framing::Tcp { 2 } else { 3 };
    EndWithPeer::new(AnyServer { config: world::client(framing), keeps_rules, memory })
}
