//! The values of an input.

use std::time::Duration;

/// The values of an input at one time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sample {
    /// X, Y, Z, RX, RY, RZ in thousandths of the full deflection.
    pub axes: [i16; 6],
    /// The buttons that are down: bit *k* is button *k* + 1.
    pub buttons: u32,
    /// The time until which the values may be used, by the clock of the host.
    pub fresh_until: Duration,
}

/// Full deflection.
pub const FULL: i16 = 1000;

/// A key that moves an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Jog {
    /// The axis: X, Y, Z, RX, RY, RZ as 0 to 5.
    pub axis: u8,
    /// Whether the key moves the axis in the negative direction.
    pub is_negative: bool,
}
