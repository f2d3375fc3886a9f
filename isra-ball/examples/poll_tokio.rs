//! Polls a ball under tokio: `cargo run -p isra-ball --features tokio --example poll_tokio -- /dev/ttyUSB0`

use core::ops::ControlFlow;

use isra_ball::robot_session::tokio::Driver;
use isra_ball::robot_session::{Session as _, now};
use isra_ball::{Host, HostConfig, HostEvent};
use tokio_serial::SerialPortBuilderExt as _;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: PORT")?;
    let config = HostConfig::default();
    let mut host = Host::new(config)?;
    let mut driver = Driver::new(tokio_serial::new(path, config.baud).open_native_async()?);
    host.handle_connected(now());
    loop {
        // One turn loses nothing when it is dropped: it may be a branch of a `select!`.
        let turn = driver.turn(&mut host, |host, event| {
            match event {
                HostEvent::Packet(packet) => println!("{packet:?} until {:?}", host.live_until()),
                other => println!("{other:?}"),
            }
            ControlFlow::<()>::Continue(())
        });
        if let ControlFlow::Break(ended) = turn.await? {
            println!("{ended:?}");
            return Ok(());
        }
    }
}
