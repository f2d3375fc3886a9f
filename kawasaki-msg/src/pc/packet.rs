//! The messages of an answer as bytes.

use super::machine::Answer;
use super::source::{JobSource, Supply};
use super::state::JobSent;
use crate::content::FromPc;
use crate::dialect::{Dialect, Params};
use crate::job::Job;
use crate::packet::{Packet, Room};
use crate::phase::Phase;
use crate::role::{Field, Role};

/// An answer that is being written.
pub(super) struct PacketAnswer<'a, 'b, S> {
    pub(super) packet: &'a mut Packet<'b>,
    pub(super) dialect: &'a Dialect,
    pub(super) source: &'a mut Option<S>,
    /// Commands that wait, the first one first.
    pub(super) commands: &'a [(u8, i32)],
}

impl<S> PacketAnswer<'_, '_, S> {
    /// Whether the message is in the packet. One that no packet could hold is refused when the session is made.
    fn write(&mut self, role: Role, params: &Params) -> bool {
        let room = self.dialect.write(role, params, |message| self.packet.push(message));
        matches!(room, Ok(Room::Added))
    }
}

impl<S: JobSource> Answer for PacketAnswer<'_, '_, S> {
    fn send(&mut self, message: FromPc) -> bool {
        let of = |order| Params::default().with(Field::Order, order);
        match message {
            FromPc::Start { order, first } => {
                self.write(Role::OrderStart, &of(order).with(Field::Number, first))
            }
            FromPc::End { order } => self.write(Role::OrderEnd, &of(order)),
            FromPc::Interrupt { order } => self.write(Role::OrderInterrupt, &of(order)),
            FromPc::Filler => self.write(Role::Filler, &Params::default()),
            // They have ways of their own.
            FromPc::Status { .. } | FromPc::Job { .. } | FromPc::WrongSide | FromPc::Unusable => false,
        }
    }

    fn status(&mut self, order: u16, phase: Phase, sent: Option<u16>, executed: Option<u16>) -> bool {
        let params = Params::default()
            .with(Field::Order, order)
            .with(Field::Phase, u16::from(u8::from(phase)))
            .with(Field::Queued, sent)
            .with(Field::Executed, executed);
        self.write(Role::Status, &params)
    }

    fn command(&mut self, order: u16) -> bool {
        let Some(((id, value), rest)) = self.commands.split_first() else { return false };
        let mut params = Params::default().with(Field::Order, order);
        params.set(Field::Value, *value);
        let sent = self.write(Role::Command(*id), &params);
        if sent {
            self.commands = rest;
        }
        sent
    }

    fn job(&mut self, order: u16, number: u16, index: u32) -> JobSent {
        let Some(source) = &mut self.source else { return JobSent::Later };
        match source.line(index) {
            Supply::Line(line) if self.write(Role::Job, &Params::from_job(order, Job { number, line })) => {
                JobSent::Sent
            }
            Supply::Line(_) => JobSent::NoRoom,
            Supply::Later => JobSent::Later,
            Supply::End => JobSent::End,
        }
    }

    fn is_end(&mut self, index: u32) -> bool {
        self.source.as_mut().is_some_and(|source| source.line(index) == Supply::End)
    }
}
