//! Polls a ball on a serial port: `cargo run -p isra-ball --features serialport --example poll -- /dev/ttyUSB0`

use core::ops::ControlFlow;

use isra_ball::robot_session::serialport::{self, FlowControl};
use isra_ball::robot_session::{Serial, drive};
use isra_ball::{Host, HostConfig, HostEvent};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: poll PORT")?;
    let config = HostConfig::default();
    // Forces of 17 and 19 are the bytes XON and XOFF: no flow control.
    let port = serialport::new(path, config.baud).flow_control(FlowControl::None).open()?;
    let mut host = Host::new(config)?;
    drive(&mut host, Serial(port), |host, event| {
        match event {
            HostEvent::Packet(packet) => println!("{packet:?} until {:?}", host.live_until()),
            other => println!("{other:?}"),
        }
        ControlFlow::<()>::Continue(())
    })?;
    Ok(())
}
