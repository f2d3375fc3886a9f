//! `cellwire modbus` with devices that close, refuse, answer wrongly or lose what comes first.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use crate::fanuc_cell::{Folder, err};
use crate::modbus_bench::{READ, ask, lines, once, reply_to};
use fanuc_hmi_modbus::crc;
use serde_json::json;

/// A device that accepts and closes at once is retried after longer and longer pauses: a connection is not a reply.
#[test]
fn a_device_that_closes_at_once_is_seldom_connected_to() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (sender, births) = std::sync::mpsc::channel();
    thread::spawn(move || {
        listener.incoming().map_while(Result::ok).for_each(|_closed| sender.send(()).unwrap())
    });
    let poll = ["modbus", "poll", &address, "holding:0-3", "--every", "20ms", "--for", "4s"];
    let output = Command::new(env!("CARGO_BIN_EXE_cellwire")).args(poll).output().unwrap();
    assert!(!output.status.success());
    let births = births.try_iter().count();
    assert!((3..9).contains(&births), "{births} connections");
}

/// After a reply that did not come a client reconnects automatically. A server that has room for one connection may refuse
/// that at first.
#[test]
fn a_connection_that_is_refused_to_its_own_reconnect_is_tried_again() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = thread::spawn(move || {
        let (mut silent, _) = listener.accept().unwrap();
        std::io::copy(&mut silent, &mut std::io::sink()).unwrap();
        drop(listener.accept().unwrap());
        let (mut client, _) = listener.accept().unwrap();
        let mut request = [0; 8];
        client.read_exact(&mut request).unwrap();
        let mut reply = vec![9, 3, 2, 0, 42];
        let crc = reply.iter().fold(0xFFFF_u16, |crc, byte| {
            (0..8).fold(
                crc ^ u16::from(*byte),
                |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 },
            )
        });
        reply.extend(crc.to_le_bytes());
        client.write_all(&reply).unwrap();
        request
    });
    let request = "{\"unit\":9,\"function\":3,\"address\":0,\"quantity\":1}\n";
    let output =
        ask(&["send", &address, "--set", "framing=rtu", "--set", "timeout=200ms"], &request.repeat(2));
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.lines().nth(1).is_some_and(|line| line.contains("[42]")), "{text}");
    assert_eq!(server.join().unwrap()[..2], [9, 3]);
}

/// Answers every request of every connection, and counts the connections.
fn answering(
    answer: impl Fn(&[u8]) -> Vec<u8> + Send + 'static,
) -> (String, std::sync::Arc<std::sync::atomic::AtomicUsize>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let connections = std::sync::Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let counted = std::sync::Arc::clone(&connections);
    thread::spawn(move || {
        for mut stream in listener.incoming().map_while(Result::ok) {
            counted.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            let mut request = [0; 12];
            while stream.read_exact(&mut request).is_ok() && stream.write_all(&answer(&request)).is_ok() {}
        }
    });
    (address, connections)
}

/// Registers 10 to 19; anything else is an exception whose header counts 4 bytes, with these bytes after its code.
fn wrong_length(rest: &'static [u8]) -> impl Fn(&[u8]) -> Vec<u8> {
    move |request| {
        let (address, quantity) = (request[9], request[11]);
        let mut reply = request[..4].to_vec();
        if request[7] == 3 && request[8] == 0 && (10..20).contains(&address) && address + quantity <= 20 {
            reply.extend([0, 3 + 2 * quantity, request[6], 3, 2 * quantity]);
            reply.extend((0..quantity).flat_map(|n| [0, n]));
        } else {
            reply.extend([0, 4, request[6], request[7] | 0x80, 2]);
            reply.extend(rest);
        }
        reply
    }
}

#[test]
fn an_exception_with_a_wrong_length_costs_neither_the_timeout_nor_the_connection() {
    for rest in [&[][..], &[0]] {
        let (address, connections) = answering(wrong_length(rest));
        let requests = [10, 30, 12, 31, 14]
            .map(|address| format!("{{\"unit\":1,\"function\":3,\"address\":{address},\"quantity\":1}}\n"));
        let begin = Instant::now();
        let output = ask(&["send", &address, "--set", "timeout=20000ms"], &requests.concat());
        assert!(begin.elapsed() < Duration::from_secs(20), "{rest:?}");
        let refused = "the reply is malformed: exception 2 (illegal data address) for function 3 with the length field 4, \
                       not 3 (at byte 4)";
        let found = lines(&output);
        for (at, line) in found.iter().enumerate() {
            if at % 2 == 0 {
                assert_eq!(line["registers"], json!([0]), "{rest:?}: {}", err(&output));
            } else {
                assert_eq!(*line, json!({"unit": 1, "function": 3, "exception": 2}));
            }
        }
        let told = format!("{refused}\nerror: 2 requests refused: see \"exception\"\n");
        assert_eq!(
            (found.len(), err(&output)),
            (5, &told[..]),
            "{rest:?}: once, and no corruption is reported"
        );
        assert_eq!(output.status.code(), Some(6));
        let count = || connections.load(std::sync::atomic::Ordering::Relaxed);
        assert_eq!(count(), 1, "{rest:?}");

        let scan = ["scan", &address, "--ranges", "--to", "40", "--set", "timeout=20000ms"];
        let output = ask(&scan, "");
        assert_eq!(
            lines(&output),
            [json!({"table": "holding", "from": 10, "to": 19, "count": 10})],
            "{rest:?}: {}",
            err(&output)
        );
        assert_eq!(count(), 2, "{rest:?}");
        let output = ask(&["scan", &address, "--units", "1-2", "--set", "timeout=20000ms"], "");
        let exception = "exception 2 (illegal data address)";
        let units = [1, 2].map(|unit| json!({"unit": unit, "reply": exception}));
        assert_eq!((lines(&output), count()), (units.to_vec(), 3));
        let poll =
            ["poll", &address, "holding:30", "holding:10-11", "--for", "200ms", "--set", "timeout=20000ms"];
        let output = ask(&poll, "");
        let found = lines(&output);
        assert_eq!((&found[0]["failed"], &found[1]["values"]), (&json!(exception), &json!([0, 1])));
        assert_eq!((found.len(), count()), (2, 4), "{rest:?}: {}", err(&output));
    }
}

/// The byte count of a reply with more than three registers is wrong: the smaller runs are read.
#[test]
fn a_scan_goes_on_after_a_malformed_reply() {
    let (address, connections) = answering(|request| {
        let quantity = request[11];
        let count = if quantity > 3 { 1 } else { 2 * quantity };
        let mut reply = request[..4].to_vec();
        if request[7] != 3 {
            reply.extend([0, 3, request[6], request[7] | 0x80, 1]);
            return reply;
        }
        reply.extend([0, 3 + 2 * quantity, request[6], 3, count]);
        reply.extend(vec![0; usize::from(2 * quantity)]);
        reply
    });
    let output = ask(&["scan", &address, "--ranges", "--to", "9", "--set", "timeout=20000ms"], "");
    let found = lines(&output);
    assert_eq!(
        found.last(),
        Some(&json!({"table": "holding", "from": 0, "to": 9, "count": 10})),
        "{found:?}"
    );
    let remark = "holding:0-9 counts as refused: the reply is malformed: byte count 1 is invalid in a reply of function 3";
    assert_eq!(err(&output).matches("counts as refused").count(), 1, "{}", err(&output));
    assert!(err(&output).contains(remark), "{}", err(&output));
    assert_eq!(connections.load(std::sync::atomic::Ordering::Relaxed), 1);
}

#[test]
fn a_timeout_names_what_came_in_place_of_the_reply() {
    const NONE: &str = "no reply before the timeout; if the request writes, it may have been executed";
    let of_7 = |request: &[u8]| [&[0, 7][..], &request[2..4], &[0, 5, request[6], 3, 2, 0, 9]].concat();
    let cut = |request: &[u8]| [&request[..4], &[0, 7, request[6], 3, 4, 0, 9]].concat();
    let strange = |_: &[u8]| b"GET / HTTP/1.1".to_vec();
    type Answer = Box<dyn Fn(&[u8]) -> Vec<u8> + Send>;
    let cases: [(Answer, &str, &str); 3] = [
        (
            Box::new(of_7),
            "a reply with transaction 7, expected 1 (unit 1, function 3)",
            "unexpected reply (unasked): a reply with transaction 7, expected 1 (unit 1, function 3)",
        ),
        (Box::new(cut), "an incomplete reply, of which 11 bytes have arrived", ""),
        (
            Box::new(strange),
            "bytes that do not begin a frame: protocol identifier is 0x5420, not 0 (at byte 2)",
            "corrupt: protocol identifier is 0x5420, not 0 (at byte 2)",
        ),
    ];
    for (answer, instead, remark) in cases {
        let (address, _) = answering(answer);
        let output = ask(&["send", &address, "--set", "timeout=300ms"], READ);
        assert_eq!(lines(&output), [json!({"failed": format!("{NONE}; received instead: {instead}")})]);
        assert!(err(&output).contains(remark), "{}", err(&output));
    }
    // On a line a reply of another unit, and an exception after bytes that may be a damaged reply.
    let rtu = |frame: &[u8]| [frame, &crc::crc16(frame).to_le_bytes()].concat();
    let of_unit_9 = rtu(&[9, 3, 4, 0, 7, 0, 8]);
    let address = once(move |mut stream| {
        let mut request = [0; 8];
        stream.read_exact(&mut request).unwrap();
        stream.write_all(&of_unit_9).unwrap();
        let _ = stream.read(&mut request);
    });
    let output = ask(&["send", &address, "--set", "framing=rtu", "--set", "timeout=700ms"], READ);
    let instead = "a reply (unit 9, function 3): unit 9 answers a request to unit 1";
    assert_eq!(lines(&output), [json!({"failed": format!("{NONE}; received instead: {instead}")})]);
}

/// Starts a server that loses all bytes in the first 200 ms of each connection.
fn deaf_at_first() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        for mut stream in listener.incoming().map_while(Result::ok) {
            thread::sleep(Duration::from_millis(200));
            stream.set_nonblocking(true).unwrap();
            let mut request = [0; 12];
            while let Ok(1..) = stream.read(&mut request) {}
            stream.set_nonblocking(false).unwrap();
            while stream.read_exact(&mut request).is_ok() {
                let _ = stream.write_all(&reply_to(&request, request[1], 7));
            }
        }
    });
    address
}

#[test]
fn the_first_byte_is_sent_after_the_pause_of_a_connection() {
    let address = deaf_at_first();
    let folder = Folder::new("pause");
    folder.write("modbus.toml", "connect_pause = \"400ms\"\n");
    let settings = folder.0.join("modbus.toml");
    let settings = settings.to_str().unwrap();
    let pauses: [&[&str]; 2] = [&["--set", "connect_pause=400ms"], &["--settings", settings]];
    for pause in pauses {
        let output = ask(&[&["send", &address, "--set", "timeout=5000ms"], pause].concat(), READ);
        assert_eq!(lines(&output)[0]["registers"], json!([7, 7]), "{pause:?}: {}", err(&output));
    }
    let none: [&[&str]; 2] = [&[], &["--settings", settings, "--set", "connect_pause=0s"]];
    for pause in none {
        let output = ask(&[&["send", &address, "--set", "timeout=1000ms"], pause].concat(), READ);
        assert!(lines(&output)[0]["failed"].is_string(), "{pause:?}");
    }
    let output = ask(&["send", &address, "--set", "connect_pause=2min"], READ);
    assert_eq!(output.status.code(), Some(2), "{}", err(&output));
    assert!(err(&output).contains("connect_pause"), "{}", err(&output));
}
