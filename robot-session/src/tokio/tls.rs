//! TLS over TCP for handles, and for the sessions of a listener. [`client`](crate::tls::client) and
//! [`server`](crate::tls::server) read certificates.
//!
//! ```no_run
//! use robot_session::tls::client;
//! use robot_session::tokio::Tcp;
//! use robot_session::tokio::tls::Tls;
//!
//! # fn run() -> Result<(), Box<dyn core::error::Error>> {
//! let config = client("authority.pem".as_ref(), None)?;
//! let connector = Tls::dial(Tcp::new("robot.local:802"), config, "robot.local")?;
//! # Ok(()) }
//! ```

use core::fmt;
use core::future::Future;
use core::net::SocketAddr;
use core::ops::DerefMut;
use core::pin::Pin;
use core::task::{Context, Poll};
use core::time::Duration;
use std::io;
use std::string::String;
use std::sync::Arc;

use super::Connector;
use super::listener::{accept, run};
use crate::Session;
use crate::tls::{HANDSHAKE, advised, late, server_name};
use ::tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use ::tokio::net::{TcpListener, TcpStream};
use ::tokio::time::timeout;
use tokio_rustls::rustls::pki_types::ServerName;
use tokio_rustls::rustls::{ClientConfig, CommonState, ConnectionCommon, ServerConfig};
use tokio_rustls::{TlsAcceptor, TlsConnector, TlsStream};

/// Makes a secure connection of each TCP connection of another connector: of [`Tcp`](super::Tcp) as the client, of
/// [`Listen`](super::Listen) as the server. A handshake takes 10 s at most.
#[derive(Clone)]
pub struct Tls<C> {
    tcp: C,
    side: Side,
}

#[derive(Clone)]
enum Side {
    Client(TlsConnector, ServerName<'static>),
    Server(TlsAcceptor),
}

impl<C: Connector<Transport = TcpStream>> Tls<C> {
    /// Connects as the client; the server's certificate must be for `name`, a host name or an IP address.
    ///
    /// # Errors
    /// `name` is neither.
    pub fn dial(tcp: C, config: Arc<ClientConfig>, name: &str) -> io::Result<Self> {
        let name = server_name(name)?;
        Ok(Self { tcp, side: Side::Client(TlsConnector::from(config), name) })
    }

    /// Returns the connector of the TCP connections.
    pub const fn tcp(&self) -> &C {
        &self.tcp
    }

    /// Connects as the server.
    pub fn accept(tcp: C, config: Arc<ServerConfig>) -> Self {
        Self { tcp, side: Side::Server(TlsAcceptor::from(config)) }
    }
}

impl<C: fmt::Debug> fmt::Debug for Tls<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tls").field("tcp", &self.tcp).finish_non_exhaustive()
    }
}

impl<C: Connector<Transport = TcpStream>> Connector for Tls<C> {
    type Transport = Secure;

    const DIALS: bool = C::DIALS;

    async fn connect(&mut self) -> io::Result<Secure> {
        let stream = self.tcp.connect().await?;
        match &self.side {
            Side::Client(connector, name) => {
                in_time(connector.connect(name.clone(), stream)).await.map(|stream| Secure(stream.into()))
            }
            Side::Server(acceptor) => {
                in_time(acceptor.accept(stream)).await.map(|stream| Secure(stream.into()))
            }
        }
    }

    fn discard_after(&mut self, after: Duration) {
        self.tcp.discard_after(after);
    }

    fn peer(&self) -> Option<String> {
        self.tcp.peer()
    }

    async fn replaced(&mut self) {
        self.tcp.replaced().await;
    }
}

async fn in_time<T>(handshake: impl Future<Output = io::Result<T>>) -> io::Result<T> {
    timeout(HANDSHAKE, handshake).await.map_err(|_| late())?.map_err(advised)
}

/// As [`serve`](super::serve), over TLS. `session` is called after each handshake, with the certificates of the peer among
/// others, or with the reason why there is no connection; `None` ends the connection.
///
/// # Errors
/// The errors of the listener.
pub async fn serve<S>(
    listener: TcpListener,
    most: usize,
    config: Arc<ServerConfig>,
    session: impl Fn(SocketAddr, Result<&CommonState, io::Error>) -> Option<S> + Clone + Send + 'static,
    event: impl FnMut(SocketAddr, &mut S, S::Event) + Clone + Send + 'static,
) -> io::Result<()>
where
    S: Session<Event: Send> + Send + 'static,
{
    let acceptor = TlsAcceptor::from(config);
    accept(listener, most, |stream, peer| {
        let (acceptor, session, event) = (acceptor.clone(), session.clone(), event.clone());
        async move {
            match in_time(acceptor.accept(stream)).await {
                Ok(stream) => {
                    let Some(session) = session(peer, Ok(stream.get_ref().1)) else { return };
                    run(Secure(stream.into()), peer, session, event).await;
                }
                Err(error) => drop(session(peer, Err(error))),
            }
        }
    })
    .await
}

/// A secure connection. Its errors state the fault of a certificate, and the remedy.
#[derive(Debug)]
pub struct Secure(TlsStream<TcpStream>);

/// Ends TLS, so that the peer does not take the end for a lost connection.
impl Drop for Secure {
    fn drop(&mut self) {
        match &mut self.0 {
            TlsStream::Client(stream) => end(stream.get_mut()),
            TlsStream::Server(stream) => end(stream.get_mut()),
        }
    }
}

fn end<D>((tcp, tls): (&mut TcpStream, &mut impl DerefMut<Target = ConnectionCommon<D>>)) {
    tls.send_close_notify();
    while tls.wants_write() && tls.write_tls(&mut NonBlocking(tcp)).is_ok() {}
}

/// A stream that does not wait.
struct NonBlocking<'a>(&'a TcpStream);

impl io::Write for NonBlocking<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.try_write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl AsyncRead for Secure {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_read(context, buffer).map_err(advised)
    }
}

impl AsyncWrite for Secure {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.0).poll_write(context, bytes).map_err(advised)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_flush(context).map_err(advised)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.0).poll_shutdown(context).map_err(advised)
    }
}
