//! For authors of a link: the parts of an end, and the session of every end, one loop for all links.

use core::time::Duration;

pub use crate::buffer::StreamBuffer;
pub use crate::bytes::ByteDecoder;
pub use crate::counters::Counters;
pub use crate::echo::Echo;
pub use crate::event::{EventQueue, Events};
pub use crate::machine::{Expiry, Input, Machine, is_due};
pub use crate::rules::{Rule, Rules};
use crate::{Decoder, Session, Unexpected, trace};

/// The parts of an end.
#[derive(Debug, Clone)]
pub struct Core<M: Machine, D, Q, S> {
    /// The configuration of the end.
    pub config: M::Config,
    /// The state machine of the end.
    pub machine: M,
    /// The decoder of the frames.
    pub decoder: D,
    /// Events that the caller has not polled yet.
    pub events: Q,
    /// The counters of the end.
    pub statistics: S,
    /// Whether reading has stopped; frames may then wait in the decoder.
    held: bool,
    /// A record of the machine's inputs: time, state and input; `None` if it is not enabled.
    #[cfg(feature = "model")]
    pub moves: Option<std::vec::Vec<(Duration, M, M::Input)>>,
}

/// The free entries that each step needs in the event queue for its outcomes. Without them the step does not begin.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct QueueSpace {
    /// Entries needed before a connection begins; without them the session stays without a connection.
    pub connect: usize,
    /// Entries needed before a frame is read; without them the frame waits in the decoder.
    pub read: usize,
    /// Entries needed before a message is sent.
    pub transmit: usize,
}

/// One end of a link: the meaning of its frames, the reports of its actions, and the encoding of its messages. It decides
/// nothing: an `if` about a rule of the protocol belongs in its [`Machine`].
///
/// Every implementor is a [`Session`].
pub trait End: Sized {
    /// The state machine of the end.
    type Machine: Machine;
    /// The decoder of the frames.
    type Decoder: Decoder;
    /// The queue of events that the caller has not polled yet.
    type Events: Events;
    /// [`Session::Statistics`].
    type Statistics: Counters;
    /// The data of a frame that the machine does not use.
    type Payload;

    /// [`Session::LINK`].
    const LINK: &'static str;
    /// [`Session::END`].
    const END: &'static str;
    /// [`Session::MAX_INPUT`]. If the machine can stop reading, this many bytes fit the decoder beside the beginning of a
    /// frame.
    const MAX_INPUT: usize;
    /// [`Session::MAX_TRANSMIT`].
    const MAX_TRANSMIT: usize;
    /// The free entries that each step needs in the event queue.
    const QUEUE_SPACE: QueueSpace;

    /// Returns the parts of the end. [`core!`](crate::core) has both accessors, and [`unexpected`](Self::unexpected).
    fn core(&self) -> &CoreOf<Self>;

    /// Returns the parts of the end.
    fn core_mut(&mut self) -> &mut CoreOf<Self>;

    /// Returns the next frame as an input. Corrupt bytes and frames that are not an input are reported here.
    fn next_input(&mut self) -> Option<(InputOf<Self>, Option<Self::Payload>)>;

    /// Executes an action of the machine.
    fn act(&mut self, now: Duration, action: ActionOf<Self>, payload: Option<Self::Payload>);

    /// Encodes the due message; returns its length, and the input to give when it is sent. Returns `None`, and changes
    /// nothing, if `out` is too short. A length of zero: the message cannot be sent, and the input has the reason.
    fn write(
        &mut self,
        now: Duration,
        what: TransmitOf<Self>,
        out: &mut [u8],
    ) -> Option<(usize, InputOf<Self>)>;

    /// Returns the event for an input that the state does not allow.
    fn unexpected(unexpected: Unexpected) -> EventOf<Self>;

    /// Returns the configuration of the end.
    #[inline]
    fn config(&self) -> &ConfigOf<Self> {
        &self.core().config
    }

    /// Returns the state machine of the end.
    #[inline]
    fn machine(&self) -> &Self::Machine {
        &self.core().machine
    }

    /// Called when a connection begins or has ended. An end of a line with an echo has this and `take_echo` from
    /// [`echo!`](crate::echo).
    #[inline(always)]
    fn reset_echo(&mut self) {}

    /// Returns the bytes that have arrived, without the line's echo of the output.
    #[inline(always)]
    fn take_echo<'a>(&mut self, bytes: &'a [u8]) -> &'a [u8] {
        bytes
    }

    /// Called when bytes have arrived, before they are decoded. Returns false to discard them.
    #[inline]
    fn begin_input(&mut self, _now: Duration) -> bool {
        true
    }

    /// Called when all bytes are decoded. Does nothing by default.
    #[inline]
    fn end_input(&mut self, _now: Duration) {}

    /// Reads other inputs, such as the queue that a robot fills, after expired deadlines. The code that changes such an
    /// input wakes the caller, see [`Session`].
    #[inline]
    fn look(&mut self, _now: Duration) {}

    /// Implements [`Session::wants_input`]: by default, returns true while frames are read and the decoder has no complete
    /// frame. An end may also accept the bytes that fit its decoder.
    #[inline]
    fn takes_input(&self) -> bool {
        self.reads() && !self.core().held
    }

    /// Called when more bytes have arrived than fit while reading is stopped: they are lost, except for the bytes that fit
    /// after this call.
    fn overrun(&mut self, _now: Duration) {}

    /// Implements [`Session::handle_transmitted`].
    fn transmitted(&mut self, _now: Duration) {}

    /// Implements [`Session::discards_after`].
    fn discards_after(&self) -> Option<Duration> {
        None
    }

    /// Removes and returns the oldest event for the caller.
    #[inline]
    fn next_event(&mut self) -> Option<EventOf<Self>> {
        self.core_mut().events.pop()
    }

    /// Gives the machine an input, and executes its action.
    #[inline(always)] // where the input is known, little of the machine is left
    fn advance(&mut self, now: Duration, input: InputOf<Self>, payload: Option<Self::Payload>) {
        match self.core_mut().on(now, input) {
            Ok(action) => self.act(now, action, payload),
            Err(unexpected) => self.refuse(unexpected),
        }
    }

    /// Passes a call to the machine, which may reject it.
    ///
    /// # Errors
    /// The state does not allow it. Nothing has changed, and nothing is reported.
    #[inline]
    fn ask(&mut self, now: Duration, input: InputOf<Self>) -> Result<(), Unexpected> {
        let action = self.core_mut().on(now, input)?;
        self.act(now, action, None);
        Ok(())
    }

    /// Passes a call to the machine, after expired deadlines if these come first.
    #[inline]
    fn request(&mut self, now: Duration, input: InputOf<Self>) {
        expire_first(self, now);
        self.advance(now, input, None);
    }

    /// Counts and reports an input that the state does not allow.
    #[cold]
    fn refuse(&mut self, unexpected: Unexpected) {
        let core = self.core_mut();
        *core.statistics.unexpected() += 1;
        core.events.push_notice(Self::unexpected(unexpected));
    }

    /// Returns whether frames are read now.
    #[inline]
    fn reads(&self) -> bool {
        let core = self.core();
        core.machine.reads() && core.events.has_room(Self::QUEUE_SPACE.read)
    }

    /// Reads every frame that the decoder has.
    #[inline(always)] // into the one place that often has bytes
    fn read(&mut self, now: Duration) {
        while self.reads() {
            let Some((input, payload)) = self.next_input() else { return };
            self.advance(now, input, payload);
        }
        self.core_mut().held = true;
    }

    /// Gives up an incomplete frame, and reads the frames after its beginning.
    fn finish(&mut self, now: Duration) {
        self.core_mut().decoder.finish();
        read_on(self, now);
    }
}

/// The [`Core`] of an end.
pub type CoreOf<E> =
    Core<<E as End>::Machine, <E as End>::Decoder, <E as End>::Events, <E as End>::Statistics>;
/// The [`Machine::Config`] of an end.
pub type ConfigOf<E> = <<E as End>::Machine as Machine>::Config;
/// The [`Machine::Input`] of an end.
pub type InputOf<E> = <<E as End>::Machine as Machine>::Input;
/// The [`Machine::Action`] of an end.
pub type ActionOf<E> = <<E as End>::Machine as Machine>::Action;
/// The [`Machine::Transmit`] of an end.
pub type TransmitOf<E> = <<E as End>::Machine as Machine>::Transmit;
/// The [`Session::Event`] of an end.
pub type EventOf<E> = <<E as End>::Events as Events>::Event;

impl QueueSpace {
    /// No outcomes: every event is a notice.
    pub const NONE: Self = Self { connect: 0, read: 0, transmit: 0 };
}

impl<M: Machine, D, Q: Default, S: Default> Core<M, D, Q, S> {
    /// Creates an end without events.
    pub fn new(config: M::Config, machine: M, decoder: D) -> Self {
        Self {
            config,
            machine,
            decoder,
            events: Q::default(),
            statistics: S::default(),
            held: false,
            #[cfg(feature = "model")]
            moves: None,
        }
    }

    /// Gives the machine an input.
    ///
    /// # Errors
    /// The state does not allow it. Nothing has changed.
    #[inline(always)] // where the input is known, little of the machine is left
    pub fn on(&mut self, now: Duration, input: M::Input) -> Result<M::Action, Unexpected> {
        #[cfg(feature = "model")]
        let noted = self.moves.as_ref().map(|_| (now, self.machine.clone(), input.clone()));
        let result = self.machine.on(now, input, &self.config);
        #[cfg(feature = "model")]
        if let (Some(moves), Some(noted), Ok(_)) = (&mut self.moves, noted, &result) {
            moves.push(noted);
        }
        result
    }
}

impl<M: Machine, D, Q: Events, S> Core<M, D, Q, S> {
    /// Reports an outcome. Its step began only with a free entry for it.
    #[inline]
    pub fn push_outcome(&mut self, outcome: Q::Event) {
        let pushed = self.events.push_outcome(outcome);
        debug_assert!(pushed.is_ok(), "begun only with room for its outcomes");
    }
}

impl<E: End> Session for E {
    type Event = EventOf<E>;
    type Statistics = E::Statistics;

    const LINK: &'static str = E::LINK;
    const END: &'static str = E::END;
    const MAX_INPUT: usize = E::MAX_INPUT;
    const MAX_TRANSMIT: usize = E::MAX_TRANSMIT;

    fn handle_connected(&mut self, now: Duration) {
        trace::connected();
        expire_first(self, now);
        self.reset_echo();
        let core = self.core_mut();
        core.decoder.clear();
        let has_room = core.events.has_room(E::QUEUE_SPACE.connect);
        self.advance(now, if has_room { Input::CONNECTED } else { Input::DISCONNECTED }, None);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        trace::disconnected();
        expire_first(self, now);
        self.reset_echo();
        self.core_mut().decoder.clear();
        self.advance(now, Input::DISCONNECTED, None);
    }

    #[inline]
    fn handle_input(&mut self, now: Duration, mut bytes: &[u8]) {
        trace::received(bytes);
        if matches!(E::Machine::EXPIRY, Expiry::First | Expiry::BeforeInput | Expiry::BeforeBytes) {
            self.handle_timeout(now);
        }
        bytes = self.take_echo(bytes);
        if bytes.is_empty() || !self.begin_input(now) {
            return;
        }
        while !bytes.is_empty() {
            let takes = push(self, &mut bytes);
            self.read(now);
            if !takes && !self.reads() {
                self.overrun(now);
                if !push(self, &mut bytes) {
                    break;
                }
            }
        }
        self.end_input(now);
    }

    #[inline]
    fn handle_timeout(&mut self, now: Duration) {
        while self.core().machine.expires(now) {
            if self.core().machine.cuts() {
                self.finish(now);
            }
            // The frames decoded just now may have cleared the deadline.
            if self.core().machine.expires(now) {
                self.advance(now, Input::TIMEOUT, None);
            }
        }
        self.look(now);
    }

    fn handle_transmitted(&mut self, now: Duration) {
        self.transmitted(now);
    }

    fn wants_input(&self) -> bool {
        self.takes_input()
    }

    #[inline]
    fn poll_event(&mut self) -> Option<Self::Event> {
        self.next_event().inspect(trace::event)
    }

    #[inline]
    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        if matches!(E::Machine::EXPIRY, Expiry::First | Expiry::BeforeTransmit | Expiry::BeforeBytes) {
            self.handle_timeout(now);
        }
        // Reading stops until an event was polled, or the caller has made a call.
        read_held(self, now);
        let core = self.core();
        let what = core.machine.transmit(now, &core.config)?;
        if !core.events.has_room(E::QUEUE_SPACE.transmit) {
            return None;
        }
        let (length, sent) = self.write(now, what, out)?;
        trace::written(out.get(..length).unwrap_or_default());
        self.advance(now, sent, None);
        // Read at once: a caller that polls until there is nothing more would miss the event of a frame that is read when
        // nothing is sent.
        read_held(self, now);
        (length > 0).then_some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.core().machine.deadline()
    }

    fn discards_after(&self) -> Option<Duration> {
        End::discards_after(self).filter(|after| *after < Duration::MAX)
    }

    fn statistics(&self) -> E::Statistics {
        let core = self.core();
        let mut statistics = core.statistics;
        *statistics.dropped_notices() = core.events.dropped_notices();
        statistics
    }
}

/// Handles expired deadlines if the machine requires that first ([`Expiry::First`]).
#[inline(always)]
fn expire_first<E: End>(end: &mut E, now: Duration) {
    if E::Machine::EXPIRY == Expiry::First {
        end.handle_timeout(now);
    }
}

/// Gives the decoder the bytes that it takes; returns whether it takes any.
#[inline(always)]
fn push<E: End>(end: &mut E, bytes: &mut &[u8]) -> bool {
    let taken = end.core_mut().decoder.push(bytes);
    *bytes = bytes.get(taken..).unwrap_or_default();
    taken > 0
}

/// Calls [`End::read`] out of line, for callers that rarely have bytes.
#[inline(never)]
fn read_on<E: End>(end: &mut E, now: Duration) {
    end.read(now);
}

/// Reads the frames in the decoder, if there are any.
#[inline(always)]
fn read_held<E: End>(end: &mut E, now: Duration) {
    if end.core().held {
        end.core_mut().held = false;
        read_on(end, now);
    }
}

/// The accessors of an [`End`](crate::end::End) whose [`Core`](crate::end::Core) is its field `core`, and the event of an
/// [`Unexpected`].
#[macro_export]
macro_rules! core {
    ($unexpected:path) => {
        #[inline(always)]
        fn core(&self) -> &$crate::end::CoreOf<Self> {
            &self.core
        }

        #[inline(always)]
        fn core_mut(&mut self) -> &mut $crate::end::CoreOf<Self> {
            &mut self.core
        }

        fn unexpected(unexpected: $crate::Unexpected) -> $crate::end::EventOf<Self> {
            $unexpected(unexpected)
        }
    };
}

/// The methods of an [`End`](crate::end::End) for its field `echo`, an [`Echo`](crate::end::Echo), and the event of an
/// [`EchoError`](crate::EchoError).
#[macro_export]
macro_rules! echo {
    ($event:path) => {
        #[inline]
        fn reset_echo(&mut self) {
            self.echo.reset();
        }

        #[inline]
        fn take_echo<'a>(&mut self, bytes: &'a [u8]) -> &'a [u8] {
            let (rest, error) = self.echo.receive(bytes);
            if let Some(error) = error {
                if let $crate::EchoError::NotSet { .. } = error {
                    // The beginning of the echo is in the decoder.
                    $crate::Decoder::clear(&mut self.core.decoder);
                }
                $crate::end::Events::push_notice(&mut self.core.events, $event(error));
            }
            rest
        }
    };
}
