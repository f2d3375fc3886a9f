//! Asks a laser robot for its state under tokio: `cargo run -p laser-eb90 --features tokio --example cut_square_tokio -- /dev/ttyUSB0`

use core::ops::ControlFlow;

use laser_eb90::robot_session::tokio::Driver;
use laser_eb90::robot_session::{Session as _, now};
use laser_eb90::{Host, HostConfig, HostEvent};
use tokio_serial::SerialPortBuilderExt as _;

/// A query.
const STATE: u16 = 0x0301;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: PORT")?;
    let mut driver = Driver::new(tokio_serial::new(path, 9600).open_native_async()?);
    let mut session = Host::new(HostConfig::default())?;
    session.handle_connected(now());
    session.submit(STATE, |_| Ok(()))?;
    loop {
        // One turn loses nothing when it is dropped: it may be a branch of a `select!`.
        let turn = driver.turn(&mut session, |host, event| {
            println!("{event:?}");
            if matches!(event, HostEvent::Answer { .. })
                && let Err(error) = host.submit(STATE, |_| Ok(()))
            {
                println!("{error}");
            }
            ControlFlow::<()>::Continue(())
        });
        if let ControlFlow::Break(ended) = turn.await? {
            println!("{ended:?}");
            return Ok(());
        }
    }
}
