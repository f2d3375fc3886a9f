//! Reads the outlines of an SVG file.

use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

use anyhow::{Context, Result, anyhow, bail, ensure};
use kurbo::{Affine, CubicBez, Line, PathEl, Point, Rect, Size};
use usvg::roxmltree::{Document, Node, ParsingOptions};

use super::check::Check;
use super::clips::{Clip, Region};
use super::findings::{Findings, with_ids};
use super::paths::{Outline, Outlines, Tool};
use super::{arcs, warnings};

/// The bytes of the largest file that is read.
pub(super) const MAX_BYTES: u64 = 32 << 20;
/// The elements of a drawing, with those that `use` repeats.
const MAX_ELEMENTS: u64 = 1_000_000;
/// The maximum depth of nested elements.
const MAX_DEPTH: u32 = 256;
/// The sides of a view box, in its own units.
const VIEW_BOX: core::ops::RangeInclusive<f64> = 0.01..=1e6;

/// The distance from the edge of a clip within which lines are visible, as a share of the sheet.
const EDGE: f64 = 1e-5;
/// The comparisons of lines with edges of clips, for each outline.
const MAX_COMPARISONS: usize = 20_000_000;

/// The outlines of an SVG file in pixels of CSS, from the upper left corner of its page, with Y pointing down.
#[derive(Debug)]
pub struct Drawing {
    /// The size of the page, in pixels of CSS.
    pub page: Size,
    /// Whether the file gives both sides of its page in a unit of length: mm, cm, in, pt or pc.
    pub is_physical: bool,
    /// The parts that the tool does not follow as a viewer shows them, as text with their lines in the file; empty if it
    /// follows all.
    pub left_out: String,
    outlines: Vec<Outline>,
}

impl Drawing {
    /// Reads an SVG file.
    ///
    /// # Errors
    /// If the data is not an SVG file, or describes more than any machine draws. The text continues a sentence that begins
    /// with the name of the drawing.
    pub fn read(data: &[u8], tool: Tool) -> Result<Self> {
        ensure!(data.len() as u64 <= MAX_BYTES, "is larger than {} MiB", MAX_BYTES >> 20);
        let text = text(data)?;
        let original = parse(&text)?;
        let elements = Elements::new(&original).count(original.root_element(), 0);
        ensure!(
            elements <= MAX_ELEMENTS,
            "has more than {MAX_ELEMENTS} elements, including those repeated by `use`, or is nested deeper than {MAX_DEPTH}"
        );
        let text = with_ids(&original);
        let document = parse(&text)?;
        let mut findings = Findings::new(&document);
        let scales_dashes = Check::run(&document, &mut findings)?;
        let (tree, warnings) = warnings::collect(|| usvg::Tree::from_xmltree(&document, &options()))?;
        for warning in &warnings {
            findings.add_warning(warning);
        }
        let tree = tree.map_err(|error| match error {
            usvg::Error::InvalidSize => {
                anyhow!("has a page without an area: check the width, the height and the view box")
            }
            error => anyhow!(error).context("is not an SVG file"),
        })?;
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
        let outlines = Outlines::of(&tree, tool, scales_dashes, &mut findings)?;
        Ok(Self { page, is_physical, left_out: findings.text(), outlines })
    }

    /// Passes each line of the outlines to `line`, with the number of its outline, from 1. Lines are placed on the sheet, are
    /// within `tolerance` of their curve, and end at the edge of `visible`. Returns whether any of them goes beyond that edge.
    ///
    /// # Errors
    /// If a clip has too many edges; the errors of `line`.
    pub fn lines(
        &self,
        placed: Affine,
        visible: Rect,
        tolerance: f64,
        mut line: impl FnMut(u64, Point, Point) -> Result<()>,
    ) -> Result<bool> {
        let (mut number, mut is_cut_off) = (0, false);
        // A stroke along the edge of a clip is visible.
        let edge = visible.width().max(visible.height()) * EDGE;
        // The outlines of a group share its clip.
        let mut clipped: Option<(&Rc<Clip>, Region)> = None;
        for Outline { path, clip } in &self.outlines {
            clipped = match (clip, clipped) {
                (None, _) => None,
                (Some(clip), Some((last, region))) if Rc::ptr_eq(clip, last) => Some((last, region)),
                (Some(clip), _) => Some((clip, clip.region(placed, tolerance / 10.0, edge))),
            };
            let region = clipped.as_ref().map(|(_, region)| region);
            let mut path = path.clone();
            path.apply_affine(placed);
            let (mut start, mut last, mut comparisons) = (Point::ZERO, Point::ZERO, 0);
            for element in path.elements() {
                let curve = match *element {
                    PathEl::MoveTo(to) => {
                        (number, start, last) = (number + 1, to, to);
                        continue;
                    }
                    PathEl::ClosePath => PathEl::LineTo(start),
                    curve => curve,
                };
                let (from, mut outcome) = (last, Ok(()));
                let mut step = |to: Point| {
                    let from = core::mem::replace(&mut last, to);
                    if outcome.is_err() {
                        return;
                    }
                    let mut show = |from, to| {
                        let shown = within(from, to, visible);
                        is_cut_off |= shown != Some((from, to));
                        if let (Some((from, to)), Ok(())) = (shown, &outcome) {
                            outcome = line(number, from, to);
                        }
                    };
                    match region {
                        None => show(from, to),
                        Some(_) if comparisons > MAX_COMPARISONS => {
                            outcome = Err(anyhow!(
                                "has a clip with too many edges: apply it in the drawing program"
                            ));
                        }
                        Some(region) => {
                            let parts = region.visible(Line::new(from, to), show);
                            comparisons += parts * region.edges();
                        }
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
        }
        Ok(is_cut_off)
    }
}

/// Returns the text of an SVG file, in UTF-8 or UTF-16.
fn text(data: &[u8]) -> Result<String> {
    ensure!(
        !data.starts_with(&[0x1F, 0x8B]),
        "is compressed (SVGZ): unpack it with `gzip -dc FILE.svgz > FILE.svg`"
    );
    ensure!(
        !matches!(data, [b'<', 0, ..] | [0, b'<', ..]),
        "is UTF-16 without a byte order mark: save it as UTF-8"
    );
    let units = |unit: fn([u8; 2]) -> u16| {
        data.chunks_exact(2)
            .skip(1)
            .map(move |it| unit([it.first().copied().unwrap_or(0), it.last().copied().unwrap_or(0)]))
    };
    let wide: Option<Vec<u16>> = match data {
        [0xFF, 0xFE, ..] => Some(units(u16::from_le_bytes).collect()),
        [0xFE, 0xFF, ..] => Some(units(u16::from_be_bytes).collect()),
        _ => None,
    };
    match wide {
        Some(units) => String::from_utf16(&units).context("is not an SVG file: its text is not UTF-16"),
        None => {
            core::str::from_utf8(data).map(str::to_owned).context("is not an SVG file: its text is not UTF-8")
        }
    }
}

fn parse(text: &str) -> Result<Document<'_>> {
    let options = ParsingOptions { allow_dtd: true, ..Default::default() };
    Document::parse_with_options(text, options).context("is not an SVG file")
}

/// Refuses a DXF drawing, which is recognised by its name or its first bytes.
///
/// # Errors
/// If the file is one: how to convert it.
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

/// Reads the drawing itself and no other file: references are left out.
fn options() -> usvg::Options<'static> {
    let mut options = usvg::Options::default();
    options.image_href_resolver.resolve_string = Box::new(|_, _| None);
    options
}

/// Counts the elements when every `use` is followed.
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

/// Returns the part of a line that is visible.
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
