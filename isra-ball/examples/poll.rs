//! Polls a ball on a serial port: `cargo run -p isra-ball --example poll -- /dev/ttyUSB0`

use core::time::Duration;
use std::io::{ErrorKind, Read, Write};
use std::time::Instant;

use isra_ball::{Config, Host, HostEvent, KeyEdges};
use serialport::FlowControl;

#[allow(clippy::disallowed_methods, reason = "the driver loop is where the clock is")]
fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: poll PORT")?;
    let config = Config::default();
    // Forces of 17 and 19 are the bytes XON and XOFF: no flow control.
    let mut port = serialport::new(path, config.baud).flow_control(FlowControl::None).open()?;
    let mut host = Host::new(config)?;
    let mut keys = KeyEdges::new();
    let epoch = Instant::now();
    let mut buf = [0; 64];
    loop {
        while let Some(n) = host.poll_transmit(epoch.elapsed(), &mut buf) {
            port.write_all(buf.get(..n).unwrap_or_default())?;
        }
        while let Some(event) = host.poll_event() {
            match event {
                HostEvent::Packet(packet) => {
                    println!("{packet:?} pressed {:?}", keys.update(packet.keys).pressed);
                }
                other => println!("{other:?}"),
            }
        }
        let due = host.poll_timeout().unwrap_or_default();
        let wait = due.saturating_sub(epoch.elapsed()).max(Duration::from_millis(1));
        port.set_timeout(wait)?;
        match port.read(&mut buf) {
            Ok(n) => host.handle_input(epoch.elapsed(), buf.get(..n).unwrap_or_default()),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(e) => return Err(e.into()),
        }
        host.handle_timeout(epoch.elapsed());
    }
}
