//! A host on a serial port: `stty -F /dev/ttyS0 38400 raw -echo`, then `host /dev/ttyS0`. Moves the tool slowly to and fro.
#![allow(clippy::indexing_slicing)]

use core::time::Duration;
use std::fs::File;
use std::io::{Read, Write};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Instant;

use val2_alter::{Host, HostConfig, HostEvent};

fn main() -> std::io::Result<()> {
    let path = std::env::args().nth(1).unwrap_or("/dev/ttyS0".into());
    let mut port = File::options().read(true).write(true).open(path)?;
    let mut reader = port.try_clone()?;
    #[expect(clippy::disallowed_methods, reason = "the driver owns the clock, not the crate")]
    let epoch = Instant::now();

    // A thread of its own for the line: what arrives is stamped at once.
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let mut buffer = [0; 256];
        while let Ok(len @ 1..) = reader.read(&mut buffer) {
            if sender.send((epoch.elapsed(), buffer[..len].to_vec())).is_err() {
                break;
            }
        }
    });

    let mut host = Host::new(HostConfig::default());
    let mut out = [0; Host::MAX_TRANSMIT];
    loop {
        let wait =
            host.poll_timeout().map_or(Duration::from_secs(1), |at| at.saturating_sub(epoch.elapsed()));
        match receiver.recv_timeout(wait) {
            Ok((arrived, bytes)) => host.handle_input(arrived, &bytes),
            Err(RecvTimeoutError::Timeout) => host.handle_timeout(epoch.elapsed()),
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
        // 16 units a cycle are 18 mm/s.
        let speed = if (host.stats().cycles / 100).is_multiple_of(2) { 16 } else { -16 };
        host.set_target([speed, 0, 0, 0, 0, 0]);
        if let Some(len) = host.poll_transmit(epoch.elapsed(), &mut out) {
            port.write_all(&out[..len])?;
        }
        while let Some(event) = host.poll_event() {
            if !matches!(event, HostEvent::Motion(_)) {
                println!("{:?} {event:?}", epoch.elapsed());
            }
        }
    }
}
