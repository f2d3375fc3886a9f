//! The clients whose TLS handshake is not over.

use core::net::SocketAddr;
use core::time::Duration;
use std::collections::VecDeque;
use std::io;
use std::sync::Arc;

use mio::net::TcpStream;
use mio::{Interest, Registry, Token};
use robot_session::tls::rustls::ServerConfig;
use robot_session::tls::{HANDSHAKE, Layer};

use super::MAX_CLIENTS;
use super::carrier::{Arrival, Carrier, refuse};

/// The handshakes of the clients that have arrived.
#[derive(Debug)]
pub(super) struct Handshakes {
    config: Arc<ServerConfig>,
    /// The poll to which bytes of these clients are reported, if it is not the caller that polls.
    reports: Option<(Registry, Token)>,
    pending: Vec<Handshake>,
    /// The clients whose handshake is over, or has failed.
    done: VecDeque<Arrival>,
}

#[derive(Debug)]
struct Handshake {
    tcp: TcpStream,
    tls: Box<Layer>,
    peer: SocketAddr,
    /// The outcome; false until the handshake is over.
    outcome: io::Result<bool>,
}

impl Handshakes {
    pub(super) const fn new(config: Arc<ServerConfig>) -> Self {
        Self { config, reports: None, pending: Vec::new(), done: VecDeque::new() }
    }

    /// Reports the bytes of clients that arrive from now on.
    pub(super) fn report(&mut self, registry: Registry, token: Token) {
        self.reports = Some((registry, token));
    }

    /// Begins the handshake of a client; returns the client if it is refused.
    pub(super) fn begin(&mut self, mut tcp: TcpStream, peer: SocketAddr) -> Option<Arrival> {
        let registered = match &self.reports {
            _ if self.pending.len() >= MAX_CLIENTS => {
                Err(io::Error::other("too many TLS handshakes at once"))
            }
            Some((registry, token)) => {
                registry.register(&mut tcp, *token, Interest::READABLE | Interest::WRITABLE)
            }
            None => Ok(()),
        };
        match registered.and_then(|()| Layer::accept(Arc::clone(&self.config))) {
            Ok(tls) => {
                self.pending.push(Handshake { tcp, tls: Box::new(tls), peer, outcome: Ok(false) });
                None
            }
            Err(error) => {
                refuse(&tcp);
                Some(Arrival::Refused(peer, error.to_string()))
            }
        }
    }

    /// Goes on with the handshakes as far as the clients' bytes have come. Returns the next client whose handshake is over, or
    /// that is refused.
    pub(super) fn next(&mut self) -> Option<Arrival> {
        if self.done.is_empty() {
            let is_over = |Handshake { tcp, tls, outcome, .. }: &mut Handshake| {
                *outcome = tls.shake_hands(tcp);
                !matches!(outcome, Ok(false))
            };
            for Handshake { mut tcp, tls, peer, outcome } in self.pending.extract_if(.., is_over) {
                if let Some((registry, _)) = &self.reports {
                    _ = registry.deregister(&mut tcp);
                }
                self.done.push_back(match outcome {
                    Ok(_) => Arrival::Client(Carrier { tcp, tls: Some(tls) }, peer),
                    Err(error) => {
                        refuse(&tcp);
                        Arrival::Refused(peer, error.to_string())
                    }
                });
            }
        }
        self.done.pop_front()
    }

    /// Returns the longest time until a handshake of a silent client has failed.
    pub(super) fn time(&self) -> Option<Duration> {
        (!self.pending.is_empty()).then_some(HANDSHAKE)
    }
}
