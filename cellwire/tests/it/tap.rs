//! The tap as a process: the bytes that it forwards and writes, and its behaviour when its output is not read.
#![allow(clippy::cast_possible_truncation, reason = "numbers of a test are small")]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream, UdpSocket};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::tool::{DEADLINE, Running, cellwire, run};
use cellwire::io::capture::reassembly::{Piece, Reassembly};
use cellwire::io::capture::{self, CaptureItem, Flow, Reading};
use cellwire_io::serial;
use serialport::SerialPort;
use socket2::SockRef;

/// A tap of TCP between its clients and a server of the test.
struct Tapped {
    tap: Running,
    server: TcpListener,
    capture: PathBuf,
    _folder: tempfile::TempDir,
}

impl Tapped {
    fn new() -> Self {
        let (server, folder) = (TcpListener::bind("127.0.0.1:0").unwrap(), tempfile::tempdir().unwrap());
        let capture = folder.path().join("it.pcapng");
        let tap = Running::start(cellwire(&format!(
            "tap laser-eb90 --listen 127.0.0.1:0 --connect {} --capture {}",
            server.local_addr().unwrap(),
            capture.display()
        )));
        Self { tap, server, capture, _folder: folder }
    }

    fn connect(&self) -> (TcpStream, TcpStream) {
        let client = self.tap.connect();
        let server = self.server.accept().unwrap().0;
        server.set_read_timeout(Some(DEADLINE)).unwrap();
        (client, server)
    }
}

/// Returns the bytes of each flow of a capture in sequence, and whether every block is whole and no byte is missing.
fn kept(path: &Path) -> (BTreeMap<String, Vec<u8>>, bool) {
    let mut flows: BTreeMap<String, (Reassembly, Vec<u8>)> = BTreeMap::new();
    let mut is_whole = true;
    capture::read(Box::new(File::open(path).unwrap()), &Reading::default(), |found| {
        let CaptureItem::Packet(packet) = found else {
            is_whole = false;
            return Ok(());
        };
        let name = match packet.flow {
            Flow::Tcp(from, to) | Flow::Udp(from, to) => format!("{from} > {to}"),
            Flow::Serial(interface) => format!("{interface}"),
            Flow::Kept(line, by_keeper) => format!("{line} {by_keeper}"),
        };
        let (tcp, bytes) = flows.entry(name).or_default();
        let Some(segment) = packet.segment else {
            bytes.extend_from_slice(packet.payload);
            return Ok(());
        };
        if segment.opens {
            tcp.open(segment.sequence);
        }
        tcp.push(segment.sequence, packet.payload, 0, |piece| {
            match piece {
                Piece::Bytes(more) => bytes.extend_from_slice(more),
                _ => is_whole = false,
            }
            Ok(())
        })
    })
    .unwrap();
    (flows.into_iter().map(|(name, (_, bytes))| (name, bytes)).collect(), is_whole)
}

/// Waits until the capture has this many bytes of each flow.
fn kept_when(path: &Path, lengths: &[usize]) -> Vec<Vec<u8>> {
    let begin = Instant::now();
    loop {
        // A copy may not have begun.
        let is_empty = path.metadata().unwrap().len() == 0;
        let (flows, is_whole) = if is_empty { Default::default() } else { kept(path) };
        let flows: Vec<Vec<u8>> = flows.into_values().collect();
        let mut found: Vec<usize> = flows.iter().map(Vec::len).collect();
        found.sort_unstable();
        if found == lengths {
            assert!(is_whole);
            return flows;
        }
        assert!(begin.elapsed() < DEADLINE, "{found:?} in place of {lengths:?}");
        thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn every_byte_passes_unchanged_and_is_in_the_capture() {
    let tapped = Tapped::new();
    let (client, server) = tapped.connect();
    let sent: [Vec<u8>; 2] = [3_000_000, 2_000_000].map(|length| {
        let mut rng = fastrand::Rng::with_seed(length as u64);
        (0..length).map(|_| rng.u8(..)).collect()
    });
    thread::scope(|scope| {
        for ((mut from, mut to), bytes) in [(&client, &server), (&server, &client)].into_iter().zip(&sent) {
            scope.spawn(move || {
                let mut rest = &bytes[..];
                let mut rng = fastrand::Rng::with_seed(1);
                while !rest.is_empty() {
                    let (head, tail) = rest.split_at(rng.usize(1..=rest.len().min(40_000)));
                    from.write_all(head).unwrap();
                    rest = tail;
                }
            });
            scope.spawn(move || {
                let mut received = vec![0; bytes.len()];
                to.read_exact(&mut received).unwrap();
                assert!(received == *bytes);
            });
        }
    });
    let mut kept = kept_when(&tapped.capture, &[2_000_000, 3_000_000]);
    kept.sort_unstable_by_key(|bytes| std::cmp::Reverse(bytes.len()));
    assert!(kept == sent);
}

#[test]
fn an_end_is_an_end_and_a_reset_a_reset() {
    let mut tapped = Tapped::new();
    let (mut client, mut server) = tapped.connect();
    // Half of a connection may end, and the other continue.
    client.write_all(b"the last").unwrap();
    client.shutdown(Shutdown::Write).unwrap();
    let mut text = String::new();
    server.read_to_string(&mut text).unwrap();
    assert_eq!(text, "the last");
    server.write_all(b"after the end").unwrap();
    drop(server);
    text.clear();
    client.read_to_string(&mut text).unwrap();
    assert_eq!(text, "after the end");

    for is_client in [true, false] {
        let (client, server) = tapped.connect();
        let (mut broken, mut other) = if is_client { (client, server) } else { (server, client) };
        broken.write_all(&[1]).unwrap();
        other.read_exact(&mut [0]).unwrap();
        SockRef::from(&broken).set_linger(Some(Duration::ZERO)).unwrap();
        drop(broken);
        assert_eq!(other.read(&mut [0]).unwrap_err().kind(), ErrorKind::ConnectionReset);
        let side = if is_client { "host" } else { "controller" };
        let line = tapped.tap.line("Connection reset");
        assert!(line.contains(&format!("\"from\":\"{side}\",\"event\":\"closed\"")), "{line}");
    }
}

#[test]
fn a_server_that_is_not_there_is_said_and_the_client_is_reset() {
    let mut tapped = Tapped::new();
    let address = tapped.server.local_addr().unwrap();
    drop(std::mem::replace(&mut tapped.server, TcpListener::bind("127.0.0.1:0").unwrap()));
    let mut client = tapped.tap.connect();
    assert_eq!(client.read(&mut [0]).unwrap_err().kind(), ErrorKind::ConnectionReset);
    tapped.tap.line(&format!("connection 1: cannot connect to {address}"));
}

#[test]
fn what_is_said_has_its_sender_and_what_is_wrong_its_clause() {
    let mut tapped = Tapped::new();
    let (mut client, mut server) = tapped.connect();
    client.write_all(&[0xEB, 0x90, 0xF0, 0xF1, 0x00, 0x00]).unwrap();
    server.write_all(b"\xEB\x90\x82\xF0\xF3\x05HELLO\x90\x82\x6D").unwrap();
    let line = tapped.tap.line("\"error\"");
    assert!(line.contains("\"from\":\"controller\",\"offset\":0"), "{line}");
    assert!(line.contains("\"clause\":\"LE-13\",\"bytes\":\"eb9082f0f30548"), "{line}");
    drop(client);
    let line = tapped.tap.line("\"from\":\"host\",\"offset\":0");
    assert!(line.contains("\"kind\":\"incomplete\"") && line.contains("\"clause\":\"LE-33\""), "{line}");
}

#[test]
fn output_that_nobody_reads_makes_nobody_wait() {
    let server = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = {
        let free = TcpListener::bind("127.0.0.1:0").unwrap();
        free.local_addr().unwrap().port()
    };
    let arguments = format!(
        "tap laser-eb90 --listen 127.0.0.1:{port} --connect {} --no-capture",
        server.local_addr().unwrap()
    );
    let mut command = cellwire(&arguments);
    let mut tap = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    let mut client = loop {
        match TcpStream::connect(("127.0.0.1", port)) {
            Ok(client) => break client,
            Err(error) => assert!(begin.elapsed() < DEADLINE, "{error}"),
        }
        thread::sleep(Duration::from_millis(20));
    };
    let mut other = server.accept().unwrap().0;
    // Each byte is noise, and this text is far more than a pipe buffers.
    let bytes = vec![0x55; 20_000_000];
    let reader = thread::spawn(move || std::io::copy(&mut other, &mut std::io::sink()).unwrap());
    client.write_all(&bytes).unwrap();
    drop(client);
    assert_eq!(reader.join().unwrap(), 20_000_000);
    tap.kill().unwrap();
    tap.wait().unwrap();
}

#[test]
fn a_capture_is_whole_whenever_the_tap_is_killed() {
    for turn in 0..50_u64 {
        let mut tapped = Tapped::new();
        let (mut client, mut server) = tapped.connect();
        let reader = thread::spawn(move || {
            let mut last = 0;
            let mut number = [0; 4];
            while server.read_exact(&mut number).is_ok() {
                last = u32::from_be_bytes(number);
            }
            last
        });
        let end = Instant::now() + Duration::from_millis(20 + fastrand::Rng::with_seed(turn).u64(0..60));
        let mut times = Vec::new();
        while Instant::now() < end {
            times.push(Instant::now());
            client.write_all(&(times.len() as u32).to_be_bytes()).unwrap();
            thread::sleep(Duration::from_micros(300));
        }
        let killed = Instant::now();
        tapped.tap.signal("-KILL");
        reader.join().unwrap();
        let (flows, is_whole) = kept(&tapped.capture);
        let numbers: Vec<u32> = flows
            .values()
            .flat_map(|bytes| {
                bytes.chunks(4).filter_map(|four| Some(u32::from_be_bytes(four.try_into().ok()?)))
            })
            .collect();
        assert!(numbers.iter().copied().eq(1..=numbers.len() as u32), "turn {turn}: {numbers:?}");
        assert!(is_whole || numbers.len() < times.len(), "turn {turn}");
        // Everything but what was sent in the last tenth of a second.
        let old = times.iter().filter(|at| killed.duration_since(**at) > Duration::from_millis(100)).count();
        assert!(numbers.len() >= old, "turn {turn}: {} of {old}", numbers.len());
    }
}

#[test]
fn datagrams_pass_whole_and_answers_find_back() {
    let (server, folder) = (UdpSocket::bind("127.0.0.1:0").unwrap(), tempfile::tempdir().unwrap());
    let capture = folder.path().join("it.pcapng");
    let tap = Running::start(cellwire(&format!(
        "tap kawasaki-msg --udp --listen 127.0.0.1:0 --connect {} --capture {}",
        server.local_addr().unwrap(),
        capture.display()
    )));
    server.set_read_timeout(Some(DEADLINE)).unwrap();
    let clients = [0; 2].map(|_| UdpSocket::bind("127.0.0.1:0").unwrap());
    let mut buffer = [0; 2000];
    for (number, client) in clients.iter().enumerate() {
        client.set_read_timeout(Some(DEADLINE)).unwrap();
        for length in [1, 1400] {
            client.send_to(&vec![number as u8; length], tap.address()).unwrap();
            let (received, from) = server.recv_from(&mut buffer).unwrap();
            assert_eq!((received, buffer[0]), (length, number as u8));
            server.send_to(&buffer[..length / 2], from).unwrap();
            assert_eq!(client.recv(&mut buffer).unwrap(), length / 2);
        }
    }
    kept_when(&capture, &[700, 700, 1401, 1401]);
}

#[test]
fn the_polls_in_a_capture_are_no_errors() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("it.pcapng");
    let ball = Running::start(cellwire("simulate ball --listen 127.0.0.1:0"));
    let arguments = format!(
        "tap isra-ball --listen 127.0.0.1:0 --connect {} --capture {}",
        ball.address(),
        capture.display()
    );
    let mut tap = Running::start(cellwire(&arguments));
    let mut client = tap.connect();
    for _ in 0..5 {
        client.write_all(&[0x05]).unwrap();
        tap.line("\"message\"");
    }
    drop(client);
    tap.line("\"closed\"");
    let begin = Instant::now();
    loop {
        let (status, lines, error) =
            run(cellwire(&format!("decode isra-ball --format pcap {}", capture.display())));
        if lines.lines().count() >= 5 && error.contains("skipped 5 bytes of the end that sends no messages") {
            assert_eq!(status, Some(0), "{lines}{error}");
            break;
        }
        assert!(begin.elapsed() < DEADLINE, "{lines}{error}");
    }
}

#[test]
fn a_message_ends_with_its_datagram() {
    let (server, folder) = (UdpSocket::bind("127.0.0.1:0").unwrap(), tempfile::tempdir().unwrap());
    let (capture, address) = (folder.path().join("it.pcapng"), server.local_addr().unwrap());
    let arguments = format!("tap kawasaki-msg --udp --listen 127.0.0.1:0 --connect {address} --capture");
    let mut tap = Running::start(cellwire(&format!("{arguments} {}", capture.display())));
    let client = UdpSocket::bind("127.0.0.1:0").unwrap();
    for datagram in ["<Huuhaa$0##><Huu", "haa$0##>", "<Huuhaa$0##>"] {
        client.send_to(datagram.as_bytes(), tap.address()).unwrap();
    }
    let wanted = [
        "\"offset\":0,\"length\":12,\"message\":{\"name\":\"Huuhaa\"",
        "\"offset\":12,\"length\":4,\"error\":{\"kind\":\"incomplete\"",
        "\"offset\":16,\"length\":8,\"error\":{\"kind\":\"garbage\"",
        "\"offset\":24,\"length\":12,\"message\":{\"name\":\"Huuhaa\"",
    ];
    for wanted in wanted {
        let line = tap.line("\"offset\"");
        assert!(line.contains(wanted), "{line}");
    }
    kept_when(&capture, &[36]);
    let (status, lines, _) =
        run(cellwire(&format!("decode kawasaki-msg --format pcap {}", capture.display())));
    assert_eq!((status, lines.lines().count()), (Some(1), 4), "{lines}");
    assert!(lines.lines().zip(wanted).all(|(line, wanted)| line.contains(wanted)), "{lines}");
}

/// Opens a pseudo-terminal: the test's end, and the path that the tap opens.
fn line() -> (Box<dyn SerialPort>, String) {
    let (mut end, name) = serial::pair().unwrap();
    end.set_timeout(DEADLINE).unwrap();
    (end, name)
}

#[test]
fn flow_control_is_no_part_of_the_message_that_it_comes_within() {
    let folder = tempfile::tempdir().unwrap();
    let capture = folder.path().join("it.pcapng");
    let ((mut host, a), (_workstation, b)) = (line(), line());
    let arguments = format!("tap val2-viewer --a {a} --b {b} --listen-only --capture {}", capture.display());
    let mut tap = Running::start(cellwire(&arguments));
    let packet = "\u{11}$POSE,7,16384\u{13},0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30\r\n";
    host.write_all(packet.as_bytes()).unwrap();
    let wanted = "\"from\":\"host\",\"offset\":2,\"length\":59,\"message\":{\"count\":7,";
    let line = tap.line("\"offset\"");
    assert!(line.contains(wanted), "{line}");
    tap.line("13\"}");
    kept_when(&capture, &[0, 61]);
    let (status, lines, error) =
        run(cellwire(&format!("decode val2-viewer --format pcap {}", capture.display())));
    assert_eq!((status, lines.lines().count()), (Some(0), 1), "{lines}{error}");
    // There the time is between.
    let (from, message) = wanted.split_once(',').unwrap();
    assert!(lines.contains(from) && lines.contains(message), "{lines}");
}

#[test]
fn two_ports_are_joined_or_only_listened_to() {
    let folder = tempfile::tempdir().unwrap();
    for is_joined in [true, false] {
        let ((mut host, a), (mut device, b)) = (line(), line());
        let capture = folder.path().join(format!("{is_joined}.pcapng"));
        let only = if is_joined { "" } else { "--listen-only" };
        let capture = capture.display();
        let mut tap = Running::start(cellwire(&format!(
            "tap isra-ball --a {a} --b {b} --baud 9600 {only} --capture {capture}"
        )));
        host.write_all(&[0x05]).unwrap();
        let mut received = [0; 8];
        if is_joined {
            device.read_exact(&mut received[..1]).unwrap();
            assert_eq!(received[0], 0x05);
        }
        let line = tap.line("\"bytes\":\"05\"");
        assert!(line.contains("\"from\":\"host\""), "{line}");
        device.write_all(&[1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
        if is_joined {
            host.read_exact(&mut received).unwrap();
            assert_eq!(received, [1, 2, 3, 4, 5, 6, 7, 8]);
        } else {
            let mut rest = [0; 1];
            host.set_timeout(Duration::from_millis(200)).unwrap();
            assert_eq!(host.read(&mut rest).unwrap_err().kind(), ErrorKind::TimedOut, "nothing is sent");
        }
        // A port that is gone ends the tap.
        drop(device);
        let rest = tap.rest();
        assert!(rest.iter().any(|line| line.contains("the port is gone")), "{rest:#?}");
    }
}

#[test]
fn both_directions_of_one_line_are_told_apart() {
    let folder = tempfile::tempdir().unwrap();
    let (mut end, port) = line();
    let capture = folder.path().join("it.pcapng");
    let mut tap = Running::start(cellwire(&format!(
        "tap fanuc-hmi-modbus --set framing=rtu --a {port} --listen-only --capture {}",
        capture.display()
    )));
    // A register is read, another is written (request and reply are the same bytes), noise, and one is read again.
    let read = b"\x01\x03\x00\x00\x00\x01\x84\x0A";
    let reply = b"\x01\x03\x02\x00\x07\xF9\x86";
    let write = b"\x01\x06\x00\x01\x00\x03\x98\x0B";
    for bytes in [&read[..], reply, write, write, &[0x55, 0xAA], read, reply] {
        end.write_all(bytes).unwrap();
        thread::sleep(Duration::from_millis(10));
    }
    for (side, what) in [
        ("client", "\"function\":3,\"address\":0,\"quantity\":1}"),
        ("server", "\"function\":3,\"registers\":[7]}"),
        ("client", "\"function\":6,"),
        ("server", "\"function\":6,"),
        ("", "\"bytes\":\"55aa\""),
        ("client", "\"function\":3,\"address\":0,\"quantity\":1}"),
        ("server", "\"function\":3,\"registers\":[7]}"),
    ] {
        let line = tap.line("\"from\"");
        let side = if side.is_empty() { "null".into() } else { format!("\"{side}\"") };
        assert!(line.contains(&format!("\"from\":{side},")) && line.contains(what), "{side} {what}: {line}");
    }
}

#[test]
fn wireshark_lists_a_tap_and_reads_from_it() {
    let answer = |arguments: &str| run(cellwire(&format!("extcap {arguments}"))).1;
    assert!(answer("--extcap-interfaces --extcap-version=4.0").contains("interface {value=cellwire}"));
    assert!(answer("--extcap-interface cellwire --extcap-dlts").starts_with("dlt {number=101}"));
    assert!(answer("--extcap-interface cellwire --extcap-config").contains("{call=--listen}"));
    let (server, folder) = (TcpListener::bind("127.0.0.1:0").unwrap(), tempfile::tempdir().unwrap());
    let (pipe, copy) = (folder.path().join("pipe"), folder.path().join("copy"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let arguments = format!(
        "extcap --extcap-interface cellwire --capture --fifo {} --listen {port} --connect {}",
        pipe.display(),
        server.local_addr().unwrap()
    );
    let mut tap = cellwire(&arguments).spawn().unwrap();
    let (mut from, mut to) = (File::open(&pipe).unwrap(), File::create(&copy).unwrap());
    let reader = thread::spawn(move || std::io::copy(&mut from, &mut to).unwrap());
    let mut client = TcpStream::connect(("127.0.0.1", port)).unwrap();
    let mut other = server.accept().unwrap().0;
    client.write_all(b"asked").unwrap();
    other.read_exact(&mut [0; 5]).unwrap();
    other.write_all(b"and answered").unwrap();
    client.read_exact(&mut [0; 12]).unwrap();
    let kept = kept_when(&copy, &[5, 12]);
    assert!(kept.contains(&b"asked".to_vec()) && kept.contains(&b"and answered".to_vec()));
    tap.kill().unwrap();
    tap.wait().unwrap();
    reader.join().unwrap();
}

#[test]
fn what_ends_a_tap_of_wireshark_is_said() {
    let pipe = tempfile::NamedTempFile::new().unwrap();
    let (status, _, error) = run(cellwire(&format!(
        "extcap --extcap-interface cellwire --capture --fifo {} --udp --listen 127.0.0.1:0 --connect nobody:1",
        pipe.path().display()
    )));
    assert_eq!(status, Some(2), "{error}");
    assert!(error.contains("cannot send to nobody"), "{error}");
}

#[test]
fn what_is_missing_on_the_command_line_is_said() {
    for (arguments, expected) in [
        ("tap laser-eb90", "give --listen and --connect for a network, or --a and --b for serial ports"),
        ("tap laser-eb90 --listen 0", "--connect <ADDR>"),
        ("tap laser-eb90 --a /dev/null", "give the other end's port with --b, or --listen-only"),
        ("tap laser-eb90 --a /dev/null --b /dev/null --mode 8X1", "7 or 8, N, E or O, 1 or 2, such as 8N1"),
        ("tap laser-eb90 --listen 127.0.0.1:0 --connect x:1 --set tail=none", "tail"),
    ] {
        let (status, _, error) = run(cellwire(arguments));
        assert_eq!(status, Some(2), "{arguments}");
        assert!(error.contains(expected), "{arguments}: {error}");
    }
}
