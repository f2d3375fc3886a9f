//! The times of the serial line and of the controller's cycle. The source gives the cycle; the baud rate is open.

use core::time::Duration;

/// The controller's cycle: every task runs once in it, and answers leave at its end (§4.1).
pub const TICK: Duration = Duration::from_millis(16);

/// The default baud rate. The source names none; 9600 is the project's choice.
pub const BAUD: u32 = 9600;

/// An answer without values, in bytes: 11, and two more if its word has a 90h twice.
pub(crate) const SHORT_ANSWER: usize = 13;

/// Returns the time that `bytes` take on the line, ten bits each (8N1). Without limit at a rate of 0.
pub const fn transmission_time(bytes: usize, baud: u32) -> Duration {
    match (bytes as u64).saturating_mul(10_000_000_000).checked_div(baud as u64) {
        Some(nanos) => Duration::from_nanos(nanos),
        None => Duration::MAX,
    }
}

/// Returns the time from the first byte of a frame to the last byte of its answer if the controller finds the whole frame
/// just after its cycle began: the longest time for an instruction that is queued.
pub const fn exchange_time(frame: usize, answer: usize, baud: u32, tick: Duration) -> Duration {
    transmission_time(frame + answer, baud).saturating_add(tick)
}

/// Returns the time from one answer to the next if the host sends the next frame at once: frame and answer on the line, then
/// the rest of the cycle. The gain of batches follows from it.
pub const fn period(frame: usize, answer: usize, baud: u32, tick: Duration) -> Duration {
    end_of_tick(transmission_time(frame + answer, baud), tick)
}

/// Returns the end of the cycle that contains `now`; `now` itself if a cycle ends just then or has no length, or if `now` is
/// centuries ahead. A cycle of centuries never ends.
pub const fn end_of_tick(now: Duration, tick: Duration) -> Duration {
    // A division of 128 bits is a kilobyte of a small processor's code.
    let Some(at) = nanos(now) else { return now };
    let Some(length) = nanos(tick) else { return if at == 0 { now } else { Duration::MAX } };
    match at.checked_rem(length) {
        None | Some(0) => now,
        Some(over) => now.saturating_add(Duration::from_nanos(length - over)),
    }
}

/// Nanoseconds, up to 584 years of them.
const fn nanos(time: Duration) -> Option<u64> {
    match time.as_secs().checked_mul(1_000_000_000) {
        Some(nanos) => nanos.checked_add(time.subsec_nanos() as u64),
        None => None,
    }
}
