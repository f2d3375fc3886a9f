//! The board that is drawn on, and jobs that are lines on it.

use anyhow::{Context as _, Result, bail};

use crate::io::drawing::{Line, Picture, Point};
use cellwire_links::kawasaki_msg::layout::{AnyValue, AnyWork, FieldType, Layout};

/// The board where no other is named: an A3 sheet, in hundredths of a millimetre.
pub const SHEET: Point = Point { x: 42_000, y: 29_700 };

/// The fields of a line: 1 draws it and 2 moves along it, then both its ends.
const NAMES: [&str; 5] = ["kind", "x1", "y1", "x2", "y2"];

/// The positions of the fields of a line in a layout that has them; all other fields have a default.
///
/// Coordinates that are decimals are in millimetres, whole ones in hundredths of a millimetre.
#[derive(Debug, Clone)]
pub struct Lines {
    kind: usize,
    /// The place of x1, y1, x2 and y2, and their decimals.
    ends: [(usize, u8); 4],
    defaults: AnyWork,
}

impl Lines {
    /// Returns the sheet for the jobs of a layout.
    ///
    /// # Errors
    /// If its jobs are not lines.
    pub fn of(layout: &Layout) -> Result<Self> {
        let place = |name: &str| {
            let place = layout.place(name)?;
            match layout.fields().get(place)?.holds {
                FieldType::Number { places, .. } => Some((place, places)),
                FieldType::Text { .. } => None,
            }
        };
        let [kind, ends @ ..] = NAMES;
        let (Some((kind, 0)), [Some(x1), Some(y1), Some(x2), Some(y2)]) = (place(kind), ends.map(place))
        else {
            bail!("the plant's jobs are not lines: [[job]] has no numbers kind, x1, y1, x2, y2");
        };
        let mut defaults = AnyWork::default();
        for (place, field) in layout.fields().iter().enumerate() {
            if !NAMES.contains(&field.name.as_str()) {
                let default = field.default.with_context(|| {
                    format!("a drawing has no `{}`: give that field of [[job]] a default", field.name)
                })?;
                defaults.set(place, default);
            }
        }
        Ok(Self { kind, ends: [x1, y1, x2, y2], defaults })
    }

    /// Returns the job that draws a line.
    pub fn work(&self, line: &Line) -> AnyWork {
        let mut work = self.defaults;
        work.set(self.kind, AnyValue::Number(if line.draws { 1 } else { 2 }));
        for ((place, places), value) in self.ends.iter().zip([line.from.x, line.from.y, line.to.x, line.to.y])
        {
            work.set(*place, AnyValue::Number(units(value, *places)));
        }
        work
    }

    /// Returns the line that a job draws.
    pub fn line(&self, work: &AnyWork) -> Line {
        let [x1, y1, x2, y2] = self.ends.map(|(place, places)| hundredths(work.number(place), places));
        let (from, to) = (Point { x: x1, y: y1 }, Point { x: x2, y: y2 });
        Line { draws: work.number(self.kind) == 1, from, to }
    }

    /// Returns the lines of a picture: a point on the board is a point on the sheet.
    pub fn jobs(&self, picture: &Picture) -> Vec<AnyWork> {
        picture.lines.iter().map(|line| self.work(line)).collect()
    }
}

/// Hundredths of a millimetre in units of the last of this many decimals of a millimetre.
fn units(hundredths: i32, places: u8) -> i32 {
    match places {
        0 | 2 => hundredths,
        // To the nearest tenth.
        1 => (hundredths + 5 * hundredths.signum()) / 10,
        _ => hundredths.saturating_mul(10_i32.saturating_pow(u32::from(places) - 2)),
    }
}

/// Converts units back to hundredths.
fn hundredths(units: i32, places: u8) -> i32 {
    match places {
        0 | 2 => units,
        1 => units.saturating_mul(10),
        _ => units / 10_i32.saturating_pow(u32::from(places) - 2),
    }
}
