//! Pictures for machines that draw lines: an SVG file to lines, and lines to an SVG file.

use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use kurbo::{Affine, BezPath, PathEl, Point as CurvePoint};
use usvg::roxmltree::{Document, Node, ParsingOptions};
use usvg::tiny_skia_path::PathSegment;

use crate::io::files;

/// The built-in picture: a robot that draws a rosette, some 6000 lines.
const BUILT_IN: &str = include_str!("../../assets/robot.svg");

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
/// No curve goes further than so many sheets.
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
        Self::from_svg(BUILT_IN.as_bytes(), sheet)
    }

    /// The picture of an SVG file, as large as the sheet allows. Outlines are drawn, fills are not.
    ///
    /// # Errors
    /// When the file cannot be read, is not an SVG file, has no lines, or is larger than any machine draws.
    pub fn from_file(path: &Path, sheet: Point) -> Result<Self> {
        let mut data = Vec::new();
        File::open(path)
            .and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut data))
            .with_context(|| format!("cannot read the drawing {}", path.display()))?;
        ensure!(data.len() as u64 <= MAX_BYTES, "the drawing {} is larger than 32 MiB", path.display());
        Self::from_svg(&data, sheet).with_context(|| format!("the drawing {}", path.display()))
    }

    fn from_svg(data: &[u8], sheet: Point) -> Result<Self> {
        let text = core::str::from_utf8(data).context("is not an SVG file: its text is not UTF-8")?;
        let document =
            Document::parse_with_options(text, ParsingOptions { allow_dtd: true, ..Default::default() })
                .context("is not an SVG file")?;
        let elements = Elements::new(&document).count(document.root_element(), 0);
        ensure!(
            elements <= MAX_ELEMENTS,
            "has more than {MAX_ELEMENTS} elements, with those that `use` repeats, or nests them deeper than {MAX_DEPTH}"
        );
        let tree = usvg::Tree::from_xmltree(&document, &options()).context("is not an SVG file")?;
        let mut path = BezPath::new();
        collect(tree.root(), &mut path);
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
            "has lines that go further than {MAX_SHEETS} sheets: is the view box right?"
        );
        // Limited to the sheet, as by an end stop of the pen: a picture may extend beyond its own view box.
        let on_sheet =
            |p: CurvePoint| Point { x: whole(p.x).clamp(0, sheet.x), y: whole(p.y).clamp(0, sheet.y) };
        let mut pen = Pen { at: Point { x: 0, y: 0 }, lines: Vec::new() };
        let mut start = pen.at;
        kurbo::flatten(path, TOLERANCE * 100.0, |element| match element {
            PathEl::MoveTo(p) => {
                start = on_sheet(p);
                pen.go(start, false);
            }
            PathEl::LineTo(p) => pen.go(on_sheet(p), true),
            PathEl::ClosePath => pen.go(start, true),
            PathEl::QuadTo(..) | PathEl::CurveTo(..) => {} // flattened: there are none
        });
        pen.trim();
        ensure!(pen.lines.len() <= MAX_LINES, "has more than {MAX_LINES} lines");
        anyhow::ensure!(
            !pen.lines.is_empty(),
            "has no lines to draw: only outlines are drawn, and text must be turned into paths first"
        );
        Ok(Self { lines: pen.lines, sheet })
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

/// Draws a route in a plane, in mm with Y upwards: places, and whether the way to each is thick. The sheet fits it, with a margin.
///
/// # Errors
/// When the route leaves 10 km, or the file cannot be written.
pub fn write_route(path: &Path, route: &[([f64; 2], bool)]) -> Result<()> {
    let of = |axis: usize| route.iter().filter_map(move |(place, _)| place.get(axis).copied());
    let least = [0, 1].map(|axis| of(axis).fold(f64::INFINITY, f64::min));
    let most = [0, 1].map(|axis| of(axis).fold(f64::NEG_INFINITY, f64::max));
    let ([left, _], [right, top]) = (least, most);
    let (width, height) = (right - left, top - least[1]);
    anyhow::ensure!(width < 1e7 && height < 1e7, "the way leaves 10 km: check its units");
    let margin = (width.max(height) / 20.0).max(1.0);
    let sheet = Point { x: hundredths(width + 2.0 * margin), y: hundredths(height + 2.0 * margin) };
    let point =
        |[x, y]: [f64; 2]| Point { x: hundredths(x - left + margin), y: hundredths(top - y + margin) };
    let ways = route.iter().zip(route.iter().skip(1));
    let lines: Vec<Line> = ways
        .map(|((from, _), (to, draws))| Line { draws: *draws, from: point(*from), to: point(*to) })
        .collect();
    // On a small sheet thin lines, on a large one lines that can be seen.
    let width = mm(sheet.x.max(sheet.y)) / 400.0;
    let between = strokes(&lines, false, "#d04000", width / 3.0).set("stroke-dasharray", width);
    let document = document(sheet).add(between).add(strokes(&lines, true, "black", width));
    files::write(path, document.to_string().as_bytes())
}

#[expect(clippy::cast_possible_truncation, reason = "it saturates")]
fn hundredths(mm: f64) -> i32 {
    (mm * 100.0).round() as i32
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
        // What refers to itself is drawn by nobody.
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

fn collect(group: &usvg::Group, out: &mut BezPath) {
    for node in group.children() {
        match node {
            usvg::Node::Group(inner) => collect(inner, out),
            usvg::Node::Path(path) if path.is_visible() => {
                let Some(data) = path.data().clone().transform(path.abs_transform()) else { continue };
                data.segments().for_each(|segment| out.push(element(segment)));
            }
            usvg::Node::Path(_) | usvg::Node::Image(_) | usvg::Node::Text(_) => {}
        }
    }
}

fn element(segment: PathSegment) -> PathEl {
    let point = |p: usvg::tiny_skia_path::Point| CurvePoint::new(f64::from(p.x), f64::from(p.y));
    match segment {
        PathSegment::MoveTo(p) => PathEl::MoveTo(point(p)),
        PathSegment::LineTo(p) => PathEl::LineTo(point(p)),
        PathSegment::QuadTo(a, p) => PathEl::QuadTo(point(a), point(p)),
        PathSegment::CubicTo(a, b, p) => PathEl::CurveTo(point(a), point(b), point(p)),
        PathSegment::Close => PathEl::ClosePath,
    }
}

#[expect(clippy::cast_possible_truncation, reason = "clamped to the sheet right after; `as` saturates")]
fn whole(x: f64) -> i32 {
    x.round() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    const A4: Point = Point { x: 29700, y: 21000 };

    fn picture_text(body: &str) -> String {
        format!(r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 297 210">{body}</svg>"#)
    }

    fn picture(body: &str) -> Result<Picture> {
        Picture::from_svg(picture_text(body).as_bytes(), A4)
    }

    #[test]
    fn the_built_in_picture_is_detailed_and_continuous() {
        let picture = Picture::built_in(A4).unwrap();
        assert!(picture.strokes() >= 2000, "{}", picture.strokes());
        assert!(picture.lines.windows(2).all(|w| w[0].to == w[1].from));
        assert!(picture.lines.windows(2).all(|w| w[0].draws || w[1].draws), "two moves in a row");
        assert!(picture.lines.iter().all(|l| l.from != l.to));
    }

    #[test]
    fn a_square_is_a_move_and_four_lines() {
        let picture =
            picture(r#"<rect x="10" y="20" width="30" height="40" fill="none" stroke="red"/>"#).unwrap();
        let corner = |x, y| Point { x, y };
        let at = [corner(1000, 2000), corner(4000, 2000), corner(4000, 6000), corner(1000, 6000)];
        let line = |draws, from, to| Line { draws, from, to };
        assert_eq!(
            picture.lines,
            [
                line(false, corner(0, 0), at[0]),
                line(true, at[0], at[1]),
                line(true, at[1], at[2]),
                line(true, at[2], at[3]),
                line(true, at[3], at[0]),
            ]
        );
    }

    #[test]
    fn a_curve_stays_within_the_tolerance() {
        let picture = picture(r#"<circle cx="100" cy="100" r="50" fill="none" stroke="red"/>"#).unwrap();
        assert!(picture.strokes() > 20);
        for line in picture.lines.iter().filter(|l| l.draws) {
            let middle = (f64::from(line.from.x + line.to.x) / 2.0, f64::from(line.from.y + line.to.y) / 2.0);
            let radius = (middle.0 - 10000.0).hypot(middle.1 - 10000.0);
            assert!((radius - 5000.0).abs() <= 7.0, "{radius}");
        }
    }

    #[test]
    fn what_cannot_be_drawn_is_reported() {
        let error = |result: Result<Picture>| format!("{:#}", result.unwrap_err());
        assert!(error(picture("")).contains("has no lines to draw"));
        assert!(error(Picture::from_svg(b"no svg", A4)).starts_with("is not an SVG file"));
        let missing = Picture::from_file(Path::new("no/such.svg"), A4);
        assert!(error(missing).starts_with("cannot read the drawing no/such.svg"));
        let endless = Picture::from_file(Path::new("/dev/zero"), A4);
        assert_eq!(error(endless), "the drawing /dev/zero is larger than 32 MiB");
    }

    #[test]
    fn no_drawing_is_too_large_to_be_refused() {
        let error = |text: &str| format!("{:#}", Picture::from_svg(text.as_bytes(), A4).unwrap_err());
        let svg = |head: &str, body: &str| {
            format!(r#"<svg xmlns="http://www.w3.org/2000/svg" {head}>{body}</svg>"#)
        };
        let curve = r#"<path d="M0 0 C 1 1 2 3 4 5" stroke="red"/>"#;
        let tiny = error(&svg(r#"viewBox="0 0 1e-30 1e-30""#, curve));
        assert!(tiny.starts_with("has a view box of 0.0"), "{tiny}");
        let far = r#"<path d="M0 0 C 1e30 1 2 3e30 4 5 A 1e20 1 0 0 0 1e19 5" stroke="red"/>"#;
        let far = error(&svg(r#"viewBox="0 0 297 210""#, far));
        assert_eq!(far, "has lines that go further than 100 sheets: is the view box right?");
        let mut body = String::from(r#"<g id="a0"><path d="M0 0 L 9 9" stroke="red"/></g>"#);
        for level in 1..40 {
            let below = level - 1;
            body += &format!(r##"<g id="a{level}"><use href="#a{below}"/><use href="#a{below}"/></g>"##);
        }
        let laughs = error(&svg(r#"viewBox="0 0 297 210""#, &body));
        let refused =
            "has more than 1000000 elements, with those that `use` repeats, or nests them deeper than 256";
        assert_eq!(laughs, refused);
        let deep = "<g>".repeat(2000) + &"</g>".repeat(2000);
        assert_eq!(error(&svg(r#"viewBox="0 0 297 210""#, &deep)), refused);
    }

    #[test]
    fn a_drawing_opens_no_other_file() {
        let folder = tempfile::tempdir().unwrap();
        let other = folder.path().join("other.svg");
        std::fs::write(&other, picture_text(r#"<path d="M0 0 L 9 9" stroke="red"/>"#)).unwrap();
        let image = format!(r#"<image href="{}" width="9" height="9"/>"#, other.display());
        assert!(format!("{:#}", picture(&image).unwrap_err()).contains("has no lines to draw"));
    }
}
