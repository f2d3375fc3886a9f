//! Reads from a port.

use std::io::{ErrorKind, Read};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use serialport::SerialPort;

use super::{CARRIED, CHUNK, Feed};
use cellwire_io::serial;

/// A client that opens the other end is looked for this often.
const CLIENT_CHECK_INTERVAL: Duration = Duration::from_millis(5);

/// Forwards the bytes of clients, with the time of each read, until the line is dropped. If the bytes are not accepted, the
/// client waits.
pub(super) fn read(mut port: Box<dyn SerialPort>, path: &Path, feed: &Feed) {
    let mut buffer = [0; CHUNK];
    // After the client has closed its end: the time until which its bytes are carried.
    let mut closed: Option<Duration> = None;
    while feed.is_wanted() {
        if feed.is_ended() {
            closed = None;
            feed.leave();
        }
        let read = port.read(&mut buffer);
        let is_open = match &read {
            Ok(_) => true,
            Err(error) => matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock),
        };
        if let Some(at) = closed {
            let is_carried = feed.client.under_way.load(Ordering::Relaxed) == 0;
            if is_open || is_carried || feed.clock.now().saturating_sub(at) >= CARRIED {
                closed = None;
                feed.leave();
                serial::discard(path);
            }
        }
        match read {
            Ok(length) => {
                feed.connect(true);
                let bytes = buffer.get(..length).unwrap_or_default().to_vec();
                let left = feed.client.left.load(Ordering::Relaxed);
                feed.client.under_way.fetch_add(1, Ordering::Relaxed);
                if feed.sender.send((feed.clock.now(), bytes, left)).is_err() {
                    return;
                }
            }
            Err(_) if is_open => feed.connect(true),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            // No client has the other end open.
            Err(_) => {
                if closed.is_none() && feed.client.is_connected.load(Ordering::Relaxed) {
                    feed.client.is_deaf.store(true, Ordering::Relaxed);
                    closed = Some(feed.clock.now());
                }
                thread::sleep(CLIENT_CHECK_INTERVAL);
            }
        }
    }
}
