//! Pictures for machines that draw lines: an SVG file to lines, and lines to an SVG file.

mod arcs;
mod check;
mod clips;
mod curves;
mod findings;
mod paths;
mod reader;
mod warnings;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::{Context, Result, anyhow, ensure};
use kurbo::{Affine, Point as CurvePoint, Size};

use cellwire_io::files;
use cellwire_io::output::remark;
pub use paths::Tool;
pub use reader::{Drawing, refuse_dxf};

/// The built-in picture: a robot that draws a rosette, some 6000 lines.
const BUILT_IN: &str = include_str!("../../../assets/robot.svg");

/// The largest distance of a line from the curve that it approximates, in millimetres on the sheet.
const TOLERANCE: f64 = 0.05;

/// The lines of a drawing.
const MAX_LINES: usize = 1_000_000;

/// No curve goes further than this many sheets.
const MAX_SHEETS: f64 = 100.0;

/// A point on the sheet in hundredths of a millimetre: x to the right, y down, from the upper left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Point {
    /// The distance from the left edge, in hundredths of a millimetre.
    pub x: i32,
    /// The distance from the upper edge, in hundredths of a millimetre.
    pub y: i32,
}

/// One straight line, with the pen on the sheet or lifted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Line {
    /// Whether the line is drawn; otherwise the pen only moves there.
    pub draws: bool,
    /// The beginning of the line.
    pub from: Point,
    /// The end of the line; never equal to `from`.
    pub to: Point,
}

/// The lines of a picture; each begins where the previous one ends.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// The lines in the order of drawing.
    pub lines: Vec<Line>,
    /// The outline of each line, from 1 in the order of the file; of a move, the outline that it leads to.
    pub outlines: Vec<u64>,
    /// The sheet's width and height in hundredths of a millimetre.
    pub sheet: Point,
}

impl Line {
    /// Returns the length in mm.
    pub fn length(&self) -> f64 {
        let way = |from: i32, to: i32| f64::from(to) - f64::from(from);
        way(self.from.x, self.to.x).hypot(way(self.from.y, self.to.y)) / 100.0
    }
}

impl Picture {
    /// Returns the built-in picture on a sheet of this size.
    ///
    /// # Errors
    /// Never for a sheet that has an area.
    pub fn built_in(sheet: Point) -> Result<Self> {
        Self::from_svg(BUILT_IN.as_bytes(), sheet, false).map(|(picture, _)| picture)
    }

    /// Reads the picture of an SVG file, as large as the sheet allows. Outlines are drawn, fills are not. Parts that a pen cannot
    /// draw, such as text and masks, are named: they are left out if that is allowed.
    ///
    /// # Errors
    /// If the file cannot be read, is not an SVG file, has no lines, has parts that may not be left out, or is larger than any
    /// machine draws.
    pub fn from_file(path: &Path, sheet: Point, allow: bool) -> Result<Self> {
        let mut data = Vec::new();
        File::open(path)
            .and_then(|file| file.take(reader::MAX_BYTES + 1).read_to_end(&mut data))
            .with_context(|| format!("cannot read the drawing {}", path.display()))?;
        refuse_dxf(path, &data)?;
        let read = Self::from_svg(&data, sheet, allow);
        let (picture, warnings) =
            read.map_err(|error| anyhow!("the drawing {} {error:#}", path.display()))?;
        for warning in warnings {
            remark(&format!("warning: the drawing {} {warning}", path.display()));
        }
        Ok(picture)
    }

    /// Returns the picture, and warnings of the parts that are not drawn as the file shows them. A warning continues a
    /// sentence that begins with the name of the drawing.
    fn from_svg(data: &[u8], sheet: Point, allow: bool) -> Result<(Self, Vec<String>)> {
        let drawing = Drawing::read(data, Tool::Pen)?;
        let left_out = &drawing.left_out;
        ensure!(
            allow || left_out.is_empty(),
            "has {left_out}: convert them to paths and lines, or skip them with `run kawasaki --allow drawing`"
        );
        let size = Size::new(sheet.x.into(), sheet.y.into());
        let page = drawing.page;
        let scale = (size.width / page.width).min(size.height / page.height);
        let margin = (size - page * scale) / 2.0;
        let placed = Affine::scale(scale).then_translate(margin.to_vec2());
        // A picture may extend beyond its view box, outside of which nothing is visible.
        let visible = size.to_rect().inflate(0.5, 0.5);
        let mut pen = Pen { at: Point { x: 0, y: 0 }, lines: Vec::new(), outlines: Vec::new() };
        let on_sheet =
            |p: CurvePoint| Point { x: whole(p.x).clamp(0, sheet.x), y: whole(p.y).clamp(0, sheet.y) };
        let is_cut_off = drawing.lines(placed, visible, TOLERANCE * 100.0, |outline, from, to| {
            pen.go(on_sheet(from), false, outline);
            pen.go(on_sheet(to), true, outline);
            ensure!(pen.lines.len() <= MAX_LINES, "has more than {MAX_LINES} lines");
            Ok(())
        })?;
        pen.trim();
        ensure!(!pen.lines.is_empty(), "has no outlines to draw: convert text to paths first");
        let mut warnings = Vec::new();
        if !left_out.is_empty() {
            warnings.push(format!("is drawn without {left_out}"));
        }
        if is_cut_off {
            warnings.push("is cut off at the edge of its page".to_owned());
        }
        Ok((Self { lines: pen.lines, outlines: pen.outlines, sheet }, warnings))
    }

    /// Returns the number of lines that are drawn.
    pub fn strokes(&self) -> usize {
        self.lines.iter().filter(|line| line.draws).count()
    }
}

/// Writes the drawn lines as an SVG file of the sheet's size.
///
/// # Errors
/// If the file cannot be written.
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

/// Hundredths of a millimetre in millimetres.
pub fn mm(hundredths: i32) -> f64 {
    f64::from(hundredths) / 100.0
}

struct Pen {
    at: Point,
    lines: Vec<Line>,
    outlines: Vec<u64>,
}

impl Pen {
    fn go(&mut self, to: Point, draws: bool, outline: u64) {
        if to == self.at {
            return;
        }
        let from = self.at;
        self.at = to;
        match self.lines.last_mut() {
            // Two consecutive moves become one.
            Some(last) if !last.draws && !draws => {
                last.to = to;
                self.outlines.pop();
            }
            _ => self.lines.push(Line { draws, from, to }),
        }
        self.outlines.push(outline);
        // A move that ends where it began is dropped.
        if self.lines.last().is_some_and(|last| last.from == last.to) {
            self.lines.pop();
        }
        self.outlines.truncate(self.lines.len());
    }

    /// Drops a move after the last drawn line.
    fn trim(&mut self) {
        while self.lines.last().is_some_and(|last| !last.draws) {
            self.lines.pop();
        }
        self.outlines.truncate(self.lines.len());
    }
}

#[expect(clippy::cast_possible_truncation, reason = "clamped to the sheet right after; `as` saturates")]
fn whole(x: f64) -> i32 {
    x.round() as i32
}

#[cfg(test)]
mod tests;
