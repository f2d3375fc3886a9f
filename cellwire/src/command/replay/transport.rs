//! Where the other end is.

use std::io::{self, ErrorKind};
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use anyhow::{Result, bail};
use robot_session::{ReceiveOutcome, SendOutcome, Serial, Transport, Wait, discard_unacknowledged};

use cellwire_io::output::ready;
use cellwire_io::serial::{self, Mode, PtyLink, baud_rate};
use cellwire_io::stream::Stream;
use cellwire_io::tcp::{self, ConnectArgs};

/// Where the other end is.
#[derive(Debug, clap::Args)]
pub(super) struct TransportArgs {
    #[command(flatten)]
    place: PlaceArgs,
    #[command(flatten)]
    dialing: ConnectArgs,
    /// The baud rate of the serial port
    #[arg(long, value_name = "N", default_value = "9600", value_parser = baud_rate())]
    baud: u32,
    /// Data bits, parity and stop bits of the serial port, such as 8E1
    #[arg(long, value_name = "MODE", default_value = "8N1")]
    mode: Mode,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct PlaceArgs {
    /// Listen on this address for the other end; a port alone means 127.0.0.1, port 0 any free port
    #[arg(long, value_name = "ADDR")]
    listen: Option<String>,
    /// Connect to the other end at this address
    #[arg(long, value_name = "ADDR")]
    connect: Option<String>,
    /// The serial port of the other end
    #[arg(long, value_name = "PORT")]
    serial: Option<String>,
    /// Create a pseudo-terminal for the other end, and a link to it at this path
    #[arg(long, value_name = "LINKPATH")]
    pty: Option<PathBuf>,
}

impl TransportArgs {
    /// Waits for the other end, where it connects.
    pub(super) fn open(&self, end: &str) -> Result<Box<dyn Transport>> {
        Ok(match &self.place {
            PlaceArgs { listen: Some(address), .. } => {
                let listener = tcp::listen(address)?;
                ready(end, "listen", &listener.local_addr()?.to_string())?;
                let stream = listener.accept()?.0;
                stream.set_nodelay(true)?;
                Box::new(Stream::new(stream))
            }
            PlaceArgs { connect: Some(address), .. } => {
                let stream = tcp::connect(address, self.dialing.dialing())?;
                discard_unacknowledged(&stream, tcp::DISCARD_AFTER)?;
                ready(end, "connect", address)?;
                Box::new(Stream::new(stream))
            }
            PlaceArgs { serial: Some(path), .. } => {
                let port = serial::open_with(path, self.baud, self.mode)?;
                self.dialing.dialing().pause();
                ready(end, "serial", path)?;
                Box::new(Serial(port))
            }
            PlaceArgs { pty: Some(path), .. } => {
                let (link, port) = PtyLink::create(path)?;
                ready(end, "pty", &path.to_string_lossy())?;
                let mut terminal = Terminal { port: Serial(port), first: Vec::new(), _link: link };
                terminal.wait()?;
                Box::new(terminal)
            }
            _ => bail!("give --listen, --connect, --serial or --pty"),
        })
    }
}

/// This end of a pseudo-terminal.
struct Terminal {
    port: Serial,
    /// The bytes that arrived when the other end was opened.
    first: Vec<u8>,
    _link: PtyLink,
}

impl Terminal {
    /// Waits until the other end is opened: without it a read fails at once.
    fn wait(&mut self) -> Result<()> {
        let mut buffer = [0; 256];
        self.port.0.set_timeout(Duration::from_millis(5))?;
        loop {
            match self.port.0.read(&mut buffer) {
                Ok(length) => {
                    self.first.extend_from_slice(buffer.get(..length).unwrap_or_default());
                    return Ok(());
                }
                Err(error) if error.kind() == ErrorKind::TimedOut => return Ok(()),
                Err(_) => thread::sleep(Duration::from_millis(5)),
            }
        }
    }
}

impl Transport for Terminal {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        if self.first.is_empty() {
            return self.port.receive(buffer, wait);
        }
        let length = self.first.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(self.first.drain(..length)) {
            *to = from;
        }
        Ok(ReceiveOutcome::Bytes(length))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.port.send(bytes)
    }
}
