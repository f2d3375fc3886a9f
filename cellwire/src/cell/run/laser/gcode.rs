//! A subset of G-code (ISO 6983): lines and arcs in a plane, with the laser on and off.

use core::f64::consts::TAU;

use anyhow::{Context, Result, anyhow, bail, ensure};
use gcode::core::TokenType;
use gcode::{Block, Code, DiagnosticKind, Value};

use super::program::Program;
use super::route::Route;
use super::settings::{Coordinate, Mapping};

/// Reads G0 to G3, G17, G20, G21, G90, G91, G94, M2, M3, M4, M5 and M30; F, S, X, Y, Z, A, B, C, I, J, R.
///
/// G1 to G3 cut while M3 or M4 holds, unless S is 0, as laser software writes its travel; else they move, as G0 does. A program without
/// S cuts with the plant's own power.
///
/// # Errors
/// When a line has anything else, with its number, or a cut has no feed: a program that is not understood is not run. All such lines are
/// named, the first twenty.
pub(super) fn read(text: &str, mapping: &Mapping) -> Result<Program> {
    let mut wrong = Wrong::default();
    let program = match gcode::parse(text) {
        Ok(program) => program,
        Err(found) => {
            found.iter().for_each(|it| wrong.add(it.span.line as u64 + 1, &unreadable(&it.kind)));
            return Err(wrong.error());
        }
    };
    let mut machine =
        Machine { route: Route::new(mapping), motion: None, scale: 1.0, relative: false, laser: false };
    for block in &program.blocks {
        let line = block.span.line as u64 + 1;
        match machine.block(line, block) {
            Ok(true) => {}
            Ok(false) => break,
            Err(error) => wrong.add(line, &format!("{error:#}")),
        }
    }
    if wrong.count > 0 {
        return Err(wrong.error());
    }
    let Route { feed, power, instructions, .. } = machine.route;
    let given = [(Coordinate::F, feed > 0.0), (Coordinate::S, power.is_some())];
    let lost = given.into_iter().filter(|(value, is_given)| *is_given && !mapping.values.contains(value));
    let not_carried = lost.map(|(value, _)| value).collect();
    Ok(Program { instructions, not_carried, warnings: Vec::new() })
}

/// What is wrong with a program, line by line.
#[derive(Default)]
struct Wrong {
    text: String,
    count: usize,
}

impl Wrong {
    fn add(&mut self, line: u64, what: &str) {
        self.count += 1;
        if self.count <= 20 {
            let separator = if self.text.is_empty() { "" } else { "\n" };
            self.text.push_str(&format!("{separator}line {line}: {what}"));
        }
    }

    fn error(self) -> anyhow::Error {
        match self.count.checked_sub(21) {
            None if self.count == 0 => anyhow!("no G-code"),
            None => anyhow!(self.text),
            Some(more) => anyhow!("{}\nand {} more", self.text, more + 1),
        }
    }
}

/// What cannot be read, in words.
fn unreadable(kind: &DiagnosticKind) -> String {
    match kind {
        DiagnosticKind::UnknownContent { text } => format!("{text:?} is not G-code"),
        DiagnosticKind::Unexpected { actual, expected } if expected.contains(&TokenType::Number) => {
            format!("{actual:?} is not followed by a number")
        }
        DiagnosticKind::Unexpected { actual, .. } => format!("{actual:?} is not expected here"),
        other => other.to_string(),
    }
}

/// What holds until it is changed.
struct Machine<'a> {
    route: Route<'a>,
    motion: Option<u32>,
    /// Millimetres in a unit.
    scale: f64,
    relative: bool,
    laser: bool,
}

/// The words of a line: letters and their numbers.
#[derive(Default)]
struct Words(Vec<(char, f64)>);

impl Words {
    fn get(&self, letter: char) -> Option<f64> {
        self.0.iter().find(|(found, _)| *found == letter).map(|(_, value)| *value)
    }
}

impl Machine<'_> {
    /// Carries a line out; false at the end of the program.
    fn block(&mut self, line: u64, block: &Block) -> Result<bool> {
        let mut words = Words::default();
        for word in &block.word_addresses {
            words.add(word.letter, &word.value)?;
        }
        let (mut moves, mut is_end) = (0, false);
        for code in &block.codes {
            let (number, args) = match code {
                Code::General(code) => {
                    ensure!(code.number.minor().is_none(), "G{} is not supported", code.number);
                    moves += u32::from(code.number.major() <= 3);
                    self.general(code.number.major())?;
                    (code.number, &code.args)
                }
                Code::Miscellaneous(code) => {
                    ensure!(code.number.minor().is_none(), "M{} is not supported", code.number);
                    match code.number.major() {
                        2 | 30 => is_end = true,
                        3 | 4 => self.laser = true,
                        5 => self.laser = false,
                        other => bail!("M{other} is not supported; M2, M3, M4, M5 and M30 are"),
                    }
                    (code.number, &code.args)
                }
                other => bail!("{other} is not supported"),
            };
            ensure!(moves <= 1, "G{number} is a second motion in one line");
            for argument in args {
                words.add(argument.letter, &argument.value)?;
            }
        }
        if let Some(feed) = words.get('F') {
            ensure!(feed > 0.0, "F{feed} is not a valid feed");
            self.route.feed = feed * self.scale;
        }
        if let Some(power) = words.get('S') {
            ensure!(power >= 0.0, "S{power} is not a valid power: give 0 (move) or more");
            self.route.power = Some(power);
        }
        if "XYZABCIJR".chars().any(|letter| words.get(letter).is_some()) {
            self.go(line, &words)?;
        }
        Ok(!is_end)
    }

    fn general(&mut self, number: u32) -> Result<()> {
        match number {
            0..=3 => self.motion = Some(number),
            17 | 94 => {}
            20 => self.scale = 25.4,
            21 => self.scale = 1.0,
            90 => self.relative = false,
            91 => self.relative = true,
            other => {
                bail!("G{other} is not supported; supported are G0 to G3, G17, G20, G21, G90, G91 and G94")
            }
        }
        Ok(())
    }

    fn go(&mut self, line: u64, words: &Words) -> Result<()> {
        let motion = self.motion.context("coordinates without a preceding G0, G1, G2 or G3")?;
        let mut to = self.route.at;
        for (letter, place) in "XYZABC".chars().zip(&mut to) {
            let Some(value) = words.get(letter) else { continue };
            // Angles are in degrees always.
            let value = if "XYZ".contains(letter) { value * self.scale } else { value };
            *place = if self.relative { *place + value } else { value };
        }
        let cuts = motion > 0 && self.laser && self.route.power != Some(0.0);
        ensure!(
            !cuts || self.route.feed > 0.0,
            "a cut without a feed rate: give F first, in units per minute"
        );
        if motion < 2 {
            ensure!(
                ['I', 'J', 'R'].iter().all(|letter| words.get(*letter).is_none()),
                "I, J and R are only for arcs: G2 and G3"
            );
            return self.route.line(line, cuts, to);
        }
        let (centre, sweep) = self.arc(motion == 3, to, words)?;
        self.route.arc(line, cuts, centre, sweep, to)
    }

    /// The centre and the angle of an arc, from the distance of its centre or its radius.
    fn arc(&self, left: bool, to: [f64; 6], words: &Words) -> Result<([f64; 2], f64)> {
        let ([x, y, ..], [end_x, end_y, ..]) = (self.route.at, to);
        let centre = match words.get('R') {
            None => {
                let [i, j] = ['I', 'J'].map(|letter| words.get(letter).unwrap_or_default() * self.scale);
                [x + i, y + j]
            }
            Some(radius) => {
                let radius = radius * self.scale;
                let (dx, dy) = (end_x - x, end_y - y);
                let chord = dx.hypot(dy);
                ensure!(chord > 0.0, "an arc with R must not end where it begins: give I and J");
                let square = radius * radius - chord * chord / 4.0;
                ensure!(square > -1e-6 * radius * radius, "the ends of the arc are farther apart than 2 R");
                let height = square.max(0.0).sqrt() / chord;
                // A negative R is the longer of the two arcs.
                let side = if left == (radius > 0.0) { height } else { -height };
                [x + dx / 2.0 - dy * side, y + dy / 2.0 + dx * side]
            }
        };
        let [begin, end] = [(x, y), (end_x, end_y)].map(|(x, y)| (x - centre[0], y - centre[1]));
        let (r, r_end) = (begin.0.hypot(begin.1), end.0.hypot(end.1));
        ensure!(r > 0.0, "an arc needs I, J or R");
        ensure!(
            (r - r_end).abs() <= 0.01_f64.max(0.001 * r),
            "the arc begins {r:.3} mm and ends {r_end:.3} mm from its centre"
        );
        let turn = (end.1.atan2(end.0) - begin.1.atan2(begin.0)).rem_euclid(TAU);
        // Ends that are the same are a whole circle.
        let turn = if turn < 1e-9 || TAU - turn < 1e-9 { TAU } else { turn };
        Ok((
            centre,
            if left {
                turn
            } else if turn == TAU {
                -TAU
            } else {
                turn - TAU
            },
        ))
    }
}

impl Words {
    fn add(&mut self, letter: char, value: &Value) -> Result<()> {
        let letter = letter.to_ascii_uppercase();
        ensure!("XYZABCIJRFS".contains(letter), "{letter} is not supported");
        ensure!(self.get(letter).is_none(), "{letter} is given twice");
        match value {
            Value::Literal(number) => self.0.push((letter, exact(*number))),
            other => bail!("{letter}{other} is not a number"),
        }
        Ok(())
    }
}

/// A literal as it is spelled: the reader has it in single precision, in which 25.4 is something else.
fn exact(number: f32) -> f64 {
    number.to_string().parse().unwrap_or_else(|_| number.into())
}
