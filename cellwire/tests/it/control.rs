//! `simulate … --control`: clients that send too much, garbage or nothing, and what a fault does to a connection.

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::tool::{DEADLINE, Running, cellwire, run};

/// A poll of the ball.
const ENQ: u8 = 0x05;

/// A client that sends commands.
struct Control(BufReader<TcpStream>);

impl Control {
    fn of(simulator: &Running) -> Self {
        let stream = TcpStream::connect(simulator.ready["control"].as_str().unwrap()).unwrap();
        stream.set_read_timeout(Some(DEADLINE)).unwrap();
        Self(BufReader::new(stream))
    }

    fn write(&mut self, bytes: &[u8]) {
        self.0.get_mut().write_all(bytes).unwrap();
    }

    /// Reads the next answer.
    fn answer(&mut self) -> Value {
        let mut line = String::new();
        self.0.read_line(&mut line).unwrap();
        serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"))
    }

    fn ask(&mut self, request: &Value) -> Value {
        self.write(format!("{request}\n").as_bytes());
        self.answer()
    }

    fn done(&mut self, request: &Value) -> Value {
        let answer = self.ask(request);
        assert_eq!(answer["ok"], true, "{request}: {answer}");
        answer
    }

    /// Returns whether the simulator has closed the connection.
    fn is_closed(&mut self) -> bool {
        self.0
            .read(&mut [0])
            .map_or_else(|error| error.kind() == ErrorKind::ConnectionReset, |length| length == 0)
    }
}

fn controlled(arguments: &str) -> Running {
    Running::listening(&format!("{arguments} --control 0"))
}

/// Polls the ball on a fast line.
fn poll(ball: &mut TcpStream) -> std::io::Result<[u8; 12]> {
    ball.write_all(&[ENQ])?;
    let mut reply = [0; 12];
    ball.read_exact(&mut reply).map(|()| reply)
}

#[test]
fn the_ready_line_has_the_address_and_a_port_alone_is_of_this_machine() {
    let simulator = controlled("ball");
    assert!(simulator.ready["control"].as_str().unwrap().starts_with("127.0.0.1:"), "{}", simulator.ready);
    assert_eq!(Running::listening("ball").ready.get("control"), None);
    let taken = simulator.ready["control"].as_str().unwrap();
    let second = cellwire(&format!("simulate ball --listen 0 --control {taken}"));
    let (status, out, error) = run(second);
    assert_eq!((status, out.as_str()), (Some(2), ""));
    assert!(error.contains("--control: cannot listen on") && error.contains("the port is in use"), "{error}");
    let mut open = Running::listening("ball --control 0.0.0.0:0");
    open.line("is open to the network without authentication");
    assert_eq!(Control::of(&open).done(&json!({"do": "help"}))["device"], "ball");
}

#[test]
fn a_line_that_is_too_long_or_http_ends_its_connection_and_no_other() {
    let simulator = controlled("ball");
    let mut other = Control::of(&simulator);
    // 64 KiB with the spaces are a line; one byte more is not.
    let request = br#"{"do":"counts","id":7}"#;
    let mut line = vec![b' '; 64 * 1024 - request.len()];
    line.extend_from_slice(request);
    let mut long = Control::of(&simulator);
    long.write(&[&line[..], b"\n"].concat());
    assert_eq!(long.answer()["id"], 7);
    for end in [&b"\n"[..], b"x"] {
        let mut long = Control::of(&simulator);
        long.write(&[&line[..], b" ", end].concat());
        assert_eq!(long.answer(), json!({"ok": false, "error": "the line is longer than 64 KiB"}));
        assert!(long.is_closed());
    }
    let mut browser = Control::of(&simulator);
    browser.write(b"POST / HTTP/1.1\r\nHost: localhost\r\n\r\n{\"do\":\"restart\"}\n");
    assert_eq!(browser.answer()["error"], "this is not HTTP: send lines of JSON over TCP");
    assert!(browser.is_closed());
    assert_eq!(other.done(&json!({"do": "counts"}))["faults"], 0, "the browser's command is not executed");
}

#[test]
fn clients_that_send_garbage_or_do_not_read_hold_up_neither_the_device_nor_other_clients() {
    let simulator = controlled("ball --set baud=115200");
    let mut ball = simulator.connect();
    poll(&mut ball).unwrap();
    let mut garbage = Control::of(&simulator);
    garbage.write(b"\x00\xff\xfe{]\n\n{\"do\"\nnull\n");
    for _ in 0..3 {
        assert_eq!(garbage.answer()["ok"], false);
    }
    garbage.done(&json!({"do": "counts"}));
    // One sends commands and reads no answer, until nothing more is taken.
    let mut deaf = Control::of(&simulator);
    let requests = b"{\"do\":\"help\"}\n".repeat(100);
    deaf.0.get_mut().set_nonblocking(true).unwrap();
    let (mut taken, mut last) = (0, Instant::now());
    while last.elapsed() < Duration::from_secs(1) && taken < 64 << 20 {
        match deaf.0.get_mut().write(&requests) {
            Ok(length) => (taken, last) = (taken + length, Instant::now()),
            Err(_) => thread::sleep(Duration::from_millis(5)),
        }
        assert!(poll(&mut ball).is_ok());
    }
    assert!(taken < 64 << 20, "it took {taken} bytes and nobody took its answers");
    assert!(simulator.resident() < 64 << 20, "{} bytes", simulator.resident());
    let mut others: Vec<Control> = (0..20).map(|_| Control::of(&simulator)).collect();
    let begun = Instant::now();
    for (id, other) in others.iter_mut().enumerate() {
        assert_eq!(other.done(&json!({"do": "get", "id": id}))["id"], id);
    }
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
    poll(&mut ball).unwrap();
}

#[test]
fn answers_come_in_the_order_of_the_requests_and_the_last_ones_before_the_end() {
    let simulator = controlled("fanuc");
    let mut client = Control::of(&simulator);
    let mut requests = String::new();
    for id in 0..200 {
        requests += &json!({"do": "set", "signal": "R[200]", "value": id, "id": id}).to_string();
        requests += "\r\n";
    }
    // The last line is without its end, and is not executed.
    client.write(requests.as_bytes());
    client.write(b"{\"do\":\"restart\"}");
    client.0.get_mut().shutdown(Shutdown::Write).unwrap();
    for id in 0..200 {
        assert_eq!(client.answer(), json!({"id": id, "ok": true}));
    }
    assert!(client.is_closed());
    let mut next = Control::of(&simulator);
    assert_eq!(next.done(&json!({"do": "get", "signal": "R[200]"}))["value"], 199);
}

/// A serial line over TCP: the device server closes the connection, and the next client reaches the same device.
#[test]
fn a_connection_to_a_serial_device_is_cut_in_a_message_and_closed_at_once() {
    let mut simulator = controlled("ball --set baud=115200");
    let mut control = Control::of(&simulator);
    let mut ball = simulator.connect();
    let whole = poll(&mut ball).unwrap();
    control.done(&json!({"do": "cut"}));
    ball.write_all(&[ENQ]).unwrap();
    let mut half = Vec::new();
    ball.read_to_end(&mut half).unwrap();
    assert_eq!((half.len(), &half[..3]), (6, &whole[..3]));
    simulator.line("\"disconnected\"");
    let mut ball = simulator.connect();
    poll(&mut ball).unwrap();
    control.done(&json!({"do": "close", "now": true}));
    assert_eq!(ball.read(&mut [0]).unwrap(), 0);
    poll(&mut simulator.connect()).unwrap();
}

#[test]
fn a_device_without_power_is_back_after_its_time() {
    for device in ["ball --set baud=115200", "fanuc", "mma-robot"] {
        let simulator = controlled(device);
        let mut control = Control::of(&simulator);
        let mut before = simulator.connect();
        let request: &[u8] = match device {
            "fanuc" => &[0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1],
            "mma-robot" => b"STP\r\n",
            _ => &[ENQ],
        };
        before.write_all(request).unwrap();
        before.read_exact(&mut [0; 4]).unwrap();
        let begun = Instant::now();
        control.done(&json!({"do": "restart", "ms": 700}));
        before.read_to_end(&mut Vec::new()).unwrap();
        let mut client = simulator.connect();
        client.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
        let answered = loop {
            assert!(begun.elapsed() < DEADLINE, "{device} does not come back");
            client.write_all(request).unwrap();
            match client.read(&mut [0; 64]) {
                Ok(length) if length > 0 => break begun.elapsed(),
                Ok(_) => client = simulator.connect(),
                Err(_) => {}
            }
            client.set_read_timeout(Some(Duration::from_millis(50))).unwrap();
        };
        assert!(answered > Duration::from_millis(650), "{device} answers after {answered:?}");
    }
}

#[test]
fn a_frozen_device_answers_commands_and_goes_on_where_it_was() {
    for device in ["ball --set baud=115200", "laser --set baud=115200"] {
        let simulator = controlled(device);
        let mut control = Control::of(&simulator);
        let mut client = simulator.connect();
        // A query of the laser's status.
        let request: &[u8] = match device.as_bytes() {
            [b'b', ..] => &[ENQ],
            _ => &[0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, 1, 3, 0x90, 0x82, 0xF6],
        };
        let begun = Instant::now();
        control.done(&json!({"do": "freeze", "ms": 600}));
        client.write_all(request).unwrap();
        control.done(&json!({"do": "get"}));
        assert!(begun.elapsed() < Duration::from_millis(500), "{device}: {:?}", begun.elapsed());
        client.read_exact(&mut [0]).unwrap();
        assert!(begun.elapsed() > Duration::from_millis(550), "{device}: {:?}", begun.elapsed());
    }
}

/// The time of a line passes also while a fault keeps the device from reading.
#[test]
fn a_request_on_a_line_is_delayed_and_so_is_an_answer() {
    let simulator = controlled("ball --set baud=115200");
    let mut control = Control::of(&simulator);
    let mut ball = simulator.connect();
    for of in ["request", "answer"] {
        poll(&mut ball).unwrap();
        control.done(&json!({"do": "delay", "seconds": 0.4, "of": of}));
        let begun = Instant::now();
        poll(&mut ball).unwrap();
        assert!(begun.elapsed() > Duration::from_millis(380), "{of}: {:?}", begun.elapsed());
    }
    let counts = control.done(&json!({"do": "counts"}));
    assert_eq!(counts, json!({"ok": true, "requests": 4, "answers": 4, "executed": 0, "faults": 2}));
}

/// A pseudo-terminal stays open: its client sees silence, and then the device again.
#[cfg(unix)]
#[test]
fn a_message_on_a_pseudo_terminal_is_cut_and_the_next_one_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball");
    let arguments = format!("simulate ball --set baud=115200 --control 0 --pty {}", path.display());
    let mut simulator = Running::start(cellwire(&arguments));
    let mut control = Control::of(&simulator);
    let mut port = serialport::new(path.to_str().unwrap(), 115_200).timeout(DEADLINE).open().unwrap();
    simulator.line("\"connected\"");
    let mut poll = |length: usize| {
        port.write_all(&[ENQ]).unwrap();
        let mut reply = vec![0; length];
        port.read_exact(&mut reply).unwrap();
        reply
    };
    assert_eq!(poll(12)[..2], [0x08, 0xF8]);
    control.done(&json!({"do": "cut"}));
    assert_eq!(poll(6)[..2], [0x08, 0xF8]);
    simulator.line("\"disconnected\"");
    simulator.line("\"connected\"");
    assert_eq!(poll(12)[..2], [0x08, 0xF8], "not the second half");
    control.done(&json!({"do": "restart", "ms": 100}));
    simulator.line("\"disconnected\"");
    simulator.line("\"connected\"");
    assert_eq!(poll(12)[..2], [0x08, 0xF8]);
}
