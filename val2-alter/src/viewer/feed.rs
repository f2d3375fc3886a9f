//! The host's end of the link to the workstation.

use core::time::Duration;

use crate::Transform;
use crate::viewer::{ENQ, PosePacket};

/// The host's end: answers each request with the newest pose, and never more than one packet for requests that piled up.
///
/// Order: [`handle_input`](PoseFeed::handle_input) with what was read, [`poll_transmit`](PoseFeed::poll_transmit) and write
/// what it gives, then wait until [`poll_timeout`](PoseFeed::poll_timeout). [`set_pose`](PoseFeed::set_pose) at any time.
/// Bytes that are no ENQ are ignored and counted.
#[derive(Debug, Clone)]
pub struct PoseFeed {
    interval: Duration,
    not_before: Duration,
    credit: bool,
    pose: Option<Transform>,
    count: u16,
    ignored: u64,
}

impl PoseFeed {
    /// The workstation draws five pictures a second: it is never slowed down by this, and a pile of old requests that comes
    /// out of a serial driver at line speed is answered once.
    pub const INTERVAL: Duration = Duration::from_millis(150);

    /// A feed that answers at most once in `interval`; [`PoseFeed::INTERVAL`] suits a workstation.
    pub const fn new(interval: Duration) -> Self {
        Self { interval, not_before: Duration::ZERO, credit: false, pose: None, count: 0, ignored: 0 }
    }

    /// Takes bytes from the workstation. Any number of requests is one.
    pub fn handle_input(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if *byte == ENQ {
                self.credit = true;
            } else {
                self.ignored += 1;
            }
        }
    }

    /// Sets the pose that the next request is answered with.
    pub fn set_pose(&mut self, pose: Transform) {
        self.pose = Some(pose);
    }

    /// ALTER begins anew: the pose of before is not sent any more, and the requests that piled up meanwhile, those that still
    /// come out of the serial driver included, are answered once.
    pub fn restart(&mut self, now: Duration) {
        self.pose = None;
        self.not_before = now + self.interval;
    }

    /// Writes the packet that is due into `out`, which has room for [`PosePacket::MAX_LEN`] bytes, and returns its length.
    pub fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.poll_transmit_as(now, out, |packet, out| packet.encode(out).ok())
    }

    /// As [`PoseFeed::poll_transmit`], in another format: `encode` writes the packet and returns its length, or `None`, and
    /// then the request stays unanswered. For a workstation on XON/XOFF it must not write the bytes 11h and 13h.
    pub fn poll_transmit_as(
        &mut self,
        now: Duration,
        out: &mut [u8],
        encode: impl FnOnce(&PosePacket, &mut [u8]) -> Option<usize>,
    ) -> Option<usize> {
        if !self.credit || now < self.not_before {
            return None;
        }
        let len = encode(&PosePacket { count: self.count, pose: self.pose? }, out)?;
        self.credit = false;
        self.count = self.count.wrapping_add(1);
        self.not_before = now + self.interval;
        Some(len)
    }

    /// When a request that waits may be answered.
    pub fn poll_timeout(&self) -> Option<Duration> {
        (self.credit && self.pose.is_some()).then_some(self.not_before)
    }

    /// Bytes that were no request.
    pub fn ignored(&self) -> u64 {
        self.ignored
    }
}

impl Default for PoseFeed {
    fn default() -> Self {
        Self::new(Self::INTERVAL)
    }
}
