//! Clip paths, and the parts of a line that they leave visible.

use std::rc::Rc;

use kurbo::{Affine, BezPath, Line, ParamCurve as _, PathEl, Point, Rect, Shape as _};
use usvg::FillRule;

use super::curves::{affine, bez_path};

/// A clip path: an area, and the clips of the same elements.
#[derive(Debug)]
pub(super) struct Clip {
    shapes: Vec<Shape>,
    /// The clip that applies to the same elements as well.
    outer: Option<Rc<Clip>>,
}

/// A shape of a clip path.
#[derive(Debug)]
struct Shape {
    path: BezPath,
    is_even_odd: bool,
    /// The clip of the shape itself.
    clip: Option<Rc<Clip>>,
}

/// A clip path as polygons on the sheet.
pub(super) struct Region {
    areas: Vec<Area>,
    outer: Option<Box<Region>>,
    /// The distance from an edge within which a point belongs to the area: strokes along the edge are visible.
    edge: f64,
}

struct Area {
    edges: Vec<Line>,
    bounds: Rect,
    is_even_odd: bool,
    clip: Option<Region>,
}

impl Clip {
    /// Converts a clip path of elements that have the transform `placed`, and that `outer` clips too. Each shape takes one
    /// of `budget`; the clip is incomplete when nothing of it remains.
    pub(super) fn new(
        clip: &usvg::ClipPath,
        placed: Affine,
        outer: Option<Rc<Self>>,
        budget: &mut u32,
    ) -> Self {
        let inner = placed * affine(clip.transform());
        // A clip path of the clip path itself applies to every element, too.
        let outer = match clip.clip_path() {
            Some(linked) => Some(Rc::new(Self::new(linked, placed, outer, budget))),
            None => outer,
        };
        let mut shapes = Vec::new();
        add_shapes(clip.root(), inner, None, &mut shapes, budget);
        Self { shapes, outer }
    }

    /// Converts the clip path to polygons.
    pub(super) fn region(&self, placed: Affine, tolerance: f64, edge: f64) -> Region {
        let areas = self.shapes.iter().map(|shape| {
            let (mut edges, mut start, mut last) = (Vec::new(), Point::ZERO, Point::ZERO);
            let mut path = shape.path.clone();
            path.apply_affine(placed);
            kurbo::flatten(path, tolerance, |element| match element {
                PathEl::MoveTo(to) => {
                    edges.push(Line::new(last, start));
                    (start, last) = (to, to);
                }
                PathEl::LineTo(to) => edges.push(Line::new(core::mem::replace(&mut last, to), to)),
                _ => edges.push(Line::new(core::mem::replace(&mut last, start), start)),
            });
            edges.push(Line::new(last, start));
            edges.retain(|edge| edge.p0 != edge.p1);
            let first = edges.first().map(|edge| Rect::from_points(edge.p0, edge.p1)).unwrap_or_default();
            let bounds = edges.iter().fold(first, |bounds, edge| bounds.union(edge.bounding_box()));
            let clip = shape.clip.as_ref().map(|clip| clip.region(placed, tolerance, edge));
            Area { edges, bounds: bounds.inflate(edge, edge), is_even_odd: shape.is_even_odd, clip }
        });
        let outer = self.outer.as_ref().map(|outer| Box::new(outer.region(placed, tolerance, edge)));
        Region { areas: areas.collect(), outer, edge }
    }
}

impl Region {
    /// Passes the visible parts of a line to `part`, in their sequence. Returns the number of parts that were compared with
    /// every edge.
    pub(super) fn visible(&self, line: Line, mut part: impl FnMut(Point, Point)) -> usize {
        let mut crossings = vec![0.0, 1.0];
        self.crossings(line, &mut crossings);
        crossings.sort_by(f64::total_cmp);
        let mut begin = None;
        for (from, to) in crossings.iter().zip(crossings.iter().skip(1)) {
            if to <= from {
                continue;
            }
            let is_visible = self.contains(line.eval((from + to) / 2.0));
            match begin {
                None if is_visible => begin = Some(*from),
                Some(begun) if !is_visible => {
                    part(line.eval(begun), line.eval(*from));
                    begin = None;
                }
                _ => {}
            }
        }
        if let Some(begin) = begin {
            part(line.eval(begin), line.p1);
        }
        crossings.len()
    }

    /// Returns the number of edges.
    pub(super) fn edges(&self) -> usize {
        let areas = self.areas.iter().map(|it| it.edges.len() + it.clip.as_ref().map_or(0, Self::edges));
        areas.sum::<usize>() + self.outer.as_ref().map_or(0, |outer| outer.edges())
    }

    fn crossings(&self, line: Line, found: &mut Vec<f64>) {
        let box_of_line = line.bounding_box();
        for area in &self.areas {
            if area.bounds.intersect(box_of_line.inflate(self.edge, self.edge)).is_zero_area() {
                continue;
            }
            for edge in &area.edges {
                let (way, along) = (line.p1 - line.p0, edge.p1 - edge.p0);
                let (across, between) = (way.cross(along), edge.p0 - line.p0);
                let (at, on) = (between.cross(along) / across, between.cross(way) / across);
                if (0.0..=1.0).contains(&at) && (0.0..=1.0).contains(&on) {
                    found.push(at);
                }
                // Along an edge, a line is visible up to the ends of the edge.
                for end in [edge.p0, edge.p1] {
                    let at = (end - line.p0).dot(way) / way.hypot2();
                    if (0.0..=1.0).contains(&at) && line.eval(at).distance(end) <= self.edge {
                        found.push(at);
                    }
                }
            }
            if let Some(clip) = &area.clip {
                clip.crossings(line, found);
            }
        }
        if let Some(outer) = &self.outer {
            outer.crossings(line, found);
        }
    }

    fn contains(&self, point: Point) -> bool {
        let is_in = |area: &Area| {
            area.bounds.contains(point)
                && (area.winds(point) || area.touches(point, self.edge))
                && area.clip.as_ref().is_none_or(|clip| clip.contains(point))
        };
        self.areas.iter().any(is_in) && self.outer.as_ref().is_none_or(|outer| outer.contains(point))
    }
}

impl Area {
    fn winds(&self, point: Point) -> bool {
        let mut winding = 0_i32;
        for Line { p0, p1 } in &self.edges {
            let is_up = p0.y <= point.y && p1.y > point.y;
            if is_up || (p1.y <= point.y && p0.y > point.y) {
                let side = (*p1 - *p0).cross(point - *p0);
                winding += i32::from(is_up && side > 0.0) - i32::from(!is_up && side < 0.0);
            }
        }
        if self.is_even_odd { winding % 2 != 0 } else { winding != 0 }
    }

    fn touches(&self, point: Point, distance: f64) -> bool {
        self.edges.iter().any(|edge| {
            let along = edge.p1 - edge.p0;
            let at = ((point - edge.p0).dot(along) / along.hypot2()).clamp(0.0, 1.0);
            edge.eval(at).distance(point) <= distance
        })
    }
}

fn add_shapes(
    group: &usvg::Group,
    placed: Affine,
    clip: Option<&Rc<Clip>>,
    shapes: &mut Vec<Shape>,
    budget: &mut u32,
) {
    let clip = match group.clip_path() {
        Some(own) => Some(Rc::new(Clip::new(own, placed, clip.cloned(), budget))),
        None => clip.cloned(),
    };
    for node in group.children() {
        *budget = budget.saturating_sub(1);
        match node {
            _ if *budget == 0 => return,
            usvg::Node::Group(inner) => {
                add_shapes(inner, placed * affine(inner.transform()), clip.as_ref(), shapes, budget);
            }
            usvg::Node::Path(path) if path.is_visible() => {
                let is_even_odd = path.fill().is_some_and(|fill| fill.rule() == FillRule::EvenOdd);
                shapes.push(Shape { path: placed * bez_path(path), is_even_odd, clip: clip.clone() });
            }
            _ => {}
        }
    }
}
