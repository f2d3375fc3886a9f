//! Many cells to one MQTT broker, with topics and payloads of Sparkplug B.

pub mod cell;
pub mod commands;
pub mod end;
pub mod hall;
pub mod health;
pub mod holds;
pub mod hub;
pub mod links;
pub mod metric;
pub mod node;
pub mod payload;
pub mod reconnect;
pub mod refusals;
pub mod report;
pub mod uplink;

pub use hall::Hall;
pub use health::Health;
pub use hub::Hub;
