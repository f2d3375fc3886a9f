//! Instructions, and a path that becomes some.

use anyhow::{Result, ensure};

use super::settings::{Coordinate, Mapping};

/// The most instructions of a program: the capacity of a journal and a drawing.
pub(super) const MAX_INSTRUCTIONS: usize = 5_000_000;

/// An instruction.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruction {
    /// The origin of the instruction: a line of the file, or an outline of a drawing, from 1.
    pub line: u64,
    /// The command word of the instruction.
    pub word: u16,
    /// The floats of the instruction.
    pub values: Vec<f32>,
}

/// A path that becomes instructions, line by line.
#[derive(Debug)]
pub struct Route<'a> {
    pub(super) mapping: &'a Mapping,
    /// X, Y, Z, A, B, C.
    pub(super) at: [f64; 6],
    pub(super) feed: f64,
    /// The power in the program; `None` before the first.
    pub(super) power: Option<f64>,
    length: f64,
    /// The instructions so far.
    pub instructions: Vec<Instruction>,
}

impl<'a> Route<'a> {
    /// Creates a path that begins at the origin.
    pub fn new(mapping: &'a Mapping) -> Self {
        Self { mapping, at: [0.0; 6], feed: 0.0, power: None, length: 0.0, instructions: Vec::new() }
    }

    /// Returns whether the plant's words have a float for this value.
    pub(super) fn carries(&self, value: Coordinate) -> bool {
        self.mapping.values.contains(&value)
    }

    /// Adds a straight line.
    ///
    /// # Errors
    /// If there are too many.
    pub fn line(&mut self, source: u64, cuts: bool, to: [f64; 6]) -> Result<()> {
        ensure!(self.instructions.len() < MAX_INSTRUCTIONS, "more than {MAX_INSTRUCTIONS} instructions");
        let way = |axis: usize| {
            let [from, to] = [self.at, to].map(|place| place.get(axis).copied().unwrap_or_default());
            to - from
        };
        self.length += way(0).hypot(way(1)).hypot(way(2));
        self.at = to;
        let [x, y, z, a, b, c] = to;
        let value = |coordinate: &Coordinate| match coordinate {
            Coordinate::X => x,
            Coordinate::Y => y,
            Coordinate::Z => z,
            Coordinate::A => a,
            Coordinate::B => b,
            Coordinate::C => c,
            Coordinate::F => self.feed,
            Coordinate::S => self.power.unwrap_or_default(),
            Coordinate::Length => self.length,
        };
        let values = self.mapping.values.iter().map(value).map(float).collect();
        let word = if cuts { self.mapping.cut } else { self.mapping.rapid };
        self.instructions.push(Instruction { line: source, word, values });
        Ok(())
    }

    /// Adds an arc about a centre, as chords: `sweep` in radians, left if positive. It ends at `to`; the other values change
    /// evenly.
    ///
    /// # Errors
    /// If there are too many chords.
    pub(super) fn arc(
        &mut self,
        source: u64,
        cuts: bool,
        centre: [f64; 2],
        sweep: f64,
        to: [f64; 6],
    ) -> Result<()> {
        let from = self.at;
        let (dx, dy) = (from[0] - centre[0], from[1] - centre[1]);
        let (radius, begin) = (dx.hypot(dy), dy.atan2(dx));
        // The height of a chord's segment is r (1 - cos(angle / 2)).
        let widest = 2.0 * (1.0 - (self.mapping.tolerance / radius).min(1.0)).acos();
        let chords = (sweep.abs() / widest.max(1e-4)).ceil().clamp(1.0, 100_000.0);
        let mut chord = 1.0;
        while chord < chords {
            let part = chord / chords;
            let angle = begin + sweep * part;
            let mut place = [0.0; 6];
            for ((place, from), to) in place.iter_mut().zip(from).zip(to) {
                *place = from + (to - from) * part;
            }
            let [x, y, ..] = &mut place;
            (*x, *y) = (centre[0] + radius * angle.cos(), centre[1] + radius * angle.sin());
            self.line(source, cuts, place)?;
            chord += 1.0;
        }
        self.line(source, cuts, to)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "the link carries floats")]
fn float(x: f64) -> f32 {
    x as f32
}
