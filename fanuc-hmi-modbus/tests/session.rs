//! Both ends on a faulty link with a virtual clock, and the state matrix.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation
)]

mod common;

use core::fmt::Write;
use core::time::Duration;
use std::collections::BTreeMap;

use common::{Bank, MS, Told, read, tcp, told};
use fanuc_hmi_modbus::client::{self, Ticket};
use fanuc_hmi_modbus::state::{self, State};
use fanuc_hmi_modbus::{Client, Request, Server, server};
use testkit::link::{Delivery, End, Faults, Link};

#[test]
fn the_state_matrix() {
    let mut matrix = String::new();
    for state in State::ALL {
        for event in state::Event::ALL {
            if let Some(next) = state::next(state, event) {
                writeln!(matrix, "{state:?} + {event:?} = {next:?}").unwrap();
            }
        }
    }
    assert_eq!(
        matrix,
        "Free + Request = Queued\n\
         Queued + Transmit = Sent\n\
         Queued + Announce = Announced\n\
         Queued + Disconnect = NotSent\n\
         Sent + Reply = Free\n\
         Sent + Deadline = TimedOut\n\
         Sent + Disconnect = Lost\n\
         Announced + Report = Free\n\
         TimedOut + Reply = Free\n\
         TimedOut + Disconnect = Lost\n\
         TimedOut + Report = Expired\n\
         Lost + Report = Free\n\
         NotSent + Report = Free\n\
         Expired + Request = Queued\n\
         Expired + Reply = Free\n\
         Expired + Disconnect = Free\n"
    );
}

/// How a run over a faulty link ended.
#[derive(Debug, Default)]
struct Outcome {
    replies: usize,
    failed: usize,
    strays: usize,
    damaged: usize,
    made: usize,
}

/// Both ends until `requests` have ended. Every write has a value of its own; every read is checked against what its register
/// holds for ever.
fn run(
    seed: u64,
    faults: Faults,
    client: client::Config,
    server: server::Config,
    requests: usize,
) -> Outcome {
    let mut link = Link::new(seed, faults);
    let (mut client, mut server) = (Client::<4>::new(client), Server::new(server));
    let mut bank = Bank::new();
    let mut open: BTreeMap<Ticket, Option<u16>> = BTreeMap::new();
    let mut outcome = Outcome::default();
    let mut certain = Vec::new();
    let mut value = 0;
    let mut now = MS;
    let mut out = [0; 260];
    for step in 0.. {
        assert!(step < 200_000, "{outcome:?} stands still at {now:?} with {open:?}");
        while outcome.made < requests {
            let writes = outcome.made % 3 == 0;
            let words = [value + 1; 1];
            let request = if writes {
                Request::WriteRegisters { address: 50, values: (&words).into() }
            } else {
                read((outcome.made % 40) as u16, 3)
            };
            let Ok(ticket) = client.request(1, &request) else { break };
            value += u16::from(writes);
            open.insert(ticket, writes.then_some(value));
            outcome.made += 1;
        }
        if open.is_empty() && outcome.made == requests {
            break;
        }
        while let Some(len) = client.poll_transmit(now, &mut out) {
            link.send(End::A, now, &out[..len]);
        }
        while let Some(len) = server.poll_transmit(now, &mut bank, &mut out) {
            link.send(End::B, now, &out[..len]);
        }
        let next =
            [link.next_delivery(), client.poll_timeout(), server.poll_timeout()].into_iter().flatten().min();
        now = next.unwrap_or(now).max(now + Duration::from_micros(1));
        let mut closed = false;
        while let Some(delivery) = link.receive(End::B, now) {
            match delivery {
                Delivery::Bytes(bytes) => assert_eq!(server.handle_input(now, &bytes), bytes.len()),
                Delivery::Closed => server.reset(),
            }
        }
        while let Some(delivery) = link.receive(End::A, now) {
            match delivery {
                Delivery::Bytes(bytes) => assert_eq!(client.handle_input(now, &bytes), bytes.len()),
                Delivery::Closed => closed = true,
            }
        }
        client.handle_timeout(now);
        server.handle_timeout(now);
        if closed {
            client.handle_disconnect();
        }
        while let Some(event) = client.poll_event() {
            let ticket = match told(event) {
                Told::Registers(ticket, words) => {
                    assert!(words.windows(2).all(|w| w[1] == w[0] + 7), "{words:?} were never side by side");
                    outcome.replies += 1;
                    ticket
                }
                Told::Written(ticket) => {
                    outcome.replies += 1;
                    certain.push(open[&ticket].expect("a write"));
                    ticket
                }
                Told::Failed(ticket, _) => {
                    outcome.failed += 1;
                    ticket
                }
                Told::Stray { .. } => {
                    outcome.strays += 1;
                    continue;
                }
                Told::Damaged(_) => {
                    outcome.damaged += 1;
                    continue;
                }
                other => panic!("{other:?}"),
            };
            assert!(open.remove(&ticket).is_some(), "{ticket:?} ended twice");
        }
        if closed {
            server.reset();
            link.reconnect();
        }
    }
    let mut written: Vec<u16> = bank.writes.iter().map(|(_, value)| *value).collect();
    assert!(certain.iter().all(|value| written.contains(value)), "an acknowledged write was lost");
    let all = written.len();
    written.dedup();
    assert_eq!(written.len(), all, "a write was carried out twice");
    outcome
}

#[test]
fn without_faults_every_request_has_its_reply() {
    for (client, server) in [
        (tcp(4), server::Config::tcp()),
        (client::Config::rtu(19_200), server::Config::rtu(1, 19_200)),
        (client::Config::rtu_over_tcp(), server::Config::rtu_over_tcp(1)),
    ] {
        let outcome = run(1, Faults::NONE, client, server, 200);
        assert_eq!((outcome.replies, outcome.failed, outcome.strays, outcome.damaged), (200, 0, 0, 0));
    }
}

#[test]
fn over_what_tcp_can_commit_nothing_is_shifted_and_nothing_done_twice() {
    let (mut replies, mut failed, mut strays) = (0, 0, 0);
    for seed in 0..60 {
        let faults = Faults { max_delay: 1500 * MS, ..Faults::TCP };
        let outcome = run(seed, faults, tcp(4), server::Config::tcp(), 60);
        assert_eq!(outcome.damaged, 0, "seed {seed}: TCP damages nothing");
        replies += outcome.replies;
        failed += outcome.failed;
        strays += outcome.strays;
    }
    assert!(replies > 2000 && failed > 50 && strays > 10, "{replies} {failed} {strays}");
}

#[test]
fn over_what_a_serial_line_can_commit_every_request_ends_and_the_line_recovers() {
    let (mut replies, mut failed) = (0, 0);
    for seed in 0..60 {
        let faults = Faults::SERIAL.at_baud(19_200);
        let outcome = run(seed, faults, client::Config::rtu(19_200), server::Config::rtu(1, 19_200), 60);
        replies += outcome.replies;
        failed += outcome.failed;
    }
    assert_eq!(replies + failed, 60 * 60);
    assert!(replies > 3200 && failed > 50, "{replies} {failed}");
}
