//! Registers, inputs, labels, positions and frames that a text names by number: their ranges, to change one word alone.

use core::ops::Range;

use crate::document::Document;
use crate::expression::ItemKind;
use crate::parts::{at, offset};
use crate::text::{digits, indent, is_letter_or_digit};

/// `PR[3:part]` in a text: a register, an input, an output, a label, a position or a frame that is named by its number.
/// Ranges are in bytes of the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reference {
    /// The kind of the item.
    pub kind: ItemKind,
    /// The number of the item.
    pub number: u32,
    /// The letters before the number, such as `PR`; `UFRAME_NUM` of a selection, `UF` of a position.
    pub letters: Range<usize>,
    /// The digits of the number.
    pub digits: Range<usize>,
    /// The name after the colon, without the blanks and quotes around it. None if the reference has no name.
    pub name: Option<Range<usize>>,
    /// Whether the text is the label itself, or the position in `/POS`, and not a use of it.
    pub is_definition: bool,
    /// Whether the number is that of a frame, without brackets: `UFRAME_NUM=1`, or `UF : 1` of a position.
    pub is_selection: bool,
}

impl Reference {
    /// Returns the reference with its ranges moved by this many bytes.
    fn moved(self, by: usize) -> Self {
        let moved = |place: Range<usize>| place.start + by..place.end + by;
        Self { letters: moved(self.letters), digits: moved(self.digits), name: self.name.map(moved), ..self }
    }
}

impl Document {
    /// Returns the items that statements and positions name by number, with their ranges, in the sequence of the text.
    /// Comments, messages and strings contain no references.
    ///
    /// ```
    /// use fanuc_ls::{Document, ItemKind};
    ///
    /// let text = "/PROG A\n/MN\n1:  R[1:count]=R[R[2]] ;\n/END\n";
    /// let document = Document::decode(text)?;
    /// let found: Vec<_> = document.references().collect();
    /// assert_eq!(found.len(), 2);
    /// assert_eq!((found[0].kind, found[0].number), (ItemKind::Register, 1));
    /// assert_eq!(found[0].name.clone().map(|name| &text[name]), Some("count"));
    /// # Ok::<(), fanuc_ls::DecodeError>(())
    /// ```
    pub fn references(&self) -> impl Iterator<Item = Reference> {
        let of_blocks =
            self.parts.blocks.iter().flat_map(|block| {
                of_position(at(&self.text, block)).map(move |found| found.moved(block.start))
            });
        self.statement_references().chain(of_blocks)
    }

    /// Returns the references of `/MN`.
    pub(crate) fn statement_references(&self) -> impl Iterator<Item = Reference> {
        self.parts.statements(&self.text).flat_map(|statement| {
            let body = statement.body();
            let start = offset(&self.text, body);
            find(body).map(move |found| found.moved(start))
        })
    }

    /// Returns the programs that statements call, run or monitor by name: the range of each name, in the sequence of the
    /// text.
    pub fn program_references(&self) -> impl Iterator<Item = Range<usize>> {
        self.parts.statements(&self.text).flat_map(|statement| {
            let body = statement.body();
            let start = offset(&self.text, body);
            programs(body).map(move |name| name.start + start..name.end + start)
        })
    }

    /// Returns the bytes of a part of [`as_str`](Self::as_str), such as the body of a statement. For a part of another text,
    /// the result is an unspecified range within the text.
    pub fn place(&self, part: &str) -> Range<usize> {
        let start = offset(&self.text, part);
        start..(start + part.len()).min(self.text.len())
    }
}

/// The frames that a statement selects, and their words.
const SELECTIONS: [(&str, ItemKind); 4] = [
    ("UFRAME_NUM", ItemKind::UserFrame),
    ("UTOOL_NUM", ItemKind::UserTool),
    ("BENUTZER_NUM", ItemKind::UserFrame),
    ("WKZ_NUM", ItemKind::UserTool),
];

/// Returns the references in the text of an instruction, in their sequence. Comments, remarks, messages, strings and names do not
/// contain references.
fn find(body: &str) -> impl Iterator<Item = Reference> {
    let is_label = ["LBL", "LABEL"]
        .iter()
        .any(|word| body.get(..word.len()).is_some_and(|begin| begin.eq_ignore_ascii_case(word)));
    let mut at = 0;
    core::iter::from_fn(move || {
        loop {
            let letters = next_word(body, at)?;
            at = letters.end;
            let word = body.get(letters.clone())?;
            if let Some((_, kind)) = SELECTIONS.iter().find(|(name, _)| word.eq_ignore_ascii_case(name)) {
                if let Some(found) = selection(body, letters, *kind) {
                    at = found.digits.end;
                    return Some(found);
                }
                continue;
            }
            let Some(inside) = body.get(at..)?.strip_prefix('[') else { continue };
            if is_message(word) {
                at = body.rfind(']').unwrap_or(body.len());
                continue;
            }
            let Some(kind) = ItemKind::named(word) else { continue };
            let is_definition = is_label && letters.start == 0;
            if let Some(found) = item(body, letters, kind, inside) {
                at = found.name.as_ref().map_or(found.digits.end, |name| name.end);
                return Some(Reference { is_definition, ..found });
            }
        }
    })
}

/// Returns the names of the programs in the text of an instruction.
fn programs(body: &str) -> impl Iterator<Item = Range<usize>> {
    let mut at = 0;
    core::iter::from_fn(move || {
        loop {
            let letters = next_word(body, at)?;
            at = letters.end;
            let word = body.get(letters)?;
            let rest = body.get(at..)?;
            if rest.starts_with('[') && is_message(word) {
                at = body.rfind(']').unwrap_or(body.len());
            }
            if !["CALL", "AUFRUF", "RUN", "MONITOR"].iter().any(|name| word.eq_ignore_ascii_case(name)) {
                continue;
            }
            let name = indent(rest);
            let start = body.len() - name.len();
            let length =
                name.find(|c| !(is_letter_or_digit(c) || matches!(c, '_' | '-'))).unwrap_or(name.len());
            let is_monitor_end = word.eq_ignore_ascii_case("MONITOR") && name.get(..length) == Some("END");
            let is_item = name.get(length..)?.starts_with('[');
            let is_name = start > at && length > 0 && !name.starts_with(|c: char| c.is_ascii_digit());
            if is_name && !is_item && !is_monitor_end {
                at = start + length;
                return Some(start..at);
            }
        }
    })
}

/// Returns the next word of letters, digits, `_`, `$` and `.` in the text of an instruction, at `from` or after it. Strings,
/// comments and remarks have no words.
fn next_word(body: &str, from: usize) -> Option<Range<usize>> {
    if body.starts_with('!') || body.starts_with("--") {
        return None;
    }
    let is_word = |c: char| is_letter_or_digit(c) || matches!(c, '_' | '$' | '.');
    let mut at = from;
    loop {
        let rest = body.get(at..)?;
        let first = rest.chars().next()?;
        if first == '\'' {
            at += 1 + rest.get(1..)?.find('\'').map_or(rest.len(), |end| end + 1);
        } else if is_word(first) {
            return Some(at..at + rest.find(|c| !is_word(c)).unwrap_or(rest.len()));
        } else {
            at += first.len_utf8();
        }
    }
}

fn is_message(word: &str) -> bool {
    ["MESSAGE", "MELDUNG"].iter().any(|name| word.eq_ignore_ascii_case(name))
}

fn item(body: &str, letters: Range<usize>, kind: ItemKind, inside: &str) -> Option<Reference> {
    let mut rest = indent(inside);
    if let Some((group, after)) = rest.split_once(':').filter(|(group, _)| group.starts_with("GP"))
        && !group.contains(']')
    {
        rest = indent(after);
    }
    let start = body.len() - rest.len();
    let end = start + digits(rest);
    let number = body.get(start..end)?.parse().ok()?;
    let name = indent(body.get(end..)?).strip_prefix(':').map(|name| {
        let length = closing(name);
        let name = name.get(..length).unwrap_or(name);
        let start = offset(body, name.trim_start());
        start..start + name.trim().len()
    });
    Some(Reference {
        kind,
        number,
        letters,
        digits: start..end,
        name,
        is_definition: false,
        is_selection: false,
    })
}

/// Returns the reference of a selection: `=1`, or for one group `[GP2]=1`.
fn selection(body: &str, letters: Range<usize>, kind: ItemKind) -> Option<Reference> {
    let mut rest = indent(body.get(letters.end..)?);
    if rest.starts_with('[') {
        rest = indent(rest.split_once(']')?.1);
    }
    rest = indent(rest.strip_prefix('=')?);
    let start = body.len() - rest.len();
    let end = start + digits(rest);
    let number = body.get(start..end)?.parse().ok()?;
    Some(Reference {
        kind,
        number,
        letters,
        digits: start..end,
        name: None,
        is_definition: false,
        is_selection: true,
    })
}

/// Returns the length of a name up to the closing bracket; a name may contain brackets.
fn closing(text: &str) -> usize {
    let mut depth = 0usize;
    for (at, c) in text.char_indices() {
        match c {
            '[' => depth += 1,
            ']' if depth > 0 => depth -= 1,
            ']' | '\r' | '\n' => return at,
            _ => {}
        }
    }
    text.find(']').unwrap_or(text.len())
}

/// Returns the references of a position of `/POS`: the number of `P[3]{` and those of `UF : 1, UT : 2`.
fn of_position(block: &str) -> impl Iterator<Item = Reference> {
    let marks = [("P[", ItemKind::Position), ("UF", ItemKind::UserFrame), ("UT", ItemKind::UserTool)];
    // A name may contain anything; the frames follow it.
    let body = block.find('{').unwrap_or(0);
    marks.into_iter().flat_map(move |(mark, kind)| {
        let is_header = kind == ItemKind::Position;
        let (part, base) = if is_header { (block, 0) } else { (block.get(body..).unwrap_or(""), body) };
        let places = part.match_indices(mark).take(if is_header { 1 } else { usize::MAX });
        places.filter_map(move |(at, _)| {
            let rest = indent(part.get(at + mark.len()..)?);
            let rest = if is_header { rest } else { indent(rest.strip_prefix(':')?) };
            let start = base + part.len() - rest.len();
            let end = start + digits(rest);
            let number = block.get(start..end)?.parse().ok()?;
            let letters = base + at..base + at + mark.trim_end_matches('[').len();
            let name = indent(block.get(end..)?).strip_prefix(':').filter(|_| is_header).and_then(|name| {
                let name = name.split_once(']').map_or("", |(name, _)| name);
                let quoted = name.trim().trim_matches('"').trim();
                let start = offset(block, quoted);
                (!quoted.is_empty()).then_some(start..start + quoted.len())
            });
            let (is_definition, is_selection) = (is_header, !is_header);
            Some(Reference { kind, number, letters, digits: start..end, name, is_definition, is_selection })
        })
    })
}

#[cfg(test)]
mod tests {
    use alloc::string::String;
    use alloc::vec::Vec;
    use alloc::{format, vec};

    use super::*;

    fn found(body: &str) -> Vec<String> {
        let text = |found: Reference| {
            let name = found.name.map_or("", |name| &body[name]);
            format!("{}{}{}{name}", found.kind, &body[found.digits], if name.is_empty() { "" } else { ":" })
        };
        find(body).map(text).collect()
    }

    #[test]
    fn what_is_a_text_names_nothing() {
        assert_eq!(found("R[1:a b]=R[R[2]]+PR[GP1:3,R[4]]"), ["R1:a b", "R2", "PR3", "R4"]);
        assert_eq!(found("IF (DI[ 7 :gate [2]] AND !F[9]),JMP LBL[3]"), ["DI7:gate [2]", "F9", "LBL3"]);
        assert_eq!(found("UFRAME_NUM[GP2] = 4"), ["UFRAME4"]);
        assert_eq!(found("WKZ_NUM=2"), ["UTOOL2"]);
        assert_eq!(found("SR[1]='R[2]'+SR[3]+'R[4]'"), ["SR1", "SR3"]);
        assert_eq!(found("SR[1]='R[2]"), ["SR1"]);
        for text in ["! R[1]", "--eg:R[1]", "MESSAGE[R[1] is R[2]]", "SR[5]='R[1]'", "$MCR[1]=1", "XR[1]=2"] {
            let expected = if text.starts_with("SR") { vec!["SR5"] } else { vec![] };
            assert_eq!(found(text), expected, "{text}");
        }
        assert_eq!(found("L P[2] 10mm/sec CNT100 Skip,LBL[5] Offset,PR[6:x]"), ["P2", "LBL5", "PR6:x"]);
    }

    #[test]
    fn a_position_has_its_number_and_its_frames() {
        let block = "P[12:\"UF : 9\"]{\n   GP1:\n\tUF : 1, UT : 2,\n GP2:\n\tUF : F, UT : 3,\n};";
        let all = of_position(block).map(|found| (found.kind, found.number, found.is_selection));
        let (frame, tool) = (ItemKind::UserFrame, ItemKind::UserTool);
        assert_eq!(
            all.collect::<Vec<_>>(),
            [(ItemKind::Position, 12, false), (frame, 1, true), (tool, 2, true), (tool, 3, true)]
        );
    }
}
