//! The typed messages inside a line.

mod command;
mod in_dialect;
mod reply;

use robot_session::Encode;

pub use self::command::{BLOW, Command, Mode, VACUUM};
pub use self::in_dialect::InDialect;
pub use self::reply::{ErrorCode, Reply, Status};
use crate::error::EncodeError;
use crate::pose::Pose;

impl<P: Pose> Encode for InDialect<Command<P>> {
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.message.len_in(&self.dialect)
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.message.write(&self.dialect, out)
    }
}

impl<P: Pose> Encode for InDialect<Reply<P>> {
    type Error = EncodeError;

    fn encoded_len(&self) -> usize {
        self.message.len_in(&self.dialect)
    }

    fn encode(&self, out: &mut [u8]) -> Result<usize, EncodeError> {
        self.message.write(&self.dialect, out)
    }
}

#[cfg(feature = "bytes")]
impl<M> InDialect<M>
where
    Self: Encode<Error = EncodeError>,
{
    /// Appends the message with its end.
    ///
    /// # Errors
    /// A value does not fit its field, or the message does not fit the buffer; nothing is appended.
    pub fn append_to(&self, buffer: &mut impl bytes::BufMut) -> Result<(), EncodeError> {
        let mut bytes = [0; 52];
        let needed = self.encode(&mut bytes)?;
        if needed > buffer.remaining_mut() {
            return Err(EncodeError::Buffer { needed, found: buffer.remaining_mut() });
        }
        buffer.put_slice(bytes.get(..needed).unwrap_or_default());
        Ok(())
    }
}
