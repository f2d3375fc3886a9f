use crate::content::FromPc;
use crate::dialect::Dialect;
use crate::error::MessageError;
use crate::job::{Job, Work};
use crate::message::Message;
use crate::params::Params;
use crate::role::{Field, Role};

/// The message that was read last.
#[derive(Debug)]
pub(super) struct ReceivedMessage<W> {
    pub(super) role: Role,
    pub(super) params: Params,
    /// A job's own fields.
    work: W,
    /// The reason that the last unusable message, or the job in it, cannot be used.
    pub(super) error: Option<MessageError>,
}

impl<W: Work> ReceivedMessage<W> {
    pub(super) fn new() -> Self {
        Self { role: Role::Filler, params: Params::default(), work: W::default(), error: None }
    }

    pub(super) fn number(&self, field: Field) -> u16 {
        self.params.or_zero(field)
    }

    pub(super) fn job(&self) -> Job<W> {
        Job { order: self.number(Field::Order), number: self.number(Field::Number), work: self.work }
    }

    /// Reads a message, in the order that is active.
    #[inline(always)]
    pub(super) fn read(
        &mut self,
        dialect: &Dialect,
        ranges: &W::Ranges,
        active: u16,
        message: &Message<'_>,
    ) -> FromPc {
        let (entry, own) = match dialect.read_values(message, &mut self.params) {
            Ok(read) => read,
            Err(error) => {
                (self.role, self.params, self.error) = (Role::Filler, Params::default(), Some(error));
                return FromPc::Unusable;
            }
        };
        self.role = entry.role;
        dialect.complete(entry.role, &mut self.params, active);
        // A command's own fields are the application's.
        let Some(own) = own.filter(|_| entry.role == Role::Job) else {
            return FromPc::read(entry.role, &self.params);
        };
        let read = entry.read_work(message, own, ranges, &mut self.work);
        let good = read.is_ok();
        if let Err(error) = read {
            self.error = Some(error);
        }
        FromPc::Job { order: self.number(Field::Order), number: self.number(Field::Number), good }
    }
}
