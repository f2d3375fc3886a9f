use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;
use core::fmt;
use core::ops::RangeInclusive;

/// A value or a condition in an instruction: `R[1:count]+1`, `(DI[3] AND !F[2]=ON)`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Expression {
    /// A number: `0.5`.
    Number(f64),
    /// A text: `'text'`, without the quotes.
    Text(String),
    /// `ON`: the signal is on.
    On,
    /// `OFF`: the signal is off.
    Off,
    /// `ON+`: OFF before, ON now. Conditions outside of mixed logic have it.
    Rising,
    /// `OFF-`: ON before, OFF now. Conditions outside of mixed logic have it.
    Falling,
    /// `LPOS`: the position of the robot, in X Y Z W P R.
    CartesianPosition,
    /// `JPOS`: the position of the robot, by its joints.
    JointPosition,
    /// The value of a register, a signal or another item: `R[1]`.
    Item(Item),
    /// `$MCR.$GENOVERRIDE`: a system variable as it stands.
    System(String),
    /// The negation of a condition: `!DI[1]`.
    Not(Box<Expression>),
    /// The negative of a number: `-R[1]`.
    Negative(Box<Expression>),
    /// An operator and the expressions on its two sides: `R[1]+1`.
    Binary(Operator, Box<(Expression, Expression)>),
    /// A function and its arguments: `ABS[R[1]]`, `SUBSTR SR[1],1,2`.
    Call(Function, Vec<Expression>),
    /// `[1,R[2],*]`: a row, a column and a layer of a pallet, as they stand.
    Pallet(String),
    /// `...` or `Constant`: a template's placeholder.
    Untaught,
}

impl Expression {
    /// Returns the number, if the expression is a number.
    pub(crate) fn constant(&self) -> Option<f64> {
        match self {
            Self::Number(number) => Some(*number),
            Self::Negative(inner) => inner.constant().map(|number| -number),
            _ => None,
        }
    }

    /// Calls `visit` with everything that it is made of.
    pub(crate) fn visit<'a>(&'a self, visit: &mut impl FnMut(&'a Self)) {
        visit(self);
        match self {
            Self::Not(inner) | Self::Negative(inner) => inner.visit(visit),
            Self::Binary(_, sides) => {
                sides.0.visit(visit);
                sides.1.visit(visit);
            }
            Self::Call(_, values) => values.iter().for_each(|value| value.visit(visit)),
            _ => {}
        }
    }
}

impl From<Index> for Expression {
    fn from(index: Index) -> Self {
        match index {
            Index::Number(number) => Self::Number(number.into()),
            Index::Item(item) => Self::Item(*item),
            Index::Untaught => Self::Untaught,
        }
    }
}

/// A function of numbers or of strings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Function {
    /// `ABS`: the absolute value.
    Abs,
    /// `SQRT`: the square root.
    SquareRoot,
    /// `SIN`: the sine of an angle in degrees.
    Sine,
    /// `COS`: the cosine of an angle in degrees.
    Cosine,
    /// `TAN`: the tangent of an angle in degrees.
    Tangent,
    /// `ASIN`: the arc sine, in degrees.
    ArcSine,
    /// `ACOS`: the arc cosine, in degrees.
    ArcCosine,
    /// `ATAN`: the arc tangent, in degrees.
    ArcTangent,
    /// `ATAN2`: the arc tangent of a quotient, by the signs of its parts, in degrees.
    ArcTangent2,
    /// `EXP`: e to the power of a number.
    Exponential,
    /// `LN`: the natural logarithm.
    Logarithm,
    /// `ROUND`: the nearest whole number.
    Round,
    /// `TRUNC`: the whole part of a number.
    Truncate,
    /// `STRLEN`: the number of characters of a string.
    StringLength,
    /// `FINDSTR`: the position of a string in another one.
    FindString,
    /// `SUBSTR`: a part of a string, from a position and of a length.
    SubString,
}

impl Function {
    pub(crate) const ALL: &[(Self, &'static str)] = &[
        (Self::Abs, "ABS"),
        (Self::SquareRoot, "SQRT"),
        (Self::Sine, "SIN"),
        (Self::Cosine, "COS"),
        (Self::Tangent, "TAN"),
        (Self::ArcSine, "ASIN"),
        (Self::ArcCosine, "ACOS"),
        (Self::ArcTangent2, "ATAN2"),
        (Self::ArcTangent, "ATAN"),
        (Self::Exponential, "EXP"),
        (Self::Logarithm, "LN"),
        (Self::Round, "ROUND"),
        (Self::Truncate, "TRUNC"),
        (Self::StringLength, "STRLEN"),
        (Self::FindString, "FINDSTR"),
        (Self::SubString, "SUBSTR"),
    ];

    /// Returns the number of arguments of the function.
    pub(crate) fn arguments(self) -> usize {
        match self {
            Self::SubString => 3,
            Self::FindString | Self::ArcTangent2 => 2,
            _ => 1,
        }
    }
}

/// The operator between the two sides of an [`Expression`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Operator {
    /// `OR`: one of the two conditions is true.
    Or,
    /// `AND`: both conditions are true.
    And,
    /// `=`: the two sides are equal.
    Equal,
    /// `<>`: the two sides are not equal.
    Unequal,
    /// `<=`: the left side is not greater.
    LessOrEqual,
    /// `>=`: the left side is not less.
    GreaterOrEqual,
    /// `<`: the left side is less.
    Less,
    /// `>`: the left side is greater.
    Greater,
    /// `+`: the sum.
    Add,
    /// `-`: the difference.
    Subtract,
    /// `*`: the product.
    Multiply,
    /// `/`: the quotient.
    Divide,
    /// `DIV`: the whole part of a quotient.
    DivideWhole,
    /// `MOD`: the rest of a division.
    Remainder,
}

impl Operator {
    /// The operators as they are written, those that bind less first. A word has blanks around it.
    pub(crate) const ALL: [(Self, &'static str, u8); 16] = [
        (Self::Or, "OR", 0),
        // As controllers set to German write it, and the one below.
        (Self::Or, "[+]", 0),
        (Self::And, "AND", 1),
        (Self::And, "[&]", 1),
        (Self::Unequal, "<>", 2),
        (Self::LessOrEqual, "<=", 2),
        (Self::GreaterOrEqual, ">=", 2),
        (Self::Equal, "=", 2),
        (Self::Less, "<", 2),
        (Self::Greater, ">", 2),
        (Self::Add, "+", 3),
        (Self::Subtract, "-", 3),
        (Self::Multiply, "*", 4),
        (Self::Divide, "/", 4),
        (Self::DivideWhole, "DIV", 4),
        (Self::Remainder, "MOD", 4),
    ];
    pub(crate) const LEVELS: u8 = 5;
}

/// A register, an input, an output …: `R[1:count]`, `PR[GP1:3,2]`, `DI[R[5]]`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Item {
    /// The kind of the item.
    pub kind: ItemKind,
    /// The motion group: 1 for `GP1`, and the first of `GP1,2`; `None` if it is not named.
    pub group: Option<u8>,
    /// The number of the item, or the item that contains it.
    pub index: Index,
    /// The coordinate of a position register, from 1; `None` for the whole register.
    pub element: Option<Index>,
    /// The name of the item; `None` if it has no name.
    pub name: Option<String>,
}

/// The number of an [`Item`].
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Index {
    /// A number as it stands: `R[1]`.
    Number(u32),
    /// The number is in another item, such as a register.
    Item(Box<Item>),
    /// `...`: it is not filled in yet.
    Untaught,
}

/// The kind of an [`Item`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum ItemKind {
    /// `R`: a register of a number.
    Register,
    /// `PR`: a register of a position.
    PositionRegister,
    /// `SR`: a register of a string.
    StringRegister,
    /// `P`: a position of the program.
    Position,
    /// `AR`: an argument that the program was called with.
    Argument,
    /// `F`: a flag, on or off.
    Flag,
    /// `M`: a marker, set in the background.
    Marker,
    /// `DI`: a digital input.
    DigitalInput,
    /// `DO`: a digital output.
    DigitalOutput,
    /// `RI`: a digital input at the robot's arm.
    RobotInput,
    /// `RO`: a digital output at the robot's arm.
    RobotOutput,
    /// `GI`: several digital inputs as one number.
    GroupInput,
    /// `GO`: several digital outputs as one number.
    GroupOutput,
    /// `AI`: an analog input.
    AnalogInput,
    /// `AO`: an analog output.
    AnalogOutput,
    /// `SI`: an input of the operator's panel.
    OperatorInput,
    /// `SO`: an output of the operator's panel.
    OperatorOutput,
    /// `UI`: an input by which other equipment controls the robot.
    UserInput,
    /// `UO`: an output that reports the robot's state to other equipment.
    UserOutput,
    /// `TIMER`: a timer, in s.
    Timer,
    /// `UFRAME`: a user frame; 0 is the world.
    UserFrame,
    /// `UTOOL`: a tool frame; 0 is the flange.
    UserTool,
    /// `LBL`: a label, the target of jumps.
    Label,
    /// `VR`: the result of a vision process.
    VisionRegister,
    /// `PL`: the position of the next part in a pallet.
    PalletRegister,
    /// `WI`: an input of the welding equipment.
    WeldInput,
    /// `WO`: an output to the welding equipment.
    WeldOutput,
    /// `WSI`: an input of the wire stick detection.
    WireInput,
    /// `WSO`: an output of the wire stick detection.
    WireOutput,
    /// `TIMER_OVERFLOW`: whether a timer has exceeded its range.
    TimerOverflow,
    /// `TCP_SPD`: the present or predicted speed of the tool; of an option.
    ToolSpeed,
    /// `SPI`: an input of the spot welding equipment.
    SpotInput,
    /// `SPO`: an output to the spot welding equipment.
    SpotOutput,
    /// `SEMAPHORE`: a signal between programs that run at the same time.
    Semaphore,
}

impl ItemKind {
    /// How they are written, and the numbers that a controller can have of each. How many it has is a matter of its settings.
    const ALL: [(Self, &'static str, RangeInclusive<u32>); 34] = [
        (Self::Register, "R", 1..=32767),
        (Self::PositionRegister, "PR", 1..=32767),
        (Self::StringRegister, "SR", 1..=32767),
        (Self::Position, "P", 1..=32767),
        (Self::Argument, "AR", 1..=10),
        (Self::Flag, "F", 1..=32767),
        (Self::Marker, "M", 1..=32767),
        (Self::DigitalInput, "DI", 1..=65535),
        (Self::DigitalOutput, "DO", 1..=65535),
        (Self::RobotInput, "RI", 1..=1024),
        (Self::RobotOutput, "RO", 1..=1024),
        (Self::GroupInput, "GI", 1..=32767),
        (Self::GroupOutput, "GO", 1..=32767),
        (Self::AnalogInput, "AI", 1..=32767),
        (Self::AnalogOutput, "AO", 1..=32767),
        (Self::OperatorInput, "SI", 0..=64),
        (Self::OperatorOutput, "SO", 0..=64),
        (Self::UserInput, "UI", 1..=64),
        (Self::UserOutput, "UO", 1..=64),
        (Self::Timer, "TIMER", 1..=1024),
        (Self::UserFrame, "UFRAME", 0..=61),
        (Self::UserTool, "UTOOL", 0..=30),
        (Self::Label, "LBL", 1..=32767),
        (Self::VisionRegister, "VR", 1..=1024),
        (Self::PalletRegister, "PL", 1..=1024),
        (Self::WeldInput, "WI", 1..=1024),
        (Self::WeldOutput, "WO", 1..=1024),
        (Self::WireInput, "WSI", 1..=1024),
        (Self::WireOutput, "WSO", 1..=1024),
        (Self::TimerOverflow, "TIMER_OVERFLOW", 1..=1024),
        (Self::ToolSpeed, "TCP_SPD", 1..=32767),
        (Self::SpotInput, "SPI", 1..=1024),
        (Self::SpotOutput, "SPO", 1..=1024),
        (Self::Semaphore, "SEMAPHORE", 1..=32),
    ];

    /// How controllers set to German write some of them.
    const GERMAN: [(Self, &'static str); 6] = [
        (Self::DigitalInput, "E"),
        (Self::DigitalOutput, "A"),
        (Self::GroupInput, "gE"),
        (Self::GroupOutput, "gA"),
        (Self::Register, "i"),
        (Self::Label, "LABEL"),
    ];

    /// Returns the kind with these letters, such as `PR`, in upper or lower case.
    pub fn named(letters: &str) -> Option<Self> {
        let all = Self::ALL
            .iter()
            .map(|(kind, text, _)| (kind, text))
            .chain(Self::GERMAN.iter().map(|(kind, text)| (kind, text)));
        { all }.find(|(_, text)| text.eq_ignore_ascii_case(letters)).map(|(kind, _)| *kind)
    }

    /// Returns the spellings of all kinds.
    pub(crate) fn names() -> impl Iterator<Item = &'static str> {
        Self::ALL.iter().map(|(_, text, _)| *text)
    }

    /// Returns the possible numbers.
    pub(crate) fn range(self) -> RangeInclusive<u32> {
        Self::ALL.into_iter().find(|(kind, ..)| *kind == self).map_or(0..=u32::MAX, |(_, _, range)| range)
    }

    /// Returns whether programs can only read the item.
    pub(crate) fn is_input(self) -> bool {
        matches!(
            self,
            Self::DigitalInput
                | Self::RobotInput
                | Self::GroupInput
                | Self::AnalogInput
                | Self::OperatorInput
                | Self::UserInput
                | Self::WeldInput
                | Self::WireInput
                | Self::TimerOverflow
                | Self::ToolSpeed
                | Self::SpotInput
        )
    }

    /// Returns whether the item is ON or OFF.
    pub(crate) fn is_state(self) -> bool {
        matches!(
            self,
            Self::DigitalInput
                | Self::DigitalOutput
                | Self::RobotInput
                | Self::RobotOutput
                | Self::OperatorInput
                | Self::OperatorOutput
                | Self::UserInput
                | Self::UserOutput
                | Self::Flag
                | Self::Marker
                | Self::WeldInput
                | Self::WeldOutput
                | Self::WireInput
                | Self::WireOutput
                | Self::TimerOverflow
                | Self::SpotInput
                | Self::SpotOutput
                | Self::Semaphore
        )
    }
}

impl fmt::Display for ItemKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::ALL.iter().find(|(kind, ..)| kind == self).map_or("", |(_, text, _)| text))
    }
}
