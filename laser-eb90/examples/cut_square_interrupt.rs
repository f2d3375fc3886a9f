//! The PC of a laser robot as a microcontroller: `no_std`, no allocation, two interrupts and no loop of its own. A port of the PC
//! plays the board: `cargo run -p laser-eb90 --features std --example cut_square_interrupt -- /dev/ttyUSB0`
#![no_std]
use core::ops::ControlFlow;
use core::time::Duration;

use laser_eb90::robot_session::{Output, Session as _, settle};
use laser_eb90::{ConfigError, Host, HostConfig, HostEvent};

/// What both interrupts share: give them one priority, or a lock.
struct Cutter {
    host: Host,
    buffer: [u8; Host::MAX_TRANSMIT],
    corner: usize,
    stopped: bool,
}

/// A straight cut to X, Y: interpreted, so it is queued.
const LINE: u16 = 0x0101;
const CORNERS: [[f32; 2]; 4] = [[100.0, 0.0], [100.0, 100.0], [0.0, 100.0], [0.0, 0.0]];

/// The UART, the timer, and a display.
trait Board {
    fn now(&self) -> Duration;
    fn set_alarm(&mut self, at: Option<Duration>);
    fn transmit(&mut self, bytes: &[u8]);
    fn queued(&mut self, count: u8);
    fn stop(&mut self, reason: &dyn core::fmt::Debug);
}

impl Cutter {
    fn new(now: Duration) -> Result<Self, ConfigError> {
        let mut host = Host::new(HostConfig::default())?;
        host.handle_connected(now);
        Ok(Self { host, buffer: [0; Host::MAX_TRANSMIT], corner: 0, stopped: false })
    }

    /// The UART's interrupt: bytes have come, or one.
    fn received(&mut self, board: &mut impl Board, bytes: &[u8]) {
        self.host.handle_input(board.now(), bytes);
        self.settle(board);
    }

    /// The timer's interrupt, and once at the beginning.
    fn alarm(&mut self, board: &mut impl Board) {
        self.host.handle_timeout(board.now());
        self.settle(board);
    }

    fn settle(&mut self, board: &mut impl Board) {
        let now = board.now();
        // The corners of a square, each as soon as the one before is queued.
        if self.host.is_idle() && !self.stopped {
            let corner = CORNERS.get(self.corner % CORNERS.len()).copied().unwrap_or_default();
            let submitted = self.host.submit(LINE, |parameters| parameters.f32(&corner).map(drop));
            self.corner += usize::from(submitted.is_ok());
        }
        let _ = settle(&mut self.host, now, &mut self.buffer, |_, output| {
            match output {
                Output::Transmit(bytes) => board.transmit(bytes),
                Output::Event(HostEvent::Done { count, .. }) => board.queued(count),
                Output::Event(HostEvent::Corrupt(_) | HostEvent::Unasked { .. }) => {}
                // Refused, or nobody knows: nothing more is sent before somebody has looked at the robot.
                Output::Event(other) => {
                    self.stopped = true;
                    board.stop(&other);
                }
            }
            ControlFlow::<()>::Continue(())
        });
        board.set_alarm(self.host.poll_timeout());
    }
}

fn main() -> Result<(), std::boxed::Box<dyn core::error::Error>> {
    let mut board = board::Pc::open()?;
    let mut cutter = Cutter::new(board.now())?;
    cutter.alarm(&mut board);
    loop {
        match board.next_interrupt()? {
            Some(byte) => cutter.received(&mut board, &[byte]),
            None => cutter.alarm(&mut board),
        }
    }
}

extern crate std;

/// A PC as the board: your hardware is here.
mod board {
    use core::time::Duration;
    use std::boxed::Box;
    use std::io::{self, ErrorKind, Read as _, Write as _};
    use std::println;

    use laser_eb90::robot_session::now;
    use serialport::SerialPort;

    pub(super) struct Pc {
        port: Box<dyn SerialPort>,
        alarm: Option<Duration>,
    }

    impl Pc {
        pub(super) fn open() -> Result<Self, Box<dyn core::error::Error>> {
            let path = std::env::args().nth(1).ok_or("usage: PORT")?;
            Ok(Self { port: serialport::new(path, 9600).open()?, alarm: None })
        }

        /// The byte that has come, or none: the alarm.
        pub(super) fn next_interrupt(&mut self) -> io::Result<Option<u8>> {
            let wait = self.alarm.map_or(Duration::from_secs(1), |at| at.saturating_sub(now()));
            self.port.set_timeout(wait)?;
            let mut byte = [0];
            match self.port.read_exact(&mut byte) {
                Ok(()) => Ok(Some(byte[0])),
                Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(None),
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
            // A line that is gone shows when it is read.
            let _ = self.port.write_all(bytes);
        }

        fn queued(&mut self, count: u8) {
            println!("{count} queued");
        }

        fn stop(&mut self, reason: &dyn core::fmt::Debug) {
            println!("look at the robot first: {reason:?}");
        }
    }
}
