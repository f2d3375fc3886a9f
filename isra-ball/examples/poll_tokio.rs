//! Prints the values of a ball, as long as they are new: `cargo run -p isra-ball --features tokio-serial --example
//! poll_tokio -- /dev/ttyUSB0`

use isra_ball::HostConfig;
use isra_ball::robot_session::tokio::{Serial, tokio_serial};
use isra_ball::tokio::host;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let path = std::env::args().nth(1).ok_or("usage: PORT")?;
    let config = HostConfig::default();
    let port = Serial(tokio_serial::new(path, config.baud));
    let (mut ball, task) = host(config, port)?;
    tokio::spawn(task.run());
    loop {
        match ball.values.next().await? {
            Some(packet) => println!("steer: {packet:?}"),
            None => println!("stop"),
        }
    }
}
