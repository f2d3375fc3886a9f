//! A pseudo-terminal: the device has one end, and a program opens the other as a serial port.

use std::io;
use std::os::fd::OwnedFd;

use robot_session::{Received, Sent, Transport, Wait};
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::io::{Errno, FdFlags, fcntl_setfd, read, write};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The device's end.
#[derive(Debug)]
pub(crate) struct Pty {
    device: OwnedFd,
    /// As long as it is open, a program that closes its end does not end the line.
    _program: OwnedFd,
}

impl Pty {
    /// A new one, and the path of the program's end.
    pub(crate) fn open() -> io::Result<(Self, String)> {
        let device = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        // A child process would keep the line open.
        fcntl_setfd(&device, FdFlags::CLOEXEC)?;
        grantpt(&device)?;
        unlockpt(&device)?;
        let path = ptsname(&device, Vec::new())?.to_string_lossy().into_owned();
        let program = open(path.as_str(), OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        // No echo, and bytes as they are.
        let mut mode = tcgetattr(&program)?;
        mode.make_raw();
        tcsetattr(&program, OptionalActions::Now, &mode)?;
        fcntl_setfl(&device, OFlags::RDWR | OFlags::NONBLOCK)?;
        Ok((Self { device, _program: program }, path))
    }
}

impl Transport for Pty {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<Received> {
        if !wait.readable(&self.device)? {
            return Ok(Received::Nothing);
        }
        match read(&self.device, buffer) {
            Ok(0) => Ok(Received::Closed),
            Ok(length) => Ok(Received::Bytes(length)),
            Err(Errno::AGAIN | Errno::INTR) => Ok(Received::Nothing),
            Err(error) => Err(error.into()),
        }
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<Sent> {
        match write(&self.device, bytes) {
            Ok(length) if length == bytes.len() => Ok(Sent::Buffered),
            Ok(length) => Ok(Sent::Part(length)),
            Err(Errno::AGAIN | Errno::INTR) => Ok(Sent::Part(0)),
            Err(error) => Err(error.into()),
        }
    }

    fn wait_for_room(&mut self, wait: Wait<'_>) -> io::Result<()> {
        wait.writable(&self.device).map(drop)
    }
}
