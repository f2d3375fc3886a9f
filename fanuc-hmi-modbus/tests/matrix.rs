//! What each machine does in each state with each input, as committed in `state_matrix.txt`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::fmt::Write as _;
use core::time::Duration;

use fanuc_hmi_modbus::{
    ClientAction, ClientConfig, ClientInput, ClientMachine, Framing, ServerConfig, ServerInput,
    ServerMachine, Stage,
};

const ZERO: Duration = Duration::ZERO;
const S: Duration = Duration::from_secs(1);
/// Late enough for every deadline of the states here.
const LATE: Duration = Duration::from_secs(100);

type Client = ClientMachine<2>;
type Server = ServerMachine<2>;

/// The state after these inputs, at the beginning of time.
fn client(config: &ClientConfig, inputs: &[(Duration, ClientInput)]) -> Client {
    let mut machine = Client::NEW;
    for (now, input) in inputs {
        machine.on(*now, *input, config).unwrap();
    }
    machine
}

fn stages(machine: &Client) -> String {
    let stage = |stage| match stage {
        Stage::Queued => "queued",
        Stage::QueuedBroadcast => "queued broadcast",
        Stage::InFlight { .. } => "in flight",
        Stage::Ended => "ended",
        Stage::TimedOut { .. } => "timed out",
        Stage::Expired { .. } => "expired",
    };
    let stages: Vec<_> = machine.held().map(|held| stage(held.stage)).collect();
    if stages.is_empty() { String::new() } else { format!(" ({})", stages.join(", ")) }
}

fn clients(text: &mut String, name: &str, config: &ClientConfig) {
    use ClientInput as On;
    let ask = On::Request { broadcast: false };
    let announce = On::Request { broadcast: true };
    let connected = (ZERO, On::Connected);
    // On a serial line the drain has to pass.
    let open = [connected, (LATE, On::Timer)];
    let with = |more: &[(Duration, ClientInput)]| client(config, &[&open[..], more].concat());
    let sent = [(ZERO, ask), (LATE, On::Transmit)];
    let timed_out = [sent[0], sent[1], (2 * LATE, On::Timer)];
    let states = [
        ("without a connection", Client::NEW),
        ("without a connection, a request", client(config, &[(ZERO, ask)])),
        ("just connected", client(config, &[connected])),
        ("idle", with(&[])),
        ("a request", with(&[(ZERO, ask)])),
        ("two requests", with(&[(ZERO, ask), (ZERO, ask)])),
        ("a broadcast", with(&[(ZERO, announce)])),
        ("bytes are arriving", with(&[(LATE, On::Received)])),
        ("in flight", with(&sent)),
        ("in flight, bytes are arriving", with(&[sent[0], sent[1], (LATE, On::Received)])),
        ("replied", with(&[sent[0], sent[1], (LATE, On::Reply { transaction: first(config), fits: true })])),
        ("timed out", with(&timed_out)),
        (
            "timed out, and taken",
            with(&[timed_out[0], timed_out[1], timed_out[2], (ZERO, On::Taken { place: 0 })]),
        ),
        ("broadcast sent", with(&[(ZERO, announce), (LATE, On::Transmit)])),
    ];
    // What was in flight since LATE is overdue at the last of these times; nothing is at the first.
    let inputs = [
        ("connected", LATE, On::Connected),
        ("disconnected", LATE, On::Disconnected),
        ("request", LATE, ask),
        ("broadcast", LATE, announce),
        ("outcome taken", LATE, On::Taken { place: 0 }),
        ("transmit", LATE, On::Transmit),
        ("transmit, late", 3 * LATE, On::Transmit),
        ("bytes", LATE, On::Received),
        ("bytes after a silence", 3 * LATE, On::Received),
        ("its reply", LATE, On::Reply { transaction: first(config), fits: true }),
        ("a reply that does not fit", LATE, On::Reply { transaction: first(config), fits: false }),
        ("a reply of another transaction", LATE, On::Reply { transaction: 77, fits: true }),
        ("timer, early", ZERO, On::Timer),
        ("timer", 3 * LATE, On::Timer),
    ];
    for (state, machine) in states {
        writeln!(text, "Client: {name}, {state}").unwrap();
        for (label, now, input) in inputs {
            let mut next = machine.clone();
            let cell = match next.on(now, input, config) {
                Ok(action) => format!("{}{}, {}", next.name(), stages(&next), short(action)),
                Err(unexpected) => {
                    assert_eq!(next, machine, "nothing has changed");
                    assert_eq!((unexpected.state, unexpected.input), (machine.name(), input.name()));
                    "unexpected".into()
                }
            };
            writeln!(text, "    {label} → {cell}").unwrap();
        }
    }
}

/// The transaction of the first request.
fn first(config: &ClientConfig) -> u16 {
    u16::from(config.framing == Framing::Tcp)
}

fn short(action: ClientAction) -> String {
    let places = |places: fanuc_hmi_modbus::Places| places.iter().collect::<Vec<_>>();
    match action {
        ClientAction::TimedOut(all) => format!("TimedOut {:?}", places(all)),
        ClientAction::Reset { lost, not_sent } => {
            format!("Reset {{ lost: {:?}, not_sent: {:?} }}", places(lost), places(not_sent))
        }
        other => format!("{other:?}"),
    }
}

fn servers(text: &mut String, name: &str, config: &ServerConfig) {
    use ServerInput as On;
    let server = |inputs: &[(Duration, ServerInput)]| {
        let mut machine = Server::NEW;
        for (now, input) in inputs {
            machine.on(*now, *input, config).unwrap();
        }
        machine
    };
    let (connected, request) = ((ZERO, On::Connected), (ZERO, On::Request { unit: 1 }));
    let states = [
        ("without a connection", Server::NEW),
        ("idle", server(&[connected])),
        ("bytes are arriving", server(&[connected, (LATE, On::Received)])),
        ("a reply waits", server(&[connected, request])),
        ("a reply waits, bytes are arriving", server(&[connected, (LATE, On::Received), request])),
        ("two replies wait", server(&[connected, request, request])),
    ];
    let inputs = [
        ("connected", LATE, On::Connected),
        ("disconnected", LATE, On::Disconnected),
        ("bytes", LATE, On::Received),
        ("bytes after a silence", 2 * LATE, On::Received),
        ("a request for this unit", LATE, On::Request { unit: 1 }),
        ("a request for another unit", LATE, On::Request { unit: 2 }),
        ("a request for unit 0", LATE, On::Request { unit: 0 }),
        ("transmit", LATE, On::Transmit),
        ("timer, early", LATE, On::Timer),
        ("timer", 2 * LATE, On::Timer),
    ];
    for (state, machine) in states {
        writeln!(text, "Server: {name}, {state}").unwrap();
        for (label, now, input) in inputs {
            let mut next = machine;
            let cell = match next.on(now, input, config) {
                Ok(action) => format!("{}, {action:?}", next.name()),
                Err(unexpected) => {
                    assert_eq!(next, machine, "nothing has changed");
                    assert_eq!((unexpected.state, unexpected.input), (machine.name(), input.name()));
                    "unexpected".into()
                }
            };
            writeln!(text, "    {label} → {cell}").unwrap();
        }
    }
}

#[test]
fn the_state_matrix_is_the_committed_one() {
    let mut text = String::new();
    let long = |config: ClientConfig| ClientConfig { timeout: S, settle: S, turnaround: S, ..config };
    for (name, client, server) in [
        ("TCP", ClientConfig::tcp(), ServerConfig::tcp()),
        ("RTU", ClientConfig::rtu(19_200), ServerConfig::rtu(1, 19_200)),
        ("RTU over TCP", ClientConfig::rtu_over_tcp(), ServerConfig::rtu_over_tcp(1)),
    ] {
        clients(&mut text, name, &long(client));
        servers(&mut text, name, &server);
    }
    if std::env::var_os("WRITE_MATRIX").is_some() {
        std::fs::write(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/state_matrix.txt"), &text).unwrap();
    }
    assert_eq!(text, include_str!("state_matrix.txt"), "\n{text}");
}
