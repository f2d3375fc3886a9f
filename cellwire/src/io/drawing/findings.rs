//! The parts of a drawing that are not drawn as a viewer draws them, by kind, with their lines in the file.

use core::fmt::Write as _;
use std::collections::{BTreeMap, BTreeSet, HashMap};

use usvg::roxmltree::{Document, Node};

/// The lines listed for one kind.
const LISTED: usize = 5;
/// The beginning of an identifier that [`with_ids`] has given to an element.
const GIVEN: &str = "cellwire-element-";

/// The parts, by kind.
pub(super) struct Findings<'a> {
    kinds: BTreeMap<String, Kind>,
    document: &'a Document<'a>,
    /// The index in the text of each element that has an identifier.
    ids: HashMap<&'a str, usize>,
}

#[derive(Default)]
struct Kind {
    count: usize,
    /// The indices of the elements in the text.
    elements: BTreeSet<usize>,
}

impl<'a> Findings<'a> {
    /// Makes an empty list for a document whose elements have identifiers.
    pub(super) fn new(document: &'a Document<'a>) -> Self {
        let mut ids = HashMap::new();
        for node in document.descendants() {
            if let Some(id) = node.attribute("id") {
                ids.entry(id).or_insert(node.range().start);
            }
        }
        Self { kinds: BTreeMap::new(), document, ids }
    }

    /// Adds an element.
    pub(super) fn add(&mut self, kind: &str, node: Node<'_, '_>) {
        self.insert(kind, [node.range().start]);
    }

    /// Adds the element that has the identifier, or an element without a line.
    pub(super) fn add_at(&mut self, kind: &str, id: &str) {
        self.insert(kind, self.ids.get(id).copied());
    }

    /// Adds a warning of the reader, with the elements that have a value quoted in it.
    pub(super) fn add_warning(&mut self, warning: &str) {
        let mut text = warning.trim_end_matches('.').to_owned();
        let mut elements = BTreeSet::new();
        for quoted in warning.split('\'').skip(1).step_by(2).filter(|it| !it.is_empty()) {
            if let Some(element) = self.ids.get(quoted) {
                elements.insert(*element);
                if quoted.starts_with(GIVEN) {
                    text = text.replace(&format!("'{quoted}' "), "");
                }
                continue;
            }
            let has = |node: &Node<'_, '_>| node.attributes().any(|it| it.value().contains(quoted));
            elements.extend(self.document.descendants().filter(has).take(LISTED).map(|it| it.range().start));
        }
        if warning.starts_with("Error during path parsing") {
            let is_wrong = |data: &str| kurbo::BezPath::from_svg(data).is_err();
            let wrong = |node: &Node<'_, '_>| node.attribute("d").is_some_and(is_wrong);
            elements.extend(self.document.descendants().filter(wrong).map(|it| it.range().start));
        }
        self.insert(&text, elements);
    }

    fn insert(&mut self, kind: &str, elements: impl IntoIterator<Item = usize>) {
        let kind = self.kinds.entry(kind.to_owned()).or_default();
        kind.count += 1;
        kind.elements.extend(elements);
    }

    /// Returns the list as text, such as `2 texts (lines 3, 7)`.
    pub(super) fn text(&self) -> String {
        let named = self.kinds.iter().map(|(kind, Kind { count, elements })| {
            let is_simple = kind.bytes().all(|byte| byte == b' ' || byte.is_ascii_lowercase());
            let mut text = match count {
                1 if is_simple => format!("1 {kind}"),
                count if is_simple => format!("{count} {kind}s"),
                _ => kind.clone(),
            };
            let row = |element: &usize| self.document.text_pos_at(*element).row;
            let mut rows: Vec<_> = elements.iter().take(LISTED).map(row).collect();
            rows.dedup();
            if !rows.is_empty() {
                let word = if rows.len() == 1 { "line" } else { "lines" };
                let listed: Vec<_> = rows.iter().map(u32::to_string).collect();
                let more = if elements.len() > LISTED { ", …" } else { "" };
                let _ = write!(text, " ({word} {}{more})", listed.join(", "));
            }
            text
        });
        named.collect::<Vec<_>>().join(", ")
    }
}

/// Returns the text of a document in which each element has an identifier: the reader's tree and its warnings have no lines.
pub(super) fn with_ids(document: &Document<'_>) -> String {
    let text = document.input_text();
    let (mut result, mut copied) = (String::with_capacity(text.len() * 2), 0);
    for node in document.descendants().filter(|it| it.is_element() && it.attribute("id").is_none()) {
        let start = node.range().start;
        // An element of an entity has no start of its own.
        let Some(name) = text.get(start..).and_then(|rest| rest.strip_prefix('<')) else { continue };
        let length = name.find(|it: char| it.is_ascii_whitespace() || it == '/' || it == '>');
        let end = start + 1 + length.unwrap_or(name.len());
        if start >= copied {
            result.push_str(text.get(copied..end).unwrap_or_default());
            let _ = write!(result, " id=\"{GIVEN}{start}\"");
            copied = end;
        }
    }
    result.push_str(text.get(copied..).unwrap_or_default());
    result
}
