//! The rows of both machines' tables, for each transport.

use core::marker::PhantomData;
use core::time::Duration;

use fanuc_hmi_modbus::client::machine::{
    self as client, ClientLink, ClientMachine, DueRequest, QuietTime, ReplyMatch, RequestState, Stage,
};
use fanuc_hmi_modbus::server::machine::{self as server, Line, ServerLink, ServerMachine};
use fanuc_hmi_modbus::{ClientConfig, ServerConfig};
use robot_session::end::{Input as _, Machine as _, is_due};

use crate::model::{DrawnMachine, NOW, Rows};

/// Shorter than `NOW` even twice: a wait that begins at zero is over.
const TIME: Duration = Duration::from_millis(400);

/// The differences between the tables.
pub trait Transport {
    /// The beginning of the names of its rows.
    const NAME: &'static str;

    /// Returns the configuration of a client of it.
    fn client() -> ClientConfig;

    /// Returns the configuration of a server of it.
    fn server() -> ServerConfig;
}

/// Modbus TCP.
#[derive(Debug)]
pub enum Tcp {}

/// A serial line.
#[derive(Debug)]
pub enum Rtu {}

/// RTU frames through a TCP connection.
#[derive(Debug)]
pub enum RtuOverTcp {}

impl Transport for Tcp {
    const NAME: &'static str = "TCP";

    fn client() -> ClientConfig {
        ClientConfig::tcp()
    }

    fn server() -> ServerConfig {
        ServerConfig::tcp()
    }
}

impl Transport for Rtu {
    const NAME: &'static str = "RTU";

    fn client() -> ClientConfig {
        ClientConfig::rtu(19_200)
    }

    fn server() -> ServerConfig {
        ServerConfig::rtu(1, 19_200)
    }
}

impl Transport for RtuOverTcp {
    const NAME: &'static str = "RTU over TCP";

    fn client() -> ClientConfig {
        ClientConfig::rtu_over_tcp()
    }

    fn server() -> ServerConfig {
        ServerConfig::rtu_over_tcp(1)
    }
}

/// The client, with `N` slots.
#[derive(Debug)]
pub struct Client<T, const N: usize = 2>(PhantomData<T>);

/// Returns the state of a client with its requests, oldest first.
pub fn client_state<const N: usize>(machine: &ClientMachine<N>) -> String {
    let stages: Vec<&str> = machine
        .held()
        .map(|held| match held.stage {
            Stage::Queued { mirrored: false } => "queued",
            Stage::Queued { mirrored: true } => "queued mirrored",
            Stage::Probing { .. } => "probing",
            Stage::QueuedBroadcast => "queued broadcast",
            Stage::InFlight { .. } => "in flight",
            Stage::Ended => "ended",
            Stage::TimedOut { .. } => "timed out",
            Stage::Expired { .. } => "expired",
        })
        .collect();
    let list = if stages.is_empty() { String::new() } else { format!(" ({})", stages.join(", ")) };
    format!("{}{list}", machine.name())
}

impl<T: Transport, const N: usize> Client<T, N> {
    /// Returns the transaction of the first request.
    fn first() -> u16 {
        u16::from(T::NAME == Tcp::NAME)
    }
}

impl<T: Transport, const N: usize> Rows for Client<T, N> {
    type Machine = ClientMachine<N>;

    fn states() -> Vec<ClientMachine<N>> {
        use client::Input as On;
        let config = Self::config();
        let after = |inputs: &[(Duration, On)]| {
            let mut machine = ClientMachine::NEW;
            for (now, input) in inputs {
                machine.on(*now, *input, &config).expect("a state that can be reached");
            }
            machine
        };
        let request = |broadcast, mirrored| On::Request { broadcast, mirrored };
        let (ask, mirror, announce) = (request(false, false), request(false, true), request(true, false));
        let due = DueRequest { slot: 0, transaction: Self::first(), probe: false };
        let (sent, probed) = (On::Sent(due), On::Sent(DueRequest { probe: true, ..due }));
        let reply = On::Reply { transaction: Self::first(), fit: ReplyMatch::Full };
        let equal = On::Reply { transaction: Self::first(), fit: ReplyMatch::Equal };
        let mut states = Vec::new();
        // Nothing is over yet; everything is.
        for at in [NOW, Duration::ZERO] {
            // On a serial line the drain is over.
            let open = [(Duration::ZERO, On::Connected), (NOW, On::Timeout)];
            let up = |inputs: &[On]| {
                let inputs: Vec<_> = inputs.iter().map(|input| (at, *input)).collect();
                after(&[&open[..], &inputs].concat())
            };
            let timed_out = [(Duration::ZERO, ask), (Duration::ZERO, sent), (at + TIME, On::Timeout)];
            let timed_out = [&open[..], &timed_out].concat();
            let taken = [&timed_out[..], &[(at, On::Taken { slot: 0 })]].concat();
            states.extend([
                ClientMachine::NEW,
                after(&[(at, ask)]),
                after(&[(at, On::Connected)]),
                up(&[]),
                up(&[ask]),
                up(&[ask, ask]),
                up(&[announce]),
                up(&[On::Received]),
                up(&[ask, sent]),
                up(&[ask, sent, On::Received]),
                up(&[ask, sent, On::Received, On::Corrupt]),
                up(&[ask, sent, reply]),
            ]);
            if T::NAME != Tcp::NAME {
                states.push(up(&[ask, sent, On::Received, On::Partial]));
                // The sent bytes have come back on a line that is not proven.
                states.push(up(&[ask, sent, On::Received, equal]));
                states.extend([after(&[(at, mirror)]), up(&[mirror]), up(&[mirror, probed])]);
                states.push(up(&[mirror, probed, On::Received]));
                states.push(up(&[mirror, probed, On::Received, On::Corrupt]));
                states.push(up(&[mirror, probed, On::Received, On::Partial]));
            }
            states.extend([after(&timed_out), after(&taken), up(&[announce, sent])]);
        }
        states
    }

    fn inputs() -> Vec<client::Input> {
        use client::Input as On;
        let transaction = Self::first();
        let mut inputs = vec![
            On::Connected,
            On::Disconnected,
            On::Timeout,
            On::Request { broadcast: false, mirrored: false },
            On::Request { broadcast: true, mirrored: false },
            On::Taken { slot: 0 },
            On::Received,
            On::Reply { transaction, fit: ReplyMatch::Full },
            On::Reply { transaction, fit: ReplyMatch::Equal },
            On::Reply { transaction, fit: ReplyMatch::Exception },
            On::Reply { transaction, fit: ReplyMatch::OpenException },
            On::Reply { transaction, fit: ReplyMatch::Mismatch },
            On::Corrupt,
            On::Sent(DueRequest { slot: 0, transaction, probe: false }),
        ];
        // Without transactions every reply has that of every request, and only its bytes show where it ends.
        if transaction > 0 {
            inputs.push(On::Reply { transaction: 77, fit: ReplyMatch::Full });
        } else {
            inputs.push(On::Partial);
            inputs.push(On::Request { broadcast: false, mirrored: true });
            inputs.push(On::Sent(DueRequest { slot: 0, transaction, probe: true }));
        }
        inputs
    }

    fn config() -> ClientConfig {
        ClientConfig { timeout: TIME, settle: TIME, turnaround: TIME, ..T::client() }
    }

    fn row(machine: &ClientMachine<N>, _now: Duration) -> String {
        let bytes = match machine.link {
            ClientLink::Up { line: Line::Partial { .. }, .. } => ", the beginning of a reply",
            ClientLink::Up { line: Line::Busy { .. }, .. } if machine.name() != "Receiving" => ", bytes",
            ClientLink::Up { .. } | ClientLink::Down => "",
        };
        let is_doubtful = |held: &RequestState| match held.stage {
            Stage::Probing { doubtful, .. } | Stage::InFlight { doubtful, .. } => doubtful,
            _ => false,
        };
        let doubt = if machine.held().any(is_doubtful) { ", in doubt" } else { "" };
        let is_returned = |held: &RequestState| matches!(held.stage, Stage::InFlight { returned: true, .. });
        let returned = if machine.held().any(is_returned) { ", returned" } else { "" };
        format!("{}, {}{bytes}{doubt}{returned}", T::NAME, client_state(machine))
    }

    fn column_at(machine: &ClientMachine<N>, now: Duration, input: &client::Input) -> String {
        let (is_silent, is_quiet_over) = match machine.link {
            ClientLink::Up { line, quiet, .. } => (
                match line {
                    Line::Busy { silent_at: at } | Line::Partial { until: at } => is_due(at, now),
                    Line::Silent => false,
                },
                matches!(quiet, QuietTime::Until { end } if is_due(end, now)),
            ),
            ClientLink::Down => (false, false),
        };
        let more = match *input {
            client::Input::Received if is_silent => " after a silence",
            client::Input::Timeout if is_silent => " of a silence",
            client::Input::Timeout if is_quiet_over => " of the quiet",
            client::Input::Timeout => " of a request",
            client::Input::Sent(DueRequest { probe: true, .. }) => " to probe",
            client::Input::Reply { transaction, .. } => {
                let is_late = |stage| match stage {
                    Stage::TimedOut { transaction: found } | Stage::Expired { transaction: found } => {
                        found == transaction
                    }
                    _ => false,
                };
                let is_expected = machine.held().any(|held| match held.stage {
                    Stage::Probing { .. } => true,
                    Stage::InFlight { transaction: found, .. } => found == transaction,
                    _ => false,
                });
                // A frame is compared with the request in flight that it belongs to.
                match machine.link {
                    ClientLink::Up { .. } if is_expected => "",
                    _ if machine.held().any(|held| is_late(held.stage)) => return "Reply(late)".into(),
                    _ => return "Reply(of nothing)".into(),
                }
            }
            _ => "",
        };
        format!("{}{more}", input.name())
    }
}

/// The server, with `N` slots.
#[derive(Debug)]
pub struct Server<T, const N: usize = 2>(PhantomData<T>);

/// Returns the state of a server with the number of its replies.
pub fn server_state<const N: usize>(machine: &ServerMachine<N>) -> String {
    match machine.link {
        ServerLink::Up { replies: 0, .. } | ServerLink::Down => machine.name().into(),
        ServerLink::Up { replies, .. } => format!("{} ({replies})", machine.name()),
    }
}

impl<T: Transport, const N: usize> Rows for Server<T, N> {
    type Machine = ServerMachine<N>;

    fn states() -> Vec<ServerMachine<N>> {
        let serial = T::NAME == Rtu::NAME;
        let mut states = vec![ServerMachine::NEW];
        for replies in 0..=2 {
            let busy = |at: Duration| Line::Busy { silent_at: at };
            let partial = |at: Duration| Line::Partial { until: at };
            for line in
                [Line::Silent, busy(NOW + TIME), busy(NOW - TIME), partial(NOW + TIME), partial(NOW - TIME)]
            {
                // On TCP frames have their length, and through TCP nothing is known of the line.
                let is_possible = match line {
                    Line::Silent => true,
                    Line::Busy { .. } => T::NAME != Tcp::NAME,
                    Line::Partial { .. } => serial,
                };
                if is_possible {
                    states.push(ServerMachine { link: ServerLink::Up { line, serial, replies } });
                }
            }
        }
        states
    }

    fn inputs() -> Vec<server::Input> {
        use server::Input as On;
        let request = |unit, is_last| On::Request { unit, is_last };
        let mut requests = [1, 2, 0].map(|unit| request(unit, true)).to_vec();
        // Through TCP a client need not wait.
        if T::NAME == Rtu::NAME {
            requests.extend([1, 2, 0].map(|unit| request(unit, false)));
            requests.push(On::Partial);
        }
        [&[On::Connected, On::Disconnected, On::Timeout, On::Received, On::Sent], &requests[..]].concat()
    }

    fn config() -> ServerConfig {
        T::server()
    }

    fn row(machine: &ServerMachine<N>, _now: Duration) -> String {
        let is_full = matches!(machine.link, ServerLink::Up { replies, .. } if usize::from(replies) == N);
        let is_partial = matches!(machine.link, ServerLink::Up { line: Line::Partial { .. }, .. });
        let partial = if is_partial { ", the beginning of a frame" } else { "" };
        format!("{}, {}{partial}{}", T::NAME, server_state(machine), if is_full { ", full" } else { "" })
    }

    fn column(input: &server::Input) -> String {
        match input {
            server::Input::Request { unit, is_last } => {
                let name = match unit {
                    1 => "Request".into(),
                    0 => "Request(unit 0)".into(),
                    _ => String::from("Request(another unit)"),
                };
                if *is_last { name } else { name + ", followed" }
            }
            _ => input.name().into(),
        }
    }
}

impl DrawnMachine for ClientMachine<2> {}
impl DrawnMachine for ServerMachine<2> {}
