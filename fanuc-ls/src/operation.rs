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
    /// `LBL[3:name]`: the target of jumps.
    Label(Item),
    /// `JMP LBL[3]`: continues at a label.
    Jump(Item),
    /// `R[1]=R[2]+1`, `DO[5]=ON`, `PR[1,3]=26.5`, `UTOOL[5]=PR[10]`: sets an item.
    Assign(Item, Expression),
    /// `$WAITTMOUT=500`: sets a system variable, whose name is as it stands.
    AssignSystem(String, Expression),
    /// `UFRAME_NUM=1`: the user frame of the following motions.
    UserFrame(Expression),
    /// `UTOOL_NUM=1`: the tool frame of the following motions.
    UserTool(Expression),
    /// `OVERRIDE=100%`: the speed of all motions, in percent.
    Override(Expression),
    /// `DO[1]=PULSE,0.5sec`: switches an output on for a time in s; `None` for the controller's own time.
    Pulse(Item, Option<f64>),
    /// `TIMER[1]=START`: starts, stops or resets a timer.
    Timer(Item, TimerAction),
    /// `WAIT 1.00(sec)`, `WAIT R[5]`: waits for a time in s.
    Wait(Expression),
    /// `WAIT DI[1]=ON TIMEOUT,LBL[570]`: waits for a condition.
    WaitFor {
        /// The condition that ends the wait.
        condition: Expression,
        /// The label to which the program goes when `$WAITTMOUT` ends the wait; `None`: it waits without a limit.
        timeout: Option<Item>,
    },
    /// `IF R[1]=2,JMP LBL[3]`: an operation that is executed if a condition is true.
    If(Expression, Box<Operation>),
    /// `IF (R[1]=2) THEN`: the beginning of a block that is executed if a condition is true.
    IfThen(Expression),
    /// `ELSE`: the beginning of the block's other part.
    Else,
    /// `ENDIF`: the end of the block of an `IF … THEN`.
    EndIf,
    /// `SELECT R[1]=1,CALL A`: the first case of a register's values.
    Select(Item, Expression, Box<Operation>),
    /// `=2,CALL B`: another case of the `SELECT` above.
    Case(Expression, Box<Operation>),
    /// `ELSE,CALL C`: every other case.
    Otherwise(Box<Operation>),
    /// `FOR R[1]=1 TO 10`: the beginning of a loop.
    For {
        /// The register that counts the runs of the loop.
        counter: Item,
        /// The first value of the register.
        from: Expression,
        /// The last value of the register.
        to: Expression,
        /// Whether the register counts down: `DOWNTO` in place of `TO`.
        down: bool,
    },
    /// `ENDFOR`: the end of the loop.
    EndFor,
    /// `MESSAGE[text]`: shows a text to the operator.
    Message(String),
    /// `UALM[1]`: an alarm that the user has defined.
    UserAlarm(Index),
    /// `PAYLOAD[1]`: the number of the load that the robot carries.
    Payload(Index),
    /// `END`: the end of the program's execution.
    End,
    /// `ABORT`: ends this program and its callers.
    Abort,
    /// `PAUSE`: stops the program until the operator continues it.
    Pause,
    /// `//CALL A`: an instruction that is switched off, as it stands.
    Disabled(String),
    /// `--eg:text`: a remark, as it stands.
    Remark(String),
    /// `LOCK PREG`: the position registers stay as they are.
    Lock,
    /// `UNLOCK PREG`: the position registers may change again.
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
pub enum TimerAction {
    /// `START`: the timer runs on.
    Start,
    /// `STOP`: the timer keeps its value.
    Stop,
    /// `RESET`: the timer is 0.
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
