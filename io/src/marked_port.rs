//! A serial port that is only listened to, and marks the characters that are broken.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt as _;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::termios::{
    ControlModes, InputModes, OptionalActions, QueueSelector, Termios, ioctl_tiocexcl, isatty, tcflush,
    tcgetattr, tcsetattr,
};
use serialport::{DataBits, Parity, StopBits};

use super::serial::Mode;

/// A port by its path.
#[derive(Debug)]
pub struct MarkedPort {
    file: File,
    name: String,
}

impl MarkedPort {
    /// Opens a port to listen.
    ///
    /// # Errors
    /// If there is no such port, or if another program uses it.
    pub fn open(name: &str) -> Result<Self> {
        let flags = (OFlags::NONBLOCK | OFlags::NOCTTY).bits().cast_signed();
        let why = || format!("cannot open {name}: no such port, or it is in use, see cellwire ports");
        let file = OpenOptions::new().read(true).custom_flags(flags).open(name).with_context(why)?;
        ensure!(isatty(&file), "{name} is not a serial port");
        ioctl_tiocexcl(&file).with_context(why)?;
        Ok(Self { file, name: name.into() })
    }

    /// Listens with another rate and format from now on; false where the port has no such format: a pseudo-terminal has 8N1
    /// alone.
    ///
    /// # Errors
    /// If the port does not have the rate, or is gone.
    pub fn set(&mut self, baud: u32, mode: Mode) -> Result<bool> {
        let why = || format!("cannot set {} to {baud} baud, {mode}", self.name);
        let mut settings = tcgetattr(&self.file).with_context(why)?;
        of_mode(&mut settings, mode);
        settings.set_speed(baud).with_context(why)?;
        tcsetattr(&self.file, OptionalActions::Now, &settings).with_context(why)?;
        // Discard bytes that were received with the previous settings.
        tcflush(&self.file, QueueSelector::IFlush).with_context(why)?;
        // A driver silently ignores settings that it does not support.
        let format = ControlModes::CSIZE | ControlModes::PARENB | ControlModes::PARODD;
        let found = tcgetattr(&self.file).with_context(why)?.control_modes;
        Ok(found & format == settings.control_modes & format)
    }

    /// Returns the bytes that arrive within `limit`, as they are marked: FF 00 before a broken character, FF FF for FF. Empty if
    /// none arrive.
    ///
    /// # Errors
    /// If the port is gone.
    pub fn read(&mut self, limit: Duration) -> Result<Vec<u8>> {
        let end = Instant::now() + limit;
        let mut buffer = [0; 4096];
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let wait = Timespec { tv_sec: left.as_secs().cast_signed(), tv_nsec: left.subsec_nanos().into() };
            match poll(&mut [PollFd::new(&self.file, PollFlags::IN)], Some(&wait)) {
                Ok(0) | Err(rustix::io::Errno::INTR) => return Ok(Vec::new()),
                Ok(_) => {}
                Err(error) => return Err(error).with_context(|| format!("{}: the port is gone", self.name)),
            }
            match self.file.read(&mut buffer) {
                Ok(length @ 1..) => return Ok(buffer.get(..length).unwrap_or_default().to_vec()),
                Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => {}
                Ok(_) => anyhow::bail!("{}: the port is gone", self.name),
                Err(error) => return Err(error).with_context(|| format!("{}: the port is gone", self.name)),
            }
        }
    }
}

fn of_mode(settings: &mut Termios, mode: Mode) {
    settings.make_raw();
    let control = &mut settings.control_modes;
    *control -= ControlModes::CSIZE | ControlModes::PARENB | ControlModes::PARODD | ControlModes::CSTOPB;
    *control |= ControlModes::CREAD | ControlModes::CLOCAL;
    *control |= if mode.data_bits == DataBits::Seven { ControlModes::CS7 } else { ControlModes::CS8 };
    if mode.stop_bits == StopBits::Two {
        *control |= ControlModes::CSTOPB;
    }
    let input = &mut settings.input_modes;
    *input -=
        InputModes::IGNPAR | InputModes::IGNBRK | InputModes::BRKINT | InputModes::INPCK | InputModes::ISTRIP;
    // Frames without a stop bit are marked with and without parity.
    *input |= InputModes::PARMRK | InputModes::INPCK;
    match mode.parity {
        Parity::None => {}
        Parity::Even => *control |= ControlModes::PARENB,
        Parity::Odd => *control |= ControlModes::PARENB | ControlModes::PARODD,
    }
}
