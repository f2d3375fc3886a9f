//! Scans of devices with a timing of their own, and the remarks of `cellwire modbus` after a timeout or a wrong request.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::fanuc_cell::{err, out};
use serde_json::{Value, json};

/// Serves each connection, one after the other. Returns the address.
fn serve(each: impl Fn(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || listener.incoming().map_while(Result::ok).for_each(each));
    address
}

/// Reads a request; returns the reply with value 7.
fn reply(stream: &mut TcpStream) -> Option<Vec<u8>> {
    let mut request = [0; 12];
    stream.read_exact(&mut request).ok()?;
    Some([&request[..5], &[5, request[6], 3, 2, 0, 7]].concat())
}

fn modbus(arguments: &[&str], input: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.arg("modbus").args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    child.wait_with_output().unwrap()
}

/// Returns the units that a scan finds.
fn units(output: &Output) -> Vec<Value> {
    let lines = out(output).lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    lines.map(|line| line["unit"].clone()).collect()
}

#[test]
fn a_device_that_loses_the_first_bytes_of_a_connection_is_found_and_reported() {
    let address = serve(|mut stream| {
        let begin = Instant::now();
        while let Some(reply) = reply(&mut stream) {
            if begin.elapsed() > Duration::from_millis(300) && reply[6] == 1 {
                let _ = stream.write_all(&reply);
            }
        }
    });
    let output = modbus(&["scan", &address, "--units", "1-3"], "");
    assert_eq!((output.status.code(), units(&output)), (Some(0), vec![json!(1)]), "{}", err(&output));
    let warning = "warning: 1 request at the start of a connection was answered only when it was made again: the server loses the \
                   first bytes of a connection; --set connect_pause=1s\n";
    assert!(err(&output).contains(warning), "{}", err(&output));
    let output = modbus(&["scan", &address, "--units", "1-3", "--set", "connect_pause=1s"], "");
    assert_eq!((units(&output), err(&output)), (vec![json!(1)], ""));
}

#[test]
fn a_device_that_needs_a_pause_between_requests_is_found_and_reported() {
    let address = serve(|mut stream| {
        let mut replied: Option<Instant> = None;
        while let Some(reply) = reply(&mut stream) {
            if replied.is_none_or(|at| at.elapsed() > Duration::from_millis(300)) {
                let _ = stream.write_all(&reply);
                replied = Some(Instant::now());
            }
        }
    });
    let output = modbus(&["scan", &address, "--units", "1-3"], "");
    assert_eq!(units(&output), [1, 2, 3].map(|unit| json!(unit)), "{}", err(&output));
    let warning = "warning: 2 requests right after a reply were answered only when they were made again: the server needs a pause \
                   between requests; --set pause=500ms\n";
    assert!(err(&output).contains(warning), "{}", err(&output));
    let output = modbus(&["scan", &address, "--units", "1-3", "--set", "pause=500ms"], "");
    assert_eq!((units(&output).len(), err(&output)), (3, ""));
}

#[test]
fn closed_connections_are_reported_with_the_settings_that_may_help() {
    let address = serve(drop);
    let output = modbus(&["scan", &address], "");
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    for part in [
        "units 5 to 247 were not asked\n",
        "warning: the server closed 8 connections and has not replied: ",
        "--set connect_pause=1s",
        "no unit replied\n",
    ] {
        assert!(err(&output).contains(part), "{part}: {}", err(&output));
    }
    let address = serve(|mut stream| {
        let reply = reply(&mut stream).unwrap();
        let _ = stream.write_all(&reply);
    });
    let output = modbus(&["scan", &address, "--units", "1-3"], "");
    assert_eq!(units(&output).len(), 3, "{}", err(&output));
    assert!(err(&output).contains(" connections: it may need --set pause=500ms, or "), "{}", err(&output));
}

#[test]
fn a_reply_after_the_timeout_of_a_scan_is_reported() {
    let address = serve(|mut stream| {
        while let Some(reply) = reply(&mut stream) {
            thread::sleep(Duration::from_millis(300));
            let _ = stream.write_all(&reply);
        }
    });
    let output = modbus(&["scan", &address, "--units", "1-3"], "");
    assert!(
        err(&output).contains(" came after the timeout: --set timeout=1s waits longer\n"),
        "{}",
        err(&output)
    );
}

#[test]
fn a_timeout_names_the_command_that_finds_units() {
    let address = serve(|mut stream| while reply(&mut stream).is_some() {});
    let hint = format!("`cellwire modbus scan {address}` shows which units answer; 9 was asked\n");
    let read = "{\"unit\":9,\"function\":3,\"address\":0,\"quantity\":1}\n";
    let output = modbus(&["send", &address, "--set", "timeout=100ms"], &read.repeat(2));
    assert_eq!((err(&output), output.status.code()), (hint.as_str(), Some(1)));
    let poll = ["poll", &address, "holding:0", "--unit", "9", "--every", "10ms", "--for", "500ms"];
    let output = modbus(&[&poll[..], &["--set", "timeout=100ms"]].concat(), "");
    assert_eq!(err(&output), hint, "once");
}

#[test]
fn a_wrong_request_is_an_error_with_its_key_and_one_line_number() {
    let address = serve(|mut stream| while reply(&mut stream).is_some() {});
    let error = |request: &str| {
        let output = modbus(&["send", &address], &format!("\n{request}\n"));
        assert_eq!(output.status.code(), Some(2));
        err(&output).to_owned()
    };
    assert_eq!(
        error(r#"{"function":3,"adress":0,"quantity":1}"#),
        "error: line 2 is not a message object: unknown key adress: a request of function 3 has transaction, unit, function, \
         address, quantity\n"
    );
    assert_eq!(
        error(r#"{"function":3,"address":0,"#),
        "error: line 2 is not a message object: column 26: EOF while parsing a value\n"
    );
}

/// On a serial line the first request waits: that time is reported, and is not part of the time to poll.
#[cfg(unix)]
#[test]
fn the_wait_before_the_first_request_on_a_serial_line_is_reported() {
    use fanuc_hmi_modbus::crc::crc16;
    let (mut device, client) = serialport::TTYPort::pair().unwrap();
    let path = serialport::SerialPort::name(&client).unwrap();
    thread::spawn(move || {
        let (mut request, mut held, mut value) = ([0; 8], 0, 0);
        loop {
            match device.read(&mut request[held..]) {
                Ok(length) => held += length,
                Err(_) => thread::sleep(Duration::from_millis(5)),
            }
            if held == 8 {
                (held, value) = (0, value + 1);
                let reply = [1, 3, 2, 0, value];
                device.write_all(&[&reply[..], &crc16(&reply).to_le_bytes()].concat()).unwrap();
            }
        }
    });
    let poll = ["poll", &path, "holding:0", "--every", "50ms", "--for", "1s", "--set", "timeout=500ms"];
    let output = modbus(&poll, "");
    let remark = "the first request waits 1.5 s, for a reply to a request of an earlier client (the settings timeout and settle)\n";
    assert_eq!(err(&output), remark);
    assert!(out(&output).lines().count() > 5, "{}", out(&output));
    drop(client);
}
