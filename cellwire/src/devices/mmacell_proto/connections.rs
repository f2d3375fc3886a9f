//! The connections of a device that serves one central controller at a time: the newest.

use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use anyhow::{Context, Result};
use mio::{Events, Interest, Poll, Token, Waker};

use cellwire_io::listener::{Arrival, Listener};
use cellwire_io::output::remark;

const ARRIVALS: Token = Token(0);
const WAKE: Token = Token(1);

/// When the system has no room for a client, the next try is this much later.
const RETRY: Duration = Duration::from_millis(100);

/// Accepts connections until it is dropped. A new one takes the place of the one before, which is closed: it may be half open, and
/// then no other client could ever connect.
#[derive(Debug)]
pub struct Connections {
    newest: Newest,
    stopped: Arc<AtomicBool>,
    waker: Arc<Waker>,
    accepted: Receiver<TcpStream>,
}

type Newest = Arc<Mutex<Option<TcpStream>>>;

/// Ends the connections of a device from another thread.
#[derive(Debug, Clone)]
pub struct Stop {
    waker: Arc<Waker>,
    stopped: Arc<AtomicBool>,
    newest: Newest,
}

impl Connections {
    /// Accepts in a thread of its own until it is stopped. A connection on which nothing is received, or on which the peer takes
    /// nothing, for `idle_timeout` ends with an error.
    ///
    /// # Errors
    /// When the system has no room for it.
    pub fn accept(listener: TcpListener, idle_timeout: Option<Duration>) -> Result<Self> {
        let (sender, accepted) = channel();
        let newest = Newest::default();
        let stopped = Arc::new(AtomicBool::new(false));
        let mut poll = Poll::new().context("cannot wait for clients")?;
        let waker = Arc::new(Waker::new(poll.registry(), WAKE)?);
        let mut listener = Listener::new(listener)?;
        poll.registry().register(&mut listener, ARRIVALS, Interest::READABLE)?;
        let (current, ended) = (Arc::clone(&newest), Arc::clone(&stopped));
        let thread = thread::Builder::new().name("accept".into()).spawn(move || {
            let mut events = Events::with_capacity(8);
            while !ended.load(Ordering::Relaxed) {
                match listener.accept() {
                    Ok(Arrival::Client(stream, _)) => {
                        let stream = TcpStream::from(stream);
                        let is_ready = stream
                            .set_nonblocking(false)
                            .and_then(|()| stream.set_read_timeout(idle_timeout))
                            .and_then(|()| stream.set_write_timeout(idle_timeout));
                        // Without a second handle it could not be ended: it is refused.
                        let (Ok(()), Ok(handle)) = (is_ready, stream.try_clone()) else { continue };
                        close(&current, Some(handle));
                        if sender.send(stream).is_err() {
                            return;
                        }
                    }
                    Ok(Arrival::Refused(peer)) => {
                        remark(&format!("refused the client {peer}: too many open files, see ulimit -n"));
                    }
                    Ok(Arrival::Nobody) => _ = poll.poll(&mut events, None),
                    // Who waits may be accepted later.
                    Err(_) => _ = poll.poll(&mut events, Some(RETRY)),
                }
            }
        });
        thread.context("cannot start a thread that accepts connections")?;
        Ok(Self { newest, stopped, waker, accepted })
    }

    /// The newest connection, if there is one within this time.
    pub fn next_within(&self, wait: Duration) -> Option<TcpStream> {
        self.accepted.recv_timeout(wait).ok()
    }

    /// What ends them.
    pub fn stop(&self) -> Stop {
        Stop {
            waker: Arc::clone(&self.waker),
            stopped: Arc::clone(&self.stopped),
            newest: Arc::clone(&self.newest),
        }
    }
}

impl Iterator for Connections {
    type Item = TcpStream;

    /// The newest connection; waits for one. `None` after [`Stop::stop`].
    fn next(&mut self) -> Option<TcpStream> {
        self.accepted.recv().ok()
    }
}

impl Stop {
    /// No connection is accepted any more, and the newest one ends.
    pub fn stop(&self) {
        self.stopped.store(true, Ordering::Relaxed);
        close(&self.newest, None);
        // Should it fail, it is woken by the next client.
        let _ = self.waker.wake();
    }
}

fn close(newest: &Newest, next: Option<TcpStream>) {
    let mut newest = newest.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(before) = core::mem::replace(&mut *newest, next) {
        let _ = before.shutdown(Shutdown::Both);
    }
}
