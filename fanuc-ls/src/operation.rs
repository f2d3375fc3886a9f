use alloc::boxed::Box;
use alloc::string::{String, ToString};
use alloc::vec::Vec;

use crate::expression::{Expression, Index, Item, ItemKind, Reader};
use crate::instruction::Instruction;
use crate::motion::Motion;

/// What an instruction that is no motion does. It is a view: what is written is the instruction's text.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Operation {
    /// `CALL NAME(1,R[2])`: runs another program, and goes on when that has ended.
    Call {
        /// The program's name as it stands; `SR[25]` where a register has it.
        program: String,
        /// What the program finds in its `AR[1]` and on.
        arguments: Vec<Expression>,
    },
    /// `RUN NAME`: starts another program, and goes on.
    Run(String),
    /// `LBL[3:name]`.
    Label(Item),
    /// `JMP LBL[3]`.
    Jump(Item),
    /// `R[1]=R[2]+1`, `DO[5]=ON`, `PR[1,3]=26.5`, `UTOOL[5]=PR[10]`.
    Assign(Item, Expression),
    /// `$WAITTMOUT=500`.
    AssignSystem(String, Expression),
    /// `UFRAME_NUM=1`: the user frame of what follows.
    UserFrame(Expression),
    /// `UTOOL_NUM=1`: the tool frame of what follows.
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
        /// What ends the wait.
        condition: Expression,
        /// Where the program goes when `$WAITTMOUT` ends it.
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
        /// Its first value.
        from: Expression,
        /// Its last value.
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
}

/// What is done with a timer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[allow(missing_docs, reason = "they are what they say")]
pub enum TimerAction {
    Start,
    Stop,
    Reset,
}

impl Instruction {
    /// What it does. None for a motion, a comment, a line of a block, and for a text that is none of these: such an instruction is
    /// kept and not understood.
    pub fn operation(&self) -> Option<Operation> {
        match self {
            Self::UserFrame(number) => Some(Operation::UserFrame(Expression::Number((*number).into()))),
            Self::UserTool(number) => Some(Operation::UserTool(Expression::Number((*number).into()))),
            Self::Other(text) => Operation::decode(text),
            Self::Empty | Self::Comment(_) | Self::Motion(_) | Self::Nested(_) => None,
        }
    }
}

impl Motion {
    /// The position register of `Offset,PR[3]`, by which the target is moved in the user frame.
    pub fn offset(&self) -> Option<Item> {
        self.register_of("Offset,")
    }

    /// The position register of `Tool_Offset,PR[3]`, by which the target is moved in the tool frame.
    pub fn tool_offset(&self) -> Option<Item> {
        self.register_of("Tool_Offset,")
    }

    fn register_of(&self, option: &str) -> Option<Item> {
        let mut words = self.options.match_indices(option);
        let whole = |at: usize| {
            !self.options.get(..at).unwrap_or("").ends_with(|c: char| c == '_' || c.is_alphanumeric())
        };
        let (at, _) = words.find(|(at, _)| whole(*at))?;
        Reader::new(self.options.get(at + option.len()..)?).item()
    }
}

impl Operation {
    /// What an instruction's text does.
    pub fn decode(text: &str) -> Option<Self> {
        if let Some(disabled) = text.strip_prefix("//") {
            return Some(Self::Disabled(disabled.to_string()));
        }
        if let Some(message) = text.strip_prefix("MESSAGE[") {
            return message.trim_end().strip_suffix(']').map(|message| Self::Message(message.to_string()));
        }
        let mut reader = Reader::new(text);
        let operation = reader.operation()?;
        reader.end()?;
        Some(operation)
    }
}

impl Reader<'_> {
    fn operation(&mut self) -> Option<Operation> {
        if self.take("IF") {
            let condition = self.expression()?;
            return match self.take("THEN") {
                true => Some(Operation::IfThen(condition)),
                false => Some(Operation::If(condition, self.action()?)),
            };
        }
        if self.take("SELECT") {
            let item = self.item()?;
            let case = self.take("=").then(|| self.value())??;
            return Some(Operation::Select(item, case, self.action()?));
        }
        if self.take("FOR") {
            return self.count();
        }
        if self.take("WAIT") {
            return self.wait();
        }
        if self.take("=") {
            return Some(Operation::Case(self.value()?, self.action()?));
        }
        if self.take("ELSE") {
            return Some(if self.end().is_some() {
                Operation::Else
            } else {
                Operation::Otherwise(self.action()?)
            });
        }
        self.simple()
    }

    /// What may follow a condition and a comma.
    fn action(&mut self) -> Option<Box<Operation>> {
        self.take(",").then(|| self.simple()).flatten().map(Box::new)
    }

    fn simple(&mut self) -> Option<Operation> {
        let words = [
            ("ENDIF", Operation::EndIf),
            ("ENDFOR", Operation::EndFor),
            ("END", Operation::End),
            ("ABORT", Operation::Abort),
            ("PAUSE", Operation::Pause),
        ];
        for (word, operation) in words {
            if self.take(word) {
                return Some(operation);
            }
        }
        if self.take("CALL") {
            return self.call();
        }
        if self.take("RUN") {
            return self.name().map(Operation::Run);
        }
        if self.take("JMP") {
            return self.item().filter(|item| item.kind == ItemKind::Label).map(Operation::Jump);
        }
        for (word, operation) in
            [("UALM", Operation::UserAlarm as fn(Index) -> Operation), ("PAYLOAD", Operation::Payload)]
        {
            if self.take(word) {
                let index = self.take("[").then(|| self.index())??;
                if self.take(":") {
                    self.rest = self.rest.get(self.rest.find(']')?..)?;
                }
                return self.take("]").then(|| operation(index));
            }
        }
        for (word, operation) in [
            ("UFRAME_NUM", Operation::UserFrame as fn(Expression) -> Operation),
            ("UTOOL_NUM", Operation::UserTool),
            ("OVERRIDE", Operation::Override),
        ] {
            if self.take(word) {
                let value = self.take("=").then(|| self.expression())??;
                self.take("%");
                return Some(operation(value));
            }
        }
        if self.rest.trim_start().starts_with('$') {
            let variable = self.system()?;
            let value = self.take("=").then(|| self.expression())??;
            return Some(Operation::AssignSystem(variable, value));
        }
        let item = self.item()?;
        if item.kind == ItemKind::Label {
            return Some(Operation::Label(item));
        }
        if !self.take("=") {
            return None;
        }
        if item.kind == ItemKind::Timer {
            let actions =
                [("START", TimerAction::Start), ("STOP", TimerAction::Stop), ("RESET", TimerAction::Reset)];
            if let Some((_, action)) = actions.into_iter().find(|(word, _)| self.take(word)) {
                return Some(Operation::Timer(item, action));
            }
        }
        if self.take("PULSE") {
            let time = if self.take(",") { Some(self.seconds()?) } else { None };
            return Some(Operation::Pulse(item, time));
        }
        self.expression().map(|value| Operation::Assign(item, value))
    }

    fn call(&mut self) -> Option<Operation> {
        let program = self.name()?;
        let mut arguments = Vec::new();
        if self.take("(") {
            loop {
                arguments.push(self.expression()?);
                if !self.take(",") {
                    break;
                }
            }
            self.take(")").then_some(())?;
        }
        Some(Operation::Call { program, arguments })
    }

    /// A program's name, or the string register that has it.
    fn name(&mut self) -> Option<String> {
        let text = self.rest.trim_start();
        if let Some(item) = self.clone().item() {
            self.item()?;
            let length = text.len() - self.rest.len();
            return (item.kind == ItemKind::StringRegister)
                .then(|| text.get(..length))
                .flatten()
                .map(ToString::to_string);
        }
        let length =
            text.find(|c: char| !(c.is_alphanumeric() || matches!(c, '_' | '-'))).unwrap_or(text.len());
        let (name, rest) = text.split_at_checked(length).filter(|(name, _)| !name.is_empty())?;
        self.rest = rest;
        Some(name.to_string())
    }

    fn wait(&mut self) -> Option<Operation> {
        let condition = self.expression()?;
        let is_time = match &condition {
            Expression::Number(_) => true,
            Expression::Item(item) => matches!(item.kind, ItemKind::Register | ItemKind::Argument),
            _ => false,
        };
        if self.take("(sec)") || is_time {
            return Some(Operation::Wait(condition));
        }
        let timeout = match self.take("TIMEOUT") {
            true => Some(self.take(",").then(|| self.item())??),
            false => None,
        };
        Some(Operation::WaitFor { condition, timeout })
    }

    fn count(&mut self) -> Option<Operation> {
        let counter = self.item()?;
        let from = self.take("=").then(|| self.value())??;
        let down = self.take("DOWNTO");
        (down || self.take("TO")).then_some(())?;
        Some(Operation::For { counter, from, to: self.value()?, down })
    }

    fn seconds(&mut self) -> Option<f64> {
        let Expression::Number(seconds) = self.value()? else { return None };
        self.take("sec").then_some(seconds)
    }
}
