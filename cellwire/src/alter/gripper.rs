//! The gripper on the keys of the control ball (§9.3).

use val2_alter::Exception;

/// Turns key presses into exception codes: one code for each press, none while a key is held.
///
/// Give each code to [`Host::exception`](val2_alter::Host::exception), which refuses it when the ALTER instruction names no
/// subroutine: VAL II would abort the program. The program of the source that works with this is
///
/// ```text
/// ALTER(0, 23, clamp2, 127)        clamp2:  test = ERROR(-1)
///                                           IF test == 253 GOTO 10     CLOSEI
///                                           IF test == 254 GOTO 20     OPENI
/// ```
///
/// (The source prints mode 22, non-cumulative, for it, and mode 23 without a subroutine elsewhere.)
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct GripperKeys {
    close: u32,
    open: u32,
    held: u32,
    enabled: bool,
}

impl GripperKeys {
    /// Creates the gripper's state. `close` and `open` are masks of keys: bit *k* is key *k* + 1. The source does not name
    /// its keys. A key that is pressed at the beginning must be released first.
    pub(super) const fn new(close: u32, open: u32) -> Self {
        Self { close, open, held: u32::MAX, enabled: true }
    }

    /// Takes the keys of a sample. Pressing both at once has no effect.
    pub(super) fn keys(&mut self, keys: u32) -> Option<Exception> {
        let pressed = keys & !self.held;
        self.held = keys;
        match (pressed & self.close != 0, pressed & self.open != 0) {
            (true, false) if self.enabled => Some(Exception::CloseGripper),
            (false, true) if self.enabled => Some(Exception::OpenGripper),
            _ => None,
        }
    }

    /// Sets the operator's switch (§10.6). Keys that are pressed while it is off have no effect.
    pub(super) fn set_enabled(&mut self, enabled: bool) {
        self.enabled = enabled;
    }
}

/// Key 1 closes, key 2 opens: our choice.
impl Default for GripperKeys {
    fn default() -> Self {
        Self::new(0b0000_0001, 0b0000_0010)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_gives_one_code_for_each_press() {
        let mut gripper = GripperKeys::default();
        // Held since before: it must be released first.
        let keys = [0b01, 0b01, 0b00, 0b01, 0b01, 0b00, 0b10, 0b11, 0b11, 0b00, 0b11, 0b100];
        let codes = keys.map(|keys| gripper.keys(keys).map_or(0, u8::from));
        assert_eq!(codes, [0, 0, 0, 253, 0, 0, 254, 253, 0, 0, 0, 0]);
        gripper.set_enabled(false);
        assert_eq!(gripper.keys(0b01), None);
        gripper.set_enabled(true);
        assert_eq!(gripper.keys(0b01), None, "pressed while it was off");
        assert_eq!((gripper.keys(0), gripper.keys(0b01)), (None, Some(Exception::CloseGripper)));
    }
}
