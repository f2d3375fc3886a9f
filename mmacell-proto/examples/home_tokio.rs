//! Asks a robot for its status under tokio: `cargo run -p mmacell-proto --features tokio --example home_tokio -- 192.168.0.1:2001`
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the program has the socket")]

use core::ops::ControlFlow;

use mmacell_proto::robot_session::tokio::Driver;
use mmacell_proto::robot_session::{Session as _, now};
use mmacell_proto::{Central, CentralConfig, Command, RobotPose};
use tokio::net::TcpStream;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: HOST:PORT")?;
    let socket = TcpStream::connect(address).await?;
    socket.set_nodelay(true)?;
    let mut driver = Driver::new(socket);
    let mut session = Central::<RobotPose>::new(CentralConfig::DEFAULT)?;
    session.handle_connected(now());
    loop {
        // One turn loses nothing when it is dropped: it may be a branch of a `select!`.
        let turn = driver.turn(&mut session, |central, event| {
            println!("{event:?}");
            if let Err(error) = central.request(Command::Status) {
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
