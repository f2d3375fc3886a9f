//! The item or the program at a position, and every place where it is named.

use core::ops::Range;

use fanuc_ls::Reference;

use crate::document::Document;
use crate::folder::{Folder, is_local};
use crate::index::Item;

/// The item or program under the cursor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Target {
    /// A register, an input, a label, a position …
    Item(Item),
    /// A program, by its name as it stands.
    Program(String),
}

/// A place where a target is named.
#[derive(Debug, Clone)]
pub(crate) struct Mention<'a> {
    pub(crate) document: &'a Document,
    pub(crate) place: Range<usize>,
    /// Whether the place is the label itself, the position in `/POS`, or the name after `/PROG`.
    pub(crate) is_definition: bool,
    /// Whether an instruction sets the item there.
    pub(crate) is_set: bool,
}

impl Target {
    /// Returns the target at a byte of a document, and its range.
    pub(crate) fn at(document: &Document, offset: usize) -> Option<(Self, Range<usize>)> {
        let index = document.index();
        if let Some(found) = index.reference_at(offset) {
            return Some((Self::Item((found.kind, found.number)), shown(&found)));
        }
        let name = Some(index.name()).filter(|name| !name.is_empty());
        let place = name
            .into_iter()
            .chain(index.programs())
            .find(|place| (place.start..=place.end).contains(&offset))?;
        Some((Self::Program(document.at(&place).to_owned()), place))
    }

    /// Returns every reference to the target: in the document, or in every program of its controller.
    pub(crate) fn places<'a>(&'a self, folder: &'a Folder, document: &'a Document) -> Vec<Mention<'a>> {
        let others = folder.neighbours(document);
        let is_alone = matches!(self, Self::Item(item) if is_local(*item));
        let documents = others.filter(|other| !is_alone || other.uri() == document.uri());
        documents.flat_map(|document| self.within(document)).collect()
    }

    /// Returns every reference to the target in one document.
    pub(crate) fn within<'a>(&self, document: &'a Document) -> Vec<Mention<'a>> {
        let index = document.index();
        match self {
            Self::Item(item) => { index.references_to(*item) }
                .map(|found| Mention {
                    document,
                    place: shown(&found),
                    is_definition: found.is_definition,
                    is_set: found.is_definition || sets(document, &found),
                })
                .collect(),
            Self::Program(name) => {
                let named = |(place, is_definition): (Range<usize>, bool)| Mention {
                    document,
                    place,
                    is_definition,
                    is_set: is_definition,
                };
                let places =
                    [(index.name(), true)].into_iter().chain(index.programs().map(|place| (place, false)));
                places.filter(|(place, _)| document.at(place).eq_ignore_ascii_case(name)).map(named).collect()
            }
        }
    }
}

/// Returns the range of the letters and the number of a reference.
fn shown(found: &Reference) -> Range<usize> {
    found.letters.start..found.digits.end
}

/// Returns whether an instruction sets the item: `R[1]=`, after a number and a colon or after a condition and a comma.
fn sets(document: &Document, found: &Reference) -> bool {
    if found.is_selection {
        return document.at(&found.letters).len() > 2;
    }
    let text = document.text();
    let before = text.get(..found.letters.start).unwrap_or("").trim_end_matches([' ', '\t']);
    let after = text.get(found.digits.end..).unwrap_or("");
    // An element may follow: `PR[1,3]`.
    let line = after.split(['\r', '\n', ';']).next().unwrap_or("");
    let behind = line.split_once(']').map_or("", |(_, behind)| behind);
    before.ends_with([':', ',']) && behind.trim_start().starts_with('=')
}
