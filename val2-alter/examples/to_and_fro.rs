//! A host on a serial port: `cargo run -p val2-alter --features serialport --example to_and_fro -- /dev/ttyS0`. Moves the
//! tool slowly to and fro. Each reply that is lost shifts the path, and nothing bounds it; a program that is ended leaves
//! the stop to the controller. The handle has a reach and a stop: `to_and_fro_tokio`.

use core::ops::ControlFlow;

use val2_alter::robot_session::{Serial, Session as _, drive, now, serialport};
use val2_alter::{Host, HostConfig, HostEvent, timing};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or("/dev/ttyS0".into());
    // A busy computer may read contiguous bytes with pauses: no silence ends a frame.
    let config = HostConfig { gap: None, ..HostConfig::default() };
    let port = serialport::new(path, timing::BAUD).open()?;
    let mut host = Host::new(config)?;
    drive(&mut host, Serial(port), |host, event| {
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
