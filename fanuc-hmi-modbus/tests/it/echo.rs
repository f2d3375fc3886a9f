//! Lines that return the bytes sent.

use core::time::Duration;

use crate::common::{Bank, MS, bytes, connected, read, rtu, sent, tcp, transmitted};
use fanuc_hmi_modbus::robot_session::end::End as _;
use fanuc_hmi_modbus::robot_session::{EchoError, Session as _};
use fanuc_hmi_modbus::{
    Bits, Client, ClientConfig, ClientEvent, ConfigError, Exception, Failure, Reply, Request, Server,
    ServerConfig, ServerEvent, Words,
};

pub(crate) const WRITE: Request<'static> = Request::WriteRegister { address: 10, value: 7 };
/// The request before a write on a connection that is not proven, and its CRC.
pub(crate) const PROBE: [u8; 8] = [1, 3, 0, 0, 0, 1, 0x84, 0x0A];

fn with_echo(config: ClientConfig) -> ClientConfig {
    ClientConfig { echo: true, ..config }
}

pub(crate) fn events(client: &mut Client) -> Vec<ClientEvent> {
    core::iter::from_fn(|| client.poll_event()).collect()
}

/// Sends the only request that is due.
pub(crate) fn send(client: &mut Client, now: Duration) -> Vec<u8> {
    let mut sent = sent(client, now);
    assert_eq!(sent.len(), 1);
    sent.remove(0)
}

pub(crate) fn reply(reply: Reply<'_>) -> Vec<u8> {
    bytes(None, 1, reply)
}

/// Returns every request whose reply can equal it, and one of each other kind, with the reply.
pub(crate) fn exchanges() -> Vec<(Request<'static>, Vec<u8>)> {
    vec![
        (read(0, 2), reply(Reply::HoldingRegisters(Words::from(&[1, 2])))),
        // The high byte of the address is the number of bytes.
        (read(0x0400, 2), reply(Reply::HoldingRegisters(Words::from(&[1, 2])))),
        (Request::WriteCoil { address: 1, value: true }, reply(Reply::WriteCoil { address: 1, value: true })),
        (WRITE, reply(Reply::WriteRegister { address: 10, value: 7 })),
        (
            Request::MaskWriteRegister { address: 1, and: 3, or: 4 },
            reply(Reply::MaskWriteRegister { address: 1, and: 3, or: 4 }),
        ),
        (
            Request::WriteRegisters { address: 1, values: (&[1, 2, 3]).into() },
            reply(Reply::WriteRegisters { address: 1, quantity: 3 }),
        ),
        (
            Request::Diagnostics { subfunction: 0, data: Words::from(&[0x102]) },
            reply(Reply::Diagnostics { subfunction: 0, data: Words::from(&[0x102]) }),
        ),
        (WRITE, reply(Reply::Exception { function: 6, exception: Exception::IllegalDataAddress })),
    ]
}

/// With the setting the line's own bytes come first, in any pieces.
#[test]
fn what_the_line_returns_is_dropped() {
    for config in [rtu(), ClientConfig::rtu_over_tcp()] {
        for (request, reply) in exchanges() {
            for size in 1..30 {
                let mut client: Client = connected(with_echo(config));
                let ticket = client.request(1, &request).unwrap();
                let mut now = MS;
                let mut line = send(&mut client, now);
                if line == PROBE {
                    line.extend(bytes(None, 1, Reply::HoldingRegisters(Words::from(&[9]))));
                    client.handle_input(now, &line);
                    now += config.framing.silence().unwrap();
                    client.handle_timeout(now);
                    line = send(&mut client, now);
                }
                line.extend(&reply);
                for piece in line.chunks(size) {
                    client.handle_input(now, piece);
                    now += 15 * MS;
                    client.handle_timeout(now);
                }
                client.handle_timeout(now + config.framing.silence().unwrap());
                assert_eq!(
                    events(&mut client),
                    [ClientEvent::Replied { ticket, unit: 1 }],
                    "{request:?} in pieces of {size}"
                );
            }
        }
    }
}

/// No device answers, and the line returns every request.
#[test]
fn the_own_bytes_are_never_a_reply() {
    for echo in [true, false] {
        for (request, _) in exchanges() {
            for size in [1, 3, 100] {
                let mut client: Client = connected(ClientConfig { echo, ..rtu() });
                let ticket = client.request(1, &request).unwrap();
                let mut now = MS;
                let mut seen = Vec::new();
                while !seen.iter().any(|event: &ClientEvent| event.outcome_of().is_some()) {
                    for bytes in sent(&mut client, now) {
                        for piece in bytes.chunks(size) {
                            now += MS;
                            client.handle_input(now, piece);
                        }
                    }
                    now = client.poll_timeout().map_or(now + MS, |at| at.max(now));
                    client.handle_timeout(now);
                    seen.extend(events(&mut client));
                }
                let failed = ClientEvent::Failed { ticket, failure: Failure::TimedOut };
                let outcome: Vec<_> = seen.iter().filter(|event| event.outcome_of().is_some()).collect();
                assert_eq!(outcome, [&failed], "{request:?}, echo {echo}, {seen:?}");
                let is_told =
                    |event: &ClientEvent| matches!(event, ClientEvent::Echo(EchoError::NotSet { .. }));
                assert_eq!(seen.iter().any(is_told), !echo, "{request:?}: {seen:?}");
            }
        }
    }
}

#[test]
fn a_collision_is_told() {
    let mut client: Client = connected(with_echo(rtu()));
    let ticket = client.request(1, &read(0, 2)).unwrap();
    let mut line = send(&mut client, MS);
    line[3] ^= 0x20;
    client.handle_input(2 * MS, &line);
    let collision = EchoError::Collision { offset: 3, expected: 0, found: 0x20 };
    assert_eq!(events(&mut client), [ClientEvent::Echo(collision)]);
    let text = "byte 3 of what was sent, 0x00, came back as 0x20: two have sent at once, or the line returns nothing and echo has to be false";
    assert_eq!(collision.to_string(), text);

    // The line returns nothing: the reply is shorter than the request.
    let timeout = MS + rtu().timeout;
    client.handle_timeout(timeout);
    assert_eq!(events(&mut client), [ClientEvent::Failed { ticket, failure: Failure::TimedOut }]);
    let now = timeout + rtu().settle;
    client.handle_timeout(now);
    let values = [1, 2, 3];
    let request = Request::WriteRegisters { address: 1, values: (&values).into() };
    let ticket = client.request(1, &request).unwrap();
    assert_eq!(send(&mut client, now).len(), 15);
    client.handle_input(now + MS, &reply(Reply::WriteRegisters { address: 1, quantity: 3 }));
    let collision = EchoError::Collision { offset: 6, expected: 6, found: 0xD1 };
    assert_eq!(events(&mut client), [ClientEvent::Echo(collision)]);
    client.handle_timeout(now + rtu().timeout);
    assert_eq!(events(&mut client), [ClientEvent::Failed { ticket, failure: Failure::TimedOut }]);
}

/// The first request that does not equal its reply shows the echo, once; the next replies count.
#[test]
fn a_line_that_returns_what_is_sent_is_found() {
    for noise in [&[][..], &[0], &[0xFF, 0]] {
        for size in [1, 5, 100] {
            let mut client: Client = connected(rtu());
            let mut now = MS;
            for (number, (request, reply)) in
                [exchanges().remove(0), exchanges().remove(3)].into_iter().enumerate()
            {
                let ticket = client.request(1, &request).unwrap();
                let mut line = if number == 0 { noise.to_vec() } else { Vec::new() };
                line.extend(send(&mut client, now));
                line.extend(&reply);
                for piece in line.chunks(size) {
                    client.handle_input(now, piece);
                }
                now += 100 * MS;
                client.handle_timeout(now);
                let mut expected = vec![ClientEvent::Replied { ticket, unit: 1 }];
                if number == 0 {
                    expected.insert(0, ClientEvent::Echo(EchoError::NotSet { length: 8 }));
                }
                assert_eq!(events(&mut client), expected, "{noise:?} in pieces of {size}");
            }
        }
    }
    assert_eq!(
        EchoError::NotSet { length: 8 }.to_string(),
        "the line returns what is sent (8 bytes came back): set echo=true"
    );
}

/// A reply that the device sends without delay, and whose first bytes are those of the request, is not an echo.
#[test]
fn a_reply_is_not_taken_for_an_echo() {
    for (request, reply) in exchanges() {
        let mut client: Client = connected(rtu());
        let mut now = MS;
        // A read before those that can equal their replies.
        let ticket = client.request(1, &request).unwrap();
        let mut first = send(&mut client, now);
        if first == PROBE {
            client.handle_input(now, &bytes(None, 1, Reply::HoldingRegisters(Words::from(&[9]))));
            now += 50 * MS;
            client.handle_timeout(now);
            first = send(&mut client, now);
        }
        assert_ne!(first, PROBE);
        client.handle_input(now, &reply);
        client.handle_timeout(now + 50 * MS);
        assert_eq!(events(&mut client), [ClientEvent::Replied { ticket, unit: 1 }], "{request:?}");
    }
}

/// Before a write that its reply can equal, the client reads a register. Only a reply to that read shows that the reply to
/// the write is not an echo of the line.
#[test]
fn a_write_waits_until_it_is_known_what_the_line_returns() {
    let refused = reply(Reply::Exception { function: 3, exception: Exception::IllegalDataAddress });
    let answer = reply(Reply::HoldingRegisters(Words::from(&[9])));
    for answer in [Some(answer), Some(refused), None] {
        let is_proven = answer.is_some();
        let mut client: Client = connected(rtu());
        let write = client.request(1, &WRITE).unwrap();
        let later = client.request(1, &read(0, 1)).unwrap();
        assert_eq!(send(&mut client, MS), PROBE);
        assert_eq!((client.machine().in_flight(), sent(&mut client, MS).len()), (1, 0));
        let mut now = 50 * MS;
        if let Some(answer) = answer {
            client.handle_input(40 * MS, &answer);
        } else {
            client.handle_timeout(MS + rtu().timeout);
            now = MS + rtu().timeout + rtu().settle;
        }
        client.handle_timeout(now);
        assert_eq!(events(&mut client), []);
        assert_eq!(send(&mut client, now)[..6], [1, 6, 0, 10, 0, 7]);
        client.handle_input(now, &reply(Reply::WriteRegister { address: 10, value: 7 }));
        client.handle_timeout(now + 50 * MS);
        if is_proven {
            assert_eq!(events(&mut client), [ClientEvent::Replied { ticket: write, unit: 1 }]);
        } else {
            assert_eq!((events(&mut client), sent(&mut client, now + 50 * MS)), (vec![], vec![]));
            client.handle_timeout(now + rtu().timeout);
            let failure = Failure::Returned;
            assert_eq!(events(&mut client), [ClientEvent::Failed { ticket: write, failure }]);
            now += rtu().timeout + rtu().settle;
            client.handle_timeout(now);
        }
        assert_eq!(send(&mut client, now + 50 * MS)[1], 3);
        client.handle_disconnected(now + 60 * MS);
        assert_eq!(
            events(&mut client),
            [ClientEvent::Failed { ticket: later, failure: Failure::Disconnected }]
        );
    }
}

#[test]
fn a_write_whose_read_was_lost_was_not_sent() {
    let mut client: Client = connected(rtu());
    let ticket = client.request(1, &WRITE).unwrap();
    assert_eq!(send(&mut client, MS), PROBE);
    client.handle_disconnected(2 * MS);
    assert_eq!(events(&mut client), [ClientEvent::Failed { ticket, failure: Failure::NotSent }]);
    // The next connection may use another line.
    client.handle_connected(3 * MS);
    client.handle_timeout(Duration::from_secs(9));
    client.request(1, &WRITE).unwrap();
    assert_eq!(send(&mut client, Duration::from_secs(9)), PROBE);
}

#[test]
fn a_broadcast_comes_back_too() {
    for echo in [true, false] {
        let mut client: Client = connected(ClientConfig { echo, ..rtu() });
        let ticket = client.request(0, &WRITE).unwrap();
        let line = send(&mut client, MS);
        assert_eq!(line[0], 0);
        client.handle_input(20 * MS, &line);
        let mut expected = vec![ClientEvent::Announced { ticket }];
        expected.extend((!echo).then_some(ClientEvent::Echo(EchoError::NotSet { length: 8 })));
        assert_eq!(events(&mut client), expected);
    }
}

#[test]
fn over_tcp_nothing_comes_back() {
    assert_eq!(Client::<1>::new(with_echo(tcp(1))).err(), Some(ConfigError::Echo));
    let config = ServerConfig { echo: true, ..ServerConfig::tcp() };
    assert_eq!(Server::<_, 1>::new(config, Bank::new()).err(), Some(ConfigError::Echo));
    let mut client: Client = connected(tcp(1));
    client.request(1, &WRITE).unwrap();
    assert_eq!(send(&mut client, MS)[7], 6);
}

/// The reply to a write is the same write for a server to which it comes back.
#[test]
fn a_server_does_not_serve_its_own_replies() {
    let silence = Duration::from_millis(5);
    let config = ServerConfig { echo: true, ..ServerConfig::rtu(1, 19_200) };
    let mut server: Server<Bank, 2> = Server::new(config, Bank::new()).unwrap();
    server.handle_connected(MS);
    let mut now = MS;
    for round in 1..=3 {
        server.handle_input(now, &bytes(None, 1, WRITE));
        server.handle_timeout(now + silence);
        let reply = transmitted(&mut server, now + silence);
        assert_eq!(reply.len(), 1);
        for byte in &reply[0] {
            server.handle_input(now + silence, &[*byte]);
        }
        now += Duration::from_secs(1);
        server.handle_timeout(now);
        assert_eq!((server.statistics().served, transmitted(&mut server, now).len()), (round, 0));
    }
}

#[test]
fn a_server_finds_its_own_replies() {
    for size in [1, 5, 100] {
        let config = ServerConfig::rtu(1, 19_200);
        let mut server: Server<Bank, 2> = Server::new(config, Bank::new()).unwrap();
        server.handle_connected(MS);
        let mut now = MS;
        for request in [read(0, 8), WRITE] {
            server.handle_input(now, &bytes(None, 1, request));
            now += 5 * MS;
            server.handle_timeout(now);
            for piece in transmitted(&mut server, now).remove(0).chunks(size) {
                now += MS;
                server.handle_input(now, piece);
            }
            now += Duration::from_secs(1);
            server.handle_timeout(now);
            assert_eq!(transmitted(&mut server, now).len(), 0);
        }
        let notices: Vec<_> = core::iter::from_fn(|| server.poll_event()).collect();
        let is_echo = |event: &&ServerEvent| matches!(event, ServerEvent::Echo(_));
        let found: Vec<_> = notices.iter().filter(is_echo).collect();
        assert_eq!(found, [&ServerEvent::Echo(EchoError::NotSet { length: 21 })]);
        assert_eq!((server.statistics().served, server.statistics().corrupt), (2, 0));
    }
}

/// A device that loses bytes that come too soon after its reply.
#[test]
fn nothing_is_sent_within_the_pause() {
    for config in [tcp(1), rtu(), ClientConfig::rtu_over_tcp()] {
        let pause = 70 * MS;
        let mut client: Client = connected(ClientConfig { pause, ..config });
        let transaction = (config.framing == fanuc_hmi_modbus::Framing::Tcp).then_some(1);
        let mut request = || client.request(1, &Request::ReadCoils { address: 0, quantity: 8 }).unwrap();
        let tickets = [request(), request()];
        send(&mut client, MS);
        let values = bytes(transaction, 1, Reply::Coils(Bits::from(&[true; 8])));
        client.handle_input(10 * MS, &values);
        client.handle_timeout(79 * MS);
        assert_eq!(sent(&mut client, 79 * MS).len(), 0, "{config:?}");
        assert_eq!(client.poll_timeout(), Some(80 * MS));
        client.handle_timeout(80 * MS);
        send(&mut client, 80 * MS);
        // After a timeout as well.
        let end = 80 * MS + config.timeout;
        client.handle_timeout(end);
        let wait = if transaction.is_some() { pause } else { pause.max(config.settle) };
        client.request(1, &WRITE).unwrap();
        assert_eq!(client.poll_timeout(), Some(end + wait), "{config:?}");
        let outcomes = events(&mut client);
        let failed = ClientEvent::Failed { ticket: tickets[1], failure: Failure::TimedOut };
        assert_eq!(outcomes, [ClientEvent::Replied { ticket: tickets[0], unit: 1 }, failed]);
    }
}
