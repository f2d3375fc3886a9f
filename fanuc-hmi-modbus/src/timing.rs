//! The times of frames on a serial line, and the silence between them (MODBUS over Serial Line V1.02, section 2.5.1).

use core::time::Duration;

/// The bits of a character: start, 8 data bits, parity or a second stop bit, stop.
pub const CHARACTER_BITS: u32 = 11;

/// Returns the silence that separates frames: 3.5 characters, and 1.75 ms above 19200 baud.
///
/// ```
/// use core::time::Duration;
/// use fanuc_hmi_modbus::timing::silence;
///
/// assert_eq!(silence(9600), Duration::from_micros(4010));
/// assert_eq!(silence(115_200), Duration::from_micros(1750));
/// ```
pub const fn silence(baud: u32) -> Duration {
    if baud > 19_200 || baud == 0 {
        Duration::from_micros(1750)
    } else {
        Duration::from_micros((CHARACTER_BITS as u64 * 3_500_000) / baud as u64)
    }
}

/// Returns the time of `bytes` on the line.
pub const fn transmission_time(bytes: usize, baud: u32) -> Duration {
    let baud = if baud == 0 { 1 } else { baud as u64 };
    Duration::from_nanos((bytes as u64).saturating_mul(CHARACTER_BITS as u64 * 1_000_000_000) / baud)
}

/// Returns the time to read `registers` in one request on a serial line: the request, the reply, and the silence after each.
///
/// ```
/// use fanuc_hmi_modbus::timing::read_time;
///
/// // The telemetry block every 8 ms needs a fast line, or TCP.
/// assert!(read_time(37, 115_200).as_millis() >= 8);
/// assert!(read_time(37, 230_400).as_millis() < 8);
/// ```
pub const fn read_time(registers: u16, baud: u32) -> Duration {
    let reply = transmission_time(5 + 2 * registers as usize, baud);
    transmission_time(8, baud)
        .saturating_add(reply)
        .saturating_add(silence(baud))
        .saturating_add(silence(baud))
}
