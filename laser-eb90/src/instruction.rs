//! Instructions and replies: the meaning of a payload's items.

use crate::error::DecodeError;
use crate::items::{Item, Items};

/// One instruction, or one reply: a word, and its parameters or values.
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
    /// Reads the payload as one instruction: everything after the word is its parameters, which are not decoded yet.
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
            let mut after = rest;
            match after.next() {
                Some(item) if word_of(&item?).is_none() => rest = after,
                _ => break,
            }
        }
        self.items = rest;
        Ok(Instruction { word, parameters: parameters.before(rest) })
    }
}

/// Returns the word that an item is, if the item is one short.
pub(crate) fn word_of(item: &Item<'_>) -> Option<u16> {
    match item {
        Item::I16(values) => values.array::<1>().map(|[word]| word.cast_unsigned()),
        _ => None,
    }
}
