//! The clients whose TLS handshake is not over.

use std::io;
use std::sync::Arc;

use mio::net::TcpStream;
use mio::{Interest, Registry, Token};
use robot_session::tls::Layer;
use robot_session::tls::rustls::ServerConfig;
use slab::Slab;

use super::carrier::Carrier;
use super::{MAX_CLIENTS, refuse};

/// The token of the first handshake; those of clients are below.
pub(super) const FIRST_TOKEN: usize = MAX_CLIENTS;

/// The handshakes of the clients that have arrived.
pub(super) struct Handshakes(Slab<Handshake>);

struct Handshake {
    tcp: TcpStream,
    tls: Box<Layer>,
    peer: String,
}

impl Handshakes {
    pub(super) const NONE: Self = Self(Slab::new());

    /// Returns the tokens of all handshakes.
    pub(super) fn tokens(&self) -> Vec<usize> {
        self.0.iter().map(|(key, _)| FIRST_TOKEN + key).collect()
    }

    /// Begins the handshake of a client; returns its token. The error has the client and the reason for which it is refused.
    pub(super) fn begin(
        &mut self,
        mut tcp: TcpStream,
        peer: String,
        config: Arc<ServerConfig>,
        registry: &Registry,
    ) -> Result<usize, (String, String)> {
        let token = FIRST_TOKEN + self.0.vacant_key();
        let interest = Interest::READABLE | Interest::WRITABLE;
        let begun = match Layer::accept(config) {
            _ if self.0.len() >= MAX_CLIENTS => Err(io::Error::other("too many TLS handshakes at once")),
            Ok(tls) => registry.register(&mut tcp, Token(token), interest).map(|()| tls),
            Err(error) => Err(error),
        };
        match begun {
            Ok(tls) => {
                self.0.insert(Handshake { tcp, tls: Box::new(tls), peer });
                Ok(token)
            }
            Err(error) => {
                refuse(&tcp);
                Err((peer, error.to_string()))
            }
        }
    }

    /// Goes on with a handshake as far as the client's bytes have come. Returns the client when the handshake is over, or
    /// the client and the reason for which it is refused.
    pub(super) fn advance(
        &mut self,
        token: usize,
        registry: &Registry,
    ) -> Option<(String, Result<Carrier, String>)> {
        let key = token.checked_sub(FIRST_TOKEN)?;
        let Handshake { tcp, tls, .. } = self.0.get_mut(key)?;
        let outcome = match tls.shake_hands(tcp) {
            Ok(false) => return None,
            outcome => outcome,
        };
        let Handshake { mut tcp, tls, peer } = self.0.try_remove(key)?;
        _ = registry.deregister(&mut tcp);
        let carrier = match outcome {
            Ok(_) => Ok(Carrier { tcp, tls: Some(tls) }),
            Err(error) => {
                refuse(&tcp);
                Err(error.to_string())
            }
        };
        Some((peer, carrier))
    }
}
