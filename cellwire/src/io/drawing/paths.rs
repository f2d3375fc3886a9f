//! The outlines of a drawing as a pen follows them, and what of a drawing it cannot.

use std::collections::{BTreeMap, HashSet};

use anyhow::{Result, ensure};
use kurbo::{Affine, BezPath, PathEl, Point, Shape as _};
use usvg::roxmltree::{Document, Node};
use usvg::tiny_skia_path::PathSegment;

use super::reader::Tool;
use super::{MAX_LINES, arcs};

/// Outlines in pixels of the page, and what else the drawing shows.
pub(super) struct Outlines {
    pub(super) path: BezPath,
    tool: Tool,
    others: BTreeMap<&'static str, usize>,
}

impl Outlines {
    /// Those of a drawing, dashes as lines of their own. Invisible elements have none.
    ///
    /// # Errors
    /// When its dashes are more than any machine draws.
    pub(super) fn of(document: &Document<'_>, tree: &usvg::Tree, tool: Tool) -> Result<Self> {
        let mut outlines = Self { path: BezPath::new(), tool, others: BTreeMap::new() };
        outlines.texts(document);
        outlines.group(tree.root())?;
        Ok(outlines)
    }

    /// What else the drawing shows, in words.
    pub(super) fn left_out(&self) -> String {
        let named = self.others.iter().map(|(what, count)| match count {
            1 => format!("1 {what}"),
            count => format!("{count} {what}s"),
        });
        named.collect::<Vec<_>>().join(", ")
    }

    fn add(&mut self, what: &'static str) {
        *self.others.entry(what).or_default() += 1;
    }

    /// What is in the file and not in its tree.
    fn texts(&mut self, document: &Document<'_>) {
        let href = |node: Node<'_, '_>| {
            let target = node.attributes().find(|attribute| attribute.name() == "href")?;
            target.value().strip_prefix('#').map(ToOwned::to_owned)
        };
        let used: HashSet<String> =
            document.descendants().filter(|node| node.tag_name().name() == "use").filter_map(href).collect();
        for node in document.descendants() {
            let what = match node.tag_name().name() {
                "text"
                    if node
                        .descendants()
                        .any(|node| node.is_text() && !node.text().unwrap_or("").trim().is_empty()) =>
                {
                    "text"
                }
                "image" => "image",
                "foreignObject" => "foreign object",
                _ => continue,
            };
            let is_hidden = |node: Node<'_, '_>| {
                let style = node.attribute("style").unwrap_or("").replace(' ', "");
                let is = |name: &str, value: &str| {
                    node.attribute(name) == Some(value) || style.contains(&format!("{name}:{value}"))
                };
                is("display", "none") || is("visibility", "hidden") || is("opacity", "0")
            };
            let stores = ["defs", "symbol", "clipPath", "mask", "pattern", "marker"];
            let is_stored = node.ancestors().any(|node| stores.contains(&node.tag_name().name()));
            let is_used =
                node.ancestors().any(|node| node.attribute("id").is_some_and(|id| used.contains(id)));
            if !node.ancestors().any(is_hidden) && (!is_stored || is_used) {
                self.add(what);
            }
        }
    }

    fn group(&mut self, group: &usvg::Group) -> Result<()> {
        if group.opacity().get() == 0.0 {
            return Ok(());
        }
        if self.tool == Tool::Laser && group.opacity().get() < 1.0 {
            self.add("translucent group");
            return Ok(());
        }
        // The clip of a drawing to its own view box is that of the sheet.
        for (is, what) in [
            (group.clip_path().is_some(), "clip"),
            (group.mask().is_some(), "mask"),
            (!group.filters().is_empty(), "filter"),
        ] {
            if is {
                self.add(what);
            }
        }
        for node in group.children() {
            match node {
                usvg::Node::Group(inner) => self.group(inner)?,
                usvg::Node::Path(path) if path.is_visible() => self.path(path)?,
                usvg::Node::Path(_) | usvg::Node::Image(_) | usvg::Node::Text(_) => {}
            }
        }
        Ok(())
    }

    fn path(&mut self, path: &usvg::Path) -> Result<()> {
        let stroke = path.stroke().filter(|stroke| stroke.opacity().get() > 0.0);
        let fill = path.fill().filter(|fill| fill.opacity().get() > 0.0);
        let outline = arcs::refine(path.data().segments().map(element));
        match (self.tool, stroke) {
            // A fill without an area shows nothing.
            (_, None) if fill.is_none() || !has_area(&outline) => return Ok(()),
            (Tool::Laser, None) => {
                self.add("unstroked shape");
                return Ok(());
            }
            (Tool::Laser, Some(stroke)) if stroke.opacity().get() < 1.0 => {
                self.add("translucent stroke");
                return Ok(());
            }
            _ => {}
        }
        let dashes = stroke.and_then(|stroke| Some((stroke.dasharray()?, stroke.dashoffset())));
        let outline = match dashes {
            None => outline,
            Some((dashes, offset)) => {
                let dashes: Vec<f64> = dashes.iter().map(|dash| f64::from(*dash)).collect();
                let (way, period) = (outline.perimeter(1.0), dashes.iter().sum::<f64>());
                #[expect(clippy::cast_precision_loss, reason = "a limit")]
                let most = MAX_LINES as f64;
                ensure!(way <= period * most, "has more than {MAX_LINES} dashes");
                if dashes.iter().step_by(2).any(|dash| *dash == 0.0) {
                    self.add("line of dots");
                }
                kurbo::dash(outline.elements().iter().copied(), offset.into(), &dashes).collect()
            }
        };
        let usvg::Transform { sx, kx, ky, sy, tx, ty } = path.abs_transform();
        let placed = Affine::new([sx, ky, kx, sy, tx, ty].map(f64::from)) * outline;
        self.path.extend(placed);
        Ok(())
    }
}

/// Whether a part of it has three places.
fn has_area(path: &BezPath) -> bool {
    path.elements().split(|element| matches!(element, PathEl::MoveTo(_))).any(|part| {
        let curves = part.iter().any(|element| matches!(element, PathEl::QuadTo(..) | PathEl::CurveTo(..)));
        let lines = part.iter().filter(|element| matches!(element, PathEl::LineTo(_))).count();
        curves || lines > 1
    })
}

fn element(segment: PathSegment) -> PathEl {
    let point = |p: usvg::tiny_skia_path::Point| Point::new(f64::from(p.x), f64::from(p.y));
    match segment {
        PathSegment::MoveTo(p) => PathEl::MoveTo(point(p)),
        PathSegment::LineTo(p) => PathEl::LineTo(point(p)),
        PathSegment::QuadTo(a, p) => PathEl::QuadTo(point(a), point(p)),
        PathSegment::CubicTo(a, b, p) => PathEl::CurveTo(point(a), point(b), point(p)),
        PathSegment::Close => PathEl::ClosePath,
    }
}
