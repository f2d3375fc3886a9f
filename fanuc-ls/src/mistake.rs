//! Mistakes in a program that can be read: in its statements, blocks, labels, frames and positions.

use crate::expression::ItemKind;
use crate::motion::SpeedUnit;
use crate::position::AxisName;

/// The severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Level {
    /// The place may be worth a look.
    Hint,
    /// A controller takes it, and its author probably did not mean it.
    Warning,
    /// A controller refuses to load or to run it.
    Error,
}

impl Level {
    /// Returns the name of the level.
    pub fn text(self) -> &'static str {
        match self {
            Self::Hint => "hint",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// A mistake in a statement, or in the relation between statements and positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Mistake {
    /// Other text is required there.
    #[error("expected {what}")]
    Expected {
        /// The missing text.
        what: Expected,
    },
    /// A word that differs by one letter from an instruction or an option.
    #[error("unknown instruction or option: did you mean `{word}`?")]
    Misspelled {
        /// The known word that differs by one letter.
        word: &'static str,
    },
    /// An unknown instruction with a name similar to a known one's; it can be that of a macro.
    #[error("unknown instruction, similar to `{word}`: it may be a macro")]
    Similar {
        /// The known word that is similar.
        word: &'static str,
    },
    /// `ON+` or `OFF-` in mixed logic, or outside of a condition.
    #[error("`ON+` and `OFF-` belong in a condition without parentheses")]
    Edge,
    /// A sum of more than two positions.
    #[error("{found} positions in one instruction: not every controller takes more than two")]
    PositionSum {
        /// The number of positions of the sum.
        found: u32,
    },
    /// An acceleration far above the greatest one of the manuals.
    #[error("ACC{found}: the manuals name 150 at most")]
    Acceleration {
        /// The value of ACC, in percent.
        found: u32,
    },
    /// A speed far above the greatest one of the manuals.
    #[error("the speed is above {highest}{unit}")]
    HighSpeed {
        /// The greatest speed without this finding, in the unit.
        highest: u32,
        /// The unit of that speed.
        unit: SpeedUnit,
    },
    /// No instruction that is known, and no macro's name.
    #[error("the instruction is not known")]
    Unknown,
    /// An unknown word after a motion.
    #[error("the motion option is not known")]
    UnknownOption,
    /// Letters and brackets that are not a known register, input or output.
    #[error("unknown register, input or output")]
    UnknownItem,
    /// A name, which can be that of a macro.
    #[error("unknown instruction: it must be a macro")]
    Macro,
    /// A call of a program that is not among those that are known.
    #[error("no program has this name")]
    MissingProgram,
    /// A number outside its range.
    #[error("expected a number from {low} to {high}")]
    Range {
        /// The least number that is allowed.
        low: i32,
        /// The greatest number that is allowed.
        high: i32,
    },
    /// Brackets that are deeper, or a text that is longer, than any instruction's.
    #[error("the instruction is too long, or its brackets are too deep")]
    TooDeep,
    /// A function that is given too few or too many values.
    #[error("the function takes {expected} values, not {found}")]
    Arguments {
        /// The number of values that the function takes.
        expected: usize,
        /// The number of values that are there.
        found: usize,
    },
    /// AND and OR in one condition without parentheses.
    #[error("AND and OR are mixed without parentheses")]
    MixedLogic,
    /// `...` or `Constant`: a template that must be filled in.
    #[error("an operand is missing")]
    Untaught,
    /// An assignment to an item that a program cannot set.
    #[error("{item} cannot be set")]
    ReadOnly {
        /// The kind of the item.
        item: ItemKind,
    },
    /// A jump to a label that is not there.
    #[error("there is no LBL[{number}]")]
    UndefinedLabel {
        /// The number of the label.
        number: u32,
    },
    /// Two labels with one number.
    #[error("LBL[{number}] is already defined")]
    RepeatedLabel {
        /// The number of the label.
        number: u32,
    },
    /// A block without its end.
    #[error("{} has no {}", block.begin(), block.end())]
    Open {
        /// The block that is not closed.
        block: Block,
    },
    /// The end, or another part, of a block that is not open here.
    #[error("no {} is open here", block.begin())]
    NotOpen {
        /// The block that is not open.
        block: Block,
    },
    /// The end of a block while one within it is open.
    #[error("{} inside it is not closed", block.begin())]
    Crossed {
        /// The inner block, which is still open.
        block: Block,
    },
    /// A second ELSE of one block.
    #[error("the block already has an ELSE")]
    RepeatedElse,
    /// FOR whose first value is beyond its last one.
    #[error("the loop never runs: its first value is beyond its last")]
    EmptyLoop,
    /// A word that controllers write in capitals.
    #[error("controllers write `{word}`")]
    Capitals {
        /// The word in capitals.
        word: &'static str,
    },
    /// A motion with Skip in a program that has no condition for it.
    #[error("the program has no SKIP CONDITION before this motion")]
    SkipCondition,
    /// A joint that has turned further than any robot's can.
    #[error("{} of P[{number}] is beyond 720 degrees", axis.name())]
    Joint {
        /// The number of the position, as in `P[1]`.
        number: u32,
        /// The joint that has turned too far.
        axis: AxisName,
    },
    /// A line to which no instruction leads.
    #[error("unreachable line")]
    Unreachable,
    /// A motion in a program without a motion group.
    #[error("DEFAULT_GROUP has no motion group: the program cannot move")]
    NoGroup,
    /// A position lacks a group of the program, or has one that the program does not move.
    #[error("P[{number}] lacks motion groups of DEFAULT_GROUP")]
    Groups {
        /// The number of the position, as in `P[1]`.
        number: u32,
    },
    /// A position that lacks a coordinate.
    #[error("P[{number}] has no {}", axis.name())]
    MissingAxis {
        /// The number of the position, as in `P[1]`.
        number: u32,
        /// The missing coordinate.
        axis: AxisName,
    },
    /// A coordinate that is there twice, or does not belong to the others.
    #[error("{} of P[{number}] is duplicate or not allowed there", axis.name())]
    ForeignAxis {
        /// The number of the position, as in `P[1]`.
        number: u32,
        /// The coordinate that is not allowed there.
        axis: AxisName,
    },
    /// A coordinate in a unit that its axis does not have.
    #[error("{} of P[{number}] has the wrong unit", axis.name())]
    AxisUnit {
        /// The number of the position, as in `P[1]`.
        number: u32,
        /// The coordinate with the wrong unit.
        axis: AxisName,
    },
    /// A CONFIG that is not valid.
    #[error("CONFIG of P[{number}] is not N or F, U or D, T or B, and turns from -8 to 7")]
    Configuration {
        /// The number of the position, as in `P[1]`.
        number: u32,
    },
    /// A motion to a position of another frame than the program has chosen.
    #[error("P[{number}] has UF {found}, but the program selected UFRAME_NUM={chosen}")]
    Frame {
        /// The number of the position, as in `P[1]`.
        number: u32,
        /// The user frame of the position.
        found: u16,
        /// The user frame that the program selected.
        chosen: u16,
    },
    /// A motion to a position of another tool than the program has selected.
    #[error("P[{number}] has UT {found}, but the program selected UTOOL_NUM={chosen}")]
    Tool {
        /// The number of the position, as in `P[1]`.
        number: u32,
        /// The tool frame of the position.
        found: u16,
        /// The tool frame that the program selected.
        chosen: u16,
    },
    /// A motion without FINE or CNT.
    #[error("the motion has no FINE or CNT")]
    Termination,
    /// An attribute whose value a controller does not take.
    #[error("the attribute has a value that a controller does not take")]
    Attribute,
}

/// The text that is expected instead of the text at hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[allow(missing_docs, reason = "the error's message names the expected text")]
#[non_exhaustive]
pub enum Expected {
    #[error("a value such as `R[1]`, `5` or `ON`")]
    Value,
    #[error("a number")]
    Number,
    #[error("a register such as `R[1]`")]
    Register,
    #[error("a position register such as `PR[1]`")]
    PositionRegister,
    #[error("a position such as `PR[1]`, `P[1]` or `LPOS`")]
    Position,
    #[error("a text such as `'a'` or `SR[1]`")]
    Text,
    #[error("ON, OFF or a condition")]
    State,
    #[error("a label such as `LBL[1]`")]
    Label,
    #[error("a program's name")]
    Program,
    #[error("a comparison such as `=ON` or `>5`")]
    Comparison,
    #[error("`[` and a number")]
    OpenBracket,
    #[error("`]`")]
    Bracket,
    #[error("`(`: IF … THEN has its condition in parentheses")]
    OpenParenthesis,
    #[error("`)`")]
    Parenthesis,
    #[error("`'`")]
    Quote,
    #[error("`,`")]
    Comma,
    #[error("`=`")]
    Equals,
    #[error("`,` and an instruction, or `THEN`")]
    Then,
    #[error("an instruction allowed here, such as `JMP LBL[1]` or `CALL A`")]
    Action,
    #[error("`TO` or `DOWNTO`")]
    To,
    #[error("`sec` or `mm`")]
    Unit,
    #[error("`(sec)`")]
    Seconds,
    #[error("`ENABLE` or `DISABLE`")]
    Enable,
    #[error("the end of the instruction")]
    End,
}

/// A structure with a beginning and an end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Block {
    /// `IF … THEN` to `ENDIF`.
    If,
    /// `FOR` to `ENDFOR`.
    For,
    /// `SELECT` and its cases.
    Select,
}

impl Block {
    fn begin(self) -> &'static str {
        match self {
            Self::If => "IF … THEN",
            Self::For => "FOR",
            Self::Select => "SELECT",
        }
    }

    fn end(self) -> &'static str {
        match self {
            Self::If => "ENDIF",
            Self::For => "ENDFOR",
            Self::Select => "end",
        }
    }
}

impl Mistake {
    #[expect(clippy::cast_possible_truncation, reason = "the limits are those of the table")]
    pub(crate) fn range(low: f64, high: f64) -> Self {
        Self::Range { low: low as i32, high: high as i32 }
    }

    /// Returns the severity of the mistake.
    pub fn level(self) -> Level {
        match self {
            Self::Macro
            | Self::Similar { .. }
            | Self::Unknown
            | Self::UnknownItem
            | Self::UnknownOption
            | Self::Acceleration { .. }
            | Self::HighSpeed { .. }
            | Self::MissingProgram
            | Self::Untaught
            | Self::Capitals { .. }
            | Self::SkipCondition => Level::Hint,
            Self::PositionSum { .. }
            | Self::Unreachable
            | Self::EmptyLoop
            | Self::Joint { .. }
            | Self::Groups { .. }
            | Self::Frame { .. }
            | Self::Tool { .. }
            | Self::Termination => Level::Warning,
            _ => Level::Error,
        }
    }

    /// Returns the advice for the reader of the mistake.
    pub fn advice(self) -> &'static str {
        match self {
            Self::Macro => "check its spelling; name the controller's macros in a file",
            Self::MissingProgram => {
                "check its spelling; it may be a KAREL program, or one that is not in this folder"
            }
            Self::Unknown | Self::Similar { .. } | Self::UnknownItem | Self::UnknownOption => {
                "check its spelling; if an option of the controller has it, name it in a file (--instructions)"
            }
            Self::Edge => "use ON or OFF, or a condition without parentheses",
            Self::PositionSum { .. } => "add them two at a time",
            Self::Acceleration { .. } => "check the number: above 100, robots may shake and wear more",
            Self::HighSpeed { .. } => "check the number, and the robot's greatest speed",
            Self::Capitals { .. } => "use this spelling: which controllers accept another one is unknown",
            Self::SkipCondition => "add one, unless the program that calls this one has it",
            Self::EmptyLoop => "change the values, or use DOWNTO or TO instead",
            Self::Joint { .. } => "check the number",
            Self::Untaught => "fill it in before the program runs",
            Self::MixedLogic => {
                "write it as mixed logic: one pair of parentheses around all of it, and one around each part"
            }
            Self::UndefinedLabel { .. } => "add the label, or correct the number",
            Self::RepeatedLabel { .. } => "give one of them another number, and its jumps as well",
            Self::Open { .. } => "close it, or delete it",
            Self::NotOpen { .. } | Self::Crossed { .. } | Self::RepeatedElse => {
                "check which block it belongs to"
            }
            Self::Unreachable => "delete it, or put a label before it",
            Self::NoGroup => "give the program a group, or take the motions out",
            Self::Groups { .. } => "teach the position with the program's groups",
            Self::Frame { .. } | Self::Tool { .. } => {
                "choose the position's frame before the motion, or teach it in the one that is chosen"
            }
            Self::Termination => "add FINE or CNT100",
            _ => "correct it: a controller would not take it",
        }
    }
}
