//! The names and numbers of a program with their places, small enough to have them of every program of a folder.

use core::ops::Range;
use std::collections::BTreeMap;

use fanuc_ls::{Document, ItemKind, Reference};

/// A kind of register, input, label … and a number.
pub(crate) type Item = (ItemKind, u32);

/// The items that a program refers to.
#[derive(Debug, Default)]
pub(crate) struct Index {
    name: ByteRange,
    comment: Option<Box<str>>,
    references: Box<[Compact]>,
    programs: Box<[ByteRange]>,
    /// The first name that the program has for each item.
    names: BTreeMap<Item, ByteRange>,
}

/// A range of bytes. Texts are shorter than 4 GB.
#[derive(Debug, Clone, Copy, Default)]
struct ByteRange {
    start: u32,
    end: u32,
}

/// A [`Reference`] in fewer bytes.
#[derive(Debug, Clone, Copy)]
struct Compact {
    kind: ItemKind,
    is_definition: bool,
    is_selection: bool,
    number: u32,
    letters: ByteRange,
    digits: ByteRange,
    /// Empty at 0 if there is no name.
    name: ByteRange,
}

impl Index {
    pub(crate) fn new(program: &Document) -> Self {
        let references: Box<[Compact]> = program.references().map(Compact::new).collect();
        let mut names = BTreeMap::new();
        for found in references.iter().filter(|found| found.name.end > 0) {
            names.entry((found.kind, found.number)).or_insert(found.name);
        }
        let comment = program.attributes().find_map(|attribute| attribute.comment().map(Box::from));
        Self {
            name: ByteRange::new(&program.place(program.name())),
            comment: comment.filter(|comment| !str::is_empty(comment)),
            references,
            programs: program.program_references().map(|place| ByteRange::new(&place)).collect(),
            names,
        }
    }

    /// Returns the program's name after `/PROG`.
    pub(crate) fn name(&self) -> Range<usize> {
        self.name.range()
    }

    /// Returns COMMENT.
    pub(crate) fn comment(&self) -> Option<&str> {
        self.comment.as_deref()
    }

    /// Returns all items that are named by a number, in the sequence of the text.
    pub(crate) fn references(&self) -> impl Iterator<Item = Reference> {
        self.references.iter().map(Compact::reference)
    }

    /// Returns the uses and definitions of an item.
    pub(crate) fn references_to(&self, (kind, number): Item) -> impl Iterator<Item = Reference> {
        let is_meant = move |found: &&Compact| (found.kind, found.number) == (kind, number);
        self.references.iter().filter(is_meant).map(Compact::reference)
    }

    /// Returns the reference at a byte, including its end.
    pub(crate) fn reference_at(&self, offset: usize) -> Option<Reference> {
        let is_there = |found: &&Compact| (found.letters.start as usize..=found.end()).contains(&offset);
        self.references.iter().rev().find(is_there).map(Compact::reference)
    }

    /// Returns the names of programs that statements call, in the sequence of the text.
    pub(crate) fn programs(&self) -> impl Iterator<Item = Range<usize>> {
        self.programs.iter().map(|place| place.range())
    }

    /// Returns the range of the first name of an item.
    pub(crate) fn name_of(&self, item: Item) -> Option<Range<usize>> {
        self.names.get(&item).map(|place| place.range())
    }

    /// Returns each item that has a name, and the range of its first name.
    pub(crate) fn names(&self) -> impl Iterator<Item = (Item, Range<usize>)> {
        self.names.iter().map(|(item, place)| (*item, place.range()))
    }
}

impl ByteRange {
    fn new(range: &Range<usize>) -> Self {
        let short = |at: usize| u32::try_from(at).unwrap_or(u32::MAX);
        Self { start: short(range.start), end: short(range.end) }
    }

    fn range(self) -> Range<usize> {
        self.start as usize..self.end as usize
    }
}

impl Compact {
    fn new(found: Reference) -> Self {
        Self {
            kind: found.kind,
            is_definition: found.is_definition,
            is_selection: found.is_selection,
            number: found.number,
            letters: ByteRange::new(&found.letters),
            digits: ByteRange::new(&found.digits),
            name: found.name.as_ref().map(ByteRange::new).unwrap_or_default(),
        }
    }

    fn reference(&self) -> Reference {
        Reference {
            kind: self.kind,
            number: self.number,
            letters: self.letters.range(),
            digits: self.digits.range(),
            name: (self.name.end > 0).then(|| self.name.range()),
            is_definition: self.is_definition,
            is_selection: self.is_selection,
        }
    }

    fn end(&self) -> usize {
        // The bracket after it belongs to it for an eye.
        let after = usize::from(!self.is_selection);
        self.digits.end.max(self.name.end) as usize + after
    }
}
