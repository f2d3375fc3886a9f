//! The messages of an answer as bytes.

use super::machine::Answer;
use super::source::{JobSource, Supply};
use super::state::JobSent;
use crate::content::FromPc;
use crate::dialect::{Dialect, Params};
use crate::error::{EncodeError, FieldError};
use crate::job::{Job, Work};
use crate::packet::{Packet, Room};
use crate::phase::Phase;
use crate::role::{Field, Role};

/// An answer that is being written.
pub(super) struct PacketAnswer<'a, 'b, S: JobSource> {
    pub(super) packet: &'a mut Packet<'b>,
    pub(super) dialect: &'a Dialect<'a>,
    pub(super) source: &'a mut Option<S>,
    pub(super) ranges: &'a <S::Work as Work>::Ranges,
    /// The job, counted from 0, that cannot be sent, and why.
    pub(super) unfit: Option<(u32, FieldError)>,
    /// Commands that wait, the first one first.
    pub(super) commands: &'a [(u8, i32)],
}

impl<S: JobSource> PacketAnswer<'_, '_, S> {
    fn write(&mut self, role: Role, params: &Params) -> bool {
        self.packet.write(self.dialect, role, params)
    }
}

impl<S: JobSource> Answer for PacketAnswer<'_, '_, S> {
    fn send(&mut self, message: FromPc) -> bool {
        let (role, params) = message.write();
        self.write(role, &params)
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
        let work = match source.job(index) {
            Supply::Job(work) => work,
            Supply::Later => return JobSent::Later,
            Supply::End => return JobSent::End,
        };
        match self.packet.push_job(self.dialect, &Job { order, number, work }, self.ranges) {
            Ok(Room::Added) => JobSent::Sent,
            Err(EncodeError::Field(error)) => {
                self.unfit = Some((index, error));
                JobSent::Later
            }
            Ok(Room::Full) | Err(_) => JobSent::NoRoom,
        }
    }

    fn is_end(&mut self, index: u32) -> bool {
        self.source.as_mut().is_some_and(|source| matches!(source.job(index), Supply::End))
    }
}
