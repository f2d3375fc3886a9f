//! `cellwire tap`: stands between two ends, or listens to them, and shows what they say.

mod decoding;
mod lines;
mod screen;
mod split;

use std::net::{TcpListener, UdpSocket};
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use anyhow::{Result, bail};
use serialport::SerialPort;

use self::decoding::Decoding;
use super::codec::LinkArgs;
use crate::io::capture::write::Writer;
use crate::io::output::{self, remark};
use crate::io::serial::{self, Mode, baud_rate};
use crate::io::tap::{self, Watch};
use crate::io::tcp::ConnectArgs;
use crate::io::{interrupt, tcp, udp};

/// Listens to both ends of a link: passes their bytes on unchanged, or only listens, and shows their messages.
///
/// Prints one JSON object per line: what a message says, when it came and who sent it, or what is wrong with bytes, and by which
/// clause of the link's specification. The bytes go into a capture for Wireshark, `decode` and `identify`, which is whole whenever the
/// tap ends.
///
/// Bytes are passed on before anything else is done with them. A full disk, output that nobody reads and messages that cannot be
/// decoded change nothing for the two ends.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    #[command(flatten)]
    of: LinkArgs,
    #[command(flatten)]
    place: PlaceArgs,
    /// The address of the server, to which the bytes of each client are passed on
    #[arg(long, value_name = "ADDR", requires = "listen")]
    connect: Option<String>,
    /// Pass datagrams on, not connections
    #[arg(long, requires = "listen")]
    udp: bool,
    #[command(flatten)]
    timeout: ConnectArgs,
    /// The serial port of the other end
    #[arg(long, value_name = "PORT", requires = "a")]
    b: Option<String>,
    /// Only listen, as on the receive lines of a Y cable; with --a alone, to a line that carries both directions
    #[arg(long, requires = "a")]
    listen_only: bool,
    /// The baud rate of the ports
    #[arg(long, value_name = "N", default_value = "9600", value_parser = baud_rate(), requires = "a")]
    baud: u32,
    /// Data bits, parity and stop bits of the ports, such as 8E1
    #[arg(long, value_name = "MODE", default_value = "8N1", requires = "a")]
    mode: Mode,
    /// Show both ends on the terminal while they talk, in place of the lines
    #[arg(long)]
    screen: bool,
    /// The capture; where there is a file of this name, one with a number
    #[arg(long, value_name = "FILE", default_value = "tap.pcapng")]
    capture: PathBuf,
    /// Write no capture
    #[arg(long, conflicts_with = "capture")]
    no_capture: bool,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct PlaceArgs {
    /// Listen for clients on this address; a port alone is one of this machine's loopback address
    #[arg(long, value_name = "ADDR", requires = "connect")]
    listen: Option<String>,
    /// The serial port of one end: of the one that is a client over TCP, which is the first side of the link unless its page says otherwise
    #[arg(long, value_name = "PORT")]
    a: Option<String>,
}

const EXAMPLES: &str = "\
Examples:
  cellwire tap kawasaki-msg --listen 0.0.0.0:9105 --connect 192.168.0.10:9105
      the robot is told this machine's address in place of its PC's
  cellwire tap laser-eb90 --a /dev/ttyUSB0 --b /dev/ttyUSB1 --baud 115200
      a PC at one adapter, the laser's controller at the other, and this machine between them
  cellwire tap val2-alter --a /dev/ttyUSB0 --b /dev/ttyUSB1 --baud 19200 --listen-only
      two receive lines of a Y cable
  cellwire decode kawasaki-msg --format pcap tap.pcapng
      the same messages again, from the capture

The ends notice nothing but a delay of some microseconds. RTS, DTR and breaks of a serial line are not passed on: what needs them is
listened to with a Y cable.";

/// On a line that carries both directions nothing more comes of what was sent before such a silence.
const SILENCE: Duration = Duration::from_millis(100);

/// Runs until interrupted, or until a port is gone.
pub fn run(args: &Args) -> Result<bool> {
    let decoding = Decoding::new(&args.of)?;
    if args.screen {
        screen::check()?;
    }
    let way = Way::open(args)?;
    output::never_wait()?;
    interrupt::handle()?;
    let mut watch = Watch::default();
    thread::scope(|scope| {
        if !args.no_capture {
            let writer = Writer::create(&args.capture, args.of.link.name)?;
            remark(&format!("capture: {}", writer.path().display()));
            let seen = watch.add();
            scope.spawn(move || writer.record(&seen));
        }
        let seen = watch.add();
        if !args.screen {
            way.announce()?;
        }
        let passing = scope.spawn(move || way.run(args, &watch));
        if args.screen {
            screen::show(args.of.link.name, decoding, &seen)?;
            // The threads that pass bytes on wait for them.
            output::finish();
            std::process::exit(0);
        }
        // Until the ports are gone.
        lines::print(decoding, &seen);
        passing.join().unwrap_or_else(|_| bail!("a thread has panicked"))
    })?;
    Ok(true)
}

/// What is tapped.
enum Way {
    Tcp(TcpListener),
    Udp(UdpSocket),
    /// Ports with their names: one or two.
    Ports(Named, Option<Named>),
}

type Named = (String, Box<dyn SerialPort>);

impl Way {
    fn open(args: &Args) -> Result<Self> {
        let port = |name: &str| -> Result<Named> {
            Ok((name.to_owned(), serial::open_with(name, args.baud, args.mode)?))
        };
        match (&args.place, &args.b) {
            (PlaceArgs { listen: Some(address), .. }, _) if args.udp => Ok(Self::Udp(udp::bind(address)?)),
            (PlaceArgs { listen: Some(address), .. }, _) => Ok(Self::Tcp(tcp::listen(address)?)),
            (PlaceArgs { a: Some(a), .. }, Some(b)) => Ok(Self::Ports(port(a)?, Some(port(b)?))),
            (PlaceArgs { a: Some(a), .. }, None) if args.listen_only => Ok(Self::Ports(port(a)?, None)),
            (PlaceArgs { a: Some(a), .. }, None) => bail!(
                "give the other end's port with --b, or --listen-only where {a} is a line that carries both directions"
            ),
            _ => bail!("give --listen and --connect, or --a"),
        }
    }

    /// Prints where it is ready.
    fn announce(&self) -> Result<()> {
        match self {
            Self::Tcp(listener) => output::ready("tap", "listen", &listener.local_addr()?.to_string()),
            Self::Udp(socket) => output::ready("tap", "listen", &socket.local_addr()?.to_string()),
            Self::Ports((a, _), None) => output::ready("tap", "port", a),
            Self::Ports((a, _), Some((b, _))) => output::ready("tap", "ports", &format!("{a} {b}")),
        }
    }

    fn run(self, args: &Args, watch: &Watch) -> Result<()> {
        let server = args.connect.as_deref().unwrap_or_default();
        match self {
            Self::Tcp(listener) => tap::tcp::run(&listener, server, args.timeout.timeout(), watch),
            Self::Udp(socket) => tap::udp::run(&socket, server, watch),
            Self::Ports(a, Some(b)) if !args.listen_only => tap::serial::join([a, b], watch),
            Self::Ports(a, b) => tap::serial::listen(a, b, watch),
        }
    }
}
