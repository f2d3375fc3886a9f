//! Finds the elements, properties and references of a drawing that the SVG reader omits without a warning.

use std::collections::{HashMap, HashSet};

use anyhow::{Result, ensure};
use simplecss::{AttributeOperator, DeclarationTokenizer, Element, PseudoClass, StyleSheet};
use usvg::roxmltree::{Document, Node};

use super::MAX_SHEETS;
use super::findings::Findings;

/// The greatest number in a coordinate, in any unit.
const MAX_NUMBER: f64 = 1e9;
/// Attributes with lengths.
const LENGTHS: [&str; 14] =
    ["x", "y", "x1", "y1", "x2", "y2", "cx", "cy", "r", "rx", "ry", "width", "height", "stroke-dashoffset"];
/// Other attributes with coordinates.
const COORDINATES: [&str; 4] = ["d", "points", "transform", "viewBox"];
/// Beginnings of the CSS properties that the reader applies, or that do not change the strokes.
const PROPERTIES: [&str; 44] = [
    "-",
    "alignment-",
    "background",
    "baseline-",
    "block-progression",
    "clip-",
    "color",
    "cursor",
    "direction",
    "display",
    "dominant-",
    "enable-background",
    "fill",
    "filter",
    "flood-",
    "font",
    "glyph-",
    "image-rendering",
    "inline-size",
    "isolation",
    "kerning",
    "letter-",
    "lighting-",
    "line-height",
    "marker",
    "mask",
    "mix-blend-mode",
    "opacity",
    "overflow",
    "paint-order",
    "pointer-events",
    "shape-",
    "solid-",
    "stop-",
    "stroke",
    "text-",
    "unicode-",
    "user-select",
    "vector-effect",
    "visibility",
    "white-space",
    "word-",
    "writing-mode",
    "xml",
];

/// The elements of a drawing, as they are rendered.
pub(super) struct Check<'f, 'a> {
    by_id: HashMap<&'a str, Node<'a, 'a>>,
    repeated: HashSet<&'a str>,
    sheet: StyleSheet<'a>,
    findings: &'f mut Findings<'a>,
    /// The elements that `use` and markers are repeating.
    open: Vec<Node<'a, 'a>>,
    /// The markers that were visited.
    markers: HashSet<Node<'a, 'a>>,
    scales_dashes: bool,
    nests_markers: bool,
}

impl<'f, 'a> Check<'f, 'a> {
    /// Adds the findings of a document. Returns whether the lengths of dashes have a scale of their own.
    ///
    /// # Errors
    /// If a coordinate is far beyond any sheet, or the view box has no area.
    pub(super) fn run(document: &'a Document<'a>, findings: &'f mut Findings<'a>) -> Result<bool> {
        let (mut by_id, mut repeated) = (HashMap::new(), HashSet::new());
        for node in document.descendants() {
            if let Some(id) = node.attribute("id")
                && *by_id.entry(id).or_insert(node) != node
            {
                repeated.insert(id);
            }
        }
        let sheet = StyleSheet::new();
        let mut check = Self {
            by_id,
            repeated,
            sheet,
            findings,
            open: Vec::new(),
            markers: HashSet::new(),
            scales_dashes: false,
            nests_markers: false,
        };
        check.style_sheets(document);
        for node in document.descendants() {
            for attribute in node.attributes().filter(|it| it.namespace().is_none()) {
                let name = attribute.name();
                let has_numbers = LENGTHS.contains(&name) || COORDINATES.contains(&name);
                ensure!(
                    !has_numbers || numbers(attribute.value()).all(|number| number.abs() <= MAX_NUMBER),
                    "has lines beyond {MAX_SHEETS} sheets: check the view box and the coordinates in line {}",
                    document.text_pos_at(node.range().start).row
                );
            }
        }
        ensure!(has_area(document.root_element()), "has a view box without an area");
        check.element(document.root_element(), true);
        // The reader repeats the inner ones for each outer one, without a limit.
        ensure!(!check.nests_markers, "has markers in markers: convert them to paths");
        Ok(check.scales_dashes)
    }

    fn style_sheets(&mut self, document: &'a Document<'a>) {
        let external =
            document.root().children().filter(|it| it.pi().is_some_and(|pi| pi.target == "xml-stylesheet"));
        for node in external {
            self.findings.add("external style sheet", node);
        }
        for node in document.descendants().filter(|it| it.has_tag_name("style")) {
            if node.attribute("type").is_some_and(|kind| kind != "text/css") {
                continue;
            }
            let is_for_screens =
                node.attribute("media").is_none_or(|it| ["", "all", "screen"].contains(&it.trim()));
            // The reader takes the first text only.
            if !is_for_screens || node.children().count() > 1 {
                self.findings.add("style sheet", node);
            }
            self.sheet.parse_more(node.text().unwrap_or_default());
        }
    }

    /// Visits an element that is rendered, unless its own properties hide it. `is_visible` is its inherited visibility.
    fn element(&mut self, node: Node<'a, 'a>, is_visible: bool) {
        let tag = node.tag_name();
        if !matches!(tag.namespace(), None | Some("http://www.w3.org/2000/svg")) {
            if tag.namespace() == Some("http://www.w3.org/2001/XInclude") {
                self.findings.add("XInclude", node);
            }
            return;
        }
        if !node.is_element() || !meets_conditions(node) {
            return;
        }
        let properties = self.properties(node);
        let value = |name: &str| value(&properties, name);
        let is_transparent = |it: &str| it.trim_end_matches('%').parse::<f64>().is_ok_and(|it| it <= 0.0);
        if value("display") == Some("none") || value("opacity").is_some_and(is_transparent) {
            return;
        }
        let is_visible = match value("visibility") {
            None | Some("inherit") => is_visible,
            Some(value) => value == "visible",
        };
        match tag.name() {
            "svg" | "g" | "a" | "symbol" | "marker" => {
                self.own(node, &properties);
                let is_sized = ["width", "height"].iter().all(|side| node.has_attribute(*side));
                let is_nested = tag.name() == "svg" && node.parent_element().is_some();
                // The reader does not clip such an element, viewers do.
                if is_nested && !is_sized && value("overflow") != Some("visible") {
                    self.findings.add("nested `svg` without a width or height", node);
                }
                for child in node.children() {
                    self.element(child, is_visible);
                }
            }
            "switch" => {
                self.own(node, &properties);
                if let Some(chosen) = node.children().find(|it| it.is_element() && meets_conditions(*it)) {
                    self.element(chosen, is_visible);
                }
            }
            "use" => {
                self.own(node, &properties);
                self.reference(node, is_visible);
            }
            "path" | "rect" | "circle" | "ellipse" | "line" | "polyline" | "polygon" => {
                self.own(node, &properties);
                for child in node.children() {
                    self.element(child, is_visible);
                }
            }
            "text" if self.shows_text(node, is_visible) => self.findings.add("text", node),
            "image" if is_visible => self.findings.add("image", node),
            "foreignObject" if is_visible => self.findings.add("foreign object", node),
            "animate" | "animateMotion" | "animateTransform" | "animateColor" | "set" => {
                self.findings.add("animation", node);
            }
            "script" => self.findings.add("script", node),
            // Elements that are not rendered where they are.
            "text" | "image" | "foreignObject" | "defs" | "clipPath" | "mask" | "pattern"
            | "linearGradient" | "radialGradient" | "meshgradient" | "meshGradient" | "hatch"
            | "solidcolor" | "solidColor" | "filter" | "style" | "title" | "desc" | "metadata" | "view"
            | "cursor" | "font" | "font-face" | "color-profile" => {}
            other => self.findings.add(&format!("<{other}>"), node),
        }
    }

    /// Returns the properties of an element; a later one overrides an earlier one.
    fn properties(&self, node: Node<'a, 'a>) -> Vec<(&'a str, &'a str, bool)> {
        let attributes = node.attributes().filter(|it| it.namespace().is_none());
        let mut properties: Vec<_> = attributes.map(|it| (it.name(), it.value(), false)).collect();
        let rules = self.sheet.rules.iter().filter(|it| it.selector.matches(&StyledElement(node)));
        let mut declarations: Vec<_> = rules.flat_map(|it| it.declarations.iter().copied()).collect();
        declarations.extend(DeclarationTokenizer::from(node.attribute("style").unwrap_or_default()));
        declarations.sort_by_key(|it| it.important);
        properties.extend(declarations.iter().map(|it| (it.name, it.value, true)));
        properties
    }

    /// Adds the findings of an element itself.
    fn own(&mut self, node: Node<'a, 'a>, properties: &[(&'a str, &'a str, bool)]) {
        for (name, value, is_css) in properties {
            let (name, value) = (*name, value.trim());
            let is_initial = ["none", "auto", "normal", "initial", "inherit", "unset"].contains(&value);
            if *is_css && !is_initial && !PROPERTIES.iter().any(|known| name.starts_with(known)) {
                self.findings.add(&format!("the style property `{name}`"), node);
            }
            if let Some(id) = value.strip_prefix("url(") {
                let (id, fallback) = id.split_once(')').unwrap_or((id, ""));
                let id = id.trim_matches(['"', '\'', ' ']);
                let target = id.strip_prefix('#').and_then(|id| self.target(id, name, node));
                if target.is_none() && fallback.trim().is_empty() {
                    self.findings.add(&format!("`{name}` that refers to `{id}`"), node);
                }
                if name.starts_with("marker")
                    && let Some(target) = target
                {
                    self.nests_markers |= self.open.iter().any(|it| it.has_tag_name("marker"));
                    if self.markers.insert(target) {
                        self.repeat(target, true);
                    }
                }
            } else if ["clip-path", "mask"].contains(&name) && !is_initial {
                self.findings.add(&format!("`{name}` that is a shape"), node);
            }
            let is_unsupported = match name {
                "clip" | "transform-box" if !*is_css => !is_initial,
                "stroke-width" => value.starts_with('-'),
                // The reader draws a solid line.
                "stroke-dasharray" => !is_initial && !value.split([' ', ',']).all(is_dash),
                "viewBox" => !has_area(node),
                _ => false,
            };
            if is_unsupported {
                self.findings.add(&format!("`{name}` of `{value}`"), node);
            }
            if LENGTHS.contains(&name) && (value.ends_with("em") || value.ends_with("ex")) {
                self.findings.add("length in the size of a font", node);
            }
            self.scales_dashes |= name == "pathLength" || (name == "vector-effect" && !is_initial);
        }
    }

    /// Returns the element with an identifier. An identifier of two elements is a finding: readers choose different ones.
    fn target(&mut self, id: &str, name: &str, node: Node<'a, 'a>) -> Option<Node<'a, 'a>> {
        if self.repeated.contains(id) {
            self.findings
                .add(&format!("`{name}` that refers to `{id}`, which several elements are called,"), node);
        }
        self.by_id.get(id).copied()
    }

    /// Visits the element that a `use` repeats.
    fn reference(&mut self, node: Node<'a, 'a>, is_visible: bool) {
        let href = node.attribute("href");
        let href =
            href.or_else(|| node.attribute(("http://www.w3.org/1999/xlink", "href"))).unwrap_or_default();
        match href.trim().strip_prefix('#').and_then(|id| self.target(id, "use", node)) {
            Some(target) => self.repeat(target, is_visible),
            None => self.findings.add(&format!("`use` that refers to `{href}`"), node),
        }
    }

    fn repeat(&mut self, target: Node<'a, 'a>, is_visible: bool) {
        // An element that refers to itself is not drawn.
        if !self.open.contains(&target) {
            self.open.push(target);
            self.element(target, is_visible);
            self.open.pop();
        }
    }

    /// Returns whether a text has visible characters.
    fn shows_text(&self, node: Node<'a, 'a>, is_visible: bool) -> bool {
        node.children().any(|child| {
            if child.is_text() {
                return is_visible && !child.text().unwrap_or_default().trim().is_empty();
            }
            let properties = self.properties(child);
            let is_visible = value(&properties, "visibility").map_or(is_visible, |it| it == "visible");
            child.is_element()
                && value(&properties, "display") != Some("none")
                && self.shows_text(child, is_visible)
        })
    }
}

/// Returns the value of a property: the last one that is given.
fn value<'a>(properties: &[(&'a str, &'a str, bool)], name: &str) -> Option<&'a str> {
    properties.iter().rev().find(|it| it.0 == name).map(|it| it.1.trim())
}

/// An element as the selectors of a style sheet see it.
struct StyledElement<'a>(Node<'a, 'a>);

impl Element for StyledElement<'_> {
    fn parent_element(&self) -> Option<Self> {
        self.0.parent_element().map(Self)
    }

    fn prev_sibling_element(&self) -> Option<Self> {
        self.0.prev_sibling_element().map(Self)
    }

    fn has_local_name(&self, name: &str) -> bool {
        self.0.tag_name().name() == name
    }

    fn attribute_matches(&self, name: &str, operator: AttributeOperator<'_>) -> bool {
        self.0.attribute(name).is_some_and(|value| operator.matches(value))
    }

    fn pseudo_class_matches(&self, class: PseudoClass<'_>) -> bool {
        matches!(class, PseudoClass::FirstChild) && self.prev_sibling_element().is_none()
    }
}

/// Returns whether the reader draws an element under its conditions: English, and no extensions.
fn meets_conditions(node: Node<'_, '_>) -> bool {
    let is_english = |tag: &str| tag.trim() == "en" || tag.trim().starts_with("en-");
    node.attribute("requiredExtensions").is_none()
        && node.attribute("systemLanguage").is_none_or(|tags| tags.split(',').any(is_english))
}

/// Returns whether the view box of an element has an area, if the element has a view box of four numbers.
fn has_area(node: Node<'_, '_>) -> bool {
    let view_box = node.attribute("viewBox").unwrap_or_default();
    let parts: Vec<f64> = numbers(view_box).collect();
    match parts.as_slice() {
        [_, _, width, height] => *width > 0.0 && *height > 0.0,
        // The reader warns of other values.
        _ => true,
    }
}

/// Returns whether a part of `stroke-dasharray` is the length of a dash, or nothing between two separators.
fn is_dash(part: &str) -> bool {
    let number = part.trim_end_matches(|it: char| it.is_ascii_alphabetic() || it == '%');
    part.is_empty() || number.parse::<f64>().is_ok_and(|length| length >= 0.0)
}

/// Returns the numbers in the value of an attribute.
fn numbers(text: &str) -> impl Iterator<Item = f64> + '_ {
    let mut rest = text;
    core::iter::from_fn(move || {
        rest = rest.trim_start_matches(|it: char| !it.is_ascii_digit() && !"+-.".contains(it));
        if rest.is_empty() {
            return None;
        }
        let digits = |text: &str| text.len() - text.trim_start_matches(|it: char| it.is_ascii_digit()).len();
        let signed = |text: &str| usize::from(text.starts_with(['+', '-']));
        let after = |at: usize| rest.get(at..).unwrap_or_default();
        let mut end = signed(rest);
        end += digits(after(end));
        if after(end).starts_with('.') {
            end += 1 + digits(after(end + 1));
        }
        if after(end).starts_with(['e', 'E']) {
            let sign = signed(after(end + 1));
            match digits(after(end + 1 + sign)) {
                0 => {}
                exponent => end += 1 + sign + exponent,
            }
        }
        let number = after(0).get(..end).and_then(|it| it.parse().ok()).unwrap_or(0.0);
        rest = after(end.max(1));
        Some(number)
    })
}
