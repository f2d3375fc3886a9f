//! Instructions as a table: the word, then its floats.

use anyhow::{Context, Result, bail, ensure};

use super::route::Instruction;
use super::settings::{Coordinate, Mapping};
use crate::io::table::rows;

/// Reads `WORD,FLOAT,FLOAT,…` a line; a word is `cut`, `move`, or a number such as 258 or 0x0102. Lines that begin with `#`
/// are passed over. A first line that begins with `word` names the floats, and the names of coordinates must stand in the
/// order of the mapping. Empty cells at the end of a line are passed over.
///
/// # Errors
/// If a cell has any other value, with the line.
pub(super) fn read(text: &str, mapping: &Mapping) -> Result<Vec<Instruction>> {
    let mut instructions = Vec::new();
    for row in rows(text) {
        let (line, record) = row?;
        let mut cells = record.iter();
        let first = cells.next().unwrap_or_default();
        if instructions.is_empty() && first.eq_ignore_ascii_case("word") {
            heading(cells, mapping).with_context(|| format!("line {line}"))?;
            continue;
        }
        let word = word(first, mapping).with_context(|| {
            format!(
                "line {line}: `{}` is not a command word: give cut, move, 258 or 0x0102",
                first.escape_debug()
            )
        })?;
        let number = |cell: &str| {
            cell.parse::<f32>()
                .with_context(|| format!("line {line}: `{}` is not a number", cell.escape_debug()))
        };
        let mut cells: Vec<_> = cells.collect();
        while cells.pop_if(|cell| cell.is_empty()).is_some() {}
        if let Some(empty) = cells.iter().position(|cell| cell.is_empty()) {
            bail!("line {line}: cell {} is empty: give 0, or leave empty only cells at the end", empty + 2);
        }
        let values = cells.into_iter().map(number).collect::<Result<_>>()?;
        instructions.push(Instruction { line, word, values });
    }
    Ok(instructions)
}

/// Checks the names of columns: another order is another path. Names that are not those of coordinates are of the plant's
/// own words.
fn heading<'a>(names: impl Iterator<Item = &'a str>, mapping: &Mapping) -> Result<()> {
    for (name, expected) in names.zip(&mapping.values) {
        let found: Result<Coordinate, _> = serde_json::from_value(name.to_ascii_lowercase().into());
        ensure!(
            found.is_err() || found.is_ok_and(|found| found == *expected),
            "column `{}`, expected {}: see the setting program.values",
            name.escape_debug(),
            serde_json::to_string(expected)?
        );
    }
    Ok(())
}

fn word(text: &str, mapping: &Mapping) -> Option<u16> {
    match text {
        "cut" => Some(mapping.cut),
        "move" => Some(mapping.rapid),
        _ => match text.strip_prefix("0x") {
            Some(digits) => u16::from_str_radix(digits, 16).ok(),
            None => text.parse().ok(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_count_remarks_and_empty_lines() {
        let text = "word,x\n# a square\n\ncut,1\n# the last\n\nmove,2";
        let instructions = read(text, &Mapping::default()).unwrap();
        assert_eq!(instructions.iter().map(|it| it.line).collect::<Vec<_>>(), [4, 7]);
    }
}
