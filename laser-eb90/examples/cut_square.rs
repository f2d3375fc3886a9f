//! Cuts a square over a serial line: `cargo run --example cut_square /dev/ttyUSB0`, the port set to raw 9600 8N1 before
//! (`stty -F /dev/ttyUSB0 raw -echo 9600`). A simulator to try it on: `cellwire simulate laser --pty /tmp/laser`.

#![allow(clippy::disallowed_methods, clippy::indexing_slicing, reason = "the driver owns clock and port")]

use core::time::Duration;
use std::fs::OpenOptions;
use std::io::{Read, Write};
use std::sync::mpsc;
use std::time::Instant;

use laser_eb90::{Frame, Host, HostConfig, HostEvent, SessionError};

/// A straight cut to X, Y: interpreted, so it is queued.
const LINE: u16 = 0x0101;

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("give the serial port")?;
    let mut port = OpenOptions::new().read(true).write(true).open(path)?;
    let (sender, heard) = mpsc::channel();
    let mut reader = port.try_clone()?;
    std::thread::spawn(move || {
        let mut bytes = [0; 256];
        while let Ok(n @ 1..) = reader.read(&mut bytes) {
            drop(sender.send(bytes[..n].to_vec()));
        }
    });

    let mut corners = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 0.0]].iter().peekable();
    let mut host = Host::new(HostConfig::default());
    let start = Instant::now();
    let mut frame = [0; Frame::MAX_LEN];
    while corners.peek().is_some() || !host.is_idle() {
        while let Some(corner) = corners.peek() {
            match host.submit(LINE, |parameters| parameters.f32(&corner[..]).map(drop)) {
                Ok(_) => corners.next(),
                Err(SessionError::Full) => break,
                Err(error) => return Err(error.into()),
            };
        }
        while let Some(event) = host.poll_event() {
            match event {
                HostEvent::Done { first, count, .. } => {
                    println!("{count} corners from {first} on are queued")
                }
                other => return Err(format!("look at the robot first: {other:?}").into()),
            }
        }
        if let Some(n) = host.poll_transmit(start.elapsed(), &mut frame) {
            port.write_all(&frame[..n])?;
        }
        let wait = host.poll_timeout().map_or(Duration::ZERO, |at| at.saturating_sub(start.elapsed()));
        match heard.recv_timeout(wait) {
            Ok(bytes) => host.handle_input(start.elapsed(), &bytes),
            Err(_) => host.handle_timeout(start.elapsed()),
        }
    }
    Ok(())
}
