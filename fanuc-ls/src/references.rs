//! Registers, inputs, labels, positions and frames where a text names them by a number: their places, to change one word alone.

use core::ops::Range;

use crate::expression::ItemKind;
use crate::text::{digits, indent, is_letter_or_digit};

/// `PR[3:part]` in a text: its letters, its number and its name, by their places.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Reference {
    pub(crate) kind: ItemKind,
    pub(crate) number: u32,
    pub(crate) letters: Range<usize>,
    pub(crate) digits: Range<usize>,
    /// What is behind the colon, without blanks.
    pub(crate) name: Option<Range<usize>>,
    /// Whether it is a frame's number without brackets: `UFRAME_NUM=1`.
    pub(crate) is_selection: bool,
}

/// The frames that a statement selects, and their words.
const SELECTIONS: [(&str, ItemKind); 4] = [
    ("UFRAME_NUM", ItemKind::UserFrame),
    ("UTOOL_NUM", ItemKind::UserTool),
    ("BENUTZER_NUM", ItemKind::UserFrame),
    ("WKZ_NUM", ItemKind::UserTool),
];

/// All of them in the text of an instruction, in their order. What is text itself has none: comments, remarks, messages, strings
/// and names.
pub(crate) fn find(body: &str) -> impl Iterator<Item = Reference> {
    let is_text = body.starts_with(['!']) || body.starts_with("--");
    let mut at = if is_text { body.len() } else { 0 };
    core::iter::from_fn(move || {
        loop {
            let rest = body.get(at..)?;
            let first = rest.chars().next()?;
            if first == '\'' {
                at += 1 + rest.get(1..)?.find('\'').map_or(rest.len(), |end| end + 1);
                continue;
            }
            let is_word = |c: char| is_letter_or_digit(c) || matches!(c, '_' | '$' | '.');
            if !is_word(first) {
                at += first.len_utf8();
                continue;
            }
            let length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            let letters = at..at + length;
            at = letters.end;
            let word = body.get(letters.clone())?;
            if let Some((_, kind)) = SELECTIONS.iter().find(|(name, _)| word.eq_ignore_ascii_case(name)) {
                if let Some(found) = selection(body, letters, *kind) {
                    at = found.digits.end;
                    return Some(found);
                }
                continue;
            }
            let is_message = ["MESSAGE", "MELDUNG"].iter().any(|name| word.eq_ignore_ascii_case(name));
            let Some(inside) = body.get(at..)?.strip_prefix('[') else { continue };
            if is_message {
                at = body.rfind(']').unwrap_or(body.len());
                continue;
            }
            let Some(kind) = ItemKind::named(word) else { continue };
            if let Some(found) = item(body, letters, kind, inside) {
                at = found.name.as_ref().map_or(found.digits.end, |name| name.end);
                return Some(found);
            }
        }
    })
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
        let start = crate::parts::offset(body, name.trim_start());
        start..start + name.trim().len()
    });
    Some(Reference { kind, number, letters, digits: start..end, name, is_selection: false })
}

/// `=1`, or of one group `[GP2]=1`.
fn selection(body: &str, letters: Range<usize>, kind: ItemKind) -> Option<Reference> {
    let mut rest = indent(body.get(letters.end..)?);
    if rest.starts_with('[') {
        rest = indent(rest.split_once(']')?.1);
    }
    rest = indent(rest.strip_prefix('=')?);
    let start = body.len() - rest.len();
    let end = start + digits(rest);
    let number = body.get(start..end)?.parse().ok()?;
    Some(Reference { kind, number, letters, digits: start..end, name: None, is_selection: true })
}

/// How long a name is: up to the bracket that closes it, which may have brackets of its own.
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

/// The number of `P[3]{` and those of `UF : 1, UT : 2` in a position of `/POS`: what each is, and its place.
pub(crate) fn of_position(block: &str) -> impl Iterator<Item = (ItemKind, u32, Range<usize>)> {
    let marks = [("P[", ItemKind::Position), ("UF", ItemKind::UserFrame), ("UT", ItemKind::UserTool)];
    // A name may hold anything; the frames are behind it.
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
            Some((kind, block.get(start..end)?.parse().ok()?, start..end))
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
        let all: Vec<_> = of_position(block).map(|(kind, number, _)| (kind, number)).collect();
        let (frame, tool) = (ItemKind::UserFrame, ItemKind::UserTool);
        assert_eq!(all, [(ItemKind::Position, 12), (frame, 1), (tool, 2), (tool, 3)]);
    }
}
