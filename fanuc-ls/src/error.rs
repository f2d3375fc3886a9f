use crate::expression::ItemKind;
/// The reason that a text is not an LS program, and its position.
///
/// Lines and columns count from 1, columns in characters (a tab is one).
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[non_exhaustive]
#[error("line {line}, column {column}: {reason}")]
pub struct DecodeError {
    /// The text that was expected there.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub reason: Reason,
    /// The line of the text, from 1.
    pub line: usize,
    /// The column in that line, from 1, in characters.
    pub column: usize,
    /// The byte in the text, from 0.
    pub offset: usize,
}

impl DecodeError {
    /// Creates the error at this byte of `text`.
    pub(crate) fn new(text: &str, offset: usize, reason: Reason) -> Self {
        let before = text.get(..offset).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        Self {
            reason,
            line: before.matches('\n').count() + 1,
            column: before.get(line_start..).map_or(0, |head| head.chars().count()) + 1,
            offset,
        }
    }
}

/// The text that a [`DecodeError`] found missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Reason {
    /// The text does not begin with `/PROG`.
    #[error("expected `/PROG` and the program's name")]
    Program,
    /// Text that is not an attribute between `/ATTR` and the next section.
    #[error("expected an attribute, `NAME = value;`, or the next section")]
    Attribute,
    /// An attribute, or an item of one, without a value.
    #[error("expected `=` and a value")]
    AttributeValue,
    /// An attribute without its end.
    #[error("the attribute is not closed with `;`")]
    AttributeEnd,
    /// The section with the instructions is missing.
    #[error("expected the section `/MN`")]
    Main,
    /// A line of `/MN` that does not begin with its number.
    #[error("expected a line number and `:`")]
    LineNumber,
    /// An instruction that neither ends in `;` nor continues in the next line.
    #[error("the instruction is not closed with `;`, and the next line does not continue it with `:`")]
    InstructionEnd,
    /// Text follows the `;` of an instruction.
    #[error("expected nothing after the `;`: write comments as `!text ;`")]
    AfterInstruction,
    /// A motion instruction without a target.
    #[error("expected a target such as `P[1]` or `PR[1]`")]
    Target,
    /// A target or a register without its end.
    #[error("expected `]`")]
    Bracket,
    /// A motion instruction without a speed.
    #[error("expected a speed such as `100mm/sec`, `50%`, `R[1]mm/sec` or `max_speed`")]
    Speed,
    /// A speed without a unit that the controller knows.
    #[error("expected a unit: %, sec, msec, mm/sec, cm/min, inch/min or deg/sec")]
    SpeedUnit,
    /// A smoothness (CNT) outside 0..=100.
    #[error("expected CNT with 0 to 100, or with a register")]
    Continuous,
    /// Text in `/POS` that is not a position.
    #[error("expected a position, `P[1]{{`, or `/END`")]
    Position,
    /// A position without its end.
    #[error("expected a motion group such as `GP1:`, or `}};` to close the position")]
    Group,
    /// A motion group without its frames.
    #[error("expected `UF : n, UT : n,`")]
    Frames,
    /// A configuration without its text.
    #[error("expected a configuration such as `CONFIG : 'N U T, 0, 0, 0',`")]
    Configuration,
    /// Text that is not an axis.
    #[error("expected an axis: X, Y, Z, W, P, R, RX to RR, J1 to J9 or E1 to E9, and `=`")]
    Axis,
    /// Text that is not a number.
    #[error("expected a number such as `-108.435`, `.582` or `********`")]
    Number,
    /// A coordinate without a unit.
    #[error("expected `deg` or `mm`")]
    AxisUnit,
    /// The text ends before `/END`.
    #[error("expected `/END`")]
    End,
    /// A speed outside its unit's range; see [`SpeedUnit::range`](crate::SpeedUnit::range).
    #[error("expected a speed within the range of its unit: above 0, and not above 100%")]
    SpeedRange,
    /// The program's name is longer than [`Rules::name_limit`](crate::Rules::name_limit).
    #[error("expected a name of {limit} characters at most, found {found}")]
    NameLength {
        /// The number of characters of the name.
        found: usize,
        /// The largest number of characters that the rules allow.
        limit: usize,
    },
    /// Text that follows `/END`.
    #[error("expected nothing after `/END`: a file has one program")]
    Trailing,
}

/// Why a program cannot be written: the caller's fault. `line` is the instruction's number, from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EncodeError {
    /// A program's name is letters, digits and `_`, and begins with a letter or `_`.
    #[error("the program's name must be letters, digits and `_`, and not begin with a digit")]
    Name,
    /// The name is longer than [`Rules::name_limit`](crate::Rules::name_limit).
    #[error("the program's name has {found} characters, the limit is {limit}")]
    NameLength {
        /// The number of characters of the name.
        found: usize,
        /// The largest number of characters that the rules allow.
        limit: usize,
    },
    /// The comment does not fit its 16 characters; [`CommentRule::Truncate`](crate::CommentRule) would cut it.
    #[error("COMMENT has {found} characters, the controller keeps 16")]
    CommentLength {
        /// The number of characters of the comment, above 16.
        found: usize,
    },
    /// Two edits overlap, or the edited text could not be read again.
    #[error("the edited text cannot be parsed")]
    Edit,
    /// A label or a position cannot take the number of another one.
    #[error("{item}[{number}] is already defined")]
    Taken {
        /// The kind of the item: label or position.
        item: ItemKind,
        /// The number of the item.
        number: u32,
    },
    /// A controller has none of this number.
    #[error("there is no {item}[{number}]: the numbers are {low} to {high}")]
    ItemRange {
        /// The kind of the item.
        item: ItemKind,
        /// The number of the item.
        number: u32,
        /// The least number of the kind.
        low: u32,
        /// The greatest number of the kind.
        high: u32,
    },
    /// A name that would end before its end.
    #[error("a name must not have brackets, quotes or line ends")]
    ItemName,
    /// An attribute's name or value would not be read again as the same.
    #[error(
        "attribute {index} (counted from 1) cannot be written: its name or value would read as something else"
    )]
    Attribute {
        /// The place of the attribute among the attributes, from 1.
        index: usize,
    },
    /// A line of `/APPL` begins a section, or contains a line end.
    #[error("line {index} of /APPL cannot be written: it begins a section or holds a line end")]
    Application {
        /// The place of the line in the section, from 1.
        index: usize,
    },
    /// An instruction's text would not be read again as the same instruction.
    #[error("instruction {line} cannot be written: its text would parse differently")]
    Instruction {
        /// The number of the instruction, from 1.
        line: usize,
    },
    /// A speed outside its unit's range; see [`SpeedUnit::range`](crate::SpeedUnit::range).
    #[error("the speed of instruction {line} is outside the range of its unit")]
    Speed {
        /// The number of the instruction, from 1.
        line: usize,
    },
    /// A speed in a unit that its motion does not take; see [`SpeedUnit::fits`](crate::SpeedUnit::fits).
    #[error("the speed of instruction {line} has a unit that its motion does not take")]
    SpeedUnit {
        /// The number of the instruction, from 1.
        line: usize,
    },
    /// A smoothness (CNT) above 100.
    #[error("CNT of instruction {line} is {found}, the range is 0 to 100")]
    Continuous {
        /// The number of the instruction, from 1.
        line: usize,
        /// The value of CNT, above 100.
        found: u8,
    },
    /// C goes through one point to another, every other motion to one point.
    #[error("instruction {line}: only C has a via point, and needs one")]
    Via {
        /// The number of the instruction, from 1.
        line: usize,
    },
    /// A position without a group, or with a number, name, configuration or coordinate that cannot be written.
    #[error("P[{number}] cannot be written: it needs a group, plain text, and coordinates that are finite")]
    Position {
        /// The number of the position, as in `P[1]`.
        number: u32,
    },
    /// The caller's writer has failed.
    #[error("the text cannot be written")]
    Write,
}

impl From<core::fmt::Error> for EncodeError {
    fn from(_: core::fmt::Error) -> Self {
        Self::Write
    }
}

/// A construct in a program that a controller accepts and its author probably did not intend.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Warning {
    /// No instruction uses this position.
    #[error("P[{number}] is not used")]
    UnusedPosition {
        /// The number of the position, as in `P[1]`.
        number: u32,
    },
    /// A motion goes to a position that `/POS` does not define.
    #[error("/POS does not define P[{number}]")]
    UndefinedPosition {
        /// The number of the position, as in `P[1]`.
        number: u32,
    },
    /// Two positions have the same number.
    #[error("P[{number}] is defined more than once")]
    RepeatedPosition {
        /// The number of the position, as in `P[1]`.
        number: u32,
    },
    /// A coordinate is not set: `********`.
    #[error("P[{number}] has a coordinate that was never taught")]
    UntaughtPosition {
        /// The number of the position, as in `P[1]`.
        number: u32,
    },
    /// The number does not follow the previous one; a line may be missing.
    #[error("the line is numbered {found}, the one before it {}", expected.saturating_sub(1))]
    LineNumber {
        /// The number that follows the previous one.
        expected: usize,
        /// The number in the text.
        found: usize,
    },
    /// LINE_COUNT is neither 0 nor the number of instructions.
    #[error("LINE_COUNT is {expected}, the program has {found} lines")]
    LineCount {
        /// The value of LINE_COUNT, not 0.
        expected: usize,
        /// The number of instructions of the program.
        found: usize,
    },
    /// A speed in a unit that its motion does not take, such as `J P[1] 100mm/sec`.
    #[error("the motion does not take a speed in this unit")]
    SpeedUnit,
    /// The comment is longer than the controller stores.
    #[error("COMMENT has {found} characters, the controller keeps 16")]
    CommentLength {
        /// The number of characters of the comment, above 16.
        found: usize,
    },
    /// A name that is not letters, digits and `_`, or begins with a digit: `-BCKEDT-` is the editor's copy of a program.
    #[error("the program's name is not letters, digits and `_`, or begins with a digit")]
    Name,
    /// The file has another name than the program.
    #[error("the file is not named as the program: on the controller both must be the same")]
    FileName,
}

impl Warning {
    /// Returns the advice for the reader of the warning.
    pub fn advice(self) -> &'static str {
        match self {
            Self::UnusedPosition { .. } => "delete the position, or check which motion should go there",
            Self::UndefinedPosition { .. } => "teach the position, or correct the number",
            Self::RepeatedPosition { .. } => "delete one of them, or give it a number of its own",
            Self::UntaughtPosition { .. } => "teach the position before the program runs",
            Self::LineNumber { .. } => "check whether a line is missing; the controller renumbers them",
            Self::LineCount { .. } => "check whether a line is missing, or set it to 0",
            Self::SpeedUnit => {
                "J takes %, sec and msec; the other motions take mm/sec, cm/min, inch/min, deg/sec, sec, msec"
            }
            Self::CommentLength { .. } => "shorten it: the rest is lost on the controller",
            Self::Name => "rename the program: letters, digits and `_`, a letter first",
            Self::FileName => "rename the file, or the program",
        }
    }
}
