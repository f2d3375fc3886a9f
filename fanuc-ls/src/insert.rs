//! Statements and positions that are added to a [`Document`], and positions that are removed.

use alloc::format;
use alloc::string::String;

use crate::document::Document;
use crate::edit::printed;
use crate::error::EncodeError;
use crate::expression::ItemKind;
use crate::parts::at;
use crate::position::Position;

impl Document {
    /// Inserts a statement before the statement `index`, which counts from 0; at the number of statements or above it, at
    /// the end. The statement has the number that follows the previous one; [`renumber_lines`](Self::renumber_lines) numbers
    /// those after it.
    ///
    /// ```
    /// use fanuc_ls::Document;
    ///
    /// let mut document = Document::decode("/PROG A\n/MN\n   1:  IF (DI[1]) THEN ;\n/END\n")?;
    /// document.insert_instruction(1, "ENDIF")?;
    /// assert!(document.as_str().ends_with("THEN ;\n   2:  ENDIF ;\n/END\n"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// If the text would be decoded as another instruction, or if the statement would be within the block of a motion.
    pub fn insert_instruction(&mut self, index: usize, text: &str) -> Result<(), EncodeError> {
        let written = printed(index, text)?;
        let (before, rest) =
            self.parts.statements.split_at_checked(index).unwrap_or((&self.parts.statements, &[]));
        let place = match rest.first() {
            Some((_, true)) => return Err(EncodeError::Instruction { line: index.saturating_add(1) }),
            Some((range, false)) => range.start,
            None => self.parts.main.end,
        };
        let number = before.iter().filter(|(_, nested)| !nested).count() + 1;
        let end = self.line_end();
        let written = written.replace("\r\n", end);
        self.apply([(place..place, format!("{number:4}:{written} ;{end}"))].into()).map(drop)
    }

    /// Adds a position at the end of `/POS`, and that section if the file lacks it.
    ///
    /// # Errors
    /// If a position has this number, or the new one cannot be written; the document is then unchanged.
    pub fn add_position(&mut self, position: &Position) -> Result<(), EncodeError> {
        position.check()?;
        let number = position.number;
        if self
            .references()
            .any(|found| found.is_definition && (found.kind, found.number) == (ItemKind::Position, number))
        {
            return Err(EncodeError::Taken { item: ItemKind::Position, number });
        }
        let mut text = String::new();
        let place = match &self.parts.positions {
            Some(section) => section.end,
            None => {
                text.push_str("/POS\r\n");
                self.parts.main.end
            }
        };
        position.encode(&mut text);
        let edit = self.lines_edit(place..place, &text);
        self.apply([edit].into()).map(drop)
    }

    /// Removes the positions with this number from `/POS`. Returns how many there were.
    ///
    /// # Errors
    /// If the rest would not be read again; nothing has changed.
    pub fn remove_position(&mut self, number: u32) -> Result<usize, EncodeError> {
        let is_meant = |block: &&core::ops::Range<usize>| {
            Position::decode_block(at(&self.text, block)).is_ok_and(|position| position.number == number)
        };
        let edits = self.parts.blocks.iter().filter(is_meant).map(|block| (block.clone(), String::new()));
        self.apply(edits.collect())
    }
}
