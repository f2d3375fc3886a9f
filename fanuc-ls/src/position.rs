use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

use crate::cursor::Cursor;
use crate::error::{EncodeError, Reason};
use crate::text::{Fault, fixed_decimal, push_fixed, push_number, rounded, word};

/// A position of `/POS`: `P[1:"name"]{ … };`
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Position {
    /// The number of the position.
    pub number: u32,
    /// The name of the position, without the quotes that it has in `/POS`.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::name))]
    pub name: Option<String>,
    /// The position of each motion group. Most cells have one, `GP1`.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::list::<1, 2, _>))]
    pub groups: Vec<Group>,
}

impl Position {
    /// Returns whether one of the coordinates has a value.
    pub(crate) fn is_taught(&self) -> bool {
        self.groups.iter().flat_map(|group| &group.axes).any(|axis| axis.value.is_some())
    }

    /// Creates a position of the first motion group, without a name.
    pub fn new(number: u32, group: Group) -> Self {
        Self { number, name: None, groups: vec![group] }
    }

    /// Returns the first group's joint angles, if they are given as six joints in degrees.
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

    /// Reads a block of `/POS`: exactly one position.
    pub(crate) fn decode_block(block: &str) -> Result<Self, Fault<'_>> {
        let mut cursor = Cursor::new(block);
        let position = Self::decode(&mut cursor)?;
        if cursor.bytes().is_empty() || cursor.rest().trim().is_empty() {
            Ok(position)
        } else {
            Err(cursor.fault(Reason::Position))
        }
    }

    fn decode<'a>(cursor: &mut Cursor<'a>) -> Result<Self, Fault<'a>> {
        if !cursor.take("P[") {
            return Err(cursor.fault(Reason::Position));
        }
        cursor.space();
        let number = cursor.number(Reason::Position)?;
        cursor.space();
        let mut name = None;
        if cursor.take(":") {
            cursor.space();
            name = Some(decode_name(cursor)?.to_string());
        }
        cursor.expect_all("]{\r\n   ", &[("]", Reason::Position), ("{", Reason::Position)])?;
        let mut groups = Vec::with_capacity(1);
        while cursor.take("GP") {
            groups.push(Group::decode(cursor)?);
            cursor.space();
        }
        cursor.expect_all("};\r\n", &[("}", Reason::Group), (";", Reason::Group)])?;
        Ok(Self { number, name, groups })
    }

    pub(crate) fn encode(&self, out: &mut String) {
        out.push_str("P[");
        push_number(out, self.number, 0);
        if let Some(name) = &self.name {
            out.push_str(":\"");
            out.push_str(name);
            out.push('"');
        }
        out.push_str("]{\r\n");
        for group in &self.groups {
            group.encode(out);
        }
        out.push_str("};\r\n");
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

/// The position of one motion group.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Group {
    /// The number of the motion group: 1 for `GP1`.
    pub number: u8,
    /// `UF`: the number of the user frame. `None` for `F`, the frame that is active when the program runs.
    pub user_frame: Option<u16>,
    /// `UT`: the number of the tool frame. `None` for `F`, the tool that is active when the program runs.
    pub user_tool: Option<u16>,
    /// The arm's solution that a Cartesian position means. `None` for joints.
    pub configuration: Option<Configuration>,
    /// The coordinates, in their order.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::list::<1, 9, _>))]
    pub axes: Vec<Axis>,
}

impl Group {
    /// Creates `GP1` from its joint angles, in degrees, as the controller shows them (J3 from the horizontal), to three
    /// decimals.
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

    /// Creates `GP1` from X, Y, Z in mm and W, P, R in degrees, to three decimals.
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

    /// Reads the text after `GP`.
    fn decode<'a>(cursor: &mut Cursor<'a>) -> Result<Self, Fault<'a>> {
        let number = cursor.number(Reason::Group)?;
        let uf = [(":", Reason::Group), ("UF", Reason::Frames), (":", Reason::Frames)];
        cursor.expect_all(":\r\n\tUF : ", &uf)?;
        let user_frame = decode_frame(cursor)?;
        let ut = [",", "UT", ":"].map(|word| (word, Reason::Frames));
        cursor.expect_all(", UT : ", &ut)?;
        let user_tool = decode_frame(cursor)?;
        cursor.expect_all(",\t\r\n\t", &[(",", Reason::Frames)])?;
        let mut configuration = None;
        // A keyword is longer than the name of an axis.
        if !matches!(cursor.bytes(), [_, b' ' | b'=', ..] | [_, _, b' ' | b'=', ..])
            && let Ok((_, keyword)) = word(cursor.rest())
            && keyword.chars().count() > 2
        {
            cursor.advance(keyword.len());
            cursor.expect(":", Reason::Configuration)?;
            let text = decode_quoted(cursor)?;
            cursor.expect(",", Reason::Configuration)?;
            cursor.space();
            configuration = Some(Configuration { keyword: keyword.to_string(), text: text.to_string() });
        }
        let mut axes = Vec::with_capacity(6);
        loop {
            axes.push(Axis::decode(cursor)?);
            if cursor.take(",\t") || cursor.take(",\r\n\t") {
                cursor.space();
                continue;
            }
            cursor.space();
            // Old controllers omit the comma between untaught values.
            if !cursor.take(",") && AxisName::decode(&mut { *cursor }).is_err() {
                return Ok(Self { number, user_frame, user_tool, configuration, axes });
            }
            cursor.space();
        }
    }

    fn encode(&self, out: &mut String) {
        out.push_str("   GP");
        push_number(out, self.number.into(), 0);
        out.push_str(":\r\n\tUF : ");
        encode_frame(out, self.user_frame);
        out.push_str(", UT : ");
        encode_frame(out, self.user_tool);
        out.push_str(",\t");
        if let Some(Configuration { keyword, text }) = &self.configuration {
            for part in ["\t", keyword, " : '", text, "',"] {
                out.push_str(part);
            }
        }
        out.push_str("\r\n");
        for (index, axis) in self.axes.iter().enumerate() {
            out.push_str(match index {
                0 => "\t",
                _ if index % 3 == 0 => ",\r\n\t",
                _ => ",\t",
            });
            axis.encode(out);
        }
        out.push_str("\r\n");
    }

    fn is_writable(&self) -> bool {
        let configuration = self.configuration.as_ref().is_none_or(|c| {
            let plain = !c.text.contains(|c: char| c.is_control() || c == '\'');
            plain && c.keyword.chars().count() > 2 && word(&c.keyword).is_ok_and(|(rest, _)| rest.is_empty())
        });
        configuration && !self.axes.is_empty() && self.axes.iter().all(Axis::is_writable)
    }
}

/// The arm's solution that a Cartesian position means, as spelled: `N U T, 0, 0, 0`.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Configuration {
    /// `CONFIG`; controllers set to German print `KONFIG`.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::keyword))]
    pub keyword: String,
    /// N or F (wrist not flipped, flipped), U or D (elbow up, down), T or B (arm in front, behind), and the turns of
    /// three joints.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::solution))]
    pub text: String,
}

impl Configuration {
    /// Creates the configuration with this text, under the keyword `CONFIG`.
    pub fn new(text: &str) -> Self {
        Self { keyword: "CONFIG".to_string(), text: text.to_string() }
    }
}

/// One coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Axis {
    /// The name of the axis.
    pub name: AxisName,
    /// The value; `None` if it was never taught (`********`). Written with three decimals, as controllers do, or with as many as
    /// it has.
    #[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::coordinate))]
    pub value: Option<f64>,
    /// The unit of the value.
    pub unit: AxisUnit,
}

impl Axis {
    fn decode<'a>(cursor: &mut Cursor<'a>) -> Result<Self, Fault<'a>> {
        let name = AxisName::decode(cursor)?;
        cursor.expect("=", Reason::Axis)?;
        if let Some((columns, unit)) = cursor.bytes().split_first_chunk()
            && let Some(unit) = AxisUnit::printed(unit)
            && let Some(value) = fixed_decimal(columns)
        {
            cursor.advance(14);
            return Ok(Self { name, value: Some(value), unit });
        }
        cursor.columns();
        let mut value = None;
        if cursor.take("*") {
            while cursor.take("*") {}
        } else {
            value = Some(cursor.decimal(Reason::Number)?);
        }
        cursor.space();
        for (unit, text) in [(AxisUnit::Deg, "deg"), (AxisUnit::Mm, "mm")] {
            if cursor.take(text) {
                return Ok(Self { name, value, unit });
            }
        }
        Err(cursor.fault(Reason::AxisUnit))
    }

    fn encode(&self, out: &mut String) {
        out.push_str(self.name.text());
        match self.value {
            Some(value) => push_fixed(out, value),
            None => out.push_str("  ********"),
        }
        out.push_str(match self.unit {
            AxisUnit::Deg => " deg",
            AxisUnit::Mm => "  mm",
        });
    }

    fn is_writable(&self) -> bool {
        let name = match self.name {
            AxisName::J(number) | AxisName::E(number) => (1..=9).contains(&number),
            _ => true,
        };
        name && self.value.is_none_or(f64::is_finite)
    }
}

/// The name of a coordinate. With `serde` it is its text: `X`, `RX`, `J1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum AxisName {
    /// X of the tool, in mm.
    X,
    /// Y of the tool, in mm.
    Y,
    /// Z of the tool, in mm.
    Z,
    /// The tool's turn about X, in degrees.
    W,
    /// The tool's turn about Y, in degrees.
    P,
    /// The tool's turn about Z, in degrees.
    R,
    /// `RX`, in mm.
    RX,
    /// `RY`, in mm.
    RY,
    /// `RZ`, in mm.
    RZ,
    /// `RW`, in degrees.
    RW,
    /// `RP`, in degrees.
    RP,
    /// `RR`, in degrees.
    RR,
    /// A joint, `J1` to `J9`, in degrees or mm.
    J(#[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::digit))] u8),
    /// An axis of an external drive, `E1` to `E9`, in degrees or mm.
    E(#[cfg_attr(feature = "arbitrary", arbitrary(with = crate::arbitrary::texts::digit))] u8),
}

impl AxisName {
    #[inline(always)]
    fn decode<'a>(cursor: &mut Cursor<'a>) -> Result<Self, Fault<'a>> {
        let (name, length) = match cursor.bytes() {
            [b'J', digit @ b'1'..=b'9', ..] => (Self::J(digit - b'0'), 2),
            [b'E', digit @ b'1'..=b'9', ..] => (Self::E(digit - b'0'), 2),
            [b'R', b'X', ..] => (Self::RX, 2),
            [b'R', b'Y', ..] => (Self::RY, 2),
            [b'R', b'Z', ..] => (Self::RZ, 2),
            [b'R', b'W', ..] => (Self::RW, 2),
            [b'R', b'P', ..] => (Self::RP, 2),
            [b'R', b'R', ..] => (Self::RR, 2),
            [b'X', ..] => (Self::X, 1),
            [b'Y', ..] => (Self::Y, 1),
            [b'Z', ..] => (Self::Z, 1),
            [b'W', ..] => (Self::W, 1),
            [b'P', ..] => (Self::P, 1),
            [b'R', ..] => (Self::R, 1),
            _ => return Err(cursor.fault(Reason::Axis)),
        };
        cursor.advance(length);
        Ok(name)
    }

    /// Returns the name, such as `X` or `J1`.
    pub fn name(self) -> &'static str {
        self.text().trim_end_matches([' ', '='])
    }

    /// Returns the name as it is written before a value.
    fn text(self) -> &'static str {
        const J: [&str; 9] = ["J1=", "J2=", "J3=", "J4=", "J5=", "J6=", "J7=", "J8=", "J9="];
        const E: [&str; 9] = ["E1=", "E2=", "E3=", "E4=", "E5=", "E6=", "E7=", "E8=", "E9="];
        let of = |names: &[&'static str], number: u8| {
            names.get(usize::from(number).wrapping_sub(1)).copied().unwrap_or("")
        };
        match self {
            Self::X => "X =",
            Self::Y => "Y =",
            Self::Z => "Z =",
            Self::W => "W =",
            Self::P => "P =",
            Self::R => "R =",
            Self::RX => "RX =",
            Self::RY => "RY =",
            Self::RZ => "RZ =",
            Self::RW => "RW =",
            Self::RP => "RP =",
            Self::RR => "RR =",
            Self::J(number) => of(&J, number),
            Self::E(number) => of(&E, number),
        }
    }
}

#[cfg(feature = "serde")]
impl serde::Serialize for AxisName {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

#[cfg(feature = "serde")]
impl<'de> serde::Deserialize<'de> for AxisName {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let mut cursor = Cursor::new(&text);
        let name = Self::decode(&mut cursor).ok().filter(|_| cursor.rest().is_empty());
        name.ok_or_else(|| {
            serde::de::Error::custom("no axis: X, Y, Z, W, P, R, RX to RR, J1 to J9, E1 to E9")
        })
    }
}

/// The unit of a coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum AxisUnit {
    /// Degrees: `deg`.
    Deg,
    /// Millimetres: `mm`.
    Mm,
}

impl AxisUnit {
    /// Reads the unit after ten columns, as controllers print it.
    #[inline(always)]
    fn printed(text: &[u8]) -> Option<Self> {
        match text {
            [b' ', b'd', b'e', b'g', ..] => Some(Self::Deg),
            [b' ', b' ', b'm', b'm', ..] => Some(Self::Mm),
            _ => None,
        }
    }
}

#[inline(always)]
fn decode_frame<'a>(cursor: &mut Cursor<'a>) -> Result<Option<u16>, Fault<'a>> {
    if cursor.take("F") { Ok(None) } else { cursor.number(Reason::Frames).map(Some) }
}

fn encode_frame(out: &mut String, frame: Option<u16>) {
    match frame {
        Some(number) => push_number(out, number.into(), 0),
        None => out.push('F'),
    }
}

/// Decodes a name in quotes; a few programs that write LS omit them.
fn decode_name<'a>(cursor: &mut Cursor<'a>) -> Result<&'a str, Fault<'a>> {
    let start = *cursor;
    let end = if cursor.take("\"") { '"' } else { ']' };
    let rest = cursor.rest();
    let name = rest.find([end, '\r', '\n']).and_then(|length| rest.split_at_checked(length));
    match name.filter(|(_, after)| after.starts_with(end)) {
        Some((name, _)) => {
            cursor.advance(name.len());
            cursor.take("\"");
            Ok(name.trim())
        }
        None => Err(start.fault(Reason::Position)),
    }
}

fn decode_quoted<'a>(cursor: &mut Cursor<'a>) -> Result<&'a str, Fault<'a>> {
    cursor.space();
    let start = *cursor;
    cursor.expect("'", Reason::Configuration)?;
    let rest = cursor.rest();
    let text = rest.find(['\'', '\r', '\n']).and_then(|length| rest.split_at_checked(length));
    match text.filter(|(_, after)| after.starts_with('\'')) {
        Some((text, _)) => {
            cursor.advance(text.len() + 1);
            Ok(text)
        }
        None => Err(start.fault(Reason::Configuration)),
    }
}
