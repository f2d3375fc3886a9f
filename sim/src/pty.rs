//! A pseudo-terminal: the device has one end, and a program opens the other as a serial port.

use std::io;
use std::os::fd::OwnedFd;

use robot_session::{ReceiveOutcome, SendOutcome, Transport, Wait};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::io::{Errno, FdFlags, fcntl_setfd, read, write};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, QueueSelector, tcflush, tcgetattr, tcsetattr};

/// The device's end.
#[derive(Debug)]
pub(crate) struct Pty {
    device: OwnedFd,
    /// The path at which a program opens the other end.
    path: String,
}

impl Pty {
    /// Opens a pseudo-terminal; returns it, and the path of the program's end.
    pub(crate) fn open() -> io::Result<(Self, String)> {
        let device = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        // A child process would keep the line open.
        fcntl_setfd(&device, FdFlags::CLOEXEC)?;
        grantpt(&device)?;
        unlockpt(&device)?;
        let path = ptsname(&device, Vec::new())?.to_string_lossy().into_owned();
        // No echo, and bytes as they are. This process does not keep this end: it would not see that a program closes its own.
        let program = program_end(&path)?;
        let mut mode = tcgetattr(&program)?;
        mode.make_raw();
        tcsetattr(&program, OptionalActions::Now, &mode)?;
        fcntl_setfl(&device, OFlags::RDWR | OFlags::NONBLOCK)?;
        Ok((Self { device, path: path.clone() }, path))
    }

    /// Returns whether a program has the other end open, or has closed it after it sent bytes.
    pub(crate) fn is_open(&self) -> bool {
        let mut ends = [PollFd::new(&self.device, PollFlags::IN)];
        let polled = poll(&mut ends, Some(&Timespec { tv_sec: 0, tv_nsec: 0 }));
        let [end] = ends;
        let found = end.revents();
        polled.is_ok() && (found.contains(PollFlags::IN) || !found.contains(PollFlags::HUP))
    }

    /// Discards the unread bytes of a program that has closed its end, which the next program would read otherwise.
    pub(crate) fn discard(&self) {
        // A program that has opened it again loses the bytes that were not sent to it.
        if let Ok(program) = program_end(&self.path) {
            let _ = tcflush(program, QueueSelector::IFlush);
        }
    }
}

fn program_end(path: &str) -> io::Result<OwnedFd> {
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
    Ok(open(path, flags, Mode::empty())?)
}

impl Transport for Pty {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        if !wait.readable(&self.device)? {
            return Ok(ReceiveOutcome::Nothing);
        }
        match read(&self.device, buffer) {
            // No program has the other end open.
            Ok(0) | Err(Errno::IO) => Ok(ReceiveOutcome::Closed),
            Ok(length) => Ok(ReceiveOutcome::Bytes(length)),
            Err(Errno::AGAIN | Errno::INTR) => Ok(ReceiveOutcome::Nothing),
            Err(error) => Err(error.into()),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        match write(&self.device, bytes) {
            Ok(length) if length == bytes.len() => Ok(SendOutcome::Buffered),
            Ok(length) => Ok(SendOutcome::Part(length)),
            Err(Errno::AGAIN | Errno::INTR) => Ok(SendOutcome::Part(0)),
            Err(error) => Err(error.into()),
        }
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        wait.writable(&self.device).map(drop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_is_there_until_it_has_gone_and_its_bytes_are_read() {
        let (mut pty, path) = Pty::open().unwrap();
        assert!(!pty.is_open());
        let program = program_end(&path).unwrap();
        assert!(pty.is_open());
        write(&program, b"!").unwrap();
        assert!(pty.is_open());
        drop(program);
        assert!(pty.is_open(), "a byte is left");
        let wait = || Wait::limited(core::time::Duration::from_secs(20));
        assert_eq!(pty.receive(&mut [0; 8], wait()).unwrap(), ReceiveOutcome::Bytes(1));
        assert_eq!(pty.receive(&mut [0; 8], wait()).unwrap(), ReceiveOutcome::Closed);
        assert!(!pty.is_open());
    }
}
