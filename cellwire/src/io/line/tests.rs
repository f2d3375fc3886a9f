#![allow(clippy::unwrap_used)]

use std::io::Read;
use std::net::{TcpListener, TcpStream};

use super::*;
use cellwire_io::serial;
use cellwire_io::trace::TraceArgs;

const MS: Duration = Duration::from_millis(1);

fn line(baud: u32) -> (Line, Box<dyn SerialPort>, Clock) {
    let (device, path) = serial::pair().unwrap();
    let clock = Clock::start();
    let mut line =
        Line::over_port(device, std::path::Path::new(&path), clock, baud, TraceArgs::off().start("x"))
            .unwrap();
    let client = open(&path, baud);
    while !line.is_connected() {
        assert!(line.wait(clock.now() + MS));
    }
    (line, client, clock)
}

/// Opens a client with a timeout that is long enough on a busy computer.
fn open(path: &str, baud: u32) -> Box<dyn SerialPort> {
    let mut client = serial::open(path, baud).unwrap();
    client.set_timeout(20_000 * MS).unwrap();
    client
}

#[test]
fn bytes_arrive_at_the_baud_rate_both_ways() {
    let (mut line, mut client, clock) = line(1200);
    let before = clock.now();
    let arrives = line.send(&[1, 2, 3, 4, 5, 6]);
    let six_bytes = 50 * MS;
    assert!((before + six_bytes..clock.now() + six_bytes).contains(&arrives));
    let reader = thread::spawn(move || {
        let mut bytes = [0; 6];
        client.read_exact(&mut bytes).unwrap();
        let at = clock.now();
        client.write_all(&[7, 8, 9]).unwrap();
        (client, bytes, at)
    });
    let mut got = Vec::new();
    while got.len() < 3 {
        assert!(line.wait(clock.now() + 500 * MS));
        got.extend(core::iter::from_fn(|| line.receive().map(|(_, byte)| byte)));
    }
    let answered = clock.now();
    let (_client, bytes, at) = reader.join().unwrap();
    assert_eq!((bytes, &got[..]), ([1, 2, 3, 4, 5, 6], &[7, 8, 9][..]));
    assert!(at >= arrives, "{at:?} is before the last byte at {arrives:?}");
    assert!(answered - at >= 24 * MS, "three bytes took {:?}", answered - at);
}

#[test]
fn bytes_sent_without_a_client_are_lost_and_the_next_client_is_served() {
    let (device, path) = serial::pair().unwrap();
    let clock = Clock::start();
    let mut line =
        Line::over_port(device, std::path::Path::new(&path), clock, 115_200, TraceArgs::off().start("x"))
            .unwrap();
    for round in 1..4u8 {
        line.send(&[99]);
        assert!(line.wait(clock.now() + 5 * MS));
        let mut client = open(&path, 115_200);
        while !line.is_connected() {
            assert!(line.wait(clock.now() + MS));
        }
        line.send(&[round]);
        assert!(line.wait(clock.now() + 5 * MS));
        let mut byte = [0];
        client.read_exact(&mut byte).unwrap();
        assert_eq!(byte, [round]);
        drop(client);
        while line.is_connected() {
            assert!(line.wait(clock.now() + MS));
        }
    }
}

#[test]
fn a_client_that_disconnects_and_the_end_of_the_line_write_a_trace() {
    let dir = std::env::temp_dir().join(format!("cellwire-line-{}", std::process::id()));
    std::fs::create_dir_all(&dir).unwrap();
    let (device, path) = serial::pair().unwrap();
    let clock = Clock::start();
    let trace = Trace::new("x", 10, Some(&dir));
    let mut line = Line::over_port(device, std::path::Path::new(&path), clock, 115_200, trace).unwrap();
    for byte in [7, 8] {
        let mut client = open(&path, 115_200);
        client.write_all(&[byte]).unwrap();
        while line.receive().is_none() {
            assert!(line.wait(clock.now() + 50 * MS));
        }
        drop(client);
        while byte == 7 && line.is_connected() {
            assert!(line.wait(clock.now() + MS));
        }
        assert!(line.wait(clock.now() + MS));
    }
    drop(line);
    let files = ["x.trace", "x-2.trace"].map(|name| std::fs::read_to_string(dir.join(name)).unwrap());
    assert!(files[0].starts_with("# x: the client disconnected\n07 # "), "{files:?}");
    assert!(files[1].starts_with("# x: ") && files[1].contains("\n08 # "), "{files:?}");
    std::fs::remove_dir_all(dir).unwrap();
}

#[test]
fn over_tcp_the_device_serves_one_client_after_another() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let clock = Clock::start();
    let (listener, trace) = (Listener::new(listener).unwrap(), TraceArgs::off().start("x"));
    let mut line = Line::over_tcp(listener, None, clock, 115_200, trace).unwrap();
    for round in 1..4u8 {
        let mut client = TcpStream::connect(address).unwrap();
        client.write_all(&[round]).unwrap();
        let byte = loop {
            assert!(line.wait(clock.now() + 50 * MS));
            if let Some((_, byte)) = line.receive() {
                break byte;
            }
        };
        line.send(&[byte, byte]);
        assert!(line.wait(clock.now() + 5 * MS));
        let mut echo = [0; 2];
        client.read_exact(&mut echo).unwrap();
        assert_eq!(echo, [round, round]);
        drop(client);
        while line.is_connected() {
            assert!(line.wait(clock.now() + MS));
        }
    }
}

#[test]
fn the_bytes_of_a_client_that_has_left_are_carried_although_it_is_silent() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let clock = Clock::start();
    let (listener, trace) = (Listener::new(listener).unwrap(), TraceArgs::off().start("x"));
    // 40 bytes take 333 ms.
    let mut line = Line::over_tcp(listener, Some(50 * MS), clock, 1200, trace).unwrap();
    let mut client = TcpStream::connect(address).unwrap();
    client.write_all(&[7; 40]).unwrap();
    drop(client);
    let (end, mut bytes) = (clock.now() + Duration::from_secs(5), 0);
    while bytes < 40 && clock.now() < end {
        assert!(line.wait(clock.now() + MS));
        bytes += core::iter::from_fn(|| line.receive()).count();
    }
    assert_eq!(bytes, 40);
}

#[test]
fn faults_are_about_as_frequent_as_configured() {
    let (line, mut client, clock) = line(10_000_000);
    let mut faults = ByteFaults::none();
    faults.flip = 0.02;
    let mut line = line.with_faults(faults);
    let sent = vec![0; 2000];
    client.write_all(&sent).unwrap();
    let mut got = Vec::new();
    while got.len() < sent.len() {
        assert!(line.wait(clock.now() + 500 * MS));
        got.extend(core::iter::from_fn(|| line.receive().map(|(_, byte)| byte)));
    }
    let wrong = got.iter().filter(|byte| byte.count_ones() == 1).count() as u64;
    assert_eq!(wrong, line.faults());
    assert!((10..100).contains(&wrong), "{wrong} of 2000");
}

/// An answer that is on the line, or that the client has not read, is lost with it.
#[test]
fn the_next_client_of_a_pseudo_terminal_reads_no_answer_to_the_one_before() {
    for read in [0, 6, 12] {
        let (mut line, mut client, clock) = line(1200);
        client.write_all(&[5]).unwrap();
        while line.receive().is_none() {
            assert!(line.wait(clock.now() + 20 * MS));
        }
        line.send(&[0xA5; 12]);
        // How much of it has arrived when the client closes.
        let until = clock.now() + 9 * MS * read;
        while clock.now() < until {
            assert!(line.wait(until));
        }
        let (path, left) = (client.name().unwrap(), line.left());
        drop(client);
        while line.left() == left {
            assert!(line.wait(clock.now() + MS));
        }
        let mut next = open(&path, 1200);
        next.set_timeout(200 * MS).unwrap();
        let reader = thread::spawn(move || next.read(&mut [0; 12]).map_err(|error| error.kind()));
        while !reader.is_finished() {
            assert!(line.wait(clock.now() + MS));
        }
        assert_eq!(reader.join().unwrap(), Err(std::io::ErrorKind::TimedOut), "{read}");
    }
}
