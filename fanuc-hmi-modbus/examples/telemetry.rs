//! Prints the telemetry block of a robot: `cargo run -p fanuc-hmi-modbus --example telemetry -- 192.168.0.10:502`
#![allow(
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "the driver loop has the clock and the socket"
)]

use core::time::Duration;
use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::Instant;

use fanuc_hmi_modbus::client::{Client, Config, Event};
use fanuc_hmi_modbus::typed::OrderProbe;
use fanuc_hmi_modbus::{Reply, TelemetryBlock, WordOrder};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: telemetry HOST:PORT")?;
    let mut socket = TcpStream::connect(address)?;
    socket.set_nodelay(true)?;
    let mut client: Client = Client::new(Config::tcp());
    let mut probe = OrderProbe::default();
    let epoch = Instant::now();
    let mut buf = [0; 512];
    client.request(1, &TelemetryBlock::request())?;
    loop {
        while let Some(n) = client.poll_transmit(epoch.elapsed(), &mut buf) {
            socket.write_all(buf.get(..n).unwrap_or_default())?;
        }
        let due = client.poll_timeout().unwrap_or_default();
        let wait = due.saturating_sub(epoch.elapsed()).max(Duration::from_millis(1));
        socket.set_read_timeout(Some(wait))?;
        match socket.read(&mut buf) {
            Ok(0) => return Err("the robot closed the connection".into()),
            Ok(n) => drop(client.handle_input(epoch.elapsed(), buf.get(..n).unwrap_or_default())),
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(e) => return Err(e.into()),
        }
        client.handle_timeout(epoch.elapsed());
        let mut ended = false;
        while let Some(event) = client.poll_event() {
            ended |= matches!(event, Event::Reply { .. } | Event::Failed { .. });
            let Event::Reply { reply: Reply::HoldingRegisters(words), .. } = event else {
                eprintln!("{event:?}");
                continue;
            };
            let order =
                words.first_chunk().and_then(|counter| probe.watch(counter)).unwrap_or(WordOrder::LowFirst);
            println!("{:?}", TelemetryBlock::from_words(&words, order));
        }
        if ended {
            client.request(1, &TelemetryBlock::request())?;
        }
    }
}
