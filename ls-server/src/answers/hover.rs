//! `textDocument/hover`: the form of an instruction, an item's comment and uses, a position's values in words.

use core::fmt::Write;
use core::ops::Range;
use std::collections::BTreeMap;

use fanuc_ls::{
    Configuration, Document as Program, Group, ItemKind, MotionKind, Position, Reference, Syntax,
};
use lsp_types::{Hover, HoverContents, HoverParams, MarkupContent, MarkupKind};

use crate::answer::{Answer, document};
use crate::document::Document;
use crate::folder::{Folder, is_local};

/// The uses that are listed, by line.
const MAX_LINES: usize = 12;

pub(crate) fn hover(folder: &Folder, params: HoverParams) -> Answer<Option<Hover>> {
    let at = params.text_document_position_params;
    let document = document(folder, &at.text_document.uri)?;
    let offset = document.offset(at.position);
    let found = item(folder, document, offset).or_else(|| program(folder, document, offset)).or_else(|| {
        document.unfinished_program().and_then(|program| words(folder, document, &program, offset))
    });
    Ok(found.map(|(place, value)| Hover {
        contents: HoverContents::Markup(MarkupContent { kind: MarkupKind::Markdown, value }),
        range: Some(document.converter().range(&place)),
    }))
}

type HoverText = (Range<usize>, String);

fn item(folder: &Folder, document: &Document, offset: usize) -> Option<HoverText> {
    let found = document.index().reference_at(offset)?;
    let Reference { kind, number, .. } = found;
    let item = (kind, number);
    let (low, high) = (kind.numbers().start().to_owned(), kind.numbers().end().to_owned());
    let mut text = format!("**{kind}[{number}]**: {}, {low} to {high}\n\n", kind.text());
    if let Some(name) = folder.name_of(document, item) {
        let _ = writeln!(text, "Comment: {}\n", quoted(name));
    }
    if let Some((listed, file)) = folder.listed(document, item)
        && !listed.value.is_empty()
    {
        let _ = writeln!(text, "Value in {file}: {}\n", quoted(&listed.value));
    }
    if kind == ItemKind::Position
        && let Some(position) =
            document.unfinished_program()?.positions().find(|position| position.number == number)
    {
        text.push_str(&in_words(&position));
    }
    text.push_str(&uses(folder, document, item));
    Some((found.letters.start..found.digits.end, text))
}

/// Returns the uses of an item: those of this program by line, and the number of those in others.
fn uses(folder: &Folder, document: &Document, item: (ItemKind, u32)) -> String {
    let mut lines: BTreeMap<usize, ()> = BTreeMap::new();
    let mut label = None;
    for found in document.index().references_to(item) {
        let line = document.lines().line(found.letters.start);
        if found.is_definition {
            label.get_or_insert(line);
        } else {
            lines.insert(line, ());
        }
    }
    let mut text = String::new();
    if let Some(line) = label.filter(|_| item.0 == ItemKind::Label) {
        let _ = writeln!(text, "Defined in line {}\n", line + 1);
    }
    let what = if item.0 == ItemKind::Label { "Jumps" } else { "Uses" };
    let shown: Vec<String> = lines.keys().take(MAX_LINES).map(|line| (line + 1).to_string()).collect();
    let more = if lines.len() > MAX_LINES { ", …" } else { "" };
    let _ = match lines.len() {
        0 => writeln!(text, "{what}: none in this program\n"),
        _ => writeln!(text, "{what} in lines: {}{more}\n", shown.join(", ")),
    };
    if !is_local(item) {
        let others = folder.neighbours(document).filter(|other| other.uri() != document.uri());
        let counts = others.map(|other| other.index().references_to(item).count()).filter(|count| *count > 0);
        let counts: Vec<usize> = counts.collect();
        if !counts.is_empty() {
            let _ = writeln!(
                text,
                "In other programs: {}, used {} times\n",
                counts.len(),
                counts.iter().sum::<usize>()
            );
        }
    }
    text
}

/// Returns the values of a position.
fn in_words(position: &Position) -> String {
    let mut text = String::new();
    for Group { number, user_frame, user_tool, configuration, axes } in &position.groups {
        let frame = |frame: &Option<u16>| {
            frame.map_or_else(|| "the selected one".to_owned(), |number| number.to_string())
        };
        let _ =
            writeln!(text, "Group {number}, user frame {}, tool {}\n", frame(user_frame), frame(user_tool));
        let value = |axis: &fanuc_ls::Axis| {
            let unit = match axis.unit {
                fanuc_ls::AxisUnit::Mm => "mm",
                fanuc_ls::AxisUnit::Deg => "°",
            };
            let value =
                axis.value.map_or_else(|| "not taught".to_owned(), |value| format!("{value:.3} {unit}"));
            format!("{} {value}", axis.name.name())
        };
        let axes: Vec<String> = axes.iter().map(value).collect();
        let _ = writeln!(text, "{}\n", axes.join(", "));
        if let Some(words) = configuration.as_ref().and_then(configured) {
            let _ = writeln!(text, "{words}\n");
        }
    }
    text
}

/// Describes a configuration: `N U T, 0, 0, 0` is `wrist not flipped, elbow up, arm in front; turns 0, 0, 0`.
fn configured(configuration: &Configuration) -> Option<String> {
    let (letters, turns) = configuration.text.split_once(',')?;
    let word = |letter: &str| match letter {
        "N" => "wrist not flipped",
        "F" => "wrist flipped",
        "U" => "elbow up",
        "D" => "elbow down",
        "T" => "arm in front",
        "B" => "arm behind",
        "L" => "arm to the left",
        "R" => "arm to the right",
        _ => "",
    };
    let words: Vec<&str> = letters.split_whitespace().map(word).filter(|word| !word.is_empty()).collect();
    (!words.is_empty()).then(|| format!("{}; turns {}", words.join(", "), turns.trim()))
}

/// Returns the program of a call.
fn program(folder: &Folder, document: &Document, offset: usize) -> Option<HoverText> {
    let place = document.index().programs().find(|place| (place.start..=place.end).contains(&offset))?;
    let name = document.at(&place);
    let text = match folder.program(document, name) {
        Some(program) => described(program),
        None => format!("**{}**: no program has this name here\n", quoted(name)),
    };
    Some((place, text))
}

fn described(document: &Document) -> String {
    let mut text = format!("**{}**: program", quoted(document.name()));
    if let Some(comment) = document.index().comment() {
        let _ = write!(text, " \"{}\"", quoted(comment));
    }
    if let Ok(program) = document.program() {
        let lines = program.statements().filter(|statement| !statement.is_nested()).count();
        let _ = write!(text, ", lines: {lines}, positions: {}", program.positions().count());
    }
    text.push('\n');
    text
}

/// Returns the form of the instruction, the option or the macro at a byte.
fn words(folder: &Folder, document: &Document, program: &Program, offset: usize) -> Option<HoverText> {
    let name = program.place(program.name());
    if (name.start..=name.end).contains(&offset) {
        return Some((name, described(document)));
    }
    let body = program.statements().map(|statement| statement.body()).find(|body| {
        let place = program.place(body);
        (place.start..=place.end).contains(&offset)
    })?;
    if body.starts_with('!') {
        return None;
    }
    let start = program.place(body).start;
    let letter =
        [MotionKind::Joint, MotionKind::Linear, MotionKind::Circular, MotionKind::Arc, MotionKind::Spline]
            .into_iter()
            .find(|kind| {
                body.starts_with(kind.letter())
                    && body.get(1..).is_some_and(|rest| rest.starts_with([' ', '\t']))
            });
    let forms = match letter {
        Some(kind) if offset <= start + 1 => {
            return Some((start..start + 1, Syntax::motion(kind).to_owned()));
        }
        Some(_) => Syntax::options().chain(Syntax::instructions()).collect::<Vec<_>>(),
        None => Syntax::instructions().collect(),
    };
    // The longest words win: `SOFTFLOAT END` before `SOFTFLOAT`.
    let mut best: Option<(Range<usize>, String)> = None;
    for syntax in forms {
        for word in syntax.words.iter().filter(|word| word.starts_with(|c: char| c.is_alphabetic())) {
            for at in places(body, word) {
                let place = start + at..start + at + word.len();
                let is_longer = best.as_ref().is_none_or(|(best, _)| best.len() < place.len());
                if (place.start..=place.end).contains(&offset) && is_longer {
                    best = Some((place, syntax.form.clone()));
                }
            }
        }
    }
    best.or_else(|| {
        let name = body.split('(').next().unwrap_or("").trim();
        let program = folder.macro_program(document, name)?;
        Some((start..start + name.len(), format!("**{}**: macro, runs {}\n", quoted(name), quoted(program))))
    })
}

/// Returns the offsets of whole words in a text.
fn places<'a>(text: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    text.char_indices().map(|(at, _)| at).filter(move |at| {
        let there = text.get(*at..*at + word.len()).is_some_and(|there| there.eq_ignore_ascii_case(word));
        // A number may follow an option: `ACC50`.
        let is_end = |c: char| c.is_alphabetic() || c == '_';
        there
            && !text.get(..*at).unwrap_or("").ends_with(is_word)
            && !text.get(*at + word.len()..).unwrap_or("").starts_with(is_end)
    })
}

/// Returns a text of a file with the marks of Markdown escaped.
fn quoted(text: &str) -> String {
    let mut quoted = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_ascii_punctuation() {
            quoted.push('\\');
        }
        quoted.push(if c.is_control() { ' ' } else { c });
    }
    quoted
}
