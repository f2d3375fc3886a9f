//! The parts of `cellwire-bridge`: many cells to one MQTT broker, with topics and payloads of Sparkplug B.
//!
//! This is a library only for its tests. The program is the interface; the API of this library may change at any time.

#![allow(clippy::std_instead_of_core, reason = "a program with std")]

pub mod bands;
pub mod broker;
pub mod bucket;
pub mod cell;
mod command;
pub mod commands;
pub mod compact;
pub mod end;
pub mod health;
pub mod history;
pub mod holds;
pub mod http;
pub mod hub;
pub mod lease;
pub mod ledger;
pub mod links;
pub mod metric;
pub mod node;
mod notify;
pub mod outages;
pub mod payload;
pub mod plain;
pub mod recent;
pub mod reconnect;
pub mod refusals;
pub mod report;
pub mod ring;
pub mod share;
pub mod signals;
pub mod site;
pub mod store;
pub mod uplink;

pub use command::main;
pub use health::Health;
pub use hub::Hub;
pub use site::Site;
