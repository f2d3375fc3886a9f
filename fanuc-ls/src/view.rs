//! The operation of an instruction and the options of a motion, read from their texts by the grammar.

use alloc::vec::Vec;

use crate::expression::{Expression, Item};
use crate::grammar;
use crate::instruction::Instruction;
use crate::motion::Motion;
use crate::operation::Operation;

impl Instruction {
    /// Returns the operation of the instruction. `None` for a motion, a comment, a line of a block, and for any other text, which
    /// is not understood.
    pub fn operation(&self) -> Option<Operation> {
        match self {
            Self::UserFrame(number) => Some(Operation::UserFrame(Expression::Number((*number).into()))),
            Self::UserTool(number) => Some(Operation::UserTool(Expression::Number((*number).into()))),
            Self::Other(text) => Operation::decode(text),
            Self::Empty | Self::Comment(_) | Self::Motion(_) | Self::Nested(_) => None,
        }
    }
}

impl Motion {
    /// Returns the position register of `Offset,PR[3]`, by which the target is moved in the user frame.
    pub fn offset(&self) -> Option<Item> {
        self.register_of("Offset,")
    }

    /// Returns the position register of `Tool_Offset,PR[3]`, by which the target is moved in the tool frame.
    pub fn tool_offset(&self) -> Option<Item> {
        self.register_of("Tool_Offset,")
    }

    /// Returns the options, each whole: `ACC50`, `Offset,PR[1:a name]`, `Skip,LBL[2],PR[3]=LPOS`. Text that is not an option is
    /// the last entry, as it stands.
    pub fn each_option(&self) -> Vec<&str> {
        let (mut options, mut rest) = (Vec::new(), self.options.as_str());
        loop {
            match grammar::option(rest) {
                Ok(Some((after, option))) => {
                    options.push(option.trim_end());
                    rest = after;
                }
                Ok(None) => return options,
                Err(_) => {
                    options.push(rest.trim());
                    return options;
                }
            }
        }
    }

    fn register_of(&self, option: &str) -> Option<Item> {
        let mut words = self.options.match_indices(option);
        let whole = |at: usize| {
            !self.options.get(..at).unwrap_or("").ends_with(|c: char| c == '_' || c.is_alphanumeric())
        };
        let (at, _) = words.find(|(at, _)| whole(*at))?;
        grammar::item(self.options.get(at + option.len()..)?).ok().map(|(_, item)| item)
    }
}

impl Operation {
    /// Decodes the operation in an instruction's text.
    pub fn decode(text: &str) -> Option<Self> {
        grammar::operation(text).ok()
    }
}
