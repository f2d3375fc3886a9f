//! A subset of G-code (ISO 6983): lines and arcs in a plane, with the laser on and off.

mod text;

use core::f64::consts::TAU;

use anyhow::{Context, Result, anyhow, bail, ensure};
use gcode::core::TokenType;
use gcode::{Block, Code, DiagnosticKind, Value};

use super::route::{Instruction, Route};
use super::settings::{Coordinate, Mapping};

/// The values that a program gives and its instructions do not carry, each with its first line.
type NotCarried = Vec<(Coordinate, u64)>;

/// Returns the instructions of a program, the values that they do not carry, and warnings.
///
/// Reads G0 to G3, G4 P0, G17, G20, G21, G90, G91, M2, M3, M4, M5 and M30; F, S, X, Y, Z, A, B, C, I, J, R. These words are
/// read and have no effect: G40, G49, G54, G69, G91.1, G94, G98 and G99, since their counterparts are refused, and M7, M8
/// and M9, since the link has no word for a coolant.
///
/// G1 to G3 cut after M3 or M4 until M5, unless S is 0, as laser software writes its travel; otherwise they move, as G0
/// does. If the words of the plant carry no S, a program without S cuts with the plant's own power.
///
/// # Errors
/// If a line has any other word, with its number, or a cut has no feed or power that the plant's words carry: a program that
/// is not understood is not run. All such lines are named, the first twenty.
pub(super) fn read(text: &str, mapping: &Mapping) -> Result<(Vec<Instruction>, NotCarried, Vec<String>)> {
    let mut wrong = ProgramErrors::default();
    text::faults(text).for_each(|(line, fault)| wrong.add(line, &fault));
    if wrong.count > 0 {
        return Err(wrong.error());
    }
    let program = match gcode::parse(text) {
        Ok(program) => program,
        Err(found) => {
            found.iter().for_each(|it| wrong.add(it.span.line as u64 + 1, &unreadable(&it.kind)));
            return Err(wrong.error());
        }
    };
    let mut machine = Machine::new(mapping);
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
    let Machine { not_carried, route: Route { instructions, .. }, .. } = machine;
    let mut warnings = Vec::new();
    if instructions.iter().all(|it| it.word != mapping.cut) {
        warnings.push(
            "never switches the laser on: no G1, G2 or G3 has M3 or M4 before it and a power above 0".into(),
        );
    }
    Ok((instructions, not_carried, warnings))
}

/// The errors in a program, line by line.
#[derive(Default)]
struct ProgramErrors {
    text: String,
    count: usize,
}

impl ProgramErrors {
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

/// Returns the text of an error.
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

/// The modal state of a program.
struct Machine<'a> {
    route: Route<'a>,
    motion: Option<u32>,
    /// Millimetres in a unit.
    scale: f64,
    relative: bool,
    laser: bool,
    /// The values of the program that the plant's words do not carry, with the first line of each.
    not_carried: NotCarried,
}

/// The group of G0 to G3 and G80.
const MOTION: &str = "the motion";
/// The group of G4.
const DWELL: &str = "a wait";

/// The words of a line: letters and their numbers.
#[derive(Default)]
struct Words(Vec<(char, f64)>);

impl Words {
    fn get(&self, letter: char) -> Option<f64> {
        self.0.iter().find(|(found, _)| *found == letter).map(|(_, value)| *value)
    }
}

impl<'a> Machine<'a> {
    fn new(mapping: &'a Mapping) -> Self {
        let (route, not_carried) = (Route::new(mapping), Vec::new());
        Self { route, motion: None, scale: 1.0, relative: false, laser: false, not_carried }
    }

    /// Applies a line; returns false at the end of the program.
    fn block(&mut self, line: u64, block: &Block) -> Result<bool> {
        let mut words = Words::default();
        for word in &block.word_addresses {
            words.add(word.letter, &word.value)?;
        }
        let (was_on, mut is_end, mut groups) = (self.laser, false, Vec::new());
        for code in &block.codes {
            let (name, group, args) = match code {
                Code::General(code) => {
                    let (major, minor) = (code.number.major(), code.number.minor().map_or(0, |it| it.get()));
                    (format!("G{}", code.number), self.general(major, minor)?, &code.args)
                }
                Code::Miscellaneous(code) => {
                    ensure!(code.number.minor().is_none(), "M{} is not supported", code.number);
                    is_end |= matches!(code.number.major(), 2 | 30);
                    (format!("M{}", code.number), self.miscellaneous(code.number.major())?, &code.args)
                }
                other => bail!("{other} is not supported"),
            };
            if let Some((earlier, _)) = groups.iter().find(|(_, known)| *known == group) {
                bail!("{earlier} and {name} in one line are two words for {group}: give one of them");
            }
            groups.push((name, group));
            for argument in args {
                words.add(argument.letter, &argument.value)?;
            }
        }
        let has = |letters: &str| letters.chars().any(|letter| words.get(letter).is_some());
        match (groups.iter().any(|(_, group)| *group == DWELL), words.get('P')) {
            (false, None) => {}
            (false, Some(_)) => bail!("P is only for G4"),
            (true, None) => bail!("G4 without P"),
            (true, Some(_)) if has("XYZABCIJR") => {
                bail!("G4 and coordinates in one line: give each its own line")
            }
            (true, Some(time)) => {
                ensure!(
                    time == 0.0,
                    "G4 P{time} is a wait, for which the link has no command word: leave it out"
                );
            }
        }
        self.rates(line, &words)?;
        if has("XYZABCIJR") {
            ensure!(
                !(was_on && !self.laser && self.motion > Some(0)),
                "M5 and a motion in one line: some controllers switch the laser off before it, some after it; give M5 its own line"
            );
            self.go(line, &words)?;
        }
        Ok(!is_end)
    }

    /// Sets the feed and the power of a line.
    fn rates(&mut self, line: u64, words: &Words) -> Result<()> {
        if let Some(feed) = words.get('F') {
            ensure!(feed > 0.0, "F{feed} is not a valid feed");
            self.route.feed = feed * self.scale;
        }
        if let Some(power) = words.get('S') {
            ensure!(power >= 0.0, "S{power} is not a valid power: give 0 (move) or more");
            self.route.power = Some(power);
        }
        for (letter, value) in [('F', Coordinate::F), ('S', Coordinate::S)] {
            // S0 is a move, which every plant has a word for.
            let is_given = words.get(letter).is_some_and(|given| given > 0.0);
            if is_given
                && !self.route.carries(value)
                && self.not_carried.iter().all(|(known, _)| *known != value)
            {
                self.not_carried.push((value, line));
            }
        }
        Ok(())
    }

    /// Applies a G word; returns the setting of its modal group.
    fn general(&mut self, major: u32, minor: u32) -> Result<&'static str> {
        Ok(match (major, minor) {
            (0..=3, 0) => {
                self.motion = Some(major);
                MOTION
            }
            (80, 0) => {
                self.motion = None;
                MOTION
            }
            (4, 0) => DWELL,
            (17, 0) => "the plane",
            (20 | 21, 0) => {
                self.scale = if major == 20 { 25.4 } else { 1.0 };
                "the unit"
            }
            (40, 0) => "the cutter compensation",
            (49, 0) => "the tool length",
            (54, 0) => "the work offset",
            (69, 0) => "the rotation",
            (90 | 91, 0) => {
                self.relative = major == 91;
                "the distances"
            }
            (91, 1) => "the centres of arcs",
            (94, 0) => "the feed mode",
            (98 | 99, 0) => "the return of cycles",
            (_, 0) => bail!(
                "G{major} is not supported; supported are G0 to G3, G4 P0, G17, G20, G21, G40, G49, G54, G69, G80, G90, G91, G94, G98 and G99"
            ),
            _ => bail!("G{major}.{minor} is not supported"),
        })
    }

    /// Applies an M word; returns the setting of its modal group.
    fn miscellaneous(&mut self, number: u32) -> Result<&'static str> {
        Ok(match number {
            2 | 30 => "the end",
            3..=5 => {
                self.laser = number != 5;
                "the laser"
            }
            7..=9 => "the coolant",
            other => bail!("M{other} is not supported; M2, M3, M4, M5, M7, M8, M9 and M30 are"),
        })
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
            !cuts || self.route.feed > 0.0 || !self.route.carries(Coordinate::F),
            "a cut without a feed rate: give F first, in units per minute"
        );
        ensure!(
            !cuts || self.route.power.is_some() || !self.route.carries(Coordinate::S),
            "a cut without a power: give S first"
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

    /// Returns the centre and the angle of an arc, from the distance of its centre, or from its radius.
    fn arc(&self, left: bool, to: [f64; 6], words: &Words) -> Result<([f64; 2], f64)> {
        let ([x, y, ..], [end_x, end_y, ..]) = (self.route.at, to);
        let tolerance = self.route.mapping.tolerance;
        let centre = match words.get('R') {
            Some(_) if words.get('I').or(words.get('J')).is_some() => bail!("R together with I or J"),
            None => {
                let [i, j] = ['I', 'J'].map(|letter| words.get(letter).unwrap_or_default() * self.scale);
                [x + i, y + j]
            }
            Some(radius) => {
                let radius = radius * self.scale;
                let (dx, dy) = (end_x - x, end_y - y);
                let chord = dx.hypot(dy);
                ensure!(chord > 0.0, "an arc with R must not end where it begins: give I and J");
                ensure!(
                    chord <= 2.0 * (radius.abs() + tolerance),
                    "the ends of the arc are farther apart than 2 R: {chord:.3} mm"
                );
                let height = (radius * radius - chord * chord / 4.0).max(0.0).sqrt() / chord;
                // A negative R is the longer of the two arcs.
                let side = if left == (radius > 0.0) { height } else { -height };
                [x + dx / 2.0 - dy * side, y + dy / 2.0 + dx * side]
            }
        };
        let [begin, end] = [(x, y), (end_x, end_y)].map(|(x, y)| (x - centre[0], y - centre[1]));
        let (r, r_end) = (begin.0.hypot(begin.1), end.0.hypot(end.1));
        ensure!(r > 0.0, "an arc needs I, J or R");
        ensure!(
            (r - r_end).abs() <= tolerance,
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
        ensure!("XYZABCIJRFSP".contains(letter), "{letter} is not supported");
        ensure!(self.get(letter).is_none(), "{letter} is given twice");
        match value {
            Value::Literal(number) => self.0.push((letter, exact(*number))),
            other => bail!("{letter}{other} is not a number"),
        }
        Ok(())
    }
}

/// Returns a literal as it is spelled: the parser has it in single precision, in which 25.4 is another number.
fn exact(number: f32) -> f64 {
    number.to_string().parse().unwrap_or_else(|_| number.into())
}
