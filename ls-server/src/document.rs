//! A file: its text, its lines, and the items that it names.

use core::cell::{OnceCell, RefCell};
use core::ops::Range;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use fanuc_ls::{DecodeError, Problem, Reason};
use lsp_types::{Location, Position, TextDocumentContentChangeEvent, TextEdit, Uri};

use crate::index::Index;
use crate::position::{Converter, Encoding, Lines};

/// The longest text that is read, in bytes. A document that is longer has no text and no answers until it is shorter.
const MAX_TEXT: usize = 16 << 20;

/// A file of the folder, open in the editor or not.
#[derive(Debug)]
pub(crate) struct Document {
    uri: Uri,
    path: Option<PathBuf>,
    /// The controller that the file belongs to, as the folder counts them. None for a file outside of the workspace.
    pub(crate) controller: Option<usize>,
    /// The editor's version. None for a file that is not open.
    version: Option<i32>,
    text: String,
    lines: Lines,
    encoding: Encoding,
    is_too_long: bool,
    index: OnceCell<Index>,
    /// The findings, and the changes of the folder that they were found after.
    found: RefCell<Option<(u64, Rc<[FoundProblem]>)>>,
    /// The edits that number the lines.
    numbering: OnceCell<Vec<TextEdit>>,
}

/// A problem, and its place in the text.
pub(crate) type FoundProblem = (Problem, Range<usize>);

impl Document {
    /// Creates the document with this text; `version` is `None` for a file that is not open.
    pub(crate) fn new(uri: Uri, text: String, version: Option<i32>, encoding: Encoding) -> Self {
        let path = crate::uri::to_path(uri.as_str());
        let mut document = Self {
            uri,
            path,
            controller: None,
            version,
            text: String::new(),
            lines: Lines::default(),
            encoding,
            is_too_long: false,
            index: OnceCell::new(),
            found: RefCell::default(),
            numbering: OnceCell::new(),
        };
        document.set_text(text);
        document
    }

    fn set_text(&mut self, text: String) {
        self.is_too_long = text.len() > MAX_TEXT;
        self.text = if self.is_too_long { String::new() } else { text };
        self.lines = Lines::new(&self.text);
        self.index.take();
        self.found.take();
        self.numbering.take();
    }

    /// Applies the changes of the editor, each to the text that the previous one has made. A document that is too long
    /// ignores changes of a part: only the whole text can be shorter.
    pub(crate) fn change(&mut self, version: i32, changes: Vec<TextDocumentContentChangeEvent>) {
        self.version = Some(version);
        for change in changes {
            match change.range {
                None => self.set_text(change.text),
                Some(_) if self.is_too_long => {}
                Some(range) => {
                    let bytes = self.converter().bytes(range);
                    let mut text = core::mem::take(&mut self.text);
                    text.replace_range(bytes, &change.text);
                    self.set_text(text);
                }
            }
        }
    }

    pub(crate) fn uri(&self) -> &Uri {
        &self.uri
    }

    pub(crate) fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    pub(crate) fn version(&self) -> Option<i32> {
        self.version
    }

    pub(crate) fn text(&self) -> &str {
        &self.text
    }

    /// Returns whether the text is longer than the limit.
    pub(crate) fn is_too_long(&self) -> bool {
        self.is_too_long
    }

    pub(crate) fn lines(&self) -> &Lines {
        &self.lines
    }

    /// Returns the text in a range.
    pub(crate) fn at(&self, place: &Range<usize>) -> &str {
        self.text.get(place.clone()).unwrap_or("")
    }

    /// Converts between bytes and the editor's positions.
    pub(crate) fn converter(&self) -> Converter<'_> {
        Converter::new(&self.text, &self.lines, self.encoding)
    }

    /// Returns the byte of a position.
    pub(crate) fn offset(&self, position: Position) -> usize {
        self.converter().offset(position)
    }

    /// Returns a range of this document as a location.
    pub(crate) fn location(&self, place: &Range<usize>) -> Location {
        Location { uri: self.uri.clone(), range: self.converter().range(place) }
    }

    /// Decodes the program in the text.
    ///
    /// # Errors
    /// If the text is not a program.
    pub(crate) fn program(&self) -> Result<fanuc_ls::Document, DecodeError> {
        fanuc_ls::Document::decode(&self.text)
    }

    /// Decodes the program in the text; a program that ends early, as during typing, is decoded up to its end. Its ranges
    /// are ranges of the text.
    pub(crate) fn unfinished_program(&self) -> Option<fanuc_ls::Document> {
        match self.program() {
            Ok(program) => Some(program),
            Err(error) if error.reason == Reason::End => {
                fanuc_ls::Document::decode(&format!("{}\n/END\n", self.text)).ok()
            }
            Err(_) => None,
        }
    }

    /// Returns the items that the text refers to.
    pub(crate) fn index(&self) -> &Index {
        self.index.get_or_init(|| {
            self.unfinished_program().map_or_else(Index::default, |program| Index::new(&program))
        })
    }

    /// Returns the findings; calls `find` if the text or the folder has changed since the last call.
    pub(crate) fn found(&self, changes: u64, find: impl FnOnce() -> Vec<FoundProblem>) -> Rc<[FoundProblem]> {
        if let Some((of, found)) = &*self.found.borrow()
            && *of == changes
        {
            return Rc::clone(found);
        }
        let found: Rc<[FoundProblem]> = find().into();
        self.found.replace(Some((changes, Rc::clone(&found))));
        found
    }

    /// Returns the edits that number the lines; calls `find` if the text has changed since the last call.
    pub(crate) fn numbering(&self, find: impl FnOnce() -> Vec<TextEdit>) -> &[TextEdit] {
        self.numbering.get_or_init(find)
    }

    /// Returns the program's name; empty if the text is not a program.
    pub(crate) fn name(&self) -> &str {
        self.at(&self.index().name())
    }
}

#[cfg(test)]
mod tests {
    use core::str::FromStr;

    use super::*;

    /// The text after changes at bytes, the simplest way.
    #[test]
    fn a_text_after_changes_is_the_text() {
        let pieces = ["a", "\n", "\r\n", "\r", "\u{e9}", "\u{1f600}", "R[1]=5 ;", ""];
        let mut random = fastrand::Rng::with_seed(5);
        for encoding in [Encoding::Utf8, Encoding::Utf16, Encoding::Utf32] {
            let uri = Uri::from_str("file:///A.LS").unwrap();
            let mut document = Document::new(uri, String::new(), Some(0), encoding);
            let mut model = String::new();
            for version in 1..4000 {
                let mut spot = || {
                    let mut at = random.usize(..=model.len());
                    // Not within a character, nor within a line's end, which has no position of its own.
                    while !model.is_char_boundary(at)
                        || model[..at].ends_with('\r') && model[at..].starts_with('\n')
                    {
                        at -= 1;
                    }
                    at
                };
                let (one, other) = (spot(), spot());
                let place = one.min(other)..one.max(other).min(one.min(other) + 40);
                let place = place.start
                    ..(place.start..=place.end)
                        .rev()
                        .find(|at| {
                            model.is_char_boundary(*at)
                                && !(model[..*at].ends_with('\r') && model[*at..].starts_with('\n'))
                        })
                        .unwrap();
                let text =
                    (0..random.usize(..5)).map(|_| *random.choice(&pieces).unwrap()).collect::<String>();
                let range = Some(document.converter().range(&place));
                model.replace_range(place, &text);
                document.change(
                    version,
                    vec![TextDocumentContentChangeEvent { range, range_length: None, text }],
                );
                assert_eq!(document.text(), model);
                if model.len() > 2000 {
                    model.clear();
                    document.change(
                        version,
                        vec![TextDocumentContentChangeEvent {
                            range: None,
                            range_length: None,
                            text: String::new(),
                        }],
                    );
                }
            }
        }
    }
}
