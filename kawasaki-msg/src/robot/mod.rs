//! The robot's end: the active side.

mod config;
mod event;
mod intake;
mod recovery;

use core::time::Duration;

use robot_work_queue::Writer;

use crate::decoder::Decoder;
use crate::dialect::{Field, Params, Role};
use crate::error::{ConfigError, DecodeError, MessageError, SessionError};
use crate::events::Events;
use crate::job::Job;
use crate::message::Message;
use crate::numbering::NumberSet;
use crate::packet::{Packet, Room};
use crate::plain::PlainJobs;
use crate::state::{Link, LinkEvent, OrderEvent, Phase};
use crate::statistics::Statistics;
use crate::timing;

pub use config::{Acks, RobotConfig};
pub use event::RobotEvent;
use intake::{Intake, Reset};
use recovery::Recovery;
pub use recovery::{Ladder, Rung};

/// The session of a robot: it opens the connection, speaks first in every cycle, and queues the jobs that the PC sends.
///
/// In each pass of the loop that does the input and output:
///
/// 1. [`job_done`](Self::job_done) for every job that the motion task has reported since the last pass;
/// 2. [`handle_timeout`](Self::handle_timeout);
/// 3. [`poll_event`](Self::poll_event) until it gives `None`; on [`RobotEvent::Connect`] open a connection and call
///    [`handle_connected`](Self::handle_connected) or [`handle_closed`](Self::handle_closed);
/// 4. [`poll_transmit`](Self::poll_transmit) until it gives `None`, each packet in one write;
/// 5. read, at the latest until [`poll_timeout`](Self::poll_timeout), and call [`handle_input`](Self::handle_input); when the
///    connection is lost, [`handle_closed`](Self::handle_closed).
///
/// One cycle is: send at least one message, filler if there is none; wait for the answer, but not longer than
/// [`RobotConfig::reply_timeout`]; start again.
///
/// **The motion task** takes a job from the queue's [`Reader`](robot_work_queue::Reader), executes it, *reports its number*, and
/// only then completes it. Reported before it is completed, a job that was executed when an order is interrupted or the queue
/// is cleared is never asked for again. It keeps taking while it is idle: that is when a cleared queue is swept.
///
/// **Damage** costs the message that it touches and is told as an event; the bytes always advance. All bytes of an input are
/// taken. **Events** that nobody polls: 32 are kept, 20 of them reports of damage; later ones are dropped and counted in
/// [`Statistics::missed_events`]. Connect and disconnect are never dropped.
///
/// An order outlives its connection. After a new one both ends tell each other by status what is queued and executed, and the
/// robot asks for the job behind the last that it has queued.
#[derive(Debug)]
pub struct Robot<'q> {
    decoder: Decoder,
    core: Core<'q>,
}

#[derive(Debug)]
struct Core<'q> {
    config: RobotConfig,
    intake: Intake<'q>,
    link: Link,
    phase: Phase,
    /// The active order; 0 for none.
    order: u16,
    /// How its jobs are read in one pass; `None` where they cannot be.
    plain: Option<PlainJobs>,
    /// The order that ended last, and the last job of it that was executed.
    ended: Option<u16>,
    ended_executed: Option<u16>,
    /// Over datagrams: the numbers of the orders before, as many as a late datagram can still name; 0 for none.
    ended_before: [u16; 16],
    /// Over datagrams: no order begins before.
    deaf_until: Option<Duration>,
    cycle: Cycle,
    connect_at: Duration,
    asks: Asks,
    /// An answer has come since the connection was opened: both ends have told each other where they are.
    synced: bool,
    silent: u16,
    owed: Owed,
    /// Up to which count executed jobs are acknowledged, where an acknowledgement covers all before it.
    acked: u32,
    /// Executed and not acknowledged, where each is acknowledged by itself.
    unacked: NumberSet,
    /// The queue was full and has not drained yet.
    full: bool,
    hold_until: Duration,
    recovery: Recovery,
    /// Whether this cycle has had its failure and its repeat: the others of the packet follow from them.
    failed: bool,
    repeated: bool,
    peer: Option<(u16, Phase, Option<u16>, Option<u16>)>,
    status_at: Duration,
    last_done: Option<Duration>,
    events: Events<RobotEvent>,
    statistics: Statistics,
}

/// Where the cycle is.
#[derive(Debug, Clone, Copy)]
enum Cycle {
    /// A packet goes out at this time.
    Ready(Duration),
    /// A packet went out, and its answer is awaited.
    Waiting { sent: Duration, answered: bool },
}

/// What the caller is to do with the connection; apart from the events because it must not be dropped.
#[derive(Debug, Clone, Copy, Default)]
struct Asks {
    connect: bool,
    disconnect: bool,
}

/// What the next packet has to say.
#[derive(Debug, Clone, Copy, Default)]
struct Owed {
    status: bool,
    pause: bool,
    order_ack: Option<u16>,
    end_ack: Option<u16>,
}

impl<'q> Robot<'q> {
    /// A session that wants to connect at once. It queues its jobs through `writer`, whose highest job number is the one that
    /// both ends have agreed on.
    ///
    /// # Errors
    /// When the configuration cannot work.
    pub fn new(config: RobotConfig, writer: Writer<'q, Job>) -> Result<Self, ConfigError> {
        config.check()?;
        let max = writer.max_number();
        if !(2..=crate::Dialect::MAX_NUMBER).contains(&max) {
            return Err(ConfigError::MaxNumber { found: max });
        }
        let core = Core {
            config,
            intake: Intake::new(writer),
            link: Link::Disconnected,
            phase: Phase::Idle,
            order: 0,
            plain: None,
            ended: None,
            ended_executed: None,
            ended_before: [0; 16],
            deaf_until: None,
            cycle: Cycle::Ready(Duration::ZERO),
            connect_at: Duration::ZERO,
            asks: Asks::default(),
            synced: false,
            silent: 0,
            owed: Owed::default(),
            acked: 0,
            unacked: NumberSet::new(),
            full: false,
            hold_until: Duration::ZERO,
            recovery: Recovery::default(),
            failed: false,
            repeated: false,
            peer: None,
            status_at: Duration::ZERO,
            last_done: None,
            events: Events::new(),
            statistics: Statistics::default(),
        };
        Ok(Self { decoder: Decoder::new(config.dialect.charset()), core })
    }

    /// The connection is open. Nothing of the one before it is left.
    pub fn handle_connected(&mut self, now: Duration) {
        self.decoder.clear();
        self.core.connected(now);
    }

    /// The connection is closed, or could not be opened: another is asked for after [`RobotConfig::reconnect_delay`].
    pub fn handle_closed(&mut self, now: Duration) {
        let core = &mut self.core;
        if let Some(link) = core.link.on(LinkEvent::Closed) {
            core.link = link;
            core.connect_at = now + core.config.reconnect_delay;
            core.asks = Asks::default();
        }
    }

    /// Takes what was read from the connection.
    pub fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        if self.core.link != Link::Connected {
            return;
        }
        loop {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            if bytes.is_empty() && self.core.config.datagrams {
                self.decoder.finish();
            }
            self.read(now);
            if bytes.is_empty() {
                break;
            }
        }
        self.core.end_cycle(now, self.decoder.is_inside_message());
    }

    /// Everything that the decoder has: plain jobs in one pass, the rest message by message.
    fn read(&mut self, now: Duration) {
        loop {
            self.core.on_plain_jobs(&mut self.decoder);
            match self.decoder.next_frame() {
                Some(Ok(message)) => self.core.on_message(now, &message),
                Some(Err(error)) => self.core.on_damage(error),
                None => break,
            }
        }
    }

    /// Looks at the clock and at the queue. Call it in every pass of the loop: a settled queue has no other way to be seen.
    pub fn handle_timeout(&mut self, now: Duration) {
        self.core.on_time(now);
    }

    /// The next packet, if one is due: write all of it. `out` should hold [`Limits::packet`](crate::Limits) bytes; a shorter one
    /// makes shorter packets, and one too short for any message none.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.core.transmit(now, out)
    }

    /// What has happened.
    pub fn poll_event(&mut self) -> Option<RobotEvent> {
        let asks = &mut self.core.asks;
        if core::mem::take(&mut asks.connect) {
            return Some(RobotEvent::Connect);
        }
        if core::mem::take(&mut asks.disconnect) {
            return Some(RobotEvent::Disconnect);
        }
        self.core.events.pop()
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and [`poll_transmit`](Self::poll_transmit) at the latest; `None`
    /// while a connection is being opened.
    pub fn poll_timeout(&self) -> Option<Duration> {
        let core = &self.core;
        match core.link {
            Link::Disconnected => Some(core.connect_at),
            Link::Connecting => None,
            Link::Connected => Some(match core.cycle {
                Cycle::Ready(at) => at,
                Cycle::Waiting { sent, .. } => sent + core.config.reply_timeout,
            }),
        }
    }

    /// The motion task has executed a job. Hand over every report before the next [`handle_timeout`](Self::handle_timeout).
    ///
    /// # Errors
    /// When no job of this number is in the queue, or it was reported before.
    pub fn job_done(&mut self, now: Duration, number: u16) -> Result<(), SessionError> {
        self.core.on_done(now, number)
    }

    /// The first reset: clears the queue of all jobs but the one that is being executed; those not executed come again. Leads out
    /// of an alarm.
    ///
    /// # Errors
    /// When no order is active.
    pub fn clear_queue(&mut self) -> Result<(), SessionError> {
        let core = &mut self.core;
        match core.phase {
            Phase::Active => {}
            Phase::Alarm => core.go(OrderEvent::Recovered),
            _ => return Err(SessionError::NoOrder),
        }
        core.recovery = Recovery::default();
        core.intake.reset(Reset::List);
        Ok(())
    }

    /// The second reset: clears the queue and forgets the order, as an interruption by the PC does.
    ///
    /// # Errors
    /// When no order is active.
    pub fn reset_order(&mut self) -> Result<(), SessionError> {
        if self.core.interrupt() { Ok(()) } else { Err(SessionError::NoOrder) }
    }

    /// Keeps a time that the caller has measured: unpacking one packet and queueing its jobs.
    pub fn record_unpack(&mut self, time: Duration) {
        self.core.statistics.unpack.record(time);
    }

    /// The connection's state.
    pub fn link(&self) -> Link {
        self.core.link
    }

    /// How far the order is.
    pub fn phase(&self) -> Phase {
        self.core.phase
    }

    /// The active order; `None` when the robot is idle.
    pub fn order(&self) -> Option<u16> {
        (self.core.order != 0).then_some(self.core.order)
    }

    /// How many jobs of the active order, or of the last one, were queued.
    pub fn queued(&self) -> u32 {
        self.core.intake.queued()
    }

    /// Up to which count the jobs of the active order, or of the last one, are executed.
    pub fn executed(&self) -> u32 {
        self.core.intake.executed()
    }

    /// Whether the motion task has dropped its end of the queue.
    pub fn is_abandoned(&self) -> bool {
        self.core.intake.is_abandoned()
    }

    /// What was measured and counted.
    pub fn statistics(&self) -> Statistics {
        Statistics { missed_events: self.core.events.missed, ..self.core.statistics }
    }
}

impl Core<'_> {
    fn go(&mut self, event: OrderEvent) {
        if let Some(phase) = self.phase.on(event) {
            self.phase = phase;
            self.owed.status = true;
        }
    }

    fn connected(&mut self, now: Duration) {
        let Some(link) = self.link.on(LinkEvent::Opened) else { return };
        self.link = link;
        self.deaf_until.get_or_insert(now + timing::LATEST_DATAGRAM);
        self.cycle = Cycle::Ready(now);
        self.asks = Asks::default();
        (self.synced, self.silent) = (false, 0);
        self.owed.status = true;
        self.peer = None;
        // The status covers what is executed in order; what was executed ahead of it may not have been heard of.
        self.acked = self.intake.executed();
        if self.config.acks == Acks::Individual {
            self.unacked = self.intake.done_ahead().clone();
        }
    }

    fn on_time(&mut self, now: Duration) {
        if self.link == Link::Disconnected && now >= self.connect_at {
            self.link = self.link.on(LinkEvent::Connect).unwrap_or(self.link);
            self.asks.connect = true;
        }
        if let Cycle::Waiting { sent, .. } = self.cycle
            && self.link == Link::Connected
            && now >= sent + self.config.reply_timeout
        {
            self.cycle = Cycle::Ready(now);
            self.statistics.unanswered += 1;
            self.events.push_report(RobotEvent::NoReply);
            self.silent = self.silent.saturating_add(1);
            self.asks.disconnect = self.config.silent_cycles != 0 && self.silent >= self.config.silent_cycles;
        }
        let all_done = self.intake.executed() == self.intake.queued();
        if self.phase == Phase::Ending && all_done && !self.intake.is_resetting() {
            self.intake.reset(Reset::Order);
        }
        match self.intake.poll_reset() {
            Some(Reset::List) => {
                self.full = false;
                self.events.push(RobotEvent::QueueCleared { next: self.intake.expected() });
            }
            Some(Reset::Order) => self.over(),
            None => {}
        }
        let low_water = self.config.low_water.unwrap_or(self.intake.capacity() / 2);
        if self.full && self.intake.drained(low_water) {
            self.full = false;
            self.events.push_report(RobotEvent::QueueDrained { next: self.intake.expected() });
        }
    }

    /// The queue is empty, and the order is forgotten.
    fn over(&mut self) {
        let order = core::mem::take(&mut self.order);
        self.ended_before.rotate_right(1);
        self.ended_before[0] = order;
        self.ended_executed = self.number(self.intake.executed());
        self.plain = None;
        self.go(OrderEvent::Over);
        (self.full, self.ended, self.owed.end_ack) = (false, Some(order), Some(order));
        // The end says it for those before.
        self.acked = self.intake.executed();
        self.events.push(RobotEvent::OrderOver { order, executed: self.intake.executed() });
    }

    fn interrupt(&mut self) -> bool {
        let possible = self.phase.on(OrderEvent::Interrupt).is_some();
        if possible {
            self.go(OrderEvent::Interrupt);
            self.intake.reset(Reset::Order);
            self.events.push(RobotEvent::OrderInterrupted { order: self.order });
        }
        possible
    }

    fn on_done(&mut self, now: Duration, number: u16) -> Result<(), SessionError> {
        self.intake.done(number)?;
        if self.config.acks == Acks::Individual {
            self.unacked.insert(number);
        }
        self.statistics.executed += 1;
        if let Some(before) = self.last_done.replace(now) {
            self.statistics.work_cycle.record(now.saturating_sub(before));
        }
        Ok(())
    }
}

mod exchange;
