//! Serial ports and pseudo-terminals, in raw mode and without flow control.

use core::fmt;
use core::ops::RangeInclusive;
use core::str::FromStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

#[cfg(unix)]
use anyhow::Context as _;
use anyhow::Result;
use clap::builder::TypedValueParser;
use serialport::{DataBits, FlowControl, Parity, SerialPort, SerialPortBuilder, StopBits};

use super::ports;

/// The timeout of a blocking read, after which the reader checks whether it should end.
pub const READ_TIMEOUT: Duration = Duration::from_millis(50);

/// The permitted baud rates.
pub const BAUD_RATES: RangeInclusive<u32> = 50..=4_000_000;

/// Returns the parser for a baud rate on the command line.
pub fn baud_rate() -> impl TypedValueParser<Value = u32> {
    clap::value_parser!(u32).range(i64::from(*BAUD_RATES.start())..=i64::from(*BAUD_RATES.end()))
}

/// Opens a port: 8N1, raw, and no flow control, because these links send binary data that may contain XON and XOFF.
///
/// # Errors
/// If there is no such port, or if another program uses it.
pub fn open(path: &str, baud: u32) -> Result<Box<dyn SerialPort>> {
    open_with(path, baud, Mode::EIGHT_N_ONE)
}

/// The division of the bytes of a serial line into bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mode {
    /// The number of data bits, 7 or 8.
    pub data_bits: DataBits,
    /// The parity bit: none, even or odd.
    pub parity: Parity,
    /// The number of stop bits, 1 or 2.
    pub stop_bits: StopBits,
}

impl Mode {
    /// 8 data bits, no parity, one stop bit.
    pub const EIGHT_N_ONE: Self =
        Self { data_bits: DataBits::Eight, parity: Parity::None, stop_bits: StopBits::One };
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parity = match self.parity {
            Parity::None => 'N',
            Parity::Even => 'E',
            Parity::Odd => 'O',
        };
        write!(f, "{}{parity}{}", u8::from(self.data_bits), u8::from(self.stop_bits))
    }
}

impl FromStr for Mode {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const WHY: &str = "give data bits, parity and stop bits: 7 or 8, N, E or O, 1 or 2, such as 8N1";
        let &[data_bits, parity, stop_bits] = text.as_bytes() else { return Err(WHY) };
        let data_bits = match data_bits {
            b'7' => DataBits::Seven,
            b'8' => DataBits::Eight,
            _ => return Err(WHY),
        };
        let parity = match parity.to_ascii_uppercase() {
            b'N' => Parity::None,
            b'E' => Parity::Even,
            b'O' => Parity::Odd,
            _ => return Err(WHY),
        };
        let stop_bits = match stop_bits {
            b'1' => StopBits::One,
            b'2' => StopBits::Two,
            _ => return Err(WHY),
        };
        Ok(Self { data_bits, parity, stop_bits })
    }
}

/// Opens a port in another mode, raw, without flow control.
///
/// # Errors
/// If there is no such port, or if another program uses it.
pub fn open_with(path: &str, baud: u32, mode: Mode) -> Result<Box<dyn SerialPort>> {
    let Mode { data_bits, parity, stop_bits } = mode;
    let settings = settings(path, baud).data_bits(data_bits).parity(parity).stop_bits(stop_bits);
    settings.open().map_err(|error| advise(path, baud, error))
}

/// Returns the settings of a port: 8N1, without flow control.
pub fn settings(path: &str, baud: u32) -> SerialPortBuilder {
    serialport::new(path, baud).flow_control(FlowControl::None).timeout(READ_TIMEOUT)
}

/// Returns the error of a port that cannot be opened, with advice.
pub fn advise(path: &str, baud: u32, error: serialport::Error) -> anyhow::Error {
    let advice = match error.kind() {
        serialport::ErrorKind::NoDevice | serialport::ErrorKind::Io(ErrorKind::NotFound) => absent(path),
        serialport::ErrorKind::InvalidInput => {
            ": it is not a serial port, or does not support this baud rate".to_owned()
        }
        serialport::ErrorKind::Io(ErrorKind::PermissionDenied) => {
            ": permission denied; on Linux add the user to the group dialout, and log in again".to_owned()
        }
        _ => String::new(),
    };
    anyhow::Error::new(error).context(format!("cannot open {path} at {baud} baud{advice}"))
}

/// Describes the failure to open a port. Systems do not distinguish a port in use from a missing one.
fn absent(path: &str) -> String {
    let names: Vec<String> = ports::list().unwrap_or_default().into_iter().map(|port| port.port).collect();
    if Path::new(path).exists() || names.iter().any(|name| name.eq_ignore_ascii_case(path)) {
        return ": in use by another program, such as a terminal program".to_owned();
    }
    let there = match names.as_slice() {
        [] => "there is no serial port; check the adapter and its driver".to_owned(),
        names => format!("found: {}, see cellwire ports", names.join(", ")),
    };
    // An IPv4 address or a name with a dot: a port of the network is forgotten more often than a path has one.
    let is_host = !path.starts_with(['/', '.']) && path.contains('.') && !path.contains(['/', ':']);
    let hint =
        if is_host { format!("; for TCP give its port too, such as {path}:502") } else { String::new() };
    format!(": no such port, {there}{hint}")
}

/// Reads all bytes that arrive within `time`.
///
/// # Errors
/// When the port is gone.
pub fn listen(port: &mut dyn SerialPort, time: Duration) -> Result<Vec<u8>> {
    port.set_timeout(Duration::from_millis(20))?;
    let end = Instant::now() + time;
    let mut received = Vec::new();
    let mut buffer = [0; 64];
    while Instant::now() < end {
        match port.read(&mut buffer) {
            Ok(n) => received.extend_from_slice(buffer.get(..n).unwrap_or_default()),
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(e) => return Err(e.into()),
        }
    }
    Ok(received)
}

/// A symbolic link to a pseudo-terminal, at a path given by the caller. It is removed when this is dropped.
#[derive(Debug)]
pub struct PtyLink {
    path: PathBuf,
    /// The target of the link.
    name: PathBuf,
}

impl PtyLink {
    /// Creates a pseudo-terminal and the link to it. The port is the device's end; a client opens the path.
    ///
    /// # Errors
    /// When there is something at the path, other than the link of a simulator that was killed.
    #[cfg(unix)]
    pub fn create(path: &Path) -> Result<(Self, Box<dyn SerialPort>)> {
        // Before the pseudo-terminal, which may get the number of the one that is gone.
        if let Ok(earlier) = std::fs::read_link(path) {
            // The link of a simulator that was killed has no target any more.
            let is_left = earlier.starts_with("/dev/pts") && !earlier.exists();
            anyhow::ensure!(
                is_left,
                "{} is a link to {}, which exists: another simulator may be running; otherwise remove the link",
                path.display(),
                earlier.display()
            );
            std::fs::remove_file(path)
                .with_context(|| format!("cannot replace the link {}", path.display()))?;
        }
        let (device, name) = pair()?;
        std::os::unix::fs::symlink(&name, path)
            .with_context(|| format!("cannot make the link {} to {name}", path.display()))?;
        let link = Self { path: path.into(), name: name.into() };
        let kept = Self { path: link.path.clone(), name: link.name.clone() };
        crate::interrupt::before_exit(move || drop(kept));
        Ok((link, device))
    }

    /// Fails: pseudo-terminals need Unix.
    ///
    /// # Errors
    /// Always.
    #[cfg(not(unix))]
    pub fn create(path: &Path) -> Result<(Self, Box<dyn SerialPort>)> {
        anyhow::bail!(
            "cannot make {}: pseudo-terminals need Unix; use --listen ADDRESS, or a serial device server between a virtual COM port (com0com) and --listen",
            path.display()
        )
    }
}

impl Drop for PtyLink {
    fn drop(&mut self) {
        // Another program may have replaced it.
        if std::fs::read_link(&self.path).is_ok_and(|name| name == self.name) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Creates a pseudo-terminal: the device's end, and the path that a client opens.
///
/// This process does not keep the client's end open, so that the device detects when the client closes it.
///
/// # Errors
/// When the system cannot create another one.
#[cfg(unix)]
pub fn pair() -> Result<(Box<dyn SerialPort>, String)> {
    let (device, client) = serialport::TTYPort::pair().context("cannot make a pseudo-terminal")?;
    let name = client.name().context("the pseudo-terminal has no name")?;
    // A child process inherits the pair, and would keep the line open; it does not inherit a copy.
    let mut device = device.try_clone_native().context("cannot copy the pseudo-terminal")?;
    device.set_timeout(READ_TIMEOUT)?;
    Ok((Box::new(device), name))
}

/// Discards unread bytes at the client's end of a pseudo-terminal: otherwise the next client would read bytes for the previous
/// one.
#[cfg(unix)]
pub fn discard(path: &Path) {
    use rustix::fs::{Mode, OFlags, open};
    use rustix::termios::{QueueSelector, tcflush};
    // A client that has removed it reads nothing.
    if let Ok(client) =
        open(path, OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC, Mode::empty())
    {
        let _ = tcflush(client, QueueSelector::IFlush);
    }
}

/// Does nothing: other ports do not buffer bytes of an earlier client.
#[cfg(not(unix))]
pub fn discard(_: &Path) {}

/// Fails: pseudo-terminals need Unix. See [`Lines`](crate::line::Lines).
///
/// # Errors
/// Always.
#[cfg(not(unix))]
pub fn pair() -> Result<(Box<dyn SerialPort>, String)> {
    anyhow::bail!("pseudo-terminals need Unix")
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_an_absent_port_says_so() {
        let error = open("/dev/no-such-port", 9600).err().unwrap().to_string();
        assert!(error.contains("no such port"), "{error}");
    }

    #[test]
    fn a_port_that_cannot_be_opened_is_an_error_with_advice() {
        use serialport::ErrorKind::{InvalidInput, Io, Unknown};
        for (kind, advice) in [
            (InvalidInput, ": it is not a serial port, or does not support this baud rate"),
            (
                Io(ErrorKind::PermissionDenied),
                ": permission denied; on Linux add the user to the group dialout, and log in again",
            ),
            (Unknown, ""),
        ] {
            let error = advise("COM5", 9600, serialport::Error::new(kind, "it fails"));
            assert_eq!(format!("{error:#}"), format!("cannot open COM5 at 9600 baud{advice}: it fails"));
        }
    }

    #[test]
    fn a_port_that_exists_is_in_use() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let found = absent(file.path().to_str().unwrap());
        assert_eq!(found, ": in use by another program, such as a terminal program");
    }

    #[test]
    fn the_error_of_a_host_without_its_port_names_one() {
        for (path, expected) in [
            ("10.0.0.7", "; for TCP give its port too, such as 10.0.0.7:502"),
            ("plc.example", "; for TCP give its port too, such as plc.example:502"),
            ("/dev/none.0", ""),
            ("./none.0", ""),
            ("none.0/tty", ""),
            ("10.0.0.7:502", ""),
            ("COM250", ""),
        ] {
            let error = absent(path);
            let hint = error.find("; for TCP").map_or("", |at| &error[at..]);
            assert_eq!(hint, expected, "{path}");
        }
    }
}
