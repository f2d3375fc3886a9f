//! Instructions and replies: what the items of a payload mean.

use core::ops::RangeInclusive;

use crate::error::{DecodeError, SessionError, WordUse};
use crate::message::{Item, Items};

/// One instruction, or one reply: a word, and what goes with it.
///
/// The word is the command word (命令字, §3(5)), which the controller echoes, or in a reply an error code (错误码). The
/// source gives neither its width nor its place: here it is a short of its own in front, unsigned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instruction<'a> {
    /// The command word, or the error code of a reply.
    pub word: u16,
    /// The parameters of an instruction, or the values of a query's answer.
    pub parameters: Items<'a>,
}

impl<'a> Instruction<'a> {
    /// The payload as one instruction: everything behind the word is its parameters, which are not read yet.
    ///
    /// # Errors
    /// The payload does not begin with a word.
    pub fn single(mut items: Items<'a>) -> Result<Self, DecodeError> {
        let first = items.next().ok_or(DecodeError::NoWord)??;
        let word = word_of(&first).ok_or(DecodeError::NoWord)?;
        Ok(Self { word, parameters: items })
    }
}

/// The instructions of a batch: a short of its own begins each, so no parameter can be one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instructions<'a> {
    items: Items<'a>,
}

impl<'a> Instructions<'a> {
    /// Cuts a payload into instructions.
    pub fn new(items: Items<'a>) -> Self {
        Self { items }
    }
}

impl<'a> Iterator for Instructions<'a> {
    type Item = Result<Instruction<'a>, DecodeError>;

    fn next(&mut self) -> Option<Result<Instruction<'a>, DecodeError>> {
        if self.items.is_empty() {
            return None;
        }
        Some(self.cut())
    }
}

impl<'a> Instructions<'a> {
    fn cut(&mut self) -> Result<Instruction<'a>, DecodeError> {
        let Instruction { word, parameters } = Instruction::single(self.items)?;
        let mut rest = parameters;
        loop {
            let mut behind = rest;
            match behind.next() {
                Some(item) if word_of(&item?).is_none() => rest = behind,
                _ => break,
            }
        }
        self.items = rest;
        Ok(Instruction { word, parameters: parameters.before(rest) })
    }
}

/// How the controller treats an instruction (§2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Class {
    /// Interpreted (解释执行指令): queued, and answered as soon as it is queued. Up to seven travel in one frame.
    Interpreted,
    /// Immediate (立即执行指令): executed first, then answered. Alone in its frame.
    Immediate,
    /// Query (查询指令): an immediate instruction whose answer carries values.
    Query,
}

/// What an error code says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Refusal {
    /// The checksum was wrong: the frame was dropped.
    BadChecksum,
    /// No head, or another fault of the frame: it was dropped.
    BadFrame,
    /// A command word that the controller does not know.
    UnknownCommand,
    /// More instructions than a frame may hold, or one that is not interpreted among others.
    BadBatch,
    /// Parameters that the instruction does not take, or its execution failed.
    BadParameters,
    /// The command queue has no room for the whole frame: nothing of it was queued.
    QueueFull,
}

/// The error codes of an installation. The source gives no numbers; the defaults E001h to E006h are ours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ErrorCodes {
    /// [`Refusal::BadChecksum`]. Default: E001h.
    pub bad_checksum: u16,
    /// [`Refusal::BadFrame`]. Default: E002h.
    pub bad_frame: u16,
    /// [`Refusal::UnknownCommand`]. Default: E003h.
    pub unknown_command: u16,
    /// [`Refusal::BadBatch`]. Default: E004h.
    pub bad_batch: u16,
    /// [`Refusal::BadParameters`]. Default: E005h.
    pub bad_parameters: u16,
    /// [`Refusal::QueueFull`]. Default: E006h.
    pub queue_full: u16,
}

impl ErrorCodes {
    /// The code of a refusal.
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

    /// The refusal that a code stands for.
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

/// The words of an installation: each command word has one class, and no error code is a command word, so that an echo
/// cannot be taken for an error.
///
/// The source gives no numbers. The defaults are ours: 0100h–01FFh interpreted, 0200h–02FFh immediate, 0300h–03FFh query.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Words {
    commands: &'static [(RangeInclusive<u16>, Class)],
    errors: ErrorCodes,
}

impl Words {
    /// A set of words.
    ///
    /// # Errors
    /// A word that would have two meanings.
    pub fn new(
        commands: &'static [(RangeInclusive<u16>, Class)],
        errors: ErrorCodes,
    ) -> Result<Self, SessionError> {
        for (index, (range, _)) in commands.iter().enumerate() {
            for (other, _) in commands.iter().take(index) {
                if range.start() <= other.end() && other.start() <= range.end() {
                    let word = *range.start().max(other.start());
                    return Err(SessionError::Ambiguous {
                        word,
                        first: WordUse::Command,
                        second: WordUse::Command,
                    });
                }
            }
        }
        for (index, refusal) in ALL.into_iter().enumerate() {
            let word = errors.code(refusal);
            if ALL.into_iter().take(index).any(|earlier| errors.code(earlier) == word) {
                return Err(SessionError::Ambiguous { word, first: WordUse::Error, second: WordUse::Error });
            }
            if commands.iter().any(|(range, _)| range.contains(&word)) {
                return Err(SessionError::Ambiguous {
                    word,
                    first: WordUse::Command,
                    second: WordUse::Error,
                });
            }
        }
        Ok(Self { commands, errors })
    }

    /// The class of a command word; `None` for a word that is none.
    pub fn class(&self, word: u16) -> Option<Class> {
        self.commands.iter().find(|(range, _)| range.contains(&word)).map(|(_, class)| *class)
    }

    /// The error codes.
    pub fn errors(&self) -> &ErrorCodes {
        &self.errors
    }
}

impl Default for Words {
    fn default() -> Self {
        const COMMANDS: &[(RangeInclusive<u16>, Class)] = &[
            (0x0100..=0x01FF, Class::Interpreted),
            (0x0200..=0x02FF, Class::Immediate),
            (0x0300..=0x03FF, Class::Query),
        ];
        Self { commands: COMMANDS, errors: ErrorCodes::default() }
    }
}

/// The word that an item is: a short of its own.
pub(crate) fn word_of(item: &Item<'_>) -> Option<u16> {
    match item {
        Item::I16(values) => values.array::<1>().map(|[word]| word.cast_unsigned()),
        _ => None,
    }
}
