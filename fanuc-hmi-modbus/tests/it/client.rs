//! The client's rules, one by one.

use core::time::Duration;

use crate::common::{MS, Seen, all, bytes, connected, read, rtu, sent, tcp};
use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::{
    Bits, Client, ClientConfig, ClientEvent, ConfigError, DecodeError, Exception, Failure, Framing, Mismatch,
    Reply, Request, SessionError, Ticket, Words,
};

#[test]
fn a_late_reply_is_dropped_and_reported_and_shifts_nothing() {
    let mut client: Client = connected(tcp(1));
    let first = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    assert_eq!(client.poll_timeout(), Some(1001 * MS));
    client.handle_timeout(1000 * MS);
    assert_eq!(all(&mut client), []);
    client.handle_timeout(1001 * MS);
    assert_eq!(all(&mut client), [Seen::Failed(first, Failure::TimedOut)]);

    let second = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 1001 * MS).len(), 1);
    client.handle_input(1100 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters(Words::from(&[111]))));
    client.handle_input(1101 * MS, &bytes(Some(2), 1, Reply::HoldingRegisters(Words::from(&[222]))));
    let late = Seen::Stray { function: 3, late: Some(first), mismatch: None };
    assert_eq!(all(&mut client), [late, Seen::Registers(second, vec![222])]);
    client.handle_input(1102 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters(Words::from(&[111]))));
    assert_eq!(all(&mut client), [Seen::Stray { function: 3, late: None, mismatch: None }]);
}

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
fn a_reply_that_is_read_before_the_timeout_is_noticed_is_taken() {
    for (config, transaction) in [(tcp(1), Some(0)), (rtu(), None)] {
        let mut client: Client = connected(config);
        let ticket = client.request(1, &read(0, 1)).unwrap();
        let transaction = sent(&mut client, 2000 * MS)[0]
            .first_chunk()
            .map(|it| u16::from_be_bytes(*it))
            .filter(|_| transaction.is_some());
        client.handle_input(9000 * MS, &bytes(transaction, 1, Reply::HoldingRegisters(Words::from(&[5]))));
        client.handle_timeout(9000 * MS);
        assert_eq!(all(&mut client), [Seen::Registers(ticket, vec![5])]);
    }
}

#[test]
fn several_requests_are_in_flight_at_once_and_their_replies_may_change_places() {
    let mut client: Client<4> = connected(tcp(3));
    let tickets: Vec<_> = (0..4).map(|i| client.request(1, &read(i, 1)).unwrap()).collect();
    assert_eq!(client.request(1, &read(0, 1)), Err(SessionError::Full { places: 4 }));
    let out = sent(&mut client, MS);
    assert_eq!(out.iter().map(|frame| frame[1]).collect::<Vec<_>>(), [1, 2, 3]);
    for transaction in [3, 1, 2] {
        let words = [transaction * 10];
        client.handle_input(2 * MS, &bytes(Some(transaction), 1, Reply::HoldingRegisters((&words).into())));
    }
    let expected: Vec<_> =
        [(2, 30), (0, 10), (1, 20)].map(|(i, word)| Seen::Registers(tickets[i], vec![word])).into();
    assert_eq!(all(&mut client), expected);
    assert_eq!(sent(&mut client, MS)[0][1], 4);
}

#[test]
fn a_reply_of_another_unit_function_length_or_echo_is_refused() {
    let words = |n: usize| Reply::HoldingRegisters(Words::from(&[0; 9][..n]));
    let write = Request::WriteRegister { address: 1, value: 2 };
    let coils = Request::WriteCoils { address: 1, values: (&[true, false]).into() };
    let registers = Request::WriteRegisters { address: 1, values: (&[1, 2]).into() };
    let cases: [(Request<'_>, u8, Reply<'_>, Mismatch); 13] = [
        (read(0, 2), 2, words(2), Mismatch::Unit { expected: 1, found: 2 }),
        (
            read(0, 2),
            1,
            Reply::InputRegisters((&[0, 0]).into()),
            Mismatch::Function { expected: 3, found: 4 },
        ),
        (
            Request::ReadInputRegisters { address: 0, quantity: 2 },
            1,
            words(2),
            Mismatch::Function { expected: 4, found: 3 },
        ),
        (read(0, 2), 1, words(3), Mismatch::Quantity { expected: 4, found: 6 }),
        (
            Request::ReadCoils { address: 0, quantity: 9 },
            1,
            Reply::Coils(Bits::from(&[true; 8])),
            Mismatch::Quantity { expected: 2, found: 1 },
        ),
        (write, 1, Reply::WriteRegister { address: 1, value: 3 }, Mismatch::Echo),
        (write, 1, Reply::WriteRegister { address: 2, value: 2 }, Mismatch::Echo),
        (
            Request::WriteCoil { address: 1, value: true },
            1,
            Reply::WriteCoil { address: 1, value: false },
            Mismatch::Echo,
        ),
        (coils, 1, Reply::WriteCoils { address: 1, quantity: 3 }, Mismatch::Echo),
        (registers, 1, Reply::WriteRegisters { address: 2, quantity: 2 }, Mismatch::Echo),
        (registers, 1, Reply::WriteRegisters { address: 1, quantity: 1 }, Mismatch::Echo),
        (
            Request::MaskWriteRegister { address: 1, and: 2, or: 3 },
            1,
            Reply::MaskWriteRegister { address: 1, and: 2, or: 4 },
            Mismatch::Echo,
        ),
        (
            read(0, 2),
            1,
            Reply::Exception { function: 4, exception: Exception::Acknowledge },
            Mismatch::Function { expected: 3, found: 4 },
        ),
    ];
    for (request, unit, reply, mismatch) in cases {
        let mut client: Client = connected(tcp(1));
        let ticket = client.request(1, &request).unwrap();
        sent(&mut client, MS);
        client.handle_input(2 * MS, &bytes(Some(1), unit, reply));
        assert_eq!(all(&mut client), [Seen::Failed(ticket, Failure::Refused(mismatch))], "{request:?}");
        assert_eq!(client.in_flight(), 0);
    }
}

#[test]
fn a_gateway_may_answer_with_another_unit_where_that_is_allowed() {
    let mut config = tcp(1);
    config.any_unit = true;
    let mut client: Client = connected(config);
    let ticket = client.request(1, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    client.handle_input(2 * MS, &bytes(Some(1), 255, Reply::HoldingRegisters((&[9]).into())));
    assert_eq!(all(&mut client), [Seen::Registers(ticket, vec![9])]);
}

#[test]
fn a_malformed_reply_ends_its_request_at_once() {
    let mut client: Client = connected(tcp(1));
    let ticket = client.request(1, &read(0, 2)).unwrap();
    sent(&mut client, MS);
    client.handle_input(2 * MS, &[0, 1, 0, 0, 0, 5, 1, 3, 4, 0, 0]);
    let error = DecodeError::PduLength { function: 3, expected: 6, found: 4 };
    assert_eq!(all(&mut client), [Seen::Failed(ticket, Failure::Malformed(error))]);
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
fn a_broadcast_waits_for_nobody_and_reads_nothing() {
    let mut client: Client = connected(rtu());
    let error = SessionError::BroadcastRead { function: 3 };
    assert_eq!(client.request(0, &read(0, 1)), Err(error));
    let ticket = client.request(0, &Request::WriteRegister { address: 1, value: 2 }).unwrap();
    let next = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 2000 * MS).len(), 1);
    assert_eq!(all(&mut client), [Seen::Announced(ticket)]);
    assert_eq!(client.poll_timeout(), Some(2100 * MS));
    client.handle_timeout(2099 * MS);
    assert_eq!(sent(&mut client, 2099 * MS).len(), 0);
    client.handle_timeout(2100 * MS);
    assert_eq!(sent(&mut client, 2100 * MS).len(), 1);
    client.handle_input(2120 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[4]).into())));
    assert_eq!(all(&mut client), [Seen::Registers(next, vec![4])]);

    // On TCP unit 0 is often the server itself.
    let mut client: Client = connected(tcp(1));
    let ticket = client.request(0, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    client.handle_input(MS, &bytes(Some(1), 0, Reply::HoldingRegisters((&[4]).into())));
    assert_eq!(all(&mut client), [Seen::Registers(ticket, vec![4])]);
}

#[test]
fn on_a_serial_line_a_late_reply_has_time_to_settle_and_another_unit_is_no_answer() {
    let mut client: Client = connected(rtu());
    let first = client.request(1, &read(0, 1)).unwrap();
    let second = client.request(2, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 2000 * MS).len(), 1, "one at a time");
    client.handle_timeout(3000 * MS);
    assert_eq!(all(&mut client), [Seen::Failed(first, Failure::TimedOut)]);
    assert_eq!(sent(&mut client, 3099 * MS).len(), 0);
    client.handle_input(3099 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    assert_eq!(all(&mut client), [Seen::Stray { function: 3, late: Some(first), mismatch: None }]);
    client.handle_timeout(3100 * MS);
    assert_eq!(sent(&mut client, 3100 * MS).len(), 0, "the line is not silent yet");
    client.handle_timeout(3102 * MS);
    assert_eq!(sent(&mut client, 3102 * MS).len(), 1);
    client.handle_input(3120 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    client.handle_input(3121 * MS, &bytes(None, 2, Reply::HoldingRegisters((&[8]).into())));
    let mismatch = Some(Mismatch::Unit { expected: 2, found: 1 });
    let stray = Seen::Stray { function: 3, late: None, mismatch };
    assert_eq!(all(&mut client), [stray, Seen::Registers(second, vec![8])]);
}

/// A driver that was stopped has not read the bytes that arrived meanwhile: it must not send before it has.
#[test]
fn a_driver_that_runs_late_reads_the_late_reply_before_it_sends() {
    let mut client: Client = connected(rtu());
    let first = client.request(1, &read(0, 1)).unwrap();
    let second = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 2000 * MS).len(), 1);
    client.handle_timeout(3000 * MS);
    assert_eq!(all(&mut client), [Seen::Failed(first, Failure::TimedOut)]);
    assert_eq!(sent(&mut client, 9000 * MS).len(), 0, "what has arrived was not read");
    client.handle_input(9000 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    client.handle_timeout(9000 * MS);
    assert_eq!(all(&mut client), [Seen::Stray { function: 3, late: Some(first), mismatch: None }]);
    client.handle_timeout(9003 * MS);
    assert_eq!(sent(&mut client, 9003 * MS).len(), 1);
    client.handle_input(9004 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[8]).into())));
    assert_eq!(all(&mut client), [Seen::Registers(second, vec![8])]);
}

/// A client that ran here before may have sent a request: its reply is not an answer to ours.
#[test]
fn a_new_client_leaves_a_serial_line_alone_first() {
    let mut client = Client::<1>::new(rtu()).unwrap();
    let ticket = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(client.poll_timeout(), None, "requests wait for the connection");
    client.handle_connected(5000 * MS);
    assert_eq!(sent(&mut client, 6099 * MS).len(), 0);
    assert_eq!(client.poll_timeout(), Some(6100 * MS));
    client.handle_input(6000 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    assert_eq!(all(&mut client), [Seen::Stray { function: 3, late: None, mismatch: None }]);
    client.handle_timeout(6100 * MS);
    assert_eq!(sent(&mut client, 6100 * MS).len(), 1);
    client.handle_input(6200 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[8]).into())));
    assert_eq!(all(&mut client), [Seen::Registers(ticket, vec![8])]);
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
fn a_timeout_is_an_outcome_that_nobody_has_to_poll_at_once() {
    let mut client: Client = connected(rtu());
    let first = client.request(1, &read(0, 1)).unwrap();
    sent(&mut client, 2000 * MS);
    client.handle_timeout(3000 * MS);
    client.handle_input(3050 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    let late = Seen::Stray { function: 3, late: Some(first), mismatch: None };
    assert_eq!(all(&mut client), [Seen::Failed(first, Failure::TimedOut), late]);
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

#[test]
fn a_configuration_that_cannot_work_is_refused() {
    let refused = |config| Client::<4>::new(config).err();
    assert_eq!(refused(tcp(0)), Some(ConfigError::InFlight { found: 0, most: 4 }));
    assert_eq!(refused(tcp(5)), Some(ConfigError::InFlight { found: 5, most: 4 }));
    assert_eq!(
        refused(ClientConfig { in_flight: 2, ..rtu() }),
        Some(ConfigError::InFlight { found: 2, most: 1 })
    );
    let config = ClientConfig { timeout: core::time::Duration::ZERO, ..tcp(1) };
    assert_eq!(refused(config), Some(ConfigError::Timeout));
    assert_eq!(ClientConfig::default(), ClientConfig::tcp());
}

#[test]
fn only_as_many_bits_are_given_as_were_asked_for() {
    let bits = [true; 10];
    for (request, reply) in [
        (Request::ReadCoils { address: 0, quantity: 10 }, Reply::Coils((&bits).into())),
        (Request::ReadDiscreteInputs { address: 0, quantity: 10 }, Reply::DiscreteInputs((&bits).into())),
    ] {
        let mut client: Client = connected(tcp(1));
        let ticket = client.request(1, &request).unwrap();
        sent(&mut client, MS);
        client.handle_input(MS, &[0, 1, 0, 0, 0, 5, 1, request.function(), 2, 0xFF, 0xFF]);
        assert_eq!(client.poll_event(), Some(ClientEvent::Replied { ticket, unit: 1 }));
        assert_eq!(client.reply(ticket), Some(reply));
    }
}

#[test]
fn what_the_specification_forbids_is_not_sent() {
    let mut client: Client = connected(tcp(1));
    let error = client.request(1, &read(0, 126)).unwrap_err();
    assert_eq!(
        error.to_string(),
        "the request cannot be sent: quantity 126 in function 3 is not within 1 to 125"
    );
    let words = [0; 124];
    let request = Request::WriteRegisters { address: 0, values: (&words).into() };
    assert!(matches!(client.request(1, &request), Err(SessionError::Encode(_))));
    assert_eq!(sent(&mut client, MS).len(), 0);
}

#[test]
fn a_request_that_is_refused_leaves_the_reply_of_the_place_that_it_would_take() {
    let mut client: Client<1> = connected(tcp(1));
    let ticket = client.request(1, &read(0, 1)).unwrap();
    let no_values = Words::from(&[]);
    let refused = [
        read(0, 126),
        read(65_535, 2),
        Request::ReadCoils { address: 0, quantity: 2001 },
        Request::WriteCoils { address: 0, values: (&[]).into() },
        Request::WriteRegisters { address: 0, values: no_values },
        Request::ReadWriteRegisters { address: 0, quantity: 1, write_address: 0, values: no_values },
        Request::Other { function: 100, data: &[1; 253] },
        Request::Other { function: 3, data: &[1] },
    ];
    // The slots are not mentioned if the request itself is invalid.
    for request in &refused {
        assert!(matches!(client.request(1, request), Err(SessionError::Encode(_))), "{request:?}");
    }
    assert_eq!(client.request(1, &read(0, 1)), Err(SessionError::Full { places: 1 }));
    assert_eq!(sent(&mut client, MS).len(), 1);
    client.handle_input(MS, &bytes(Some(1), 1, Reply::HoldingRegisters((&[7]).into())));
    assert_eq!(all(&mut client), [Seen::Registers(ticket, vec![7])]);
    for request in &refused {
        assert!(matches!(client.request(1, request), Err(SessionError::Encode(_))), "{request:?}");
        assert_eq!(client.reply(ticket), Some(Reply::HoldingRegisters((&[7]).into())), "{request:?}");
    }
    assert_eq!(client.statistics().requests, 1);
}
