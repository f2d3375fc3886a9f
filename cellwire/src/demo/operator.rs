//! The operator of a demo's run: answers its questions, and stops it when its time is over.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use anyhow::Result;
use robot_session::now;

use cellwire_io::input::OperatorInput;

/// The keyboard of a run.
#[derive(Debug)]
pub(super) struct Operator {
    typed: Sender<Option<OperatorInput>>,
    /// The time at which the run is stopped; `None` without one, and afterwards.
    end: Option<Duration>,
}

impl Operator {
    /// Creates an operator who stops the run at `end`, and the receiver of the typed lines.
    pub(super) fn new(end: Option<Duration>) -> (Self, Receiver<Option<OperatorInput>>) {
        let (typed, lines) = channel();
        (Self { typed, end }, lines)
    }

    /// Types a line.
    ///
    /// # Errors
    /// If the run has ended.
    pub(super) fn say(&self, word: &str) -> Result<()> {
        Ok(self.typed.send(Some(OperatorInput::Line(word.into())))?)
    }

    /// Stops the run if its time is over. Called for each event of the run.
    ///
    /// # Errors
    /// If the run has ended.
    pub(super) fn look_at_clock(&mut self) -> Result<()> {
        if self.end.take_if(|end| now() >= *end).is_some() { self.say("stop") } else { Ok(()) }
    }
}
