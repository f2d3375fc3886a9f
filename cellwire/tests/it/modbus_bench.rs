//! `cellwire modbus` at the bench: servers that cut replies, ignore writes and have holes; scans, polls, exit statuses;
//! serial lines.

use core::ops::ControlFlow;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::fanuc_cell::{Folder, Simulator, err, out};
use fanuc_hmi_modbus::{BitsMut, Exception, Registers, Server, ServerConfig, Words, WordsMut, crc};
use serde_json::{Value, json};

/// Runs `cellwire modbus` with requests on its standard input.
pub(crate) fn ask(arguments: &[&str], requests: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.arg("modbus").args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    child.stdin.take().unwrap().write_all(requests.as_bytes()).unwrap();
    child.wait_with_output().unwrap()
}

pub(crate) fn lines(output: &Output) -> Vec<Value> {
    out(output).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

pub(crate) const READ: &str = "{\"unit\":1,\"function\":3,\"address\":0,\"quantity\":2}\n";
pub(crate) const REPLY: [u8; 7] = [1, 3, 4, 0, 7, 0, 8];

/// Starts a server with one behaviour for every connection, on a free port.
fn serve<R: Registers + Send + 'static>(
    config: ServerConfig,
    registers: impl Fn() -> R + Send + 'static,
) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let mut server = Server::<_, 4>::new(config, registers()).unwrap();
            let _ = robot_session::drive(&mut server, stream, |_, _| ControlFlow::<()>::Continue(()));
        }
    });
    address
}

#[test]
fn after_a_cut_reply_the_next_good_one_is_not_lost() {
    for framing in ["tcp", "rtu"] {
        for kept in [1, 4, 6, 8] {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let address = listener.local_addr().unwrap().to_string();
            thread::spawn(move || {
                let mut served = 0;
                for mut stream in listener.incoming().map_while(Result::ok) {
                    let mut request = [0; 64];
                    while let Ok(1..) = stream.read(&mut request) {
                        served += 1;
                        let mut reply = Vec::new();
                        if framing == "tcp" {
                            reply.extend([request[0], request[1], 0, 0, 0, 7]);
                            reply.extend(REPLY);
                        } else {
                            reply.extend(REPLY);
                            reply.extend(crc::crc16(&REPLY).to_le_bytes());
                        }
                        let length = if served == 1 { kept } else { reply.len() };
                        if stream.write_all(&reply[..length]).is_err() {
                            break;
                        }
                    }
                }
            });
            let arguments =
                ["send", &address, "--set", &format!("framing={framing}"), "--set", "timeout=700ms"];
            let output = ask(&arguments, &READ.repeat(3));
            let found = lines(&output);
            assert_eq!(found.len(), 3, "{framing} {kept}: {}", err(&output));
            assert!(
                found[0]["failed"].as_str().unwrap().starts_with("no reply before the timeout"),
                "{found:?}"
            );
            for reply in &found[1..] {
                assert_eq!(reply["registers"], json!([7, 8]), "{framing}, {kept} bytes: {}", err(&output));
            }
            assert_eq!(output.status.code(), Some(1), "one has failed");
        }
    }
}

/// Starts a server on a free port that calls `serve` with its first connection.
pub(crate) fn once(serve: impl FnOnce(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        let stream = listener.accept().unwrap().0;
        drop(listener);
        serve(stream);
    });
    address
}

pub(crate) fn reply_to(request: &[u8], transaction: u8, value: u8) -> Vec<u8> {
    vec![request[0], transaction, 0, 0, 0, 7, request[6], 3, 4, 0, value, 0, value]
}

#[test]
fn a_reply_that_comes_before_its_request_is_not_its_reply() {
    let address = once(|mut stream| {
        let mut request = [0; 12];
        for value in 1..=3 {
            stream.read_exact(&mut request).unwrap();
            thread::sleep(Duration::from_millis(100));
            stream.write_all(&reply_to(&request, request[1], value)).unwrap();
            thread::sleep(Duration::from_millis(100));
            stream.write_all(&reply_to(&request, request[1] + 1, 99)).unwrap();
        }
        let _ = stream.read(&mut request);
    });
    let mut child = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(["modbus", "send", &address])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut requests = child.stdin.take().unwrap();
    for _ in 0..3 {
        requests.write_all(READ.as_bytes()).unwrap();
        thread::sleep(Duration::from_millis(600));
    }
    drop(requests);
    let output = child.wait_with_output().unwrap();
    let values: Vec<Value> = lines(&output).iter().map(|line| line["registers"].clone()).collect();
    assert_eq!(values, [json!([1, 1]), json!([2, 2]), json!([3, 3])], "{}", err(&output));
    assert_eq!(err(&output).matches("unasked").count(), 2, "{}", err(&output));
}

#[test]
fn each_request_has_its_line_when_the_connection_is_lost() {
    const LOST: &str = "the connection was lost; if the request writes, it may have been executed";
    const NOT_SENT: &str = "the connection was lost before the request was sent";
    const CUT: &str = "no reply before the timeout; if the request writes, it may have been executed; \
                       received instead: an incomplete reply, of which 5 bytes have arrived";
    let failures = |output: &Output| -> Vec<String> {
        lines(output).iter().map(|line| line["failed"].as_str().unwrap_or("none").to_owned()).collect()
    };
    // After a reply; instead of one.
    for served in [1, 0] {
        let address = once(move |mut stream| {
            let mut request = [0; 12];
            for _ in 0..served {
                stream.read_exact(&mut request).unwrap();
                stream.write_all(&reply_to(&request, request[1], 7)).unwrap();
            }
            stream.read_exact(&mut request).unwrap();
        });
        let output = ask(&["send", &address], &READ.repeat(4));
        let mut expected = vec!["none"; served];
        expected.extend([LOST].into_iter().chain(vec![NOT_SENT; 3 - served]));
        assert_eq!(failures(&output), expected, "{}", err(&output));
        assert_eq!(output.status.code(), Some(3));
    }
    // A reply that is cut, and no other connection.
    let address = once(|mut stream| {
        let mut request = [0; 12];
        stream.read_exact(&mut request).unwrap();
        stream.write_all(&reply_to(&request, request[1], 7)[..5]).unwrap();
        let _ = stream.read(&mut request);
    });
    let output = ask(&["send", &address, "--set", "timeout=300ms"], &READ.repeat(3));
    assert_eq!(failures(&output), [CUT, NOT_SENT, NOT_SENT], "{}", err(&output));
    assert_eq!(output.status.code(), Some(3));
    // While a write is read back.
    let address = once(|mut stream| {
        let mut request = [0; 12];
        stream.read_exact(&mut request).unwrap();
        stream.write_all(&request).unwrap();
        stream.read_exact(&mut request).unwrap();
    });
    let write = "{\"unit\":1,\"function\":6,\"address\":10,\"value\":3}\n";
    let output = ask(&["send", "--confirm", &address], &write.repeat(2));
    let found = lines(&output);
    assert_eq!((&found[0]["confirmed"], &found[0]["holds"]), (&json!(false), &json!(LOST)), "{found:?}");
    assert_eq!((found.len(), &found[1]["failed"]), (2, &json!(NOT_SENT)), "{found:?}");
    assert_eq!(output.status.code(), Some(3));
}

#[test]
fn a_serial_line_has_parity_and_stop_bits_and_loses_no_reply_after_a_cut_one() {
    let (mut device, client) = serialport::TTYPort::pair().unwrap();
    let path = serialport::SerialPort::name(&client).unwrap();
    let line = path.clone();
    let served = thread::spawn(move || {
        let mut settings = String::new();
        for served in 0..3 {
            let (mut request, mut held) = ([0; 8], 0);
            let begin = Instant::now();
            while held < 8 {
                match device.read(&mut request[held..]) {
                    Ok(length) => held += length,
                    Err(_) => thread::sleep(Duration::from_millis(5)), // the client has not opened its end yet
                }
                assert!(begin.elapsed() < Duration::from_secs(30), "no request");
            }
            let shown = Command::new("stty").args(["-a", "-F", &line]).output().unwrap();
            settings = String::from_utf8(shown.stdout).unwrap();
            let mut reply = REPLY.to_vec();
            reply.extend(crc::crc16(&REPLY).to_le_bytes());
            let kept = if served == 0 { 5 } else { reply.len() };
            device.write_all(&reply[..kept]).unwrap();
        }
        settings
    });
    let arguments = ["send", &path, "--baud", "9600", "--mode", "8O2", "--set", "timeout=300ms"];
    let output = ask(&arguments, &READ.repeat(3));
    let found = lines(&output);
    assert!(found[0]["failed"].is_string(), "{found:?}");
    assert!(found[1..].iter().all(|reply| reply["registers"] == json!([7, 8])), "{found:?} {}", err(&output));
    // A pseudo-terminal drops `parenb` and the speed, and keeps the rest.
    let settings = served.join().unwrap();
    for word in [" parodd ", " cstopb "] {
        assert!(settings.contains(word), "{word}: {settings}");
    }
    drop(client);
}

#[test]
fn what_a_scan_finds_is_there_and_what_is_there_is_found() {
    /// Holding registers 10 to 14, 20, and 30 to 399; no others.
    struct Holes;
    impl Registers for Holes {
        fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
            let has = |n: u16| (10..15).contains(&n) || n == 20 || (30..400).contains(&n);
            let last = address + u16::try_from(out.len()).unwrap() - 1;
            if (address..=last).all(has) { Ok(()) } else { Err(Exception::IllegalDataAddress) }
        }
        fn read_coils(&mut self, _: u16, _: &mut BitsMut<'_>) -> Result<(), Exception> {
            Err(Exception::IllegalDataAddress)
        }
    }
    let address = serve(ServerConfig::tcp(), || Holes);
    let output = ask(&["scan", &address, "--ranges", "--to", "999"], "");
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let run =
        |from: u16, to: u16| json!({"table": "holding", "from": from, "to": to, "count": to - from + 1});
    let stopped = |table: &str| json!({"table": table, "stopped": "exception 1 (illegal function)"});
    let found = lines(&output);
    assert_eq!(
        found,
        [stopped("discrete"), stopped("input"), run(10, 14), run(20, 20), run(30, 399)],
        "{found:?}"
    );
    let output = ask(&["scan", &address, "--ranges", "--from", "400", "--to", "500"], "");
    assert_eq!(output.status.code(), Some(1), "nothing there");
    // The FANUC controller's tables end where Table 1 of the source ends.
    let simulator = Simulator::start("127.0.0.1:0", &[]);
    let output = ask(&["scan", &simulator.address, "--ranges", "--from", "3700", "--to", "4300"], "");
    let ends: Vec<(Value, Value)> =
        lines(&output).iter().map(|run| (run["table"].clone(), run["to"].clone())).collect();
    let expected = [("coils", 4300), ("discrete", 4300), ("input", 3999), ("holding", 4300)];
    assert_eq!(ends, expected.map(|(table, to)| (json!(table), json!(to))));
}

#[test]
fn a_scan_finds_the_units_that_reply_with_whatever() {
    let unit = |unit| ServerConfig { unit: Some(unit), ..ServerConfig::rtu_over_tcp(unit) };
    struct Empty;
    impl Registers for Empty {}
    let address = serve(unit(3), || Empty);
    let arguments = ["scan", &address, "--set", "framing=rtu", "--units", "1-5", "--set", "timeout=300ms"];
    let output = ask(&arguments, "");
    assert_eq!(
        lines(&output),
        [json!({"unit": 3, "reply": "exception 1 (illegal function)"})],
        "{}",
        err(&output)
    );
    assert_eq!(output.status.code(), Some(0));
    let output =
        ask(&["scan", &address, "--set", "framing=rtu", "--units", "4-5", "--set", "timeout=100ms"], "");
    assert_eq!((output.status.code(), err(&output).trim_end().ends_with("no unit replied")), (Some(1), true));
}

/// A server that takes writes and forgets them.
struct Forgetful;
impl Registers for Forgetful {
    fn read_holding_registers(&mut self, _: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.fill_with(|_| 0x00F0);
        Ok(())
    }
    fn write_registers(&mut self, _: u16, _: Words<'_>) -> Result<(), Exception> {
        Ok(())
    }
}

#[test]
fn a_write_is_confirmed_by_what_the_server_holds_afterwards() {
    let simulator = Simulator::start("127.0.0.1:0", &[]);
    let writes = "{\"unit\":1,\"function\":16,\"address\":1000,\"values\":[1,2,3]}\n\
                  {\"unit\":1,\"function\":6,\"address\":1003,\"value\":7}\n\
                  {\"unit\":1,\"function\":15,\"address\":9,\"values\":[true,false,true]}\n\
                  {\"unit\":1,\"function\":5,\"address\":20,\"value\":true}\n\
                  {\"unit\":1,\"function\":22,\"address\":1003,\"and\":65280,\"or\":5}\n\
                  {\"unit\":1,\"function\":23,\"address\":0,\"quantity\":1,\"write_address\":1100,\"values\":[9,9]}\n";
    let output = ask(&["send", "--confirm", &simulator.address], writes);
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let found = lines(&output);
    assert_eq!(found.len(), 6);
    assert!(found.iter().all(|reply| reply["confirmed"] == true), "{found:?}");
    let reads = "{\"unit\":1,\"function\":3,\"address\":1000,\"quantity\":4}\n";
    assert_eq!(
        lines(&ask(&["send", "--confirm", &simulator.address], reads))[0].get("confirmed"),
        None,
        "no write"
    );
    // A server that forgets.
    let address = serve(ServerConfig::tcp(), || Forgetful);
    let writes = "{\"unit\":1,\"function\":16,\"address\":1,\"values\":[1,2]}\n\
                  {\"unit\":1,\"function\":6,\"address\":1,\"value\":240}\n";
    let output = ask(&["send", "--confirm", &address], writes);
    assert_eq!(output.status.code(), Some(1));
    let found = lines(&output);
    assert_eq!((&found[0]["confirmed"], &found[0]["holds"]), (&json!(false), &json!([240, 240])));
    assert_eq!(found[1]["confirmed"], true);
}

#[test]
fn the_exit_status_names_what_went_wrong() {
    let simulator = Simulator::start("127.0.0.1:0", &[]);
    let beyond = "{\"unit\":1,\"function\":4,\"address\":65535,\"quantity\":1}\n";
    let output = ask(&["send", &simulator.address], &format!("{beyond}{READ}"));
    assert_eq!(output.status.code(), Some(6), "{}", err(&output));
    assert_eq!(lines(&output).len(), 2, "the requests after it are made all the same");
    assert_eq!(ask(&["send", &simulator.address], READ).status.code(), Some(0));
    assert_eq!(ask(&["send", &simulator.address], "nonsense\n").status.code(), Some(2));
    // A server that is silent, and one that hangs up.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = silent.local_addr().unwrap().to_string();
    let output = ask(&["send", &address, "--set", "timeout=100ms"], READ);
    assert_eq!(output.status.code(), Some(1));
    drop(silent);
    assert_eq!(ask(&["send", &address], READ).status.code(), Some(2), "nobody listens");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || listener.incoming().map_while(Result::ok).for_each(drop));
    assert_eq!(ask(&["send", &address], READ).status.code(), Some(3));
    let output = Command::new(env!("CARGO_BIN_EXE_cellwire")).args(["modbus", "send"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "a server is needed");
}

#[test]
fn a_poll_prints_what_changes_and_survives_a_restart() {
    let folder = Folder::new("poll");
    let first = Simulator::start("127.0.0.1:0", &[]);
    let address = first.address.clone();
    let poll = [
        "modbus",
        "poll",
        &address,
        "holding:1000-1199",
        "coils:7",
        "holding:16447-16448",
        "--every",
        "20ms",
    ];
    let mut poll = folder.command(&poll).stdout(Stdio::piped()).spawn().unwrap();
    let (sender, receiver) = std::sync::mpsc::channel::<Value>();
    let out = poll.stdout.take().unwrap();
    thread::spawn(move || {
        for line in BufReader::new(out).lines().map_while(Result::ok) {
            let _ = sender.send(serde_json::from_str(&line).unwrap());
        }
    });
    let next = || {
        let mut line = receiver.recv_timeout(Duration::from_secs(30)).unwrap();
        assert!(line["time"].is_f64(), "{line}");
        line.as_object_mut().unwrap().remove("time");
        line
    };
    let shown = next();
    assert_eq!((&shown["address"], shown["values"].as_array().unwrap().len()), (&json!(1000), 125));
    assert_eq!(next()["values"].as_array().unwrap().len(), 75, "in two requests");
    assert_eq!(next(), json!({"table": "coils", "address": 7, "values": [false]}));
    let refused = next();
    assert_eq!((&refused["table"], refused["failed"].is_string()), (&json!("holding"), true));
    let write = "{\"unit\":1,\"function\":6,\"address\":1150,\"value\":5}\n";
    assert_eq!(ask(&["send", &address], write).status.code(), Some(0));
    assert_eq!(next(), json!({"table": "holding", "address": 1150, "was": 1151, "is": 5}));
    drop(first);
    assert_eq!(next()["event"], "disconnected");
    let second = Simulator::start(&address, &[]);
    assert_eq!(next()["event"], "reconnected");
    // The new one has not the value that was written.
    assert_eq!(next(), json!({"table": "holding", "address": 1150, "was": 5, "is": 1151}));
    assert!(Command::new("kill").args(["-INT", &poll.id().to_string()]).status().unwrap().success());
    let begin = Instant::now();
    let code = loop {
        match poll.try_wait().unwrap() {
            Some(status) => break status.code(),
            None if begin.elapsed() > Duration::from_secs(20) => {
                poll.kill().unwrap();
                panic!("it does not end")
            }
            None => thread::sleep(Duration::from_millis(20)),
        }
    };
    assert_eq!(code, Some(1), "a range was refused");
    drop(second);
}

#[test]
fn a_poll_waits_for_a_server_that_is_off_at_the_start_and_not_for_an_unknown_name() {
    let folder = Folder::new("off");
    let address = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let poll = ["modbus", "poll", &address, "coils:7", "--every", "20ms"];
    let mut poll = folder.command(&poll).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(poll.stdout.take().unwrap()).lines();
    let mut next = || serde_json::from_str::<Value>(&lines.next().unwrap().unwrap()).unwrap();
    let off = next();
    assert_eq!(off["event"], "not_connected");
    assert!(off["why"].as_str().unwrap().starts_with(&format!("cannot connect to {address}: ")), "{off}");
    let server = Simulator::start(&address, &[]);
    assert_eq!(next()["event"], "connected");
    assert_eq!(next()["values"], json!([false]));
    poll.kill().unwrap();
    poll.wait().unwrap();
    drop(server);
    let output = folder.run(&format!("modbus poll {address} coils:7 --for 200ms"));
    assert_eq!(output.status.code(), Some(3), "off until the end");
    for address in ["nonsense:", "no.such.invalid:502"] {
        assert_eq!(folder.run(&format!("modbus poll {address} coils:7")).status.code(), Some(2), "{address}");
    }
}
