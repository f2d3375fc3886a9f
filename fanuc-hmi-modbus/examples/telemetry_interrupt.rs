//! The telemetry of a robot on a microcontroller: `no_std`, no allocation, two interrupts and no loop of its own. A socket of the PC
//! plays the board: `cargo run -p fanuc-hmi-modbus --features std --example telemetry_interrupt -- 192.168.0.10:502`
#![no_std]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "a socket plays the board")]
use core::ops::ControlFlow;
use core::time::Duration;

use fanuc_hmi_modbus::robot_session::{Output, Session as _, settle};
use fanuc_hmi_modbus::{Client, ClientConfig, ClientEvent, ConfigError, Reply, TelemetryBlock, WordOrder};

/// What both interrupts share: give them one priority, or a lock.
struct Watcher {
    client: Client<1>,
    buffer: [u8; Client::<1>::MAX_TRANSMIT],
}

/// The socket, the timer, and a display.
trait Board {
    fn now(&self) -> Duration;
    fn set_alarm(&mut self, at: Option<Duration>);
    fn transmit(&mut self, bytes: &[u8]);
    fn show(&mut self, block: &TelemetryBlock);
    fn failed(&mut self, event: &ClientEvent);
}

impl Watcher {
    fn new(now: Duration) -> Result<Self, ConfigError> {
        let mut client = Client::<1>::new(ClientConfig::tcp())?;
        client.handle_connected(now);
        Ok(Self { client, buffer: [0; Client::<1>::MAX_TRANSMIT] })
    }

    /// The socket's interrupt: bytes have come.
    fn received(&mut self, board: &mut impl Board, bytes: &[u8]) {
        self.client.handle_input(board.now(), bytes);
        self.settle(board);
    }

    /// The timer's interrupt, and once at the beginning.
    fn alarm(&mut self, board: &mut impl Board) {
        self.client.handle_timeout(board.now());
        self.settle(board);
    }

    fn settle(&mut self, board: &mut impl Board) {
        let now = board.now();
        if self.client.in_flight() == 0 {
            // Between two requests of one in flight there is always room.
            let _ = self.client.request(1, &TelemetryBlock::request());
        }
        let _ = settle(&mut self.client, now, &mut self.buffer, |client, output| {
            match output {
                Output::Transmit(bytes) => board.transmit(bytes),
                Output::Event(ClientEvent::Replied { ticket, .. }) => {
                    if let Some(Reply::HoldingRegisters(words)) = client.reply(ticket)
                        && let Some(block) = TelemetryBlock::from_words(&words, WordOrder::LowFirst)
                    {
                        board.show(&block);
                    }
                }
                Output::Event(event) => board.failed(&event),
            }
            ControlFlow::<()>::Continue(())
        });
        board.set_alarm(self.client.poll_timeout());
    }
}

fn main() -> Result<(), std::boxed::Box<dyn core::error::Error>> {
    let mut board = board::Pc::open()?;
    let mut watcher = Watcher::new(board.now())?;
    watcher.alarm(&mut board);
    let mut buffer = [0; 512];
    loop {
        match board.next_interrupt(&mut buffer)? {
            Some(bytes) => watcher.received(&mut board, bytes),
            None => watcher.alarm(&mut board),
        }
    }
}

extern crate std;

/// A PC as the board: your network chip is here.
mod board {
    use core::time::Duration;
    use std::boxed::Box;
    use std::io::{self, ErrorKind, Read as _, Write as _};
    use std::net::TcpStream;
    use std::println;

    use fanuc_hmi_modbus::robot_session::now;
    use fanuc_hmi_modbus::{ClientEvent, TelemetryBlock};

    pub(super) struct Pc {
        socket: TcpStream,
        alarm: Option<Duration>,
    }

    impl Pc {
        pub(super) fn open() -> Result<Self, Box<dyn core::error::Error>> {
            let address = std::env::args().nth(1).ok_or("usage: HOST:PORT")?;
            let socket = TcpStream::connect(address)?;
            socket.set_nodelay(true)?;
            Ok(Self { socket, alarm: None })
        }

        /// The bytes that have come, or none: the alarm.
        pub(super) fn next_interrupt<'a>(&mut self, buffer: &'a mut [u8]) -> io::Result<Option<&'a [u8]>> {
            let wait = self.alarm.map_or(Duration::from_secs(1), |at| at.saturating_sub(now()));
            self.socket.set_read_timeout(Some(wait.max(Duration::from_micros(1))))?;
            match self.socket.read(buffer) {
                Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
                Ok(length) => Ok(buffer.get(..length)),
                Err(e)
                    if matches!(
                        e.kind(),
                        ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                    ) =>
                {
                    Ok(None)
                }
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
            let _ = self.socket.write_all(bytes);
        }

        fn show(&mut self, block: &TelemetryBlock) {
            println!("{block:?}");
        }

        fn failed(&mut self, event: &ClientEvent) {
            println!("{event:?}");
        }
    }
}
