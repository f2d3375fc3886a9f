//! A server's reading of its stream, in each framing.

use core::time::Duration;

use crate::common::{Bank, MS, bytes, read, transmitted};
use fanuc_hmi_modbus::robot_session::end::End;
use fanuc_hmi_modbus::robot_session::{Decoder as _, Session as _};
use fanuc_hmi_modbus::{DecodeError, Request, Server, ServerConfig, ServerEvent};

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
