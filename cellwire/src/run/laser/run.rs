//! The run: one frame at a time, so that never more than one is unknown.

use std::time::Duration;

use anyhow::{Context, Result, bail};
use laser_eb90::host::machine::HostLink;
use laser_eb90::{Class, Host, HostConfig, HostEvent, SessionError, UnknownReason};
use robot_session::end::End as _;
use robot_session::{Driver, Session as _, Transport, now};
use serde_json::{Value, json};

use super::Journal;
use super::program::Program;
use super::route::Instruction;
use crate::io::journal::{Outcome, Span};
use crate::run::{self, Console, KEYBOARD_WITHIN, ResumeAnswer, ResumeChoice, STOP_WITHIN};
use cellwire_io::drive::{ConnectionLost, turn};

/// The interval at which the operator's words are checked.
const OPERATOR_CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// The end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunEnd {
    /// Every instruction of the program is done.
    Complete,
    /// The operator has stopped it, or a question was not answered.
    Stopped,
    /// The controller refuses an instruction.
    Refused,
}

/// Returns the time for which the line must be silent before the next frame.
fn silence_left(host: &Host) -> Duration {
    match host.machine().link {
        HostLink::Idle { quiet_until } => quiet_until.saturating_sub(now()),
        _ => Duration::ZERO,
    }
}

/// A program that is run.
#[allow(missing_debug_implementations, reason = "it holds what notifies")]
pub struct Runner<'a> {
    program: &'a Program,
    journal: &'a mut Journal,
    config: HostConfig,
    console: Console<'a>,
    /// The instructions in flight, and the host's number of the first.
    flight: Option<(usize, usize)>,
    refused: bool,
    unknown: bool,
}

impl<'a> Runner<'a> {
    /// Creates a run that continues at the end of the journal.
    pub fn new(
        program: &'a Program,
        journal: &'a mut Journal,
        config: HostConfig,
        console: Console<'a>,
    ) -> Self {
        let (flight, refused, unknown) = (None, false, false);
        Self { program, journal, config, console, flight, refused, unknown }
    }

    /// Settles the instructions that an earlier run has left unknown: by `answer` if it is given, otherwise by the operator's
    /// answer; returns false when the operator stops.
    ///
    /// # Errors
    /// If the journal cannot be written.
    pub fn settle_earlier(&mut self, answer: Option<ResumeChoice>) -> Result<bool> {
        while let Some((first, count)) = self.journal.unknown()
            && let Some(done) = answer.and_then(|answer| answer.done(first, count))
        {
            self.answer(ResumeAnswer { first, count, done })?;
        }
        self.settle_unknown("an earlier run ended before the answer")
    }

    /// Asks about every instruction whose outcome is unknown, with the reason; returns false when the operator stops.
    ///
    /// # Errors
    /// If the journal cannot be written.
    fn settle_unknown(&mut self, why: &str) -> Result<bool> {
        while let Some((first, count)) = self.journal.unknown() {
            if !self.ask(first, count, why)? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Runs to the end of the program, or until it is stopped.
    ///
    /// # Errors
    /// A lost connection; a journal that cannot be written. The journal has every outcome then, too.
    pub fn run<T: Transport>(&mut self, transport: T) -> Result<RunEnd> {
        let mut driver = Driver::new(transport);
        let mut host = Host::new(self.config)?;
        host.handle_connected(now());
        loop {
            // While the run is paused there is no other work.
            let wait = if self.console.paused && self.flight.is_none() {
                OPERATOR_CHECK_INTERVAL
            } else {
                Duration::ZERO
            };
            self.console.listen(wait);
            let silence = silence_left(&host);
            if host.is_idle() && self.flight.is_none() {
                if self.console.stopping {
                    return Ok(RunEnd::Stopped);
                }
                // An instruction is noted when it is sent, not while the line must be silent first.
                if !self.console.paused && silence.is_zero() && !self.submit(&mut host)? {
                    return Ok(RunEnd::Complete);
                }
            }
            if self.flight.is_some() && self.console.has_waited(STOP_WITHIN) {
                self.outcome(Outcome::Unknown, "no outcome in the time that a stop may take")?;
                return Ok(RunEnd::Stopped);
            }
            let wait = match silence {
                Duration::ZERO => OPERATOR_CHECK_INTERVAL,
                left => left.min(OPERATOR_CHECK_INTERVAL),
            };
            let goes_on = turn(&mut driver, &mut host, Some(wait), |host, event| self.take(host, event));
            if !matches!(goes_on, Ok(true)) && self.flight.is_some() {
                self.outcome(Outcome::Unknown, "the connection was lost")?;
            }
            match goes_on {
                Ok(true) => {}
                Ok(false) => {
                    return Err(ConnectionLost("the connection to the controller was closed".into()).into());
                }
                Err(error) if error.is::<std::io::Error>() => {
                    return Err(ConnectionLost(format!(
                        "the connection to the controller was lost: {error:#}"
                    ))
                    .into());
                }
                Err(error) => return Err(error),
            }
            if self.refused {
                return Ok(RunEnd::Refused);
            }
            if core::mem::take(&mut self.unknown) {
                if !self.settle_unknown("the controller may have executed them: look at the machine")? {
                    return Ok(RunEnd::Stopped);
                }
                host.resume();
            }
        }
    }

    /// Submits the next frame, and notes before it is sent that it may have been; false at the end of the program.
    fn submit(&mut self, host: &mut Host) -> Result<bool> {
        let open = |known: &Outcome| matches!(known, Outcome::NotSent | Outcome::Refused);
        let outcomes = self.journal.outcomes();
        let Some(first) = outcomes.iter().position(open) else { return Ok(false) };
        let mut count = 0;
        for instruction in self.program.instructions.iter().skip(first) {
            let Instruction { word, values, .. } = instruction;
            if count > 0 && !outcomes.get(first + count).is_some_and(open) {
                break;
            }
            match host.submit(*word, |parameters| match values.as_slice() {
                [] => Ok(()),
                values => parameters.f32(values).map(drop),
            }) {
                Ok(_) => count += 1,
                Err(SessionError::Full) => break,
                Err(error) => {
                    let line = instruction.line;
                    return Err(error).with_context(|| format!("line {line} cannot be sent"));
                }
            }
            if self.config.words.class(*word) != Some(Class::Interpreted) {
                break;
            }
        }
        if count == 0 {
            bail!("the host accepts no instruction: please report this as a bug");
        }
        self.note(Outcome::Unknown, first, count).context("nothing of it was sent")?;
        self.flight = Some((first, count));
        Ok(true)
    }

    fn take(&mut self, _: &mut Host, event: HostEvent) -> Result<()> {
        let event = match event {
            HostEvent::Done { .. } => return self.outcome(Outcome::Done, ""),
            HostEvent::Refused { refusal, .. } => {
                self.refused = true;
                return self.outcome(Outcome::Refused, &format!("the controller refuses: {refusal}"));
            }
            HostEvent::Unknown { reason, .. } => {
                self.unknown = true;
                let limit = self.config.answer_timeout;
                let why = match reason {
                    UnknownReason::Silence => format!("no answer within {limit:?}"),
                    reason => reason.to_string(),
                };
                return self.outcome(Outcome::Unknown, &why);
            }
            HostEvent::Unasked { word } => json!({"event": "unasked", "word": word}),
            HostEvent::Corrupt(error) => json!({"event": "corrupt", "error": error}),
            HostEvent::Echo(error) => json!({"event": "echo", "error": error, "text": error.to_string()}),
            other => json!({"event": "notice", "what": format!("{other:?}")}),
        };
        self.console.notice(event);
        Ok(())
    }

    fn outcome(&mut self, outcome: Outcome, why: &str) -> Result<()> {
        let Some((first, count)) = self.flight.take() else { return Ok(()) };
        self.note(outcome, first, count)?;
        let line = self.span(outcome.name(), first, count, why);
        self.console.notify(line);
        Ok(())
    }

    fn note(&mut self, outcome: Outcome, first: usize, count: usize) -> Result<()> {
        self.journal.note(&Span { outcome, first, count })?;
        self.console.progress(self.journal.tally());
        Ok(())
    }

    /// Returns an event about instructions with consecutive numbers, with their lines or outlines in the file.
    fn span(&self, event: &str, first: usize, count: usize, why: &str) -> Value {
        let line = |at: usize| self.program.instructions.get(at).map(|it| it.line);
        let mut span = run::span(event, (first, count), self.program.unit, line);
        if let Some(fields) = span.as_object_mut().filter(|_| !why.is_empty()) {
            fields.insert("why".into(), why.into());
        }
        span
    }

    /// Asks the operator for the outcomes of instructions; returns false if the operator stops, or cannot answer.
    fn ask(&mut self, first: usize, count: usize, why: &str) -> Result<bool> {
        let event = self.span("", first, count, why);
        if !self.console.ask((first, count), KEYBOARD_WITHIN, event) {
            return Ok(false);
        }
        match self.console.answer() {
            Some(answered) => self.answer(answered).map(|()| true),
            None => Ok(false),
        }
    }

    fn answer(&mut self, answered: ResumeAnswer) -> Result<()> {
        for Span { outcome, first, count } in answered.spans() {
            self.note(outcome, first, count)?;
        }
        self.console.notify_answered(answered);
        Ok(())
    }
}
