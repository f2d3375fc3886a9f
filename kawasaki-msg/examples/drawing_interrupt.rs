//! The PC's end on a microcontroller: `no_std`, no allocation, two interrupts and no loop of its own. A socket of the PC plays the
//! board: `cargo run -p kawasaki-msg --features std --example drawing_interrupt -- 127.0.0.1:9105`
#![no_std]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "a socket plays the board")]

use core::ops::ControlFlow;
use core::time::Duration;

use kawasaki_msg::robot_session::{Output, Session as _, settle};
use kawasaki_msg::{JobKind, Line, Pc, PcConfig, PcEvent, Point};

/// What both interrupts share: give them one priority, or a lock.
struct Drawing {
    pc: Pc<'static, &'static [Line]>,
    buffer: [u8; 4096],
}

/// The socket, the timer, and a display.
trait Board {
    fn now(&self) -> Duration;
    fn set_alarm(&mut self, at: Option<Duration>);
    fn transmit(&mut self, bytes: &[u8]);
    fn close(&mut self);
    fn show(&mut self, event: &PcEvent);
}

/// A square of 10 mm, in hundredths of a millimetre.
const SQUARE: [Line; 4] = [
    Line { kind: JobKind::Draw, start: Point::new(0, 0), end: Point::new(1000, 0) },
    Line { kind: JobKind::Draw, start: Point::new(1000, 0), end: Point::new(1000, 1000) },
    Line { kind: JobKind::Draw, start: Point::new(1000, 1000), end: Point::new(0, 1000) },
    Line { kind: JobKind::Draw, start: Point::new(0, 1000), end: Point::new(0, 0) },
];

impl Drawing {
    fn new() -> Option<Self> {
        let mut pc = Pc::new(PcConfig::TCP).ok()?;
        pc.start(50, &SQUARE[..]).ok()?;
        Some(Self { pc, buffer: [0; 4096] })
    }

    /// The robot has connected.
    fn connected(&mut self, board: &mut impl Board) {
        self.pc.handle_connected(board.now());
        self.settle(board);
    }

    /// Its connection is gone: the order goes on with the next one.
    fn disconnected(&mut self, board: &mut impl Board) {
        self.pc.handle_disconnected(board.now());
        self.settle(board);
    }

    /// The socket's interrupt: bytes have come.
    fn received(&mut self, board: &mut impl Board, bytes: &[u8]) {
        self.pc.handle_input(board.now(), bytes);
        self.settle(board);
    }

    /// The timer's interrupt.
    fn alarm(&mut self, board: &mut impl Board) {
        self.pc.handle_timeout(board.now());
        self.settle(board);
    }

    fn settle(&mut self, board: &mut impl Board) {
        let _ = settle(&mut self.pc, board.now(), &mut self.buffer, |_, output| {
            match output {
                Output::Transmit(bytes) => board.transmit(bytes),
                Output::Event(PcEvent::Disconnect) => board.close(),
                Output::Event(event) => board.show(&event),
            }
            ControlFlow::<()>::Continue(())
        });
        board.set_alarm(self.pc.poll_timeout());
    }
}

fn main() -> Result<(), std::boxed::Box<dyn core::error::Error>> {
    let mut board = board::Pc::open()?;
    let mut drawing = Drawing::new().ok_or("the defaults cannot work")?;
    let mut buffer = [0; 4096];
    while drawing.pc.order().is_some() {
        board.accept()?;
        drawing.connected(&mut board);
        while drawing.pc.order().is_some() {
            match board.next_interrupt(&mut buffer) {
                Ok(Some(bytes)) => drawing.received(&mut board, bytes),
                Ok(None) => drawing.alarm(&mut board),
                Err(_) => break,
            }
        }
        drawing.disconnected(&mut board);
    }
    std::println!("{} executed", drawing.pc.executed());
    Ok(())
}

extern crate std;

/// A PC as the board: your network chip is here.
mod board {
    use core::time::Duration;
    use std::boxed::Box;
    use std::io::{self, ErrorKind, Read as _, Write as _};
    use std::net::{Shutdown, TcpListener, TcpStream};
    use std::println;

    use kawasaki_msg::PcEvent;
    use kawasaki_msg::robot_session::now;

    pub(super) struct Pc {
        listener: TcpListener,
        socket: Option<TcpStream>,
        alarm: Option<Duration>,
    }

    impl Pc {
        pub(super) fn open() -> Result<Self, Box<dyn core::error::Error>> {
            let address = std::env::args().nth(1).ok_or("usage: HOST:PORT")?;
            Ok(Self { listener: TcpListener::bind(address)?, socket: None, alarm: None })
        }

        pub(super) fn accept(&mut self) -> io::Result<()> {
            let (socket, _) = self.listener.accept()?;
            socket.set_nodelay(true)?;
            self.socket = Some(socket);
            Ok(())
        }

        /// The bytes that have come, or none: the alarm.
        pub(super) fn next_interrupt<'a>(&mut self, buffer: &'a mut [u8]) -> io::Result<Option<&'a [u8]>> {
            let socket = self.socket.as_mut().ok_or(ErrorKind::NotConnected)?;
            let wait = self.alarm.map_or(Duration::from_secs(1), |at| at.saturating_sub(now()));
            socket.set_read_timeout(Some(wait.max(Duration::from_micros(1))))?;
            match socket.read(buffer) {
                Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
                Ok(length) => Ok(buffer.get(..length)),
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(None),
                Err(e) => Err(e),
            }
        }
    }

    impl super::Board for Pc {
        fn now(&self) -> Duration {
            now()
        }

        fn set_alarm(&mut self, at: Option<Duration>) {
            self.alarm = at;
        }

        fn transmit(&mut self, bytes: &[u8]) {
            // A connection that is gone shows when it is read.
            let _ = self.socket.as_mut().map(|socket| socket.write_all(bytes));
        }

        fn close(&mut self) {
            let _ = self.socket.take().map(|socket| socket.shutdown(Shutdown::Both));
        }

        fn show(&mut self, event: &PcEvent) {
            println!("{event:?}");
        }
    }
}
