//! The client's limits and counters. Its rules are the stories of `reference/sessions/fanuc-hmi-modbus.json`.

use core::time::Duration;

use crate::common::{MS, Seen, all, bytes, connected, read, rtu, sent, tcp};
use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::{
    Client, ClientConfig, DecodeError, Failure, Framing, Reply, Request, SessionError, Ticket,
};

#[test]
fn a_transaction_that_may_still_be_answered_is_not_given_again() {
    let mut client: Client<2> = connected(tcp(1));
    let late = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, MS)[0][..2], [0, 1]);
    client.handle_timeout(2000 * MS);
    assert_eq!(all(&mut client), [Seen::Failed(late, Failure::TimedOut)]);
    for _ in 0..=u16::MAX {
        client.request(1, &read(0, 1)).unwrap();
        let out = sent(&mut client, 2000 * MS);
        let transaction = u16::from_be_bytes([out[0][0], out[0][1]]);
        assert_ne!(transaction, 1);
        let reply = bytes(Some(transaction), 1, Reply::HoldingRegisters((&[7]).into()));
        client.handle_input(2000 * MS, &reply);
        assert!(matches!(all(&mut client)[..], [Seen::Registers(..)]));
    }
    client.handle_input(3000 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters((&[7]).into())));
    assert_eq!(all(&mut client), [Seen::Stray { function: 3, late: Some(late), mismatch: None }]);
}

#[test]
fn corruption_on_tcp_is_reported_at_once_and_then_as_what_it_was() {
    let mut client: Client = connected(tcp(1));
    let length = DecodeError::MbapLength { found: 0xFFFF };
    client.handle_input(MS, &[0, 1, 0, 0, 0xFF, 0xFF]);
    assert_eq!(all(&mut client), [Seen::OutOfStep(length)]);
    client.handle_input(MS, &[0xFF; 300]);
    client.handle_input(MS, &bytes(Some(1), 1, Reply::HoldingRegisters((&[9]).into())));
    let stray = Seen::Stray { function: 3, late: None, mismatch: None };
    assert_eq!(all(&mut client), [Seen::Corrupt(length), stray]);
    assert_eq!(client.statistics().corrupt, 1);
    client.handle_input(MS, &[0xEE; 6]);
    let protocol = DecodeError::Protocol { found: 0xEEEE };
    assert_eq!(all(&mut client), [Seen::OutOfStep(protocol)]);
    // More bytes than are searched at once: the error is returned, and no frame is there yet.
    let mut client: Client = connected(tcp(1));
    client.handle_input(MS, &[0xEE; 600]);
    assert_eq!(all(&mut client), [Seen::Corrupt(protocol), Seen::OutOfStep(protocol)]);
    client.handle_input(MS, &[0xEE; 600]);
    assert_eq!(all(&mut client), []);
}

#[test]
fn a_lost_connection_ends_every_request_and_nothing_is_sent_again() {
    let mut client: Client = connected(tcp(1));
    let out = client.request(1, &Request::WriteRegister { address: 1, value: 2 }).unwrap();
    let queued = client.request(1, &Request::WriteRegister { address: 2, value: 2 }).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    client.handle_input(MS, &[0, 1, 0, 0]);
    assert_eq!((client.in_flight(), client.pending()), (1, 4));
    client.handle_disconnected(MS);
    assert_eq!((client.in_flight(), client.pending()), (0, 0));
    client.handle_disconnected(MS);
    assert_eq!(
        all(&mut client),
        [Seen::Failed(out, Failure::Disconnected), Seen::Failed(queued, Failure::NotSent)]
    );
    let again = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 2 * MS).len(), 0);
    client.handle_input(2 * MS, &[1]);
    assert_eq!(all(&mut client), [Seen::Unexpected("Disconnected", "Received")]);
    client.handle_connected(2 * MS);
    assert_eq!(sent(&mut client, 2 * MS)[0][..2], [0, 2], "a new transaction");
    client.handle_input(3 * MS, &bytes(Some(2), 1, Reply::HoldingRegisters((&[1]).into())));
    assert_eq!(all(&mut client), [Seen::Registers(again, vec![1])]);
    let statistics = client.statistics();
    assert_eq!(
        (statistics.requests, statistics.replies, statistics.failures, statistics.unexpected),
        (3, 1, 2, 1)
    );
}

/// A slot, and the reply in it, is the caller's until the outcome was polled.
#[test]
fn a_reply_stays_until_the_next_request_takes_its_place() {
    let mut client: Client<2> = connected(tcp(2));
    let tickets = [0, 1].map(|address| client.request(1, &read(address, 1)).unwrap());
    assert_eq!(tickets.map(Ticket::number), [1, 2]);
    assert_eq!(sent(&mut client, MS).len(), 2);
    for transaction in [1, 2] {
        client
            .handle_input(MS, &bytes(Some(transaction), 1, Reply::HoldingRegisters((&[transaction]).into())));
    }
    assert_eq!(
        client.request(1, &read(2, 1)),
        Err(SessionError::Full { places: 2 }),
        "neither outcome was polled"
    );
    assert!(client.poll_event().is_some());
    let third = client.request(1, &read(2, 1)).unwrap();
    assert_eq!(client.reply(tickets[0]), None, "its place is taken");
    assert_eq!(all(&mut client), [Seen::Registers(tickets[1], vec![2])]);
    assert_eq!(client.reply(third), None, "it has none yet");
    assert_eq!(client.reply(tickets[1]), Some(Reply::HoldingRegisters((&[2]).into())), "still there");
    sent(&mut client, MS);
    client.handle_input(MS, &bytes(Some(3), 1, Reply::HoldingRegisters((&[3]).into())));
    assert_eq!(all(&mut client), [Seen::Registers(third, vec![3])]);
    assert_eq!(client.reply(tickets[0]), None, "the reply in its place is another one's");
}

#[test]
fn a_time_of_duration_max_never_comes() {
    let endless = |config: ClientConfig| ClientConfig {
        timeout: Duration::MAX,
        turnaround: Duration::MAX,
        settle: Duration::MAX,
        ..config
    };
    let late = Duration::MAX - MS;
    let long = [
        tcp(1),
        rtu(),
        ClientConfig { framing: Framing::Rtu { silence: Duration::MAX }, ..rtu() },
        ClientConfig::rtu_over_tcp(),
        ClientConfig {
            framing: Framing::RtuOverTcp { stall: Duration::MAX },
            ..ClientConfig::rtu_over_tcp()
        },
    ];
    for config in long.map(endless) {
        let mut client: Client = Client::new(config).unwrap();
        client.handle_connected(MS);
        let ticket = client.request(1, &read(0, 1)).unwrap();
        client.handle_timeout(late);
        // A serial line is drained without limit.
        let requests = sent(&mut client, late).len();
        assert_eq!(requests, usize::from(!matches!(config.framing, Framing::Rtu { .. })), "{config:?}");
        assert_eq!(client.poll_timeout(), None, "{config:?}");
        client.handle_timeout(late);
        assert_eq!(all(&mut client), [], "{config:?}");
        let transaction = (config.framing == Framing::Tcp).then_some(1);
        client.handle_input(late, &bytes(transaction, 1, Reply::HoldingRegisters((&[7]).into())));
        if requests == 1 {
            assert_eq!(all(&mut client), [Seen::Registers(ticket, vec![7])], "{config:?}");
        }
        client.handle_timeout(Duration::MAX);
        client.handle_connected(Duration::MAX);
        client.handle_disconnected(Duration::MAX);
    }
}

#[test]
fn all_bytes_are_taken_however_many_and_however_late() {
    let mut client: Client = connected(tcp(1));
    let ticket = client.request(1, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    let stray = bytes(Some(999), 1, Reply::HoldingRegisters((&[0; 125]).into()));
    let mut stream = stray.repeat(100);
    stream.extend(bytes(Some(1), 1, Reply::HoldingRegisters((&[7]).into())));
    client.handle_input(Duration::MAX, &stream);
    client.handle_timeout(Duration::MAX);
    assert_eq!(client.statistics().strays, 100);
    assert_eq!(
        all(&mut client).last(),
        Some(&Seen::Registers(ticket, vec![7])),
        "an outcome is never dropped"
    );
    assert_eq!(client.statistics().dropped_notices, 85);
}
