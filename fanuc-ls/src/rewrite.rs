//! Edits of all of a [`Document`]: speeds, numbers of items, names, positions, line numbers. Each changes only the words in
//! question.

use alloc::collections::{BTreeMap, BTreeSet};
use alloc::format;
use alloc::string::ToString;
use alloc::vec::Vec;

use crate::attribute::Attribute;
use crate::document::Document;
use crate::edit::Edit;
use crate::error::EncodeError;
use crate::expression::ItemKind;
use crate::instruction::Instruction;
use crate::motion::{Motion, Speed};
use crate::parts::{at, offset};
use crate::position::{AxisName, Position};
use crate::statement::Statement;

impl Document {
    /// Gives motions another speed, if `speed` returns one for them. Returns the number of changed motions.
    ///
    /// ```
    /// use fanuc_ls::{Document, Speed, SpeedUnit};
    ///
    /// let text = "/PROG A\n/MN\n1:L P[1] 100mm/sec FINE ;\n2:J P[1] 100% FINE ;\n/END\n";
    /// let mut document = Document::decode(text)?;
    /// let half = |motion: &fanuc_ls::Motion| match motion.speed {
    ///     Speed::Fixed { value, unit: unit @ SpeedUnit::MmPerSec } => Some(Speed::Fixed { value: value / 2.0, unit }),
    ///     _ => None,
    /// };
    /// assert_eq!(document.set_speeds(half)?, 1);
    /// assert_eq!(document.as_str(), text.replace("100mm", "50mm"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// If a speed cannot be written; nothing has changed.
    pub fn set_speeds(
        &mut self,
        mut speed: impl FnMut(&Motion) -> Option<Speed>,
    ) -> Result<usize, EncodeError> {
        let mut edits = Vec::new();
        for index in 0..self.parts.statements.len() {
            let Some(Instruction::Motion(mut motion)) = self.instruction(index) else { continue };
            let Some(new) = speed(&motion) else { continue };
            motion.speed = new;
            edits.extend(self.motion_edit(index, &motion)?);
        }
        self.apply(edits)
    }

    /// Replaces each number of a register, input, label, position or frame. All are replaced at once, so two may be
    /// exchanged. `UFRAME_NUM=` and the positions also name frames, and `/POS` also names positions. Returns the number of
    /// changes.
    ///
    /// ```
    /// use fanuc_ls::{Document, ItemKind};
    ///
    /// let text = "/PROG A\n/MN\n1:  R[1:a]=R[2] ;\n2:  !R[1] ;\n/END\n";
    /// let mut document = Document::decode(text)?;
    /// let swap = |kind, number| match (kind, number) {
    ///     (ItemKind::Register, 1) => Some((kind, 2)),
    ///     (ItemKind::Register, 2) => Some((kind, 1)),
    ///     _ => None,
    /// };
    /// assert_eq!(document.replace_items(swap)?, 2);
    /// assert_eq!(document.as_str(), text.replace("R[1:a]=R[2]", "R[2:a]=R[1]"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// If two labels or positions would have one number, or a controller has none of it; nothing has changed.
    pub fn replace_items(
        &mut self,
        mut to: impl FnMut(ItemKind, u32) -> Option<(ItemKind, u32)>,
    ) -> Result<usize, EncodeError> {
        let mut edits: Vec<Edit> = Vec::new();
        let mut defined: BTreeMap<(bool, u32), u32> = BTreeMap::new();
        let mut changed = |kind: ItemKind, number: u32| {
            let new = to(kind, number).filter(|new| *new != (kind, number));
            if let Some((item, number)) = new
                && !item.range().contains(&number)
            {
                let (low, high) = (*item.range().start(), *item.range().end());
                return Err(EncodeError::ItemRange { item, number, low, high });
            }
            Ok(new)
        };
        let mut define = |kind: ItemKind, old: u32, new: u32| {
            let before = defined.insert((kind == ItemKind::Label, new), old);
            // One that the file has twice is its own matter.
            let is_other = before.is_some_and(|before| before != old);
            if is_other { Err(EncodeError::Taken { item: kind, number: new }) } else { Ok(()) }
        };
        let positions = self.parts.positions.as_ref().map_or(self.text.len(), |section| section.start);
        for found in self.references() {
            let new = changed(found.kind, found.number)?;
            let (kind, number) = new.unwrap_or((found.kind, found.number));
            if found.is_definition {
                define(found.kind, found.number, number)?;
            }
            if number != found.number {
                edits.push((found.digits, number.to_string()));
            }
            // In `/POS`, the letters are those of the section.
            if kind != found.kind && found.letters.start < positions {
                edits.push((found.letters, kind.to_string()));
            }
        }
        self.apply(edits)
    }

    /// Gives a register, an input, an output, a label or a position a name wherever it is named by its number, or takes its name
    /// away with an empty one. A jump does not name its label. How many places have changed.
    ///
    /// # Errors
    /// If the name would end before its end; nothing has changed.
    pub fn set_item_name(&mut self, kind: ItemKind, number: u32, name: &str) -> Result<usize, EncodeError> {
        let is_name = |c: char| !(c.is_control() || matches!(c, '[' | ']' | '"' | '{'));
        if name.trim() != name || !name.chars().all(is_name) {
            return Err(EncodeError::ItemName);
        }
        let mut edits: Vec<Edit> = Vec::new();
        let marked =
            |mark: &str| if name.is_empty() { name.to_string() } else { format!(":{mark}{name}{mark}") };
        for found in self.statement_references() {
            if (found.kind, found.number) != (kind, number) || found.is_selection {
                continue;
            }
            let is_jump = kind == ItemKind::Label && !found.is_definition;
            match found.name {
                Some(place) if !name.is_empty() => edits.push((place, name.to_string())),
                Some(place) => edits.push((found.digits.end..place.end, name.to_string())),
                None if is_jump => {}
                None => edits.push((found.digits.end..found.digits.end, marked(""))),
            }
        }
        for found in self.references().filter(|_| kind == ItemKind::Position) {
            let is_block = found.is_definition && (found.kind, found.number) == (kind, number);
            let digits = found.digits.end;
            if is_block && let Some(length) = self.text.get(digits..).and_then(|rest| rest.find(']')) {
                edits.push((digits..digits + length, marked("\"")));
            }
        }
        self.apply(edits)
    }

    /// Moves positions by X, Y and Z in mm, in the frame that each is in: those that `which` names and that are given in X,
    /// Y and Z. How many have moved, and the numbers of those that `which` names and that have no X, Y and Z.
    ///
    /// # Errors
    /// If a position cannot be written; nothing has changed.
    pub fn shift_positions(
        &mut self,
        by: [f64; 3],
        mut which: impl FnMut(&Position) -> bool,
    ) -> Result<(usize, Vec<u32>), EncodeError> {
        let (mut edits, mut others) = (Vec::new(), Vec::new());
        for mut position in self.positions() {
            if !which(&position) {
                continue;
            }
            let mut axes =
                position.groups.first_mut().map(|group| group.axes.iter_mut()).into_iter().flatten();
            let names = [AxisName::X, AxisName::Y, AxisName::Z];
            let mut found = 0;
            for axis in &mut axes {
                let by = names.iter().zip(by).find(|(name, _)| **name == axis.name);
                if let (Some((_, by)), Some(value)) = (by, &mut axis.value) {
                    // Programs of post-processors have six decimals, controllers three.
                    *value = format!("{:.6}", *value + by).parse().unwrap_or(*value);
                    found += 1;
                }
            }
            match found {
                3 => edits.extend(self.position_edit(&position)?),
                _ => others.push(position.number),
            }
        }
        Ok((self.apply(edits)?, others))
    }

    /// Numbers the lines from 1, right-aligned in four columns as controllers do, and updates LINE_COUNT. Returns the number of
    /// changed numbers.
    ///
    /// # Errors
    /// No case is known: an edit that could not be read again is not made.
    pub fn renumber_lines(&mut self) -> Result<usize, EncodeError> {
        let mut edits: Vec<Edit> = Vec::new();
        let mut number = 0usize;
        for (range, nested) in &self.parts.statements {
            let text = at(&self.text, range);
            let statement = Statement::new(text, *nested);
            if *nested {
                continue;
            }
            number += 1;
            if statement.place().is_some()
                && statement.number() != Some(number)
                && let Some(colon) = text.find(':')
            {
                edits.push((range.start..range.start + colon, format!("{number:4}")));
            }
        }
        edits.extend(self.line_count(number));
        self.apply(edits)
    }

    /// Returns the edit of the number of LINE_COUNT to `count`.
    pub(crate) fn line_count(&self, count: usize) -> Option<Edit> {
        let section = self.parts.attributes.clone()?;
        let mut attributes = self.parts.attributes(&self.text);
        let (place, _) =
            attributes.find(|(_, attribute)| attribute.as_ref().is_ok_and(Attribute::is_line_count))?;
        let value = Attribute::value_place(at(&self.text, &(place.start..section.end)))?;
        let start = offset(&self.text, value);
        Some((start..start + value.len(), count.to_string()))
    }

    /// Returns the kinds and numbers that statements and positions name.
    pub fn items(&self) -> BTreeSet<(ItemKind, u32)> {
        self.references().map(|found| (found.kind, found.number)).collect()
    }
}
