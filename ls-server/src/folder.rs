//! The documents of a folder: those that are open, and the files below the workspace's folders.

use core::str::FromStr;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use fanuc_ls::{CheckContext, Rules};
use lsp_types::Uri;

use crate::document::Document;
use crate::files::{Walk, has_ending, stem};
use crate::index::Item;
use crate::listing::{self, ListedItem, Listing};
use crate::position::Encoding;
use crate::uri;

/// The endings of files that are read.
const ENDINGS: &[&str] = &["ls", "va", "dg"];
/// The files and folders that are looked at below a workspace's folder.
const MAX_ENTRIES: usize = 200_000;
/// The bytes of programs that are read below the workspace's folders, so that the server stays small.
const MAX_BYTES: usize = 24 << 20;

/// All documents.
#[derive(Debug, Default)]
pub(crate) struct Folder {
    pub(crate) encoding: Encoding,
    pub(crate) client: Client,
    pub(crate) rules: Rules,
    /// The macros and instructions that the user has named.
    pub(crate) around: CheckContext,
    roots: Vec<PathBuf>,
    /// The folders of controllers.
    controllers: Vec<PathBuf>,
    documents: BTreeMap<String, Document>,
    /// The listings of a backup, by their folder and file.
    listings: BTreeMap<PathBuf, BTreeMap<PathBuf, Listing>>,
    bytes: usize,
    is_cut: bool,
    /// Counts the changes of the inputs of findings other than their text: the known files, and the listings.
    changes: u64,
}

/// The kinds of edits that the client supports.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Client {
    /// Edits of a version of a document.
    pub(crate) versions: bool,
    /// Files that are renamed.
    pub(crate) renames: bool,
}

impl Folder {
    /// Creates a folder without documents.
    pub(crate) fn new(rules: Rules, around: CheckContext) -> Self {
        Self { rules, around, ..Self::default() }
    }

    /// Reads the programs and listings below a folder of the workspace.
    pub(crate) fn add_root(&mut self, root: &Path) {
        if self.roots.iter().any(|known| known == root) {
            return;
        }
        self.roots.push(root.to_path_buf());
        self.read_below(root);
        self.settle();
    }

    fn read_below(&mut self, folder: &Path) {
        let mut walk = Walk::new(folder, ENDINGS).at_most(MAX_ENTRIES);
        for path in walk.by_ref().flatten() {
            self.read_file(&path);
        }
        self.is_cut |= walk.is_cut();
    }

    /// Forgets the programs and listings below a folder of the workspace, except open documents.
    pub(crate) fn remove_root(&mut self, root: &Path) {
        self.roots.retain(|known| known != root);
        self.forget_below(root);
        self.settle();
    }

    /// Forgets the programs and listings below a folder, except open documents. Whether there were any.
    fn forget_below(&mut self, folder: &Path) -> bool {
        let start = uri::key_of_path(&folder.join(""));
        let below = self.documents.range(start.clone()..).take_while(|(key, _)| key.starts_with(&start));
        let closed = below.filter(|(_, document)| document.version().is_none());
        let gone: Vec<String> = closed.map(|(key, _)| key.clone()).collect();
        for document in gone.iter().filter_map(|key| self.documents.remove(key)) {
            self.bytes -= document.text().len().min(self.bytes);
        }
        let listings = self.listings.len();
        self.listings.retain(|of, _| !of.starts_with(folder));
        !gone.is_empty() || self.listings.len() != listings
    }

    /// Returns whether files were omitted because there are too many.
    pub(crate) fn is_cut(&self) -> bool {
        self.is_cut
    }

    /// Reads changed files again, or removes them if they are gone; of a folder, all that is below it. An open document has the
    /// editor's text. Returns whether any of them is a program or a listing.
    pub(crate) fn read(&mut self, mut paths: Vec<PathBuf>) -> bool {
        paths.sort();
        let (mut is_known, mut walked) = (false, None::<PathBuf>);
        for path in paths {
            if walked.as_ref().is_some_and(|folder| path.starts_with(folder)) {
                continue;
            }
            is_known |= self.forget_below(&path);
            // As in a walk, links to folders are not followed.
            if path.is_dir() && !path.is_symlink() && self.is_within(&path) {
                self.read_below(&path);
                is_known = true;
                walked = Some(path);
            } else if has_ending(&path, ENDINGS) {
                self.read_file(&path);
                is_known = true;
            }
        }
        if is_known {
            self.settle();
        }
        is_known
    }

    /// Returns whether a path is in a folder of the workspace.
    fn is_within(&self, path: &Path) -> bool {
        self.roots.iter().any(|root| path.starts_with(root))
    }

    fn read_file(&mut self, path: &Path) {
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        if listing::is_one(path) {
            let listing = std::fs::read(path).ok().map(|bytes| listing::read(path, &bytes));
            let of_folder = self.listings.entry(folder.clone()).or_default();
            match listing {
                Some(listing) => of_folder.insert(path.to_path_buf(), listing),
                None => of_folder.remove(path),
            };
            self.listings.retain(|_, files| !files.is_empty());
            return;
        }
        let key = uri::key_of_path(path);
        if !has_ending(path, &["ls"])
            || self.documents.get(&key).is_some_and(|known| known.version().is_some())
        {
            return;
        }
        if let Some(known) = self.documents.remove(&key) {
            self.bytes -= known.text().len().min(self.bytes);
        }
        let Ok(uri) = Uri::from_str(&uri::of_path(path)) else { return };
        let length =
            std::fs::metadata(path).map_or(0, |file| usize::try_from(file.len()).unwrap_or(usize::MAX));
        if self.bytes.saturating_add(length) > MAX_BYTES {
            self.is_cut = true;
            return;
        }
        let Ok(bytes) = std::fs::read(path) else { return };
        let text = match String::from_utf8(bytes) {
            Ok(text) => text,
            // As `Document::decode_bytes`: controllers write comments in the character set of their settings.
            Err(error) => error.into_bytes().into_iter().map(char::from).collect(),
        };
        self.bytes += text.len();
        self.insert(Document::new(uri, text, None, self.encoding));
    }

    /// Adds a document and returns the one that it replaces.
    fn insert(&mut self, mut document: Document) -> Option<Document> {
        self.changes += 1;
        document.controller = self.controller_of(document.path());
        self.documents.insert(uri::key(document.uri().as_str()), document)
    }

    /// Opens a document, in place of the file.
    pub(crate) fn open(&mut self, uri: Uri, version: i32, text: String) {
        let document = Document::new(uri, text, Some(version), self.encoding);
        if let Some(file) = self.insert(document)
            && file.version().is_none()
        {
            self.bytes -= file.text().len().min(self.bytes);
        }
    }

    /// Closes a document; the file takes its place if it is one of the workspace.
    pub(crate) fn close(&mut self, uri: &Uri) {
        let Some(document) = self.documents.remove(&uri::key(uri.as_str())) else { return };
        self.changes += 1;
        if let Some(path) = document.path().filter(|path| self.is_within(path)) {
            self.read(vec![path.to_path_buf()]);
        }
    }

    /// Returns the number of changes so far of the inputs of findings other than the text.
    pub(crate) fn changes(&self) -> u64 {
        self.changes
    }

    /// Returns the document with this URI.
    pub(crate) fn get(&self, uri: &Uri) -> Option<&Document> {
        self.documents.get(&uri::key(uri.as_str()))
    }

    /// Returns the document with this URI, to change it.
    pub(crate) fn get_mut(&mut self, uri: &Uri) -> Option<&mut Document> {
        self.documents.get_mut(&uri::key(uri.as_str()))
    }

    /// Returns all documents, sorted by path.
    pub(crate) fn documents(&self) -> impl Iterator<Item = &Document> {
        self.documents.values()
    }

    /// Returns the controller of a file: its folder is the nearest one above the file with the listings of a backup, or the
    /// workspace's. `None` for a file outside the workspace.
    fn controller_of(&mut self, path: Option<&Path>) -> Option<usize> {
        let path = path?;
        let root = self
            .roots
            .iter()
            .filter(|root| path.starts_with(root))
            .max_by_key(|root| root.as_os_str().len())?;
        let mut above = path.ancestors().skip(1).take_while(|folder| folder.starts_with(root));
        let folder = above.find(|folder| self.listings.contains_key(*folder)).unwrap_or(root);
        let known = self.controllers.iter().position(|known| known == folder);
        Some(known.unwrap_or_else(|| {
            self.controllers.push(folder.to_path_buf());
            self.controllers.len() - 1
        }))
    }

    /// Decides again which controller each document belongs to.
    fn settle(&mut self) {
        self.changes += 1;
        self.controllers.clear();
        let mut documents = core::mem::take(&mut self.documents);
        for document in documents.values_mut() {
            document.controller = self.controller_of(document.path());
        }
        self.documents = documents;
    }

    /// Returns the documents of the same controller, including the document itself.
    pub(crate) fn neighbours<'a>(&'a self, document: &'a Document) -> impl Iterator<Item = &'a Document> {
        let controller = document.controller;
        let alone = controller.is_none().then_some(document);
        let others =
            self.documents().filter(move |other| controller.is_some() && other.controller == controller);
        alone.into_iter().chain(others)
    }

    /// Returns the program with this name that a document calls; `/PROG` has the name, or the file.
    pub(crate) fn program<'a>(&'a self, from: &'a Document, name: &str) -> Option<&'a Document> {
        let is_meant = |document: &&Document| {
            document.name().eq_ignore_ascii_case(name)
                || document.path().and_then(stem).is_some_and(|stem| stem.eq_ignore_ascii_case(name))
        };
        self.neighbours(from).find(is_meant)
    }

    /// Returns the known surroundings of a document, for its findings.
    pub(crate) fn surroundings(&self, document: &Document) -> CheckContext {
        let mut around = self.around.clone();
        around.file = document.path().and_then(stem);
        if document.controller.is_some() {
            let names = self.neighbours(document).filter_map(|other| other.path().and_then(stem));
            around.programs = Some(names.map(|name| name.to_uppercase()).collect());
        }
        for listing in self.listings_of(document) {
            around.macros.extend(listing.macros.keys().cloned());
        }
        around
    }

    fn listings_of(&self, document: &Document) -> impl Iterator<Item = &Listing> {
        let folder = document.controller.and_then(|controller| self.controllers.get(controller));
        let folder = folder.and_then(|folder| self.listings.get(folder));
        folder.into_iter().flat_map(BTreeMap::values)
    }

    /// Returns the program that a macro runs.
    pub(crate) fn macro_program(&self, document: &Document, name: &str) -> Option<&str> {
        self.listings_of(document)
            .find_map(|listing| listing.macros.get(&name.to_uppercase()))
            .map(String::as_str)
    }

    /// Returns a backup's entry for an item, and the listing's file.
    pub(crate) fn listed(&self, document: &Document, item: Item) -> Option<(&ListedItem, &str)> {
        self.listings_of(document)
            .find_map(|listing| Some((listing.items.get(&item)?, listing.file.as_str())))
    }

    /// Returns the name of an item: the controller's, if there is a listing, or the document's, or another program's.
    pub(crate) fn name_of<'a>(&'a self, document: &'a Document, item: Item) -> Option<&'a str> {
        let listed = self
            .listed(document, item)
            .map(|(listed, _)| listed.name.as_str())
            .filter(|name| !name.is_empty());
        let named = |document: &'a Document| document.index().name_of(item).map(|place| document.at(&place));
        listed
            .or_else(|| named(document))
            .or_else(|| if is_local(item) { None } else { self.neighbours(document).find_map(named) })
    }

    /// Returns every item with a name, of the listings and the programs.
    pub(crate) fn names<'a>(&'a self, document: &'a Document) -> BTreeMap<Item, &'a str> {
        let mut names = BTreeMap::new();
        for listing in self.listings_of(document) {
            let items = listing.items.iter().filter(|(_, listed)| !listed.name.is_empty());
            names.extend(items.map(|(item, listed)| (*item, listed.name.as_str())));
        }
        for (item, place) in document.index().names() {
            names.entry(item).or_insert_with(|| document.at(&place));
        }
        for other in self.neighbours(document) {
            for (item, place) in other.index().names().filter(|(item, _)| !is_local(*item)) {
                names.entry(item).or_insert_with(|| other.at(&place));
            }
        }
        names
    }

    /// Returns the names of the programs that a document may call.
    pub(crate) fn programs<'a>(&'a self, document: &'a Document) -> BTreeSet<&'a str> {
        self.neighbours(document).map(Document::name).filter(|name| !name.is_empty()).collect()
    }
}

/// Returns whether an item is local to one program: a label, a position, an argument.
pub(crate) fn is_local((kind, _): Item) -> bool {
    use fanuc_ls::ItemKind::{Argument, Label, Position};
    matches!(kind, Label | Position | Argument)
}
