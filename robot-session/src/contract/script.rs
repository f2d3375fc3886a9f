//! Strings of calls as values, drawn by a fuzzer or from a seed.

use core::iter;
use core::time::Duration;
use std::vec::Vec;

use arbitrary::{Arbitrary, Result, Unstructured};

/// A string of calls of a session. `I` is the [`Input`](super::Subject::Input) of its subject, `C` the
/// [`Call`](super::Subject::Call).
#[derive(Debug, Clone, Arbitrary)]
pub struct Script<I, C> {
    /// The configuration, counted on from 0 again after the last.
    pub(super) configuration: u16,
    /// Whether each timeout of the configuration is the longest that is allowed.
    pub(super) is_endless: bool,
    /// Whether bytes arrive without a connection, too. Each such call may be reported, so input in pieces is not compared.
    pub(super) is_careless: bool,
    /// Whether [`Step::End`] is done.
    pub(super) ends: bool,
    /// The caller that is compared with the plain one.
    pub(super) caller: Caller,
    /// The calls.
    #[arbitrary(with = all)]
    pub(super) steps: Vec<Step<I, C>>,
}

/// A caller that must make no difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Arbitrary)]
pub(super) enum Caller {
    /// Asks for the timeout, and handles it, more often than it must.
    Often,
    /// First with a buffer that is too small.
    SmallBuffer,
    /// Input byte by byte.
    Pieces,
    /// The loop over `embedded-io`.
    Polls,
    /// The loop over `embedded-io-async`.
    Awaits,
}

impl Caller {
    pub(super) const ALL: [Self; 5] =
        [Self::Often, Self::SmallBuffer, Self::Pieces, Self::Polls, Self::Awaits];
}

/// One call, or a change of the time.
#[derive(Debug, Clone)]
pub(super) enum Step<I, C> {
    /// A call of the user.
    Call(C),
    /// Input of the peer.
    Input(I),
    /// Input of the peer with one wrong bit; bits are counted on from the first again after the last.
    Corrupt(I, u16),
    /// Any bytes.
    Noise(Vec<u8>),
    /// A connection is made.
    Connected,
    /// The connection is lost.
    Disconnected,
    /// The last transmission has left the port.
    Transmitted,
    /// The time becomes that of the next deadline.
    Deadline,
    /// The time advances.
    Later(Duration),
    /// The time becomes the latest that there is.
    End,
}

/// Not derived: if all steps were equally likely, few sessions would live until their second message.
impl<'a, I: Arbitrary<'a>, C: Arbitrary<'a>> Arbitrary<'a> for Step<I, C> {
    fn arbitrary(u: &mut Unstructured<'a>) -> Result<Self> {
        Ok(match u.int_in_range(0..=63)? {
            0..20 => Self::Call(u.arbitrary()?),
            20..36 => Self::Input(u.arbitrary()?),
            36..40 => Self::Corrupt(u.arbitrary()?, u.arbitrary()?),
            40..44 => {
                let length = u.int_in_range(0..=79)?.min(u.len());
                Self::Noise(u.bytes(length)?.into())
            }
            44..50 => Self::Deadline,
            50..54 => {
                // Below a power of two from 16 µs to 137 s, each of them equally likely.
                let bits = u.int_in_range(14..=37)?;
                Self::Later(Duration::from_nanos(u.arbitrary::<u64>()? >> (64 - bits)))
            }
            54..58 => Self::Connected,
            58..62 => Self::Transmitted,
            62 => Self::Disconnected,
            _ => Self::End,
        })
    }
}

/// Reads values until the bytes are spent.
pub(super) fn all<'a, T: Arbitrary<'a>>(u: &mut Unstructured<'a>) -> Result<Vec<T>> {
    Ok(iter::from_fn(|| if u.is_empty() { None } else { u.arbitrary().ok() }).collect())
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::super::Rng;
    use super::*;

    #[test]
    fn every_step_is_drawn_and_short_and_long_times() {
        let bytes = Rng::new(1).bytes(4000);
        let steps: Vec<Step<u8, u8>> = all(&mut Unstructured::new(&bytes)).unwrap();
        let kinds: HashSet<_> = steps.iter().map(core::mem::discriminant).collect();
        assert_eq!(kinds.len(), 10);
        let later = |step: &_| if let Step::Later(time) = step { Some(*time) } else { None };
        let [mut shortest, mut longest] = [Duration::MAX, Duration::ZERO];
        for time in steps.iter().filter_map(later) {
            (shortest, longest) = (shortest.min(time), longest.max(time));
        }
        assert!(shortest < Duration::from_millis(1), "{shortest:?}");
        assert!((10..138).contains(&longest.as_secs()), "{longest:?}");
    }
}
