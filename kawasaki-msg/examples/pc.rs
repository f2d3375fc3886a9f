//! A PC that lets a robot draw a zigzag: `cargo run --example pc`, then `cargo run --example robot` in another terminal.
#![allow(clippy::disallowed_methods, clippy::disallowed_types, clippy::indexing_slicing, clippy::unwrap_used)]

use core::time::Duration;
use std::io::{Error, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Instant;

use kawasaki_msg::{JobKind, JobSource, Line, Pc, PcConfig, PcEvent, Point, Supply};

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let listener = TcpListener::bind("127.0.0.1:9105")?;
    let (mut pc, epoch) = (Pc::new(PcConfig::TCP)?, Instant::now());
    pc.start(50, |index| if index < 2000 { Supply::Line(line(index)) } else { Supply::End })?;
    // The order outlives a connection: with the next one it goes on.
    while pc.order().is_some() {
        let (stream, _) = listener.accept()?;
        pc.handle_connected(epoch.elapsed());
        println!("connection closed: {:?}", serve(&mut pc, stream, epoch));
        pc.handle_closed(epoch.elapsed());
    }
    Ok(())
}

fn serve<S: JobSource>(pc: &mut Pc<S>, mut stream: TcpStream, epoch: Instant) -> Result<(), Error> {
    stream.set_read_timeout(Some(Duration::from_millis(2)))?;
    let mut buffer = [0; 4096];
    loop {
        pc.handle_timeout(epoch.elapsed());
        while let Some(event) = pc.poll_event() {
            println!("{event:?}");
            match event {
                PcEvent::Disconnect => return Err(ErrorKind::TimedOut.into()),
                PcEvent::OrderOver { .. } | PcEvent::OutcomeUnknown { .. } => return Ok(()),
                _ => {}
            }
        }
        while let Some(length) = pc.poll_transmit(epoch.elapsed(), &mut buffer) {
            stream.write_all(&buffer[..length])?;
        }
        let until = pc.poll_timeout().unwrap_or(epoch.elapsed() + Duration::from_secs(1));
        stream
            .set_read_timeout(Some((until.saturating_sub(epoch.elapsed())).max(Duration::from_millis(1))))?;
        match stream.read(&mut buffer) {
            Ok(0) => return Err(ErrorKind::UnexpectedEof.into()),
            Ok(length) => pc.handle_input(epoch.elapsed(), &buffer[..length]),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error),
        }
    }
}

/// A zigzag over the board.
fn line(index: u32) -> Line {
    let at = |n: u32| Point::new(10 * n.cast_signed(), 500 * (n % 7).cast_signed());
    Line { kind: JobKind::Draw, start: at(index), end: at(index + 1) }
}
