//! The layout that controllers print, for a [`Document`]: blanks, columns and decimals. No word becomes another one.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

use crate::attribute::{Attribute, AttributeValue};
use crate::document::Document;
use crate::edit::{Edit, words};
use crate::error::EncodeError;
use crate::instruction::Instruction;
use crate::parts::{at, offset};
use crate::position::Position;
use crate::statement::Statement;
use crate::text::{decimal_prefix, indent, push_shortest};

impl Document {
    /// Lays the text out as controllers print it: line numbers and the text after them in their columns, seconds of motions and
    /// pulses with one decimal, coordinates with three, attributes and frames in their places. Text that is not understood is
    /// unchanged, as are line ends, the spelling of words and `/APPL`. A second call has no effect. Returns the number of changed
    /// places.
    ///
    /// ```
    /// use fanuc_ls::Document;
    ///
    /// let mut document = Document::decode("/PROG A\n/MN\n1:J P[1]  .6sec FINE ;\n 2: WAIT 0.5(sec);\n/END\n")?;
    /// document.format()?;
    /// assert!(document.as_str().contains("   1:J P[1] 0.6sec FINE    ;\n   2:  WAIT    .50(sec) ;\n"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// No case is known: an edit that could not be read again is not made.
    pub fn format(&mut self) -> Result<usize, EncodeError> {
        let mut edits: Vec<Edit> = Vec::new();
        let (mut number, mut last_end) = (0, None);
        for (range, nested) in &self.parts.statements {
            let text = at(&self.text, range);
            if !nested {
                number += 1;
                edits.extend(line(text, number).map(|new| self.lines_edit(range.clone(), &new)));
            }
            // Between two lines is one line end.
            if let Some(end) = last_end.replace(range.end)
                && at(&self.text, &(end..range.start)).trim().is_empty()
            {
                edits.push((end..range.start, self.line_end().to_string()));
            }
        }
        let count = self.line_count(number);
        for (place, attribute) in self.parts.attributes(&self.text) {
            let Ok(mut attribute) = attribute else { continue };
            if let Some((_, number)) = count.as_ref().filter(|(counted, _)| place.contains(&counted.start)) {
                attribute.value = AttributeValue::Text(number.clone());
            }
            let mut new = String::new();
            attribute.encode(&mut new);
            if Attribute::decode(&new).is_ok_and(|(rest, again)| rest.is_empty() && again == attribute) {
                edits.push(self.lines_edit(place, &new));
            }
        }
        for block in &self.parts.blocks {
            let text = at(&self.text, block);
            let Ok(position) = Position::decode_block(text) else { continue };
            // How wide the stars are depends on the controller.
            if position.check().is_err() || text.contains('*') {
                continue;
            }
            let mut new = String::new();
            position.encode(&mut new);
            // Some controllers print zero without the zero before the point.
            if text.contains(" .000 ") && !text.contains(" 0.000 ") {
                new = new.replace(" 0.000 ", "  .000 ");
            }
            let end = if text.ends_with('\n') { new.len() } else { new.trim_end().len() };
            new.truncate(end);
            if Position::decode_block(&new).as_ref() == Ok(&position) {
                edits.push(self.lines_edit(block.clone(), &new));
            }
        }
        self.apply(edits)
    }
}

/// Returns a line with its number, in its standard layout. `None` if the line cannot be decoded.
fn line(text: &str, number: usize) -> Option<String> {
    let statement = Statement::new(text, false);
    let body = statement.place()?;
    let instruction = statement.decode().ok()?;
    let mut new = String::new();
    instruction.encode(&mut new);
    let bodies = match &instruction {
        Instruction::Motion(_) => vec![format!("{}   ", respelled(body, new.trim_end())?)],
        Instruction::Comment(_) | Instruction::Empty => vec![new],
        _ => {
            let before = text.get(..offset(text, body)).unwrap_or("");
            let colon = before.rfind(':').map_or(0, |at| at + 1);
            // A case of a SELECT follows the register's column.
            let is_case = body.starts_with('=') || body.starts_with("ELSE,") || body.starts_with("SONST,");
            let lead = before.get(colon..).filter(|_| is_case && before.len() - colon > 2);
            let lead = lead.unwrap_or(if body.starts_with('=') { "         " } else { "  " });
            let behind = text.get(offset(text, body) + body.len()..).unwrap_or("");
            let behind = behind.get(..behind.find(';').unwrap_or(0)).unwrap_or("");
            // Controllers end some instructions with one blank and some with four, each its own way.
            let behind = if behind == "    " { "   " } else { "" };
            // A remark may look as if it had seconds.
            let bodies = [seconds(body), body.to_string()];
            bodies.map(|body| format!("{lead}{body}{behind}")).to_vec()
        }
    };
    bodies.into_iter().map(|body| format!("{number:4}:{body} ;")).find(|laid_out| {
        let again = Statement::new(laid_out, false).decode();
        again.is_ok_and(|again| is_same(&instruction, &again))
    })
}

fn is_same(before: &Instruction, after: &Instruction) -> bool {
    match (before, after) {
        (Instruction::Other(_), Instruction::Other(_)) => before.operation() == after.operation(),
        (Instruction::Comment(a), Instruction::Comment(b)) => a.trim_end() == b.trim_end(),
        _ => before == after,
    }
}

/// Returns the layout of `new` with the words of `old`, except for numbers. `None` if the words differ.
fn respelled(old: &str, new: &str) -> Option<String> {
    let (olds, news) = (words(old), words(new));
    if olds.len() != news.len() {
        return None;
    }
    let (mut text, mut copied) = (String::new(), 0);
    for (old_place, new_place) in olds.iter().zip(&news) {
        text.push_str(new.get(copied..new_place.start)?);
        let (old, new) = (old.get(old_place.clone())?, new.get(new_place.clone())?);
        let is_number = new.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+'));
        text.push_str(if is_number { new } else { old });
        copied = new_place.end;
    }
    text.push_str(new.get(copied..)?);
    Some(text)
}

/// Returns the seconds of a WAIT in six columns with two decimals, those of a pulse with one.
fn seconds(body: &str) -> String {
    let rest = ["WAIT", "WARTE"].iter().find_map(|word| Some((*word, body.strip_prefix(word)?)));
    if let Some((word, rest)) = rest
        && let Some((value, length)) = decimal_prefix(indent(rest).as_bytes())
        && let Some(behind) = indent(rest).get(length..)
        && ["(sec)", "(sek)"].contains(&behind.trim())
    {
        let mut number = format!("{value:.2}");
        if number.parse() != Ok(value) {
            number.clear();
            push_shortest(&mut number, value);
        }
        let number = number.strip_prefix('0').filter(|rest| rest.starts_with('.')).unwrap_or(&number);
        return format!("{word} {number:>6}{}", behind.trim());
    }
    if let Some((head, tail)) = body.rsplit_once("PULSE,")
        && let Some((value, length)) = decimal_prefix(indent(tail).as_bytes())
        && let Some(unit) = indent(tail).get(length..)
        && ["sec", "sek"].contains(&unit.trim())
    {
        let number = format!("{value:.1}");
        let number = if number.parse() == Ok(value) { number } else { format!("{value}") };
        return format!("{head}PULSE,{number}{}", unit.trim());
    }
    body.to_string()
}
