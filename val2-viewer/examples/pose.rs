//! Answers a workstation on a serial port: `cargo run -p val2-viewer --features serialport --example pose -- /dev/ttyUSB0`

use core::ops::ControlFlow;
use core::time::Duration;

use val2_viewer::robot_session::serialport::{self, FlowControl};
use val2_viewer::robot_session::{Driver, Serial, Session as _, now};
use val2_viewer::{Host, HostConfig, timing};

/// A new pose comes every 28 ms, as from ALTER.
const POSES: Duration = Duration::from_millis(28);

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: pose PORT")?;
    let port = serialport::new(path, timing::BAUD).flow_control(FlowControl::Software).open()?;
    let mut host = Host::new(HostConfig::default())?;
    let mut driver = Driver::new(Serial(port));
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
