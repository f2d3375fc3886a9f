//! The outlines of a drawing as a tool follows them, and the parts of a drawing that it cannot follow.

use std::rc::Rc;

use anyhow::{Result, ensure};
use kurbo::{Affine, BezPath, PathEl, Point, Rect, Shape as _, Size};

use super::clips::Clip;
use super::curves::{affine, bez_path};
use super::findings::Findings;
use super::{MAX_LINES, MAX_SHEETS, arcs};

/// The size, in pixels of CSS, below which an outline is a dot.
const DOT: f64 = 0.004;

/// The shapes of all clips.
const MAX_CLIP_SHAPES: u32 = 100_000;

/// The machine that follows the outlines of a drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tool {
    /// Follows the outline of every visible shape, with or without a stroke.
    Pen,
    /// Cuts along opaque strokes. Shapes without a stroke and translucent shapes are listed as unsupported.
    Laser,
}

/// An outline in pixels of the page, and its clip.
#[derive(Debug)]
pub(super) struct Outline {
    pub(super) path: BezPath,
    pub(super) clip: Option<Rc<Clip>>,
}

/// The outlines of a drawing.
pub(super) struct Outlines<'f, 'a> {
    pub(super) all: Vec<Outline>,
    findings: &'f mut Findings<'a>,
    tool: Tool,
    page: Size,
    /// Whether the dashes of the drawing may differ from those in the tree.
    scales_dashes: bool,
    /// The number of shapes that further clips may have.
    clip_shapes: u32,
}

/// The group that is visited: its identifier or that of an outer group, transform and clip.
#[derive(Clone)]
struct GroupContext<'t> {
    id: &'t str,
    placed: Affine,
    clip: Option<Rc<Clip>>,
}

impl<'f, 'a> Outlines<'f, 'a> {
    /// Reads the outlines of a drawing, dashes as separate lines. Invisible elements have no outlines.
    ///
    /// # Errors
    /// If its dashes are more than any machine draws, or it has lines far beyond the page.
    pub(super) fn of(
        tree: &usvg::Tree,
        tool: Tool,
        scales_dashes: bool,
        findings: &'f mut Findings<'a>,
    ) -> Result<Vec<Outline>> {
        let page = Size::new(tree.size().width().into(), tree.size().height().into());
        let mut outlines =
            Self { all: Vec::new(), findings, tool, page, scales_dashes, clip_shapes: MAX_CLIP_SHAPES };
        outlines.group(tree.root(), &GroupContext { id: "", placed: Affine::IDENTITY, clip: None })?;
        Ok(outlines.all)
    }

    fn group(&mut self, group: &usvg::Group, outer: &GroupContext<'_>) -> Result<()> {
        if group.opacity().get() == 0.0 {
            return Ok(());
        }
        let id = if group.id().is_empty() { outer.id } else { group.id() };
        if self.tool == Tool::Laser && group.opacity().get() < 1.0 {
            self.findings.add_at("translucent group", self.nearest(group, id));
            return Ok(());
        }
        if group.mask().is_some() {
            self.findings.add_at("mask", self.nearest(group, id));
        }
        if !group.filters().is_empty() {
            self.findings.add_at("filter", self.nearest(group, id));
        }
        let placed = outer.placed * affine(group.transform());
        let clip = match group.clip_path() {
            Some(clip) => Some(Rc::new(Clip::new(clip, placed, outer.clip.clone(), &mut self.clip_shapes))),
            None => outer.clip.clone(),
        };
        ensure!(self.clip_shapes > 0, "has clips of more than {MAX_CLIP_SHAPES} shapes");
        let place = GroupContext { id, placed, clip };
        for node in group.children() {
            match node {
                usvg::Node::Group(inner) => self.group(inner, &place)?,
                usvg::Node::Path(path) if path.is_visible() => self.path(path, &place)?,
                usvg::Node::Path(_) | usvg::Node::Image(_) | usvg::Node::Text(_) => {}
            }
        }
        Ok(())
    }

    /// Returns the identifier of the first element in a group, of which the reader may have made the group.
    fn nearest<'t>(&self, group: &'t usvg::Group, id: &'t str) -> &'t str {
        match group.children() {
            [usvg::Node::Path(path)] if group.id().is_empty() && !path.id().is_empty() => path.id(),
            _ => id,
        }
    }

    fn path(&mut self, path: &usvg::Path, place: &GroupContext<'_>) -> Result<()> {
        let stroke = path.stroke().filter(|stroke| stroke.opacity().get() > 0.0);
        let fill = path.fill().filter(|fill| fill.opacity().get() > 0.0);
        let id = if path.id().is_empty() { place.id } else { path.id() };
        let whole = bez_path(path);
        // The reader makes a shape of the property `background-color`, which no viewer draws as one.
        let is_background = id.is_empty() && stroke.is_none();
        if is_background || (stroke.is_none() && (fill.is_none() || !has_area(&whole))) {
            return Ok(());
        }
        let furthest = MAX_SHEETS * self.page.width.max(self.page.height);
        let is_near = |p: Point| p.x.abs() <= furthest && p.y.abs() <= furthest;
        ensure!(
            (place.placed * &whole).elements().iter().flat_map(points).all(is_near),
            "has lines beyond {MAX_SHEETS} sheets: check the view box"
        );
        let outline = arcs::refine(whole.into_iter());
        match (self.tool, stroke) {
            (Tool::Laser, None) => {
                self.findings.add_at("unstroked shape", id);
                return Ok(());
            }
            (Tool::Laser, Some(stroke)) if is_translucent(stroke) => {
                self.findings.add_at("translucent stroke", id);
                return Ok(());
            }
            _ => {}
        }
        if stroke.is_none_or(|stroke| stroke.linecap() != usvg::LineCap::Butt)
            && self.has_dot(&(place.placed * &outline))
        {
            self.findings.add_at("dot", id);
        }
        let dashes = stroke.and_then(|stroke| Some((stroke.dasharray()?, stroke.dashoffset())));
        let outline = match dashes {
            None => outline,
            Some((dashes, offset)) => {
                if self.scales_dashes {
                    self.findings.add_at("dashes with `pathLength` or `vector-effect`", id);
                }
                let dashes: Vec<f64> = dashes.iter().map(|dash| f64::from(*dash)).collect();
                let (way, period) = (outline.perimeter(1.0), dashes.iter().sum::<f64>());
                #[expect(clippy::cast_precision_loss, reason = "a limit")]
                let most = MAX_LINES as f64;
                ensure!(way <= period * most, "has more than {MAX_LINES} dashes");
                if dashes.iter().step_by(2).any(|dash| *dash == 0.0) {
                    self.findings.add_at("line of dots", id);
                }
                let offset = f64::from(offset).rem_euclid(period);
                kurbo::dash(outline.elements().iter().copied(), offset, &dashes).collect()
            }
        };
        let outline = place.placed * outline;
        if stroke.is_none() && place.clip.is_some() {
            self.findings.add_at("clipped fill", id);
        }
        self.all.push(Outline { path: outline, clip: place.clip.clone() });
        Ok(())
    }

    /// Returns whether a part of an outline is too small to be a line.
    fn has_dot(&self, outline: &BezPath) -> bool {
        let page = Rect::from_origin_size(Point::ZERO, self.page);
        let least = DOT.max(2e-5 * self.page.width.max(self.page.height));
        let mut parts = outline.elements().split(|element| matches!(element, PathEl::MoveTo(_)));
        let mut starts = outline.elements().iter().filter(|element| matches!(element, PathEl::MoveTo(_)));
        // Elements before the first start do not exist.
        parts.next();
        parts.zip(&mut starts).any(|(part, start)| {
            let Some(start) = start.end_point() else { return false };
            !part.is_empty()
                && page.contains(start)
                && part.iter().flat_map(points).all(|point| point.distance(start) < least)
        })
    }
}

/// Returns whether a stroke is not opaque everywhere.
fn is_translucent(stroke: &usvg::Stroke) -> bool {
    let stops = match stroke.paint() {
        usvg::Paint::Color(_) => &[],
        usvg::Paint::LinearGradient(gradient) => gradient.stops(),
        usvg::Paint::RadialGradient(gradient) => gradient.stops(),
        usvg::Paint::Pattern(_) => return true,
    };
    stroke.opacity().get() < 1.0 || stops.iter().any(|stop| stop.opacity().get() < 1.0)
}

/// Returns whether a part of the path has three points.
fn has_area(path: &BezPath) -> bool {
    path.elements().split(|element| matches!(element, PathEl::MoveTo(_))).any(|part| {
        let curves = part.iter().any(|element| matches!(element, PathEl::QuadTo(..) | PathEl::CurveTo(..)));
        let lines = part.iter().filter(|element| matches!(element, PathEl::LineTo(_))).count();
        curves || lines > 1
    })
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
