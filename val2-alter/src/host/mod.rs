//! The host computer's end: answers the controller's messages within their deadline.

mod active;
mod config;
mod deadline;
mod input;
pub mod machine;
mod state;

#[doc(hidden)]
pub use config::Rule;
pub use config::{
    ExceptionOutcome, HostConfig, HostEvent, HostStatistics, LostReason, Policy, UnknownReason,
};

use core::time::Duration;

use robot_session::Decoder as _;
use robot_session::end::{Core, CoreOf, End, EventQueue, QueueSpace};

use crate::decoder::Decoder;
use crate::error::{ConfigError, DecodeError, SessionError};
use crate::framing::{DLE, Framing};
use crate::limit::{Axes, Limiter};
use crate::message::{
    ALL, AXES, Accumulation, Exception, HostMessage, Message, Motion, Reply, RobotMessage, StartCode,
};
use crate::timing;
use machine::{Action, Answer, Draft, HostMachine, HostPhase, Input, OutputMode, PreviousReply, Stage};

/// The host computer's session. Its methods are those of [`robot_session::Session`]; it never reads a clock and never blocks.
///
/// [`set_target`](Host::set_target) at any time: the reply to a message is made when `poll_transmit` is called, from the target
/// of that moment, within the limits. A reply has all six words if they fit the remaining window. Otherwise it omits words
/// that are and were zero, which is valid for either reading of the source; an axis whose word does not fit waits at
/// rest until another has come to rest.
///
/// A corrupt frame costs the bytes that the error covers; the session continues, and requests a corrupt start message again.
/// When 16 events wait, the oldest notice is dropped and counted; [`HostEvent::End`] and [`HostEvent::Lost`] of an ALTER,
/// [`HostEvent::Exception`] and [`HostEvent::Stopped`] are outcomes and are not.
#[derive(Debug, Clone)]
pub struct Host {
    core: CoreOf<Self>,
    /// The caller's target, the limiter that approaches it, and the values that were sent last.
    target: [i16; AXES],
    limiter: Limiter,
    sent: [i16; AXES],
}

/// The outcomes that an ALTER may have: its end, and that of a stop.
const OUTCOMES: usize = 2;

impl Host {
    /// Creates a host without a connection.
    ///
    /// # Errors
    /// [`ConfigError::Window`]: not even one value fits the line; [`ConfigError::SilenceCycles`].
    pub fn new(config: HostConfig) -> Result<Self, ConfigError> {
        config.check()?;
        let machine = HostMachine::new(config.policy, config.subroutine);
        Ok(Self {
            target: [0; AXES],
            limiter: Limiter::new(config.limits),
            sent: [0; AXES],
            core: Core::new(config, machine, Decoder::new(config.framing)),
        })
    }

    /// Sets the target of the next replies, in units of their words: a speed in each cycle (cumulative), or an offset from
    /// the path (non-cumulative). It holds for [`HostConfig::target_timeout`]; a new start sets it to zero.
    pub fn set_target(&mut self, now: Duration, target: [i16; AXES]) {
        self.target = target;
        self.advance(now, Input::Target, None);
    }

    /// Called when the source of targets is lost: speeds go to zero (cumulative), an offset stays (non-cumulative), until a
    /// target is set.
    pub fn clear_target(&mut self, now: Duration) {
        self.advance(now, Input::NoTarget, None);
    }

    /// Sends an exception code with the next reply, once. Its outcome is a [`HostEvent::Exception`], after one message, or
    /// after two if the first one reports that the reply was not read. If it was not late either, it is resent.
    ///
    /// # Errors
    /// [`SessionError::NoSubroutine`] when the configuration has no subroutine,
    /// [`SessionError::NotRunning`], [`SessionError::ExceptionPending`] before the outcome of the previous one, and
    /// [`SessionError::EventsFull`].
    pub fn exception(&mut self, now: Duration, exception: Exception) -> Result<(), SessionError> {
        let has_room = self.core.events.has_room(OUTCOMES + 1);
        match self.core.on(now, Input::Exception { exception, has_room }) {
            Ok(Action::Refuse(error)) => return Err(error),
            Ok(action) => self.act(now, action, None),
            Err(unexpected) => self.refuse(unexpected),
        }
        Ok(())
    }

    /// Brings the values to zero within the limits, then stops answering, which makes the controller end ALTER (§3.3.3). The
    /// policy becomes [`Policy::Ignore`]: [`Host::set_policy`] resumes ALTER. If ALTER runs, [`HostEvent::Stopped`],
    /// [`HostEvent::End`] or [`HostEvent::Lost`] follows.
    pub fn stop(&mut self, now: Duration) {
        self.advance(now, Input::Stop, None);
    }

    /// Sets how start messages are answered from now on, including one that is not yet answered.
    pub fn set_policy(&mut self, now: Duration, policy: Policy) {
        self.advance(now, Input::Policy(policy), None);
    }

    /// Sets whether the ALTER instruction has an exception subroutine, if that depends on the robot's program.
    pub fn set_subroutine(&mut self, now: Duration, installed: bool) {
        self.advance(now, Input::Subroutine(installed), None);
    }

    /// Returns the state of the session.
    pub fn state(&self) -> HostState {
        match &self.core.machine.phase {
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

    /// Returns the policy for start messages.
    pub fn policy(&self) -> Policy {
        self.core.machine.policy
    }

    /// Returns the values of the last reply, in units of their words.
    pub fn values(&self) -> [i16; AXES] {
        self.sent
    }

    /// Returns the time by which the answer that is due must begin to leave: the window less the time of the shortest
    /// possible answer. `None` if no answer is due.
    pub fn reply_by(&self) -> Option<Duration> {
        self.core.machine.reply_by()
    }

    /// Applies the actions that are not taken in every cycle: one copy of the code is enough.
    #[cold]
    fn act_rarely(&mut self, now: Duration, action: Action) {
        match action {
            Action::EndFrame => self.finish(now),
            Action::Missed => self.missed(),
            Action::Stale => self.core.events.push_notice(HostEvent::TargetStale),
            Action::Stopped(previous) => {
                self.report_previous(previous);
                self.core.push_outcome(HostEvent::Stopped);
            }
            Action::Exception(exception, outcome) => self.ended(exception, outcome),
            Action::Lost { missed, outcome, reason } => {
                self.report_previous(PreviousReply { missed, outcome, ..PreviousReply::default() });
                self.core.statistics.lost += 1;
                self.core.push_outcome(HostEvent::Lost(reason));
            }
            Action::SentStart(StartCode::Accept) => {
                self.core.statistics.starts += 1;
                self.limiter.restart();
                (self.target, self.sent) = ([0; AXES], [0; AXES]);
            }
            Action::Nothing
            | Action::Refuse(_)
            | Action::Asked(_)
            | Action::Ended(_)
            | Action::SentStart(_)
            | Action::SentReply(_) => {}
        }
    }

    #[cold]
    fn missed(&mut self) {
        // The arm is at rest without a reply: if ALTER continues, it begins again from rest.
        self.limiter.rest();
        self.core.statistics.missed += 1;
        self.core.events.push_notice(HostEvent::Missed);
    }

    #[cold]
    fn delayed(&mut self) {
        self.core.statistics.delayed += 1;
        self.core.events.push_notice(HostEvent::Delayed);
    }

    #[cold]
    fn ended(&mut self, exception: Exception, outcome: ExceptionOutcome) {
        self.core.push_outcome(HostEvent::Exception { exception, outcome });
    }

    #[inline(always)] // nearly always there is nothing
    fn report_previous(&mut self, PreviousReply { missed, delayed, rejected, outcome }: PreviousReply) {
        if missed {
            self.missed();
        }
        if delayed {
            self.delayed();
        }
        if let Some((error, follows)) = rejected {
            if follows {
                self.limiter.rejected();
            } else {
                self.limiter.rest();
            }
            self.core.statistics.rejected += 1;
            self.core.events.push_notice(HostEvent::Rejected(error));
        }
        if let Some((exception, outcome)) = outcome {
            self.ended(exception, outcome);
        }
    }

    #[cold]
    fn write_start(&mut self, now: Duration, code: StartCode, out: &mut [u8]) -> Option<(usize, Input)> {
        if code == StartCode::Accept && !self.core.events.has_room(OUTCOMES) {
            // The controller requests the start again.
            return Some((0, Input::Ignored));
        }
        let draft = Draft { bare: self.bare() - 1, words: [0; AXES], moving: 0 };
        if self.core.machine.select(now, &draft, &self.core.config).is_none() {
            return Some((0, Input::Late));
        }
        let length = HostMessage::StartReply(code).encode(self.core.config.framing, out).ok()?;
        Some((length, Input::Sent { moving: 0, at_rest: true }))
    }

    /// Writes a reply on a slow line, or late: its words depend on its length.
    #[inline(never)]
    fn write_measured(
        &mut self,
        now: Duration,
        exception: Exception,
        values: [i16; AXES],
        axes: Axes,
        out: &mut [u8],
    ) -> Option<(usize, Input)> {
        let mut reply = Reply { exception, ..Reply::all(values) };
        let frame = reply.frame();
        let bare = self.bare() + u8::from(u8::from(exception) == DLE);
        let doubled = |value: i16| value.to_le_bytes().iter().map(|byte| u8::from(*byte == DLE)).sum::<u8>();
        let words = if frame.has_dle() { values.map(|value| 2 + doubled(value)) } else { [2; AXES] };
        let draft = Draft { bare, words, moving: moving(&values) };
        let Some((select, held)) = self.core.machine.select(now, &draft, &self.core.config) else {
            return Some((0, Input::Late));
        };
        let sent = self.replied(values, axes, select);
        if select == ALL {
            return Some((frame.encode(self.core.config.framing, out).ok()?, sent));
        }
        self.limiter.hold(held);
        self.core.statistics.held += u64::from(held != 0);
        for (axis, (value, sent)) in reply.values.iter_mut().zip(&mut self.sent).enumerate() {
            if select >> axis & 1 == 0 {
                (*value, *sent) = (None, 0);
            }
        }
        Some((HostMessage::Reply(reply).encode(self.core.config.framing, out).ok()?, sent))
    }

    /// Called when a reply with these values and the selected words was sent.
    #[inline]
    fn replied(&mut self, values: [i16; AXES], axes: Axes, select: u8) -> Input {
        self.core.statistics.replies += 1;
        self.limiter.set_axes(axes);
        self.sent = values;
        let moving = moving(&values);
        Input::Sent { moving: moving & select, at_rest: moving == 0 && axes.speed == [0; AXES] }
    }

    /// Returns the length of a reply without words, whose exception is not a DLE.
    fn bare(&self) -> u8 {
        let Framing { stuffed_checksum, .. } = self.core.config.framing;
        let len = timing::min_reply_len(0, self.core.config.framing) + usize::from(stuffed_checksum);
        u8::try_from(len).unwrap_or(u8::MAX)
    }

    /// Returns the next values, and the motion of the axes by them.
    #[inline(always)] // most of it is one instruction for several axes
    fn next(&self, course: OutputMode) -> ([i16; AXES], Axes) {
        let mut axes = self.limiter.axes();
        if course == OutputMode::Rest {
            axes.speed = [0; AXES];
        }
        let accumulation = self.core.config.mode.accumulation();
        let target = match (course, accumulation) {
            (OutputMode::Target, _) => self.target,
            (OutputMode::Zero, _) | (OutputMode::Rest, Accumulation::Cumulative) => [0; AXES],
            (OutputMode::Hold, _) | (OutputMode::Rest, Accumulation::NonCumulative) => axes.position,
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

/// Returns a mask: bit *i* is set if value *i* is not zero.
#[inline(always)]
fn moving(values: &[i16; AXES]) -> u8 {
    values.iter().rev().fold(0, |mask, value| 2 * mask + u8::from(*value != 0))
}

impl End for Host {
    type Machine = HostMachine;
    type Decoder = Decoder<RobotMessage>;
    type Events = EventQueue<HostEvent, 16>;
    type Statistics = HostStatistics;
    /// The message, as it is reported.
    type Payload = HostEvent;

    const LINK: &'static str = "val2-alter";
    const END: &'static str = "host";
    const MAX_INPUT: usize = 4096;
    const MAX_TRANSMIT: usize =
        timing::max_reply_len(AXES, Framing { stuffed_checksum: true, ..Framing::DEFAULT });
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(HostEvent::Unexpected);

    /// Returns the time after which a silent controller has ended its ALTER.
    fn discards_after(&self) -> Option<Duration> {
        Some(self.core.config.lost_at(Duration::ZERO))
    }

    #[inline]
    fn begin_input(&mut self, now: Duration) -> bool {
        let is_connected = self.core.machine.is_connected();
        if !is_connected {
            self.advance(now, Input::Bytes { partial: false }, None);
        }
        is_connected
    }

    #[inline]
    fn end_input(&mut self, now: Duration) {
        let partial = self.core.decoder.pending() > 0;
        self.advance(now, Input::Bytes { partial }, None);
    }

    #[inline]
    fn next_input(&mut self) -> Option<(Input, Option<HostEvent>)> {
        loop {
            let item = self.core.decoder.next_frame();
            let is_corrupt = self.core.decoder.corruption().is_some();
            if let Some(Err(error)) = &item {
                self.core.statistics.corrupt += 1;
                self.core.events.push_notice(HostEvent::Corrupt(*error));
                if !is_corrupt && matches!(error, DecodeError::StartMark { .. }) {
                    return Some((Input::Noise, None));
                }
            }
            if is_corrupt {
                return Some((Input::CorruptFrame, None));
            }
            let Ok(received) = item? else { continue };
            return Some(match received.message {
                RobotMessage::Start(start) => {
                    let is_expected = start.mode == self.core.config.mode;
                    (Input::Start { is_expected }, Some(HostEvent::Start(start)))
                }
                RobotMessage::Motion(motion) => {
                    let Motion { phase, error, .. } = motion;
                    (Input::Motion { phase, error, len: received.length }, Some(HostEvent::Motion(motion)))
                }
                RobotMessage::End(end) => (Input::End, Some(HostEvent::End(end))),
            });
        }
    }

    #[inline(always)] // see `HostMachine::on`
    fn act(&mut self, now: Duration, action: Action, message: Option<HostEvent>) {
        match action {
            Action::Nothing | Action::Refuse(_) | Action::SentReply(_) => {}
            Action::Asked(previous) => {
                self.core.statistics.cycles += 1;
                self.report_previous(previous);
            }
            Action::Ended(outcome) => {
                self.report_previous(PreviousReply { outcome, ..PreviousReply::default() });
                self.core.statistics.ends += 1;
                message.into_iter().for_each(|end| self.core.push_outcome(end));
                return;
            }
            action => self.act_rarely(now, action),
        }
        if let Some(message) = message {
            self.core.statistics.ends += u64::from(matches!(message, HostEvent::End(_)));
            self.core.events.push_notice(message);
        }
    }

    #[inline]
    fn write(&mut self, now: Duration, what: Answer, out: &mut [u8]) -> Option<(usize, Input)> {
        if out.len() < Self::MAX_TRANSMIT {
            return None;
        }
        let (course, exception) = match what {
            Answer::Reply { course, exception } => (course, exception),
            Answer::Start(code) => return self.write_start(now, code, out),
            Answer::Nothing => return Some((0, Input::Ignored)),
        };
        let (values, axes) = self.next(course);
        if !self.core.machine.fits(now, Self::MAX_TRANSMIT, &self.core.config) {
            return self.write_measured(now, exception, values, axes, out);
        }
        // As nearly always at 38400 baud: even the longest reply fits.
        let sent = self.replied(values, axes, ALL);
        let reply = Reply { exception, ..Reply::all(values) };
        Some((reply.frame().encode(self.core.config.framing, out).ok()?, sent))
    }
}

/// The state of a host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum HostState {
    /// The port is not open.
    Disconnected,
    /// The port is open, and no ALTER runs.
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
