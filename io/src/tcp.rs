//! TCP: errors that contain advice.

use core::ops::RangeInclusive;
use std::io::{self, ErrorKind};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::thread;
use std::time::Duration;

use anyhow::{Result, anyhow, ensure};
use socket2::SockRef;

use crate::input::time;
use crate::output::remark;

/// Listens on an address; a port alone is one of this machine's loopback address. Access from other machines is reported on
/// standard error: none of the protocols has authentication.
///
/// # Errors
/// When the address is invalid, in use, or not this machine's. The error contains advice.
pub fn listen(address: &str) -> Result<TcpListener> {
    let port: Option<u16> = address.parse().ok();
    let bound = match port {
        Some(port) => TcpListener::bind((Ipv4Addr::LOCALHOST, port)),
        None => TcpListener::bind(address),
    };
    let listener = bound.map_err(|error| advise(address, error))?;
    warn_unless_loopback(listener.local_addr()?);
    Ok(listener)
}

/// Returns the error of an address that cannot be listened on, with advice.
pub(super) fn advise(address: &str, error: io::Error) -> anyhow::Error {
    let advice = match error.kind() {
        ErrorKind::AddrInUse => "the port is in use; choose another, or port 0 for any free one",
        ErrorKind::PermissionDenied => "ports below 1024 need more privileges; choose a higher one",
        ErrorKind::AddrNotAvailable => "the address is not local; use 127.0.0.1 or 0.0.0.0",
        _ if address.starts_with(':') || error.kind() == ErrorKind::InvalidInput => {
            "give an address and a port from 0 to 65535, such as 127.0.0.1:9105, or a port alone"
        }
        _ => "",
    };
    let context = format!("cannot listen on {address}");
    match advice {
        "" => anyhow::Error::new(error).context(context),
        advice => anyhow!("{context}: {advice}"),
    }
}

/// Remarks that other computers can reach an address that is listened on.
pub fn warn_unless_loopback(place: SocketAddr) {
    if !place.ip().is_loopback() {
        remark(&format!(
            "warning: {place} is open to the network without authentication; use 127.0.0.1 to restrict it to this machine"
        ));
    }
}

/// The settings by which a client opens its connections.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dialing {
    /// The time that a TCP connection may take to open.
    pub timeout: Duration,
    /// The pause between a connection, or an open serial port, and the first byte that is sent. Some devices lose bytes that
    /// arrive sooner.
    pub pause: Duration,
}

impl Default for Dialing {
    fn default() -> Self {
        Self { timeout: Duration::from_secs(5), pause: Duration::ZERO }
    }
}

impl Dialing {
    /// Pauses after a serial port was opened.
    pub fn pause(self) {
        thread::sleep(self.pause);
    }
}

/// The range of the time that a connection may take to open.
const TIMEOUTS: RangeInclusive<Duration> = Duration::from_millis(10)..=Duration::from_secs(3600);
/// The longest pause before the first byte.
pub const MAX_PAUSE: Duration = Duration::from_secs(60);

/// The option for opening the connections of a client, whose settings have the pause.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct TimeoutArgs {
    /// The longest wait for a connection
    #[arg(long, value_name = "TIME", default_value = "5s", value_parser = time(TIMEOUTS))]
    connect_timeout: Duration,
}

impl TimeoutArgs {
    /// Returns the settings of a client's connections, with this pause.
    pub const fn dialing(self, pause: Duration) -> Dialing {
        Dialing { timeout: self.connect_timeout, pause }
    }
}

/// The options for opening the connections of a command without the setting `connect_pause`.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct ConnectArgs {
    #[command(flatten)]
    timeout: TimeoutArgs,
    /// Wait between a new connection and the first byte, for devices that lose what comes sooner
    #[arg(long, value_name = "TIME", default_value = "0s", hide_short_help = true, value_parser = time(Duration::ZERO..=MAX_PAUSE))]
    connect_pause: Duration,
}

impl ConnectArgs {
    /// Returns the settings of a client's connections.
    pub const fn dialing(self) -> Dialing {
        self.timeout.dialing(self.connect_pause)
    }
}

/// Checks that an address has a port, before any other action.
///
/// # Errors
/// When it lacks one.
pub fn check(address: &str) -> Result<()> {
    let port = address.rsplit_once(':').and_then(|(host, port)| Some((host, port.parse::<u16>().ok()?)));
    match port {
        Some((host, _)) if !host.is_empty() => Ok(()),
        _ => Err(without_port(address)),
    }
}

/// Returns the error of an address that lacks its port.
fn without_port(address: &str) -> anyhow::Error {
    anyhow!("cannot connect to {address}: give HOST:PORT, such as 192.168.0.10:502")
}

/// Looks an address up.
///
/// # Errors
/// When it has no port, or its name has no address.
pub fn resolve(address: &str) -> Result<impl Iterator<Item = SocketAddr>> {
    let mut found = address
        .to_socket_addrs()
        .map_err(|error| match error.kind() {
            ErrorKind::InvalidInput => without_port(address),
            _ => anyhow::Error::new(error).context(format!("cannot connect to {address}")),
        })?
        .peekable();
    ensure!(found.peek().is_some(), "cannot connect to {address}: the name has no address");
    Ok(found)
}

/// Connects, without Nagle's delay, because each exchange is one packet in each direction. Returns after the pause.
///
/// # Errors
/// When the connection is refused, or not there within the timeout.
pub fn connect(address: &str, dialing: Dialing) -> Result<TcpStream> {
    let timeout = dialing.timeout;
    let context = || format!("cannot connect to {address}");
    let (mut stream, mut last) = (None, anyhow!(context()));
    for place in resolve(address)? {
        match TcpStream::connect_timeout(&place, timeout) {
            Ok(found) => {
                stream = Some(found);
                break;
            }
            Err(error) if error.kind() == ErrorKind::TimedOut => {
                let time = timeout.as_secs_f64();
                last = anyhow!("{}: no answer within {time} s, see --connect-timeout", context());
            }
            Err(error) => last = anyhow::Error::new(error).context(context()),
        }
    }
    let stream = stream.ok_or(last)?;
    stream.set_nodelay(true)?;
    // Without keepalive, a program that never writes does not notice that a serial device server was power-cycled.
    SockRef::from(&stream).set_tcp_keepalive(&cellwire_sim::host::probes())?;
    dialing.pause();
    Ok(stream)
}

/// When bytes are discarded that a peer has not acknowledged, where the link's own time is not known.
pub const DISCARD_AFTER: Duration = Duration::from_secs(2);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::show_remarks;

    #[test]
    fn a_peer_that_vanishes_is_noticed() {
        let peer = listen("127.0.0.1:0").unwrap();
        let stream = connect(&peer.local_addr().unwrap().to_string(), Dialing::default()).unwrap();
        assert!(SockRef::from(&stream).keepalive().unwrap());
    }

    #[test]
    fn a_connection_is_used_after_its_pause() {
        let peer = listen("127.0.0.1:0").unwrap();
        let dialing = Dialing { pause: Duration::from_millis(20), ..Dialing::default() };
        let start = std::time::Instant::now();
        let _stream = connect(&peer.local_addr().unwrap().to_string(), dialing).unwrap();
        assert!(start.elapsed() >= dialing.pause);
    }

    #[test]
    fn an_address_that_cannot_be_listened_on_is_an_error_with_advice() {
        let advice = ": give an address and a port from 0 to 65535, such as 127.0.0.1:9105, or a port alone";
        for (address, kind, expected) in [
            ("nonsense", ErrorKind::InvalidInput, advice),
            (":9105", ErrorKind::NotFound, advice),
            ("nonsense:9105", ErrorKind::NotFound, ": entity not found"),
            (
                "80",
                ErrorKind::PermissionDenied,
                ": ports below 1024 need more privileges; choose a higher one",
            ),
            (
                "192.0.2.7:9105",
                ErrorKind::AddrNotAvailable,
                ": the address is not local; use 127.0.0.1 or 0.0.0.0",
            ),
        ] {
            let error = format!("{:#}", advise(address, kind.into()));
            assert_eq!(error, format!("cannot listen on {address}{expected}"));
        }
    }

    #[test]
    fn an_address_that_others_can_reach_is_remarked_upon() {
        let (screen, remarks) = std::sync::mpsc::channel();
        show_remarks(Some(screen));
        for place in ["127.0.0.1:9", "[::1]:9", "192.0.2.7:9"] {
            warn_unless_loopback(place.parse().unwrap());
        }
        show_remarks(None);
        // Other tests may remark upon their ports.
        let remarks: Vec<String> = remarks.try_iter().filter(|it| it.contains(":9 ")).collect();
        assert_eq!(
            remarks,
            [
                "warning: 192.0.2.7:9 is open to the network without authentication; use 127.0.0.1 to restrict it to this machine"
            ]
        );
    }

    #[test]
    fn the_error_of_a_port_in_use_contains_advice() {
        let taken = listen("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap().to_string();
        let error = listen(&address).unwrap_err().to_string();
        assert_eq!(
            error,
            format!(
                "cannot listen on {address}: the port is in use; choose another, or port 0 for any free one"
            )
        );
        assert!(format!("{:#}", listen("nonsense").unwrap_err()).starts_with("cannot listen on nonsense: "));
        assert_eq!(
            connect("nonsense", Dialing::default()).unwrap_err().to_string(),
            "cannot connect to nonsense: give HOST:PORT, such as 192.168.0.10:502"
        );
    }
}
