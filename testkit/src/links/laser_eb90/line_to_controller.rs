//! The line between a controller and a host of another maker: words as bytes, and the controller's answers.

use core::time::Duration;
use std::cell::RefCell;
use std::rc::Rc;

use laser_eb90::controller::machine::{Action, Answer};
use laser_eb90::{Controller, ControllerConfig, ControllerEvent, Instruction, Refusal};
use robot_work_queue::{Reader, Wake, boxed_with};

use super::any_host::{AnyHost, Knowledge, Step};
use super::pieces::{BATCH, FEW, HEAD, MANY, Piece, frame, instruction, spell};
use super::{CUT, SWITCH};
use crate::faults::Faults;
use crate::model::{SceneOf, Wired};

/// Any instruction: each is queued.
#[derive(Debug)]
pub struct AnyInstruction;

impl TryFrom<Instruction<'_>> for AnyInstruction {
    type Error = ();

    fn try_from(_: Instruction<'_>) -> Result<Self, ()> {
        Ok(Self)
    }
}

/// A motion task that executes each job at once.
#[derive(Debug, Clone, Default)]
pub struct Prompt(Rc<RefCell<Option<Reader<'static, AnyInstruction>>>>);

impl Wake for Prompt {
    fn wake(&self) {
        let mut reader = self.0.borrow_mut();
        while let Some(job) = reader.as_mut().and_then(Reader::take) {
            job.complete();
        }
    }
}

impl Wired for AnyHost {
    type Session = Controller<'static, AnyInstruction, Prompt>;

    /// The faults of the line are words.
    const FAULTS: Faults = Faults { split: 0.3, ..Faults::NONE };

    fn session(&self) -> Self::Session {
        let prompt = Prompt::default();
        let (writer, reader) =
            boxed_with(BATCH - 1, 9999, prompt.clone(), robot_work_queue::NoWake).expect("such a queue");
        *prompt.0.borrow_mut() = Some(reader);
        Controller::new(self.config, writer).expect("a configuration that works")
    }

    fn speak(&self, known: &Knowledge, word: Step, session: &mut Self::Session, now: Duration) -> Vec<u8> {
        match word {
            Step::Piece(piece) => return spell(piece, known.held),
            Step::Arrive => return known.port.first().map_or(Vec::new(), |piece| spell(*piece, known.held)),
            Step::Executed(true) => session.answer(now, |_| Ok(())).expect("it is executed"),
            Step::Executed(false) => {
                session.refuse(now, Refusal::BadParameters).expect("it is executed");
            }
            Step::Transmit(_) | Step::Read | Step::GiveUp => {}
        }
        Vec::new()
    }

    /// The connection breaks within a piece.
    fn lost(&self, _: &Knowledge, _: Step) -> Vec<Vec<Step>> {
        let strings: [&[Piece]; 6] =
            [&[], &[FEW], &[HEAD], &[MANY, HEAD], &[Piece::Bad, HEAD], &[FEW, Piece::Bad, HEAD]];
        strings.map(|pieces| pieces.iter().copied().map(Step::Piece).collect()).into()
    }

    /// Not beyond the silence.
    fn may_pause(&self, _: Step) -> bool {
        false
    }

    fn is_written(&self, _: &SceneOf<Self>, answer: &Answer, bytes: &[u8]) -> bool {
        let word = match answer {
            Answer::Echo(word) => *word,
            Answer::Error(refusal) => ControllerConfig::default().words.errors().code(*refusal),
        };
        bytes == frame(&instruction(word))
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        match action {
            Action::Execute => reports.push("execute".into()),
            Action::Answer(Answer::Echo(CUT)) => reports.push("queued 1".into()),
            Action::Answer(Answer::Error(refusal)) => reports.push(format!("{refusal:?}")),
            Action::Nothing | Action::Answer(Answer::Echo(_)) | Action::Sent => {}
        }
    }

    fn reported(&self, event: &ControllerEvent) -> Option<String> {
        Some(match event {
            ControllerEvent::Execute { word: SWITCH, .. } => "execute".into(),
            ControllerEvent::Queued { count } => format!("queued {count}"),
            ControllerEvent::Refused(refusal) => format!("{refusal:?}"),
            ControllerEvent::Corrupt(_) => return None,
            other => format!("{other:?}"),
        })
    }
}
