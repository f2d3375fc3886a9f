//! What the serial line and the controller's cycle allow. The source gives the cycle; the baud rate is open.

use core::time::Duration;

/// The controller's cycle: every task runs once in it, and answers leave at its end (§4.1).
pub const TICK: Duration = Duration::from_millis(16);

/// The baud rate that is assumed where none is given: the source names none, 9600 is ours.
pub const BAUD: u32 = 9600;

/// An answer without values, in bytes: 11, and two more where its word has a 90h twice.
pub(crate) const SHORT_ANSWER: usize = 13;

/// The time that `bytes` take on the line, ten bits each (8N1). A rate of 0 never ends.
pub const fn transmission_time(bytes: usize, baud: u32) -> Duration {
    match (bytes as u64).saturating_mul(10_000_000_000).checked_div(baud as u64) {
        Some(nanos) => Duration::from_nanos(nanos),
        None => Duration::MAX,
    }
}

/// From the first byte of a frame to the last of its answer, when the controller finds the whole frame just after its
/// cycle began: the longest that an instruction which is queued can take.
pub const fn exchange_time(frame: usize, answer: usize, baud: u32, tick: Duration) -> Duration {
    transmission_time(frame + answer, baud).saturating_add(tick)
}

/// From one answer to the next when the host sends the next frame at once: frame and answer on the line, then the end of
/// the cycle. What batches gain follows from it.
pub const fn period(frame: usize, answer: usize, baud: u32, tick: Duration) -> Duration {
    end_of_tick(transmission_time(frame + answer, baud), tick)
}

/// The end of the cycle that `now` falls into; `now` itself when a cycle ends just then, or has no length.
pub const fn end_of_tick(now: Duration, tick: Duration) -> Duration {
    let Some(over) = now.as_nanos().checked_rem(tick.as_nanos()) else { return now };
    if over == 0 {
        return now;
    }
    #[expect(
        clippy::cast_possible_truncation,
        reason = "over is below a cycle, which is a Duration of few seconds"
    )]
    let over = Duration::from_nanos(over as u64);
    now.saturating_add(tick.saturating_sub(over))
}
