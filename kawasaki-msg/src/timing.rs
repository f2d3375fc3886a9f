//! The times that the source measured or states, as constants for planning and simulation.

use core::time::Duration;

/// The cycle of the controller's processor; background programs get the time that motion leaves (thesis, section 5.3).
pub const CPU_CYCLE: Duration = Duration::from_millis(2);

/// The shortest delay of the PC's answer: the robot may not be receiving yet (thesis, section 7.1; needed over UDP).
pub const MIN_REPLY_DELAY: Duration = CPU_CYCLE;

/// One packet sent and its answer received, whatever the length of the packets: 31 a second (thesis, section 9.4).
pub const EXCHANGE: Duration = Duration::from_millis(32);

/// The longest delay of a datagram for which both ends over UDP are designed. This project's value: the source gives no
/// value.
pub const LATEST_DATAGRAM: Duration = Duration::from_secs(1);

/// The mean time to unpack a packet and to queue its jobs (thesis, appendix 2: 13 rounds).
pub const UNPACK_MEAN: Duration = Duration::from_micros(27_078);

/// The longest observed time for the same. The text has "under 50 ms"; 3 of the 13 rounds are above it.
pub const UNPACK_MAX: Duration = Duration::from_micros(59_861);

/// From the start of one job to the start of the next, without motion: mean (thesis, appendix 2; "under 110 ms").
pub const WORK_CYCLE: Duration = Duration::from_micros(108_207);

/// Returns the number of packets that carry `jobs` messages of `message_len` bytes each within `packet_limit`.
pub const fn packets(jobs: usize, message_len: usize, packet_limit: usize) -> usize {
    match packet_limit.checked_div(message_len) {
        None | Some(0) => 0,
        Some(each) => jobs.div_ceil(each),
    }
}

/// Returns the time to send `jobs` messages of `message_len` bytes when each exchange carries a full packet: batching pays in
/// proportion (thesis, section 9.4).
pub fn transfer_time(jobs: usize, message_len: usize, packet_limit: usize) -> Duration {
    EXCHANGE.saturating_mul(u32::try_from(packets(jobs, message_len, packet_limit)).unwrap_or(u32::MAX))
}
