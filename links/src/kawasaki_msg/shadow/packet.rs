//! Packets, and the rules for those of both ends.

use core::time::Duration;

use kawasaki_msg::{Dialect, Message, Params, Role};
use serde_json::Value;

use super::ROBOT;
use crate::kawasaki_msg::bytes::written;
use crate::kawasaki_msg::plant::{field_name, role_name};
use crate::shadow::Report;

/// Messages that an end has sent together.
pub(super) struct Packet {
    pub(super) from: &'static str,
    /// When it began, and its last message.
    pub(super) begun: Duration,
    pub(super) last: Duration,
    pub(super) messages: Vec<(Role, Params)>,
    /// Some bytes of the packet are not a message of the plant.
    pub(super) is_damaged: bool,
}

impl Packet {
    /// Checks the rules for packets of both ends.
    pub(super) fn judge(&self, report: &mut Report<'_>) {
        let clause = if self.from == ROBOT { "KM-52" } else { "KM-92" };
        let once = [
            Role::Status,
            Role::Filler,
            Role::JobRequest,
            Role::Pause,
            Role::OrderStart,
            Role::OrderAck,
            Role::OrderEnd,
            Role::OrderInterrupt,
            Role::EndAck,
        ];
        for role in once {
            if self.count(role) > 1 {
                let text = format!("{} messages `{}` in one packet", self.count(role), role_name(role));
                report.rule(self.from, clause, text);
            }
        }
        if self.has(Role::Filler) && self.messages.len() > 1 {
            report.rule(self.from, clause, "a filler beside other messages");
        }
        let others: &[Role] = match self.from {
            ROBOT => &[Role::Job, Role::OrderStart, Role::OrderEnd, Role::OrderInterrupt],
            _ => &[Role::JobAck, Role::JobRequest, Role::Pause, Role::OrderAck, Role::EndAck],
        };
        for (role, _) in self.messages.iter().filter(|(role, _)| others.contains(role)) {
            report.rule(self.from, "KM-22", format!("`{}` is the other end's", role_name(*role)));
        }
    }

    pub(super) fn of(&self, wanted: Role) -> impl Iterator<Item = &Params> {
        self.messages.iter().filter(move |(role, _)| *role == wanted).map(|(_, params)| params)
    }

    pub(super) fn count(&self, role: Role) -> usize {
        self.of(role).count()
    }

    pub(super) fn has(&self, role: Role) -> bool {
        self.count(role) > 0
    }
}

/// Returns a message's role in the plant, and its parameters.
pub(super) fn read(dialect: &Dialect, message: &Value) -> Option<(Role, Params)> {
    if let Some(role) = message["role"].as_str() {
        let entry = dialect.entries().iter().find(|entry| role_name(entry.role) == role)?;
        let mut params = Params::default();
        for field in entry.header.iter().chain(entry.fields) {
            let value = field_name(*field).and_then(|name| message["values"].get(name)?.as_i64());
            if let Some(value) = value {
                params.set(*field, i32::try_from(value).ok()?);
            }
        }
        return Some((entry.role, params));
    }
    let texts = |name: &str| -> Vec<&str> {
        message[name].as_array().into_iter().flatten().filter_map(Value::as_str).collect()
    };
    let charset = dialect.charset();
    let wire = written(charset, message["name"].as_str()?, &texts("header"), &texts("fields")).ok()?;
    let (message, _) = Message::decode(&wire, charset).ok()??;
    dialect.read(&message).ok()
}
