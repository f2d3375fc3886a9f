//! A drawn sheet with axes.

use std::path::Path;

use anyhow::{Result, ensure};
use svg::node::element::{Circle, Group, Line as Stroke, Rectangle, Text};

use crate::io::drawing::{Line, Point, mm, strokes};
use crate::io::journal::Outcome;
use cellwire_io::files;

const INK: &str = "#404040";
const OFF: &str = "#d04000";
const START: &str = "#288c46";
const END: &str = "#c83c32";

/// Draws lines on their sheet as seen from above, with axes in millimetres: X to the right, Y down. The ways between lines
/// are thin; `names` are those of a line and of such a way in the key. With `outcomes`, one for each line, the lines are
/// marked by them.
///
/// # Errors
/// If the file cannot be written.
pub fn write(
    path: &Path,
    sheet: Point,
    lines: &[Line],
    outcomes: &[Outcome],
    names: [&str; 2],
) -> Result<()> {
    draw(path, &Plan { sheet, origin: [0.0; 2], up: false, lines, outcomes, names })
}

/// Draws a route in a plane, in mm with Y upwards: places, and whether the way to each is thick. The sheet fits it, with a
/// margin. With `outcomes`, one for each place, the ways to them are marked by them.
///
/// # Errors
/// If the route leaves 10 km, or the file cannot be written.
pub fn write_route(
    path: &Path,
    route: &[([f64; 2], bool)],
    outcomes: &[Outcome],
    names: [&str; 2],
) -> Result<()> {
    let of = |axis: usize| route.iter().filter_map(move |(place, _)| place.get(axis).copied());
    let least = [0, 1].map(|axis| of(axis).fold(f64::INFINITY, f64::min));
    let most = [0, 1].map(|axis| of(axis).fold(f64::NEG_INFINITY, f64::max));
    let ([left, low], [right, top]) = (least, most);
    ensure!(right - left < 1e7 && top - low < 1e7, "the path exceeds 10 km: check its units");
    let margin = ((right - left).max(top - low) / 20.0).max(1.0);
    let (left, top) = ((left - margin).floor(), (top + margin).ceil());
    let point = |[x, y]: [f64; 2]| Point { x: hundredths(x - left), y: hundredths(top - y) };
    let ways = route.iter().zip(route.iter().skip(1));
    let lines: Vec<Line> = ways
        .map(|((from, _), (to, draws))| Line { draws: *draws, from: point(*from), to: point(*to) })
        .collect();
    let sheet = point([(right + margin).ceil(), (low - margin).floor()]);
    let outcomes = outcomes.get(1..).unwrap_or_default();
    draw(path, &Plan { sheet, origin: [left, top], up: true, lines: &lines, outcomes, names })
}

#[expect(clippy::cast_possible_truncation, reason = "it saturates")]
fn hundredths(mm: f64) -> i32 {
    (mm * 100.0).round() as i32
}

/// Lines on a sheet, the X and Y of its upper left corner, and the direction of Y.
struct Plan<'a> {
    sheet: Point,
    origin: [f64; 2],
    up: bool,
    lines: &'a [Line],
    outcomes: &'a [Outcome],
    names: [&'a str; 2],
}

/// The colors of lines by their outcomes, and the words of the key.
const MARKS: [(&str, &str); 3] = [("black", "done"), ("#a020c0", "unknown"), ("#5090e0", "to do")];

/// Returns the index of an outcome in [`MARKS`].
const fn mark(outcome: Outcome) -> usize {
    match outcome {
        Outcome::Done => 0,
        Outcome::Unknown => 1,
        Outcome::NotSent | Outcome::Refused => 2,
    }
}

impl Plan<'_> {
    /// Returns the lines with this mark, or all of a plan without outcomes.
    fn marked(&self, index: usize) -> Vec<Line> {
        match self.outcomes {
            [] if index == 0 => self.lines.to_vec(),
            outcomes => {
                let lines = self.lines.iter().zip(outcomes);
                lines.filter(|(_, outcome)| mark(**outcome) == index).map(|(line, _)| *line).collect()
            }
        }
    }
}

fn draw(path: &Path, plan: &Plan<'_>) -> Result<()> {
    let Plan { sheet, origin: [x0, y0], up, lines, outcomes, names: [name, between] } = *plan;
    let (width, height) = (mm(sheet.x), mm(sheet.y));
    let longest = width.max(height);
    // On a small sheet thin lines, on a large one lines that can be seen.
    let (size, margin, line) = (longest / 50.0, longest / 10.0, longest / 1000.0);
    let label = |text: &str, x: f64, y: f64, anchor: &str| {
        Text::new(text).set("x", shown(x)).set("y", shown(y)).set("text-anchor", anchor)
    };
    let mut axes =
        Group::new().set("font-family", "sans-serif").set("font-size", shown(size)).set("fill", INK);
    let step = step(longest);
    let tick = |from: [f64; 2], to: [f64; 2]| {
        let ends = Stroke::new().set("x1", shown(from[0])).set("y1", shown(from[1]));
        let ends = ends.set("x2", shown(to[0])).set("y2", shown(to[1]));
        ends.set("stroke", INK).set("stroke-width", shown(line))
    };
    for value in marks(x0, x0 + width, step) {
        let x = value - x0;
        axes = axes.add(tick([x, height], [x, height + size / 2.0]));
        axes = axes.add(label(&shown(value).to_string(), x, height + 1.7 * size, "middle"));
    }
    let (low, high) = if up { (y0 - height, y0) } else { (y0, y0 + height) };
    for value in marks(low, high, step) {
        let y = if up { y0 - value } else { value - y0 };
        axes = axes.add(tick([-size / 2.0, y], [0.0, y]));
        axes = axes.add(label(&shown(value).to_string(), -0.8 * size, y + size / 3.0, "end"));
    }
    axes = axes.add(label("X, mm", width / 2.0, height + 3.4 * size, "middle"));
    axes = axes.add(label("Y, mm", -margin * 0.95, -1.2 * size, "start"));
    // The key: both kinds of lines, start and end, and how long a step of the axes is.
    let mut left = 0.0;
    let row = height + 4.6 * size;
    let marks = MARKS.map(|(color, word)| (format!("{name}, {word}"), color));
    let names = if outcomes.is_empty() { vec![(name.to_owned(), "black")] } else { marks.to_vec() };
    for (name, color) in names.into_iter().chain([(between.to_owned(), OFF)]) {
        let stroke = tick([left, row], [left + 2.0 * size, row]);
        let stroke = stroke.set("stroke", color).set("stroke-width", shown(2.0 * line));
        axes =
            axes.add(if color == OFF { stroke.set("stroke-dasharray", shown(size / 3.0)) } else { stroke });
        axes = axes.add(label(&name, left + 2.5 * size, row + size / 3.0, "start"));
        #[expect(clippy::cast_precision_loss, reason = "a few letters")]
        let letters = name.len() as f64;
        left += (4.5 + 0.6 * letters) * size;
    }
    let dot = |x: f64, y: f64, color: &str| {
        Circle::new().set("cx", shown(x)).set("cy", shown(y)).set("r", shown(size / 3.0)).set("fill", color)
    };
    let mut ends = Group::new();
    for (name, color, place) in [
        ("start", START, lines.first().map(|line| line.from)),
        ("end", END, lines.last().map(|line| line.to)),
    ] {
        ends = ends.add(dot(left, row, color));
        axes = axes.add(label(name, left + 0.7 * size, row + size / 3.0, "start"));
        left += 4.5 * size;
        if let Some(place) = place {
            ends = ends.add(dot(mm(place.x), mm(place.y), color));
        }
    }
    let bar = [[left, row], [left + step, row]];
    axes = axes.add(tick(bar[0], bar[1]).set("stroke-width", shown(3.0 * line)));
    axes = axes.add(label(&format!("{step} mm"), left + step + 0.5 * size, row + size / 3.0, "start"));
    let frame = Rectangle::new().set("width", width).set("height", height).set("fill", "none");
    let frame = frame.set("stroke", INK).set("stroke-width", shown(line));
    let wide = (width + 1.2 * margin).max(left + step + 8.0 * size + margin);
    let view = [-margin, -margin / 2.0, wide, height + 1.7 * margin].map(shown);
    let [x, y, wide, high] = view;
    let thin = strokes(lines, false, OFF, shown(line / 2.0)).set("stroke-dasharray", shown(size / 3.0));
    let mut thick = Group::new();
    for (index, (color, _)) in MARKS.iter().enumerate() {
        let marked = plan.marked(index);
        if marked.iter().any(|line| line.draws) {
            thick = thick.add(strokes(&marked, true, color, shown(line)));
        }
    }
    let document = svg::Document::new()
        .set("width", 1200)
        .set("height", (1200.0 * high / wide).round())
        .set("viewBox", (x, y, wide, high))
        .add(
            Rectangle::new()
                .set("x", x)
                .set("y", y)
                .set("width", wide)
                .set("height", high)
                .set("fill", "white"),
        )
        .add(frame)
        .add(thin)
        .add(thick)
        .add(ends)
        .add(axes);
    files::write(path, document.to_string().as_bytes())
}

/// Returns a number in its printed form: to a thousandth, without a negative zero.
fn shown(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0 + 0.0
}

/// Returns the numbers of an axis.
fn marks(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let first = (low / step).ceil();
    (0u32..).map(move |n| (first + f64::from(n)) * step).take_while(move |value| *value <= high)
}

/// Returns the step from one number of an axis to the next: 1, 2 or 5 and zeros, at most ten of them.
fn step(length: f64) -> f64 {
    let mut power = 1.0;
    loop {
        if let Some(step) =
            [1.0, 2.0, 5.0].map(|step| step * power).into_iter().find(|step| length / step <= 10.0)
        {
            return step;
        }
        power *= 10.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axes_have_numbers_units_and_a_key() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.svg");
        let line = Line { draws: true, from: Point { x: 0, y: 0 }, to: Point { x: 150_000, y: 9 } };
        write(&file, Point { x: 150_000, y: 100_000 }, &[line], &[], ["laser on", "laser off"]).unwrap();
        let text = std::fs::read_to_string(file).unwrap();
        for label in ["X, mm", "Y, mm", "laser on", "laser off", "1400", "1000", "start", "end", "200 mm"] {
            assert_eq!(text.lines().filter(|line| line.trim() == label).count().min(1), 1, "{label}\n{text}");
        }
        // A route around zero, an inch wide: numbers as they are read.
        let file = folder.path().join("y.svg");
        write_route(&file, &[([-25.4, 0.0], false), ([0.0, -0.0], true)], &[], ["cut", "moved"]).unwrap();
        let text = std::fs::read_to_string(file).unwrap();
        assert!(!text.contains("-0\"") && !text.contains(">-0<") && !text.contains("99999"), "{text}");
        assert!(text.lines().any(|line| line.trim() == "-25") && text.contains("1.6,2"), "{text}");
        assert_eq!([3.0, 10.0, 99.0, 1500.0].map(step), [1.0, 1.0, 10.0, 200.0]);
    }

    #[test]
    fn outcomes_have_colors_and_the_key_names_them() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("x.svg");
        let place = |x: f64, draws| ([x, 0.0], draws);
        let route = [place(0.0, false), place(1.0, true), place(2.0, true), place(3.0, true)];
        let outcomes = [Outcome::Done, Outcome::Done, Outcome::Unknown, Outcome::NotSent];
        write_route(&file, &route, &outcomes, ["cut", "moved"]).unwrap();
        let text = std::fs::read_to_string(file).unwrap();
        for ((color, word), x) in MARKS.into_iter().zip([2, 3, 4]) {
            assert!(text.lines().any(|line| line.trim() == format!("cut, {word}")), "{text}");
            let end = format!(" L{x},1\" fill=\"none\" stroke=\"{color}\"");
            assert!(text.contains(&end), "{end}: {text}");
        }
    }
}
