//! Removes the echo of lines that return the bytes sent on them.

use core::fmt;

/// A filter that removes the echo from the input of an end: the bytes that a line returns of its output, as many adapters for
/// two wires do.
///
/// With the setting, as many bytes as were sent come back first. They are compared with those sent, and dropped. Without it,
/// a message that no peer answers with the same bytes shows whether the line returns it: if so, that is reported, and from
/// then on the echo is dropped as with the setting, until the connection ends.
#[derive(Debug, Clone)]
pub struct Echo<const N: usize> {
    /// Whether the line is configured as one with an echo.
    is_set: bool,
    /// Whether the line has an echo, as configured or found.
    returns: bool,
    /// The last message.
    sent: [u8; N],
    len: usize,
    /// The number of bytes that have come since the message was sent, while they may be its echo.
    come: usize,
    /// For a line without a known echo: a bit for each of the first three bytes that came, set while the echo may have begun
    /// with it. Before the echo an adapter may give a byte of noise.
    begun: u8,
    /// Whether a collision was reported for this message.
    has_collided: bool,
}

/// An error of a line that returns the bytes sent, or is configured to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(tag = "kind", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum EchoError {
    /// The line returns the bytes sent, and `echo` is not set. The echo is dropped from here on.
    NotSet {
        /// The number of bytes of the message that came back.
        length: usize,
    },
    /// `echo` is set, and other bytes than those sent have come back.
    Collision {
        /// The first byte that differs, counted from 0.
        offset: usize,
        /// The byte that was sent.
        expected: u8,
        /// The byte that came in its place.
        found: u8,
    },
}

/// The number of noise bytes that may come before an echo, plus one.
const BEGINNINGS: usize = 3;

impl<const N: usize> Echo<N> {
    /// Creates the state of a line: with an echo if `is_set`, otherwise with an echo that is not known yet.
    pub const fn new(is_set: bool) -> Self {
        Self { is_set, returns: is_set, sent: [0; N], len: 0, come: 0, begun: 0, has_collided: false }
    }

    /// Called when a connection begins or has ended: the next one may use another line.
    pub const fn reset(&mut self) {
        (self.returns, self.len, self.begun) = (self.is_set, 0, 0);
    }

    /// Called when a message of at most `N` bytes is sent. `is_proof`: no answer to it begins with the same bytes.
    pub fn sent(&mut self, message: &[u8], is_proof: bool) {
        (self.len, self.come, self.begun, self.has_collided) = (0, 0, 0, false);
        if !self.returns && !is_proof {
            return;
        }
        if let Some(room) = self.sent.get_mut(..message.len()) {
            room.copy_from_slice(message);
            self.len = message.len();
            self.begun = if self.returns { 0 } else { (1 << BEGINNINGS) - 1 };
        }
    }

    /// Called when an end whose frames cannot be answers has found the last message, of `length` bytes, as a frame in the input.
    /// The echo of the next messages is dropped. Returns the error unless the echo was known.
    #[cold]
    pub fn found(&mut self, length: usize) -> Option<EchoError> {
        self.len = 0;
        let is_known = core::mem::replace(&mut self.returns, true);
        (!is_known).then_some(EchoError::NotSet { length })
    }

    /// Returns the bytes that have come, without the echo, and the error of the line, at most one per message.
    #[inline]
    pub fn receive<'a>(&mut self, bytes: &'a [u8]) -> (&'a [u8], Option<EchoError>) {
        if self.len == 0 { (bytes, None) } else { self.compare(bytes) }
    }

    #[cold]
    fn compare<'a>(&mut self, bytes: &'a [u8]) -> (&'a [u8], Option<EchoError>) {
        if !self.returns {
            return self.look(bytes);
        }
        let expected = self.sent.get(self.come..self.len).unwrap_or_default();
        let differs = expected.iter().zip(bytes).position(|(expected, found)| expected != found);
        let wrong = differs.filter(|_| !self.has_collided).and_then(|at| {
            let (expected, found) = (*expected.get(at)?, *bytes.get(at)?);
            Some(EchoError::Collision { offset: self.come + at, expected, found })
        });
        self.has_collided |= wrong.is_some();
        let count = expected.len().min(bytes.len());
        self.come += count;
        if self.come == self.len {
            self.len = 0;
        }
        (bytes.get(count..).unwrap_or_default(), wrong)
    }

    /// Looks for the echo of the message at the beginning of the input.
    fn look<'a>(&mut self, bytes: &'a [u8]) -> (&'a [u8], Option<EchoError>) {
        for noise in 0..BEGINNINGS {
            if self.begun & (1 << noise) == 0 {
                continue;
            }
            let own = bytes.get(noise.saturating_sub(self.come)..).unwrap_or_default();
            let expected = self.sent.get(self.come.saturating_sub(noise)..self.len).unwrap_or_default();
            let count = own.len().min(expected.len());
            if own.get(..count) != expected.get(..count) {
                self.begun &= !(1 << noise);
            } else if count == expected.len() {
                let length = core::mem::take(&mut self.len);
                self.returns = true;
                return (own.get(count..).unwrap_or_default(), Some(EchoError::NotSet { length }));
            }
        }
        self.come += bytes.len();
        if self.begun == 0 {
            self.len = 0;
        }
        (bytes, None)
    }
}

impl fmt::Display for EchoError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotSet { length } => {
                write!(f, "the line returns what is sent ({length} bytes came back): set echo=true")
            }
            Self::Collision { offset, expected, found } => write!(
                f,
                "byte {offset} of what was sent, {expected:#04x}, came back as {found:#04x}: two have sent at once, or the line \
                 returns nothing and echo has to be false"
            ),
        }
    }
}

impl core::error::Error for EchoError {}
