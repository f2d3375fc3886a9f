use alloc::boxed::Box;
use alloc::string::String;
use alloc::vec::Vec;

use crate::expression::{Expression, Index, Item};

/// The action of an instruction other than a motion. It is a view: the encoder writes the instruction's text.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Operation {
    /// `CALL NAME(1,R[2])`: runs another program, and continues after its end.
    Call {
        /// The program's name as in the text; `SR[25]` if a register contains it.
        program: String,
        /// The values of the called program's `AR[1]` and so on.
        arguments: Vec<Expression>,
    },
    /// `RUN NAME`: starts another program, and continues.
    Run(String),
    /// `LBL[3:name]`.
    Label(Item),
    /// `JMP LBL[3]`.
    Jump(Item),
    /// `R[1]=R[2]+1`, `DO[5]=ON`, `PR[1,3]=26.5`, `UTOOL[5]=PR[10]`.
    Assign(Item, Expression),
    /// `$WAITTMOUT=500`.
    AssignSystem(String, Expression),
    /// `UFRAME_NUM=1`: the user frame of the following motions.
    UserFrame(Expression),
    /// `UTOOL_NUM=1`: the tool frame of the following motions.
    UserTool(Expression),
    /// `OVERRIDE=100%`.
    Override(Expression),
    /// `DO[1]=PULSE,0.5sec`.
    Pulse(Item, Option<f64>),
    /// `TIMER[1]=START`.
    Timer(Item, TimerAction),
    /// `WAIT 1.00(sec)`, `WAIT R[5]`.
    Wait(Expression),
    /// `WAIT DI[1]=ON TIMEOUT,LBL[570]`.
    WaitFor {
        /// The condition that ends the wait.
        condition: Expression,
        /// The label to which the program goes when `$WAITTMOUT` ends the wait.
        timeout: Option<Item>,
    },
    /// `IF R[1]=2,JMP LBL[3]`.
    If(Expression, Box<Operation>),
    /// `IF (R[1]=2) THEN`.
    IfThen(Expression),
    /// `ELSE`.
    Else,
    /// `ENDIF`.
    EndIf,
    /// `SELECT R[1]=1,CALL A`.
    Select(Item, Expression, Box<Operation>),
    /// `=2,CALL B`: another case of the `SELECT` above.
    Case(Expression, Box<Operation>),
    /// `ELSE,CALL C`: every other case.
    Otherwise(Box<Operation>),
    /// `FOR R[1]=1 TO 10`.
    For {
        /// The register that counts.
        counter: Item,
        /// The first value of the register.
        from: Expression,
        /// The last value of the register.
        to: Expression,
        /// `DOWNTO`.
        down: bool,
    },
    /// `ENDFOR`.
    EndFor,
    /// `MESSAGE[text]`.
    Message(String),
    /// `UALM[1]`: an alarm that the user has defined.
    UserAlarm(Index),
    /// `PAYLOAD[1]`.
    Payload(Index),
    /// `END`.
    End,
    /// `ABORT`.
    Abort,
    /// `PAUSE`.
    Pause,
    /// `//CALL A`: an instruction that is switched off, as it stands.
    Disabled(String),
    /// `--eg:text`: a remark, as it stands.
    Remark(String),
    /// `LOCK PREG`: the position registers stay as they are.
    Lock,
    /// `UNLOCK PREG`.
    Unlock,
    /// `MONITOR NAME`: a program of conditions that are looked at from here on.
    Monitor(String),
    /// `WHEN DI[1]=ON,CALL A`: one of such a program's conditions.
    When(Expression, Box<Operation>),
    /// Another instruction of the table: `COL GUARD ADJUST 50`, `SOFTFLOAT[1]`, `VISION RUN_FIND 'A'`.
    Command {
        /// The words of the instruction in English.
        name: &'static str,
        /// The operands of the instruction.
        operands: Vec<Expression>,
        /// The text after them as spelled, if its form is described in an option's own manual.
        text: String,
    },
    /// `OPEN HAND 1`: a macro, or an unknown instruction.
    Macro {
        /// The name of the macro.
        name: String,
        /// The arguments of the macro.
        arguments: Vec<Expression>,
    },
}

/// An action on a timer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[allow(missing_docs, reason = "they are what they say")]
pub enum TimerAction {
    Start,
    Stop,
    Reset,
}

impl Operation {
    /// Returns the operation that is executed if a condition is true; otherwise the operation itself.
    pub fn action(&self) -> &Self {
        match self {
            Self::If(_, inner)
            | Self::When(_, inner)
            | Self::Select(_, _, inner)
            | Self::Case(_, inner)
            | Self::Otherwise(inner) => inner.action(),
            other => other,
        }
    }
}
