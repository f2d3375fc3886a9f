//! Answers a workstation under tokio: `cargo run -p val2-viewer --features tokio-serial --example pose_tokio -- /dev/ttyUSB0`

use core::ops::ControlFlow;

use val2_viewer::robot_session::tokio::Driver;
use val2_viewer::robot_session::tokio::tokio_serial::{self, SerialPortBuilderExt as _};
use val2_viewer::robot_session::{Session as _, now};
use val2_viewer::{Host, HostConfig, timing};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: PORT")?;
    let mut driver = Driver::new(tokio_serial::new(path, timing::BAUD).open_native_async()?);
    let mut session = Host::new(HostConfig::default())?;
    session.handle_connected(now());
    session.set_pose(now(), [16384, 0, 0, 0, 16384, 0, 0, 0, 16384, 3200, 0, 16000]);
    loop {
        // One turn loses nothing when it is dropped: it may be a branch of a `select!`.
        let turn = driver.turn(&mut session, |_, event| {
            println!("{event:?}");
            ControlFlow::<()>::Continue(())
        });
        if let ControlFlow::Break(ended) = turn.await? {
            println!("{ended:?}");
            return Ok(());
        }
    }
}
