//! Reads a laser program (G-code, DXF or CSV) as a list of instructions.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail, ensure};
use laser_eb90::{Class, HostConfig, timing};

use super::route::{Instruction, MAX_INSTRUCTIONS};
use super::settings::{Coordinate, Mapping};
use super::{csv, gcode, svg};
use crate::io::drawing::refuse_dxf;
use crate::io::journal::{Fingerprint, Outcome};
use crate::io::sheet;
use crate::run::Bounds;
use cellwire_io::input;

/// The bytes around the floats of an instruction, and of a frame.
const OVERHEAD: (usize, usize) = (6, 7);

/// A program.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    /// The instructions, in their sequence.
    pub instructions: Vec<Instruction>,
    /// The unit of the instructions' lines: `line`, or `outline` of a drawing.
    pub unit: &'static str,
    /// The values that the program gives and its instructions do not carry, feed or power, each with its first line.
    pub not_carried: Vec<(Coordinate, u64)>,
    /// The parts of a drawing that are not cut as they are drawn, or that the laser is never on. Each continues a sentence
    /// that begins with the name of the file.
    pub warnings: Vec<String>,
}

impl Program {
    /// Reads a program: `.csv` of instructions, an SVG drawing (`.svg`, or text that begins with `<`), or G-code. A drawing
    /// that cannot be cut as it is drawn is refused; with `allow` it has warnings.
    ///
    /// # Errors
    /// If the file cannot be read, is a DXF drawing, or has a part that cannot become an instruction, with the line.
    pub fn read(file: &Path, mapping: &Mapping, host: &HostConfig, allow: bool) -> Result<Self> {
        let data = input::bytes(file)?;
        refuse_dxf(file, &data)?;
        let kind = input::extension(file);
        let program = match kind.as_str() {
            "csv" => csv::read(&input::decode(file, data)?, mapping).map(Self::of),
            kind if ["svg", "svgz"].contains(&kind) || is_markup(&data) => {
                let read = svg::read(&data, mapping, allow);
                let (instructions, warnings) =
                    read.map_err(|error| anyhow!("the drawing {} {error:#}", file.display()))?;
                Ok(Self { warnings, unit: "outline", ..Self::of(instructions) })
            }
            _ => gcode::read(&input::decode(file, data)?, mapping).map(|read| {
                let (instructions, not_carried, warnings) = read;
                Self { not_carried, warnings, ..Self::of(instructions) }
            }),
        };
        let program = program.with_context(|| file.display().to_string())?;
        let instructions = &program.instructions;
        ensure!(!instructions.is_empty(), "{} has no instructions", file.display());
        ensure!(instructions.len() <= MAX_INSTRUCTIONS, "more than {MAX_INSTRUCTIONS} instructions");
        for Instruction { line, word, values } in instructions {
            match host.words.class(*word) {
                Some(Class::Interpreted | Class::Immediate) => {}
                Some(Class::Query) => bail!("line {line}: {word:#06x} is a query, not allowed in a program"),
                None => bail!("line {line}: {word:#06x} is not a command word; see the setting `words`"),
            }
            ensure!(values.iter().all(|value| value.is_finite()), "line {line}: number too large");
            ensure!(values.len() <= 60, "line {line}: more floats than fit a frame");
        }
        Ok(program)
    }

    /// Creates the program of these instructions.
    pub fn of(instructions: Vec<Instruction>) -> Self {
        Self { instructions, unit: "line", not_carried: Vec::new(), warnings: Vec::new() }
    }

    /// Returns the value by which a journal recognizes this program, from all words and floats.
    pub fn fingerprint(&self) -> String {
        let mut fingerprint = Fingerprint::default();
        for Instruction { word, values, .. } in &self.instructions {
            fingerprint.add(&word.to_le_bytes());
            values.iter().for_each(|value| fingerprint.add(&value.to_le_bytes()));
            fingerprint.add(&[0xFF]);
        }
        fingerprint.to_string()
    }

    /// Returns the number of frames, and the time of the line if nothing fails and the queue is never full.
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

    /// Returns the least and the greatest of X and Y, in mm, to a thousandth.
    pub fn bounds(&self, mapping: &Mapping) -> Option<Bounds> {
        // A negative zero plus zero is zero.
        let shown = |value: f32| (f64::from(value) * 1000.0).round() / 1000.0 + 0.0;
        let points = self.instructions.iter().filter_map(|it| place(it, mapping));
        Bounds::of(points.map(|point| point.map(shown)))
    }

    /// Draws the path of the robot, seen from above: lines with the laser off are thin. With outcomes of the instructions,
    /// the lines are marked by them.
    ///
    /// # Errors
    /// If no instruction has a place, the path is longer than 10 km, or the file cannot be written.
    pub fn draw(&self, file: &Path, mapping: &Mapping, outcomes: &[Outcome]) -> Result<()> {
        let way = |it: &Instruction| {
            let [x, y] = place(it, mapping)?;
            Some(([f64::from(x), f64::from(y)], it.word == mapping.cut))
        };
        let route: Vec<_> = self.instructions.iter().filter_map(way).collect();
        ensure!(!route.is_empty(), "no instruction has X and Y: nothing can be drawn");
        let has_place = self.instructions.iter().map(|it| place(it, mapping).is_some());
        let outcomes: Vec<_> =
            outcomes.iter().zip(has_place).filter(|(_, has)| *has).map(|it| *it.0).collect();
        sheet::write_route(file, &route, &outcomes, ["cut", "moved"])
    }
}

fn is_markup(data: &[u8]) -> bool {
    let data = data.strip_prefix("\u{feff}".as_bytes()).unwrap_or(data);
    data.trim_ascii_start().starts_with(b"<")
}

/// Returns the point to which an instruction of a path leads.
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
