//! Answers a workstation on a serial port: `cargo run -p val2-viewer --features std --example pose -- /dev/ttyUSB0`

use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{self, ErrorKind, Read as _, Write as _};

use serialport::{FlowControl, SerialPort};
use val2_viewer::robot_session::{Driver, Received, Sent, Session as _, Transport, Wait, now};
use val2_viewer::{Host, HostConfig, timing};

/// A new pose comes every 28 ms, as from ALTER.
const POSES: Duration = Duration::from_millis(28);

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
    let path = std::env::args().nth(1).ok_or("usage: pose PORT")?;
    let port = serialport::new(path, timing::BAUD).flow_control(FlowControl::Software).open()?;
    let mut host = Host::new(HostConfig::default())?;
    let mut driver = Driver::new(Port(port));
    host.handle_connected(now());
    let mut step: i16 = 0;
    loop {
        // The arm goes to and fro by 100 mm.
        step = (step + 1) % 200;
        let x = 32 * (step - 100).abs();
        host.set_pose(now(), [16384, 0, 0, 0, 16384, 0, 0, 0, 16384, x, 0, 500 * 32]);
        // One turn of `robot_session::drive`, which sets no poses between.
        let turn = driver.turn(&mut host, Some(POSES), |_, event| {
            println!("{event:?}");
            ControlFlow::<()>::Continue(())
        })?;
        if turn.is_break() {
            return Ok(());
        }
    }
}
