//! A host under tokio: `cargo run -p val2-alter --features tokio --example to_and_fro_tokio -- /dev/ttyS0`. Moves the tool slowly to and fro.

use core::ops::ControlFlow;

use tokio_serial::SerialPortBuilderExt as _;
use val2_alter::robot_session::tokio::Driver;
use val2_alter::robot_session::{Session as _, now};
use val2_alter::{Host, HostConfig, HostEvent};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: PORT")?;
    let mut driver = Driver::new(tokio_serial::new(path, 38400).open_native_async()?);
    // A busy computer may read apart what came together: no silence ends a frame.
    let config = HostConfig { gap: None, ..HostConfig::default() };
    let mut session = Host::new(config)?;
    session.handle_connected(now());
    loop {
        // One turn loses nothing when it is dropped: it may be a branch of a `select!`.
        let turn = driver.turn(&mut session, |host, event| {
            // 16 units a cycle are 18 mm/s.
            let speed = if (host.statistics().cycles / 100).is_multiple_of(2) { 16 } else { -16 };
            host.set_target(now(), [speed, 0, 0, 0, 0, 0]);
            if !matches!(event, HostEvent::Motion(_)) {
                println!("{:?} {event:?}", now());
            }
            ControlFlow::<()>::Continue(())
        });
        if let ControlFlow::Break(ended) = turn.await? {
            println!("{ended:?}");
            return Ok(());
        }
    }
}
