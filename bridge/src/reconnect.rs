//! When the broker is tried again. A name that another client has is left to it.

use std::time::{Duration, Instant};

/// The wait before the first attempt to connect again; each one after it waits twice as long, up to the longest.
const FIRST_WAIT: Duration = Duration::from_millis(500);
const LONGEST_WAIT: Duration = Duration::from_secs(10);
/// So long a bridge leaves its name to another client that has it, at first; each time after it twice as long, up to the longest.
const FIRST_YIELD: Duration = Duration::from_secs(60);
const LONGEST_YIELD: Duration = Duration::from_secs(3600);
/// So many connections that the broker ends one after the other, each soon, are another client's doing: not every broker says so
/// in words that are understood.
const SEVERAL: u32 = 3;
const SOON: Duration = Duration::from_secs(120);

/// The waits.
#[derive(Debug)]
pub struct Reconnect {
    wait: Duration,
    yield_for: Duration,
    /// Connections that the broker has ended one after the other, each soon.
    ended_soon: u32,
    /// When the broker accepted the connection.
    since: Option<Instant>,
    /// Another client has this name.
    is_doubled: bool,
}

impl Default for Reconnect {
    fn default() -> Self {
        Self { wait: FIRST_WAIT, yield_for: FIRST_YIELD, ended_soon: 0, since: None, is_doubled: false }
    }
}

impl Reconnect {
    /// The broker has accepted a connection.
    pub fn accepted(&mut self, now: Instant) {
        self.since = Some(now);
    }

    /// The broker, or the network, has ended the connection without a word. Whether the name is to be left.
    pub fn dropped(&mut self, now: Instant) -> bool {
        let Some(since) = self.since else { return false };
        // The other one may keep the name for one and a half times its own wait, which is about as long as this one's.
        if now.saturating_duration_since(since) < SOON.max(self.yield_for * 4) {
            self.ended_soon += 1;
        } else {
            (self.ended_soon, self.yield_for) = (0, FIRST_YIELD);
        }
        self.ended_soon >= SEVERAL
    }

    /// Another client has this name. For about how long it is left to it.
    pub fn leave_name(&mut self) -> Duration {
        self.is_doubled = true;
        self.yield_for
    }

    /// The connection is over, or the attempt: until the next one.
    pub fn next(&mut self, now: Instant) -> Duration {
        match self.since.take() {
            Some(since) if now.saturating_duration_since(since) > LONGEST_WAIT => self.wait = FIRST_WAIT,
            Some(_) => {}
            None => self.ended_soon = 0, // the broker was not there
        }
        let (next, longest) = if core::mem::take(&mut self.is_doubled) {
            (&mut self.yield_for, LONGEST_YIELD)
        } else {
            (&mut self.wait, LONGEST_WAIT)
        };
        // Not all bridges of a hall at once.
        let wait = next.mul_f64(0.5 + fastrand::f64());
        *next = (*next * 2).min(longest);
        wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn the_third_connection_in_a_row_that_ends_soon_leaves_the_name() {
        let (mut waits, mut now) = (Reconnect::default(), Instant::now());
        let mut end_after = |waits: &mut Reconnect, lasts: Duration| {
            waits.accepted(now);
            now += lasts;
            let leaves = waits.dropped(now);
            if leaves {
                waits.leave_name();
            }
            (leaves, waits.next(now))
        };
        assert!(!end_after(&mut waits, SECOND).0);
        assert!(!end_after(&mut waits, SECOND).0);
        let (leaves, wait) = end_after(&mut waits, SECOND);
        assert!(leaves && (30 * SECOND..=90 * SECOND).contains(&wait), "{wait:?}");
        // The other one has not gone: twice as long, and so on up to an hour.
        let (leaves, wait) = end_after(&mut waits, 90 * SECOND);
        assert!(leaves && (60 * SECOND..=180 * SECOND).contains(&wait), "{wait:?}");
        for _ in 0..9 {
            end_after(&mut waits, SECOND);
        }
        assert_eq!(waits.leave_name(), LONGEST_YIELD);
        waits.next(Instant::now());
        // It has.
        let (leaves, wait) = end_after(&mut waits, 5 * LONGEST_YIELD);
        assert!(!leaves && wait <= SECOND, "{wait:?}");
    }

    #[test]
    fn a_broker_that_is_started_again_has_no_other_client() {
        let (mut waits, now) = (Reconnect::default(), Instant::now());
        for _ in 0..9 {
            waits.accepted(now);
            assert!(!waits.dropped(now + SECOND));
            waits.next(now + SECOND);
            // An attempt that the system refuses.
            waits.next(now + SECOND);
        }
        assert!(waits.next(now) <= 15 * SECOND);
    }
}
