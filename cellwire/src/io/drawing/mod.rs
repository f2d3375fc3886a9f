//! Pictures for machines that draw lines: an SVG file to lines, and lines to an SVG file.

mod paths;

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::{Context, Result, anyhow, ensure};
use kurbo::{Affine, PathEl, Point as CurvePoint};
use usvg::roxmltree::{Document, Node, ParsingOptions};

use crate::io::files;
use crate::io::output::remark;
use paths::Outlines;

/// The built-in picture: a robot that draws a rosette, some 6000 lines.
const BUILT_IN: &str = include_str!("../../../assets/robot.svg");

/// How far a line may be from the curve that it approximates, in millimetres on the sheet.
const TOLERANCE: f64 = 0.05;

/// The bytes of the largest file that is read.
const MAX_BYTES: u64 = 32 << 20;
/// The elements of a drawing, with those that `use` repeats.
const MAX_ELEMENTS: u64 = 1_000_000;
/// How deep its elements are nested.
const MAX_DEPTH: u32 = 256;
/// The lines of a drawing.
const MAX_LINES: usize = 1_000_000;
/// The sides of a view box, in its own units.
const VIEW_BOX: core::ops::RangeInclusive<f64> = 0.01..=1e6;
/// No curve goes further than this many sheets.
const MAX_SHEETS: f64 = 100.0;

/// A point on the sheet in hundredths of a millimetre: x to the right, y down, from the upper left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Point {
    /// To the right.
    pub x: i32,
    /// Down.
    pub y: i32,
}

/// One straight line, with the pen on the sheet or lifted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Line {
    /// Whether the line is drawn; otherwise the pen only moves there.
    pub draws: bool,
    /// Where it begins.
    pub from: Point,
    /// Where it ends; never equal to `from`.
    pub to: Point,
}

/// The lines of a picture, each beginning where the one before it ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// The lines in the order of drawing.
    pub lines: Vec<Line>,
    /// The sheet's width and height in hundredths of a millimetre.
    pub sheet: Point,
}

impl Line {
    /// Its length in mm.
    pub fn length(&self) -> f64 {
        let way = |from: i32, to: i32| f64::from(to) - f64::from(from);
        way(self.from.x, self.to.x).hypot(way(self.from.y, self.to.y)) / 100.0
    }
}

impl Picture {
    /// The built-in picture on a sheet of this size.
    ///
    /// # Errors
    /// Never for a sheet that has an area.
    pub fn built_in(sheet: Point) -> Result<Self> {
        Self::from_svg(BUILT_IN.as_bytes(), sheet, false).map(|(picture, _)| picture)
    }

    /// The picture of an SVG file, as large as the sheet allows. Outlines are drawn, fills are not. What the file shows and a pen cannot
    /// follow, such as text and clips, is named: it is left out where that is allowed.
    ///
    /// # Errors
    /// When the file cannot be read, is not an SVG file, has no lines, has what is not to be left out, or is larger than any machine draws.
    pub fn from_file(path: &Path, sheet: Point, allow: bool) -> Result<Self> {
        let mut data = Vec::new();
        File::open(path)
            .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut data))
            .with_context(|| format!("cannot read the drawing {}", path.display()))?;
        ensure!(data.len() as u64 <= MAX_BYTES, "the drawing {} is larger than 32 MiB", path.display());
        let read = Self::from_svg(&data, sheet, allow);
        let (picture, left_out) =
            read.map_err(|error| anyhow!("the drawing {} {error:#}", path.display()))?;
        if !left_out.is_empty() {
            remark(&format!("warning: the drawing {} without {left_out}", path.display()));
        }
        Ok(picture)
    }

    /// The picture, and what is left out of it.
    fn from_svg(data: &[u8], sheet: Point, allow: bool) -> Result<(Self, String)> {
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
        let outlines = Outlines::of(&document, &tree)?;
        let left_out = outlines.left_out();
        ensure!(
            allow || left_out.is_empty(),
            "has {left_out}: convert them to paths and lines, or skip them with `kawasaki draw --allow`"
        );
        let mut path = outlines.path;
        let (width, height) = (f64::from(tree.size().width()), f64::from(tree.size().height()));
        ensure!(
            VIEW_BOX.contains(&width) && VIEW_BOX.contains(&height),
            "has a view box of {width} by {height}: each side must be {} to {}",
            VIEW_BOX.start(),
            VIEW_BOX.end()
        );
        let scale = (f64::from(sheet.x) / width).min(f64::from(sheet.y) / height);
        let (left, top) =
            ((f64::from(sheet.x) - width * scale) / 2.0, (f64::from(sheet.y) - height * scale) / 2.0);
        path.apply_affine(Affine::new([scale, 0.0, 0.0, scale, left, top]));
        let furthest = MAX_SHEETS * f64::from(sheet.x.max(sheet.y));
        let is_near = |p: CurvePoint| p.x.abs() <= furthest && p.y.abs() <= furthest;
        ensure!(
            path.elements().iter().flat_map(points).all(is_near),
            "has lines beyond {MAX_SHEETS} sheets: check the view box"
        );
        // A picture may extend beyond its view box, outside of which nothing is visible.
        let mut pen = Pen { at: Point { x: 0, y: 0 }, lines: Vec::new() };
        let (mut start, mut last) = (CurvePoint::ZERO, CurvePoint::ZERO);
        let mut line = |from: CurvePoint, to: CurvePoint| {
            if let Some((from, to)) = within(from, to, sheet) {
                pen.go(from, false);
                pen.go(to, true);
            }
        };
        kurbo::flatten(path, TOLERANCE * 100.0, |element| match element {
            PathEl::MoveTo(p) => (start, last) = (p, p),
            PathEl::LineTo(p) => {
                line(last, p);
                last = p;
            }
            PathEl::ClosePath => {
                line(last, start);
                last = start;
            }
            PathEl::QuadTo(..) | PathEl::CurveTo(..) => {} // flattened: there are none
        });
        pen.trim();
        ensure!(pen.lines.len() <= MAX_LINES, "has more than {MAX_LINES} lines");
        ensure!(!pen.lines.is_empty(), "has no outlines to draw: convert text to paths first");
        Ok((Self { lines: pen.lines, sheet }, left_out))
    }

    /// How many of the lines are drawn.
    pub fn strokes(&self) -> usize {
        self.lines.iter().filter(|line| line.draws).count()
    }
}

/// Writes the drawn lines as an SVG file of the sheet's size.
///
/// # Errors
/// When the file cannot be written.
pub fn write_svg(path: &Path, sheet: Point, lines: &[Line]) -> Result<()> {
    let document = document(sheet).add(strokes(lines, true, "black", 0.25));
    files::write(path, document.to_string().as_bytes())
}

fn document(sheet: Point) -> svg::Document {
    svg::Document::new()
        .set("width", format!("{}mm", mm(sheet.x)))
        .set("height", format!("{}mm", mm(sheet.y)))
        .set("viewBox", (0, 0, mm(sheet.x), mm(sheet.y)))
}

pub(super) fn strokes(lines: &[Line], draws: bool, color: &str, width: f64) -> svg::node::element::Path {
    let mut data = svg::node::element::path::Data::new();
    let mut at = None;
    for line in lines.iter().filter(|line| line.draws == draws) {
        if at != Some(line.from) {
            data = data.move_to((mm(line.from.x), mm(line.from.y)));
        }
        data = data.line_to((mm(line.to.x), mm(line.to.y)));
        at = Some(line.to);
    }
    svg::node::element::Path::new()
        .set("fill", "none")
        .set("stroke", color)
        .set("stroke-width", width)
        .set("stroke-linecap", "round")
        .set("stroke-linejoin", "round")
        .set("d", data)
}

pub(super) fn mm(hundredths: i32) -> f64 {
    f64::from(hundredths) / 100.0
}

struct Pen {
    at: Point,
    lines: Vec<Line>,
}

impl Pen {
    fn go(&mut self, to: Point, draws: bool) {
        if to == self.at || self.lines.len() > MAX_LINES {
            return;
        }
        let from = self.at;
        self.at = to;
        match self.lines.last_mut() {
            // Two consecutive moves become one.
            Some(last) if !last.draws && !draws => last.to = to,
            _ => self.lines.push(Line { draws, from, to }),
        }
        // A move that ends where it began is dropped.
        if self.lines.last().is_some_and(|last| last.from == last.to) {
            self.lines.pop();
        }
    }

    /// Drops a move after the last drawn line.
    fn trim(&mut self) {
        while self.lines.last().is_some_and(|last| !last.draws) {
            self.lines.pop();
        }
    }
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

fn points(element: &PathEl) -> impl Iterator<Item = CurvePoint> + use<> {
    let points = match *element {
        PathEl::MoveTo(a) | PathEl::LineTo(a) => [Some(a), None, None],
        PathEl::QuadTo(a, b) => [Some(a), Some(b), None],
        PathEl::CurveTo(a, b, c) => [Some(a), Some(b), Some(c)],
        PathEl::ClosePath => [None; 3],
    };
    points.into_iter().flatten()
}

/// The part of a line that is on the sheet.
fn within(from: CurvePoint, to: CurvePoint, sheet: Point) -> Option<(Point, Point)> {
    let way = to - from;
    let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
    for (at, step, most) in [(from.x, way.x, f64::from(sheet.x)), (from.y, way.y, f64::from(sheet.y))] {
        if step == 0.0 {
            if !(-0.5..=most + 0.5).contains(&at) {
                return None;
            }
            continue;
        }
        let (a, b) = (-at / step, (most - at) / step);
        (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
    }
    let on_sheet = |share: f64| {
        let p = from + way * share;
        Point { x: whole(p.x).clamp(0, sheet.x), y: whole(p.y).clamp(0, sheet.y) }
    };
    (enters <= leaves).then(|| (on_sheet(enters), on_sheet(leaves)))
}

#[expect(clippy::cast_possible_truncation, reason = "clamped to the sheet right after; `as` saturates")]
fn whole(x: f64) -> i32 {
    x.round() as i32
}

#[cfg(test)]
mod tests;
