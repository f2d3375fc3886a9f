//! The messages of the host (§3.3).

use super::codes::{Exception, StartCode};
use super::side::{Message, Sealed};
use crate::error::DecodeError;
use crate::frame::Frame;
use crate::framing::Framing;

/// The axes of a reply, in the order of its words and of its select bits: X, Y, Z, RX, RY, RZ.
pub const AXES: usize = 6;

/// The select byte of a reply that transmits all values.
pub(crate) const ALL: u8 = (1 << AXES) - 1;

/// A message from the host to the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum HostMessage {
    /// The answer to a start message: one data byte.
    StartReply(StartCode),
    /// The answer to a standard message.
    Reply(Reply),
}

impl Sealed for HostMessage {}

impl Message for HostMessage {
    const MAX_DATA: usize = 2 + 2 * AXES;

    fn decode(data: &[u8], framing: Framing) -> Result<Self, DecodeError> {
        match *data {
            [] => Err(DecodeError::Length { offset: 0, found: 0 }),
            [found] => StartCode::from_byte(found)
                .map(Self::StartReply)
                .ok_or(DecodeError::StartReply { offset: 0, found }),
            [exception, select, ref words @ ..] => {
                Reply::decode(exception, select, words, framing).map(Self::Reply)
            }
        }
    }

    #[inline(always)] // see `Reply::frame`
    fn frame(&self) -> Frame {
        match self {
            Self::StartReply(code) => {
                let mut frame = Frame::empty();
                frame.push([u8::from(*code)]);
                frame
            }
            Self::Reply(reply) => reply.frame(),
        }
    }

    fn is_plausible(&self) -> bool {
        match self {
            Self::StartReply(_) => true,
            Self::Reply(reply) => !matches!(reply.exception, Exception::Other(_)),
        }
    }
}

/// The answer to a standard message (§3.3.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Reply {
    /// Starts the robot's exception subroutine; none in normal operation.
    pub exception: Exception,
    /// X, Y, Z in 1/32 mm, then RX, RY, RZ in 360/65536 degrees ([`Scale`](crate::Scale)). `None` is not transmitted:
    /// its select bit is clear.
    pub values: [Option<i16>; AXES],
}

impl Reply {
    /// Creates a reply that transmits all six values.
    pub fn all(values: [i16; AXES]) -> Self {
        Self { exception: Exception::None, values: values.map(Some) }
    }

    /// A reply that transmits no value.
    pub const NOTHING: Self = Self { exception: Exception::None, values: [None; AXES] };

    /// Returns the select byte: bit *i* is set if value *i* is transmitted.
    pub fn select(&self) -> u8 {
        self.values.iter().rev().fold(0, |select, value| 2 * select + u8::from(value.is_some()))
    }

    fn decode(exception: u8, select: u8, words: &[u8], framing: Framing) -> Result<Self, DecodeError> {
        if select & !ALL != 0 && !framing.ignore_spare_select {
            return Err(DecodeError::Select { offset: 0, found: select });
        }
        let expected = 2 * (select & ALL).count_ones() as usize;
        if words.len() != expected {
            return Err(DecodeError::ReplyLength {
                offset: 0,
                expected: 2 + expected,
                found: 2 + words.len(),
            });
        }
        let mut values = [None; AXES];
        let mut words = words;
        for (axis, value) in values.iter_mut().enumerate() {
            if select >> axis & 1 != 0
                && let Some((word, rest)) = words.split_first_chunk()
            {
                *value = Some(i16::from_le_bytes(*word));
                words = rest;
            }
        }
        Ok(Self { exception: Exception::from(exception), values })
    }

    #[inline(always)] // where all values are there, little of it is left
    pub(crate) fn frame(&self) -> Frame {
        let mut frame = Frame::empty();
        frame.push([u8::from(self.exception), self.select()]);
        for value in &self.values {
            frame.push_if(value.is_some(), value.unwrap_or_default().to_le_bytes());
        }
        frame
    }
}

#[cfg(feature = "serde")]
mod json {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::{AXES, Exception, HostMessage, Reply, StartCode};

    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Kind {
        StartReply,
        Reply,
    }

    /// Every field of every kind: a tagged enum cannot be read without an allocator.
    #[derive(Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Object {
        kind: Kind,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        reply: Option<StartCode>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        exception: Option<Exception>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        values: Option<[Option<i16>; AXES]>,
    }

    impl Serialize for HostMessage {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            match *self {
                Self::StartReply(reply) => {
                    Object { kind: Kind::StartReply, reply: Some(reply), exception: None, values: None }
                }
                Self::Reply(Reply { exception, values }) => Object {
                    kind: Kind::Reply,
                    reply: None,
                    exception: Some(exception),
                    values: Some(values),
                },
            }
            .serialize(serializer)
        }
    }

    impl<'de> Deserialize<'de> for HostMessage {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
            match Object::deserialize(deserializer)? {
                Object { kind: Kind::StartReply, reply: Some(reply), exception: None, values: None } => {
                    Ok(Self::StartReply(reply))
                }
                Object {
                    kind: Kind::Reply,
                    reply: None,
                    exception: Some(exception),
                    values: Some(values),
                } => Ok(Self::Reply(Reply { exception, values })),
                _ => Err(D::Error::custom(
                    "a start_reply has exactly `reply`, a reply exactly `exception` and `values`",
                )),
            }
        }
    }
}
