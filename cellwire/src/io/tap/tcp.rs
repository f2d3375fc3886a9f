//! TCP: each client's connection is one to the server.

use std::io::{self, ErrorKind, Read as _, Write as _};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use robot_session::discard_unacknowledged;
use socket2::SockRef;

use super::{CHUNK, ConnectionTransport, End, TapEvent, Watch};
use cellwire_io::output::remark;
use cellwire_io::tcp::{self, Dialing};

/// Passes every client on to `server`, until the listener is gone.
///
/// # Errors
/// If the listener fails, or there is no room for a thread.
pub fn run(listener: &TcpListener, server: &str, dialing: Dialing, watch: &Watch) -> Result<()> {
    for number in 1.. {
        let (client, peer) = match listener.accept() {
            Ok(accepted) => accepted,
            // The client has disconnected, or there is no descriptor for it now: the others pass.
            Err(error) => {
                remark(&format!("warning: a client was not accepted: {error}"));
                thread::sleep(Duration::from_millis(100));
                continue;
            }
        };
        let (server, watch) = (server.to_owned(), watch.clone());
        let serve = move || {
            if let Err(error) = serve((&client, peer), &server, dialing, number, &watch) {
                remark(&format!("connection {number}: {error:#}"));
                reset(&client);
            }
        };
        thread::Builder::new().name("client".into()).spawn(serve).context("cannot start a thread")?;
    }
    Ok(())
}

/// Serves a client; `peer` is its address, which a connection that was reset no longer has.
fn serve(
    (client, peer): (&TcpStream, SocketAddr),
    server: &str,
    dialing: Dialing,
    number: u32,
    watch: &Watch,
) -> Result<()> {
    client.set_nodelay(true)?;
    let server = tcp::connect(server, dialing)?;
    // Bytes that the tap has taken from one end must not reach the other much later than they would have without the tap.
    for stream in [client, &server] {
        discard_unacknowledged(stream, tcp::DISCARD_AFTER)?;
    }
    // The address as if the tap were not there; if one address is of IPv4 and the other of IPv6, the one that the client has
    // connected to.
    let mut place = server.peer_addr()?;
    if peer.is_ipv4() != place.is_ipv4() {
        place = client.local_addr()?;
    }
    watch.see(number, End::A, TapEvent::Opened(ConnectionTransport::Tcp(peer, place)));
    let connection = Connection { number, is_broken: AtomicBool::new(false), watch };
    thread::scope(|scope| {
        scope.spawn(|| connection.pass(client, &server, End::A));
        connection.pass(&server, client, End::B);
    });
    Ok(())
}

struct Connection<'a> {
    number: u32,
    is_broken: AtomicBool,
    watch: &'a Watch,
}

impl Connection<'_> {
    /// Forwards one direction until it ends: the end of one stream ends the other, and a reset resets it.
    fn pass(&self, mut from: &TcpStream, mut to: &TcpStream, end: End) {
        let mut buffer = vec![0; CHUNK];
        loop {
            let bytes = match from.read(&mut buffer) {
                Ok(0) => break,
                Ok(length) => buffer.get(..length).unwrap_or_default(),
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                Err(error) => return self.end_both([from, to], end, &error),
            };
            // Reported first, so that an answer is not seen before its request.
            self.watch.see(self.number, end, TapEvent::Bytes(Arc::from(bytes)));
            if let Err(error) = to.write_all(bytes) {
                return self.end_both([from, to], end.other(), &error);
            }
        }
        if !self.is_broken.load(Ordering::Acquire) {
            self.watch.see(self.number, end, TapEvent::Closed(None));
            let _ = to.shutdown(Shutdown::Write);
        }
    }

    /// Breaks the connection of the other end after that of one end broke.
    fn end_both(&self, streams: [&TcpStream; 2], end: End, error: &io::Error) {
        if !self.is_broken.swap(true, Ordering::AcqRel) {
            self.watch.see(self.number, end, TapEvent::Closed(Some(error.to_string())));
        }
        for stream in streams {
            reset(stream);
            // Wakes the other direction, and sends nothing.
            let _ = stream.shutdown(Shutdown::Read);
        }
    }
}

/// Makes a close of the stream reset the peer's connection.
fn reset(stream: &TcpStream) {
    let _ = SockRef::from(stream).set_linger(Some(Duration::ZERO));
}
