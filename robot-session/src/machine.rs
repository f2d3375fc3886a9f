//! The state machine of one end of a link, and its inputs.

use core::fmt::Debug;
use core::hash::Hash;
use core::time::Duration;

use crate::unexpected::Unexpected;

/// The state machine of one end of a link: all decisions about the next action, without bytes, buffers or a clock.
///
/// The state is a value: equal states behave equally. Every time in it is a deadline, which is compared only with `now`, so
/// that the states are finitely many and a model can visit all of them. `Duration::MAX` means never.
pub trait Machine: Clone + Eq + Hash + Debug {
    /// The end's name.
    const END: &'static str;

    /// The inputs that wait until an expired deadline is handled.
    const EXPIRY: Expiry;

    /// The inputs of the end.
    type Input: Input;

    /// The reactions of the end.
    type Action: Debug;

    /// The messages that the end sends.
    type Transmit: Debug;

    /// The limits and options of the end.
    type Config;

    /// Takes an input.
    ///
    /// # Errors
    /// The state does not allow the input. Nothing has changed.
    fn on(
        &mut self,
        now: Duration,
        input: Self::Input,
        config: &Self::Config,
    ) -> Result<Self::Action, Unexpected>;

    /// Returns the message to send now. The message stays due until an input reports that it was sent.
    fn transmit(&self, now: Duration, config: &Self::Config) -> Option<Self::Transmit>;

    /// Returns the time at which [`Input::TIMEOUT`] or a message is due; `None` if nothing happens without bytes or a call.
    fn deadline(&self) -> Option<Duration>;

    /// Returns whether [`Input::TIMEOUT`] is due now. Each timeout handles one deadline.
    fn expires(&self, now: Duration) -> bool;

    /// Returns whether an expired deadline gives up the incomplete frame in the decoder, and decodes the bytes after its
    /// beginning, before [`Input::TIMEOUT`]. Return false if the input follows in any case: its action then gives up the
    /// frame.
    #[inline]
    fn cuts(&self) -> bool {
        false
    }

    /// Returns whether frames are read now; otherwise bytes wait.
    #[inline]
    fn reads(&self) -> bool {
        true
    }

    /// Visits every time in the state.
    fn each_time(&mut self, f: impl FnMut(&mut Duration));

    /// Returns the state's name.
    fn name(&self) -> &'static str;

    /// Returns the error of [`on`](Self::on).
    #[cold]
    fn unexpected(&self, input: &Self::Input) -> Unexpected {
        Unexpected { state: self.name(), input: input.name() }
    }
}

/// The inputs that wait until an expired deadline is handled.
///
/// If input does not wait, a reply that a late caller reads after its deadline still counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expiry {
    /// All inputs wait: late input is worthless.
    First,
    /// Bytes wait: after a silence they do not continue an earlier frame.
    BeforeInput,
    /// Sending waits: the message depends on the deadline.
    BeforeTransmit,
    /// Bytes and sending wait; calls do not.
    BeforeBytes,
    /// No input waits: time passes only in [`Session::handle_timeout`](crate::Session::handle_timeout).
    Last,
}

/// The inputs that every machine has, and their names. [`inputs!`](crate::inputs) implements it.
pub trait Input: Clone + Debug {
    /// The connection was made, perhaps again: opening a port is a connection.
    const CONNECTED: Self;
    /// The connection is lost or closed.
    const DISCONNECTED: Self;
    /// A deadline has passed. Given only if [`Machine::expires`] returns true.
    const TIMEOUT: Self;

    /// Returns the input's name.
    fn name(&self) -> &'static str;
}

/// Implements [`Input`](trait@crate::end::Input) for an enum with the variants `Connected`, `Disconnected` and `Timeout`, and
/// with the listed ones. The name of an input is that of its variant, or the text after `as`.
///
/// ```
/// #[derive(Debug, Clone)]
/// enum Input {
///     Connected,
///     Disconnected,
///     Timeout,
///     Sent,
///     Packet { fresh: bool },
/// }
/// robot_session::inputs!(Input: Sent, Packet { fresh: true } as "Packet(fresh)", Packet { fresh: false } as "Packet(old)");
///
/// assert_eq!(robot_session::end::Input::name(&Input::Packet { fresh: true }), "Packet(fresh)");
/// ```
#[macro_export]
macro_rules! inputs {
    ($input:ident $(<$parameter:ident $(: $bound:path)?>)?: $($variant:ident $({ $($field:tt)* } as $name:literal)?),* $(,)?) => {
        impl $(<$parameter $(: $bound)?>)? $crate::end::Input for $input $(<$parameter>)? {
            const CONNECTED: Self = Self::Connected;
            const DISCONNECTED: Self = Self::Disconnected;
            const TIMEOUT: Self = Self::Timeout;

            fn name(&self) -> &'static str {
                match self {
                    Self::Connected => "Connected",
                    Self::Disconnected => "Disconnected",
                    Self::Timeout => "Timeout",
                    $(Self::$variant { $($($field)*,)? .. } => $crate::inputs!(@name $variant $($name)?),)*
                }
            }
        }
    };
    (@name $variant:ident) => {
        stringify!($variant)
    };
    (@name $variant:ident $name:literal) => {
        $name
    };
}

/// Returns whether a deadline has passed; `Duration::MAX` means never.
#[inline]
pub fn is_due(deadline: Duration, now: Duration) -> bool {
    now >= deadline && deadline < Duration::MAX
}
