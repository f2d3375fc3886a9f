//! The connections of a device that serves one central controller at a time: the newest.

use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

/// Accepts connections until it is dropped. A new one takes the place of the one before, which is closed: it may be half open, and
/// then nobody else ever would.
#[derive(Debug)]
pub struct Connections {
    listener: Arc<TcpListener>,
    newest: Newest,
    stopped: Arc<AtomicBool>,
    accepted: Receiver<TcpStream>,
}

type Newest = Arc<Mutex<Option<TcpStream>>>;

/// Ends the connections of a device from another thread.
#[derive(Debug, Clone)]
pub struct Stop {
    listener: Arc<TcpListener>,
    stopped: Arc<AtomicBool>,
    newest: Newest,
}

impl Connections {
    /// Accepts in a thread of its own until it is stopped.
    pub fn accept(listener: TcpListener) -> Self {
        let (sender, accepted) = channel();
        let (listener, newest) = (Arc::new(listener), Newest::default());
        let stopped = Arc::new(AtomicBool::new(false));
        let (incoming, current, ended) = (Arc::clone(&listener), Arc::clone(&newest), Arc::clone(&stopped));
        thread::spawn(move || {
            for stream in incoming.incoming().flatten() {
                if ended.load(Ordering::Relaxed) {
                    return;
                }
                let _ = stream.set_nodelay(true);
                close(&current, stream.try_clone().ok());
                if sender.send(stream).is_err() {
                    return;
                }
            }
        });
        Self { listener, newest, stopped, accepted }
    }

    /// What ends them.
    pub fn stop(&self) -> Stop {
        Stop {
            listener: Arc::clone(&self.listener),
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
        // Wakes the listener.
        let _ = self.listener.local_addr().and_then(TcpStream::connect);
    }
}

fn close(newest: &Newest, next: Option<TcpStream>) {
    let mut newest = newest.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(before) = core::mem::replace(&mut *newest, next) {
        let _ = before.shutdown(Shutdown::Both);
    }
}
