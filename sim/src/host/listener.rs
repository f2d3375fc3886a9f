//! Accepts clients without waiting for them, even if there are more than can be served.

use core::time::Duration;
use std::fs::File;
use std::io::{self, ErrorKind};
#[cfg(feature = "tls")]
use std::sync::Arc;

use mio::event::Source;
use mio::net::TcpListener;
use mio::{Interest, Registry, Token};
#[cfg(feature = "tls")]
use robot_session::tls::rustls::ServerConfig;
use socket2::{SockRef, TcpKeepalive};

use super::carrier::{Arrival, refuse};
#[cfg(feature = "tls")]
use super::handshakes::Handshakes;

/// A peer that has vanished without a word is noticed when it acknowledges no probe: the first is sent after this long, the
/// others after each [`PROBE_INTERVAL`].
const FIRST_PROBE: Duration = Duration::from_secs(30);
const PROBE_INTERVAL: Duration = Duration::from_secs(5);

/// A listener whose queue never blocks its caller.
#[derive(Debug)]
pub struct Listener {
    listener: TcpListener,
    /// When no descriptor is free, this one is given up to accept a client and to close its connection: it would otherwise
    /// wait forever, and its arrival would be reported again and again.
    reserve: Option<File>,
    /// The clients whose TLS handshake is not over; `None`: the connections are not encrypted.
    #[cfg(feature = "tls")]
    handshakes: Option<Handshakes>,
}

impl Listener {
    /// Accepts the clients of `listener`.
    ///
    /// # Errors
    /// If it cannot be made non-blocking.
    pub fn new(listener: std::net::TcpListener) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener: TcpListener::from_std(listener),
            reserve: reserve(),
            #[cfg(feature = "tls")]
            handshakes: None,
        })
    }

    /// Sets the TLS that the clients have to speak; `None`: the connections are not encrypted.
    #[cfg(feature = "tls")]
    #[must_use]
    pub fn with_tls(self, config: Option<Arc<ServerConfig>>) -> Self {
        Self { handshakes: config.map(Handshakes::new), ..self }
    }

    /// Accepts the next client that has arrived, and goes on with the handshakes of TLS as far as the clients' bytes have
    /// come.
    ///
    /// # Errors
    /// If the system has no resources for a client: clients that wait may be accepted later.
    pub fn accept(&mut self) -> io::Result<Arrival> {
        #[cfg(feature = "tls")]
        return self.accept_tls();
        #[cfg(not(feature = "tls"))]
        self.accept_tcp()
    }

    #[cfg(feature = "tls")]
    fn accept_tls(&mut self) -> io::Result<Arrival> {
        loop {
            let arrival = self.accept_tcp();
            let Some(handshakes) = &mut self.handshakes else { return arrival };
            match arrival {
                Ok(Arrival::Client(client, peer)) => {
                    if let Some(refused) = handshakes.begin(client.tcp, peer) {
                        return Ok(refused);
                    }
                }
                Ok(Arrival::Nobody) | Err(_) => return handshakes.next().map_or(arrival, Ok),
                refused => return refused,
            }
        }
    }

    /// Returns a time after which [`accept`](Self::accept) is to be called without an event, because a handshake has taken too
    /// long then; `None` without handshakes.
    pub(super) fn handshake_time(&self) -> Option<Duration> {
        #[cfg(feature = "tls")]
        return self.handshakes.as_ref().and_then(Handshakes::time);
        #[cfg(not(feature = "tls"))]
        None
    }

    fn accept_tcp(&mut self) -> io::Result<Arrival> {
        loop {
            return match self.listener.accept() {
                Ok((stream, peer)) => {
                    stream.set_nodelay(true)?;
                    SockRef::from(&stream).set_tcp_keepalive(&probes())?;
                    Ok(Arrival::Client(stream.into(), peer))
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(Arrival::Nobody),
                // The client has gone before it was accepted.
                Err(error)
                    if matches!(error.kind(), ErrorKind::ConnectionAborted | ErrorKind::Interrupted) =>
                {
                    continue;
                }
                Err(error) => match self.reserve.take() {
                    Some(file) => {
                        drop(file);
                        let accepted = self.listener.accept();
                        let refused = accepted.map(|(stream, peer)| {
                            refuse(&stream);
                            Arrival::Refused(peer, "too many open files, see ulimit -n".into())
                        });
                        self.reserve = reserve();
                        refused
                    }
                    None => {
                        self.reserve = reserve();
                        Err(error)
                    }
                },
            };
        }
    }
}

impl Source for Listener {
    /// Clients whose handshake is not over are registered with the same token.
    fn register(&mut self, registry: &Registry, token: Token, interests: Interest) -> io::Result<()> {
        #[cfg(feature = "tls")]
        if let Some(handshakes) = &mut self.handshakes {
            handshakes.report(registry.try_clone()?, token);
        }
        self.listener.register(registry, token, interests)
    }

    fn reregister(&mut self, registry: &Registry, token: Token, interests: Interest) -> io::Result<()> {
        self.listener.reregister(registry, token, interests)
    }

    fn deregister(&mut self, registry: &Registry) -> io::Result<()> {
        self.listener.deregister(registry)
    }
}

/// Returns the probes of a peer that may disappear silently.
pub fn probes() -> TcpKeepalive {
    TcpKeepalive::new().with_time(FIRST_PROBE).with_interval(PROBE_INTERVAL)
}

fn reserve() -> Option<File> {
    File::open(if cfg!(unix) { "/dev/null" } else { "NUL" }).ok()
}

#[cfg(all(test, feature = "tls"))]
mod tests {
    use std::net::TcpStream;
    use std::time::Instant;

    use robot_session::tls::HANDSHAKE;
    use robot_session::tls::rustls::server::ResolvesServerCertUsingSni;

    use super::*;

    #[test]
    fn a_silent_client_is_looked_at_when_its_handshake_has_failed() {
        let names = Arc::new(ResolvesServerCertUsingSni::new());
        let config = ServerConfig::builder().with_no_client_auth().with_cert_resolver(names);
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let mut listener = Listener::new(listener).unwrap().with_tls(Some(Arc::new(config)));
        assert_eq!(listener.handshake_time(), None);
        let _client = TcpStream::connect(address).unwrap();
        let begun = Instant::now();
        while listener.handshake_time().is_none() && begun.elapsed() < HANDSHAKE {
            assert!(matches!(listener.accept(), Ok(Arrival::Nobody)));
        }
        assert_eq!(listener.handshake_time(), Some(HANDSHAKE));
    }
}
