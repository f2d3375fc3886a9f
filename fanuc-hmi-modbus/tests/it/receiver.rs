//! A server's reading of its stream, in each framing.

use core::time::Duration;

use crate::common::{Bank, Line, MS, bytes, read, transmitted};
use fanuc_hmi_modbus::robot_session::end::End;
use fanuc_hmi_modbus::robot_session::{Decoder as _, Session as _};
use fanuc_hmi_modbus::{DecodeError, Exception, Framing, Reply, Request, Server, ServerConfig, ServerEvent};

fn server(config: ServerConfig) -> Server<Bank, 2> {
    let mut server = Server::new(config, Bank::new()).unwrap();
    server.handle_connected(Duration::ZERO);
    server
}

/// Returns the replies and events of a server that gets these bytes, and then a silence.
fn outcome(config: ServerConfig, stream: &[u8]) -> (Vec<Vec<u8>>, Vec<ServerEvent>) {
    let mut server = server(config);
    server.handle_input(MS, stream);
    let mut events: Vec<_> = core::iter::from_fn(|| server.poll_event()).collect();
    let mut replies = transmitted(&mut server, MS);
    server.handle_timeout(1000 * MS);
    replies.extend(transmitted(&mut server, 1000 * MS));
    events.extend(core::iter::from_fn(|| server.poll_event()));
    (replies, events)
}

fn writes(has_transactions: bool) -> Vec<Vec<u8>> {
    let write = |value| {
        let transaction = has_transactions.then_some(value);
        bytes(transaction, 1, Request::WriteRegister { address: 1, value })
    };
    (0..200).map(write).collect()
}

#[test]
fn requests_are_answered_and_what_is_none_is_reported() {
    let (tcp, requests) = (ServerConfig::tcp(), writes(true));
    assert_eq!(outcome(tcp, &requests[..4].concat()).0, requests[..4]);
    let out_of_step = ServerEvent::OutOfStep(DecodeError::Protocol { found: 0x5420 });
    assert!(outcome(tcp, b"GET / HTTP/1.1\r\n\r\n").1.contains(&out_of_step));
    let lost = ServerEvent::Corrupt(DecodeError::Noise { length: 1024 });
    assert!(outcome(tcp, &requests.concat()).1.contains(&lost));
    let requests = writes(false);
    for config in [ServerConfig::rtu(1, 19_200), ServerConfig::rtu_over_tcp(1)] {
        assert_eq!(outcome(config, &requests[0]).0, requests[..1]);
    }
}

/// The same, without the session.
#[test]
fn the_decoder_of_a_server_gives_the_frame_and_its_end() {
    let tcp = (ServerConfig::tcp(), bytes(Some(1), 1, read(0, 1)));
    let request = bytes(None, 1, read(0, 1));
    let rtu = [ServerConfig::rtu(1, 19_200), ServerConfig::rtu_over_tcp(1)];
    for (config, frame) in rtu.map(|config| (config, request.clone())).into_iter().chain([tcp]) {
        let mut server = server(config);
        let decoder = &mut server.core_mut().decoder;
        assert_eq!(decoder.push(&frame), frame.len());
        decoder.finish();
        assert!(matches!(decoder.next_frame(), Some(Ok(_))));
        assert_eq!(decoder.position(), frame.len() as u64);
        assert!(decoder.next_frame().is_none());
    }
}

fn line() -> Line {
    let framing = Framing::Rtu { silence: 2 * MS };
    Line::with(ServerConfig { framing, ..ServerConfig::rtu(1, 19_200) }, 19_200)
}

/// Returns the replies after the last of these pieces; each has a silence after it.
fn last_replies(line: &mut Line, pieces: &[&[u8]]) -> Vec<Vec<u8>> {
    let replies = pieces.iter().map(|piece| {
        line.lump(piece);
        line.silence()
    });
    replies.last().unwrap_or_default()
}

const NOTHING: [Vec<u8>; 0] = [];

/// Returns a frame of a function whose length is not known.
fn unknown(unit: u8, data: &[u8]) -> Vec<u8> {
    bytes(None, unit, Request::Other { function: 0x64, data })
}

#[test]
fn a_message_that_is_not_whole_frames_is_dropped_whole() {
    for unit in [0, 1] {
        let whole = bytes(None, unit, Request::WriteRegister { address: 1, value: 7 });
        let mut damaged = bytes(None, 1, Request::WriteRegister { address: 2, value: 7 });
        *damaged.last_mut().unwrap() ^= 1;
        let mut line = line();
        assert_eq!(last_replies(&mut line, &[&[whole, damaged].concat()]), NOTHING);
        assert_eq!(line.server.registers_mut().writes, []);
        let events: Vec<_> = core::iter::from_fn(|| line.server.poll_event()).collect();
        assert!(matches!(events[..], [ServerEvent::Corrupt(_)]), "{events:?}");
    }
}

/// Of bytes without a known length nobody knows whether they go on after a silence: if a whole frame comes then, they do not.
#[test]
fn a_request_after_bytes_without_a_length_is_served_in_time() {
    let request = bytes(None, 1, Request::WriteRegister { address: 1, value: 7 });
    for before in [0, 127] {
        let mut line = line();
        for _ in 0..before {
            assert_eq!(last_replies(&mut line, &[&request]), [&request[..]]);
            while line.server.poll_event().is_some() {}
        }
        // With 127 requests before it, the pieces pass the end of the buffer.
        assert_eq!(
            last_replies(&mut line, &[&unknown(2, &[9; 3])[..5], &request]),
            [&request[..]],
            "{before}"
        );
    }
}

#[test]
fn a_request_without_a_length_is_answered_in_three_pieces() {
    let mut line = line();
    let write = bytes(None, 1, Request::WriteRegister { address: 1, value: 7 });
    assert_eq!(last_replies(&mut line, &[&write]), [&write[..]]);
    let request = unknown(1, &[7; 12]);
    let exception = Reply::Exception { function: 0x64, exception: Exception::IllegalFunction };
    let replies = last_replies(&mut line, &[&request[..5], &request[5..10], &request[10..]]);
    assert_eq!(replies, [bytes(None, 1, exception)]);
}

#[test]
fn a_frame_that_would_be_too_long_is_not_waited_for_through_tcp() {
    let begun = [1, 16, 0, 0, 0, 127, 255, 0];
    let (replies, events) = outcome(ServerConfig::rtu_over_tcp(1), &begun);
    assert_eq!((replies, events), (vec![], vec![ServerEvent::Corrupt(DecodeError::TooLong { found: 264 })]));
}

/// A reply of three bytes of coils has the length of a request to read some, which may have the same bytes.
#[test]
fn a_request_that_equals_the_reply_before_is_served() {
    let mut line = line();
    line.server.registers_mut().coils = core::array::from_fn(|at| [0, 16].contains(&at));
    let replies =
        last_replies(&mut line, &[&bytes(None, 1, Request::ReadCoils { address: 0, quantity: 24 })]);
    let again = bytes(None, 1, Request::ReadCoils { address: 0x0301, quantity: 1 });
    assert_eq!(replies, [&again[..]]);
    let exception = Reply::Exception { function: 1, exception: Exception::IllegalDataAddress };
    assert_eq!(last_replies(&mut line, &[&again]), [bytes(None, 1, exception)]);
}
