use core::time::Duration;

use robot_session::end::{Core, CoreOf, End, EventQueue, QueueSpace};
use robot_session::{Decoder as _, Unexpected};
use robot_work_queue::{NoWake, Wake};

use super::config::{Acks, RobotConfig};
use super::event::{OF_ORDER, RobotEvent};
use super::received::ReceivedMessage;
use super::state::{Action, DuePacket, Input, Machine, RecoveryStep, Report, SentPacket};
use crate::content::FromRobot;
use crate::decoder::Decoder;
use crate::error::{ConfigError, SessionError};
use crate::job::{self, Work};
use crate::message::Message;
use crate::motion::Jobs;
use crate::packet::{AddResult as PacketRoom, Packet};
use crate::params::Params;
use crate::phase::Phase;
use crate::role::{Field, Role};
use crate::statistics::RobotStatistics;

/// The session of a robot: it opens the connection, speaks first in every cycle, and queues the jobs that the PC sends.
///
/// Drive it as [`Session`](robot_session::Session) describes, each packet in one write. The [`Wake`] of its queue signals
/// that the session is to check the queue: if that hook is the waker of a driver, the loop needs no other turns. On
/// [`RobotEvent::Connect`] open a connection and call [`handle_connected`](robot_session::Session::handle_connected), or
/// [`handle_disconnected`](robot_session::Session::handle_disconnected) if it fails.
///
/// One cycle: send at least one message, a filler if no other message is due; wait for the answer, but not longer than
/// [`RobotConfig::reply_timeout`]; start again.
///
/// **The motion task** has the other end of the queue, [`Motion`](crate::motion::Motion): it takes a job, executes it, and
/// completes it, which reports it to the session. A motion task with another way of reporting passes every number
/// ([`Job::number`](crate::Job)) to [`job_done`](Self::job_done) before it completes the job.
///
/// **Corrupt bytes** and jobs that cannot be used are reported as events, and cost the rest of the packet: it is destroyed
/// (thesis, sections 7.2 and 12), and requested again. The bytes always advance. All bytes of an input are taken. **Events**
/// that are not polled: see [`RobotEvent`]; while the event queue lacks free entries for outcomes, no order begins.
///
/// **No progress**: while nothing more is to be executed and the next job does not come, a step of recovery is taken after
/// each [`RobotConfig::patience`], up to the alarm, which comes within [`RobotConfig::alarm_bound`]. A job that takes long is
/// progress.
///
/// An order outlives its connection. After a new one both ends report by status the queued and the executed jobs, and the
/// robot requests the job after the last queued one.
///
/// The session can hold a message of `MESSAGE` bytes, and sends packets of at most as many. A table that needs more is a
/// [`ConfigError`]: `Robot::<_, 512>::with_ranges`, or a [`LargeRobot`].
#[derive(Debug)]
pub struct Robot<'q, W: Work, const MESSAGE: usize = 256, R: Wake = NoWake> {
    pub(super) core: CoreOf<Self>,
    pub(super) ranges: W::Ranges,
    pub(super) jobs: Jobs<'q, W, R>,
    pub(super) received: ReceivedMessage<W>,
    low_water: usize,
}

/// A [`Robot`] for messages of every length: [`LargeRobot::with_ranges`](Robot::with_ranges).
pub type LargeRobot<'q, W, R = NoWake> = Robot<'q, W, { Message::MAX_LEN }, R>;

impl<'q, W: Work, R: Wake> Robot<'q, W, 256, R> {
    /// Creates a session that requests a connection at once. `jobs` is its end of a queue, whose highest job number is the
    /// one on which both ends have agreed. The ranges of a job's fields are the defaults.
    ///
    /// # Errors
    /// If the configuration cannot work.
    pub fn new(config: RobotConfig, jobs: impl Into<Jobs<'q, W, R>>) -> Result<Self, ConfigError> {
        Self::with_ranges(config, jobs, W::Ranges::default())
    }
}

impl<'q, W: Work, const MESSAGE: usize, R: Wake> Robot<'q, W, MESSAGE, R> {
    /// Creates a session as [`new`](Robot::new) does, of the size of its type, with other ranges of a job's fields: those
    /// that the robot can reach.
    ///
    /// # Errors
    /// If a range is empty, a job with the longest values does not fit a packet or the session, or the configuration cannot work.
    pub fn with_ranges(
        config: RobotConfig,
        jobs: impl Into<Jobs<'q, W, R>>,
        ranges: W::Ranges,
    ) -> Result<Self, ConfigError> {
        let jobs = jobs.into();
        let queue = jobs.writer.max_number();
        config.check(job::check::<W>(&ranges)?, MESSAGE, jobs.writer.capacity())?;
        if queue != config.max_number {
            return Err(ConfigError::QueueNumbers { queue, config: config.max_number });
        }
        Ok(Self {
            core: Core::new(config, Machine::new(&config), Decoder::sized(config.dialect.charset())),
            ranges,
            low_water: config.low_water.unwrap_or(jobs.writer.capacity() / 2),
            jobs,
            received: ReceivedMessage::new(),
        })
    }

    /// Records that the motion task has executed a job, if [`Motion`](crate::motion::Motion) does not report that. Pass every
    /// report before the next [`handle_timeout`](robot_session::Session::handle_timeout).
    ///
    /// # Errors
    /// If no job of this number is in the queue, or it was reported before.
    pub fn job_done(&mut self, now: Duration, number: u16) -> Result<(), SessionError> {
        self.executed_one(now, number).map_err(|_| SessionError::NotQueued { number })
    }

    /// Performs the first reset: clears the queue of all jobs except the one being executed; jobs not executed are sent
    /// again. Ends an alarm.
    ///
    /// # Errors
    /// If no order is active, or it is ending or being cleared; when the event queue is full.
    pub fn clear_queue(&mut self) -> Result<(), SessionError> {
        if !self.core.events.has_room(OF_ORDER) {
            return Err(SessionError::TooManyEvents);
        }
        self.ask(Duration::ZERO, Input::ClearQueue).map_err(|_| SessionError::NoOrder)
    }

    /// Performs the second reset: clears the queue and discards the order, as an interruption by the PC does.
    ///
    /// # Errors
    /// If no order is active, or it is interrupted already.
    pub fn reset_order(&mut self) -> Result<(), SessionError> {
        self.ask(Duration::ZERO, Input::ResetOrder).map_err(|_| SessionError::NoOrder)
    }

    /// Records a time that the caller has measured: unpacking one packet and queueing its jobs.
    pub fn record_unpack(&mut self, time: Duration) {
        self.core.statistics.unpack.record(time);
    }

    /// Returns the phase of the order.
    pub const fn phase(&self) -> Phase {
        self.core.machine.phase()
    }

    /// Returns the active order; `None` when the robot is idle.
    pub fn order(&self) -> Option<u16> {
        let number = self.core.machine.order.number();
        (number != 0).then_some(number)
    }

    /// Returns the number of jobs of the active order, or of the last one, that were queued.
    pub const fn queued(&self) -> u32 {
        self.core.machine.queued
    }

    /// Returns the count up to which the jobs of the active order, or of the last one, are executed.
    pub const fn executed(&self) -> u32 {
        self.core.machine.executed
    }

    /// Returns whether the motion task has dropped its end of the queue.
    pub fn is_abandoned(&self) -> bool {
        self.jobs.writer.is_abandoned()
    }

    /// Records the jobs that the motion task has executed. A job is unexpected only if it has overtaken others although none
    /// may.
    fn take_reports(&mut self, now: Duration) {
        while let Some(number) = self.jobs.next_executed() {
            if let Err(unexpected) = self.executed_one(now, number) {
                self.refuse(unexpected);
            }
        }
    }

    fn executed_one(&mut self, now: Duration, number: u16) -> Result<(), Unexpected> {
        self.ask(now, Input::Executed { number })?;
        self.core.statistics.executed += 1;
        self.core.statistics.work_cycle.end(now);
        self.core.statistics.work_cycle.begin(now);
        Ok(())
    }

    /// Returns the number of the job that is queued next.
    pub(super) fn next(&self) -> u16 {
        self.core.config.numbering().next(self.core.machine.queued)
    }
}

impl<W: Work, const MESSAGE: usize, R: Wake> End for Robot<'_, W, MESSAGE, R> {
    type Machine = Machine;
    type Decoder = Decoder<MESSAGE>;
    type Events = EventQueue<RobotEvent, 32>;
    type Statistics = RobotStatistics;
    /// The message is `received`.
    type Payload = ();

    const LINK: &'static str = "kawasaki-msg";
    const END: &'static str = "robot";
    /// Longer than any message, so that a datagram that is too long is noticed.
    const MAX_INPUT: usize = 2 * Message::MAX_LEN;
    const MAX_TRANSMIT: usize = MESSAGE;
    const QUEUE_SPACE: QueueSpace = QueueSpace::NONE;

    robot_session::core!(RobotEvent::Unexpected);

    fn begin_input(&mut self, _now: Duration) -> bool {
        let is_connected = self.core.machine.is_connected();
        if !is_connected {
            self.refuse(Unexpected { state: "not connected", input: "bytes" });
        }
        is_connected
    }

    fn end_input(&mut self, now: Duration) {
        if self.core.config.datagrams {
            // A message does not continue after the end of a datagram.
            self.finish(now);
        }
        let whole = !self.core.decoder.is_inside_message();
        self.advance(now, Input::ReadEnd { whole }, None);
    }

    fn look(&mut self, now: Duration) {
        // Checked before the reports are taken: so the jobs executed until then are recorded first.
        let is_settled = self.jobs.writer.is_settled() || self.jobs.writer.is_abandoned();
        let is_drained = self.jobs.writer.drained(self.low_water);
        self.take_reports(now);
        if is_settled {
            self.advance(now, Input::Settled, None);
        }
        if is_drained {
            self.advance(now, Input::Drained, None);
        }
    }

    #[inline(always)]
    fn next_input(&mut self) -> Option<(Input, Option<()>)> {
        let active = self.core.machine.order.number();
        match self.core.decoder.next_frame()? {
            Ok(message) => {
                let message = self.received.read(&self.core.config.dialect, &self.ranges, active, &message);
                let room = self.accepts(message);
                Some((Input::Message { message, room }, Some(())))
            }
            Err(error) => {
                self.core.statistics.corrupt += 1;
                self.core.events.push_notice(RobotEvent::Corrupt(error));
                Some((Input::Corrupt, None))
            }
        }
    }

    fn act(&mut self, now: Duration, action: Action, received: Option<()>) {
        let order = self.core.machine.order.number();
        match action {
            Action::Nothing => {}
            Action::Connected => self.core.statistics.exchange.cancel(),
            Action::Sent => {
                self.core.statistics.packets += 1;
                self.core.statistics.exchange.begin(now);
            }
            Action::Answered => self.core.statistics.exchange.end(now),
            Action::Queue | Action::QueuedBefore => {
                self.core.statistics.queued += 1;
                self.take_reports(now);
                if action == Action::Queue
                    && let Ok(claim) = self.jobs.writer.claim()
                {
                    claim.push(self.received.job());
                }
            }
            Action::Refused => {
                let found = self.received.number(Field::Order);
                self.core.events.push_notice(RobotEvent::OrderRefused { order: found, active: order });
            }
            Action::Discarded => self.core.statistics.discarded += 1,
            Action::Rejected(why) => {
                if received.is_some() {
                    self.rejected(why);
                }
            }
            Action::NoReply => {
                self.core.statistics.unanswered += 1;
                self.core.events.push_notice(RobotEvent::NoReply);
            }
            Action::Clear => self.jobs.writer.clear(),
            Action::Interrupt => {
                self.jobs.writer.clear();
                self.core.push_outcome(RobotEvent::OrderInterrupted { order });
            }
            Action::Started => {
                self.core.statistics.work_cycle.cancel();
                self.core.push_outcome(RobotEvent::OrderStarted { order });
            }
            Action::Ending => self.core.push_outcome(RobotEvent::OrderEnding { order }),
            Action::Over => {
                self.jobs.writer.reset();
                let order = self.core.machine.ended.map_or(0, |ended| ended.order);
                self.core.push_outcome(RobotEvent::OrderOver { order, executed: self.core.machine.executed });
            }
            Action::Cleared => self.core.events.push_notice(RobotEvent::QueueCleared { next: self.next() }),
            Action::Drained => self.core.events.push_notice(RobotEvent::QueueDrained { next: self.next() }),
            Action::Step(RecoveryStep::Alarm) => {
                self.core.push_outcome(RobotEvent::Alarm { order, next: self.next() })
            }
            Action::Step(step) => {
                if step == RecoveryStep::Clear {
                    self.jobs.writer.clear();
                }
                self.core.events.push_notice(RobotEvent::Recovery { step, next: self.next() });
            }
        }
    }

    /// Returns a buffer shorter than [`Limits::packet`](crate::Limits) and `MESSAGE` is too small.
    fn write(&mut self, _now: Duration, due: DuePacket, out: &mut [u8]) -> Option<(usize, Input)> {
        let out = out.get_mut(..self.core.config.limits.packet.min(MESSAGE))?;
        let mut packet = Packet::new(out, self.core.config.limits, self.core.config.dialect);
        let mut send = |message: FromRobot| {
            let (role, params) = message.write();
            packet.push(role, &params) == Ok(PacketRoom::Added)
        };
        let (machine, config) = (&self.core.machine, &self.core.config);
        let (mut sent, mut all_acked) = (SentPacket::default(), true);
        for (count, ack) in machine.acks(&due, config) {
            if !send(ack) {
                all_acked = config.acks != Acks::Individual;
                break;
            }
            sent.acked += count;
        }
        sent.start = due.start.is_some_and(&mut send);
        sent.end = all_acked && due.end.is_some_and(&mut send);
        sent.status = all_acked && due.status.is_some_and(&mut send);
        sent.pause = due.pause.is_some_and(&mut send);
        sent.request = due.request.is_some_and(&mut send);
        if packet.is_empty() {
            let _ = packet.push(Role::Filler, &Params::default());
        }
        Some((packet.as_bytes().len(), Input::Sent(sent)))
    }

    fn next_event(&mut self) -> Option<RobotEvent> {
        self.core.events.pop().or_else(|| {
            let event = match self.core.machine.report()? {
                Report::Connect => RobotEvent::Connect,
                Report::Disconnect => RobotEvent::Disconnect,
            };
            self.advance(Duration::ZERO, Input::Reported, None);
            Some(event)
        })
    }
}
