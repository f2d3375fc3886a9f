//! The statements that a line can contain.

use crate::expression::{Expression, VariableRef};

/// A statement, with the line that it is at. Places in a program are counted from 0.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Statement {
    pub(crate) line: usize,
    pub(crate) what: StatementKind,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum StatementKind {
    Assign(VariableRef, Expression),
    /// `IF … THEN`, `WHILE … DO`: goes there unless it is so; `UNTIL` too.
    Unless(Expression, usize),
    /// `ELSE`, the `END` of a loop.
    GoTo(usize),
    /// `FOR`: the end is kept in a local variable, the loop ends there.
    For {
        variable: VariableRef,
        from: Expression,
        to: Expression,
        kept: usize,
        end: usize,
    },
    /// The `END` of a `FOR`.
    Next {
        variable: VariableRef,
        kept: usize,
        begin: usize,
    },
    /// `DO`, the `END` of an `IF`, and settings of the arm.
    Nothing,
    Call(usize, Vec<Expression>),
    Return,
    /// `WAIT`: until it is so.
    Wait(Expression),
    /// `TWAIT`: this many seconds.
    WaitTime(Expression),
    /// `TIMER (n) = …`
    SetTimer(Expression, Expression),
    /// `SIGNAL`: on, or off if negative.
    Signal(Vec<Expression>),
    Move {
        straight: bool,
        to: Expression,
    },
    /// `BREAK`
    Arrive,
    Print(Vec<Expression>),
    Connect {
        socket: VariableRef,
        port: Expression,
        ip: VariableRef,
        timeout: Expression,
    },
    Send {
        result: VariableRef,
        socket: Expression,
        strings: VariableRef,
        count: Expression,
        timeout: Expression,
    },
    Receive {
        result: VariableRef,
        socket: Expression,
        strings: VariableRef,
        count: VariableRef,
        timeout: Expression,
        longest: Expression,
    },
    Close {
        result: VariableRef,
        socket: Expression,
    },
    Status {
        count: VariableRef,
        columns: [VariableRef; 5],
    },
}
