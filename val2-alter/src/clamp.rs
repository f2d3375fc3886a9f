//! The gripper on the keys of the control ball (§9.3).

use crate::message::Exception;

/// Turns key presses into exception codes: one code for each press, none while a key is held.
///
/// Give each code to [`Host::exception`](crate::Host::exception), which refuses it when the ALTER instruction names no
/// subroutine: VAL II would abort the program. The program of the source that works with this is
///
/// ```text
/// ALTER(0, 23, clamp2, 127)        clamp2:  test = ERROR(-1)
///                                           IF test == 253 GOTO 10     CLOSEI
///                                           IF test == 254 GOTO 20     OPENI
/// ```
///
/// (The source prints mode 22, non-cumulative, for it, and mode 23 without a subroutine elsewhere.)
///
/// ```
/// use val2_alter::{Clamp, Exception};
///
/// let mut clamp = Clamp::new(0b0000_0001, 0b0000_0010);
/// assert_eq!(clamp.keys(0b00), None);
/// assert_eq!(clamp.keys(0b01), Some(Exception::CloseGripper));
/// assert_eq!(clamp.keys(0b01), None);
/// assert_eq!(clamp.keys(0b11), Some(Exception::OpenGripper));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Clamp {
    close: u8,
    open: u8,
    held: u8,
    enabled: bool,
}

impl Clamp {
    /// `close` and `open` are masks of the key byte: bit *k* is key *k* + 1. The source does not say which keys it took. A
    /// key that is held from the beginning must be let go first.
    pub const fn new(close: u8, open: u8) -> Self {
        Self { close, open, held: u8::MAX, enabled: true }
    }

    /// Takes the key byte of a ball packet. Pressing both in the same packet says nothing.
    pub fn keys(&mut self, keys: u8) -> Option<Exception> {
        let pressed = keys & !self.held;
        self.held = keys;
        match (pressed & self.close != 0, pressed & self.open != 0) {
            (true, false) if self.enabled => Some(Exception::CloseGripper),
            (false, true) if self.enabled => Some(Exception::OpenGripper),
            _ => None,
        }
    }

    /// The operator's switch (§10.6). Keys that are pressed while it is off stay without effect.
    pub fn set_enabled(&mut self, enabled: bool) {
        self.enabled = enabled;
    }

    /// Whether key presses have an effect.
    pub fn is_enabled(&self) -> bool {
        self.enabled
    }
}

/// Key 1 closes, key 2 opens: our choice.
impl Default for Clamp {
    fn default() -> Self {
        Self::new(0b0000_0001, 0b0000_0010)
    }
}
