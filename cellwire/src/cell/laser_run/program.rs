//! The instructions of a program, whatever it was written in.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, bail, ensure};
use laser_eb90::{Class, HostConfig, timing};

use super::settings::{Coordinate, Mapping};
use super::{csv, dxf, gcode};
use crate::io::drawing;
use crate::io::input;

/// The most instructions of a program: what a journal and a drawing can hold.
const MAX_INSTRUCTIONS: usize = 5_000_000;
/// The bytes around the floats of an instruction, and of a frame.
const OVERHEAD: (usize, usize) = (6, 7);

/// An instruction.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruction {
    /// Where it is from: a line of the file, or an entity of a drawing, from 1.
    pub line: u64,
    /// The command word.
    pub word: u16,
    /// Its floats.
    pub values: Vec<f32>,
}

/// A program.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    /// In order.
    pub instructions: Vec<Instruction>,
}

impl Program {
    /// Reads a program: `.csv` of instructions, `.dxf`, or else G-code.
    ///
    /// # Errors
    /// When the file cannot be read, or has what no instruction can be made of, with the line.
    pub fn read(file: &Path, mapping: &Mapping, host: &HostConfig) -> Result<Self> {
        let kind = file.extension().and_then(|it| it.to_str()).unwrap_or_default().to_ascii_lowercase();
        let instructions = match kind.as_str() {
            "csv" => csv::read(&input::text(file)?, mapping),
            "dxf" => dxf::read(&input::bytes(file)?, mapping),
            _ => gcode::read(&input::text(file)?, mapping),
        };
        let instructions = instructions.with_context(|| file.display().to_string())?;
        ensure!(!instructions.is_empty(), "{} has no instructions", file.display());
        ensure!(instructions.len() <= MAX_INSTRUCTIONS, "more than {MAX_INSTRUCTIONS} instructions");
        for Instruction { line, word, values } in &instructions {
            match host.words.class(*word) {
                Some(Class::Interpreted | Class::Immediate) => {}
                Some(Class::Query) => bail!("line {line}: {word:#06x} is a query: it belongs in no program"),
                None => bail!("line {line}: {word:#06x} is no command word; the setting `words` has them"),
            }
            ensure!(values.iter().all(|value| value.is_finite()), "line {line}: a number that is too large");
            ensure!(values.len() <= 60, "line {line}: more floats than a frame can hold");
        }
        Ok(Self { instructions })
    }

    /// A number that programs of other instructions do not have: FNV-1a of all words and floats.
    pub fn fingerprint(&self) -> String {
        let mut hash = 0xCBF2_9CE4_8422_2325_u64;
        let mut add = |byte: u8| hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01B3);
        for Instruction { word, values, .. } in &self.instructions {
            word.to_le_bytes().into_iter().for_each(&mut add);
            values.iter().flat_map(|value| value.to_le_bytes()).for_each(&mut add);
            add(0xFF);
        }
        format!("{hash:016x}")
    }

    /// How long the line takes, when nothing fails and the queue is never full, and how many frames there are.
    pub fn estimate(&self, host: &HostConfig) -> (usize, Duration) {
        let (mut frames, mut time) = (0, Duration::ZERO);
        let mut rest = self.instructions.as_slice();
        while let Some(first) = rest.first() {
            let interpreted = |it: &Instruction| host.words.class(it.word) == Some(Class::Interpreted);
            let most = if interpreted(first) { usize::from(host.batch) } else { 1 };
            let count = rest.iter().take(most).take_while(|it| interpreted(it) == interpreted(first)).count();
            let (frame, after) = rest.split_at(count.max(1));
            rest = after;
            let length: usize = frame.iter().map(|it| OVERHEAD.0 + 4 * it.values.len()).sum();
            frames += 1;
            time += timing::period(length + OVERHEAD.1, OVERHEAD.1 + OVERHEAD.0, host.baud, timing::TICK);
        }
        (frames, time)
    }

    /// The least and the greatest of X and Y, in mm.
    pub fn bounds(&self, mapping: &Mapping) -> Option<([f32; 2], [f32; 2])> {
        let points = self.instructions.iter().filter_map(|it| place(it, mapping));
        points.fold(None, |bounds, [x, y]| {
            let ([left, low], [right, high]) = bounds.unwrap_or(([x, y], [x, y]));
            Some(([left.min(x), low.min(y)], [right.max(x), high.max(y)]))
        })
    }

    /// Draws what the robot would do, seen from above: lines with the laser off are thin.
    ///
    /// # Errors
    /// When no instruction has a place, the path is longer than 10 km, or the file cannot be written.
    pub fn draw(&self, file: &Path, mapping: &Mapping) -> Result<()> {
        let way = |it: &Instruction| {
            let [x, y] = place(it, mapping)?;
            Some(([f64::from(x), f64::from(y)], it.word == mapping.cut))
        };
        let route: Vec<_> = self.instructions.iter().filter_map(way).collect();
        ensure!(!route.is_empty(), "no instruction has X and Y: nothing can be drawn");
        drawing::write_route(file, &route)
    }
}

/// Where an instruction of a path leads.
fn place(instruction: &Instruction, mapping: &Mapping) -> Option<[f32; 2]> {
    if ![mapping.cut, mapping.rapid].contains(&instruction.word) {
        return None;
    }
    let value = |wanted| {
        let at = mapping.values.iter().position(|value| *value == wanted)?;
        instruction.values.get(at).copied()
    };
    Some([value(Coordinate::X)?, value(Coordinate::Y)?])
}

/// A path that becomes instructions, line by line.
#[derive(Debug)]
pub(super) struct Route<'a> {
    mapping: &'a Mapping,
    /// X, Y, Z, A, B, C.
    pub(super) at: [f64; 6],
    pub(super) feed: f64,
    pub(super) power: f64,
    length: f64,
    pub(super) instructions: Vec<Instruction>,
}

impl<'a> Route<'a> {
    pub(super) fn new(mapping: &'a Mapping) -> Self {
        Self { mapping, at: [0.0; 6], feed: 0.0, power: 0.0, length: 0.0, instructions: Vec::new() }
    }

    /// A straight line.
    ///
    /// # Errors
    /// When there are too many.
    pub(super) fn line(&mut self, source: u64, cuts: bool, to: [f64; 6]) -> Result<()> {
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
            Coordinate::S => self.power,
            Coordinate::Length => self.length,
        };
        let values = self.mapping.values.iter().map(value).map(float).collect();
        let word = if cuts { self.mapping.cut } else { self.mapping.rapid };
        self.instructions.push(Instruction { line: source, word, values });
        Ok(())
    }

    /// An arc about a centre, as chords: `sweep` in radians, left if positive. It ends at `to`; what else changes, does evenly.
    ///
    /// # Errors
    /// When there are too many chords.
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
