//! Prints the telemetry block of a robot ten times a second under tokio:
//! `cargo run -p fanuc-hmi-modbus --features tokio --example telemetry_tokio -- 192.168.0.10:502`
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the program has the socket")]

use core::ops::ControlFlow;
use core::time::Duration;

use fanuc_hmi_modbus::robot_session::tokio::Driver;
use fanuc_hmi_modbus::robot_session::{Session as _, now};
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, Reply, TelemetryBlock, WordOrder};
use tokio::net::TcpStream;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: HOST:PORT")?;
    let socket = TcpStream::connect(address).await?;
    socket.set_nodelay(true)?;
    let mut driver = Driver::new(socket);
    let mut session = Client::<1>::new(ClientConfig::tcp())?;
    session.handle_connected(now());
    session.request(1, &TelemetryBlock::request())?;
    let mut is_answered = false;
    loop {
        // One turn loses nothing when it is dropped: it may be a branch of a `select!`.
        let turn = driver.turn(&mut session, |client, event| {
            match event {
                ClientEvent::Replied { ticket, .. } => match client.reply(ticket) {
                    Some(Reply::HoldingRegisters(words)) => {
                        println!("{:?}", TelemetryBlock::from_words(&words, WordOrder::LowFirst));
                    }
                    other => println!("{other:?}"),
                },
                event => println!("{event:?}"),
            }
            is_answered |= event.outcome_of().is_some();
            ControlFlow::<()>::Continue(())
        });
        if let ControlFlow::Break(ended) = turn.await? {
            println!("{ended:?}");
            return Ok(());
        }
        if core::mem::take(&mut is_answered) {
            tokio::time::sleep(Duration::from_millis(100)).await;
            session.request(1, &TelemetryBlock::request())?;
        }
    }
}
