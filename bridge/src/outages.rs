//! Limits the log of connection failures: each reason is logged once per outage, not once per attempt.

use std::collections::HashSet;
use std::time::{Duration, Instant};

/// After a connection that has lasted this long, reasons that were logged before are logged again. The same applies after
/// this time without a connection if the last line of the log states that there is one.
const LASTING: Duration = Duration::from_secs(60);

/// The reasons that were logged during an outage.
#[derive(Debug, Default)]
pub struct Outages {
    /// The reasons of failed connections, as logged.
    logged: HashSet<String>,
    /// Whether there is a connection, and the time since which that is so.
    since: Option<(bool, Instant)>,
    /// Whether the last line of the log states that there is a connection.
    logged_connected: bool,
}

impl Outages {
    /// Records that the connection is up; returns whether to log it.
    pub fn over(&mut self, now: Instant) -> bool {
        self.since = Some((true, now));
        !core::mem::replace(&mut self.logged_connected, true)
    }

    /// Records that the connection is down; returns whether to log the reason.
    pub fn is_news(&mut self, why: &str, now: Instant) -> bool {
        let lasted = self.since.filter(|(_, since)| now.saturating_duration_since(*since) >= LASTING);
        if lasted.is_some_and(|(was_connected, _)| was_connected || self.logged_connected) {
            self.logged.clear();
        }
        if self.since.is_none_or(|(was_connected, _)| was_connected) {
            self.since = Some((false, now));
        }
        let is_news = self.logged.insert(why.to_owned());
        self.logged_connected &= !is_news;
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
        // A connection that does not last does not begin another outage.
        assert!(outages.over(at(101)) && !outages.is_news("a", at(102)));
        assert!(!outages.over(at(103)) && !outages.is_news("b", at(104)));
        // The log must not end with "connected" while there is no connection.
        assert!(
            !outages.is_news("b", at(163)) && outages.is_news("b", at(164)) && !outages.is_news("b", at(165))
        );
        assert!(outages.over(at(200)) && outages.is_news("b", at(260)));
    }
}
