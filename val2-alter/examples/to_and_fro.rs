//! A host on a serial port: `stty -F /dev/ttyS0 38400 raw -echo`, then `host /dev/ttyS0`. Moves the tool slowly to and fro.

use core::ops::ControlFlow;
use core::time::Duration;
use std::fs::File;
use std::io::{self, Read, Write};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError};

use val2_alter::robot_session::{Received, Sent, Session as _, Transport, Wait, drive, now};
use val2_alter::{Host, HostConfig, HostEvent};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or("/dev/ttyS0".into());
    // A busy computer may read apart what came together: no silence ends a frame.
    let config = HostConfig { gap: None, ..HostConfig::default() };
    let mut host = Host::new(config)?;
    drive(&mut host, Port::open(&path)?, |host, event| {
        // 16 units a cycle are 18 mm/s.
        let speed = if (host.statistics().cycles / 100).is_multiple_of(2) { 16 } else { -16 };
        host.set_target(now(), [speed, 0, 0, 0, 0, 0]);
        if !matches!(event, HostEvent::Motion(_)) {
            println!("{:?} {event:?}", now());
        }
        ControlFlow::<()>::Continue(())
    })?;
    Ok(())
}

/// A port that is read by a thread of its own: a file cannot be read with a deadline.
struct Port {
    port: File,
    bytes: Receiver<Vec<u8>>,
}

impl Port {
    fn open(path: &str) -> io::Result<Self> {
        let port = File::options().read(true).write(true).open(path)?;
        let (mut reader, (sender, bytes)) = (port.try_clone()?, mpsc::channel());
        std::thread::spawn(move || {
            let mut buffer = [0; 256];
            while let Ok(len @ 1..) = reader.read(&mut buffer) {
                if sender.send(buffer.get(..len).unwrap_or_default().to_vec()).is_err() {
                    break;
                }
            }
        });
        Ok(Self { port, bytes })
    }
}

impl Transport for Port {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        match self.bytes.recv_timeout(wait.limit.unwrap_or(Duration::from_secs(1))) {
            Ok(bytes) => (&bytes[..]).read(buffer).map(Received::Bytes),
            Err(RecvTimeoutError::Timeout) => Ok(Received::Nothing),
            Err(RecvTimeoutError::Disconnected) => Ok(Received::Closed),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.port.write_all(bytes).map(|()| Sent::Buffered)
    }
}
