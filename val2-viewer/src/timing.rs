//! The times of the serial line and the display: ten bits a byte (8N1), 19200 baud (§5).

use core::time::Duration;

use crate::message::PosePacket;

/// The baud rate of the source's line (§5).
pub const BAUD: u32 = 19_200;

/// The approximate time for which the workstation draws one picture (§5).
pub const CYCLE: Duration = Duration::from_millis(200);

/// Returns the time that `bytes` take on the line. Without limit at a rate of 0.
pub const fn transmission_time(bytes: usize, baud: u32) -> Duration {
    match (bytes as u64).saturating_mul(10_000_000_000).checked_div(baud as u64) {
        Some(nanos) => Duration::from_nanos(nanos),
        None => Duration::MAX,
    }
}

/// Returns the time of ENQ and the longest packet: 52.6 ms at 19200.
pub const fn exchange_time(baud: u32) -> Duration {
    transmission_time(1 + PosePacket::MAX_LEN, baud)
}
