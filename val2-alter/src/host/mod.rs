//! The host computer's end: answers the controller's messages within their deadline.

mod active;
mod config;
mod due;
mod input;
mod machine;
mod state;

pub use config::{
    ExceptionOutcome, HostConfig, HostEvent, HostRule, HostStatistics, LostReason, Policy, UnknownReason,
};
pub use due::Due;
pub use input::{Answer, Course, Draft, HostActions, HostInput, Wanted};
pub use state::{Active, HostMachine, HostPhase, Pending, Request, Stage, Target};

use core::time::Duration;

use robot_session::{Decoder as _, EventQueue, Session, Unexpected};

use crate::decoder::{Decoder, Received};
use crate::error::{ConfigError, DecodeError, SessionError};
use crate::framing::{DLE, Framing};
use crate::limit::{Axes, Limiter};
use crate::message::{
    ALL, AXES, Accumulation, Exception, HostMessage, Message, Reply, RobotMessage, StartCode,
};
use crate::timing;

/// The host computer's session. Its verbs are those of [`robot_session::Session`]; it never reads a clock and never blocks.
///
/// [`set_target`](Host::set_target) at any time: the reply to a message is made when `poll_transmit` is called, from the target
/// of that moment, within the limits. A reply has all six words if they fit what is left of the window. Else it leaves out words
/// that are zero and were zero, which is right whatever the controller makes of them; an axis whose word does not fit waits at
/// rest until another has come to rest.
///
/// A corrupt frame costs the bytes that the error covers; the session goes on, and asks again for a corrupt start message. Of 16
/// events that nobody fetches, the oldest notice is dropped and counted; [`HostEvent::End`] and [`HostEvent::Lost`] of an ALTER,
/// [`HostEvent::Exception`] and [`HostEvent::Stopped`] are outcomes and are not.
#[derive(Debug, Clone)]
pub struct Host {
    config: HostConfig,
    machine: HostMachine,
    decoder: Decoder<RobotMessage>,
    events: EventQueue<HostEvent, 16>,
    statistics: HostStatistics,
    /// Where the caller goes, what the limits make of it, and what was sent last.
    target: [i16; AXES],
    limiter: Limiter,
    sent: [i16; AXES],
}

/// The longest reply has [`Host::MAX_TRANSMIT`] bytes: those of each word, the exception and the checksum are all doubled.
const LONGEST_WORD: u8 = 4;
const LONGEST_BARE: u8 = 10;
const _: () = assert!(LONGEST_BARE as usize + AXES * LONGEST_WORD as usize == Host::MAX_TRANSMIT);

/// The outcomes that an ALTER may have: its end, and that of a stop.
const OUTCOMES: usize = 2;

impl Host {
    /// A host whose port is not open.
    ///
    /// # Errors
    /// [`ConfigError::Window`]: not even one value fits the line; [`ConfigError::SilenceCycles`].
    pub fn new(config: HostConfig) -> Result<Self, ConfigError> {
        config.check()?;
        Ok(Self {
            machine: HostMachine::new(config.policy, config.subroutine),
            decoder: Decoder::new(config.framing),
            events: EventQueue::new(),
            statistics: HostStatistics::default(),
            target: [0; AXES],
            limiter: Limiter::new(config.limits),
            sent: [0; AXES],
            config,
        })
    }

    /// Sets where the next replies go, in units of their words: a speed in each cycle (cumulative), or an offset from the path
    /// (non-cumulative). It holds for [`HostConfig::target_timeout`]; a new start sets it to zero.
    pub fn set_target(&mut self, now: Duration, target: [i16; AXES]) {
        self.target = target;
        self.on(now, HostInput::Target);
    }

    /// The source of targets is lost: speeds go to zero (cumulative), an offset stays (non-cumulative), until a target is set.
    pub fn clear_target(&mut self, now: Duration) {
        self.on(now, HostInput::NoTarget);
    }

    /// Sends an exception code with the next reply, once. What became of it is a [`HostEvent::Exception`], after one message, or
    /// after two when the first one says that the reply was not read. If it was not late either, it is sent again.
    ///
    /// # Errors
    /// [`SessionError::NoSubroutine`] when the configuration says that the ALTER instruction names none,
    /// [`SessionError::NotRunning`], [`SessionError::ExceptionPending`] before the outcome of the one before, and
    /// [`SessionError::EventsFull`].
    pub fn exception(&mut self, now: Duration, exception: Exception) -> Result<(), SessionError> {
        let has_room = self.events.has_room(OUTCOMES + 1);
        let actions = self.on(now, HostInput::Exception { exception, has_room });
        actions.refused.map_or(Ok(()), Err)
    }

    /// Brings the values to zero within the limits, then answers no message; the controller ends ALTER by that (§3.3.3). The
    /// policy becomes [`Policy::Ignore`]: [`Host::set_policy`] takes ALTER up again. If ALTER runs, [`HostEvent::Stopped`],
    /// [`HostEvent::End`] or [`HostEvent::Lost`] follows.
    pub fn stop(&mut self, now: Duration) {
        self.on(now, HostInput::Stop);
    }

    /// Sets how start messages are answered from now on, one that is not answered yet included.
    pub fn set_policy(&mut self, now: Duration, policy: Policy) {
        self.on(now, HostInput::Policy(policy));
    }

    /// Whether the ALTER instruction names an exception subroutine, when that changes with the robot's program.
    pub fn set_subroutine(&mut self, now: Duration, installed: bool) {
        self.on(now, HostInput::Subroutine(installed));
    }

    /// The machine: what the session is doing.
    pub fn machine(&self) -> &HostMachine {
        &self.machine
    }

    /// What the session is doing, in a word.
    pub fn state(&self) -> HostState {
        match &self.machine.phase {
            HostPhase::Disconnected => HostState::Disconnected,
            HostPhase::Idle | HostPhase::Repeating { .. } => HostState::Idle,
            HostPhase::Starting { .. } => HostState::Starting,
            HostPhase::Active(active) => match active.stage {
                Stage::Accepted | Stage::Running => HostState::Running,
                Stage::Interrupted => HostState::Interrupted,
                Stage::Stopping { .. } => HostState::Stopping,
            },
            HostPhase::Silent { .. } => HostState::Silent,
        }
    }

    /// The configuration.
    pub fn config(&self) -> &HostConfig {
        &self.config
    }

    /// How start messages are answered.
    pub fn policy(&self) -> Policy {
        self.machine.policy
    }

    /// The values of the last reply, in units of their words.
    pub fn values(&self) -> [i16; AXES] {
        self.sent
    }

    /// The time by which the answer that is due must begin to leave: the window less the time that the shortest possible answer
    /// takes. `None` when none is due.
    pub fn reply_by(&self) -> Option<Duration> {
        self.machine.reply_by()
    }

    #[inline]
    fn read(&mut self, now: Duration) {
        loop {
            let item = self.decoder.next_frame();
            if self.decoder.corruption().is_some() {
                self.on_corrupt_frame(now);
            }
            match &item {
                None => return,
                Some(Ok(received)) => self.on_message(now, received),
                Some(Err(error)) => self.on_error(now, *error),
            }
        }
    }

    #[cold]
    fn end_frame(&mut self, now: Duration) {
        self.decoder.finish();
        self.read(now);
    }

    #[cold]
    fn on_corrupt_frame(&mut self, now: Duration) {
        self.on(now, HostInput::CorruptFrame);
    }

    #[cold]
    fn on_error(&mut self, now: Duration, error: DecodeError) {
        self.statistics.corrupt += 1;
        if let DecodeError::StartMark { .. } = error {
            self.on(now, HostInput::Noise);
        }
        self.events.push_notice(HostEvent::Corrupt(error));
    }

    #[inline(never)] // a message that is passed in registers is copied field by field
    fn on_message(&mut self, now: Duration, received: &Received<RobotMessage>) {
        let len = u8::try_from(received.length).unwrap_or(u8::MAX);
        match &received.message {
            RobotMessage::Start(start) => {
                let is_expected = start.mode == self.config.mode;
                self.on(now, HostInput::Start { is_expected, len });
                self.events.push_notice(HostEvent::Start(*start));
            }
            RobotMessage::Motion(motion) => {
                let (phase, error) = (motion.phase, motion.error);
                self.on(now, HostInput::Motion { phase, error, len });
                self.statistics.cycles += u64::from(matches!(&self.machine.phase, HostPhase::Active(_)));
                self.events.push_notice(HostEvent::Motion(*motion));
            }
            RobotMessage::End(end) => {
                let ended = self.on(now, HostInput::End).ended;
                self.statistics.ends += 1;
                if ended {
                    self.push_outcome(HostEvent::End(*end));
                } else {
                    self.events.push_notice(HostEvent::End(*end));
                }
            }
        }
    }

    /// Gives the machine an input and does what it says, but for sending.
    #[inline(always)] // where the input is known, little of it is left
    fn on(&mut self, now: Duration, input: HostInput) -> HostActions {
        let actions = match self.machine.on(now, input, &self.config) {
            Ok(actions) => actions,
            Err(unexpected) => {
                self.report(unexpected);
                return HostActions::default();
            }
        };
        self.act(now, &actions);
        actions
    }

    #[cold]
    fn report(&mut self, unexpected: Unexpected) {
        self.statistics.unexpected += 1;
        self.events.push_notice(HostEvent::Unexpected(unexpected));
    }

    #[inline(always)] // see `on`
    fn act(&mut self, now: Duration, actions: &HostActions) {
        if actions.end_frame {
            self.end_frame(now);
        }
        if actions.missed {
            // The arm is at rest for want of a reply: should ALTER go on all the same, it begins again from rest.
            self.limiter.rest();
            self.statistics.missed += 1;
            self.events.push_notice(HostEvent::Missed);
        }
        if let Some(error) = actions.rejected {
            self.limiter.rejected();
            self.statistics.rejected += 1;
            self.events.push_notice(HostEvent::Rejected(error));
        }
        if actions.stale {
            self.events.push_notice(HostEvent::TargetStale);
        }
        if let Some((exception, outcome)) = actions.outcome {
            self.push_outcome(HostEvent::Exception(exception, outcome));
        }
        if actions.stopped {
            self.push_outcome(HostEvent::Stopped);
        }
        if let Some(reason) = actions.lost {
            self.statistics.lost += 1;
            self.push_outcome(HostEvent::Lost(reason));
        }
    }

    #[cold]
    fn push_outcome(&mut self, event: HostEvent) {
        let pushed = self.events.push_outcome(event);
        debug_assert!(pushed.is_ok(), "room was asked for when it began");
    }

    #[cold]
    fn answer_start(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let answer = self.transmit(now, [0; AXES], self.limiter.axes(), self.bare() - 1, [2; AXES])?;
        let Answer::Start(code) = answer else { return None };
        if code == StartCode::Accept {
            self.statistics.starts += 1;
            self.limiter.restart();
            (self.target, self.sent) = ([0; AXES], [0; AXES]);
        }
        HostMessage::StartReply(code).encode(self.config.framing, out).ok()
    }

    /// A reply on a slow line, or late: what it has depends on its length.
    #[inline(never)]
    fn reply_measured(
        &mut self,
        now: Duration,
        values: [i16; AXES],
        axes: Axes,
        out: &mut [u8],
    ) -> Option<usize> {
        let Wanted::Reply { exception, .. } = self.machine.wanted(&self.config)? else { return None };
        let mut reply = Reply { exception, ..Reply::all(values) };
        let frame = reply.frame();
        let bare = self.bare() + u8::from(u8::from(exception) == DLE);
        let doubled = |value: i16| value.to_le_bytes().iter().map(|byte| u8::from(*byte == DLE)).sum::<u8>();
        let words = if frame.has_dle() { values.map(|value| 2 + doubled(value)) } else { [2; AXES] };
        let answer = self.transmit(now, values, axes, bare, words)?;
        let Answer::Reply { select, held, .. } = answer else { return None };
        self.replied(values, axes);
        if select == ALL {
            return frame.encode(self.config.framing, out).ok();
        }
        self.limiter.hold(held);
        self.statistics.held += u64::from(held != 0);
        for (axis, (value, sent)) in reply.values.iter_mut().zip(&mut self.sent).enumerate() {
            if select >> axis & 1 == 0 {
                (*value, *sent) = (None, 0);
            }
        }
        HostMessage::Reply(reply).encode(self.config.framing, out).ok()
    }

    #[inline(never)] // what is nearly always sent is sent without it: one copy for all else
    fn transmit(
        &mut self,
        now: Duration,
        values: [i16; AXES],
        axes: Axes,
        bare: u8,
        words: [u8; AXES],
    ) -> Option<Answer> {
        self.on(now, HostInput::Transmit(self.draft(values, axes, bare, words))).send
    }

    #[inline]
    fn replied(&mut self, values: [i16; AXES], axes: Axes) {
        self.statistics.replies += 1;
        self.limiter.set_axes(axes);
        self.sent = values;
    }

    /// The length of a reply without words, whose exception is no DLE.
    fn bare(&self) -> u8 {
        let Framing { stuffed_checksum, .. } = self.config.framing;
        let len = timing::min_reply_len(0, self.config.framing) + usize::from(stuffed_checksum);
        u8::try_from(len).unwrap_or(u8::MAX)
    }

    #[inline(always)] // see `on`: what tells a `HostInput` from another is kept in the draft's `bool`s
    fn draft(&self, values: [i16; AXES], axes: Axes, bare: u8, words: [u8; AXES]) -> Draft {
        Draft {
            bare,
            words,
            moving: values.iter().rev().fold(0, |mask, value| 2 * mask + u8::from(*value != 0)),
            at_rest: axes.speed == [0; AXES],
            has_room: self.events.has_room(OUTCOMES),
        }
    }

    /// The next values, and how the axes move by them.
    #[inline(always)] // most of it is one instruction for several axes
    fn next(&self, course: Course) -> ([i16; AXES], Axes) {
        let mut axes = self.limiter.axes();
        if course == Course::Rest {
            axes.speed = [0; AXES];
        }
        let accumulation = self.config.mode.accumulation();
        let target = match (course, accumulation) {
            (Course::Target, _) => self.target,
            (Course::Zero, _) | (Course::Rest, Accumulation::Cumulative) => [0; AXES],
            (Course::Hold, _) | (Course::Rest, Accumulation::NonCumulative) => axes.position,
        };
        match accumulation {
            Accumulation::Cumulative => {
                let axes = self.limiter.speeds_from(axes, target);
                (axes.speed, axes)
            }
            Accumulation::NonCumulative => {
                let axes = self.limiter.positions_from(axes, target);
                (axes.position, axes)
            }
        }
    }
}

impl Session for Host {
    type Event = HostEvent;
    type Statistics = HostStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize =
        timing::max_reply_len(AXES, Framing { stuffed_checksum: true, ..Framing::DEFAULT });

    fn handle_connected(&mut self, now: Duration) {
        self.decoder.clear();
        self.on(now, HostInput::Connected);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.decoder.clear();
        self.on(now, HostInput::Disconnected);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.handle_timeout(now);
        let mut rest = bytes;
        while !rest.is_empty() && self.machine.phase != HostPhase::Disconnected {
            let taken = self.decoder.push(rest);
            rest = rest.get(taken..).unwrap_or_default();
            self.read(now);
        }
        self.on(now, HostInput::Bytes { partial: self.decoder.pending() > 0 });
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.on(now, HostInput::Timeout);
    }

    fn poll_event(&mut self) -> Option<HostEvent> {
        self.events.pop()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        if out.len() < Self::MAX_TRANSMIT {
            return None;
        }
        let Wanted::Reply { course, .. } = self.machine.wanted(&self.config)? else {
            return self.answer_start(now, out);
        };
        let (values, axes) = self.next(course);
        if !self.machine.fits(now, Self::MAX_TRANSMIT, &self.config) {
            return self.reply_measured(now, values, axes, out);
        }
        // As nearly always at 38400 baud: even the longest reply fits.
        let draft = self.draft(values, axes, LONGEST_BARE, [LONGEST_WORD; AXES]);
        let Answer::Reply { select, exception, .. } = self.on(now, HostInput::Transmit(draft)).send? else {
            return None;
        };
        debug_assert_eq!(select, ALL, "the machine was asked whether the longest fits");
        self.replied(values, axes);
        let reply = Reply { exception, ..Reply::all(values) };
        reply.frame().encode(self.config.framing, out).ok()
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> HostStatistics {
        HostStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}

/// What a host is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostState {
    /// The port is not open.
    Disconnected,
    /// No ALTER.
    Idle,
    /// A start message was received and is not answered yet.
    Starting,
    /// Every standard message is answered with values.
    Running,
    /// The robot's exception subroutine runs. Messages are answered; the values brake to standstill.
    Interrupted,
    /// The caller has stopped: the values go to zero within the limits.
    Stopping,
    /// The values were zero: no message is answered any more, and the controller ends ALTER.
    Silent,
}
