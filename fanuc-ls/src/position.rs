use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

use nom::bytes::complete::take_while1;

use crate::error::{EncodeError, Reason};
use crate::text::{Fault, Read, decimal, expect, fail, fixed, or_fail, rounded, space, unsigned, word};

/// A position of `/POS`: `P[1:"name"]{ … };`
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Position {
    /// Its number.
    pub number: u32,
    /// Its name, without the quotes that it has in `/POS`.
    pub name: Option<String>,
    /// Where each motion group stands. Most cells have one, `GP1`.
    pub groups: Vec<Group>,
}

impl Position {
    /// A position of the first motion group, without a name.
    pub fn new(number: u32, group: Group) -> Self {
        Self { number, name: None, groups: vec![group] }
    }

    /// The first group's joint angles, where they are given as six joints in degrees.
    pub fn joints(&self) -> Option<[f64; 6]> {
        let axes = self.groups.first()?.axes.get(..6)?;
        let mut joints = [0.0; 6];
        for ((axis, number), joint) in axes.iter().zip(1..).zip(&mut joints) {
            if axis.name != AxisName::J(number) || axis.unit != AxisUnit::Deg {
                return None;
            }
            *joint = axis.value?;
        }
        Some(joints)
    }

    /// Reads a block of `/POS`: one position and nothing else.
    pub(crate) fn decode_block(block: &str) -> Result<Self, Fault<'_>> {
        match Self::decode(block) {
            Ok((rest, position)) if rest.trim().is_empty() => Ok(position),
            Ok((rest, _)) => Err(Fault { at: space(rest), reason: Reason::Position }),
            Err(error) => Err(Fault::of(error)),
        }
    }

    fn decode(input: &str) -> Read<'_, Self> {
        let (rest, _) = expect(input, "P[", Reason::Position)?;
        let (rest, number) = or_fail(space(rest), Reason::Position, unsigned)?;
        let mut rest = space(rest);
        let mut name = None;
        if let Some(after) = rest.strip_prefix(':') {
            let (after, text) = decode_name(space(after))?;
            name = Some(text.to_string());
            rest = space(after);
        }
        let (rest, _) = expect(rest, "]", Reason::Position)?;
        let (rest, _) = expect(space(rest), "{", Reason::Position)?;
        let mut rest = space(rest);
        let mut groups = Vec::new();
        while rest.starts_with("GP") {
            let (after, group) = Group::decode(rest)?;
            groups.push(group);
            rest = space(after);
        }
        let (after, _) = expect(rest, "}", Reason::Group)?;
        let (after, _) = expect(space(after), ";", Reason::Group)?;
        Ok((after, Self { number, name, groups }))
    }

    pub(crate) fn encode(&self, out: &mut impl fmt::Write) -> fmt::Result {
        match &self.name {
            Some(name) => write!(out, "P[{}:\"{name}\"]{{\r\n", self.number)?,
            None => write!(out, "P[{}]{{\r\n", self.number)?,
        }
        for group in &self.groups {
            group.encode(out)?;
        }
        write!(out, "}};\r\n")
    }

    pub(crate) fn check(&self) -> Result<(), EncodeError> {
        let plain = |text: &str| !text.contains(|c: char| c.is_control() || c == '"');
        let name = self.name.as_deref().is_none_or(|name| plain(name) && name.trim() == name);
        if name && !self.groups.is_empty() && self.groups.iter().all(Group::is_writable) {
            Ok(())
        } else {
            Err(EncodeError::Position { number: self.number })
        }
    }
}

/// Where one motion group stands.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Group {
    /// 1 for `GP1`.
    pub number: u8,
    /// `UF`. None for `F`, the frame that is active when the program runs.
    pub user_frame: Option<u16>,
    /// `UT`. None for `F`.
    pub user_tool: Option<u16>,
    /// Which of the arm's solutions a Cartesian position means. None for joints.
    pub configuration: Option<Configuration>,
    /// The coordinates, in their order.
    pub axes: Vec<Axis>,
}

impl Group {
    /// `GP1` by its joint angles, in degrees, as the controller shows them (J3 from the horizontal), to three decimals.
    pub fn joints(user_frame: u16, user_tool: u16, degrees: [f64; 6]) -> Self {
        let axis = |(number, value)| Axis {
            name: AxisName::J(number),
            value: Some(rounded(value)),
            unit: AxisUnit::Deg,
        };
        Self {
            number: 1,
            user_frame: Some(user_frame),
            user_tool: Some(user_tool),
            configuration: None,
            axes: (1..).zip(degrees).map(axis).collect(),
        }
    }

    /// `GP1` by X, Y, Z in mm and W, P, R in degrees, to three decimals.
    pub fn cartesian(
        user_frame: u16,
        user_tool: u16,
        xyzwpr: [f64; 6],
        configuration: Configuration,
    ) -> Self {
        use AxisName::{P, R, W, X, Y, Z};
        let axis = |(name, value)| {
            let unit = if matches!(name, X | Y | Z) { AxisUnit::Mm } else { AxisUnit::Deg };
            Axis { name, value: Some(rounded(value)), unit }
        };
        Self {
            number: 1,
            user_frame: Some(user_frame),
            user_tool: Some(user_tool),
            configuration: Some(configuration),
            axes: [X, Y, Z, W, P, R].into_iter().zip(xyzwpr).map(axis).collect(),
        }
    }

    fn decode(input: &str) -> Read<'_, Self> {
        let (rest, _) = expect(input, "GP", Reason::Group)?;
        let (rest, number) = or_fail(rest, Reason::Group, unsigned)?;
        let (rest, _) = expect(space(rest), ":", Reason::Group)?;
        let (rest, user_frame) = decode_frame(space(rest), "UF")?;
        let (rest, _) = expect(space(rest), ",", Reason::Frames)?;
        let (rest, user_tool) = decode_frame(space(rest), "UT")?;
        let (rest, _) = expect(space(rest), ",", Reason::Frames)?;
        let mut rest = space(rest);
        let mut configuration = None;
        if let Ok((after, keyword)) = word(rest)
            && keyword.len() > 2
        {
            let (after, _) = expect(space(after), ":", Reason::Configuration)?;
            let (after, text) = decode_quoted(space(after))?;
            let (after, _) = expect(space(after), ",", Reason::Configuration)?;
            configuration = Some(Configuration { keyword: keyword.to_string(), text: text.to_string() });
            rest = space(after);
        }
        let mut axes = Vec::new();
        loop {
            let (after, axis) = Axis::decode(rest)?;
            axes.push(axis);
            let next = space(after);
            match next.strip_prefix(',') {
                Some(next) => rest = space(next),
                // Old controllers leave it out between what was never taught.
                None if AxisName::decode(next).is_ok() => rest = next,
                None => return Ok((after, Self { number, user_frame, user_tool, configuration, axes })),
            }
        }
    }

    fn encode(&self, out: &mut impl fmt::Write) -> fmt::Result {
        write!(out, "   GP{}:\r\n\tUF : ", self.number)?;
        encode_frame(out, self.user_frame)?;
        out.write_str(", UT : ")?;
        encode_frame(out, self.user_tool)?;
        match &self.configuration {
            Some(Configuration { keyword, text }) => write!(out, ",\t\t{keyword} : '{text}',\r\n")?,
            None => out.write_str(",\t\r\n")?,
        }
        for (index, axis) in self.axes.iter().enumerate() {
            let before = match index {
                0 => "\t",
                _ if index % 3 == 0 => ",\r\n\t",
                _ => ",\t",
            };
            out.write_str(before)?;
            axis.encode(out)?;
        }
        out.write_str("\r\n")
    }

    fn is_writable(&self) -> bool {
        let configuration = self.configuration.as_ref().is_none_or(|c| {
            let plain = !c.text.contains(|c: char| c.is_control() || c == '\'');
            plain && c.keyword.len() > 2 && word(&c.keyword).is_ok_and(|(rest, _)| rest.is_empty())
        });
        configuration && !self.axes.is_empty() && self.axes.iter().all(Axis::is_writable)
    }
}

/// Which of the arm's solutions a Cartesian position means, as it stands: `N U T, 0, 0, 0`.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Configuration {
    /// `CONFIG`; controllers set to German say `KONFIG`.
    pub keyword: String,
    /// N or F (wrist not flipped, flipped), U or D (elbow up, down), T or B (arm in front, behind), and the turns of
    /// three joints.
    pub text: String,
}

impl Configuration {
    /// The configuration with this text, under the keyword `CONFIG`.
    pub fn new(text: &str) -> Self {
        Self { keyword: "CONFIG".to_string(), text: text.to_string() }
    }
}

/// One coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Axis {
    /// Which.
    pub name: AxisName,
    /// Its value; None when it was never taught (`********`). Written with three decimals, as controllers do, or with as
    /// many as it has.
    pub value: Option<f64>,
    /// Its unit.
    pub unit: AxisUnit,
}

impl Axis {
    fn decode(input: &str) -> Read<'_, Self> {
        let (rest, name) = AxisName::decode(input)?;
        let (rest, _) = expect(space(rest), "=", Reason::Axis)?;
        let rest = space(rest);
        let stars: Read<'_, &str> = nom::Parser::parse(&mut take_while1(|c| c == '*'), rest);
        let (rest, value) = match stars {
            Ok((rest, _)) => (rest, None),
            Err(_) => {
                let (rest, value) = or_fail(rest, Reason::Number, decimal)?;
                (rest, Some(value))
            }
        };
        let rest = space(rest);
        for (unit, text) in [(AxisUnit::Deg, "deg"), (AxisUnit::Mm, "mm")] {
            if let Some(after) = rest.strip_prefix(text) {
                return Ok((after, Self { name, value, unit }));
            }
        }
        fail(rest, Reason::AxisUnit)
    }

    fn encode(&self, out: &mut impl fmt::Write) -> fmt::Result {
        let value = self.value.map_or("********".to_string(), fixed);
        let unit = match self.unit {
            AxisUnit::Deg => "deg",
            AxisUnit::Mm => "mm",
        };
        self.name.encode(out)?;
        write!(out, "={value:>10} {unit:>3}")
    }

    fn is_writable(&self) -> bool {
        let name = match self.name {
            AxisName::J(number) | AxisName::E(number) => (1..=9).contains(&number),
            _ => true,
        };
        name && self.value.is_none_or(f64::is_finite)
    }
}

/// The name of a coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[allow(missing_docs, reason = "they are what they say")]
pub enum AxisName {
    X,
    Y,
    Z,
    W,
    P,
    R,
    RX,
    RY,
    RZ,
    RW,
    RP,
    RR,
    /// `J1` to `J9`.
    J(u8),
    /// `E1` to `E9`: an axis of an external drive.
    E(u8),
}

impl AxisName {
    fn decode(input: &str) -> Read<'_, Self> {
        let mut chars = input.chars();
        let letter = chars.next();
        let plain = |name| Ok((chars.as_str(), name));
        match letter {
            Some('X') => plain(Self::X),
            Some('Y') => plain(Self::Y),
            Some('Z') => plain(Self::Z),
            Some('W') => plain(Self::W),
            Some('P') => plain(Self::P),
            Some('R') => {
                let name = match chars.clone().next() {
                    Some('X') => Self::RX,
                    Some('Y') => Self::RY,
                    Some('Z') => Self::RZ,
                    Some('W') => Self::RW,
                    Some('P') => Self::RP,
                    Some('R') => Self::RR,
                    _ => return plain(Self::R),
                };
                Ok((input.get(2..).unwrap_or(""), name))
            }
            Some(letter @ ('J' | 'E')) => {
                let digit = chars.next().and_then(|c| c.to_digit(10)).and_then(|d| u8::try_from(d).ok());
                match digit {
                    Some(number @ 1..) if letter == 'J' => Ok((chars.as_str(), Self::J(number))),
                    Some(number @ 1..) => Ok((chars.as_str(), Self::E(number))),
                    _ => fail(input, Reason::Axis),
                }
            }
            _ => fail(input, Reason::Axis),
        }
    }

    fn encode(self, out: &mut impl fmt::Write) -> fmt::Result {
        out.write_str(match self {
            Self::X => "X ",
            Self::Y => "Y ",
            Self::Z => "Z ",
            Self::W => "W ",
            Self::P => "P ",
            Self::R => "R ",
            Self::RX => "RX ",
            Self::RY => "RY ",
            Self::RZ => "RZ ",
            Self::RW => "RW ",
            Self::RP => "RP ",
            Self::RR => "RR ",
            Self::J(number) => return write!(out, "J{number}"),
            Self::E(number) => return write!(out, "E{number}"),
        })
    }
}

/// The unit of a coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[allow(missing_docs, reason = "they are what they say")]
pub enum AxisUnit {
    Deg,
    Mm,
}

fn decode_frame<'a>(input: &'a str, name: &'static str) -> Read<'a, Option<u16>> {
    let (rest, _) = expect(input, name, Reason::Frames)?;
    let (rest, _) = expect(space(rest), ":", Reason::Frames)?;
    let rest = space(rest);
    match rest.strip_prefix('F') {
        Some(rest) => Ok((rest, None)),
        None => {
            let (rest, number) = or_fail(rest, Reason::Frames, unsigned)?;
            Ok((rest, Some(number)))
        }
    }
}

fn encode_frame(out: &mut impl fmt::Write, frame: Option<u16>) -> fmt::Result {
    match frame {
        Some(number) => write!(out, "{number}"),
        None => out.write_str("F"),
    }
}

/// A name in quotes; a few programs that write LS leave them out.
fn decode_name(input: &str) -> Read<'_, &str> {
    let (text, end) = match input.strip_prefix('"') {
        Some(text) => (text, '"'),
        None => (input, ']'),
    };
    let length = text.find([end, '\r', '\n']).unwrap_or(text.len());
    let (name, rest) = text.split_at_checked(length).unwrap_or((text, ""));
    if !rest.starts_with(end) {
        return fail(input, Reason::Position);
    }
    Ok((rest.strip_prefix('"').unwrap_or(rest), name.trim()))
}

fn decode_quoted(input: &str) -> Read<'_, &str> {
    let (text, _) = expect(input, "'", Reason::Configuration)?;
    let length = text.find(['\'', '\r', '\n']).unwrap_or(text.len());
    let (inside, rest) = text.split_at_checked(length).unwrap_or((text, ""));
    let (rest, _) =
        expect(rest, "'", Reason::Configuration).or_else(|_| fail(input, Reason::Configuration))?;
    Ok((rest, inside))
}
