//! The words of an installation: which command words there are, how each is treated, and the error codes.

use core::ops::RangeInclusive;

use crate::error::{ConfigError, WordUse};

/// The words of an installation: each command word has one class, and no error code is a command word, so that an echo
/// cannot be taken for an error.
///
/// The source gives no numbers. The defaults are the project's: 0100h–01FFh interpreted, 0200h–02FFh immediate, 0300h–03FFh
/// query.
///
/// With feature `serde` they can be loaded:
/// `{"commands":[{"first":256,"last":511,"class":"interpreted"}],"errors":{"bad_checksum":57345}}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Words {
    commands: [Range; Self::MAX_RANGES],
    len: usize,
    errors: ErrorCodes,
}

/// Command words of one class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields))]
pub(crate) struct Range {
    pub(crate) first: u16,
    pub(crate) last: u16,
    pub(crate) class: Class,
}

/// The controller's treatment of an instruction (§2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Class {
    /// Interpreted (解释执行指令): queued, and answered as soon as it is queued. Up to seven travel in one frame.
    Interpreted,
    /// Immediate (立即执行指令): executed first, then answered. Alone in its frame.
    Immediate,
    /// Query (查询指令): an immediate instruction whose answer carries values.
    Query,
}

/// The meaning of an error code.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Refusal {
    /// The checksum was wrong: the frame was dropped.
    BadChecksum,
    /// No head, or another fault of the frame: it was dropped.
    BadFrame,
    /// A command word that is unknown to the controller.
    UnknownCommand,
    /// More instructions than a frame may hold, or one that is not interpreted among others.
    BadBatch,
    /// Parameters that the instruction does not take, or its execution failed.
    BadParameters,
    /// The whole frame does not fit the command queue: nothing of it was queued.
    QueueFull,
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::BadChecksum => "wrong checksum",
            Self::BadFrame => "malformed frame",
            Self::UnknownCommand => "unknown command word",
            Self::BadBatch => "too many instructions in a frame, or one that must be alone",
            Self::BadParameters => "wrong parameters, or the execution failed",
            Self::QueueFull => "queue full",
        })
    }
}

/// The error codes of an installation. The source gives no numbers; the defaults E001h to E006h are the project's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ErrorCodes {
    /// The code of [`Refusal::BadChecksum`]. Default: E001h.
    pub bad_checksum: u16,
    /// The code of [`Refusal::BadFrame`]. Default: E002h.
    pub bad_frame: u16,
    /// The code of [`Refusal::UnknownCommand`]. Default: E003h.
    pub unknown_command: u16,
    /// The code of [`Refusal::BadBatch`]. Default: E004h.
    pub bad_batch: u16,
    /// The code of [`Refusal::BadParameters`]. Default: E005h.
    pub bad_parameters: u16,
    /// The code of [`Refusal::QueueFull`]. Default: E006h.
    pub queue_full: u16,
}

impl Words {
    /// The most ranges of command words.
    pub const MAX_RANGES: usize = 32;

    /// Creates a set of words, of ranges of command words and the error codes.
    ///
    /// # Errors
    /// A word that would have two meanings, or more than [`MAX_RANGES`](Self::MAX_RANGES) ranges.
    pub fn new(
        commands: impl IntoIterator<Item = (RangeInclusive<u16>, Class)>,
        errors: ErrorCodes,
    ) -> Result<Self, ConfigError> {
        let mut words = Self::without_commands(errors)?;
        for (range, class) in commands {
            words.add(Range { first: *range.start(), last: *range.end(), class })?;
        }
        Ok(words)
    }

    /// Returns the class of a command word; `None` for a word that is not a command word.
    pub fn class(&self, word: u16) -> Option<Class> {
        self.ranges().iter().find(|range| range.contains(word)).map(|range| range.class)
    }

    /// Returns the error codes.
    pub fn errors(&self) -> &ErrorCodes {
        &self.errors
    }

    pub(crate) fn without_commands(errors: ErrorCodes) -> Result<Self, ConfigError> {
        for (index, refusal) in ALL.into_iter().enumerate() {
            let word = errors.code(refusal);
            if ALL.into_iter().take(index).any(|earlier| errors.code(earlier) == word) {
                return Err(ConfigError::Ambiguous { word, first: WordUse::Error, second: WordUse::Error });
            }
        }
        Ok(Self { commands: [Range::NONE; Self::MAX_RANGES], len: 0, errors })
    }

    pub(crate) fn add(&mut self, range: Range) -> Result<(), ConfigError> {
        let both = |first, second, word| ConfigError::Ambiguous { word, first, second };
        if let Some(other) = self.ranges().iter().find(|other| range.overlaps(other)) {
            let word = range.first.max(other.first);
            return Err(both(WordUse::Command, WordUse::Command, word));
        }
        if let Some(refusal) = ALL.into_iter().find(|refusal| range.contains(self.errors.code(*refusal))) {
            return Err(both(WordUse::Command, WordUse::Error, self.errors.code(refusal)));
        }
        let slot = self.commands.get_mut(self.len);
        *slot.ok_or(ConfigError::TooManyRanges { limit: Self::MAX_RANGES })? = range;
        self.len += 1;
        Ok(())
    }

    pub(crate) fn ranges(&self) -> &[Range] {
        self.commands.get(..self.len).unwrap_or_default()
    }
}

impl Default for Words {
    fn default() -> Self {
        let mut commands = [Range::NONE; Self::MAX_RANGES];
        let defaults = [
            Range { first: 0x0100, last: 0x01FF, class: Class::Interpreted },
            Range { first: 0x0200, last: 0x02FF, class: Class::Immediate },
            Range { first: 0x0300, last: 0x03FF, class: Class::Query },
        ];
        for (slot, range) in commands.iter_mut().zip(defaults) {
            *slot = range;
        }
        Self { commands, len: defaults.len(), errors: ErrorCodes::default() }
    }
}

impl Range {
    const NONE: Self = Self { first: 1, last: 0, class: Class::Interpreted };

    fn contains(&self, word: u16) -> bool {
        (self.first..=self.last).contains(&word)
    }

    fn overlaps(&self, other: &Self) -> bool {
        self.first <= other.last && other.first <= self.last
    }
}

impl ErrorCodes {
    /// Returns the code of a refusal.
    pub const fn code(&self, refusal: Refusal) -> u16 {
        match refusal {
            Refusal::BadChecksum => self.bad_checksum,
            Refusal::BadFrame => self.bad_frame,
            Refusal::UnknownCommand => self.unknown_command,
            Refusal::BadBatch => self.bad_batch,
            Refusal::BadParameters => self.bad_parameters,
            Refusal::QueueFull => self.queue_full,
        }
    }

    /// Returns the refusal of a code.
    pub fn refusal(&self, code: u16) -> Option<Refusal> {
        ALL.into_iter().find(|refusal| self.code(*refusal) == code)
    }
}

impl Default for ErrorCodes {
    fn default() -> Self {
        Self {
            bad_checksum: 0xE001,
            bad_frame: 0xE002,
            unknown_command: 0xE003,
            bad_batch: 0xE004,
            bad_parameters: 0xE005,
            queue_full: 0xE006,
        }
    }
}

const ALL: [Refusal; 6] = [
    Refusal::BadChecksum,
    Refusal::BadFrame,
    Refusal::UnknownCommand,
    Refusal::BadBatch,
    Refusal::BadParameters,
    Refusal::QueueFull,
];
