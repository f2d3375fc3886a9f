//! The outcome of `cellwire fanuc write` when the controller refuses, is silent or closes the connection.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::thread;

use crate::fanuc_cell::{Folder, err, out};

/// A server's part of one connection.
type Part = fn(&mut TcpStream);

/// Starts a server that does these things, each with one connection; the last one stays open. Returns its address.
fn server(parts: &'static [Part]) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        let mut last = None;
        for part in parts {
            drop(last.take());
            let mut stream = listener.accept().unwrap().0;
            part(&mut stream);
            last = Some(stream);
        }
        if parts.len() == 1 {
            return;
        }
        let _ = last.unwrap().read(&mut [0]);
    });
    address
}

fn request(stream: &mut TcpStream) -> Vec<u8> {
    let mut head = [0; 6];
    stream.read_exact(&mut head).unwrap();
    let mut rest = vec![0; usize::from(head[5])];
    stream.read_exact(&mut rest).unwrap();
    [&head[..], &rest].concat()
}

fn acknowledge(stream: &mut TcpStream) {
    let request = request(stream);
    stream.write_all(&[&request[..5], &[6], &request[6..12]].concat()).unwrap();
}

fn refuse(stream: &mut TcpStream) {
    let request = request(stream);
    stream.write_all(&[&request[..5], &[3, request[6], request[7] | 0x80, 2]].concat()).unwrap();
}

fn hold(stream: &mut TcpStream, value: u8) {
    let request = request(stream);
    stream.write_all(&[&request[..5], &[5, request[6], 3, 2, 0, value]].concat()).unwrap();
}

#[test]
fn a_write_without_a_known_outcome_may_have_been_executed() {
    const MAY: &str = "error: the write may have been executed: ";
    const ACKNOWLEDGED: &str = "error: the write may have been executed: the controller has acknowledged it, but the value could not be \
                                read back: ";
    let closes: &[Part] = &[|stream| drop(request(stream))];
    let acknowledges_and_closes: &[Part] = &[acknowledge];
    let is_silent: &[Part] = &[|stream| {
        request(stream);
        let _ = stream.read(&mut [0]);
    }];
    let is_silent_then: &[Part] = &[|stream| {
        acknowledge(stream);
        request(stream);
        let _ = stream.read(&mut [0]);
    }];
    let refuses: &[Part] = &[refuse];
    let refuses_then: &[Part] = &[|stream| {
        acknowledge(stream);
        refuse(stream);
    }];
    let differs: &[Part] = &[|stream| {
        acknowledge(stream);
        hold(stream, 8);
    }];
    let one_reply_a_connection: &[Part] = &[acknowledge, |stream| hold(stream, 7)];
    let closes_at_once: &[Part] = &[|_| {}];
    let cases = [
        (closes, 8, vec![MAY, "closed the connection"]),
        (acknowledges_and_closes, 8, vec![ACKNOWLEDGED]),
        (is_silent, 8, vec![MAY, "no reply before the timeout", "modbus scan"]),
        (is_silent_then, 8, vec![ACKNOWLEDGED, "no reply before the timeout"]),
        (refuses, 6, vec!["error: the controller refuses: exception 2"]),
        (refuses_then, 8, vec![ACKNOWLEDGED, "the controller refuses: exception 2"]),
        (differs, 1, vec!["error: 7 was written, the controller holds 8"]),
        (one_reply_a_connection, 0, vec![""]),
        (closes_at_once, 3, vec!["error: the server closed the connection"]),
    ];
    let folder = Folder::new("outcome");
    for (index, (parts, code, said)) in cases.into_iter().enumerate() {
        let address = server(parts);
        // A pause, so that a connection that is closed at once is seen to be.
        let write = format!(
            "fanuc write {address} int16 --address 430 7 --set timeout=300ms --set connect_pause=200ms"
        );
        let output = folder.run(&write);
        assert_eq!(output.status.code(), Some(code), "case {index}: {}{}", out(&output), err(&output));
        assert!(err(&output).starts_with(said[0]), "case {index}: {}", err(&output));
        assert!(said.iter().all(|part| err(&output).contains(part)), "case {index}: {}", err(&output));
    }
}
