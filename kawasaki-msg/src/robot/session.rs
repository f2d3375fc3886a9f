use core::time::Duration;

use robot_session::{Decoder as _, EventQueue, Session, Unexpected};
use robot_work_queue::Writer;

use super::config::RobotConfig;
use super::event::RobotEvent;
use super::reading::{Events, OF_ORDER, Reading, push};
use super::state::{Action, Input, Machine, RecoveryStep, Report};
use crate::decoder::Decoder;
use crate::dialect::Params;
use crate::error::{ConfigError, SessionError};
use crate::job::{self, Expected, Job, Work};
use crate::message::Message;
use crate::numbering::ALL_NUMBERS;
use crate::packet::Packet;
use crate::phase::Phase;
use crate::role::Role;
use crate::statistics::RobotStatistics;

/// The session of a robot: it opens the connection, speaks first in every cycle, and queues the jobs that the PC sends.
///
/// Drive it as [`Session`] describes, each packet in one write, and before every [`handle_timeout`](Session::handle_timeout) hand
/// over every report of the motion task with [`job_done`](Self::job_done). Call `handle_timeout` in every pass: a settled queue
/// has no other way to be seen. On [`RobotEvent::Connect`] open a connection and call
/// [`handle_connected`](Session::handle_connected), or [`handle_disconnected`](Session::handle_disconnected) if it fails.
///
/// One cycle is: send at least one message, filler if there is none; wait for the answer, but not longer than
/// [`RobotConfig::reply_timeout`]; start again.
///
/// **The motion task** takes a job from the queue's [`Reader`](robot_work_queue::Reader), executes it, *reports its number*
/// ([`Job::number`]: the queue's own goes on when it is cleared), and only then completes it. Reported before it is completed, a job that was executed when an order is interrupted or the queue
/// is cleared is never asked for again. It keeps taking while it is idle: that is when a cleared queue is swept.
///
/// **Corrupt bytes** and jobs that cannot be used are reported as events, and cost what follows them in the packet: it is destroyed
/// (thesis, sections 7.2 and 12), and asked for again. The bytes always advance. All bytes of an input are taken. **Events** that
/// nobody polls: see [`RobotEvent`]; while there is no room for outcomes, no order begins.
///
/// **No progress**: while nothing is left to execute and the next job does not come, a step of recovery is taken after each
/// [`RobotConfig::patience`], up to the alarm, which comes within [`RobotConfig::alarm_bound`]. A job that takes long is progress.
///
/// An order outlives its connection. After a new one both ends report by status what is queued and executed, and the
/// robot asks for the job after the last that it has queued.
///
/// It can hold a message of `MESSAGE` bytes, and tell job numbers below 64 for each of its `WORDS` apart where jobs may overtake one
/// another ([`Acks::Individual`](super::Acks)). What needs more is a [`ConfigError`]: `Robot::<_, 512>::sized`, or a [`LargeRobot`].
#[derive(Debug)]
pub struct Robot<'a, W: Work, const MESSAGE: usize = 256, const WORDS: usize = 16> {
    config: RobotConfig<'a>,
    ranges: W::Ranges,
    machine: Machine<WORDS>,
    decoder: Decoder<MESSAGE>,
    writer: Writer<'a, Job<W>>,
    events: Events,
    statistics: RobotStatistics,
}

/// A [`Robot`] for messages of every length and all job numbers: [`LargeRobot::sized`](Robot::sized).
pub type LargeRobot<'a, W> = Robot<'a, W, { Message::MAX_LEN }, ALL_NUMBERS>;

impl<'a, W: Work> Robot<'a, W> {
    /// A session that wants to connect at once. It queues its jobs through `writer`, whose highest job number is the one that
    /// both ends have agreed on. The ranges of a job's fields are the default ones.
    ///
    /// # Errors
    /// When the configuration cannot work.
    pub fn new(config: RobotConfig<'a>, writer: Writer<'a, Job<W>>) -> Result<Self, ConfigError> {
        Self::sized(config, writer)
    }
}

impl<'a, W: Work, const MESSAGE: usize, const WORDS: usize> Robot<'a, W, MESSAGE, WORDS> {
    /// As [`new`](Robot::new), of the size that its type says.
    ///
    /// # Errors
    /// When the configuration cannot work, or needs more.
    pub fn sized(config: RobotConfig<'a>, writer: Writer<'a, Job<W>>) -> Result<Self, ConfigError> {
        let ranges = W::Ranges::default();
        config.check::<MESSAGE, WORDS>(job::check::<W>(&ranges)?)?;
        if writer.max_number() != config.max_number {
            return Err(ConfigError::QueueNumbers { queue: writer.max_number(), config: config.max_number });
        }
        Ok(Self {
            config,
            ranges,
            machine: Machine::new(&config),
            decoder: Decoder::sized(config.dialect.charset()),
            writer,
            events: EventQueue::new(),
            statistics: RobotStatistics::default(),
        })
    }

    /// The same session with other ranges of a job's fields: what the robot can reach.
    ///
    /// # Errors
    /// When a range is empty, or a job with the longest values does not fit a packet or the session.
    pub fn with_ranges(self, ranges: W::Ranges) -> Result<Self, ConfigError> {
        self.config.check::<MESSAGE, WORDS>(job::check::<W>(&ranges)?)?;
        Ok(Self { ranges, ..self })
    }

    /// The motion task has executed a job. Hand over every report before the next
    /// [`handle_timeout`](Session::handle_timeout).
    ///
    /// # Errors
    /// When no job of this number is in the queue, or it was reported before.
    pub fn job_done(&mut self, now: Duration, number: u16) -> Result<(), SessionError> {
        self.request(now, Input::Executed { number }).map_err(|_| SessionError::NotQueued { number })?;
        self.statistics.executed += 1;
        self.statistics.work_cycle.end(now);
        self.statistics.work_cycle.begin(now);
        Ok(())
    }

    /// The first reset: clears the queue of all jobs but the one that is being executed; those not executed come again. Leads out
    /// of an alarm.
    ///
    /// # Errors
    /// When no order is active, or it is ending or being cleared; when too many events wait.
    pub fn clear_queue(&mut self) -> Result<(), SessionError> {
        if !self.events.has_room(OF_ORDER) {
            return Err(SessionError::TooManyEvents);
        }
        self.request(Duration::ZERO, Input::ClearQueue).map_err(|_| SessionError::NoOrder)
    }

    /// The second reset: clears the queue and forgets the order, as an interruption by the PC does.
    ///
    /// # Errors
    /// When no order is active, or it is interrupted already.
    pub fn reset_order(&mut self) -> Result<(), SessionError> {
        self.request(Duration::ZERO, Input::ResetOrder).map_err(|_| SessionError::NoOrder)
    }

    /// Keeps a time that the caller has measured: unpacking one packet and queueing its jobs.
    pub fn record_unpack(&mut self, time: Duration) {
        self.statistics.unpack.record(time);
    }

    /// Everything that decides what the session does next.
    pub const fn machine(&self) -> &Machine<WORDS> {
        &self.machine
    }

    /// How far the order is.
    pub const fn phase(&self) -> Phase {
        self.machine.phase()
    }

    /// The active order; `None` when the robot is idle.
    pub fn order(&self) -> Option<u16> {
        let number = self.machine.order.number();
        (number != 0).then_some(number)
    }

    /// How many jobs of the active order, or of the last one, were queued.
    pub const fn queued(&self) -> u32 {
        self.machine.queued
    }

    /// Up to which count the jobs of the active order, or of the last one, are executed.
    pub const fn executed(&self) -> u32 {
        self.machine.executed
    }

    /// Whether the motion task has dropped its end of the queue.
    pub fn is_abandoned(&self) -> bool {
        self.writer.is_abandoned()
    }

    /// A request of the caller.
    fn request(&mut self, now: Duration, input: Input) -> Result<(), Unexpected> {
        let order = self.machine.order.number();
        let action = self.machine.on(now, input, &self.config)?;
        self.act(order, action);
        Ok(())
    }

    fn input(&mut self, now: Duration, input: Input) {
        let order = self.machine.order.number();
        match self.machine.on(now, input, &self.config) {
            Ok(action) => self.act(order, action),
            Err(unexpected) => self.unexpected(unexpected),
        }
    }

    #[cold]
    fn unexpected(&mut self, Unexpected { state, input }: Unexpected) {
        self.statistics.unexpected += 1;
        self.events.push_notice(RobotEvent::Unexpected { state, input });
    }

    /// All bytes of an input: the expected jobs in one pass, the rest message by message.
    fn read(&mut self, now: Duration, mut bytes: &[u8]) {
        loop {
            bytes = self.queue_expected_jobs(now, bytes);
            let order = self.machine.order.number();
            let action = match self.decoder.next_frame() {
                None if bytes.is_empty() => break,
                None => continue,
                Some(Ok(message)) => {
                    let mut reading = Reading {
                        config: &self.config,
                        ranges: &self.ranges,
                        machine: &mut self.machine,
                        writer: &mut self.writer,
                        events: &mut self.events,
                        statistics: &mut self.statistics,
                    };
                    reading.message(now, &message)
                }
                Some(Err(error)) => {
                    self.statistics.corrupt += 1;
                    self.events.push_notice(RobotEvent::Corrupt(error));
                    self.machine.on(now, Input::Corrupt, &self.config)
                }
            };
            match action {
                Ok(action) => self.act(order, action),
                Err(unexpected) => self.unexpected(unexpected),
            }
        }
    }

    /// Queues the expected jobs that come next, as far as there is room, and publishes them together. The next message, whatever it is,
    /// is in the decoder then, to be read the general way; what that cannot take yet is given back.
    fn queue_expected_jobs<'b>(&mut self, now: Duration, bytes: &'b [u8]) -> &'b [u8] {
        let RobotConfig { dialect, max_number, datagrams, .. } = &self.config;
        let next = self.machine.fast_path(&self.config);
        let expected = next.and_then(|(order, number)| Expected::new(dialect, order, number, *max_number));
        let Some(mut expected) = expected else { return self.decoder.take_next(bytes, *datagrams) };
        let mut count = 0;
        let rest = self.decoder.read_in_place(bytes, *datagrams, |bytes| {
            let (used, queued) =
                queue_jobs::<W, MESSAGE>(bytes, &mut self.writer, &mut expected, &self.ranges);
            count += queued;
            used
        });
        if let Ok(count @ 1..) = u32::try_from(count) {
            self.statistics.queued += u64::from(count);
            self.input(now, Input::Queued { count });
        }
        rest
    }

    /// Does what the machine asks for; `order` is the one that was active before.
    fn act(&mut self, order: u16, action: Action) {
        let next = self.config.numbering().next(self.machine.queued);
        match action {
            // What concerns a single message is done where the message is known.
            Action::Nothing | Action::Queue | Action::Refused | Action::Rejected(_) | Action::Discarded => {}
            Action::NoReply => {
                self.statistics.unanswered += 1;
                self.events.push_notice(RobotEvent::NoReply);
            }
            Action::Clear => self.writer.clear(),
            Action::Interrupt => {
                self.writer.clear();
                push(&mut self.events, RobotEvent::OrderInterrupted { order });
            }
            Action::Started => {
                let order = self.machine.order.number();
                self.statistics.work_cycle.cancel();
                push(&mut self.events, RobotEvent::OrderStarted { order });
            }
            Action::Ending => push(&mut self.events, RobotEvent::OrderEnding { order }),
            Action::Over => {
                self.writer.reset();
                let executed = self.machine.executed;
                push(&mut self.events, RobotEvent::OrderOver { order, executed });
            }
            Action::Cleared => self.events.push_notice(RobotEvent::QueueCleared { next }),
            Action::Drained => self.events.push_notice(RobotEvent::QueueDrained { next }),
            Action::Step(RecoveryStep::Alarm) => push(&mut self.events, RobotEvent::Alarm { order, next }),
            Action::Step(step) => {
                if step == RecoveryStep::Clear {
                    self.writer.clear();
                }
                self.events.push_notice(RobotEvent::Recovery { step, next });
            }
        }
    }
}

/// Queues the expected jobs that these bytes begin with: how many bytes, and how many jobs they are.
#[inline(never)] // by itself it fits the registers
fn queue_jobs<W: Work, const MESSAGE: usize>(
    bytes: &[u8],
    writer: &mut Writer<'_, Job<W>>,
    expected: &mut Expected,
    ranges: &W::Ranges,
) -> (usize, usize) {
    let Ok(mut batch) = writer.claim_batch(writer.free()) else { return (0, 0) };
    let used = expected.read::<W, MESSAGE>(bytes, ranges, |job| {
        let claim = batch.claim();
        claim.map(|claim| claim.push(*job)).is_ok()
    });
    (used, batch.publish())
}

impl<W: Work, const MESSAGE: usize, const WORDS: usize> Session for Robot<'_, W, MESSAGE, WORDS> {
    type Event = RobotEvent;
    type Statistics = RobotStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Message::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        self.decoder.clear();
        self.statistics.exchange.cancel();
        self.input(now, Input::Connected);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.input(now, Input::Disconnected);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        if !self.machine.is_connected() {
            return self.unexpected(Unexpected { state: "not connected", input: "bytes" });
        }
        self.read(now, bytes);
        if !self.decoder.is_inside_message() {
            let waited = self.machine.is_waiting();
            self.input(now, Input::ReadEnd);
            if waited && !self.machine.is_waiting() {
                self.statistics.exchange.end(now);
            }
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        // A step of recovery and the end of a cycle may be due at once.
        self.input(now, Input::Timeout);
        self.input(now, Input::Timeout);
        if self.writer.is_settled() || self.writer.is_abandoned() {
            self.input(now, Input::Settled);
        }
        let low_water = self.config.low_water.unwrap_or(self.writer.capacity() / 2);
        if self.writer.drained(low_water) {
            self.input(now, Input::Drained);
        }
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.events.pop().or_else(|| {
            Some(match self.machine.report()? {
                Report::Connect => RobotEvent::Connect,
                Report::Disconnect => RobotEvent::Disconnect,
            })
        })
    }

    /// A buffer shorter than [`Limits::packet`](crate::Limits) is too small.
    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let out = out.get_mut(..self.config.limits.packet)?;
        let dialect = &self.config.dialect;
        let mut packet = Packet::new(out, self.config.limits, dialect.charset());
        let sent = self.machine.transmit(now, &self.config, |message| {
            let (role, params) = message.write();
            packet.write(dialect, role, &params)
        });
        if !sent {
            return None;
        }
        if packet.is_empty() {
            // All that was to be sent is of roles that the table lacks.
            packet.write(dialect, Role::Filler, &Params::default());
        }
        self.statistics.packets += 1;
        self.statistics.exchange.begin(now);
        Some(packet.as_bytes().len())
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.machine.deadline()
    }

    fn statistics(&self) -> RobotStatistics {
        RobotStatistics { dropped_notices: self.events.dropped_notices(), ..self.statistics }
    }
}
