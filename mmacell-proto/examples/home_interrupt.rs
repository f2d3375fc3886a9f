//! The central controller of one robot on a microcontroller: `no_std`, no allocation, two interrupts and no loop of its own. A socket
//! of the PC plays the board: `cargo run -p mmacell-proto --features std --example home_interrupt -- 192.168.0.1:2001`
#![no_std]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "a socket plays the board")]
use core::ops::ControlFlow;
use core::time::Duration;

use mmacell_proto::robot_session::{Output, Session as _, settle};
use mmacell_proto::{Central, CentralConfig, CentralEvent, Command, ConfigError, RobotPose};

/// What both interrupts share: give them one priority, or a lock.
struct Robot {
    central: Central<RobotPose>,
    buffer: [u8; Central::<RobotPose>::MAX_TRANSMIT],
}

/// The socket, the timer, and a display.
trait Board {
    fn now(&self) -> Duration;
    fn set_alarm(&mut self, at: Option<Duration>);
    fn transmit(&mut self, bytes: &[u8]);
    fn show(&mut self, event: &CentralEvent<RobotPose>);
}

impl Robot {
    fn new(now: Duration) -> Result<Self, ConfigError> {
        let mut central = Central::new(CentralConfig::DEFAULT)?;
        central.handle_connected(now);
        Ok(Self { central, buffer: [0; Central::<RobotPose>::MAX_TRANSMIT] })
    }

    /// The socket's interrupt: bytes have come.
    fn received(&mut self, board: &mut impl Board, bytes: &[u8]) {
        self.central.handle_input(board.now(), bytes);
        self.settle(board);
    }

    /// The timer's interrupt, and once at the beginning.
    fn alarm(&mut self, board: &mut impl Board) {
        self.central.handle_timeout(board.now());
        self.settle(board);
    }

    fn settle(&mut self, board: &mut impl Board) {
        let now = board.now();
        let _ = settle(&mut self.central, now, &mut self.buffer, |central, output| {
            match output {
                Output::Transmit(bytes) => board.transmit(bytes),
                Output::Event(event) => {
                    board.show(&event);
                    // Asks for the status again and again: each answer is the reason for the next question.
                    let _ = central.request(Command::Status);
                }
            }
            ControlFlow::<()>::Continue(())
        });
        board.set_alarm(self.central.poll_timeout());
    }
}

fn main() -> Result<(), std::boxed::Box<dyn core::error::Error>> {
    let mut board = board::Pc::open()?;
    let mut robot = Robot::new(board.now())?;
    robot.alarm(&mut board);
    let mut buffer = [0; 512];
    loop {
        match board.next_interrupt(&mut buffer)? {
            Some(bytes) => robot.received(&mut board, bytes),
            None => robot.alarm(&mut board),
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

    use mmacell_proto::robot_session::now;
    use mmacell_proto::{CentralEvent, RobotPose};

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

        fn show(&mut self, event: &CentralEvent<RobotPose>) {
            println!("{event:?}");
        }
    }
}
