//! The `message` objects of the robot's side.

use core::fmt;

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::codes::{ErrorCode, SegmentStatus};
use super::mode::Mode;
use super::robot::{End, List, Motion, MotionPhase, RobotMessage, Start};
use super::transform::Transform;

#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Kind {
    Start,
    Motion,
    End,
}

/// Every field of every kind: a tagged enum cannot be read without an allocator.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AnyObject {
    kind: Kind,
    marked: Option<bool>,
    error: Option<ErrorCode>,
    mode: Option<Mode>,
    data: Option<List>,
    phase: Option<MotionPhase>,
    segment_status: Option<SegmentStatus>,
    segment: Option<u16>,
    percent: Option<u16>,
    transform: Option<Transform>,
}

pub(super) fn is_true(marked: &bool) -> bool {
    *marked
}

pub(super) fn is_none(error: &ErrorCode) -> bool {
    *error == ErrorCode::None
}

impl<'de> Deserialize<'de> for RobotMessage {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let object = AnyObject::deserialize(deserializer)?;
        let missing = D::Error::missing_field;
        let error = object.error;
        if error.is_some_and(|error| u8::from(error) > 7) {
            return Err(D::Error::custom("an error code has three bits"));
        }
        Ok(match object.kind {
            Kind::Start => Self::Start(Start {
                marked: object.marked.unwrap_or(true),
                error: error.unwrap_or(ErrorCode::None),
                mode: object.mode.ok_or_else(|| missing("mode"))?,
                data: object.data.ok_or_else(|| missing("data"))?,
            }),
            Kind::Motion => Self::Motion(Motion {
                phase: object.phase.ok_or_else(|| missing("phase"))?,
                error: error.ok_or_else(|| missing("error"))?,
                segment_status: object.segment_status.ok_or_else(|| missing("segment_status"))?,
                segment: object.segment.ok_or_else(|| missing("segment"))?,
                percent: object.percent.ok_or_else(|| missing("percent"))?,
                transform: object.transform,
            }),
            Kind::End => Self::End(End { error: error.ok_or_else(|| missing("error"))? }),
        })
    }
}

impl Serialize for List {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.words())
    }
}

impl<'de> Deserialize<'de> for List {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_seq(ListVisitor)
    }
}

struct ListVisitor;

impl<'de> Visitor<'de> for ListVisitor {
    type Value = List;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "up to {} words", List::MAX)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<List, A::Error> {
        let mut list = List::EMPTY;
        while let Some(word) = seq.next_element()? {
            let Some(place) = list.words.get_mut(list.len) else {
                return Err(A::Error::invalid_length(list.len + 1, &self));
            };
            *place = word;
            list.len += 1;
        }
        Ok(list)
    }
}
