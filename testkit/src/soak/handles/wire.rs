//! Pipes of tokio through the faulty line.

use core::future::pending;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use robot_session::now;
use robot_session::tokio::Connector;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, DuplexStream, ReadHalf, WriteHalf, duplex, split};
use tokio::sync::{mpsc, oneshot};
use tokio::time::sleep;

use crate::link::{Delivery, End, Faults};
use crate::soak::{Check, Log, Mark, Tally, Unseen, Wire as Line};

/// The capacity of a pipe in each direction, in bytes.
const PIPE: usize = 1 << 16;

/// The socket of an end: it has a connection when the other one is plugged in too.
#[derive(Clone)]
pub struct Plug(mpsc::UnboundedSender<oneshot::Sender<DuplexStream>>);

impl Connector for Plug {
    type Transport = DuplexStream;

    async fn connect(&mut self) -> io::Result<DuplexStream> {
        let (give, stream) = oneshot::channel();
        let gone = |_| io::Error::from(io::ErrorKind::BrokenPipe);
        self.0.send(give).map_err(|_| io::ErrorKind::BrokenPipe)?;
        stream.await.map_err(gone)
    }
}

/// The line that carries the bytes.
#[derive(Clone)]
pub struct Wire(Arc<Mutex<Line>>);

impl Wire {
    /// Starts a wire in a task of its own, and its two ends.
    pub fn start(seed: u64, faults: Faults, log: Log) -> (Self, [Plug; 2]) {
        let line = Line::new(seed, faults, ["handle", "device"], false, log);
        let wire = Self(Arc::new(Mutex::new(line)));
        let [(near, to_near), (far, to_far)] = core::array::from_fn(|_| mpsc::unbounded_channel());
        tokio::spawn(wire.clone().run([to_near, to_far]));
        (wire, [Plug(near), Plug(far)])
    }

    /// Ends all faults from now on.
    pub fn heal(&self) {
        self.lock().heal(now());
    }

    /// Returns a mark after the transmissions so far.
    pub fn mark(&self) -> Mark {
        self.lock().mark()
    }

    /// Calls [`Line::settle`].
    pub fn settle(&self, tally: &mut Tally, longest: usize, check: fn(End, &[u8]) -> Check) -> Vec<Unseen> {
        self.lock().settle(now(), tally, longest, check)
    }

    fn lock(&self) -> MutexGuard<'_, Line> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Serves one connection after the other.
    async fn run(self, [mut near, mut far]: [mpsc::UnboundedReceiver<oneshot::Sender<DuplexStream>>; 2]) {
        // An end whose future was dropped has gone.
        while let (Some(to_near), Some(to_far)) = (next(&mut near).await, next(&mut far).await) {
            let [(near_end, near_pipe), (far_end, far_pipe)] = [duplex(PIPE), duplex(PIPE)];
            if to_near.send(near_end).is_ok() && to_far.send(far_end).is_ok() {
                self.lock().reconnect(now());
                self.carry([near_pipe, far_pipe].map(split)).await;
            }
        }
    }

    async fn carry(&self, [near, far]: [(ReadHalf<DuplexStream>, WriteHalf<DuplexStream>); 2]) {
        let ([mut from_a, mut from_b], [mut to_a, mut to_b]) =
            ([near.0, far.0].map(Some), [near.1, far.1].map(Some));
        let [mut a, mut b] = [[0; 4096]; 2];
        while from_a.is_some() || from_b.is_some() {
            let due = self.lock().next_delivery();
            let read = tokio::select! {
                biased;
                length = read(&mut from_a, &mut a) => Some((End::A, length)),
                length = read(&mut from_b, &mut b) => Some((End::B, length)),
                () = wait(due) => None,
            };
            match read {
                Some((end, 0)) => {
                    self.lock().disconnect(now());
                    *(if end == End::A { &mut from_a } else { &mut from_b }) = None;
                }
                Some((End::A, length)) => self.lock().send(End::A, now(), &a[..length]),
                Some((End::B, length)) => self.lock().send(End::B, now(), &b[..length]),
                None => {}
            }
            for (end, to) in [(End::A, &mut to_a), (End::B, &mut to_b)] {
                loop {
                    let delivery = self.lock().receive(end, now());
                    match (delivery, to.as_mut()) {
                        (None, _) => break,
                        // An end that has gone reads nothing.
                        (Some(Delivery::Bytes(bytes)), Some(to)) => _ = to.write_all(&bytes).await,
                        (Some(Delivery::Bytes(_)), None) => {}
                        (Some(Delivery::Closed), _) => {
                            if let Some(mut to) = to.take() {
                                _ = to.shutdown().await;
                            }
                        }
                    }
                }
            }
        }
    }
}

async fn next(
    plug: &mut mpsc::UnboundedReceiver<oneshot::Sender<DuplexStream>>,
) -> Option<oneshot::Sender<DuplexStream>> {
    loop {
        let waits = plug.recv().await?;
        if !waits.is_closed() {
            return Some(waits);
        }
    }
}

async fn read(from: &mut Option<ReadHalf<DuplexStream>>, buffer: &mut [u8]) -> usize {
    match from {
        Some(from) => from.read(buffer).await.unwrap_or(0),
        None => pending().await,
    }
}

async fn wait(due: Option<core::time::Duration>) {
    match due {
        Some(due) => sleep(due.saturating_sub(now())).await,
        None => pending().await,
    }
}
