//! Datagrams: those of each client are sent on from a socket of its own, by which the server's answers find back.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::{SocketAddr, ToSocketAddrs as _, UdpSocket};
use std::sync::Arc;
use std::thread;

use anyhow::{Context, Result};

use super::{ConnectionTransport, End, TapEvent, Watch};
use cellwire_io::output::remark;
use cellwire_io::udp;

/// The longest datagram.
const MAX_DATAGRAM_LEN: usize = 65_536;

/// The maximum number of clients; datagrams of more clients are not passed.
const CLIENTS: usize = 256;

/// Passes the datagrams of every client on to `server`, and its answers back.
///
/// # Errors
/// If the socket fails, or the server's name has no address.
pub fn run(socket: &UdpSocket, server: &str, watch: &Watch) -> Result<()> {
    socket.set_nonblocking(false)?;
    let place = server.to_socket_addrs().with_context(|| format!("cannot send to {server}"))?.next();
    let place = place.with_context(|| format!("cannot send to {server}: the name has no address"))?;
    let mut clients: BTreeMap<SocketAddr, (u32, UdpSocket)> = BTreeMap::new();
    let mut buffer = vec![0; MAX_DATAGRAM_LEN];
    let (mut number, mut is_full) = (0, false);
    loop {
        let (length, from) = match socket.recv_from(&mut buffer) {
            Ok(received) => received,
            // An answer was not delivered.
            Err(error) if is_passing(error.kind()) => continue,
            Err(error) => return Err(error).context("cannot receive datagrams"),
        };
        if !clients.contains_key(&from) {
            if clients.len() == CLIENTS {
                if !core::mem::replace(&mut is_full, true) {
                    remark(&format!(
                        "warning: datagrams of {from} and others are dropped: {CLIENTS} clients are the maximum"
                    ));
                }
                continue;
            }
            number += 1;
            clients.insert(from, (number, open(socket, server, number, from, watch)?));
            watch.see(number, End::A, TapEvent::Opened(ConnectionTransport::Udp(from, place)));
        }
        let (Some((number, to)), Some(bytes)) = (clients.get(&from), buffer.get(..length)) else { continue };
        watch.see(*number, End::A, TapEvent::Bytes(Arc::from(bytes)));
        // One that is lost is lost: the protocol sends again.
        let _ = to.send(bytes);
    }
}

/// Opens a client's socket, whose answers are sent back.
fn open(
    socket: &UdpSocket,
    server: &str,
    number: u32,
    client: SocketAddr,
    watch: &Watch,
) -> Result<UdpSocket> {
    let to = udp::connect(server)?;
    to.set_nonblocking(false)?;
    let (from, back, watch) = (to.try_clone()?, socket.try_clone()?, watch.clone());
    let answer = move || {
        let mut buffer = vec![0; MAX_DATAGRAM_LEN];
        loop {
            match from.recv(&mut buffer) {
                Ok(length) => {
                    let bytes = buffer.get(..length).unwrap_or_default();
                    watch.see(number, End::B, TapEvent::Bytes(Arc::from(bytes)));
                    let _ = back.send_to(bytes, client);
                }
                Err(error) if is_passing(error.kind()) => {}
                Err(error) => return watch.see(number, End::B, TapEvent::Closed(Some(error.to_string()))),
            }
        }
    };
    thread::Builder::new().name("answers".into()).spawn(answer).context("cannot start a thread")?;
    Ok(to)
}

/// Returns whether an error is temporary: the peer does not listen now, or the call was interrupted.
fn is_passing(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset | ErrorKind::Interrupted)
}
