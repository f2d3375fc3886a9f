use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;

use crate::attribute::Attribute;
use crate::check::CheckContext;
use crate::complete::{self, Completion};
use crate::entry::{self, Entry};
use crate::error::DecodeError;
use crate::finding::Finding;
use crate::inspect;
use crate::instruction::Instruction;
use crate::parts::{Parts, at};
use crate::position::Position;
use crate::program::{Program, Rules};
use crate::statement::Statement;

/// An LS file, to the byte: its text, and the ranges of its attributes, statements and positions.
///
/// Reads any file with `/PROG`, `/MN` and `/END`. Text that is not understood stays as it is spelled, and is one of the
/// [`findings`](Self::findings). The written file is equal to the one that was read, except for edits.
///
/// ```
/// use fanuc_ls::{Document, Instruction, Speed};
///
/// let text = "/PROG A\n/MN\n   1:L  P[1]  100mm/sec FINE    ;\n   2:  CALL WELD_ON ;\n/END\n";
/// let mut document = Document::decode(text)?;
/// assert_eq!(document.to_string(), text);
///
/// let Some(Instruction::Motion(mut motion)) = document.instruction(0) else { panic!() };
/// motion.speed = Speed::mm_per_sec(80.0);
/// document.set_motion(0, &motion)?;
/// assert_eq!(document.to_string(), text.replace("100mm", "80mm"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Document {
    pub(crate) text: String,
    pub(crate) parts: Parts,
    encoding: Encoding,
}

/// How the characters of a file are bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Encoding {
    /// UTF-8, of which ASCII is a part.
    #[default]
    Utf8,
    /// A byte a character, Latin-1, if the text is not UTF-8. Controllers write comments in the character set of their settings.
    Latin1,
}

impl Document {
    /// Reads an LS file.
    ///
    /// # Errors
    /// If it has no name, no `/MN` or no `/END`, or text follows that: it is not a program, or not a whole one.
    pub fn decode(text: &str) -> Result<Self, DecodeError> {
        Self::new(text.to_owned(), Encoding::Utf8)
    }

    /// Reads the bytes of an LS file: UTF-8, otherwise Latin-1.
    ///
    /// # Errors
    /// As [`decode`](Self::decode).
    pub fn decode_bytes(bytes: &[u8]) -> Result<Self, DecodeError> {
        match core::str::from_utf8(bytes) {
            Ok(text) => Self::decode(text),
            Err(_) => Self::new(bytes.iter().copied().map(char::from).collect(), Encoding::Latin1),
        }
    }

    fn new(text: String, encoding: Encoding) -> Result<Self, DecodeError> {
        let parts = Parts::find(&text)?;
        Ok(Self { text, parts, encoding })
    }

    /// Returns the bytes of the file with the edits. A character that Latin-1 lacks becomes `?`.
    pub fn to_bytes(&self) -> Vec<u8> {
        match self.encoding {
            Encoding::Utf8 => self.text.as_bytes().to_vec(),
            Encoding::Latin1 => self.text.chars().map(|c| u8::try_from(c).unwrap_or(b'?')).collect(),
        }
    }

    /// Returns the text of the file.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// Returns the encoding of the file.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// Returns its contents as values.
    ///
    /// # Errors
    /// The first of its findings that is [`Problem::Error`](crate::Problem::Error). Other mistakes are in values that can be
    /// read.
    pub fn program(&self) -> Result<Program, DecodeError> {
        Program::from_parts(&self.text, &self.parts)
    }

    /// Returns the findings, each once, in the sequence of the text: text that a controller would not take, and text that it
    /// takes but that the author probably did not mean. [`Problem::level`](crate::Problem::level) is the severity of each.
    pub fn findings(&self, rules: &Rules) -> Vec<Finding> {
        self.findings_among(rules, &CheckContext::default())
    }

    /// Returns the findings if other programs, macros, instructions or the file's name are known: a call of a missing
    /// program and a different file name are findings; the name of a macro or an instruction is not.
    pub fn findings_among(&self, rules: &Rules, around: &CheckContext) -> Vec<Finding> {
        inspect::find(&self.text, &self.parts, rules, around)
    }

    /// Returns the completions at a byte of the text, for an editor: instructions, registers, options, labels, positions.
    ///
    /// ```
    /// use fanuc_ls::Document;
    ///
    /// let text = "/PROG A\n/MN\n1: LBL[7] ;\n2: JMP LBL[ ;\n/END\n";
    /// let document = Document::decode(text)?;
    /// let at = text.find("[ ;").unwrap() + 1;
    /// assert_eq!(document.completions(at)[0].text, "7");
    /// # Ok::<(), fanuc_ls::DecodeError>(())
    /// ```
    pub fn completions(&self, at: usize) -> Vec<Completion> {
        complete::find(&self.text, &self.parts, at)
    }

    /// Returns the entries of the file in the sequence of the text, each with its place and the findings of its layout, which all
    /// readers of the format report. [`findings`](Self::findings) has more findings.
    ///
    /// ```
    /// use fanuc_ls::{Content, Document, Rules};
    ///
    /// let document = Document::decode("/PROG A\n/MN\n1:J P[1] 5 FINE;\n2: CALL X;\n/END\n")?;
    /// let entries = document.entries(&Rules::default());
    /// assert_eq!(entries.len(), 3); // the head and two statements
    /// assert_eq!((entries[1].content.is_none(), entries[1].findings.len()), (true, 1)); // a speed without a unit
    /// assert!(matches!(entries[2].content, Some(Content::Statement { number: Some(2), .. })));
    /// assert_eq!(&document.as_str()[entries[2].place.clone()], "2: CALL X;");
    /// # Ok::<(), fanuc_ls::DecodeError>(())
    /// ```
    pub fn entries(&self, rules: &Rules) -> Vec<Entry<'_>> {
        entry::find(&self.text, &self.parts, inspect::layout(&self.text, &self.parts, rules))
    }

    /// Returns the program's name.
    pub fn name(&self) -> &str {
        at(&self.text, &self.parts.name)
    }

    /// Returns the word after the name, such as `Macro`.
    pub fn kind(&self) -> Option<&str> {
        Some(at(&self.text, &self.parts.kind)).filter(|kind| !kind.is_empty())
    }

    /// Returns the attributes that can be decoded, in sequence.
    pub fn attributes(&self) -> impl Iterator<Item = Attribute> {
        self.parts.attributes(&self.text).filter_map(|(_, attribute)| attribute.ok())
    }

    /// Returns the statements of `/MN`, in sequence.
    pub fn statements(&self) -> impl Iterator<Item = Statement<'_>> {
        self.parts.statements(&self.text)
    }

    /// Returns the instruction of a statement; `index` counts from 0.
    pub fn instruction(&self, index: usize) -> Option<Instruction> {
        let (range, nested) = self.parts.statements.get(index)?;
        Some(Statement::new(at(&self.text, range), *nested).instruction())
    }

    /// Returns the positions that can be decoded, in sequence.
    pub fn positions(&self) -> impl Iterator<Item = Position> {
        self.parts.positions(&self.text).filter_map(Result::ok)
    }
}

impl core::str::FromStr for Document {
    type Err = DecodeError;

    fn from_str(text: &str) -> Result<Self, DecodeError> {
        Self::decode(text)
    }
}

impl fmt::Display for Document {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
