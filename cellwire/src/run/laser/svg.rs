//! The strokes of an SVG drawing as cuts, in the order of the file.

use anyhow::{Result, ensure};
use kurbo::{Affine, Point};

use super::route::{Instruction, Route};
use super::settings::{Coordinate, Mapping};
use crate::io::drawing::{Drawing, Tool};

/// The pixel of CSS, in mm.
const PIXEL: f64 = 25.4 / 96.0;
/// A line that begins within this distance, in mm, of the end of the previous one continues it; a shorter line is not cut.
const SAME: f64 = 1e-3;
/// A line may leave the page by this distance, in mm: the coordinates of the file and of its reader are rounded.
const ROUNDED: f64 = 0.01;

/// Reads a drawing in its true size. Its origin is the lower left corner of the page, with Y pointing up. Before each stroke that
/// does not begin at the end of the previous one, the robot moves with the laser off. The line of an instruction is the number
/// of its outline.
///
/// A part that is not cut as it is drawn is an error, or with `allow` a warning. Both continue a sentence that begins with
/// the name of the drawing.
///
/// # Errors
/// If the data is not an SVG file, has no strokes or no size in a unit of length, or has parts that a laser cannot cut.
pub(super) fn read(data: &[u8], mapping: &Mapping, allow: bool) -> Result<(Vec<Instruction>, Vec<String>)> {
    for (value, name) in [(Coordinate::F, "feed"), (Coordinate::S, "power")] {
        ensure!(
            !mapping.values.contains(&value),
            "has no {name}, which the setting program.values asks for: write the program as G-code"
        );
    }
    let drawing = Drawing::read(data, Tool::Laser)?;
    let mut warnings = Vec::new();
    let mut refuse = |why: String, warning: String| {
        ensure!(allow, "{why} with --allow drawing");
        warnings.push(warning);
        Ok(())
    };
    let left_out = &drawing.left_out;
    if !left_out.is_empty() {
        let cure = "convert them to paths with an opaque stroke, or leave them out";
        refuse(format!("has {left_out}: {cure}"), format!("is cut without {left_out}"))?;
    }
    if !drawing.is_physical {
        let cure = "give the width and the height of its <svg> in mm, or take 96 pixels as an inch";
        refuse(format!("has no size in mm: {cure}"), "is taken to have 96 pixels per inch".into())?;
    }
    let page = drawing.page * PIXEL;
    let placed = Affine::new([PIXEL, 0.0, 0.0, -PIXEL, 0.0, page.height]);
    let visible = page.to_rect().inflate(ROUNDED, ROUNDED);
    let mut route = Route::new(mapping);
    let is_cut_off = drawing
        .lines(placed, visible, mapping.tolerance, |outline, from, to| cut(&mut route, outline, from, to))?;
    if is_cut_off {
        let size = format!("{:.1} by {:.1} mm", page.width, page.height);
        let why = format!("has lines outside of its page of {size}: move them onto it, or cut them off");
        refuse(why, format!("is cut off at the edge of its page of {size}"))?;
    }
    ensure!(!route.instructions.is_empty(), "has no strokes to cut");
    Ok((route.instructions, warnings))
}

fn cut(route: &mut Route<'_>, outline: u64, from: Point, to: Point) -> Result<()> {
    let [x, y, z, a, b, c] = route.at;
    let is_here = |place: Point| place.distance(Point::new(x, y)) <= SAME;
    if !is_here(from) || route.instructions.is_empty() {
        route.line(outline, false, [from.x, from.y, z, a, b, c])?;
    }
    let [x, y, ..] = route.at;
    if to.distance(Point::new(x, y)) <= SAME {
        return Ok(());
    }
    route.line(outline, true, [to.x, to.y, z, a, b, c])
}
