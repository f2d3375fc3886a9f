//! Sessions of one framing, which link no other: they do what those of any framing do.

use core::time::Duration;

use crate::common::{Bank, MS, bytes, read, transmitted};
use fanuc_hmi_modbus::robot_session::{Decoder as _, End, Session as _};
use fanuc_hmi_modbus::{
    Client, DecodeError, Framing, Framings, Request, Rtu, Server, ServerConfig, ServerEvent, Tcp,
};

/// What a server answers, reports and writes, of these bytes and a silence after them.
type Outcome = (Vec<Vec<u8>>, Vec<ServerEvent>, Vec<(u16, u16)>);

fn server<F: Framings>(config: ServerConfig) -> Server<Bank, 2, F> {
    let mut server = Server::new(config, Bank::new()).unwrap();
    server.handle_connected(Duration::ZERO);
    server
}

fn outcome<F: Framings>(config: ServerConfig, stream: &[u8]) -> Outcome {
    let mut server = server::<F>(config);
    server.handle_input(MS, stream);
    let mut events: Vec<_> = core::iter::from_fn(|| server.poll_event()).collect();
    let mut replies = transmitted(&mut server, MS);
    server.handle_timeout(1000 * MS);
    replies.extend(transmitted(&mut server, 1000 * MS));
    events.extend(core::iter::from_fn(|| server.poll_event()));
    (replies, events, server.registers().writes.clone())
}

fn write(transaction: Option<u16>, value: u16) -> Vec<u8> {
    bytes(transaction, 1, Request::WriteRegister { address: 1, value })
}

#[test]
fn a_server_of_one_framing_does_what_one_of_any_framing_does() {
    let tcp = ServerConfig::tcp();
    let requests: Vec<_> = (0..200).map(|value| write(Some(value), value)).collect();
    assert_eq!(outcome::<Tcp>(tcp, &requests[..4].concat()).0, requests[..4]);
    let garbage = b"GET / HTTP/1.1\r\n\r\n";
    let out_of_step = ServerEvent::OutOfStep(DecodeError::Protocol { found: 0x5420 });
    assert!(outcome::<Tcp>(tcp, garbage).1.contains(&out_of_step));
    let lost = ServerEvent::Corrupt(DecodeError::Noise { length: 1024 });
    assert!(outcome::<Tcp>(tcp, &requests.concat()).1.contains(&lost));
    for stream in [&requests[..4].concat()[..], &requests.concat(), garbage, &requests[0][..5]] {
        assert_eq!(outcome::<Tcp>(tcp, stream), outcome::<Framing>(tcp, stream));
    }
    let requests: Vec<_> = (0..200).map(|value| write(None, value)).collect();
    for config in [ServerConfig::rtu(1, 19_200), ServerConfig::rtu_over_tcp(1)] {
        assert_eq!(outcome::<Rtu>(config, &requests[0]).0, requests[..1]);
        for stream in [&requests[..4].concat()[..], &requests.concat(), garbage, &requests[0][..5]] {
            assert_eq!(outcome::<Rtu>(config, stream), outcome::<Framing>(config, stream));
        }
    }
}

/// Also without the session around it.
#[test]
fn the_decoder_of_a_server_gives_the_frame_and_its_end() {
    fn assert_reads<E: End>(mut end: E, frame: &[u8]) {
        let decoder = &mut end.core_mut().decoder;
        assert_eq!(decoder.push(frame), frame.len());
        decoder.finish();
        assert!(matches!(decoder.next_frame(), Some(Ok(_))));
        assert_eq!(decoder.position(), frame.len() as u64);
        assert!(decoder.next_frame().is_none());
    }
    let request = bytes(Some(1), 1, read(0, 1));
    assert_reads(server::<Tcp>(ServerConfig::tcp()), &request);
    assert_reads(server::<Framing>(ServerConfig::tcp()), &request);
    let request = bytes(None, 1, read(0, 1));
    for config in [ServerConfig::rtu(1, 19_200), ServerConfig::rtu_over_tcp(1)] {
        assert_reads(server::<Rtu>(config), &request);
        assert_reads(server::<Framing>(config), &request);
    }
}

#[test]
fn a_client_takes_a_reply_for_every_place_at_once() {
    assert_eq!(<Client as End>::MAX_INPUT, 16 * 260);
}
