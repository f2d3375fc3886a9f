//! The times of the serial line: ten bits a byte (8N1), 9600 baud on the source's ball (§4.1).

use core::time::Duration;

use crate::message::Packet;

/// The baud rate of the source's DIP setting (§4.1).
pub const BAUD: u32 = 9600;

/// Returns the time that `bytes` take on the line. Without limit at a rate of 0.
pub const fn transmission_time(bytes: usize, baud: u32) -> Duration {
    match (bytes as u64).saturating_mul(10_000_000_000).checked_div(baud as u64) {
        Some(nanos) => Duration::from_nanos(nanos),
        None => Duration::MAX,
    }
}

/// Returns the time of ENQ and its packet: 13.54 ms at 9600.
pub const fn exchange_time(baud: u32) -> Duration {
    transmission_time(1 + Packet::LEN, baud)
}

/// Returns the shortest poll period in whole milliseconds: 14 ms at 9600.
pub const fn min_period(baud: u32) -> Duration {
    let exchange = exchange_time(baud);
    let millis = exchange.as_secs().saturating_mul(1000).saturating_add(exchange.subsec_millis() as u64);
    let whole = Duration::from_millis(millis);
    if exchange.as_nanos() > whole.as_nanos() {
        Duration::from_millis(millis.saturating_add(1))
    } else {
        whole
    }
}
