//! The path to cut: the tool's drawing on a large curved sheet.

use anyhow::Result;
use laser_eb90::ControllerConfig;

use crate::io::drawing::{Line, Picture, Point, mm};
use crate::run::laser::{Instruction, Mapping, Program, Route};
use cellwire_sim::laser::Job;

/// The sheet: 1.5 m by 1 m, in hundredths of a millimetre.
pub const SHEET: Point = Point { x: 150_000, y: 100_000 };

/// A line is cut in steps of at most this, in hundredths of a millimetre, so that the beam follows the curved sheet.
const STEP: f64 = 500.0;

/// Returns the path of the built-in drawing. Its last float, the length of the path so far, makes every instruction another one.
///
/// # Errors
/// Never, unless the drawing is broken.
pub fn path(mapping: &Mapping) -> Result<Program> {
    let (picture, mut route) = (Picture::built_in(SHEET)?, Route::new(mapping));
    picture.lines.iter().try_for_each(|line| steps(*line, &mut route))?;
    Ok(Program::of(route.instructions))
}

fn steps(line: Line, route: &mut Route<'_>) -> Result<()> {
    let [from, to] = [line.from, line.to].map(|at| (mm(at.x), mm(at.y)));
    let count = if line.draws { (line.length() * 100.0 / STEP).ceil().max(1.0) } else { 1.0 };
    for step in 1..=whole(count) {
        let part = f64::from(step) / count;
        let (x, y) = (from.0 + (to.0 - from.0) * part, from.1 + (to.1 - from.1) * part);
        let [z, tilt_x, tilt_y] = measured(x, y);
        route.line(0, line.draws, [x, y, z, tilt_x, tilt_y, 0.0])?;
    }
    Ok(())
}

/// Returns the measurements of the sheet at X, Y: its height, and the tilt about X and Y with which the beam is perpendicular to
/// it. The parameters of a laser robot cannot be taught; they come from a measuring system (introduction of the source).
fn measured(x: f64, y: f64) -> [f64; 3] {
    let (wave_x, wave_y) = (x / 240.0, y / 310.0);
    let z = 12.0 * wave_x.sin() + 8.0 * wave_y.cos();
    let slope_x = 12.0 / 240.0 * wave_x.cos();
    let slope_y = -8.0 / 310.0 * wave_y.sin();
    [z, slope_y.atan().to_degrees(), -slope_x.atan().to_degrees()]
}

/// Returns the instruction that a robot has executed.
pub fn executed(job: &Job, config: &ControllerConfig) -> Instruction {
    Instruction { line: 0, word: job.word, values: job.floats(config) }
}

/// Returns the lines on the sheet of these instructions; a point that corruption has moved off the sheet is at its edge.
pub fn lines(executed: &[Instruction], mapping: &Mapping) -> Vec<Line> {
    let mut at = Point { x: 0, y: 0 };
    let lines = executed.iter().filter_map(|Instruction { word, values, .. }| {
        let [x, y, ..] = *values.as_slice() else { return None };
        let to = Point { x: hundredths(x).clamp(0, SHEET.x), y: hundredths(y).clamp(0, SHEET.y) };
        let from = core::mem::replace(&mut at, to);
        Some(Line { draws: *word == mapping.cut, from, to })
    });
    lines.collect()
}

#[expect(clippy::cast_possible_truncation, reason = "a float saturates when cast to an integer")]
fn hundredths(millimetres: f32) -> i32 {
    (f64::from(millimetres) * 100.0).round() as i32
}

#[expect(clippy::cast_possible_truncation, reason = "a line of the sheet has some hundred steps")]
fn whole(x: f64) -> i32 {
    x as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn the_path_has_tens_of_thousands_of_different_instructions() {
        let path = path(&Mapping::default()).unwrap().instructions;
        assert!((20_000..99_999).contains(&path.len()), "{}", path.len());
        let values = |it: &Instruction| it.values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let different: HashSet<_> = path.iter().map(values).collect();
        assert_eq!(different.len(), path.len());
        let stuffed = path.iter().flat_map(|it| &it.values).filter(|v| v.to_le_bytes().contains(&0x90));
        assert!(stuffed.count() > 100, "some values need stuffing");
    }

    #[test]
    fn steps_end_where_the_line_ends() {
        let mapping = Mapping::default();
        let line = Line { draws: true, from: Point { x: 0, y: 0 }, to: Point { x: 1100, y: 0 } };
        let mut route = Route::new(&mapping);
        steps(line, &mut route).unwrap();
        let ends: Vec<_> = lines(&route.instructions, &mapping).iter().map(|line| line.to).collect();
        assert_eq!((ends.len(), ends.last()), (3, Some(&line.to)));
    }
}
