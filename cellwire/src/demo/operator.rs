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
    /// Dropped with the operator: a run that is over is not stopped.
    timer: Option<Sender<()>>,
}

impl Operator {
    /// Creates an operator, and the receiver of the typed lines.
    pub(super) fn new() -> (Self, Receiver<Option<OperatorInput>>) {
        let (typed, lines) = channel();
        (Self { typed, timer: None }, lines)
    }

    /// Stops the run at this time.
    pub(super) fn stop_at(&mut self, end: Duration) {
        let (timer, is_over) = channel();
        let typed = self.typed.clone();
        self.timer = Some(timer);
        thread::spawn(move || {
            if is_over.recv_timeout(end.saturating_sub(now())) == Err(RecvTimeoutError::Timeout) {
                let _ = typed.send(Some(OperatorInput::Line("stop".into())));
            }
        });
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
