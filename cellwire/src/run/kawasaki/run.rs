//! The run: one order after another, until every job is done.

use std::cell::Cell;
use std::time::Duration;

use anyhow::{Context as _, Result, bail, ensure};
use kawasaki_msg::{LargePc, MessageError, PcConfig, PcEvent, Phase, SessionError};
use robot_session::now;
use serde_json::{Value, json};

use super::jobs::Jobs;
use super::journal::{Entry, Journal};
use super::order::Order;
use crate::devices::kawasaki_msg::endpoint::{self, Connection, Packets, Report};
use crate::devices::kawasaki_msg::peer_endpoint::{PeerEndpoint, Side};
use crate::io::journal::Outcome;
use crate::run::{self, Console, ResumeAnswer, ResumeChoice, STOP_WITHIN};
use cellwire_io::clock::Clock;
use cellwire_io::drive::ConnectionLost;
use cellwire_io::trace::Trace;

/// The end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunEnd {
    /// Every job of the work is done.
    Complete,
    /// The operator has stopped it, or a question was not answered.
    Stopped,
    /// The robot refuses the order: it has another order, or accepts none.
    Refused {
        /// The number of the robot's order; 0 without an order.
        active: u16,
    },
}

type Pc<'a> = LargePc<Order<'a>>;

/// Jobs that are executed.
#[allow(missing_debug_implementations, reason = "it holds what notifies")]
pub struct Runner<'a> {
    jobs: &'a Jobs,
    config: PcConfig,
    journal: &'a mut Journal,
    console: Console<'a>,
    /// The number of the next order, if given.
    order: Option<u16>,
    /// The answer for the jobs that an earlier run has left unknown, if given.
    answer: Option<ResumeChoice>,
    /// The time for which no robot may be connected.
    absence: Option<Duration>,
    ended: Option<RunEnd>,
    /// Whether jobs are asked about.
    asks: bool,
    /// The number of jobs that were done before the order began, and the number of its jobs that are reported as done.
    before: usize,
    reported: u32,
    /// Whether a robot is connected, and since when it is so.
    connected: bool,
    since: Duration,
    met: bool,
    alarm: bool,
    /// The number of messages of this connection that are not in the table of messages; `None` once one is.
    strange: Option<u32>,
}

/// The number of such messages that shows a wrong table.
const STRANGE: u32 = 3;
const NO_TABLE: &str = "no message of the robot is in the table of messages: give the plant's with --settings; `cellwire identify CAPTURE --link kawasaki --draft FILE` drafts one from a capture";

impl<'a> Runner<'a> {
    /// Creates a run that continues at the end of the journal; `answer` is the outcome of jobs that an earlier run has left
    /// unknown. The run ends if no robot is connected for as long as `absence`.
    pub fn new(
        jobs: &'a Jobs,
        config: PcConfig,
        journal: &'a mut Journal,
        order: Option<u16>,
        answer: Option<ResumeChoice>,
        absence: Option<Duration>,
        console: Console<'a>,
    ) -> Self {
        let (ended, asks, before, reported) = (None, false, 0, 0);
        let (connected, since, met, alarm, strange) = (false, now(), false, false, None);
        Self {
            jobs,
            config,
            journal,
            console,
            order,
            answer,
            absence,
            ended,
            asks,
            before,
            reported,
            connected,
            since,
            met,
            alarm,
            strange,
        }
    }

    /// Runs to the end of the jobs, or until it is stopped; counts the packets that were sent.
    ///
    /// # Errors
    /// No robot for too long; a journal that cannot be written; a configuration that cannot work.
    pub fn run(mut self, meeting: &mut PeerEndpoint, trace: &Trace) -> Result<(RunEnd, Packets)> {
        let layout = self.jobs.layout().clone();
        let mut pc = LargePc::with_ranges(self.config, layout)?;
        if let Some(flight) = &self.journal.record().flight {
            if flight.max_number != self.config.max_number {
                bail!(
                    "order {} was started with max_number = {}: finish it with the same value",
                    flight.order,
                    flight.max_number
                );
            }
            let source = Order { jobs: &self.jobs.work, places: flight.places.clone() };
            pc.resume(flight.order, source, flight.executed, flight.sent, flight.ahead.iter().copied())?;
            self.reported = flight.executed;
            self.before = self.jobs.work.len() - flight.places.len();
            let (order, sent) = (flight.order, flight.sent);
            let executed = flight.executed;
            self.console.notify(
                json!({"event": "order_resumed", "order": order, "executed": executed, "sent": sent}),
            );
        }
        let (is_over, clock) = (Cell::new(false), Clock::start());
        let goes_on = || !is_over.get();
        let packets =
            endpoint::run(
                Side::Pc,
                meeting,
                trace,
                clock,
                &mut pc,
                goes_on,
                |session, report| match report {
                    Report::Event(event) => self.event(event),
                    Report::Sending => self.keep(session),
                    Report::Settled => self.step(session).map(|goes_on| is_over.set(!goes_on)),
                    Report::Connection(change) => self.connection(change),
                    Report::Handled(_) => Ok(()),
                },
            )?;
        Ok((self.ended.unwrap_or(RunEnd::Stopped), packets))
    }

    /// Begins the next order: all jobs that are not done.
    fn begin(&mut self, session: &mut Pc<'a>) -> Result<()> {
        let used = &self.journal.record().numbers;
        let free = || core::iter::repeat_with(|| fastrand::u16(1..)).find(|number| !used.contains(number));
        // After 65 thousand orders every number was used.
        let any = || if used.len() < usize::from(u16::MAX) / 2 { free() } else { None };
        let number = self.order.take().or_else(any).unwrap_or_else(|| fastrand::u16(1..));
        let places = self.journal.begin(number, self.config.max_number)?;
        self.answer = None; // it is not meant for jobs of this run
        (self.before, self.reported) = (self.jobs.work.len() - places.len(), 0);
        session.start(number, Order { jobs: &self.jobs.work, places })?;
        Ok(())
    }

    /// Notes an answer about jobs.
    fn answer(&mut self, answered: ResumeAnswer) -> Result<()> {
        for span in answered.spans() {
            self.journal.note(&Entry::Answer(span))?;
        }
        self.asks = false;
        self.console.progress(self.journal.tally());
        self.console.notify_answered(answered);
        Ok(())
    }

    /// Asks the operator for the outcomes of jobs.
    fn ask(&mut self, first: usize, count: usize) {
        let event = self.span("", first, count);
        self.asks = self.console.ask((first, count), Duration::ZERO, event);
    }

    /// Called when the jobs of the order up to this count are done.
    fn done(&mut self, executed: u32) {
        let Some(flight) = &self.journal.record().flight else { return };
        let from = self.reported;
        self.reported = executed.max(from);
        let indices = from as usize..executed as usize;
        let places = flight.places.get(indices).unwrap_or_default();
        let lines: Vec<Value> = places
            .chunk_by(|a, b| a + 1 == *b)
            .filter_map(|run| Some(self.span("done", *run.first()?, run.len())))
            .collect();
        lines.into_iter().for_each(|line| self.console.notify(line));
        self.console.progress(self.journal.tally());
    }

    /// Returns an event about jobs with consecutive numbers: the number of the first, and their lines or outlines in the
    /// file.
    fn span(&self, event: &str, first: usize, count: usize) -> Value {
        run::span(event, (first, count), self.jobs.unit, |at| self.jobs.lines.get(at).copied())
    }

    fn check_absence(&self) -> Result<()> {
        let is_strange = self.strange.is_some_and(|strange| strange >= STRANGE);
        let is_absent = !self.connected || is_strange;
        let Some(most) = self.absence.filter(|most| is_absent && now() - self.since > *most) else {
            return Ok(());
        };
        ensure!(!is_strange, NO_TABLE);
        let most = humantime::format_duration(most);
        match self.met {
            true => Err(ConnectionLost(format!("the robot has been disconnected for {most}")).into()),
            false => bail!("no robot connected within {most}: see --robot-timeout"),
        }
    }

    /// Stores the state in the journal before anything is sent.
    fn keep(&mut self, session: &mut Pc<'a>) -> Result<()> {
        if session.order().is_none() {
            return Ok(());
        }
        let progress = self.journal.progress(session.executed(), session.sent());
        if progress.context("the packet was not sent, and the connection was closed")? {
            self.console.progress(self.journal.tally());
        }
        Ok(())
    }

    /// Acts on the session once everything that has happened was reported; false ends the run.
    fn step(&mut self, session: &mut Pc<'a>) -> Result<bool> {
        while let Some(answered) = self.console.listen(Duration::ZERO) {
            self.answer(answered)?;
        }
        if session.order().is_some() {
            if self.console.stopping && (!self.connected || self.console.has_waited(STOP_WITHIN)) {
                // Nothing can be sent, or it has no effect: the robot executes what it has queued.
                return Ok(false);
            }
            if self.console.paused || self.console.stopping {
                self.journal.break_off()?;
                // After the job that is being executed; if the plant has no message for that, after the jobs that the robot
                // has queued.
                if let Err(SessionError::Lacks { .. }) = session.interrupt() {
                    // The order is ending already, or has not begun: then the call is retried.
                    let _ = session.end();
                }
            }
            self.check_absence()?;
            return Ok(true);
        }
        if self.ended.is_some() || self.console.stopping {
            return Ok(false);
        }
        if self.asks || self.console.paused {
            return Ok(true);
        }
        if let Some((first, count)) = self.journal.unknown() {
            match self.answer.and_then(|answer| answer.done(first, count)) {
                Some(done) => self.answer(ResumeAnswer { first, count, done })?,
                None => self.ask(first, count),
            }
        } else if self.journal.count(Outcome::NotSent) == 0 {
            self.ended = Some(RunEnd::Complete);
        } else {
            self.begin(session)?;
        }
        Ok(self.ended.is_none() && !(self.console.stopping && session.order().is_none()))
    }

    fn event(&mut self, event: PcEvent) -> Result<()> {
        match (&event, &mut self.strange) {
            (PcEvent::Rejected(MessageError::UnknownName { .. }), Some(strange)) => {
                *strange = strange.saturating_add(1);
                if *strange == STRANGE {
                    self.console.hint(NO_TABLE);
                }
            }
            (PcEvent::Corrupt(_) | PcEvent::Rejected(MessageError::UnknownName { .. }), _) => {}
            _ => self.strange = None,
        }
        let shown = match event {
            PcEvent::Progress { executed, .. } => {
                self.done(executed);
                return Ok(());
            }
            PcEvent::ExecutedAhead { index } => {
                self.journal.note(&Entry::Ahead { ahead: index })?;
                let flight = self.journal.record().flight.as_ref();
                let place = flight.and_then(|flight| flight.places.get(index as usize).copied());
                let Some(place) = place else { return Ok(()) };
                self.span("done", place, 1)
            }
            PcEvent::OrderOver { executed, complete, .. } => {
                self.done(executed);
                let flight = self.journal.record().flight.as_ref();
                let is_expected = flight.is_none_or(|flight| flight.sent == 0 || flight.is_broken_off);
                self.journal.note(&Entry::End { end: executed, unknown: executed })?;
                self.console.notify(serde_json::to_value(event)?);
                if complete || self.console.paused || self.console.stopping || is_expected {
                    return Ok(());
                }
                // The order was ended at the robot.
                if self.console.is_without_keyboard(Duration::ZERO) {
                    self.console.stopping = true;
                    self.console.hint("the robot has ended the order: the same command executes the rest");
                    return Ok(());
                }
                self.console.paused = true;
                self.console
                    .hint("the robot has ended the order: type continue to execute the rest, or stop");
                return Ok(());
            }
            PcEvent::OutcomeUnknown { order, executed, sent } => {
                self.done(executed);
                self.journal.note(&Entry::End { end: executed, unknown: sent })?;
                let why = "the robot no longer has the order: it was restarted, or received another one";
                json!({"event": "unknown", "order": order, "why": why})
            }
            PcEvent::OrderRefused { given_up: true, active, .. } => {
                self.journal.note(&Entry::End { end: 0, unknown: 0 })?;
                self.ended = Some(RunEnd::Refused { active });
                serde_json::to_value(event)?
            }
            PcEvent::JobUnfit { index, error, .. } => bail!("job {} of the order: {error}", index + 1),
            PcEvent::PeerStatus { phase, order, .. } => {
                let before = core::mem::replace(&mut self.alarm, phase == Phase::Alarm);
                if !self.alarm || before {
                    return Ok(());
                }
                let what = "the robot has an alarm and executes nothing: reset it at the robot, or type stop; if it has executed no \
                            job at all, compare [[job]] and the messages in the settings of both ends";
                json!({"event": "alarm", "order": order, "what": what})
            }
            PcEvent::Corrupt(_) | PcEvent::Rejected(_) => {
                self.console.notice(serde_json::to_value(event)?);
                return Ok(());
            }
            _ => serde_json::to_value(event)?,
        };
        self.console.notify(shown);
        Ok(())
    }

    fn connection(&mut self, connection: Connection<'_>) -> Result<()> {
        let line = match connection {
            Connection::Connected(peer) => {
                (self.connected, self.since, self.met) = (true, now(), true);
                self.strange = Some(0);
                json!({"event": "connected", "peer": peer})
            }
            Connection::Disconnected(why) => {
                (self.connected, self.since, self.strange) = (false, now(), None);
                json!({"event": "disconnected", "why": why})
            }
            Connection::Traced(path) => json!({"event": "trace", "path": path}),
        };
        self.console.notify(line);
        Ok(())
    }
}
