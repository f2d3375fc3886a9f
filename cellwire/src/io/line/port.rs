//! Reads from a port.

use std::io::{ErrorKind, Read};
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use serialport::SerialPort;

use super::{CHUNK, Feed};

/// Forwards what clients write, with the time at which it was read, until the line is dropped. When it is not taken, the client waits.
pub(super) fn read(mut port: Box<dyn SerialPort>, feed: &Feed) {
    let mut buffer = [0; CHUNK];
    while feed.is_wanted() {
        match port.read(&mut buffer) {
            Ok(n) => {
                feed.connect(true);
                let bytes = buffer.get(..n).unwrap_or_default().to_vec();
                feed.client.under_way.fetch_add(1, Ordering::Relaxed);
                if feed.sender.send((feed.clock.now(), bytes, 0)).is_err() {
                    return;
                }
            }
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
                feed.connect(true);
            }
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            // No client has the other end open.
            Err(_) => {
                feed.connect(false);
                thread::sleep(Duration::from_millis(5));
            }
        }
    }
}
