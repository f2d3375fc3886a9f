//! The transport that `cellwire tap` forwards or listens to.

use std::net::{TcpListener, UdpSocket};

use anyhow::{Result, bail};
use serialport::SerialPort;

use crate::io::tap::{self, Watch};
use cellwire_io::latency::Deadline;
use cellwire_io::output::remark;
use cellwire_io::serial::{self, Mode, baud_rate};
use cellwire_io::tcp::ConnectArgs;
use cellwire_io::{output, tcp, udp};

/// Where the ends are.
#[derive(Debug, clap::Args)]
pub(in crate::command) struct TapTransportArgs {
    /// Listen for clients on this address; a port alone means 127.0.0.1
    #[arg(long, value_name = "ADDR", requires = "connect", conflicts_with = "a")]
    listen: Option<String>,
    /// The address of the server, to which each client's bytes are forwarded
    #[arg(long, value_name = "ADDR", requires = "listen")]
    connect: Option<String>,
    /// Forward UDP datagrams instead of TCP connections
    #[arg(long, requires = "listen")]
    udp: bool,
    #[command(flatten)]
    dialing: ConnectArgs,
    /// The serial port of the end that would be the client over TCP: the PC, or Kawasaki's robot
    #[arg(long, value_name = "PORT")]
    a: Option<String>,
    /// The serial port of the other end
    #[arg(long, value_name = "PORT", requires = "a")]
    b: Option<String>,
    /// Only listen, as with the receive lines of a Y cable; with --a alone, to a line that carries both directions
    #[arg(long, requires = "a")]
    listen_only: bool,
    /// The baud rate of the ports
    #[arg(long, value_name = "N", default_value = "9600", value_parser = baud_rate())]
    baud: u32,
    /// Data bits, parity and stop bits of the ports, such as 8E1
    #[arg(long, value_name = "MODE", default_value = "8N1")]
    mode: Mode,
}

impl TapTransportArgs {
    /// Returns the rate of the serial ports, if there are any.
    pub(super) fn baud(&self) -> Option<u32> {
        self.a.as_ref().map(|_| self.baud)
    }
}

/// The transport that `cellwire tap` forwards or listens to.
pub(in crate::command) enum TapTransport {
    Tcp(TcpListener),
    Udp(UdpSocket),
    /// Ports with their names: one or two.
    Ports(NamedPort, Option<NamedPort>),
}

type NamedPort = (String, Box<dyn SerialPort>);

impl TapTransport {
    pub(in crate::command) fn open(args: &TapTransportArgs) -> Result<Self> {
        let port = |name: &str| -> Result<NamedPort> {
            Ok((name.to_owned(), serial::open_with(name, args.baud, args.mode)?))
        };
        if let Some(server) = &args.connect {
            tcp::check(server)?;
        }
        match (&args.listen, &args.a, &args.b) {
            (Some(address), ..) if args.udp => Ok(Self::Udp(udp::bind(address)?)),
            (Some(address), ..) => Ok(Self::Tcp(tcp::listen(address)?)),
            (None, Some(a), Some(b)) => Ok(Self::Ports(port(a)?, Some(port(b)?))),
            (None, Some(a), None) if args.listen_only => Ok(Self::Ports(port(a)?, None)),
            (None, Some(a), None) => {
                bail!("give the other end's port with --b, or --listen-only if {a} carries both directions")
            }
            (None, None, _) => {
                bail!("give --listen and --connect for a network, or --a and --b for serial ports")
            }
        }
    }

    /// Reports adapters that are too slow for the link between the two ports.
    pub(super) fn advise(&self, link: &str, args: &TapTransportArgs) {
        let Self::Ports((a, _), Some((b, _))) = self else { return };
        let Some(deadline) = Deadline::between(link, args.baud).filter(|_| !args.listen_only) else { return };
        [a, b].iter().filter_map(|port| deadline.advice(port)).for_each(|advice| remark(&advice));
    }

    /// Prints where it is ready.
    pub(super) fn announce(&self) -> Result<()> {
        match self {
            Self::Tcp(listener) => output::ready("tap", "listen", &listener.local_addr()?.to_string()),
            Self::Udp(socket) => output::ready("tap", "listen", &socket.local_addr()?.to_string()),
            Self::Ports((a, _), None) => output::ready("tap", "port", a),
            Self::Ports((a, _), Some((b, _))) => output::ready("tap", "ports", &format!("{a} {b}")),
        }
    }

    /// Passes bytes on until the ports are gone; nothing is seen after that.
    pub(in crate::command) fn pass(self, args: &TapTransportArgs, watch: &Watch) -> Result<()> {
        let passed = self.run(args, watch);
        watch.close();
        passed
    }

    fn run(self, args: &TapTransportArgs, watch: &Watch) -> Result<()> {
        let server = args.connect.as_deref().unwrap_or_default();
        match self {
            Self::Tcp(listener) => tap::tcp::run(&listener, server, args.dialing.dialing(), watch),
            Self::Udp(socket) => tap::udp::run(&socket, server, watch),
            Self::Ports(a, Some(b)) if !args.listen_only => tap::serial::join([a, b], watch),
            Self::Ports(a, b) => tap::serial::listen(a, b, watch),
        }
    }
}
