//! Lines and arcs of a DXF drawing, in the order of the file.

use core::f64::consts::TAU;
use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use dxf::entities::EntityType;
use dxf::enums::Units;

use super::route::{Instruction, Route};
use super::settings::Mapping;

/// Nearer than this, in mm, the next entity goes on where the last has ended.
const SAME: f64 = 1e-6;

/// Reads LINE, ARC, CIRCLE, LWPOLYLINE and POLYLINE; before each that does not begin where the last has ended, the robot moves with
/// the laser off. An instruction's line is the number of its entity.
///
/// # Errors
/// When the file is no DXF, or has an entity of another kind: nothing of a drawing is left out.
pub(super) fn read(bytes: &[u8], mapping: &Mapping) -> Result<Vec<Instruction>> {
    let drawing = dxf::Drawing::load(&mut &*bytes).context("no DXF drawing")?;
    let scale = match drawing.header.default_drawing_units {
        Units::Inches => 25.4,
        Units::Centimeters => 10.0,
        Units::Meters => 1000.0,
        Units::Unitless | Units::Millimeters => 1.0,
        other => bail!("the drawing is in {other:?}: give millimetres, centimetres, metres or inches"),
    };
    let mut route = Route::new(mapping);
    let mut others: BTreeMap<String, u64> = BTreeMap::new();
    for (number, entity) in (1..).zip(drawing.entities()) {
        let mut pen = Pen { route: &mut route, number, scale };
        match &entity.specific {
            EntityType::Line(line) => {
                pen.go([line.p1.x, line.p1.y, line.p1.z])?;
                pen.cut([line.p2.x, line.p2.y, line.p2.z], 0.0)?;
            }
            EntityType::Arc(arc) => {
                let (centre, radius) = ([arc.center.x, arc.center.y, arc.center.z], arc.radius);
                let [begin, end] = [arc.start_angle, arc.end_angle].map(f64::to_radians);
                // Always to the left.
                pen.arc(centre, radius, begin, (end - begin).rem_euclid(TAU))?;
            }
            EntityType::Circle(circle) => {
                let centre = [circle.center.x, circle.center.y, circle.center.z];
                pen.arc(centre, circle.radius, 0.0, TAU)?;
            }
            EntityType::LwPolyline(line) => {
                let points = line.vertices.iter().map(|at| ([at.x, at.y, 0.0], at.bulge)).collect();
                pen.polyline(points, line.is_closed())?;
            }
            EntityType::Polyline(line) => {
                let point =
                    |at: &dxf::entities::Vertex| ([at.location.x, at.location.y, at.location.z], at.bulge);
                pen.polyline(line.vertices().map(point).collect(), line.is_closed())?;
            }
            other => {
                let name = format!("{other:?}");
                let name = name.split(['(', ' ', '{']).next().unwrap_or_default().to_uppercase();
                *others.entry(name).or_default() += 1;
            }
        }
    }
    if !others.is_empty() {
        let others: Vec<String> = others.iter().map(|(name, count)| format!("{count} {name}")).collect();
        bail!(
            "the drawing has unsupported entities: {}; supported: LINE, ARC, CIRCLE, LWPOLYLINE and POLYLINE",
            others.join(", ")
        );
    }
    Ok(route.instructions)
}

/// Where an entity is drawn to.
struct Pen<'a, 'm> {
    route: &'a mut Route<'m>,
    number: u64,
    scale: f64,
}

impl Pen<'_, '_> {
    fn place(&self, at: [f64; 3]) -> [f64; 6] {
        let [x, y, z] = at.map(|it| it * self.scale);
        let [_, _, _, a, b, c] = self.route.at;
        [x, y, z, a, b, c]
    }

    /// To the beginning of an entity.
    fn go(&mut self, at: [f64; 3]) -> Result<()> {
        let to = self.place(at);
        let far = self.route.at.iter().zip(to).any(|(from, to)| (from - to).abs() > SAME);
        if far || self.route.instructions.is_empty() {
            self.route.line(self.number, false, to)
        } else {
            Ok(())
        }
    }

    /// A line, or an arc whose bulge is the tangent of a quarter of its angle.
    fn cut(&mut self, at: [f64; 3], bulge: f64) -> Result<()> {
        let to = self.place(at);
        if bulge == 0.0 {
            return self.route.line(self.number, true, to);
        }
        let [x, y, ..] = self.route.at;
        let (dx, dy) = (to[0] - x, to[1] - y);
        // The centre is on the middle of the chord's perpendicular.
        let offset = (1.0 - bulge * bulge) / (4.0 * bulge);
        let centre = [x + dx / 2.0 - dy * offset, y + dy / 2.0 + dx * offset];
        self.route.arc(self.number, true, centre, 4.0 * bulge.atan(), to)
    }

    fn arc(&mut self, centre: [f64; 3], radius: f64, begin: f64, sweep: f64) -> Result<()> {
        let at = |angle: f64| [centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin(), centre[2]];
        self.go(at(begin))?;
        let to = self.place(at(begin + sweep));
        let [x, y, _] = centre.map(|it| it * self.scale);
        self.route.arc(self.number, true, [x, y], sweep, to)
    }

    fn polyline(&mut self, points: Vec<([f64; 3], f64)>, is_closed: bool) -> Result<()> {
        let Some((first, mut bulge)) = points.first().copied() else { return Ok(()) };
        self.go(first)?;
        for (at, next) in points.into_iter().skip(1) {
            self.cut(at, core::mem::replace(&mut bulge, next))?;
        }
        if is_closed { self.cut(first, bulge) } else { Ok(()) }
    }
}
