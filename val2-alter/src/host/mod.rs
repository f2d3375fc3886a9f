//! The host computer's end: answers the controller's messages within their deadline.

mod config;

pub use config::{HostConfig, HostEvent, HostStats, Policy, Select, Unselected};

use core::time::Duration;

use crate::decoder::{Decoder, Received};
use crate::limit::Limiter;
use crate::message::{
    AXES, Accumulation, ErrorCode, Exception, HostMessage, Message, Mode, Motion, MotionPhase, Reply,
    RobotMessage, Start, StartCode,
};
use crate::queue::Queue;
use crate::state::{HostInput, HostState};
use crate::timing::{self, Budget};
use crate::{DecodeError, Framing, SessionError};

/// The host computer's session. It never reads a clock and never blocks.
///
/// Order: [`handle_input`](Host::handle_input) with what was read and the time when it arrived,
/// [`handle_timeout`](Host::handle_timeout), [`poll_event`](Host::poll_event) until `None`,
/// [`poll_transmit`](Host::poll_transmit) and write what it gives, then wait for bytes until
/// [`poll_timeout`](Host::poll_timeout). [`set_target`](Host::set_target) at any time: the reply to a message is made when
/// `poll_transmit` is called, from the target of that moment, within the limits.
///
/// A decode error costs the bytes that it names; the session goes on, and asks again for a damaged start message. Of 16
/// events that nobody fetches, the oldest is dropped and counted.
#[derive(Debug, Clone)]
pub struct Host {
    config: HostConfig,
    decoder: Decoder<RobotMessage>,
    events: Queue<HostEvent, 16>,
    stats: HostStats,
    state: HostState,
    mode: Mode,
    due: Option<Due>,
    heard: Duration,
    last_input: Duration,
    repeats: u8,
    target: [i16; AXES],
    limiter: Limiter,
    /// The values of the last reply, and whether the controller has read them.
    sent: [i16; AXES],
    sent_is_known: bool,
    exception: Exception,
    sent_exception: Exception,
}

impl Host {
    /// A host that has heard nothing yet.
    pub fn new(config: HostConfig) -> Self {
        Self {
            config,
            decoder: Decoder::new(config.framing),
            events: Queue::new(),
            stats: HostStats::default(),
            state: HostState::Idle,
            mode: Mode::default(),
            due: None,
            heard: Duration::ZERO,
            last_input: Duration::ZERO,
            repeats: 0,
            target: [0; AXES],
            limiter: Limiter::new(config.limits),
            sent: [0; AXES],
            sent_is_known: false,
            exception: Exception::None,
            sent_exception: Exception::None,
        }
    }

    /// Takes bytes that arrived at `now`. All of them are taken.
    pub fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.handle_timeout(now);
        let silent = now.saturating_sub(self.last_input);
        if self.decoder.pending() > 0 && self.config.gap.is_some_and(|gap| silent > gap) {
            self.decoder.finish();
            self.read(now);
        }
        self.last_input = now;
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.decoder.push(rest);
            rest = rest.get(taken..).unwrap_or_default();
            self.read(now);
        }
    }

    /// Lets time pass: a deadline without a reply is a missed cycle, a silent controller is gone.
    pub fn handle_timeout(&mut self, now: Duration) {
        if self.reply_by().is_some_and(|deadline| now >= deadline) {
            self.miss();
        }
        if self.silent_at().is_some_and(|at| now >= at) {
            self.state = self.state.on(HostInput::Silence);
            self.due = None;
            self.stats.lost += 1;
            self.tell(HostEvent::Lost);
        }
    }

    /// Writes the answer that is due into `out`, which has room for [`Host::MAX_TRANSMIT`] bytes, and returns its length.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let due = self.due?;
        match due.answer {
            Answer::Motion(phase) => self.reply(now, due, phase, out),
            Answer::Start => self.answer_start(now, due, out),
            Answer::Repeat => {
                let len = self.write(now, due, HostMessage::StartReply(StartCode::Repeat), out)?;
                self.repeats += 1;
                Some(len)
            }
        }
    }

    /// The next event.
    pub fn poll_event(&mut self) -> Option<HostEvent> {
        self.events.pop()
    }

    /// When to call `handle_timeout` at the latest: the deadline of the reply that is due (see [`Host::reply_by`]), or the
    /// time when the controller counts as gone.
    pub fn poll_timeout(&self) -> Option<Duration> {
        [self.reply_by(), self.silent_at()].into_iter().flatten().min()
    }

    /// The most bytes that `poll_transmit` writes.
    pub const MAX_TRANSMIT: usize =
        timing::max_reply_len(AXES, Framing { stuffed_checksum: true, ..Framing::DEFAULT });

    /// Sets where the next replies go, in units of their words: a speed in each cycle (cumulative), or an offset from the path
    /// (non-cumulative). It holds until it is set again; a new start sets it to zero. A caller whose source of targets may
    /// fall silent sets it to zero itself.
    pub fn set_target(&mut self, target: [i16; AXES]) {
        self.target = target;
    }

    /// Sends an exception code with the next reply, once.
    ///
    /// # Errors
    /// [`SessionError::NoSubroutine`] when the configuration says that the ALTER instruction names none,
    /// [`SessionError::NotRunning`], and [`SessionError::ExceptionPending`] while the code before is not sent yet.
    pub fn exception(&mut self, exception: Exception) -> Result<(), SessionError> {
        if !self.config.subroutine {
            Err(SessionError::NoSubroutine)
        } else if self.state != HostState::Running {
            Err(SessionError::NotRunning)
        } else if self.exception != Exception::None {
            Err(SessionError::ExceptionPending { pending: self.exception.into() })
        } else {
            self.exception = exception;
            Ok(())
        }
    }

    /// Brings the values to zero within the limits, then falls silent; the controller ends ALTER by that (§3.3.3). The policy
    /// becomes [`Policy::Ignore`]: [`Host::set_policy`] takes ALTER up again.
    pub fn stop(&mut self) {
        self.config.policy = Policy::Ignore;
        self.state = self.state.on(HostInput::Stop);
        if self.state == HostState::Idle {
            self.due = None;
        }
    }

    /// Sets how start messages are answered from now on, one that is not answered yet included.
    pub fn set_policy(&mut self, policy: Policy) {
        self.config.policy = policy;
    }

    /// How start messages are answered.
    pub fn policy(&self) -> Policy {
        self.config.policy
    }

    /// Whether the ALTER instruction names an exception subroutine, when that changes with the robot's program.
    pub fn set_subroutine(&mut self, installed: bool) {
        self.config.subroutine = installed;
    }

    /// Where the session stands.
    pub fn state(&self) -> HostState {
        self.state
    }

    /// The mode of the last start message.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// The values of the last reply, in units of their words.
    pub fn values(&self) -> [i16; AXES] {
        self.sent
    }

    /// What has been counted.
    pub fn stats(&self) -> HostStats {
        HostStats { events_lost: self.events.lost(), ..self.stats }
    }

    /// The time by which the answer that is due must begin to leave: the window less the time that an answer without doubled
    /// DLEs takes. `None` when none is due.
    pub fn reply_by(&self) -> Option<Duration> {
        let due = self.due?;
        let values = match (due.answer, self.config.select) {
            (Answer::Motion(_), Select::All) => AXES,
            (Answer::Motion(_), Select::Needed) | (Answer::Start | Answer::Repeat, _) => 0,
        };
        let shortest = HostMessage::Reply(Reply { values: [None; AXES], ..Reply::NOTHING });
        let len = shortest.encoded_len(self.config.framing) + 2 * values;
        Some(self.deadline(due, len))
    }

    fn deadline(&self, due: Due, reply_len: usize) -> Duration {
        let budget = Budget::new(self.mode.accumulation(), self.config.baud, due.request_len, reply_len);
        due.arrived + budget.slack().unwrap_or_default()
    }

    fn silent_at(&self) -> Option<Duration> {
        (self.state != HostState::Idle).then(|| self.heard + timing::CYCLE * self.config.silence_cycles)
    }

    fn read(&mut self, now: Duration) {
        while let Some(outcome) = self.decoder.next_frame() {
            match outcome {
                Ok(Received { message: RobotMessage::Start(start), length, .. }) => {
                    self.on_start(now, start, length);
                }
                Ok(Received { message: RobotMessage::Motion(motion), length, .. }) => {
                    self.on_motion(now, motion, length);
                }
                Ok(Received { message: RobotMessage::End(end), .. }) => {
                    self.heard(now, HostInput::End);
                    self.due = None;
                    self.stats.ends += 1;
                    self.tell(HostEvent::End(end));
                }
                Err(error) => self.on_damage(now, error),
            }
        }
    }

    fn on_start(&mut self, now: Duration, start: Start, length: usize) {
        self.heard(now, HostInput::Start);
        if self.due.is_some() {
            self.miss();
        }
        self.mode = start.mode;
        self.repeats = 0;
        self.due = Some(Due { answer: Answer::Start, arrived: now, request_len: length });
        self.tell(HostEvent::Start(start));
    }

    fn on_motion(&mut self, now: Duration, motion: Motion, length: usize) {
        self.heard(
            now,
            match motion.phase {
                MotionPhase::Running => HostInput::Motion,
                MotionPhase::Interrupted => HostInput::Interruption,
            },
        );
        if let HostState::Running | HostState::Interrupted | HostState::Stopping = self.state {
            if self.due.is_some() {
                self.miss();
            }
            if motion.error != ErrorCode::None {
                self.on_rejection(motion.error);
            }
            self.sent_exception = Exception::None;
            self.stats.cycles += 1;
            self.due = Some(Due { answer: Answer::Motion(motion.phase), arrived: now, request_len: length });
        }
        self.tell(HostEvent::Motion(motion));
    }

    /// The arm stood for a cycle: it begins again from rest.
    fn on_rejection(&mut self, error: ErrorCode) {
        self.limiter.rejected();
        self.sent_is_known = false;
        if self.exception == Exception::None {
            self.exception = self.sent_exception;
        }
        self.stats.rejected += 1;
        self.tell(HostEvent::Rejected(error));
    }

    fn on_damage(&mut self, now: Duration, error: DecodeError) {
        self.stats.damaged += 1;
        self.tell(HostEvent::Damaged(error));
        // "Der externe Rechner hat einen Kommunikationsfehler entdeckt und erwartet, daß die Robotersteuerung die einleitende
        // Nachricht wiederholt" (§3.3.1). A damaged standard message has no such answer: the controller's timeout tells it.
        let no_frame = matches!(error, DecodeError::StartMark { .. });
        let starting = matches!(self.state, HostState::Idle | HostState::Starting);
        let wanted = self.config.policy == Policy::Accept && self.repeats < self.config.repeats;
        if starting && wanted && !no_frame && self.due.is_none() {
            self.due = Some(Due { answer: Answer::Repeat, arrived: now, request_len: 0 });
        }
    }

    fn answer_start(&mut self, now: Duration, due: Due, out: &mut [u8]) -> Option<usize> {
        let (code, input) = match self.config.policy {
            Policy::Accept => (StartCode::Accept, HostInput::Accept),
            Policy::Refuse => (StartCode::Refuse, HostInput::Decline),
            Policy::Ignore => {
                self.state = self.state.on(HostInput::Decline);
                self.due = None;
                return None;
            }
        };
        let len = self.write(now, due, HostMessage::StartReply(code), out)?;
        self.state = self.state.on(input);
        if code == StartCode::Accept {
            self.stats.starts += 1;
            self.limiter.restart();
            (self.target, self.sent, self.sent_is_known) = ([0; AXES], [0; AXES], true);
            (self.exception, self.sent_exception) = (Exception::None, Exception::None);
        }
        Some(len)
    }

    fn reply(&mut self, now: Duration, due: Due, phase: MotionPhase, out: &mut [u8]) -> Option<usize> {
        let mut limiter = self.limiter;
        let running = self.state == HostState::Running;
        let values = match self.mode.accumulation() {
            Accumulation::Cumulative => limiter.speeds(if running { self.target } else { [0; AXES] }),
            Accumulation::NonCumulative => limiter.positions(match self.state {
                HostState::Running => self.target,
                HostState::Interrupted => limiter.position(),
                _ => [0; AXES],
            }),
        };
        let exception = if running { self.exception } else { Exception::None };
        let reply = Reply { exception, values: self.selected(values) };
        let len = self.write(now, due, HostMessage::Reply(reply), out)?;
        self.limiter = limiter;
        // Nobody knows whether a controller keeps the words that come while its subroutine runs.
        (self.sent, self.sent_is_known) = (values, phase == MotionPhase::Running);
        if exception != Exception::None {
            (self.sent_exception, self.exception) = (exception, Exception::None);
        }
        self.stats.replies += 1;
        if self.state == HostState::Stopping && values == [0; AXES] && limiter.is_at_rest() {
            self.state = self.state.on(HostInput::AtZero);
            self.tell(HostEvent::Stopped);
        }
        Some(len)
    }

    fn selected(&self, values: [i16; AXES]) -> [Option<i16>; AXES] {
        if self.config.select == Select::All || !self.sent_is_known {
            return values.map(Some);
        }
        let holds = self.config.unselected.holds(self.mode.accumulation());
        let assumed = if holds { self.sent } else { [0; AXES] };
        let mut selected = values.map(Some);
        for (value, assumed) in selected.iter_mut().zip(assumed) {
            *value = value.filter(|value| *value != assumed);
        }
        selected
    }

    /// Writes an answer, unless it would end behind the window.
    fn write(&mut self, now: Duration, due: Due, message: HostMessage, out: &mut [u8]) -> Option<usize> {
        let len = message.encode(self.config.framing, out).ok()?;
        if now > self.deadline(due, len) {
            self.miss();
            return None;
        }
        self.due = None;
        Some(len)
    }

    /// The arm stands for want of a reply: should ALTER go on all the same, it begins again from rest.
    fn miss(&mut self) {
        self.due = None;
        self.limiter.rest();
        self.stats.missed += 1;
        self.tell(HostEvent::Missed);
    }

    fn heard(&mut self, now: Duration, input: HostInput) {
        self.heard = now;
        self.state = self.state.on(input);
    }

    fn tell(&mut self, event: HostEvent) {
        self.events.push(event);
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Answer {
    Start,
    Repeat,
    Motion(MotionPhase),
}

/// The answer that is due, and what its deadline follows from.
#[derive(Debug, Clone, Copy)]
struct Due {
    answer: Answer,
    arrived: Duration,
    request_len: usize,
}
