//! Which reasons of a connection that is lost are logged: each once, and not each attempt.

use std::collections::HashSet;
use std::time::{Duration, Instant};

/// A connection that has lasted this long was one: what ends it is news again. After this long without one, what the log says last is not
/// that there is one.
const LASTING: Duration = Duration::from_secs(60);

/// What was logged.
#[derive(Debug, Default)]
pub struct Outages {
    /// Why there is no connection, each time that it was logged.
    logged: HashSet<String>,
    /// Since when there is a connection, or none.
    since: Option<(bool, Instant)>,
    /// The log says last that there is one.
    says_connected: bool,
}

impl Outages {
    /// There is a connection. Whether that is to be logged.
    pub fn over(&mut self, now: Instant) -> bool {
        self.since = Some((true, now));
        !core::mem::replace(&mut self.says_connected, true)
    }

    /// There is none, and why. Whether that is to be logged.
    pub fn is_news(&mut self, why: &str, now: Instant) -> bool {
        let lasted = self.since.filter(|(_, since)| now.saturating_duration_since(*since) >= LASTING);
        if lasted.is_some_and(|(was_connected, _)| was_connected || self.says_connected) {
            self.logged.clear();
        }
        if self.since.is_none_or(|(was_connected, _)| was_connected) {
            self.since = Some((false, now));
        }
        let is_news = self.logged.insert(why.to_owned());
        self.says_connected &= !is_news;
        is_news
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_logged_once_for_each_outage() {
        let (mut outages, start) = (Outages::default(), Instant::now());
        let at = |seconds| start + Duration::from_secs(seconds);
        assert!(outages.is_news("a", at(0)));
        assert!(
            outages.is_news("b", at(1)) && !outages.is_news("a", at(2)) && !outages.is_news("b", at(100))
        );
        // A connection that does not last is no other outage.
        assert!(outages.over(at(101)) && !outages.is_news("a", at(102)));
        assert!(!outages.over(at(103)) && !outages.is_news("b", at(104)));
        // But the log is not to end with "connected" where there is none.
        assert!(
            !outages.is_news("b", at(163)) && outages.is_news("b", at(164)) && !outages.is_news("b", at(165))
        );
        assert!(outages.over(at(200)) && outages.is_news("b", at(260)));
    }
}
