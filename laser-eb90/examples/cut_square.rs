//! Cuts a square over a serial line: `cargo run --features std --example cut_square /dev/ttyUSB0`, the port set to raw 9600 8N1
//! before (`stty -F /dev/ttyUSB0 raw -echo 9600`). A simulator to try it on: `cellwire simulate laser --pty /tmp/laser`.

use core::ops::ControlFlow;
use core::time::Duration;
use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::sync::mpsc::{Receiver, channel};

use laser_eb90::robot_session::{Ended, Received, Sent, Transport, Wait, drive};
use laser_eb90::{Host, HostConfig, HostEvent, SessionError};

/// A straight cut to X, Y: interpreted, so it is queued.
const LINE: u16 = 0x0101;
const CORNERS: [[f32; 2]; 5] = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 0.0]];

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("give the serial port")?;
    let mut host = Host::new(HostConfig::default())?;
    submit(&mut host, 0)?;
    let ended = drive(&mut host, Port::open(&path)?, |host, event| match event {
        HostEvent::Done { first, count, .. } => {
            let next = first + u64::from(count);
            println!("{next} of {} corners are queued", CORNERS.len());
            match submit(host, usize::try_from(next).unwrap_or(CORNERS.len())) {
                Ok(0) if host.is_idle() => ControlFlow::Break(Ok(())),
                Ok(_) => ControlFlow::Continue(()),
                Err(error) => ControlFlow::Break(Err(error.to_string())),
            }
        }
        HostEvent::Corrupt(_) | HostEvent::Unasked { .. } => ControlFlow::Continue(()),
        other => ControlFlow::Break(Err(format!("look at the robot first: {other:?}"))),
    })?;
    match ended {
        Ended::ByHandler(result) => Ok(result?),
        Ended::ByPeer => Err("the port is gone".into()),
    }
}

/// Submits what fits into the next frame; returns how many corners.
fn submit(host: &mut Host, from: usize) -> Result<usize, SessionError> {
    for (count, corner) in CORNERS.iter().skip(from).enumerate() {
        match host.submit(LINE, |parameters| parameters.f32(corner).map(drop)) {
            Ok(_) => {}
            Err(SessionError::Full) => return Ok(count),
            Err(error) => return Err(error),
        }
    }
    Ok(CORNERS.len().saturating_sub(from))
}

/// A port that a thread reads: a file has no read with a deadline.
struct Port {
    port: File,
    received: Receiver<Vec<u8>>,
}

impl Port {
    fn open(path: &str) -> io::Result<Self> {
        let port = OpenOptions::new().read(true).write(true).open(path)?;
        let (mut reader, (sender, received)) = (port.try_clone()?, channel());
        std::thread::spawn(move || {
            let mut bytes = [0; 256];
            while let Ok(length @ 1..) = reader.read(&mut bytes) {
                if sender.send(bytes.get(..length).unwrap_or_default().to_vec()).is_err() {
                    return;
                }
            }
        });
        Ok(Self { port, received })
    }
}

impl Transport for Port {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        let Ok(bytes) = self.received.recv_timeout(wait.limit.unwrap_or(Duration::from_secs(3600))) else {
            return Ok(Received::Nothing);
        };
        buffer.get_mut(..bytes.len()).unwrap_or_default().copy_from_slice(&bytes);
        Ok(Received::Bytes(bytes.len()))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.port.write_all(bytes).map(|()| Sent::Buffered)
    }
}
