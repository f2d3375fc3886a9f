//! The times of messages and replies (§3.4), for any baud rate and any length.
//!
//! The source prints two tables, and they are of different lines: its table of requests is right for 38400 baud, its table
//! of replies, which it took from the maker, for 19200. Nothing here is a constant of a table: times follow from the
//! number of bytes.

use core::time::Duration;

use crate::frame::Frame;
use crate::framing::Framing;
use crate::message::{AXES, Accumulation};

/// The controller sends a standard message, to be answered, every 28 ms (§3.4).
pub const CYCLE: Duration = Duration::from_nanos(CYCLE_NANOS);
pub(crate) const CYCLE_NANOS: u64 = 28_000_000;

/// The baud rate of the source's line (§3.2), 8N1. Its reply table is for 19200.
pub const BAUD: u32 = 38_400;

/// Returns the time from the end of the request to the end of the reply: 15 ms cumulative, 17 ms non-cumulative (§3.4).
pub const fn window(accumulation: Accumulation) -> Duration {
    Duration::from_nanos(window_nanos(accumulation))
}

/// Returns [`Budget::window`] in nanoseconds.
pub(crate) const fn window_after_nanos(accumulation: Accumulation, baud: u32, request_len: usize) -> u64 {
    let left = CYCLE_NANOS.saturating_sub(transmission_nanos(request_len, baud));
    let window = window_nanos(accumulation);
    if left < window { left } else { window }
}

pub(crate) const fn window_nanos(accumulation: Accumulation) -> u64 {
    match accumulation {
        Accumulation::Cumulative => 15_000_000,
        Accumulation::NonCumulative => 17_000_000,
    }
}

/// Returns the time for which `bytes` occupy the line: ten bits each (8N1). A baud rate of 0 counts as 1.
pub const fn transmission_time(bytes: usize, baud: u32) -> Duration {
    Duration::from_nanos(transmission_nanos(bytes, baud))
}

/// Returns the transmission time in nanoseconds: one number, where a `Duration` has two and carries between them.
pub(crate) const fn transmission_nanos(bytes: usize, baud: u32) -> u64 {
    let baud = if baud == 0 { 1 } else { baud };
    (bytes as u64).saturating_mul(10_000_000_000) / baud as u64
}

/// Returns the time this many nanoseconds after `now`: within the same second, as for most deadlines, without a carry or a
/// division.
pub(crate) fn after(now: Duration, nanos: u64) -> Duration {
    match u32::try_from(u64::from(now.subsec_nanos()).saturating_add(nanos)) {
        Ok(nanos) if nanos < 1_000_000_000 => Duration::new(now.as_secs(), nanos),
        _ => now.saturating_add(Duration::from_nanos(nanos)),
    }
}

/// The time in one cycle, divided by its users.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// The request on the line.
    pub request: Duration,
    /// From the request's end to the reply's end: the window, or the rest of the cycle after the request if that is less.
    /// (At 38400 baud a request with transformation takes 13.5 ms, and leaves 14.5 ms of the 15 ms.)
    pub window: Duration,
    /// The reply on the line.
    pub reply: Duration,
}

impl Budget {
    /// Creates the budget of a cycle with a request and a reply of these lengths on the line.
    pub const fn new(accumulation: Accumulation, baud: u32, request_len: usize, reply_len: usize) -> Self {
        Self {
            request: transmission_time(request_len, baud),
            window: Duration::from_nanos(window_after_nanos(accumulation, baud, request_len)),
            reply: transmission_time(reply_len, baud),
        }
    }

    /// Creates the budget if every byte that can be a DLE is a DLE: the worst case for a host.
    pub const fn worst_case(
        accumulation: Accumulation,
        baud: u32,
        transform: bool,
        values: usize,
        framing: Framing,
    ) -> Self {
        let reply = max_reply_len(values, framing);
        Self::new(accumulation, baud, max_request_len(transform, framing), reply)
    }

    /// Returns the time that the host may compute before it begins to send; `None` if the reply does not fit.
    pub const fn slack(&self) -> Option<Duration> {
        self.window.checked_sub(self.reply)
    }
}

/// Returns the time that the host may compute before it begins a reply of `reply_len` bytes; `None` if the reply does not
/// fit. The source's table lists these times.
pub const fn reply_slack(accumulation: Accumulation, baud: u32, reply_len: usize) -> Option<Duration> {
    window(accumulation).checked_sub(transmission_time(reply_len, baud))
}

/// Returns the length of the shortest standard message, without a doubled DLE: 12 bytes, with transformation 36 (two leading
/// DLEs).
pub const fn min_request_len(transform: bool, framing: Framing) -> usize {
    framing.leading_dle.count() + 4 + if transform { 30 } else { 6 }
}

/// Returns the length of the shortest reply with this number of values, without a doubled DLE: 8 bytes and two per value
/// (two leading DLEs).
pub const fn min_reply_len(values: usize, framing: Framing) -> usize {
    framing.leading_dle.count() + 6 + 2 * values
}

/// Returns the length of the longest standard message: 16 bytes, with transformation 64 (two leading DLEs, checksum not
/// doubled). Control byte and segment status are never DLE; all other bytes can be. The source counts 14 and 52.
pub const fn max_request_len(transform: bool, framing: Framing) -> usize {
    let words = if transform { 2 + 12 } else { 2 };
    envelope(framing) + 2 + 4 * words
}

/// Returns the length of the longest reply with this number of values: 33 bytes for six (two leading DLEs, checksum not
/// doubled). The exception code can be a DLE; so can the select byte, if it selects RY alone. The source counts 26 and 32.
pub const fn max_reply_len(values: usize, framing: Framing) -> usize {
    let values = if values > AXES { AXES } else { values };
    let select = if values == 1 { 2 } else { 1 };
    envelope(framing) + 2 + select + 4 * values
}

/// Returns the length of a reply with this number of values as in the source's table (§3.4.2): 8 bytes, and for each value 3
/// (cumulative: its high byte is assumed never to be a DLE) or 4.
pub const fn printed_reply_len(accumulation: Accumulation, values: usize) -> usize {
    match accumulation {
        Accumulation::Cumulative => 8 + 3 * values,
        Accumulation::NonCumulative => 8 + 4 * values,
    }
}

/// Returns the length of a standard message as in the source's table (§3.4.1).
pub const fn printed_request_len(transform: bool) -> usize {
    if transform { 52 } else { 14 }
}

const fn envelope(framing: Framing) -> usize {
    let checksum = if framing.stuffed_checksum { 2 } else { 1 };
    framing.leading_dle.count() + 1 + 2 + checksum
}

const _: () = assert!(max_request_len(true, Framing::DEFAULT) <= Frame::MAX_LEN);
