//! A pseudo-terminal that no process inherits: when its user's end is closed, it is gone.

use std::fs::File;
use std::io::{self, Read, Write};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

pub(crate) struct Pty(File);

impl Pty {
    /// Creates a pseudo-terminal: returns one end, and the path of the other.
    pub(crate) fn new() -> (Self, String) {
        let user = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
        grantpt(&user).unwrap();
        unlockpt(&user).unwrap();
        let path = ptsname(&user, Vec::new()).unwrap().into_string().unwrap();
        (Self(user.into()), path)
    }

    /// Opens the same end again.
    pub(crate) fn again(&self) -> Self {
        Self(self.0.try_clone().unwrap())
    }

    /// Removes echo and translation: bytes that are written before the other end is opened arrive unchanged.
    pub(crate) fn raw(self) -> Self {
        let mut settings = tcgetattr(&self.0).unwrap();
        settings.make_raw();
        tcsetattr(&self.0, OptionalActions::Now, &settings).unwrap();
        self
    }

    /// Reads what comes in that time; 0 for nothing.
    pub(crate) fn read(&mut self, wait: Duration, buffer: &mut [u8]) -> io::Result<usize> {
        let mut fds = [PollFd::new(&self.0, PollFlags::IN)];
        let wait =
            Timespec { tv_sec: 0, tv_nsec: wait.min(Duration::from_millis(999)).subsec_nanos().into() };
        if poll(&mut fds, Some(&wait))? == 0 {
            return Ok(0);
        }
        self.0.read(buffer)
    }

    /// Writes bytes; an error is ignored, because the other end may be closed.
    pub(crate) fn write(&mut self, bytes: &[u8]) {
        let _ = self.0.write_all(bytes);
    }
}
