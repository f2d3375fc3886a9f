//! What systemd is told of a service of `Type=notify`: that it is ready, that it lives, that it ends. Without systemd nobody is told.

use std::env;
use std::os::linux::net::SocketAddrExt as _;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::{Duration, Instant};

/// Who is told.
#[derive(Debug)]
pub(crate) struct Notify {
    socket: Option<(UnixDatagram, SocketAddr)>,
    /// From one sign of life to the next.
    interval: Option<Duration>,
    due: Instant,
}

impl Notify {
    /// As the environment says.
    pub(crate) fn from_environment() -> Self {
        let address = env::var("NOTIFY_SOCKET").ok().and_then(|name| match name.strip_prefix('@') {
            Some(name) => SocketAddr::from_abstract_name(name).ok(),
            None => SocketAddr::from_pathname(name).ok(),
        });
        let socket = address.and_then(|address| Some((UnixDatagram::unbound().ok()?, address)));
        let limit = env::var("WATCHDOG_USEC").ok().and_then(|text| text.parse().ok());
        let interval = limit.map(|limit| Duration::from_micros(limit) / 3);
        Self { socket, interval, due: Instant::now() }
    }

    /// Says it, once.
    pub(crate) fn say(&self, what: &str) {
        if let Some((socket, address)) = &self.socket {
            // Who does not listen has no use for it.
            let _ = socket.send_to_addr(what.as_bytes(), address);
        }
    }

    /// A sign of life, where it is time for one.
    pub(crate) fn lives(&mut self, now: Instant) {
        if let Some(interval) = self.interval
            && now >= self.due
        {
            self.due = now + interval;
            self.say("WATCHDOG=1");
        }
    }
}
