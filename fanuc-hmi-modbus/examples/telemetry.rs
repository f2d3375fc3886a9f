//! Prints the telemetry block of a robot ten times a second: `cargo run -p fanuc-hmi-modbus --features std --example
//! telemetry -- 192.168.0.10:502`
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "the program has the socket, and time"
)]

use core::convert::Infallible;
use core::ops::ControlFlow;
use core::time::Duration;
use std::net::TcpStream;

use fanuc_hmi_modbus::robot_session::drive;
use fanuc_hmi_modbus::typed::OrderProbe;
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, Reply, TelemetryBlock, WordOrder};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: telemetry HOST:PORT")?;
    let socket = TcpStream::connect(address)?;
    socket.set_nodelay(true)?;
    let mut client = Client::<1>::new(ClientConfig::tcp())?;
    let mut probe = OrderProbe::default();
    client.request(1, &TelemetryBlock::request())?;
    drive(&mut client, socket, |client, event| -> ControlFlow<Infallible> {
        match event {
            ClientEvent::Replied { ticket, .. } => match client.reply(ticket) {
                Some(Reply::HoldingRegisters(words)) => {
                    let order = words.first_chunk().and_then(|counter| probe.watch(counter));
                    println!(
                        "{:?}",
                        TelemetryBlock::from_words(&words, order.unwrap_or(WordOrder::LowFirst))
                    );
                }
                other => println!("{other:?}"),
            },
            event => eprintln!("{event:?}"),
        }
        if event.outcome_of().is_some() {
            std::thread::sleep(Duration::from_millis(100)); // nothing else is to be done meanwhile
            if let Err(error) = client.request(1, &TelemetryBlock::request()) {
                eprintln!("{error}");
            }
        }
        ControlFlow::Continue(())
    })?;
    Err("the robot closed the connection".into())
}
