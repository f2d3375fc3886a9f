//! Polls a ball on a serial port: `cargo run -p isra-ball --features std --example poll -- /dev/ttyUSB0`

use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, ErrorKind, Read as _, Write as _};

use isra_ball::robot_session::{Received, Sent, Transport, Wait, drive};
use isra_ball::{Host, HostConfig, HostEvent};
use serialport::{FlowControl, SerialPort};

struct Port(Box<dyn SerialPort>);

impl Transport for Port {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        self.0.set_timeout(wait.limit.unwrap_or(Duration::MAX))?;
        match self.0.read(buffer) {
            Ok(length) => Ok(Received::Bytes(length)),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                Ok(Received::Nothing)
            }
            Err(e) => Err(e),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        self.0.write_all(bytes).map(|()| Sent::Buffered)
    }
}

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: poll PORT")?;
    let config = HostConfig::default();
    // Forces of 17 and 19 are the bytes XON and XOFF: no flow control.
    let port = serialport::new(path, config.baud).flow_control(FlowControl::None).open()?;
    let mut host = Host::new(config)?;
    drive(&mut host, Port(port), |host, event| {
        match event {
            HostEvent::Packet(packet) => println!("{packet:?} until {:?}", host.live_until()),
            other => println!("{other:?}"),
        }
        ControlFlow::<()>::Continue(())
    })?;
    Ok(())
}
