//! Circular arcs that were converted to cubic curves.

use kurbo::{Arc, BezPath, CubicBez, PathEl, Point, Vec2};

/// The largest distance of the curves of a refined arc from the arc, as a share of its radius.
const ACCURACY: f64 = 1e-5;

/// Makes the arcs of a path accurate. The reader of SVG files converts circles and arcs to cubic curves, which may be 0.03 % of
/// the radius beside them: each such curve is replaced by shorter ones.
pub(super) fn refine(path: impl Iterator<Item = PathEl>) -> BezPath {
    let (mut refined, mut last) = (BezPath::new(), Point::ZERO);
    for element in path {
        match element {
            PathEl::CurveTo(a, b, to) => {
                let curve = CubicBez::new(last, a, b, to);
                // The reader's coordinates are in single precision.
                let largest =
                    [last, a, b, to].iter().flat_map(|p| [p.x.abs(), p.y.abs()]).fold(0.0, f64::max);
                match arc(curve, 16.0 * f64::from(f32::EPSILON) * largest) {
                    Some(arc) => refined.extend(arc.append_iter(ACCURACY * arc.radii.x)),
                    None => refined.push(element),
                }
            }
            other => refined.push(other),
        }
        last = element.end_point().unwrap_or(last);
    }
    refined
}

/// Returns the chords of a curve that is a circular arc, as their end points: each within `tolerance` of the arc.
pub(super) fn chords(curve: CubicBez, tolerance: f64) -> Option<impl Iterator<Item = Point>> {
    let arc = arc(curve, 1e-5 * (curve.p3 - curve.p0).hypot())?;
    let (radius, sweep) = (arc.radii.x, arc.sweep_angle);
    // The height of a chord's segment is r (1 - cos(angle / 2)).
    let widest = 2.0 * (1.0 - (tolerance / radius).min(1.0)).acos();
    let chords = (sweep.abs() / widest.max(1e-4)).ceil().max(1.0);
    let mut chord = 0.0;
    Some(core::iter::from_fn(move || {
        chord += 1.0;
        let angle = arc.start_angle + sweep * chord / chords;
        match chord {
            _ if chord < chords => Some(arc.center + Vec2::from_angle(angle) * radius),
            _ => (chord == chords).then_some(curve.p3),
        }
    }))
}

/// Returns the circular arc of which a cubic curve is the usual approximation: it has the same ends and tangents, and its
/// control points are 4/3 tan(angle / 4) of the radius away from its ends, except for an `error`.
fn arc(CubicBez { p0: from, p1: a, p2: b, p3: to }: CubicBez, error: f64) -> Option<Arc> {
    let (begin, chord) = (a - from, to - from);
    let half = begin.cross(chord).atan2(begin.dot(chord));
    // The curve of a shorter arc is accurate; there are no longer ones.
    if !(0.1..0.8).contains(&half.abs()) {
        return None;
    }
    let radius = chord.hypot() / (2.0 * half.sin().abs());
    let (begin, end) = (begin.normalize(), Vec2::from_angle(begin.angle() + 2.0 * half));
    let arm = 4.0 / 3.0 * (half.abs() / 2.0).tan() * radius;
    if (a - (from + begin * arm)).hypot() > error || (b - (to - end * arm)).hypot() > error {
        return None;
    }
    let centre = from + Vec2::new(-begin.y, begin.x) * radius * half.signum();
    Some(Arc {
        center: centre,
        radii: Vec2::new(radius, radius),
        start_angle: (from - centre).angle(),
        sweep_angle: 2.0 * half,
        x_rotation: 0.0,
    })
}
