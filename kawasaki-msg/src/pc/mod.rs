//! The PC's end: it answers.

mod config;
mod event;
mod messages;
mod reply;
mod source;

use core::time::Duration;

use crate::decoder::Decoder;
use crate::dialect::Role;
use crate::error::{ConfigError, SessionError};
use crate::events::Events;
use crate::numbering::{NumberSet, Numbering};
use crate::state::{Link, LinkEvent, OrderEvent, Phase};

pub use config::{PcConfig, Takeover};
pub use event::PcEvent;
pub use source::{JobSource, Supply};

/// The session of a PC: it listens, and sends only what the robot waits for.
///
/// In each pass of the loop that does the input and output:
///
/// 1. [`handle_timeout`](Self::handle_timeout);
/// 2. [`poll_event`](Self::poll_event) until it gives `None`;
/// 3. [`poll_transmit`](Self::poll_transmit) until it gives `None`, each packet in one write;
/// 4. read, at the latest until [`poll_timeout`](Self::poll_timeout), and call [`handle_input`](Self::handle_input).
///
/// A connection that was accepted is told by [`handle_connected`](Self::handle_connected), its end by
/// [`handle_closed`](Self::handle_closed). The order goes on with the next one.
///
/// Nothing is sent unless the robot has sent something first: it cannot flush what it does not expect (thesis, section 10.4).
/// The whole of what has come is read before it is answered, and the answer is made from the state of then: nothing of an earlier
/// answer is left to be sent twice (thesis, sections 11.3 and 12.2). It holds the messages for which a reply is defined, or
/// filler.
///
/// **Damage** costs the message that it touches and is told as an event; the bytes always advance. All bytes of an input are
/// taken. **Events** that nobody polls: 32 are kept, 20 of them reports of damage; later ones are dropped and counted
/// ([`missed_events`](Self::missed_events)). Progress is never dropped: the last state of it is told.
#[derive(Debug)]
pub struct Pc<S> {
    decoder: Decoder,
    core: Core<S>,
}

#[derive(Debug)]
struct Core<S> {
    config: PcConfig,
    numbering: Numbering,
    link: Link,
    phase: Phase,
    order: Order<S>,
    /// The order before: its late acknowledgements are no error.
    before: u16,
    /// The order that has to end before ours can begin.
    foreign: Option<u16>,
    refusals: u16,
    /// When the start that is not acknowledged yet went out.
    start_sent: Option<Duration>,
    owed: Owed,
    /// Since when the robot, over datagrams, seems not to be in our order: it may be an old one that was overtaken.
    doubt: Option<Duration>,
    heard_at: Duration,
    disconnect: bool,
    commands: [Option<(u8, i32)>; COMMANDS],
    peer: Option<(u16, Phase, Option<u16>, Option<u16>)>,
    events: Events<PcEvent>,
}

const COMMANDS: usize = 4;

/// The order of ours, and how far it is. Jobs are counted; their numbers are made from the counts.
#[derive(Debug)]
struct Order<S> {
    number: u16,
    source: Option<S>,
    /// Up to which count all jobs are executed.
    executed: u32,
    /// Executed ahead of those before them.
    done: NumberSet,
    /// How many jobs the robot has queued, as far as we know.
    queued: u32,
    /// How many were ever sent.
    sent: u32,
    /// How many there are, once the source has said it.
    total: Option<u32>,
    /// What was told by the last progress event.
    told: (u32, u32),
}

/// What the answer has to hold.
#[derive(Debug, Clone, Copy, Default)]
struct Owed {
    /// Something was heard since the last answer: we may send.
    heard: bool,
    status: bool,
    /// The jobs from this count on.
    jobs: Option<u32>,
}

impl<S> Order<S> {
    const NONE: Self = Self {
        number: 0,
        source: None,
        executed: 0,
        done: NumberSet::new(),
        queued: 0,
        sent: 0,
        total: None,
        told: (0, 0),
    };
}

impl<S: JobSource> Pc<S> {
    /// A session without an order that listens.
    ///
    /// # Errors
    /// When the configuration cannot work.
    pub fn new(config: PcConfig) -> Result<Self, ConfigError> {
        config.check()?;
        let core = Core {
            config,
            numbering: Numbering::new(config.max_number),
            link: Link::Connecting,
            phase: Phase::Idle,
            order: Order::NONE,
            before: 0,
            foreign: None,
            refusals: 0,
            start_sent: None,
            owed: Owed::default(),
            doubt: None,
            heard_at: Duration::ZERO,
            disconnect: false,
            commands: [None; COMMANDS],
            peer: None,
            events: Events::new(),
        };
        Ok(Self { decoder: Decoder::new(config.dialect.charset()), core })
    }

    /// A connection was accepted. Nothing of the one before it is left.
    pub fn handle_connected(&mut self, now: Duration) {
        let core = &mut self.core;
        if let Some(link) = core.link.on(LinkEvent::Opened) {
            core.link = link;
            (core.heard_at, core.owed, core.disconnect, core.peer) = (now, Owed::default(), false, None);
            core.start_sent = None;
            self.decoder.clear();
        }
    }

    /// The connection is closed.
    pub fn handle_closed(&mut self, _now: Duration) {
        let core = &mut self.core;
        let link = core.link.on(LinkEvent::Closed).and_then(|link| link.on(LinkEvent::Connect));
        core.link = link.unwrap_or(core.link);
        core.disconnect = false;
    }

    /// Takes what was read from the connection.
    pub fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        if self.core.link != Link::Connected {
            return;
        }
        self.core.heard_at = now;
        loop {
            let taken = self.decoder.push(bytes);
            bytes = bytes.get(taken..).unwrap_or_default();
            if bytes.is_empty() && self.core.config.datagrams {
                self.decoder.finish();
            }
            while let Some(frame) = self.decoder.next_frame() {
                match frame {
                    Ok(message) => self.core.on_message(&message),
                    Err(error) => self.core.events.push_report(PcEvent::Damaged(error)),
                }
            }
            if bytes.is_empty() {
                break;
            }
        }
    }

    /// Looks at the clock.
    pub fn handle_timeout(&mut self, now: Duration) {
        let core = &mut self.core;
        let silence = core.config.silence;
        if core.link == Link::Connected && silence != Duration::ZERO && now >= core.heard_at + silence {
            core.heard_at = now;
            core.disconnect = true;
        }
    }

    /// The answer, if one is due: write all of it. `out` should hold [`Limits::packet`](crate::Limits) bytes; a shorter one makes
    /// shorter packets, and one too short for any message none.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let core = &mut self.core;
        let due = core.owed.heard && !self.decoder.is_inside_message();
        if core.link != Link::Connected || !due || now < core.heard_at + core.config.reply_delay {
            return None;
        }
        core.answer(now, out)
    }

    /// What has happened.
    pub fn poll_event(&mut self) -> Option<PcEvent> {
        let core = &mut self.core;
        if core::mem::take(&mut core.disconnect) {
            return Some(PcEvent::Disconnect);
        }
        core.events.pop().or_else(|| core.progress())
    }

    /// When to call [`handle_timeout`](Self::handle_timeout) and [`poll_transmit`](Self::poll_transmit) at the latest; `None` when
    /// only the robot can change anything.
    pub fn poll_timeout(&self) -> Option<Duration> {
        let core = &self.core;
        let silence = core.config.silence;
        let silent_at = (silence != Duration::ZERO).then_some(core.heard_at + silence);
        let due = core.owed.heard && !self.decoder.is_inside_message();
        let answer_at = due.then_some(core.heard_at + core.config.reply_delay);
        let timeout = answer_at.into_iter().chain(silent_at).min();
        timeout.filter(|_| core.link == Link::Connected)
    }

    /// Begins an order. The robot hears of it in its next cycle, also when it is not connected yet.
    ///
    /// # Errors
    /// When there is an order already, or `order` is 0.
    pub fn start(&mut self, order: u16, source: S) -> Result<(), SessionError> {
        let core = &mut self.core;
        if core.phase.on(OrderEvent::Start).is_none() {
            return Err(SessionError::OrderActive { active: core.order.number });
        }
        if order == 0 {
            return Err(SessionError::OrderZero);
        }
        core.go(OrderEvent::Start);
        core.order = Order { number: order, source: Some(source), ..Order::NONE };
        (core.foreign, core.refusals, core.start_sent) = (None, 0, None);
        Ok(())
    }

    /// Ends the order when the jobs that the robot has queued are executed.
    ///
    /// # Errors
    /// When no order is active.
    pub fn end(&mut self) -> Result<(), SessionError> {
        self.core.request(OrderEvent::End)
    }

    /// Ends the order when the job that is being executed is done. It cannot go on after that (thesis, section 11.1).
    ///
    /// # Errors
    /// When there is no order.
    pub fn interrupt(&mut self) -> Result<(), SessionError> {
        self.core.request(OrderEvent::Interrupt)
    }

    /// Sends a command past the queue with the next answer. It is sent once: no reply is defined for it.
    ///
    /// # Errors
    /// When the dialect has no such command, or too many wait.
    pub fn command(&mut self, id: u8, value: i32) -> Result<(), SessionError> {
        let core = &mut self.core;
        if core.config.dialect.entry(Role::Command(id)).role != Role::Command(id) {
            return Err(SessionError::UnknownCommand { id });
        }
        let free = core.commands.iter_mut().find(|place| place.is_none());
        *free.ok_or(SessionError::TooManyCommands { waiting: COMMANDS })? = Some((id, value));
        Ok(())
    }

    /// The connection's state.
    pub fn link(&self) -> Link {
        self.core.link
    }

    /// How far the order is.
    pub fn phase(&self) -> Phase {
        self.core.phase
    }

    /// The order of ours; `None` when there is none.
    pub fn order(&self) -> Option<u16> {
        (self.core.phase != Phase::Idle).then_some(self.core.order.number)
    }

    /// Up to which count the jobs of the order, or of the last one, are executed.
    pub fn executed(&self) -> u32 {
        self.core.order.executed
    }

    /// How many jobs of the order, or of the last one, the robot has queued, as far as it has said.
    pub fn queued(&self) -> u32 {
        self.core.order.queued
    }

    /// How many jobs of the order, or of the last one, were ever sent.
    pub fn sent(&self) -> u32 {
        self.core.order.sent
    }

    /// How many events found no place because nobody polled them.
    pub fn missed_events(&self) -> u64 {
        self.core.events.missed
    }
}

impl<S> Core<S> {
    fn go(&mut self, event: OrderEvent) {
        self.phase = self.phase.on(event).unwrap_or(self.phase);
    }

    fn request(&mut self, event: OrderEvent) -> Result<(), SessionError> {
        if self.phase.on(event).is_none() {
            return Err(SessionError::NoOrder);
        }
        self.go(event);
        Ok(())
    }

    fn progress(&mut self) -> Option<PcEvent> {
        let now = (self.order.executed, self.order.queued);
        (core::mem::replace(&mut self.order.told, now) != now)
            .then_some(PcEvent::Progress { executed: now.0, queued: now.1 })
    }
}
