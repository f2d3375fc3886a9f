//! Notifications to systemd for a service of `Type=notify`: ready, watchdog, stopping. Without systemd nothing is sent.

use std::env;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The socket.
#[derive(Debug)]
pub(crate) struct Notify {
    socket: Option<PathBuf>,
    /// The time from one sign of life to the next.
    interval: Option<Duration>,
    due: Instant,
}

impl Notify {
    /// Reads the socket and the interval from the environment.
    pub(crate) fn from_environment() -> Self {
        let limit = env::var("WATCHDOG_USEC").ok().and_then(|text| text.parse().ok());
        let interval = limit.map(|limit| Duration::from_micros(limit) / 3);
        Self { socket: env::var_os("NOTIFY_SOCKET").map(PathBuf::from), interval, due: Instant::now() }
    }

    /// Sends a notification, once.
    pub(crate) fn say(&self, what: &str) {
        #[cfg(unix)]
        if let Some(place) = &self.socket
            && let Ok(socket) = std::os::unix::net::UnixDatagram::unbound()
        {
            // Ignore an error: a socket on which no program listens has no use for the notification.
            let _ = socket.send_to(what.as_bytes(), place);
        }
        #[cfg(not(unix))]
        let _ = (&self.socket, what);
    }

    /// Sends a sign of life if it is time for one.
    pub(crate) fn lives(&mut self, now: Instant) {
        if let Some(interval) = self.interval
            && now >= self.due
        {
            self.due = now + interval;
            self.say("WATCHDOG=1");
        }
    }
}
