//! A session for each connection of a listener.

use core::future::{Future, poll_fn};
use core::net::SocketAddr;
use core::ops::ControlFlow;
use core::task::Poll;
use core::time::Duration;
use std::io;
use std::string::ToString;

use ::tokio::io::{AsyncRead, AsyncWrite};
use ::tokio::net::{TcpListener, TcpStream};
use ::tokio::task::JoinSet;
use ::tokio::time::sleep;

use super::Driver;
use super::connector::prepare;
use crate::Session;
use crate::trace::Span;

/// Accepts TCP connections, `most` at a time, and runs a session over each: `session` makes it, and `event` is called with
/// its events. Further peers wait in the system's queue. A dropped future ends all connections.
///
/// The listener's loop runs until the listener fails, which does not happen for a lost peer or a lack of descriptors.
///
/// # Errors
/// The errors of the listener.
pub async fn serve<S>(
    listener: TcpListener,
    most: usize,
    mut session: impl FnMut(SocketAddr) -> S,
    event: impl FnMut(SocketAddr, &mut S, S::Event) + Clone + Send + 'static,
) -> io::Result<()>
where
    S: Session<Event: Send> + Send + 'static,
{
    accept(listener, most, |stream, peer| run(stream, peer, session(peer), event.clone())).await
}

/// Accepts connections, `most` at a time, and spawns the future of `connection` for each.
pub(super) async fn accept<F: Future<Output = ()> + Send + 'static>(
    listener: TcpListener,
    most: usize,
    mut connection: impl FnMut(TcpStream, SocketAddr) -> F,
) -> io::Result<()> {
    let mut connections = JoinSet::new();
    loop {
        let has_room = connections.len() < most.max(1);
        // A connection that ends makes a free entry.
        let accepted = poll_fn(|context| {
            if connections.poll_join_next(context).map(|ended| ended.is_some()) == Poll::Ready(true) {
                return Poll::Ready(None);
            }
            if has_room { listener.poll_accept(context).map(Some) } else { Poll::Pending }
        });
        let Some(accepted) = accepted.await else { continue };
        match accepted {
            Ok((stream, peer)) => {
                if prepare(&stream, None).is_ok() {
                    connections.spawn(connection(stream, peer));
                }
            }
            Err(error) if is_of_the_listener(&error) => return Err(error),
            Err(_) => sleep(Duration::from_millis(100)).await,
        }
    }
}

/// Runs a session over a connection to its end.
pub(super) async fn run<S: Session>(
    stream: impl AsyncRead + AsyncWrite + Unpin,
    peer: SocketAddr,
    mut session: S,
    mut event: impl FnMut(SocketAddr, &mut S, S::Event),
) {
    let each = |session: &mut S, reported| {
        event(peer, session, reported);
        ControlFlow::<()>::Continue(())
    };
    let span = Span::of([S::LINK, S::END], Some(&peer.to_string()));
    // A lost connection ends in the same way as a closed one.
    let _ = span.instrument(Driver::new(stream).run(&mut session, each)).await;
}

/// Returns whether the error ends the listener, so that no later peer is accepted either.
fn is_of_the_listener(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::NotConnected)
}
