//! Reads the outlines of an SVG file.

use std::collections::HashMap;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use kurbo::{Affine, BezPath, CubicBez, PathEl, Point, Rect, Size};
use usvg::roxmltree::{Document, Node, ParsingOptions};

use super::arcs;
use super::paths::Outlines;

/// The bytes of the largest file that is read.
pub(super) const MAX_BYTES: u64 = 32 << 20;
/// The elements of a drawing, with those that `use` repeats.
const MAX_ELEMENTS: u64 = 1_000_000;
/// How deep its elements are nested.
const MAX_DEPTH: u32 = 256;
/// The sides of a view box, in its own units.
const VIEW_BOX: core::ops::RangeInclusive<f64> = 0.01..=1e6;
/// No curve goes further than this many sheets.
const MAX_SHEETS: f64 = 100.0;

/// The machine that follows the outlines of a drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tool {
    /// Follows the outline of every visible shape, with or without a stroke.
    Pen,
    /// Cuts along opaque strokes. Shapes without a stroke and translucent shapes are listed as unsupported.
    Laser,
}

/// The outlines of an SVG file in pixels of CSS, from the upper left corner of its page, with Y pointing down.
#[derive(Debug)]
pub struct Drawing {
    /// The size of the page, in pixels of CSS.
    pub page: Size,
    /// Whether the file gives both sides of its page in a unit of length: mm, cm, in, pt or pc.
    pub is_physical: bool,
    /// The visible elements that the tool cannot follow, as text; empty if it follows every element.
    pub left_out: String,
    path: BezPath,
}

impl Drawing {
    /// Reads an SVG file.
    ///
    /// # Errors
    /// When the data is not an SVG file, or describes more than any machine draws. The text continues a sentence that begins
    /// with the name of the drawing.
    pub fn read(data: &[u8], tool: Tool) -> Result<Self> {
        ensure!(data.len() as u64 <= MAX_BYTES, "is larger than {} MiB", MAX_BYTES >> 20);
        let text = core::str::from_utf8(data).context("is not an SVG file: its text is not UTF-8")?;
        let document =
            Document::parse_with_options(text, ParsingOptions { allow_dtd: true, ..Default::default() })
                .context("is not an SVG file")?;
        let elements = Elements::new(&document).count(document.root_element(), 0);
        ensure!(
            elements <= MAX_ELEMENTS,
            "has more than {MAX_ELEMENTS} elements, including those repeated by `use`, or is nested deeper than {MAX_DEPTH}"
        );
        let tree = usvg::Tree::from_xmltree(&document, &options()).context("is not an SVG file")?;
        let outlines = Outlines::of(&document, &tree, tool)?;
        let page = Size::new(tree.size().width().into(), tree.size().height().into());
        ensure!(
            VIEW_BOX.contains(&page.width) && VIEW_BOX.contains(&page.height),
            "has a view box of {} by {}: each side must be {} to {}",
            page.width,
            page.height,
            VIEW_BOX.start(),
            VIEW_BOX.end()
        );
        let is_physical = ["width", "height"].iter().all(|side| {
            let length = document.root_element().attribute(*side).unwrap_or_default().trim_end();
            ["mm", "cm", "in", "pt", "pc"].iter().any(|unit| length.ends_with(unit))
        });
        Ok(Self { page, is_physical, left_out: outlines.left_out(), path: outlines.path })
    }

    /// Passes each line of the outlines to `line`, with the number of its outline, from 1. Lines are placed on the sheet, are
    /// within `tolerance` of their curve, and end at the edge of `visible`. Returns whether any of them goes beyond that edge.
    ///
    /// # Errors
    /// When a curve leads far beyond the sheet; the errors of `line`.
    pub fn lines(
        &self,
        placed: Affine,
        visible: Rect,
        tolerance: f64,
        mut line: impl FnMut(u64, Point, Point) -> Result<()>,
    ) -> Result<bool> {
        let mut path = self.path.clone();
        path.apply_affine(placed);
        let furthest = MAX_SHEETS * visible.width().max(visible.height());
        let is_near = |p: Point| p.x.abs() <= furthest && p.y.abs() <= furthest;
        ensure!(
            path.elements().iter().flat_map(points).all(is_near),
            "has lines beyond {MAX_SHEETS} sheets: check the view box"
        );
        let (mut outline, mut start, mut last, mut is_cut_off) = (0, Point::ZERO, Point::ZERO, false);
        for element in path.elements() {
            let curve = match *element {
                PathEl::MoveTo(to) => {
                    (outline, start, last) = (outline + 1, to, to);
                    continue;
                }
                PathEl::ClosePath => PathEl::LineTo(start),
                curve => curve,
            };
            let (from, mut outcome) = (last, Ok(()));
            let mut step = |to: Point| {
                let from = core::mem::replace(&mut last, to);
                let shown = within(from, to, visible);
                is_cut_off |= shown != Some((from, to));
                if let (Some((from, to)), Ok(())) = (shown, &outcome) {
                    outcome = line(outline, from, to);
                }
            };
            let chords = match curve {
                PathEl::CurveTo(a, b, to) => arcs::chords(CubicBez::new(from, a, b, to), tolerance),
                _ => None,
            };
            match chords {
                Some(chords) => chords.for_each(&mut step),
                None => kurbo::flatten([PathEl::MoveTo(from), curve], tolerance, |part| {
                    if let PathEl::LineTo(to) = part {
                        step(to);
                    }
                }),
            }
            outcome?;
        }
        Ok(is_cut_off)
    }
}

/// Refuses a DXF drawing, which is recognised by its name or its first bytes.
///
/// # Errors
/// When the file is one: how to convert it.
pub fn refuse_dxf(file: &Path, data: &[u8]) -> Result<()> {
    let is_named = file.extension().is_some_and(|it| it.eq_ignore_ascii_case("dxf"));
    let data = data.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(data);
    let mut lines = data.splitn(3, |byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    // A group is two lines: its code and its value. The first one begins a section, or is a comment.
    let is_text = match (lines.next(), lines.next()) {
        (Some(b"0"), Some(value)) => value == b"SECTION",
        (Some(code), Some(_)) => code == b"999",
        _ => false,
    };
    if is_named || is_text || data.starts_with(b"AutoCAD Binary DXF") {
        let svg = file.with_extension("svg");
        let (file, svg) = (file.display(), svg.display());
        bail!(
            "{file} is a DXF drawing: convert it with `python3 dxf-to-svg.py {file} {svg}`; the script is docs/dxf-to-svg.py, and needs \
             `pip install ezdxf pillow`"
        );
    }
    Ok(())
}

/// The drawing itself is read and no other file: what it refers to is left out.
fn options() -> usvg::Options<'static> {
    let mut options = usvg::Options::default();
    options.image_href_resolver.resolve_string = Box::new(|_, _| None);
    options
}

/// How many elements there are when every `use` is followed.
struct Elements<'a, 'input> {
    by_id: HashMap<&'a str, Node<'a, 'input>>,
    counted: HashMap<Node<'a, 'input>, u64>,
}

impl<'a, 'input> Elements<'a, 'input> {
    fn new(document: &'a Document<'input>) -> Self {
        let by_id = document.descendants().filter_map(|node| Some((node.attribute("id")?, node))).collect();
        Self { by_id, counted: HashMap::new() }
    }

    fn count(&mut self, node: Node<'a, 'input>, depth: u32) -> u64 {
        if depth > MAX_DEPTH {
            return u64::MAX;
        }
        if let Some(count) = self.counted.get(&node) {
            return *count;
        }
        // An element that refers to itself is not drawn.
        self.counted.insert(node, 0);
        let mut count = 1_u64;
        for child in node.children().filter(Node::is_element) {
            count = count.saturating_add(self.count(child, depth + 1));
        }
        let target = node.attributes().find(|a| a.name() == "href").and_then(|a| a.value().strip_prefix('#'));
        if node.tag_name().name() == "use"
            && let Some(target) = target.and_then(|id| self.by_id.get(id).copied())
        {
            count = count.saturating_add(self.count(target, depth + 1));
        }
        self.counted.insert(node, count);
        count
    }
}

fn points(element: &PathEl) -> impl Iterator<Item = Point> + use<> {
    let points = match *element {
        PathEl::MoveTo(a) | PathEl::LineTo(a) => [Some(a), None, None],
        PathEl::QuadTo(a, b) => [Some(a), Some(b), None],
        PathEl::CurveTo(a, b, c) => [Some(a), Some(b), Some(c)],
        PathEl::ClosePath => [None; 3],
    };
    points.into_iter().flatten()
}

/// The part of a line that is visible.
fn within(from: Point, to: Point, visible: Rect) -> Option<(Point, Point)> {
    let way = to - from;
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    let axes = [(from.x, way.x, visible.x0, visible.x1), (from.y, way.y, visible.y0, visible.y1)];
    for (at, step, least, most) in axes {
        if step == 0.0 {
            if !(least..=most).contains(&at) {
                return None;
            }
            continue;
        }
        let (a, b) = ((least - at) / step, (most - at) / step);
        (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
    }
    let end = if leaves < 1.0 { from + way * leaves } else { to };
    (enters <= leaves).then(|| (from + way * enters, end))
}
