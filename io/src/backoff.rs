//! The pauses of a client before it connects again.

use std::thread;
use std::time::{Duration, Instant};

/// As `robot_session::tokio::Reconnect` has them.
const FIRST_DELAY: Duration = Duration::from_millis(100);
const MAX_DELAY: Duration = Duration::from_secs(5);
/// The longest time between two checks for the end of a pause.
const CHECK_INTERVAL: Duration = Duration::from_millis(20);

/// Pauses that double from one attempt to the next, half of each random, until the peer answers. A connection alone is not an
/// answer, since a device may accept and close at once.
#[derive(Debug)]
pub struct Backoff {
    next: Duration,
}

impl Default for Backoff {
    fn default() -> Self {
        Self { next: FIRST_DELAY }
    }
}

impl Backoff {
    /// Returns the pause before the next attempt.
    pub fn pause(&mut self) -> Duration {
        let pause = self.next.mul_f64(0.5 + fastrand::f64() / 2.0);
        self.next = self.next.saturating_mul(2).min(MAX_DELAY);
        pause
    }

    /// Pauses before the next attempt while `goes_on`; returns whether it still does.
    pub fn wait(&mut self, goes_on: impl Fn() -> bool) -> bool {
        let end = Instant::now() + self.pause();
        while goes_on() && Instant::now() < end {
            thread::sleep(end.saturating_duration_since(Instant::now()).min(CHECK_INTERVAL));
        }
        goes_on()
    }

    /// Called when the peer has answered: the next pause is the first again.
    pub fn answered(&mut self) {
        self.next = FIRST_DELAY;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pauses_double_until_the_peer_answers() {
        let mut backoff = Backoff::default();
        let within = |pause: Duration, longest: u64| {
            let longest = Duration::from_millis(longest);
            assert!(longest / 2 <= pause && pause <= longest, "{pause:?} {longest:?}");
        };
        for longest in [100, 200, 400, 800, 1600, 3200, 5000, 5000] {
            within(backoff.pause(), longest);
        }
        backoff.answered();
        within(backoff.pause(), 100);
    }
}
