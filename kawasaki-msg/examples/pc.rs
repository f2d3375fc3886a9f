//! A PC that lets a robot draw a zigzag: `cargo run --features std --example pc`, then `cargo run --features std --example robot`
//! in another terminal.
#![allow(clippy::disallowed_methods, clippy::disallowed_types)]

use core::ops::ControlFlow;
use std::net::TcpListener;

use kawasaki_msg::robot_session::drive;
use kawasaki_msg::{JobKind, Line, Pc, PcConfig, PcEvent, Point, Supply};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let listener = TcpListener::bind("127.0.0.1:9105")?;
    let mut pc = Pc::new(PcConfig::TCP)?;
    pc.start(50, |index| if index < 2000 { Supply::Line(line(index)) } else { Supply::End })?;
    // The order outlives a connection: with the next one it goes on.
    while pc.order().is_some() {
        let (stream, _) = listener.accept()?;
        let ended = drive(&mut pc, stream, |_, event| {
            println!("{event:?}");
            match event {
                PcEvent::Disconnect | PcEvent::OrderOver { .. } | PcEvent::OutcomeUnknown { .. } => {
                    ControlFlow::Break(())
                }
                _ => ControlFlow::Continue(()),
            }
        });
        println!("connection closed: {ended:?}");
    }
    Ok(())
}

/// A zigzag over the board.
fn line(index: u32) -> Line {
    let at = |n: u32| Point::new(10 * n.cast_signed(), 500 * (n % 7).cast_signed());
    Line { kind: JobKind::Draw, start: at(index), end: at(index + 1) }
}
