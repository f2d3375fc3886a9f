//! The path to cut: the tool's drawing on a large curved sheet, as instructions with six floats.

use anyhow::Result;
use laser_eb90::{EncodeError, Item, Items, Payload, Profile};

use crate::io::drawing::{Line, Picture, Point};
use cellwire_sim::laser::Job;

/// To a point with the laser on.
pub const CUT: u16 = 0x0101;
/// To a point with the laser off.
pub const MOVE: u16 = 0x0102;

/// The sheet: 1.5 m by 1 m, in hundredths of a millimetre.
pub const SHEET: Point = Point { x: 150_000, y: 100_000 };

/// A line is cut in steps of at most this, in hundredths of a millimetre, so that the beam follows the curved sheet.
const STEP: f64 = 500.0;

/// One instruction: to X, Y, Z in millimetres with the beam tilted about X and Y in degrees; the last float is the length of
/// the path so far in millimetres, by which the laser is pulsed. It makes every instruction of the path another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// The command word: [`CUT`] or [`MOVE`].
    pub word: u16,
    /// X, Y, Z, tilt about X, tilt about Y, length.
    pub values: [f32; 6],
}

impl Cut {
    /// Writes the parameters.
    ///
    /// # Errors
    /// If they do not fit.
    pub fn write(&self, parameters: &mut Payload<'_>) -> Result<(), EncodeError> {
        parameters.f32(&self.values).map(drop)
    }

    /// Returns the cut of a job; `None` if the job is not an instruction of a path.
    pub fn of(job: &Job, profile: &Profile) -> Option<Self> {
        let mut items = Items::new(&job.parameters, profile);
        match (job.word, items.next(), items.next()) {
            (CUT | MOVE, Some(Ok(Item::F32(values))), None) => {
                Some(Self { word: job.word, values: values.array()? })
            }
            _ => None,
        }
    }

    /// Returns the end of the cut on the sheet; a point that corruption has moved off the sheet is at its edge.
    pub fn end(&self) -> Point {
        let [x, y, ..] = self.values;
        Point { x: hundredths(x).clamp(0, SHEET.x), y: hundredths(y).clamp(0, SHEET.y) }
    }
}

/// Returns the path of the built-in drawing.
///
/// # Errors
/// Never, unless the drawing is broken.
pub fn path() -> Result<Vec<Cut>> {
    let picture = Picture::built_in(SHEET)?;
    let mut length = 0.0;
    Ok(picture.lines.iter().flat_map(|line| steps(*line, &mut length)).collect())
}

fn steps(line: Line, length: &mut f64) -> Vec<Cut> {
    let from = (f64::from(line.from.x), f64::from(line.from.y));
    let way = (f64::from(line.to.x) - from.0, f64::from(line.to.y) - from.1);
    let distance = way.0.hypot(way.1);
    let count = if line.draws { (distance / STEP).ceil().max(1.0) } else { 1.0 };
    let word = if line.draws { CUT } else { MOVE };
    let start = *length;
    *length += distance / 100.0;
    (1..=whole(count))
        .map(|step| {
            let part = f64::from(step) / count;
            let (x, y) = ((from.0 + way.0 * part) / 100.0, (from.1 + way.1 * part) / 100.0);
            let (z, tilt_x, tilt_y) = measured(x, y);
            let values = [x, y, z, tilt_x, tilt_y, start + distance / 100.0 * part];
            Cut { word, values: values.map(float) }
        })
        .collect()
}

/// Returns the measurements of the sheet at X, Y: its height, and the tilt of the beam with which it is perpendicular to the
/// sheet. The parameters of a laser robot cannot be taught; they come from a measuring system (introduction of the source).
fn measured(x: f64, y: f64) -> (f64, f64, f64) {
    let (wave_x, wave_y) = (x / 240.0, y / 310.0);
    let z = 12.0 * wave_x.sin() + 8.0 * wave_y.cos();
    let slope_x = 12.0 / 240.0 * wave_x.cos();
    let slope_y = -8.0 / 310.0 * wave_y.sin();
    (z, slope_y.atan().to_degrees(), -slope_x.atan().to_degrees())
}

#[expect(clippy::cast_possible_truncation, reason = "the link carries floats")]
fn float(x: f64) -> f32 {
    x as f32
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
        let path = path().unwrap();
        assert!((20_000..99_999).contains(&path.len()), "{}", path.len());
        let different: HashSet<_> = path.iter().map(|cut| cut.values.map(f32::to_bits)).collect();
        assert_eq!(different.len(), path.len());
        let stuffed = path.iter().flat_map(|cut| cut.values).filter(|v| v.to_le_bytes().contains(&0x90));
        assert!(stuffed.count() > 100, "some values need stuffing");
    }

    #[test]
    fn steps_end_where_the_line_ends() {
        let line = Line { draws: true, from: Point { x: 0, y: 0 }, to: Point { x: 1100, y: 0 } };
        let mut length = 7.0;
        let cuts = steps(line, &mut length);
        let ends: Vec<_> = cuts.iter().map(Cut::end).collect();
        assert_eq!(ends.len(), 3);
        assert_eq!(ends.last(), Some(&line.to));
        assert_eq!((cuts[2].values[5], length), (18.0, 18.0));
    }
}
