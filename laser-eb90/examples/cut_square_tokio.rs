//! Cuts a square, then asks for the robot's state: `cargo run -p laser-eb90 --features tokio-serial --example
//! cut_square_tokio -- /dev/ttyUSB0`

use laser_eb90::HostConfig;
use laser_eb90::robot_session::tokio::{Serial, tokio_serial};
use laser_eb90::tokio::{Command, host};

/// A straight cut to X, Y: interpreted, so it is queued.
const LINE: u16 = 0x0101;
/// A query.
const STATE: u16 = 0x0301;
const CORNERS: [[f32; 2]; 5] = [[0.0, 0.0], [100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 0.0]];

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: PORT")?;
    let config = HostConfig::default();
    let port = Serial(tokio_serial::new(path, config.baud));
    let (laser, task) = host(config, port)?;
    tokio::spawn(task.run());
    let cuts = CORNERS.map(|corner| Command::new(LINE, move |parameters| parameters.f32(&corner).map(drop)));
    // An error says how many are queued, and how many unknown: look at the sheet before sending the others.
    laser.run(cuts).await?;
    println!("{} corners are queued", CORNERS.len());
    for item in laser.query(Command::bare(STATE)).await?.items() {
        println!("{item:?}");
    }
    Ok(())
}
