//! The client's rules, one by one.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation
)]

mod common;

use common::{MS, Told, all, bytes, read, sent, tcp};
use fanuc_hmi_modbus::client::{self, Event, Failure};
use fanuc_hmi_modbus::{Bits, Client, DecodeError, Exception, Mismatch, Reply, Request, SessionError, Words};

#[test]
fn a_late_reply_is_dropped_and_told_and_shifts_nothing() {
    let mut client: Client = Client::new(tcp(1));
    let first = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    assert_eq!(client.poll_timeout(), Some(1001 * MS));
    client.handle_timeout(1000 * MS);
    assert_eq!(all(&mut client), []);
    client.handle_timeout(1001 * MS);
    assert_eq!(all(&mut client), [Told::Failed(first, Failure::TimedOut)]);

    let second = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 1001 * MS).len(), 1);
    client.handle_input(1100 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters(Words::from(&[111]))));
    client.handle_input(1101 * MS, &bytes(Some(2), 1, Reply::HoldingRegisters(Words::from(&[222]))));
    let late = Told::Stray { function: 3, late: Some(first), mismatch: None };
    assert_eq!(all(&mut client), [late, Told::Registers(second, vec![222])]);
    client.handle_input(1102 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters(Words::from(&[111]))));
    assert_eq!(all(&mut client), [Told::Stray { function: 3, late: None, mismatch: None }]);
}

#[test]
fn a_transaction_that_may_still_be_answered_is_not_given_again() {
    let mut client: Client<2> = Client::new(tcp(1));
    let late = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, MS)[0][..2], [0, 1]);
    client.handle_timeout(2000 * MS);
    assert_eq!(all(&mut client), [Told::Failed(late, Failure::TimedOut)]);
    for _ in 0..=u16::MAX {
        client.request(1, &read(0, 1)).unwrap();
        let out = sent(&mut client, 2000 * MS);
        let transaction = u16::from_be_bytes([out[0][0], out[0][1]]);
        assert_ne!(transaction, 1);
        let reply = bytes(Some(transaction), 1, Reply::HoldingRegisters((&[7]).into()));
        client.handle_input(2000 * MS, &reply);
        assert!(matches!(all(&mut client)[..], [Told::Registers(..)]));
    }
    client.handle_input(3000 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters((&[7]).into())));
    assert_eq!(all(&mut client), [Told::Stray { function: 3, late: Some(late), mismatch: None }]);
}

#[test]
fn a_reply_that_arrived_before_the_timeout_was_told_is_taken() {
    let mut client: Client = Client::new(tcp(1));
    let ticket = client.request(1, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    client.handle_input(1000 * MS, &bytes(Some(1), 1, Reply::HoldingRegisters(Words::from(&[5]))));
    client.handle_timeout(2000 * MS);
    assert_eq!(all(&mut client), [Told::Registers(ticket, vec![5])]);
}

#[test]
fn several_requests_are_out_at_once_and_their_replies_may_change_places() {
    let mut client: Client<4> = Client::new(tcp(3));
    let tickets: Vec<_> = (0..4).map(|i| client.request(1, &read(i, 1)).unwrap()).collect();
    assert_eq!(client.request(1, &read(0, 1)), Err(SessionError::Full { places: 4 }));
    let out = sent(&mut client, MS);
    assert_eq!(out.iter().map(|frame| frame[1]).collect::<Vec<_>>(), [1, 2, 3]);
    for transaction in [3, 1, 2] {
        let words = [transaction * 10];
        client.handle_input(2 * MS, &bytes(Some(transaction), 1, Reply::HoldingRegisters((&words).into())));
    }
    let expected: Vec<_> =
        [(2, 30), (0, 10), (1, 20)].map(|(i, word)| Told::Registers(tickets[i], vec![word])).into();
    assert_eq!(all(&mut client), expected);
    assert_eq!(sent(&mut client, MS)[0][1], 4);
}

#[test]
fn a_reply_of_another_unit_function_length_or_echo_is_refused() {
    let words = |n: usize| Reply::HoldingRegisters(Words::from(&[0; 9][..n]));
    let write = Request::WriteRegister { address: 1, value: 2 };
    let coils = Request::WriteCoils { address: 1, values: (&[true, false]).into() };
    let registers = Request::WriteRegisters { address: 1, values: (&[1, 2]).into() };
    let cases: [(Request<'_>, u8, Reply<'_>, Mismatch); 12] = [
        (read(0, 2), 2, words(2), Mismatch::Unit { expected: 1, found: 2 }),
        (
            read(0, 2),
            1,
            Reply::InputRegisters((&[0, 0]).into()),
            Mismatch::Function { expected: 3, found: 4 },
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
        let mut client: Client = Client::new(tcp(1));
        let ticket = client.request(1, &request).unwrap();
        sent(&mut client, MS);
        client.handle_input(2 * MS, &bytes(Some(1), unit, reply));
        assert_eq!(all(&mut client), [Told::Failed(ticket, Failure::Refused(mismatch))], "{request:?}");
        assert_eq!(client.in_flight(), 0);
    }
}

#[test]
fn a_gateway_may_answer_with_another_unit_where_that_is_allowed() {
    let mut config = tcp(1);
    config.any_unit = true;
    let mut client: Client = Client::new(config);
    let ticket = client.request(1, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    client.handle_input(2 * MS, &bytes(Some(1), 255, Reply::HoldingRegisters((&[9]).into())));
    assert_eq!(all(&mut client), [Told::Registers(ticket, vec![9])]);
}

#[test]
fn a_malformed_reply_ends_its_request_at_once() {
    let mut client: Client = Client::new(tcp(1));
    let ticket = client.request(1, &read(0, 2)).unwrap();
    sent(&mut client, MS);
    client.handle_input(2 * MS, &[0, 1, 0, 0, 0, 5, 1, 3, 4, 0, 0]);
    let error = DecodeError::PduLength { function: 3, expected: 6, found: 4 };
    assert_eq!(all(&mut client), [Told::Failed(ticket, Failure::Malformed(error))]);
}

#[test]
fn damage_on_tcp_is_told_at_once_and_once() {
    let mut client: Client = Client::new(tcp(1));
    client.handle_input(MS, &[0, 1, 0, 0, 0xFF, 0xFF]);
    assert_eq!(all(&mut client), [Told::Damaged(DecodeError::MbapLength { found: 0xFFFF })]);
    client.handle_input(MS, &[0xFF; 300]);
    client.handle_input(MS, &bytes(Some(1), 1, Reply::HoldingRegisters((&[9]).into())));
    assert_eq!(all(&mut client), [Told::Stray { function: 3, late: None, mismatch: None }]);
    client.handle_input(MS, &[0xEE; 6]);
    assert_eq!(all(&mut client), [Told::Damaged(DecodeError::Protocol { found: 0xEEEE })]);
}

#[test]
fn a_broadcast_waits_for_nobody_and_reads_nothing() {
    let mut client: Client = Client::new(client::Config::rtu(19_200));
    let error = SessionError::BroadcastRead { function: 3 };
    assert_eq!(client.request(0, &read(0, 1)), Err(error));
    let ticket = client.request(0, &Request::WriteRegister { address: 1, value: 2 }).unwrap();
    let next = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 10 * MS).len(), 1);
    assert_eq!(all(&mut client), [Told::Announced(ticket)]);
    assert_eq!(client.poll_timeout(), Some(110 * MS));
    assert_eq!(sent(&mut client, 109 * MS).len(), 0);
    assert_eq!(sent(&mut client, 110 * MS).len(), 1);
    client.handle_input(120 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[4]).into())));
    assert_eq!(all(&mut client), [Told::Registers(next, vec![4])]);

    // On TCP unit 0 is often the server itself.
    let mut client: Client = Client::new(tcp(1));
    let ticket = client.request(0, &read(0, 1)).unwrap();
    sent(&mut client, MS);
    client.handle_input(MS, &bytes(Some(1), 0, Reply::HoldingRegisters((&[4]).into())));
    assert_eq!(all(&mut client), [Told::Registers(ticket, vec![4])]);
}

#[test]
fn on_a_serial_line_a_late_reply_has_time_to_settle_and_another_unit_is_no_answer() {
    let mut client: Client = Client::new(client::Config::rtu(19_200));
    let first = client.request(1, &read(0, 1)).unwrap();
    let second = client.request(2, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 10 * MS).len(), 1, "one at a time");
    client.handle_timeout(1010 * MS);
    assert_eq!(all(&mut client), [Told::Failed(first, Failure::TimedOut)]);
    assert_eq!(sent(&mut client, 1109 * MS).len(), 0);
    client.handle_input(1109 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    assert_eq!(all(&mut client), [Told::Stray { function: 3, late: Some(first), mismatch: None }]);
    assert_eq!(sent(&mut client, 1110 * MS).len(), 0, "the line is not silent yet");
    assert_eq!(sent(&mut client, 1112 * MS).len(), 1);
    client.handle_input(1120 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
    client.handle_input(1121 * MS, &bytes(None, 2, Reply::HoldingRegisters((&[8]).into())));
    let mismatch = Some(Mismatch::Unit { expected: 2, found: 1 });
    let stray = Told::Stray { function: 3, late: None, mismatch };
    assert_eq!(all(&mut client), [stray, Told::Registers(second, vec![8])]);
}

#[test]
fn a_break_says_what_was_out_and_sends_nothing_of_it_again() {
    let mut client: Client = Client::new(tcp(1));
    let out = client.request(1, &Request::WriteRegister { address: 1, value: 2 }).unwrap();
    let queued = client.request(1, &Request::WriteRegister { address: 2, value: 2 }).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    client.handle_input(MS, &[0, 1, 0, 0]);
    client.handle_disconnect();
    assert_eq!(
        all(&mut client),
        [Told::Failed(out, Failure::Disconnected), Told::Failed(queued, Failure::NotSent)]
    );
    assert_eq!(sent(&mut client, 2 * MS).len(), 0);
    let again = client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, 2 * MS)[0][..2], [0, 3], "a new transaction");
    client.handle_input(3 * MS, &bytes(Some(3), 1, Reply::HoldingRegisters((&[1]).into())));
    assert_eq!(all(&mut client), [Told::Registers(again, vec![1])]);
}

/// The caller has not polled: the place of the request that timed out still waits for its reply.
#[test]
fn a_timeout_that_was_not_told_takes_no_reply_of_a_later_request() {
    for config in [client::Config::rtu(19_200), client::Config::rtu_over_tcp()] {
        let mut client: Client = Client::new(config);
        let first = client.request(1, &read(0, 1)).unwrap();
        let second = client.request(1, &read(0, 1)).unwrap();
        assert_eq!(sent(&mut client, 10 * MS).len(), 1);
        client.handle_timeout(1010 * MS);
        assert_eq!(sent(&mut client, 9000 * MS).len(), 0);
        assert_eq!(client.poll_timeout(), None, "only the caller can change that");
        assert_eq!(all(&mut client), [Told::Failed(first, Failure::TimedOut)]);
        assert_eq!(sent(&mut client, 9000 * MS).len(), 1);
        client.handle_input(9001 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
        assert_eq!(all(&mut client), [Told::Registers(second, vec![7])]);

        let first = client.request(1, &read(0, 1)).unwrap();
        assert_eq!(sent(&mut client, 10_000 * MS).len(), 1);
        client.handle_timeout(11_000 * MS);
        client.handle_disconnect();
        let second = client.request(1, &read(0, 1)).unwrap();
        assert_eq!(sent(&mut client, 12_000 * MS).len(), 1, "a new connection has no late replies");
        client.handle_input(12_001 * MS, &bytes(None, 1, Reply::HoldingRegisters((&[7]).into())));
        let lost = Told::Failed(first, Failure::Disconnected);
        assert_eq!(all(&mut client), [Told::Registers(second, vec![7]), lost]);
    }
}

#[test]
fn only_as_many_bits_are_given_as_were_asked_for() {
    let bits = [true; 10];
    for (request, reply) in [
        (Request::ReadCoils { address: 0, quantity: 10 }, Reply::Coils((&bits).into())),
        (Request::ReadDiscreteInputs { address: 0, quantity: 10 }, Reply::DiscreteInputs((&bits).into())),
    ] {
        let mut client: Client = Client::new(tcp(1));
        let ticket = client.request(1, &request).unwrap();
        sent(&mut client, MS);
        client.handle_input(MS, &[0, 1, 0, 0, 0, 5, 1, request.function(), 2, 0xFF, 0xFF]);
        assert_eq!(client.poll_event(), Some(Event::Reply { ticket, unit: 1, reply }));
    }
}

#[test]
fn what_the_specification_forbids_is_not_sent() {
    let mut client: Client = Client::new(tcp(1));
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
