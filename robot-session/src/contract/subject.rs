//! The subject of the contract's tests: a session, its inputs and its calls.

use core::fmt::Debug;
use core::time::Duration;
use std::format;
use std::string::String;
use std::vec::Vec;

use arbitrary::Arbitrary;

use crate::Session;

/// An observed act of a session, of its peer or of its user.
#[derive(Debug)]
pub enum Observed<'a, E> {
    /// A connection is made or lost.
    Connection,
    /// A byte arrives on a connection.
    Byte(u8),
    /// A message is transmitted, in one piece.
    Sent(&'a [u8]),
    /// The session reports an event to its user.
    Event(&'a E),
    /// The user's call has this result.
    Called(&'a str),
}

/// A session that is checked against the contract: its constructor, the possible inputs of its peer, and the possible calls
/// of its user.
///
/// Inputs and calls are drawn at random, as values that `arbitrary` derives: equal values on equal sessions must do the same.
pub trait Subject {
    /// The session, with the state that its user has besides.
    type Session: Session<Event: Debug>;
    /// The choice of an input: a message, an index into a table, `()` if there is one input.
    type Input: for<'a> Arbitrary<'a> + Debug;
    /// The choice of a call; `()` if there is one call or none.
    type Call: for<'a> Arbitrary<'a> + Debug;

    /// Returns the name of the subject in messages.
    fn name(&self) -> &str {
        core::any::type_name::<Self::Session>()
    }

    /// Returns the number of configurations to test, 1 or more.
    fn configurations(&self) -> usize {
        1
    }

    /// Returns a new session with a configuration. With `is_endless`, each of its timeouts is the longest allowed.
    fn session(&self, configuration: usize, is_endless: bool) -> Self::Session;

    /// Returns the bytes of an input, which arrive at once; most are valid. Input longer than [`Session::MAX_INPUT`] is
    /// truncated to it.
    fn input(&self, session: &Self::Session, configuration: usize, input: &Self::Input) -> Vec<u8>;

    /// Makes one of the user's calls, valid or not, and returns its name and result as text. `None` if there are no calls.
    fn call(
        &self,
        _session: &mut Self::Session,
        _configuration: usize,
        _now: Duration,
        _call: &Self::Call,
    ) -> Option<String> {
        None
    }

    /// Returns an event as text. `None` if it depends on how the input is divided into reads.
    fn event(&self, event: &<Self::Session as Session>::Event) -> Option<String> {
        Some(format!("{event:?}"))
    }

    /// Returns whether these bytes may arrive in several reads. Return false for datagrams.
    fn may_be_cut(&self, _configuration: usize, _bytes: &[u8]) -> bool {
        true
    }

    /// Returns the number of notices that a session has dropped. If it is not 0, events are not compared, because the
    /// division of the input into reads decides which notices are dropped.
    fn dropped_notices(&self, _statistics: &<Self::Session as Session>::Statistics) -> u64 {
        0
    }

    /// Returns a check of one session, called with every act in sequence: for example that each request has one outcome. The
    /// check panics if it fails.
    fn watch(&self) -> impl FnMut(Observed<'_, <Self::Session as Session>::Event>) {
        |_| ()
    }
}
