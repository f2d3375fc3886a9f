//! The operator of a demo's run: answers its questions, and stops it when its time is over.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

use anyhow::Result;
use robot_session::now;

use crate::io::journal::Outcome;
use cellwire_io::input::OperatorInput;
use cellwire_sim::ledger::ReportedOutcome;

/// The keyboard of a run.
#[derive(Debug)]
pub(super) struct Operator {
    typed: Sender<Option<OperatorInput>>,
    /// Dropped with the operator: the run is not stopped any more.
    _run: Sender<()>,
}

impl Operator {
    /// Creates an operator who stops the run at `end`, and the receiver of the typed lines.
    pub(super) fn new(end: Option<Duration>) -> (Self, Receiver<Option<OperatorInput>>) {
        let ((typed, lines), (run, is_over)) = (channel(), channel());
        let operator = Self { typed, _run: run };
        if let Some(end) = end {
            let typed = operator.typed.clone();
            thread::spawn(move || {
                if is_over.recv_timeout(end.saturating_sub(now())) == Err(RecvTimeoutError::Timeout) {
                    let _ = typed.send(Some(OperatorInput::Line("stop".into())));
                }
            });
        }
        (operator, lines)
    }

    /// Types a line.
    ///
    /// # Errors
    /// If the run has ended.
    pub(super) fn say(&self, word: &str) -> Result<()> {
        Ok(self.typed.send(Some(OperatorInput::Line(word.into())))?)
    }
}

/// The outcome that a run has noted, as the ledger counts it.
pub(super) fn reported(outcome: Outcome) -> ReportedOutcome {
    match outcome {
        Outcome::Done => ReportedOutcome::Done,
        Outcome::Unknown => ReportedOutcome::Unknown,
        Outcome::NotSent | Outcome::Refused => ReportedOutcome::NotDone,
    }
}
