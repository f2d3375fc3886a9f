use alloc::boxed::Box;
use alloc::string::{String, ToString};
use core::fmt;

use crate::error::Reason;
use crate::text::{decimal, reference};

/// A value or a condition in an instruction: `R[1:count]+1`, `(DI[3] AND !F[2]=ON)`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Expression {
    /// `0.5`.
    Number(f64),
    /// `'text'`, without the quotes.
    Text(String),
    /// `ON`.
    On,
    /// `OFF`.
    Off,
    /// `LPOS`: where the robot is, in X Y Z W P R.
    CartesianPosition,
    /// `JPOS`: where the robot is, by its joints.
    JointPosition,
    /// `R[1]`.
    Item(Item),
    /// `$MCR.$GENOVERRIDE`: a system variable as it stands.
    System(String),
    /// `!DI[1]`.
    Not(Box<Expression>),
    /// `-R[1]`.
    Negative(Box<Expression>),
    /// `R[1]+1`.
    Binary(Operator, Box<(Expression, Expression)>),
}

/// What is between the two sides of an [`Expression`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[allow(missing_docs, reason = "they are what they say")]
pub enum Operator {
    Or,
    And,
    Equal,
    Unequal,
    LessOrEqual,
    GreaterOrEqual,
    Less,
    Greater,
    Add,
    Subtract,
    Multiply,
    Divide,
    /// `DIV`: the whole part of a quotient.
    DivideWhole,
    /// `MOD`: the rest of a division.
    Remainder,
}

impl Operator {
    /// As they are written, those that bind less first. A word has blanks around it.
    const ALL: [(Self, &'static str, u8); 14] = [
        (Self::Or, "OR", 0),
        (Self::And, "AND", 1),
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
    const LEVELS: u8 = 5;
}

/// A register, an input, an output …: `R[1:count]`, `PR[GP1:3,2]`, `DI[R[5]]`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Item {
    /// What it is.
    pub kind: ItemKind,
    /// The motion group, where one is named: 1 for `GP1`.
    pub group: Option<u8>,
    /// Which one.
    pub index: Index,
    /// Which coordinate of a position register, from 1.
    pub element: Option<Index>,
    /// Its name, if it has one.
    pub name: Option<String>,
}

/// The number of an [`Item`].
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Index {
    /// The number itself.
    Number(u32),
    /// It is in another item, such as a register.
    Item(Box<Item>),
}

/// What an [`Item`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[allow(missing_docs, reason = "they are what they say")]
pub enum ItemKind {
    Register,
    PositionRegister,
    StringRegister,
    Position,
    /// `AR`: an argument that the program was called with.
    Argument,
    Flag,
    /// `M`: a marker, set in the background.
    Marker,
    DigitalInput,
    DigitalOutput,
    RobotInput,
    RobotOutput,
    GroupInput,
    GroupOutput,
    AnalogInput,
    AnalogOutput,
    OperatorInput,
    OperatorOutput,
    UserInput,
    UserOutput,
    Timer,
    UserFrame,
    UserTool,
    Label,
}

impl ItemKind {
    const ALL: [(Self, &'static str); 23] = [
        (Self::Register, "R"),
        (Self::PositionRegister, "PR"),
        (Self::StringRegister, "SR"),
        (Self::Position, "P"),
        (Self::Argument, "AR"),
        (Self::Flag, "F"),
        (Self::Marker, "M"),
        (Self::DigitalInput, "DI"),
        (Self::DigitalOutput, "DO"),
        (Self::RobotInput, "RI"),
        (Self::RobotOutput, "RO"),
        (Self::GroupInput, "GI"),
        (Self::GroupOutput, "GO"),
        (Self::AnalogInput, "AI"),
        (Self::AnalogOutput, "AO"),
        (Self::OperatorInput, "SI"),
        (Self::OperatorOutput, "SO"),
        (Self::UserInput, "UI"),
        (Self::UserOutput, "UO"),
        (Self::Timer, "TIMER"),
        (Self::UserFrame, "UFRAME"),
        (Self::UserTool, "UTOOL"),
        (Self::Label, "LBL"),
    ];
}

impl fmt::Display for ItemKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::ALL.iter().find(|(kind, _)| kind == self).map_or("", |(_, text)| text))
    }
}

/// How many values an instruction may have: more than fit its longest line, and few enough for any stack.
const MOST_VALUES: u8 = 100;

/// Reads an instruction from left to right. What does not fit is None: the instruction stays text.
#[derive(Debug, Clone)]
pub(crate) struct Reader<'a> {
    pub(crate) rest: &'a str,
    left: u8,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self { rest: text, left: MOST_VALUES }
    }

    /// Passes over a text, if it is next.
    pub(crate) fn take(&mut self, text: &str) -> bool {
        let rest = self.rest.trim_start().strip_prefix(text);
        // A word does not end within another one.
        let word = text.ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let rest = rest.filter(|rest| !word || !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_'));
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    /// Some when nothing is left.
    pub(crate) fn end(&self) -> Option<()> {
        self.rest.trim().is_empty().then_some(())
    }

    pub(crate) fn expression(&mut self) -> Option<Expression> {
        self.level(0)
    }

    /// One side of an operator that binds at least so much.
    fn level(&mut self, level: u8) -> Option<Expression> {
        if level == Operator::LEVELS {
            return self.value();
        }
        let mut left = self.level(level + 1)?;
        while let Some(operator) = self.operator(level) {
            left = Expression::Binary(operator, Box::new((left, self.level(level + 1)?)));
        }
        Some(left)
    }

    fn operator(&mut self, level: u8) -> Option<Operator> {
        Operator::ALL
            .iter()
            .find(|(_, text, of)| *of == level && self.take(text))
            .map(|(operator, ..)| *operator)
    }

    pub(crate) fn value(&mut self) -> Option<Expression> {
        self.left = self.left.checked_sub(1)?;
        let words = [
            ("ON", Expression::On),
            ("OFF", Expression::Off),
            ("LPOS", Expression::CartesianPosition),
            ("JPOS", Expression::JointPosition),
        ];
        for (word, value) in words {
            if self.take(word) {
                return Some(value);
            }
        }
        if self.take("(") {
            let inner = self.expression()?;
            return self.take(")").then_some(inner);
        }
        if self.take("!") {
            return Some(Expression::Not(Box::new(self.value()?)));
        }
        if self.take("'") {
            let (text, rest) = self.rest.split_once('\'')?;
            self.rest = rest;
            return Some(Expression::Text(text.to_string()));
        }
        self.rest = self.rest.trim_start();
        if let Ok((rest, number)) = decimal(self.rest) {
            self.rest = rest;
            return Some(Expression::Number(number));
        }
        if self.take("-") {
            return Some(Expression::Negative(Box::new(self.value()?)));
        }
        if self.rest.starts_with('$') {
            return self.system().map(Expression::System);
        }
        self.item().map(Expression::Item)
    }

    /// A system variable: words that begin with `$`, with `.` between them and brackets behind them.
    pub(crate) fn system(&mut self) -> Option<String> {
        self.rest = self.rest.trim_start();
        let part = |c: char| c.is_alphanumeric() || matches!(c, '$' | '_' | '.' | '[' | ']' | ',');
        let length = self.rest.find(|c| !part(c)).unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at_checked(length)?;
        self.rest = rest;
        (name.starts_with('$') && name.len() > 1).then(|| name.to_string())
    }

    pub(crate) fn item(&mut self) -> Option<Item> {
        let (rest, found) = reference(self.rest.trim_start(), Reason::Bracket).ok()?;
        let (kind, _) = ItemKind::ALL.iter().find(|(_, text)| *text == found.letters)?;
        let mut inside = Self { rest: found.inside, left: self.left };
        let group = match inside.rest.trim_start().strip_prefix("GP").and_then(|rest| rest.split_once(':')) {
            Some((number, rest)) => {
                inside.rest = rest;
                Some(number.trim().parse().ok()?)
            }
            None => None,
        };
        let index = inside.index()?;
        let element = if inside.take(",") { Some(inside.index()?) } else { None };
        let name = if inside.take(":") { Some(inside.rest.trim().to_string()) } else { None };
        if name.is_none() {
            inside.end()?;
        }
        self.rest = rest;
        Some(Item { kind: *kind, group, index, element, name })
    }

    pub(crate) fn index(&mut self) -> Option<Index> {
        self.left = self.left.checked_sub(1)?;
        self.rest = self.rest.trim_start();
        let digits = self.rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(self.rest.len());
        if digits == 0 {
            return self.item().map(|item| Index::Item(Box::new(item)));
        }
        let (number, rest) = self.rest.split_at_checked(digits)?;
        self.rest = rest;
        number.parse().ok().map(Index::Number)
    }
}
