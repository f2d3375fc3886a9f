//! A drawn sheet with axes.

use std::path::Path;

use anyhow::Result;
use svg::node::element::{Group, Line as Stroke, Rectangle, Text};

use crate::io::drawing::{Line, Point, mm, strokes};
use crate::io::files;

const INK: &str = "#404040";
const OFF: &str = "#d04000";

/// Draws lines on their sheet as seen from above, with axes in millimetres: X to the right, Y down. The ways between lines are thin;
/// `names` are those of a line and of such a way in the key.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, sheet: Point, lines: &[Line], names: [&str; 2]) -> Result<()> {
    let (width, height) = (mm(sheet.x), mm(sheet.y));
    let longest = width.max(height);
    // On a small sheet thin lines, on a large one lines that can be seen.
    let (size, margin, line) = (longest / 50.0, longest / 10.0, longest / 1000.0);
    let label = |text: &str, x: f64, y: f64, anchor: &str| {
        Text::new(text).set("x", x).set("y", y).set("text-anchor", anchor)
    };
    let mut axes = Group::new().set("font-family", "sans-serif").set("font-size", size).set("fill", INK);
    let step = step(longest);
    let marks = |length: f64| (0u32..).map(move |n| f64::from(n) * step).take_while(move |at| *at <= length);
    let tick = |from: [f64; 2], to: [f64; 2]| {
        let ends = Stroke::new().set("x1", from[0]).set("y1", from[1]).set("x2", to[0]).set("y2", to[1]);
        ends.set("stroke", INK).set("stroke-width", line)
    };
    for x in marks(width) {
        axes = axes.add(tick([x, height], [x, height + size / 2.0]));
        axes = axes.add(label(&x.to_string(), x, height + 1.7 * size, "middle"));
    }
    for y in marks(height) {
        axes = axes.add(tick([-size / 2.0, y], [0.0, y]));
        axes = axes.add(label(&y.to_string(), -0.8 * size, y + size / 3.0, "end"));
    }
    axes = axes.add(label("X, mm", width / 2.0, height + 3.4 * size, "middle"));
    axes = axes.add(label("Y, mm", -margin * 0.95, height / 2.0, "start"));
    let mut left = 0.0;
    for (name, color) in names.into_iter().zip(["black", OFF]) {
        let stroke = tick([left, -1.2 * size], [left + 2.0 * size, -1.2 * size]);
        axes = axes.add(stroke.set("stroke", color).set("stroke-width", 2.0 * line));
        axes = axes.add(label(name, left + 2.5 * size, -0.9 * size, "start"));
        left += longest / 4.0;
    }
    let frame = Rectangle::new().set("width", width).set("height", height).set("fill", "none");
    let frame = frame.set("stroke", INK).set("stroke-width", line);
    let view = (-margin, -margin / 2.0, width + 1.2 * margin, height + 1.4 * margin);
    let document = svg::Document::new()
        .set("width", 1200)
        .set("height", 1200.0 * view.3 / view.2)
        .set("viewBox", view)
        .add(
            Rectangle::new()
                .set("x", view.0)
                .set("y", view.1)
                .set("width", view.2)
                .set("height", view.3)
                .set("fill", "white"),
        )
        .add(frame)
        .add(strokes(lines, false, OFF, line / 2.0))
        .add(strokes(lines, true, "black", line))
        .add(axes);
    files::write(path, document.to_string().as_bytes())
}

/// From one number of an axis to the next: 1, 2 or 5 and zeros, at most ten of them.
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
        write(&file, Point { x: 150_000, y: 100_000 }, &[line], ["laser on", "laser off"]).unwrap();
        let text = std::fs::read_to_string(file).unwrap();
        for label in ["X, mm", "Y, mm", "laser on", "laser off", "1400", "1000"] {
            assert_eq!(text.lines().filter(|line| line.trim() == label).count().min(1), 1, "{label}\n{text}");
        }
        assert_eq!([3.0, 10.0, 99.0, 1500.0].map(step), [1.0, 1.0, 10.0, 200.0]);
    }
}
