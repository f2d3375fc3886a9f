//! The faults of a network between a client and a server.

use core::net::{Ipv4Addr, SocketAddr};
use core::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use core::time::Duration;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::thread;

/// The number of faults of a [`FaultyProxy`] so far.
#[derive(Debug, Default)]
pub struct NetworkFaults {
    /// Reads that were forwarded in pieces.
    pub splits: AtomicU64,
    /// Reads that were forwarded late.
    pub delays: AtomicU64,
    /// Connections that were broken in the middle of a read.
    pub disconnects: AtomicU64,
}

/// A proxy between a client and a server with the faults of a network: it splits, merges and delays reads, and disconnects.
///
/// It never corrupts a byte, because TCP does not. It stops when dropped.
#[derive(Debug)]
pub struct FaultyProxy {
    address: SocketAddr,
    faults: Arc<NetworkFaults>,
    stop: Arc<AtomicBool>,
}

impl FaultyProxy {
    /// Listens on a free loopback port and forwards every connection to `server`. `breaks` is the probability that a
    /// read breaks the connection.
    ///
    /// # Errors
    /// If no port is free.
    pub fn start(server: SocketAddr, seed: u64, breaks: f64) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0))?;
        let address = listener.local_addr()?;
        let (faults, stop) = (Arc::new(NetworkFaults::default()), Arc::new(AtomicBool::new(false)));
        let (shared, ended) = (Arc::clone(&faults), Arc::clone(&stop));
        thread::spawn(move || {
            let mut rng = fastrand::Rng::with_seed(seed);
            for client in listener.incoming() {
                if ended.load(Ordering::Relaxed) {
                    return;
                }
                // If the server cannot be reached, the client's connection is closed.
                let (Ok(client), Ok(server)) = (client, TcpStream::connect(server)) else { continue };
                for (from, to) in [(&client, &server), (&server, &client)] {
                    let (Ok(from), Ok(to)) = (from.try_clone(), to.try_clone()) else { continue };
                    let (rng, faults) = (rng.fork(), Arc::clone(&shared));
                    thread::spawn(move || forward(from, to, rng, breaks, &faults));
                }
            }
        });
        Ok(Self { address, faults, stop })
    }

    /// Returns the address to which clients connect.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Returns the number of faults so far.
    pub fn faults(&self) -> &NetworkFaults {
        &self.faults
    }
}

impl Drop for FaultyProxy {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = TcpStream::connect(self.address); // wakes the listener
    }
}

fn forward(
    mut from: TcpStream,
    mut to: TcpStream,
    mut rng: fastrand::Rng,
    breaks: f64,
    faults: &NetworkFaults,
) {
    let _ = to.set_nodelay(true);
    let mut buffer = vec![0; 16 * 1024];
    loop {
        // A late read merges everything that arrived meanwhile.
        if rng.f64() < 0.05 {
            faults.delays.fetch_add(1, Ordering::Relaxed);
            thread::sleep(Duration::from_micros(rng.u64(100..20_000)));
        }
        let Ok(n) = from.read(&mut buffer) else { break };
        let read = buffer.get(..n).unwrap_or_default();
        if read.is_empty() {
            break;
        }
        if rng.f64() < breaks {
            faults.disconnects.fetch_add(1, Ordering::Relaxed);
            let _ = to.write_all(read.get(..rng.usize(0..n)).unwrap_or_default());
            break;
        }
        let (pieces, last) = split(read, &mut rng);
        faults.splits.fetch_add(u64::from(!pieces.is_empty()), Ordering::Relaxed);
        for (piece, pause) in pieces {
            if to.write_all(piece).is_err() {
                return;
            }
            thread::sleep(pause);
        }
        if to.write_all(last).is_err() {
            break;
        }
    }
    let _ = to.shutdown(Shutdown::Both);
    let _ = from.shutdown(Shutdown::Both);
}

/// Returns the pieces in which a read is forwarded, each with the pause after it, and the last piece: mostly that alone.
fn split<'a>(mut rest: &'a [u8], rng: &mut fastrand::Rng) -> (Vec<(&'a [u8], Duration)>, &'a [u8]) {
    let mut pieces = Vec::new();
    if rng.f64() < 0.3 {
        while rest.len() > 1 && rng.f64() < 0.7 {
            let (head, tail) = rest.split_at(rng.usize(1..rest.len()));
            pieces.push((head, Duration::from_micros(rng.u64(50..1_000))));
            rest = tail;
        }
    }
    (pieces, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fifth_of_the_reads_is_split_and_no_byte_is_lost() {
        let mut rng = fastrand::Rng::with_seed(1);
        let read: Vec<u8> = (0..100).collect();
        let mut splits = 0;
        for _ in 0..1000 {
            let (pauses, last) = split(&read, &mut rng);
            splits += u32::from(!pauses.is_empty());
            let pieces: Vec<_> = pauses.into_iter().map(|(piece, _)| piece).chain([last]).collect();
            assert!(pieces.concat() == read && pieces.iter().all(|piece| !piece.is_empty()), "{pieces:?}");
            assert_eq!(split(&[7], &mut rng), (vec![], &[7][..]));
        }
        assert!((150..270).contains(&splits), "0.3 * 0.7 of them: {splits}");
    }
}
