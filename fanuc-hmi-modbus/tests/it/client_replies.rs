//! Replies in pieces, after noise, and with wrong lengths, as a client reads them.
#![allow(clippy::cast_possible_truncation)]

use core::time::Duration;

use crate::common::{MS, Seen, all, bytes, connected, read, rtu, sent, tcp};
use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::{
    Bits, Client, ClientConfig, ClientEvent, DecodeError, Exception, Failure, Mismatch, Reply, Request, Words,
};

/// Returns every request with a reply of its own, and that reply.
fn exchanges() -> Vec<(Request<'static>, Vec<u8>)> {
    let reply = |reply: Reply<'_>| bytes(None, 1, reply);
    let words: Vec<u16> = (0..37).collect();
    let echo = |request: Request<'static>| (request, bytes(None, 1, request));
    vec![
        (read(0, 37), reply(Reply::HoldingRegisters((&words[..]).into()))),
        (read(0, 37), reply(Reply::Exception { function: 3, exception: 2.into() })),
        (
            Request::ReadCoils { address: 0, quantity: 17 },
            reply(Reply::Coils(Bits::from_wire(&[1, 2, 1], 17))),
        ),
        echo(Request::WriteRegister { address: 1, value: 7 }),
        echo(Request::WriteCoil { address: 1, value: true }),
        echo(Request::MaskWriteRegister { address: 1, and: 3, or: 4 }),
        (
            Request::WriteRegisters { address: 1, values: (&[1, 2, 3]).into() },
            reply(Reply::WriteRegisters { address: 1, quantity: 3 }),
        ),
        (Request::ReportServerId, reply(Reply::ServerId(&[17, 255, 3, 4, 5, 6, 7, 8, 9, 10]))),
        (
            Request::Other { function: 65, data: &[9] },
            reply(Reply::Other { function: 65, data: &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10] }),
        ),
    ]
}

/// Returns a client whose first reply has come, and the time.
fn proven(config: ClientConfig) -> (Client, Duration) {
    let mut client: Client = connected(config);
    client.request(1, &read(0, 1)).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    client.handle_input(2 * MS, &bytes(None, 1, Reply::HoldingRegisters(Words::from(&[7]))));
    let now = Duration::from_secs(1);
    client.handle_timeout(now);
    assert_eq!(all(&mut client).len(), 1);
    (client, now)
}

/// A UART with a FIFO, a USB adapter or a device server delivers a reply in pieces, with silences between them that are not
/// on the line.
#[test]
fn a_reply_that_is_delivered_in_pieces_is_one() {
    for config in [rtu(), ClientConfig::rtu(115_200), ClientConfig::rtu(1200), ClientConfig::rtu_over_tcp()] {
        for (request, reply) in exchanges() {
            for size in 1..reply.len() {
                let (mut client, mut now) = proven(config);
                let ticket = client.request(1, &request).unwrap();
                assert_eq!(sent(&mut client, now).len(), 1);
                let gap = if size < 4 { 6 * MS } else { 20 * MS };
                for piece in reply.chunks(size) {
                    client.handle_input(now, piece);
                    now += gap;
                    client.handle_timeout(now);
                }
                let silence = config.framing.silence().unwrap();
                client.handle_timeout(now + silence);
                let events: Vec<_> = core::iter::from_fn(|| client.poll_event()).collect();
                assert_eq!(
                    events,
                    [ClientEvent::Replied { ticket, unit: 1 }],
                    "{request:?} in pieces of {size}"
                );
            }
        }
    }
}

#[test]
fn the_rest_of_a_reply_is_waited_for_until_the_timeout() {
    let (request, reply) = exchanges().remove(0);
    let mut client: Client = connected(rtu());
    let begin = MS;
    let ticket = client.request(1, &request).unwrap();
    assert_eq!(sent(&mut client, begin).len(), 1);
    client.handle_input(begin + MS, &reply[..40]);
    let timeout = rtu().timeout;
    assert_eq!(client.poll_timeout(), Some(begin + timeout));
    client.handle_timeout(begin + timeout);
    let cut = ClientEvent::Corrupt(DecodeError::Cut { expected: reply.len(), found: 40 });
    let failed = ClientEvent::Failed { ticket, failure: Failure::TimedOut };
    let events: Vec<_> = core::iter::from_fn(|| client.poll_event()).collect();
    assert_eq!(events, [cut, failed]);
    // A late reply is not a reply to the next request.
    client.handle_input(begin + timeout + MS, &reply[40..]);
    assert_eq!(client.in_flight(), 0);
}

/// A silence ends bytes that cannot become the reply: another unit, another function, another byte count.
#[test]
fn what_cannot_become_the_reply_ends_with_the_silence() {
    let (request, reply) = exchanges().remove(0);
    for (at, byte) in [(0, 2), (1, 4), (2, 76)] {
        let mut client: Client = connected(rtu());
        let begin = MS;
        let ticket = client.request(1, &request).unwrap();
        assert_eq!(sent(&mut client, begin).len(), 1);
        let mut other = reply.clone();
        other[at] = byte;
        client.handle_input(begin + MS, &other[..3]);
        client.handle_timeout(begin + 50 * MS);
        assert!(
            matches!(client.poll_event(), Some(ClientEvent::Corrupt(DecodeError::Cut { found: 3, .. }))),
            "{at}"
        );
        client.handle_input(begin + 50 * MS, &reply);
        assert_eq!(client.poll_event(), Some(ClientEvent::Replied { ticket, unit: 1 }), "{at}");
    }
}

/// A glitch as the transmitter is switched on, right before an exception or a whole reply.
#[test]
fn a_byte_before_a_reply_does_not_hide_it() {
    // A function without a length of its own is not searched for within noise.
    for (request, reply) in
        exchanges().into_iter().filter(|(request, _)| !matches!(request, Request::Other { .. }))
    {
        for byte in [0x00, 0xFF, 0x55] {
            for size in [1, 3, 500] {
                let (mut client, mut now) = proven(rtu());
                let ticket = client.request(1, &request).unwrap();
                assert_eq!(sent(&mut client, now).len(), 1);
                for piece in [&[byte], &reply[..]].concat().chunks(size) {
                    client.handle_input(now, piece);
                    now += if size == 1 { MS } else { 20 * MS };
                    client.handle_timeout(now);
                }
                client.handle_timeout(now + 50 * MS);
                let outcome =
                    core::iter::from_fn(|| client.poll_event()).find(|event| event.outcome_of().is_some());
                let expected = ClientEvent::Replied { ticket, unit: 1 };
                assert_eq!(outcome, Some(expected), "{byte:x} before {reply:x?} in pieces of {size}");
            }
        }
    }
}

#[test]
fn an_exception_with_a_wrong_length_fails_its_request_at_once_and_harms_no_other() {
    let mut client: Client = connected(tcp(1));
    let refused = client.request(1, &read(30, 1)).unwrap();
    assert_eq!(sent(&mut client, MS).len(), 1);
    client.handle_input(2 * MS, &[0, 1, 0, 0, 0, 4, 1, 0x83, 2]);
    let exception = Exception::IllegalDataAddress;
    let error = DecodeError::ExceptionLength {
        transaction: 1,
        unit: 1,
        function: 3,
        exception,
        expected: 3,
        found: 4,
    };
    let failure = Failure::Malformed(error);
    assert_eq!(all(&mut client), [Seen::Failed(refused, failure)]);
    assert_eq!((failure.exception(), failure.is_unknown()), (Some(exception), false));
    assert_eq!(
        failure.to_string(),
        "the reply is malformed: exception 2 (illegal data address) for function 3 with the length field 4, not 3 (at byte 4)"
    );
    // The tenth byte of the reply is neither the beginning of a reply nor corruption.
    client.handle_input(3 * MS, &[0]);
    assert_eq!((client.pending(), all(&mut client)), (0, vec![]));
    let next = client.request(1, &read(10, 1)).unwrap();
    assert_eq!(sent(&mut client, 4 * MS).len(), 1);
    client.handle_input(5 * MS, &bytes(Some(2), 1, Reply::HoldingRegisters(Words::from(&[7]))));
    assert_eq!((client.pending(), all(&mut client)), (0, vec![Seen::Registers(next, vec![7])]));
    // The unit comes first, then this, then the function.
    for (unit, code, failure) in [
        (2, 0x83, Failure::Refused(Mismatch::Unit { expected: 1, found: 2 })),
        (
            1,
            0x84,
            Failure::Malformed(DecodeError::ExceptionLength {
                transaction: 3,
                unit: 1,
                function: 4,
                exception,
                expected: 3,
                found: 4,
            }),
        ),
    ] {
        let ticket = client.request(1, &read(10, 1)).unwrap();
        let transaction = sent(&mut client, 6 * MS)[0][1];
        client.handle_input(7 * MS, &[0, transaction, 0, 0, 0, 4, unit, code, 2]);
        let failure = match failure {
            Failure::Malformed(DecodeError::ExceptionLength { unit, function, expected, found, .. }) => {
                let transaction = transaction.into();
                Failure::Malformed(DecodeError::ExceptionLength {
                    transaction,
                    unit,
                    function,
                    exception,
                    expected,
                    found,
                })
            }
            failure => failure,
        };
        assert_eq!(all(&mut client), [Seen::Failed(ticket, failure)]);
    }
}

/// A malformed reply within a sound header fails its request at once, with the reason, and the next request has its reply.
#[test]
fn every_reply_that_is_wrong_within_a_sound_header_is_reported_at_once() {
    use DecodeError::{Function, PduLength, ReplyByteCount};
    let length = |function, expected, found| Failure::Malformed(PduLength { function, expected, found });
    let cases: [(&[u8], Failure); 12] = [
        (&[3], length(3, 2, 1)),
        (&[3, 4, 0, 1], length(3, 6, 4)),
        (&[3, 2, 0, 1], Failure::Refused(Mismatch::Quantity { expected: 4, found: 2 })),
        (&[3, 3, 0, 1, 0], Failure::Malformed(ReplyByteCount { function: 3, found: 3 })),
        (&[3, 0], Failure::Malformed(ReplyByteCount { function: 3, found: 0 })),
        (&[3, 4, 0, 1, 0, 2, 0, 3], length(3, 6, 8)),
        (&[4, 4, 0, 1, 0, 2], Failure::Refused(Mismatch::Function { expected: 3, found: 4 })),
        (&[0], Failure::Malformed(Function { found: 0 })),
        (&[0, 4, 0, 1, 0, 2], Failure::Malformed(Function { found: 0 })),
        (&[0x80, 2], Failure::Malformed(Function { found: 0x80 })),
        (&[0x83], length(0x83, 2, 1)),
        (&[0xC1, 2, 0], length(0xC1, 2, 3)),
    ];
    let mut client: Client = connected(tcp(1));
    for (pdu, failure) in cases {
        let ticket = client.request(1, &read(0, 2)).unwrap();
        let [high, low, ..] = sent(&mut client, MS)[0][..] else { panic!() };
        let reply = [&[high, low, 0, 0, 0, 1 + pdu.len() as u8, 1], pdu].concat();
        client.handle_input(2 * MS, &reply);
        assert_eq!(all(&mut client), [Seen::Failed(ticket, failure)], "{pdu:?}");
        assert_eq!(client.pending(), 0);
        let ticket = client.request(1, &read(0, 1)).unwrap();
        let [high, low, ..] = sent(&mut client, 3 * MS)[0][..] else { panic!() };
        client.handle_input(4 * MS, &[high, low, 0, 0, 0, 5, 1, 3, 2, 0, 9]);
        assert_eq!(all(&mut client), [Seen::Registers(ticket, vec![9])], "{pdu:?}");
    }
}
