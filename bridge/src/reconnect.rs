//! The delays between attempts to connect to the broker. If another client uses the bridge's client name, the delay is longer.

use std::time::{Duration, Instant};

/// The wait before the first attempt to connect again; each further attempt waits twice as long as the previous one, up to the
/// longest. Together with the time of an attempt, a wait is less than 30 s.
const FIRST_WAIT: Duration = Duration::from_millis(500);
const MAX_DELAY: Duration = Duration::from_secs(10);
/// The first time for which a bridge leaves its name to another client that has it; each further time is twice as long, up to the
/// longest.
const FIRST_YIELD: Duration = Duration::from_secs(60);
const MAX_NAME_DELAY: Duration = Duration::from_secs(3600);

/// The waits.
#[derive(Debug)]
pub struct Reconnect {
    wait: Duration,
    yield_for: Duration,
    /// The time at which the broker accepted the connection.
    since: Option<Instant>,
    /// Whether another client has this name.
    name_taken: bool,
}

impl Default for Reconnect {
    fn default() -> Self {
        Self { wait: FIRST_WAIT, yield_for: FIRST_YIELD, since: None, name_taken: false }
    }
}

impl Reconnect {
    /// Called when the broker has accepted a connection.
    pub fn accepted(&mut self, now: Instant) {
        self.since = Some(now);
    }

    /// Called when the broker reports that another client has this name. Returns for about how long the name is left to that
    /// client.
    pub fn leave_name(&mut self, now: Instant) -> Duration {
        // The other one may keep the name for one and a half times its own wait, which is about as long as this one's.
        if self.since.is_some_and(|since| now.saturating_duration_since(since) >= self.yield_for * 4) {
            self.yield_for = FIRST_YIELD;
        }
        self.name_taken = true;
        self.yield_for
    }

    /// Called when the connection or the attempt is over. Returns the wait before the next attempt.
    pub fn next(&mut self, now: Instant) -> Duration {
        if let Some(since) = self.since.take()
            && now.saturating_duration_since(since) > MAX_DELAY
        {
            self.wait = FIRST_WAIT;
        }
        // The bridges of a site do not connect all at once.
        let (next, longest, jitter) = if core::mem::take(&mut self.name_taken) {
            (&mut self.yield_for, MAX_NAME_DELAY, 0.5 + fastrand::f64())
        } else {
            (&mut self.wait, MAX_DELAY, 0.5 + fastrand::f64() / 2.0)
        };
        let wait = next.mul_f64(jitter);
        *next = (*next * 2).min(longest);
        wait
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    #[test]
    fn a_name_that_is_taken_again_and_again_is_left_for_longer() {
        let (mut waits, mut now) = (Reconnect::default(), Instant::now());
        let mut taken_after = |lasts: Duration| {
            waits.accepted(now);
            now += lasts;
            (waits.leave_name(now), waits.next(now))
        };
        let (about, wait) = taken_after(SECOND);
        assert!(about == FIRST_YIELD && (30 * SECOND..=90 * SECOND).contains(&wait), "{wait:?}");
        for doubled in 1..=5 {
            assert_eq!(taken_after(90 * SECOND).0, FIRST_YIELD * (1 << doubled));
        }
        assert_eq!(taken_after(SECOND).0, MAX_NAME_DELAY);
        // The other one had gone.
        assert_eq!(taken_after(5 * MAX_NAME_DELAY).0, FIRST_YIELD);
    }

    #[test]
    fn whatever_else_ends_a_connection_is_tried_again_soon() {
        let (mut waits, mut now) = (Reconnect::default(), Instant::now());
        let mut waited = Vec::new();
        for _ in 0..20 {
            waits.accepted(now);
            now += SECOND;
            waited.push(waits.next(now));
        }
        assert!(waited[0] <= SECOND / 2 && waited.iter().all(|wait| *wait <= 10 * SECOND), "{waited:?}");
        assert!(waited.iter().skip(6).all(|wait| *wait >= MAX_DELAY / 2), "{waited:?}");
        waits.accepted(now);
        assert!(waits.next(now + 2 * MAX_DELAY) <= SECOND / 2);
    }
}
