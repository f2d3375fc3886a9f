use alloc::format;
use alloc::string::{String, ToString};
use core::fmt;

use crate::error::{EncodeError, Reason};
use crate::text::{
    ParseResult, Reference, decimal, fail, is_letter_or_digit, is_plain, join_lines, joint, or_fail,
    plain_number, push_number, push_shortest, reference, unsigned,
};

/// A motion instruction, such as `S P[2] 10mm/sec CNT100`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Motion {
    /// The path of the motion: joint, linear, circular or another.
    pub kind: MotionKind,
    /// For [`MotionKind::Circular`]: the point on the arc before the target; otherwise `None`.
    pub via: Option<Target>,
    /// The text after that point, as spelled: `Offset,PR[3]`. Empty if there is no such text.
    pub via_options: String,
    /// The target of the motion.
    pub target: Target,
    /// The speed of the motion and its unit.
    pub speed: Speed,
    /// The distance from the target at which the robot begins the next motion; `None` if it is omitted, as some applications
    /// do.
    pub termination: Option<Termination>,
    /// The text after the termination, as spelled: `ACC50 Offset,PR[3]`. Empty if there is no such text.
    pub options: String,
}

impl Motion {
    /// Creates a motion without a point to go through and without options.
    pub fn new(kind: MotionKind, target: Target, speed: Speed, termination: Termination) -> Self {
        let (via_options, options) = (String::new(), String::new());
        Self { kind, via: None, via_options, target, speed, termination: Some(termination), options }
    }

    /// Decodes the text between the line's `:` and `;`.
    pub(crate) fn decode(input: &str) -> ParseResult<'_, Self> {
        let (rest, mut motion) = Self::head(input)?;
        motion.options = join_lines(rest);
        Ok(("", motion))
    }

    /// Returns the options in the text of a motion; empty if the motion cannot be decoded.
    pub(crate) fn options_place(input: &str) -> &str {
        Self::head(input).map_or("", |(rest, _)| rest)
    }

    /// Decodes all of a motion except the options, which follow.
    fn head(input: &str) -> ParseResult<'_, Self> {
        let mut letters = input.chars();
        let Some(kind) = letters.next().and_then(MotionKind::from_letter) else {
            return fail(input, Reason::Target);
        };
        let (mut rest, mut target) = Target::decode(joint(letters.as_str()))?;
        let (mut via, mut via_options) = (None, "");
        if kind == MotionKind::Circular {
            via = Some(target);
            // If the second point is on the next line, the rest of the first line belongs to the first point.
            if let Some((line, _)) = rest.split_once('\n') {
                via_options = line.trim();
                rest = rest.get(line.len()..).unwrap_or("");
            }
            (rest, target) = Target::decode(joint(rest))?;
        }
        let (rest, speed) = Speed::decode(joint(rest))?;
        let (rest, termination) = Termination::decode(joint(rest))?;
        let (options, via_options) = (String::new(), via_options.to_string());
        Ok((joint(rest), Self { kind, via, via_options, target, speed, termination, options }))
    }

    /// Writes the form that [`decode`](Self::decode) reads, with the controller's spaces before the `;`.
    pub(crate) fn encode(&self, out: &mut String) {
        out.push(self.kind.letter());
        if let Some(via) = &self.via {
            out.push(' ');
            via.encode(out);
            if !self.via_options.is_empty() {
                out.push(' ');
                out.push_str(&self.via_options);
            }
            out.push_str("    \r\n    : ");
        }
        out.push(' ');
        self.target.encode(out);
        out.push(' ');
        self.speed.encode(out);
        if let Some(termination) = &self.termination {
            out.push(' ');
            termination.encode(out);
        }
        if !self.options.is_empty() {
            out.push(' ');
            out.push_str(&self.options.replace('\n', "\r\n    :  "));
        }
        out.push_str("   ");
    }

    /// Rejects a motion that a controller would reject, or whose text would be decoded differently. `written` is its text by
    /// [`encode`](Self::encode).
    pub(crate) fn check(&self, line: usize, written: &str) -> Result<(), EncodeError> {
        if self.via.is_some() != (self.kind == MotionKind::Circular)
            || (self.via.is_none() && !self.via_options.is_empty())
        {
            return Err(EncodeError::Via { line });
        }
        if let Some(Termination::Continuous(found)) = self.termination
            && found > 100
        {
            return Err(EncodeError::Continuous { line, found });
        }
        if !self.speed.unit().is_none_or(|unit| unit.fits(self.kind)) {
            return Err(EncodeError::SpeedUnit { line });
        }
        if let Speed::Fixed { value, unit } = self.speed
            && !unit.range().contains(&value)
        {
            return Err(EncodeError::Speed { line });
        }
        // The texts inside may contain anything: the written motion must decode to the same value.
        let same = Self::decode(written.trim_end()).is_ok_and(|(_, again)| again == *self);
        let plain = match written.contains('\r') {
            true => is_plain(&written.replace("\r\n", "\n")),
            false => is_plain(written),
        };
        if same && plain { Ok(()) } else { Err(EncodeError::Instruction { line }) }
    }
}

/// How the robot moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum MotionKind {
    /// `J`: every joint arrives at the same time; the path is unspecified.
    Joint,
    /// `L`: a straight line.
    Linear,
    /// `C`: an arc through one point to another.
    Circular,
    /// `A`: an arc through the neighbouring A points.
    Arc,
    /// `S`: the Spline Motion option. The curve between the points is the controller's secret.
    Spline,
}

impl MotionKind {
    /// Returns the letter after the line's number.
    pub fn letter(self) -> char {
        match self {
            Self::Joint => 'J',
            Self::Linear => 'L',
            Self::Circular => 'C',
            Self::Arc => 'A',
            Self::Spline => 'S',
        }
    }

    pub(crate) fn from_letter(letter: char) -> Option<Self> {
        Some(match letter {
            'J' => Self::Joint,
            'L' => Self::Linear,
            'C' => Self::Circular,
            'A' => Self::Arc,
            'S' => Self::Spline,
            _ => return None,
        })
    }
}

/// The target of a motion.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Target {
    /// `P[3]` or `P[3:name]`: a position of this program.
    Position {
        /// The number of the position.
        number: u32,
        /// The name of the position; `None` if it has no name. Not quoted here; in `/POS` it is.
        #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::name))]
        name: Option<String>,
    },
    /// `PR[3]` or `PR[3:name]`: a position register.
    Register {
        /// The number of the register.
        number: u32,
        /// The name of the register; `None` if it has no name.
        #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::name))]
        name: Option<String>,
    },
    /// Another one as it stands, such as `P[R[1]]` or `PR[GP1:3]`.
    Other(#[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::target))] String),
}

impl Target {
    /// Returns `P[number]`.
    pub fn position(number: u32) -> Self {
        Self::Position { number, name: None }
    }

    /// Returns `PR[number]`.
    pub fn register(number: u32) -> Self {
        Self::Register { number, name: None }
    }

    fn decode(input: &str) -> ParseResult<'_, Self> {
        let (rest, Reference { letters, inside, .. }) = reference(input, Reason::Target)?;
        let (number, name) = match plain_number(inside) {
            Some(number) => (Some(number), None),
            None => match inside.split_once(':') {
                Some((number, name)) => (plain_number(number.trim()), Some(name.trim().to_string())),
                None => (plain_number(inside.trim()), None),
            },
        };
        let target = match (letters, number) {
            ("P", Some(number)) => Self::Position { number, name },
            ("PR", Some(number)) => Self::Register { number, name },
            _ => Self::Other(format!("{letters}[{inside}]")),
        };
        Ok((rest, target))
    }

    fn encode(&self, out: &mut String) {
        let (letters, number, name) = match self {
            Self::Position { number, name } => ("P[", number, name),
            Self::Register { number, name } => ("PR[", number, name),
            Self::Other(text) => return out.push_str(text),
        };
        out.push_str(letters);
        push_number(out, *number, 0);
        if let Some(name) = name {
            out.push(':');
            out.push_str(name);
        }
        out.push(']');
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = String::new();
        self.encode(&mut text);
        f.write_str(&text)
    }
}

/// How fast a motion is.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Speed {
    /// A number in the program: `100mm/sec`.
    Fixed {
        /// The number. Written with as many decimals as it has; seconds with at least one.
        value: f64,
        /// The unit of the speed.
        unit: SpeedUnit,
    },
    /// `R[23:slow]mm/sec`: the number is in a register.
    Register {
        /// The register as it stands.
        register: String,
        /// The unit of its number.
        unit: SpeedUnit,
    },
    /// `max_speed`, `WELD_SPEED`: a speed that has a name.
    Named(String),
}

impl Speed {
    /// Returns a share of the greatest joint speed, in %, for [`MotionKind::Joint`].
    pub fn percent(value: u8) -> Self {
        Self::Fixed { value: f64::from(value), unit: SpeedUnit::Percent }
    }

    /// Returns a path speed in mm/s.
    pub fn mm_per_sec(value: f64) -> Self {
        Self::Fixed { value, unit: SpeedUnit::MmPerSec }
    }

    /// Returns the unit, unless the speed is a name.
    pub fn unit(&self) -> Option<SpeedUnit> {
        match self {
            Self::Fixed { unit, .. } | Self::Register { unit, .. } => Some(*unit),
            Self::Named(_) => None,
        }
    }

    fn decode(input: &str) -> ParseResult<'_, Self> {
        // A template's placeholder counts as a register.
        if let Some(rest) = input.strip_prefix("...")
            && let Ok((rest, unit)) = SpeedUnit::decode(rest)
        {
            return Ok((rest, Self::Register { register: "...".to_string(), unit }));
        }
        let letters = input.find(|c: char| !(c.is_ascii_alphabetic() || c == '_' || c == '.'));
        let letters = letters.unwrap_or(input.len());
        let (word, behind) = input.split_at_checked(letters).unwrap_or(("", input));
        if !word.is_empty() && behind.starts_with('[') {
            let (rest, register) = reference(input, Reason::Speed)?;
            let (rest, unit) = SpeedUnit::decode(joint(rest))?;
            return Ok((rest, Self::Register { register: register.text.to_string(), unit }));
        }
        let alone = behind.is_empty() || behind.starts_with([' ', '\t', '\r', '\n']);
        if !word.is_empty() && alone && Termination::decode(input).is_ok_and(|(_, found)| found.is_none()) {
            return Ok((behind, Self::Named(word.to_string())));
        }
        let (rest, value) = or_fail(input, Reason::Speed, decimal)?;
        let (rest, unit) = SpeedUnit::decode(joint(rest))?;
        Ok((rest, Self::Fixed { value, unit }))
    }

    fn encode(&self, out: &mut String) {
        match self {
            // Controllers print `0.6sec` and `2.0sec`.
            Self::Fixed { value, unit: SpeedUnit::Sec } => {
                let tenths = format!("{value:.1}");
                let exact = if tenths.parse() == Ok(*value) { tenths } else { format!("{value}") };
                out.push_str(&exact);
            }
            Self::Fixed { value, .. } => push_shortest(out, *value),
            Self::Register { register, .. } => out.push_str(register),
            Self::Named(name) => out.push_str(name),
        }
        out.push_str(self.unit().map_or("", SpeedUnit::text));
    }
}

impl fmt::Display for Speed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = String::new();
        self.encode(&mut text);
        f.write_str(&text)
    }
}

/// The unit of a speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum SpeedUnit {
    /// `%`: the share of the joints' greatest speeds.
    Percent,
    /// `sec`: the time of the motion in s.
    Sec,
    /// `msec`: the time of the motion in ms.
    Msec,
    /// `mm/sec`: the speed of the tool in mm/s.
    MmPerSec,
    /// `cm/min`: the speed of the tool in cm/min.
    CmPerMin,
    /// `inch/min`: the speed of the tool in inches a minute.
    InchPerMin,
    /// `deg/sec`: the rotation of the tool in degrees a second.
    DegPerSec,
}

impl SpeedUnit {
    /// Returns the numbers that are allowed with this unit: above 0 to 100 for %, above 0 to 100 000 for the others (a
    /// controller's own limits are narrower and depend on the robot).
    pub fn range(self) -> core::ops::RangeInclusive<f64> {
        match self {
            Self::Percent => 0.001..=100.0,
            _ => 0.001..=100_000.0,
        }
    }

    /// Returns whether motions of this kind have this unit: joint motions have %, sec and msec; the others have all units
    /// except %.
    pub fn fits(self, kind: MotionKind) -> bool {
        match self {
            Self::Percent => kind == MotionKind::Joint,
            Self::Sec | Self::Msec => true,
            Self::MmPerSec | Self::CmPerMin | Self::InchPerMin | Self::DegPerSec => kind != MotionKind::Joint,
        }
    }

    fn decode(input: &str) -> ParseResult<'_, Self> {
        // Controllers set to German print `sek`.
        let (unit, length) = match input.as_bytes() {
            [b'%', ..] => (Self::Percent, 1),
            [b's', b'e', b'c' | b'k', ..] => (Self::Sec, 3),
            [b'm', b's', b'e', b'c' | b'k', ..] => (Self::Msec, 4),
            [b'm', b'm', b'/', b's', b'e', b'c' | b'k', ..] => (Self::MmPerSec, 6),
            [b'c', b'm', b'/', b'm', b'i', b'n', ..] => (Self::CmPerMin, 6),
            [b'i', b'n', b'c', b'h', b'/', b'm', b'i', b'n', ..] => (Self::InchPerMin, 8),
            [b'd', b'e', b'g', b'/', b's', b'e', b'c' | b'k', ..] => (Self::DegPerSec, 7),
            _ => return fail(input, Reason::SpeedUnit),
        };
        let rest = input.get(length..).unwrap_or("");
        if unit != Self::Percent && rest.starts_with(|c| is_letter_or_digit(c) || c == '/') {
            return fail(input, Reason::SpeedUnit);
        }
        Ok((rest, unit))
    }

    fn text(self) -> &'static str {
        match self {
            Self::Percent => "%",
            Self::Sec => "sec",
            Self::Msec => "msec",
            Self::MmPerSec => "mm/sec",
            Self::CmPerMin => "cm/min",
            Self::InchPerMin => "inch/min",
            Self::DegPerSec => "deg/sec",
        }
    }
}

impl fmt::Display for SpeedUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

/// How close a motion comes to its target before the next one begins.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum Termination {
    /// `FINE`: stops at the target.
    Fine,
    /// `CNT0` to `CNT100`: passes by the target; the exact effect of the number is not published.
    Continuous(#[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::percent))] u8),
    /// `CNT R[1]`: the number is in a register, given as it stands.
    ContinuousRegister(
        #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::register))] String,
    ),
}

impl Termination {
    /// Decodes a termination; `None` if other text follows, which is then an option.
    fn decode(input: &str) -> ParseResult<'_, Option<Self>> {
        let ends = |rest: &str| !rest.starts_with(|c| is_letter_or_digit(c) || c == '_');
        if let Some(rest) = input.strip_prefix("FINE").filter(|rest| ends(rest)) {
            return Ok((rest, Some(Self::Fine)));
        }
        let Some(rest) = input.strip_prefix("CNT") else { return Ok((input, None)) };
        let number = joint(rest);
        if number.starts_with(|c: char| c.is_ascii_alphabetic()) {
            let (rest, register) = reference(number, Reason::Continuous)?;
            return Ok((rest, Some(Self::ContinuousRegister(register.text.to_string()))));
        }
        let (after, value) = or_fail(number, Reason::Continuous, unsigned::<u8>)?;
        // Options may follow without a blank: `CNT100TB   .50sec`.
        if value > 100 || after.starts_with(['.', '_']) {
            return fail(number, Reason::Continuous);
        }
        Ok((after, Some(Self::Continuous(value))))
    }

    fn encode(&self, out: &mut String) {
        match self {
            Self::Fine => out.push_str("FINE"),
            Self::Continuous(value) => {
                out.push_str("CNT");
                push_number(out, (*value).into(), 0);
            }
            Self::ContinuousRegister(register) => {
                out.push_str("CNT ");
                out.push_str(register);
            }
        }
    }
}

impl fmt::Display for Termination {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut text = String::new();
        self.encode(&mut text);
        f.write_str(&text)
    }
}
