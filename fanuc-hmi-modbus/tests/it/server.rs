//! The server's functions, limits and counters. Its rules are the stories of `reference/sessions/fanuc-hmi-modbus.json`.

#![allow(clippy::cast_possible_truncation)]
#![allow(clippy::disallowed_methods, clippy::disallowed_types, reason = "one test is over TCP")]

use core::ops::ControlFlow;
use core::time::Duration;
use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::thread;

use crate::common::{Bank, MS, bytes, read, transmitted};
use fanuc_hmi_modbus::robot_session::end::End as _;
use fanuc_hmi_modbus::robot_session::{EndReason, Session, drive};
use fanuc_hmi_modbus::{
    DecodeError, Exception, Framing, Registers, Request, Server, ServerConfig, ServerEvent, Words, WordsMut,
    function, limit, serve,
};

/// Returns the reply PDU to a request PDU.
fn answer(bank: &mut Bank, pdu: &[u8]) -> Vec<u8> {
    let mut out = [0xAA; limit::PDU];
    let len = serve(pdu, bank, &mut out);
    out[..len].to_vec()
}

#[test]
fn every_function_is_served() {
    let bank = &mut Bank::new();
    assert_eq!(answer(bank, &[1, 0, 0, 0, 10]), [1, 2, 0b0100_1001, 0b10]);
    assert_eq!(answer(bank, &[2, 0, 0, 0, 10]), [2, 2, 0b1011_0110, 0b01]);
    assert_eq!(answer(bank, &[3, 0, 1, 0, 2]), [3, 4, 0, 7, 0, 14]);
    assert_eq!(answer(bank, &[4, 0, 1, 0, 1]), [4, 2, 0xFF, 0xF8]);
    assert_eq!(answer(bank, &[5, 0, 1, 0xFF, 0]), [5, 0, 1, 0xFF, 0]);
    assert_eq!(answer(bank, &[6, 0, 1, 0x12, 0x34]), [6, 0, 1, 0x12, 0x34]);
    assert_eq!(answer(bank, &[15, 0, 2, 0, 3, 1, 0b101]), [15, 0, 2, 0, 3]);
    assert_eq!(bank.coils[1..5], [true, true, false, true]);
    assert_eq!(answer(bank, &[16, 0, 2, 0, 2, 4, 0, 1, 0, 2]), [16, 0, 2, 0, 2]);
    assert_eq!(bank.holding[1..4], [0x1234, 1, 2]);
    assert_eq!(answer(bank, &[22, 0, 1, 0xFF, 0, 0, 0x56]), [22, 0, 1, 0xFF, 0, 0, 0x56]);
    assert_eq!(bank.holding[1], 0x1256);
    assert_eq!(answer(bank, &[23, 0, 1, 0, 2, 0, 2, 0, 1, 2, 0xAB, 0xCD]), [23, 4, 0x12, 0x56, 0xAB, 0xCD]);
    assert_eq!(answer(bank, &[65, 1, 2, 3]), [65, 1, 2, 3]);
}

#[test]
fn what_cannot_be_served_gets_its_exception() {
    let bank = &mut Bank::new();
    for (pdu, reply) in [
        (&[7][..], [0x87, 1]),
        (&[0x83, 2], [0x83, 1]),
        (&[0, 1], [0x80, 1]),
        (&[3, 0, 99, 0, 2], [0x83, 2]),
        (&[3, 0xFF, 0xFF, 0, 2], [0x83, 2]),
        (&[1, 0xFF, 0xFF, 0, 2], [0x81, 2]),
        (&[16, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0], [0x90, 2]),
        (&[15, 0xFF, 0xFF, 0, 2, 1, 0], [0x8F, 2]),
        (&[23, 0, 0, 0, 1, 0, 99, 0, 2, 4, 0, 0, 0, 0], [0x97, 2]),
        (&[23, 0, 99, 0, 2, 0, 0, 0, 1, 2, 0xEE, 0xEE], [0x97, 2]),
        (&[3, 0, 0, 0, 0], [0x83, 3]),
        (&[3, 0, 0, 0, 126], [0x83, 3]),
        (&[3, 0, 0], [0x83, 3]),
        (&[5, 0, 0, 0, 1], [0x85, 3]),
        (&[16, 0, 0, 0, 5, 2, 0, 1], [0x90, 3]),
        (&[22, 0, 100, 0, 0, 0, 0], [0x96, 2]),
    ] {
        assert_eq!(answer(bank, pdu), reply, "{pdu:x?}");
    }
    assert_eq!(bank.writes, [], "a refused request changes nothing");
    // Registers are never requested beyond 65535.
    struct Everything;
    impl Registers for Everything {
        fn read_holding_registers(&mut self, _: u16, _: &mut WordsMut<'_>) -> Result<(), Exception> {
            Ok(())
        }
        fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
            panic!("{address} {values:?}")
        }
    }
    let mut out = [0; limit::PDU];
    for pdu in
        [&[23, 0, 0, 0, 1, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0][..], &[16, 0xFF, 0xFF, 0, 2, 4, 0, 0, 0, 0]]
    {
        assert_eq!(serve(pdu, &mut Everything, &mut out), 2);
        assert_eq!(out[..2], [pdu[0] | function::EXCEPTION, 2]);
    }
    assert_eq!(serve(&[3, 0xFF, 0xFF, 0, 1], &mut Everything, &mut out), 4, "the last address is one");
    assert_eq!(serve(&[3, 0xF0, 0, 0, 125], &mut Everything, &mut out), 252, "as many as one request reads");
    struct Nothing;
    impl Registers for Nothing {}
    for code in [1, 2, 3, 4, 5, 6, 22] {
        let pdu: &[u8] = if code == 22 { &[22, 0, 0, 0, 0, 0, 0] } else { &[code, 0, 0, 0, 1] };
        let pdu = if code == 5 { &[5, 0, 0, 0, 0][..] } else { pdu };
        let mut out = [0; limit::PDU];
        assert_eq!(serve(pdu, &mut Nothing, &mut out), 2);
        assert_eq!(out[..2], [code | function::EXCEPTION, 1]);
    }
}

fn connected<const N: usize>(config: ServerConfig) -> Server<Bank, N> {
    let mut server = Server::new(config, Bank::new()).unwrap();
    server.handle_connected(Duration::ZERO);
    server
}

#[test]
fn a_server_answers_in_order_and_only_what_is_meant_for_it() {
    let mut server: Server<_> = connected(ServerConfig::rtu_over_tcp(5));
    let mut stream = Vec::new();
    for unit in [5, 6, 0, 5] {
        stream.extend(bytes(None, unit, Request::WriteRegister { address: unit.into(), value: 9 }));
    }
    server.handle_input(MS, &stream);
    assert_eq!(server.registers().writes, [(5, 9), (0, 9), (5, 9)]);
    assert_eq!(server.poll_transmit(MS, &mut [0; 259]), None, "too little room: nothing is sent");
    let out = transmitted(&mut server, MS);
    assert_eq!(out.len(), 2);
    assert_eq!(out[0][..6], [5, 6, 0, 5, 0, 9]);
    let served: Vec<_> = core::iter::from_fn(|| server.poll_event()).collect();
    let units: Vec<_> = served
        .iter()
        .map(|event| match event {
            ServerEvent::Served { unit, .. } => *unit,
            event => panic!("{event:?}"),
        })
        .collect();
    assert_eq!(units, [5, 0, 5]);
    assert_eq!(server.statistics().served, 3);
}

fn write(transaction: Option<u16>, value: u16) -> Vec<u8> {
    bytes(transaction, 1, Request::WriteRegister { address: 1, value })
}

#[test]
fn through_tcp_a_request_waits_for_a_place() {
    for config in [ServerConfig::tcp(), ServerConfig::rtu_over_tcp(1)] {
        let mut server: Server<_, 2> = connected(config);
        let transaction = |value| (config.framing == Framing::Tcp).then_some(value);
        let requests: Vec<_> = (0..40).map(|value| write(transaction(value), value)).collect();
        assert!(server.wants_input());
        server.handle_input(MS, &requests.concat());
        assert_eq!(server.registers().writes, [(1, 0), (1, 1)]);
        assert!(!server.wants_input());
        let mut out = [0; 260];
        let length = server.poll_transmit(MS, &mut out).unwrap();
        assert_eq!(out[..length], requests[0]);
        assert_eq!(server.registers().writes[2..], [(1, 2)], "the one that has waited");
        assert_eq!(transmitted(&mut server, MS), requests[1..]);
        assert!(server.wants_input());
        assert_eq!((server.statistics().served, server.statistics().refused), (40, 0));
    }
}

/// The transport holds the bytes that the server does not want yet: a client that does not wait gets every reply, in order.
#[test]
fn a_thousand_requests_in_one_write_are_answered_in_order() {
    for config in [ServerConfig::tcp(), ServerConfig::rtu_over_tcp(1)] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let stream = listener.accept().unwrap().0;
        let server = thread::spawn(move || {
            let mut server = Server::<_>::new(config, Bank::new()).unwrap();
            let ended = drive(&mut server, stream, |_, _| ControlFlow::<()>::Continue(())).unwrap();
            (ended, server.registers().writes.len(), server.statistics())
        });
        let transaction = |value| (config.framing == Framing::Tcp).then_some(value);
        let requests: Vec<u8> = (0..1000).flat_map(|value| write(transaction(value), value)).collect();
        client.write_all(&requests).unwrap();
        client.shutdown(Shutdown::Write).unwrap();
        let mut replies = Vec::new();
        client.read_to_end(&mut replies).unwrap();
        assert!(replies == requests, "a reply to a write repeats it");
        let (ended, writes, statistics) = server.join().unwrap();
        assert_eq!((ended, writes), (EndReason::ByPeer, 1000));
        assert_eq!((statistics.served, statistics.refused, statistics.unexpected), (1000, 0, 0));
    }
}

/// As many bytes as `MAX_INPUT` fit whenever input is wanted; a caller that gives more loses some, which is reported.
#[test]
fn what_arrives_is_kept_while_the_places_are_taken() {
    let most = <Server<Bank> as Session>::MAX_INPUT;
    assert_eq!(most, 504);
    // With less garbage the rest may come.
    for garbage in (0..=600).filter(|garbage| !(1..5).contains(garbage)) {
        let mut server: Server<_, 1> = connected(ServerConfig::rtu_over_tcp(1));
        server.handle_input(MS, &vec![0xFF; garbage]);
        server.handle_timeout(501 * MS);
        let requests: Vec<u8> = (0..100).flat_map(|value| write(None, value)).collect();
        assert!(server.wants_input());
        server.handle_input(MS, &requests[..most]);
        assert_eq!(transmitted(&mut server, MS).len(), most / 8, "{garbage}");
    }
    let mut server: Server<_, 1> = connected(ServerConfig::tcp());
    server.handle_input(MS, &(0..200).flat_map(|value| write(Some(value), value)).collect::<Vec<_>>());
    let noise = ServerEvent::Corrupt(DecodeError::Noise { length: 1024 });
    assert_eq!(core::iter::from_fn(|| server.poll_event()).last(), Some(noise));
    transmitted(&mut server, MS);
    assert!(!server.registers().writes.contains(&(1, 1)), "what is lost is not carried out");
    // RTU frames are read again when the rest of that one has come.
    let mut server: Server<_, 1> = connected(ServerConfig::rtu_over_tcp(1));
    server.handle_input(MS, &(0..200).flat_map(|value| write(None, value)).collect::<Vec<_>>());
    assert_eq!(core::iter::from_fn(|| server.poll_event()).last(), Some(noise));
    assert_eq!(transmitted(&mut server, MS), [write(None, 0)]);
    server.handle_timeout(501 * MS);
    server.handle_input(501 * MS, &write(None, 7));
    assert_eq!(transmitted(&mut server, 501 * MS), [write(None, 7)]);
}

#[test]
fn nothing_of_a_connection_reaches_the_next() {
    let mut server: Server<_> = connected(ServerConfig::tcp());
    let request = bytes(Some(1), 1, read(0, 1));
    server.handle_input(MS, &request);
    server.handle_input(MS, &request[..5]);
    assert!(server.machine().is_connected());
    server.handle_disconnected(2 * MS);
    assert!(!server.machine().is_connected());
    assert_eq!(transmitted(&mut server, 2 * MS).len(), 0);
    server.handle_input(2 * MS, &request);
    let unexpected = core::iter::from_fn(|| server.poll_event()).last();
    let Some(ServerEvent::Unexpected(unexpected)) = unexpected else { panic!("{unexpected:?}") };
    assert_eq!(unexpected.to_string(), "Received is not expected in the state Disconnected");
    server.handle_connected(3 * MS);
    assert_eq!(transmitted(&mut server, 3 * MS).len(), 0);
    server.handle_input(3 * MS, &request);
    assert_eq!(transmitted(&mut server, 3 * MS).len(), 1);
    assert_eq!(server.statistics().unexpected, 1);
}

#[test]
fn a_silence_of_duration_max_never_comes() {
    let late = Duration::MAX - MS;
    for framing in [Framing::Rtu { silence: Duration::MAX }, Framing::RtuOverTcp { stall: Duration::MAX }] {
        let config = ServerConfig { framing, ..ServerConfig::rtu(1, 19_200) };
        let mut server: Server<_> = Server::new(config, Bank::new()).unwrap();
        server.handle_connected(MS);
        server.handle_input(late, &bytes(None, 1, read(0, 1)));
        assert_eq!(server.poll_timeout(), None);
        server.handle_timeout(late);
        let is_serial = matches!(framing, Framing::Rtu { .. });
        assert_eq!(transmitted(&mut server, late).len(), usize::from(!is_serial), "{framing:?}");
        server.handle_connected(Duration::MAX);
        server.handle_disconnected(Duration::MAX);
    }
}
