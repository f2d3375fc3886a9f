//! The host on a microcontroller: `no_std`, no allocation, two interrupts and no loop of its own. A port of the PC plays the board:
//! `cargo run -p val2-alter --example to_and_fro_interrupt -- /dev/ttyS0`
#![no_std]
use core::ops::ControlFlow;
use core::time::Duration;

use val2_alter::robot_session::{Output, Session as _, settle};
use val2_alter::{ConfigError, Host, HostConfig, HostEvent};

/// What both interrupts share: give them one priority, or a lock.
struct Arm {
    host: Host,
    buffer: [u8; Host::MAX_TRANSMIT],
}

/// The UART, the timer, and a display.
trait Board {
    fn now(&self) -> Duration;
    fn set_alarm(&mut self, at: Option<Duration>);
    fn transmit(&mut self, bytes: &[u8]);
    fn show(&mut self, segment: u16, percent: f32);
}

impl Arm {
    fn new(now: Duration) -> Result<Self, ConfigError> {
        let mut host = Host::new(HostConfig::default())?;
        host.handle_connected(now);
        Ok(Self { host, buffer: [0; Host::MAX_TRANSMIT] })
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
        // To and fro by 16 units, 18 mm/s, for 100 cycles each.
        let speed = if (self.host.statistics().cycles / 100).is_multiple_of(2) { 16 } else { -16 };
        self.host.set_target(now, [speed, 0, 0, 0, 0, 0]);
        let _ = settle(&mut self.host, now, &mut self.buffer, |_, output| {
            match output {
                Output::Transmit(bytes) => board.transmit(bytes),
                Output::Event(HostEvent::Motion(motion)) => {
                    board.show(motion.segment, motion.fraction() * 100.0)
                }
                // An exception, the end of ALTER, a reply that was missed: what your program does about it.
                Output::Event(_) => {}
            }
            ControlFlow::<()>::Continue(())
        });
        board.set_alarm(self.host.poll_timeout());
    }
}

fn main() -> Result<(), std::boxed::Box<dyn core::error::Error>> {
    let mut board = board::Pc::open()?;
    let mut arm = Arm::new(board.now())?;
    arm.alarm(&mut board);
    loop {
        match board.next_interrupt()? {
            Some(byte) => arm.received(&mut board, &[byte]),
            None => arm.alarm(&mut board),
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

    use serialport::SerialPort;
    use val2_alter::robot_session::now;

    pub(super) struct Pc {
        port: Box<dyn SerialPort>,
        alarm: Option<Duration>,
    }

    impl Pc {
        pub(super) fn open() -> Result<Self, Box<dyn core::error::Error>> {
            let path = std::env::args().nth(1).ok_or("usage: PORT")?;
            Ok(Self { port: serialport::new(path, 38400).open()?, alarm: None })
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

        fn show(&mut self, segment: u16, percent: f32) {
            println!("segment {segment}, {percent:.1} %");
        }
    }
}
