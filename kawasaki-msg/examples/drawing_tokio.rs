//! A PC lets a robot draw a line of 100 pieces under tokio:
//! `cargo run -p kawasaki-msg --features tokio --example drawing_tokio -- 127.0.0.1:9105`
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "the program has the socket")]

use core::ops::ControlFlow;

use kawasaki_msg::robot_session::tokio::Driver;
use kawasaki_msg::robot_session::{Session as _, now};
use kawasaki_msg::{JobKind, Line, Pc, PcConfig, PcEvent, Point};
use tokio::net::TcpListener;

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Box<dyn core::error::Error>> {
    let address = std::env::args().nth(1).ok_or("usage: HOST:PORT")?;
    let listener = TcpListener::bind(address).await?;
    let jobs: Vec<Line> = (0..100)
        .map(|n| Line { kind: JobKind::Draw, start: Point::new(n, 0), end: Point::new(n + 1, 0) })
        .collect();
    let mut pc = Pc::new(PcConfig::TCP)?;
    pc.start(50, &jobs[..])?;
    // The order outlives a connection: with the next one it goes on.
    while pc.order().is_some() {
        let mut driver = Driver::new(listener.accept().await?.0);
        pc.handle_connected(now());
        loop {
            let turn = driver.turn(&mut pc, |_, event| match event {
                PcEvent::Disconnect | PcEvent::OrderOver { .. } | PcEvent::OutcomeUnknown { .. } => {
                    ControlFlow::Break(())
                }
                event => {
                    println!("{event:?}");
                    ControlFlow::Continue(())
                }
            });
            // A connection that broke is no end of the order.
            if !matches!(turn.await, Ok(ControlFlow::Continue(()))) {
                break;
            }
        }
        pc.handle_disconnected(now());
    }
    println!("{} executed", pc.executed());
    Ok(())
}
