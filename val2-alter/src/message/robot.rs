//! The messages of the robot controller (§3.2).

use super::codes::{ErrorCode, SegmentStatus};
use super::mode::Mode;
use super::side::{Message, Sealed};
use super::transform::Transform;
use crate::error::{DecodeError, EncodeError};
use crate::frame::Frame;
use crate::framing::Framing;

/// A message from the controller to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(untagged))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum RobotMessage {
    /// ALTER begins: to be answered.
    Start(Start),
    /// The standard message of each cycle: to be answered.
    Motion(Motion),
    /// ALTER has ended: not to be answered.
    End(End),
}

impl Sealed for RobotMessage {}

impl Message for RobotMessage {
    const MAX_DATA: usize = Frame::MAX_DATA;

    fn decode(data: &[u8], _: Framing) -> Result<Self, DecodeError> {
        let Some((&control, body)) = data.split_first() else {
            return Err(DecodeError::Length { offset: 0, found: 0 });
        };
        // Nearly every message: ALTER runs, or is interrupted.
        if control & !(INTERRUPTED | ERROR) == MARK {
            return Motion::decode(body, control).map(Self::Motion);
        }
        let error = ErrorCode::from(control & ERROR);
        match control & !MARK & !ERROR {
            STARTING => Start::decode(body, control & MARK != 0, error).map(Self::Start),
            ENDED if control & MARK != 0 => End::decode(body, error).map(Self::End),
            _ => Err(DecodeError::Control { offset: 0, found: control }),
        }
    }

    fn frame(&self) -> Frame {
        let mut frame = Frame::empty();
        match self {
            Self::Start(start) => start.fill(&mut frame),
            Self::Motion(motion) => motion.fill(&mut frame),
            Self::End(end) => frame.push([end.control()]),
        }
        frame
    }

    fn is_plausible(&self) -> bool {
        let error = match self {
            Self::Start(start) if start.marked && start.mode.is_named() => start.error,
            Self::Motion(motion) if !matches!(motion.segment_status, SegmentStatus::Other(_)) => motion.error,
            Self::End(end) => end.error,
            Self::Start(_) | Self::Motion(_) => return false,
        };
        !matches!(error, ErrorCode::Other(_))
    }
}

const MARK: u8 = 0x80;
const ERROR: u8 = 0x07;
const RUNNING: u8 = 0x00;
const STARTING: u8 = 0x20;
const INTERRUPTED: u8 = 0x40;
const ENDED: u8 = 0x60;

/// Joins three parts of a byte that do not overlap.
fn control(phase: u8, error: ErrorCode) -> u8 {
    MARK + phase + (u8::from(error) & ERROR)
}

/// The start message (§3.2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename = "start"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Start {
    /// Bit 7 of the control byte. The section on the start message leaves it out, the one on the control byte demands it:
    /// it is always written, and read either way.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "super::json::is_true"))]
    #[cfg_attr(feature = "arbitrary", arbitrary(value = true))]
    pub marked: bool,
    /// The error of the answer to the previous attempt.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "super::json::is_none"))]
    pub error: ErrorCode,
    /// The mode of the ALTER instruction.
    pub mode: Mode,
    /// The data list of the ALTER instruction.
    pub data: List,
}

impl Start {
    /// Creates a first attempt to start.
    pub fn new(mode: Mode, data: List) -> Self {
        Self { marked: true, error: ErrorCode::None, mode, data }
    }

    /// Returns the control byte on the wire.
    pub fn control(&self) -> u8 {
        control(STARTING, self.error)
    }

    #[inline(never)] // one in an ALTER: its registers are not to be saved for each standard message
    fn decode(body: &[u8], marked: bool, error: ErrorCode) -> Result<Self, DecodeError> {
        let length = DecodeError::Length { offset: 0, found: 1 + body.len() };
        let (&mode, words) = body.split_first().ok_or(length)?;
        let data = List::decode(words).ok_or(length)?;
        Ok(Self { marked, error, mode: Mode(mode), data })
    }

    fn fill(&self, frame: &mut Frame) {
        frame.push([self.control(), self.mode.0]);
        for word in self.data.words() {
            frame.push(word.to_le_bytes());
        }
    }
}

/// The data list of an ALTER instruction: up to [`List::MAX`] words. The source sets no limit; this limit makes a start
/// message no longer than the longest standard message.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
pub struct List {
    pub(super) words: [i16; List::MAX],
    pub(super) len: usize,
}

impl List {
    /// The most words.
    pub const MAX: usize = (Frame::MAX_DATA - 2) / 2;
    /// No words.
    pub const EMPTY: Self = Self { words: [0; Self::MAX], len: 0 };

    /// Creates a list of these words.
    ///
    /// # Errors
    /// If there are more than [`List::MAX`].
    pub fn new(words: &[i16]) -> Result<Self, EncodeError> {
        let mut list = Self::EMPTY;
        let room = list
            .words
            .get_mut(..words.len())
            .ok_or(EncodeError::TooLong { found: 2 + 2 * words.len(), limit: Frame::MAX_DATA })?;
        room.copy_from_slice(words);
        list.len = words.len();
        Ok(list)
    }

    /// Returns the words.
    pub fn words(&self) -> &[i16] {
        self.words.get(..self.len).unwrap_or_default()
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let (words, []) = bytes.as_chunks::<2>() else { return None };
        let mut list = Self::EMPTY;
        for (to, from) in list.words.get_mut(..words.len())?.iter_mut().zip(words) {
            *to = i16::from_le_bytes(*from);
        }
        list.len = words.len();
        Some(list)
    }
}

#[cfg(feature = "arbitrary")]
impl<'a> arbitrary::Arbitrary<'a> for List {
    fn arbitrary(u: &mut arbitrary::Unstructured<'a>) -> arbitrary::Result<Self> {
        let mut list = Self { len: u.int_in_range(0..=Self::MAX)?, ..Self::EMPTY };
        for word in list.words.iter_mut().take(list.len) {
            *word = u.arbitrary()?;
        }
        Ok(list)
    }
}

impl core::fmt::Debug for List {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.words()).finish()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for List {
    fn format(&self, f: defmt::Formatter<'_>) {
        self.words().format(f);
    }
}

/// The standard message (§3.2.2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename = "motion"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Motion {
    /// Whether ALTER runs or is interrupted by the exception subroutine.
    pub phase: MotionPhase,
    /// The error of the last reply.
    pub error: ErrorCode,
    /// The state of the current motion segment.
    pub segment_status: SegmentStatus,
    /// Counts the program's motion instructions, from 1.
    pub segment: u16,
    /// The part of the segment that is done; 16384 (40000 octal) is all of it. See [`Motion::fraction`].
    pub percent: u16,
    /// The position and orientation of the tool; `None` unless mode bit 2 requests it.
    pub transform: Option<Transform>,
}

impl Motion {
    /// `percent` when the segment is done.
    pub const DONE: u16 = 0o40000;

    /// Returns the completed part of the segment, 0.0..=1.0. A word above [`Motion::DONE`] counts as done.
    pub fn fraction(&self) -> f32 {
        f32::from(self.percent.min(Self::DONE)) / f32::from(Self::DONE)
    }

    /// Returns the control byte on the wire.
    pub fn control(&self) -> u8 {
        let phase = match self.phase {
            MotionPhase::Running => RUNNING,
            MotionPhase::Interrupted => INTERRUPTED,
        };
        control(phase, self.error)
    }

    #[inline]
    fn decode(body: &[u8], control: u8) -> Result<Self, DecodeError> {
        let length = DecodeError::Length { offset: 0, found: 1 + body.len() };
        let (&[status, segment_low, segment_high, percent_low, percent_high], rest) =
            body.split_first_chunk().ok_or(length)?;
        let transform = match rest {
            [] => None,
            bytes => Some(Transform::from_bytes(bytes.try_into().map_err(|_| length)?)),
        };
        Ok(Self {
            phase: if control & INTERRUPTED == 0 { MotionPhase::Running } else { MotionPhase::Interrupted },
            error: ErrorCode::from(control & ERROR),
            segment_status: SegmentStatus::from(status),
            segment: u16::from_le_bytes([segment_low, segment_high]),
            percent: u16::from_le_bytes([percent_low, percent_high]),
            transform,
        })
    }

    fn fill(&self, frame: &mut Frame) {
        let [segment_low, segment_high] = self.segment.to_le_bytes();
        let [percent_low, percent_high] = self.percent.to_le_bytes();
        let status = u8::from(self.segment_status);
        frame.push([self.control(), status, segment_low, segment_high, percent_low, percent_high]);
        if let Some(transform) = &self.transform {
            frame.push(transform.to_bytes());
        }
    }
}

/// The kinds of standard message: bits 5 and 6 of the control byte (01 is the start message, 11 the end).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum MotionPhase {
    /// 00: values change the path.
    Running,
    /// 10: ALTER is interrupted by a subroutine, and values have no effect.
    Interrupted,
}

/// The last message (§3.2.3).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename = "end"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct End {
    /// The reason that ALTER ended; [`ErrorCode::None`] if the program ended it.
    pub error: ErrorCode,
}

impl End {
    /// Returns the control byte on the wire.
    pub fn control(&self) -> u8 {
        control(ENDED, self.error)
    }

    /// Decodes an end message. The source gives only the control byte. The contents of a standard message may follow it,
    /// which a host does not need; a frame of any other length has lost its end mark.
    fn decode(body: &[u8], error: ErrorCode) -> Result<Self, DecodeError> {
        match body.len() {
            0 | 5 | 29 => Ok(Self { error }),
            len => Err(DecodeError::Length { offset: 0, found: 1 + len }),
        }
    }
}
