//! An input that a machine's state does not allow.

/// An input that the machine's state does not allow. Nothing has changed.
///
/// A session counts it in its statistics. Neither a caller that follows the contract nor any peer can cause it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Unexpected {
    /// The name of the state, as in the machine's table of states.
    pub state: &'static str,
    /// The name of the input, as in the machine's table of states.
    pub input: &'static str,
}

impl core::fmt::Display for Unexpected {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} is not expected in the state {}", self.input, self.state)
    }
}

impl core::error::Error for Unexpected {}
