//! What a hand asks for, whatever it is on.

/// The values of an input at one time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample {
    /// X, Y, Z, RX, RY, RZ in thousandths of the full deflection.
    pub axes: [i16; 6],
    /// The buttons that are down: bit *k* is button *k* + 1.
    pub buttons: u32,
    /// How long the values may be used, by the clock of the host.
    pub fresh_until: std::time::Duration,
}

/// Full deflection.
pub const FULL: i16 = 1000;
