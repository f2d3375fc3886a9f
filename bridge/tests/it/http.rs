//! Requests that a stranger may send to the HTTP server, which they must not bring down.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::tool::{DEADLINE, Running};
use crate::{ball, bridge, get};

struct Under {
    bridge: Running,
    _ball: Running,
    _folder: tempfile::TempDir,
}

fn start() -> Under {
    let (folder, ball) = (tempfile::tempdir().unwrap(), ball());
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let bridge = bridge(folder.path(), &nobody, &ball);
    Under { bridge, _ball: ball, _folder: folder }
}

impl Under {
    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.bridge.ready["health"].as_str().unwrap()).unwrap();
        stream.set_read_timeout(Some(DEADLINE)).unwrap();
        stream
    }

    /// Returns the answer, or the part of it that came before the connection was reset.
    fn answer(&self, request: &[u8]) -> String {
        let mut stream = self.connect();
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        let mut chunk = [0; 4096];
        while let Ok(count @ 1..) = stream.read(&mut chunk) {
            answer.extend_from_slice(&chunk[..count]);
        }
        String::from_utf8(answer).unwrap()
    }

    /// Checks that another client is answered at once.
    fn is_well(&self) {
        let start = Instant::now();
        assert!(get(&self.bridge, "/metrics").contains("cellwire_bridge_online 0"));
        assert!(start.elapsed() < Duration::from_secs(3), "{:?}", start.elapsed());
    }

    fn count(&self, what: &str) -> usize {
        std::fs::read_dir(format!("/proc/{}/{what}", self.bridge.id())).unwrap().count()
    }
}

#[test]
fn a_body_of_whatever_length_is_refused() {
    let under = start();
    for length in
        ["1", "99999999999", "18446744073709551613", "18446744073709551615", "99999999999999999999", "-1"]
    {
        let request = format!("POST /health HTTP/1.1\r\nHost: x\r\nContent-Length: {length}\r\n\r\n");
        let answer = under.answer(request.as_bytes());
        assert!(
            ["400", "413", "431"].iter().any(|status| answer.starts_with(&format!("HTTP/1.1 {status} "))),
            "{length}: {answer}"
        );
        under.is_well();
    }
    let chunked =
        b"GET /metrics HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nffffffffffffffff\r\n";
    assert!(under.answer(chunked).starts_with("HTTP/1.1 413 "));
    assert!(under.answer(b"PUT / HTTP/1.1\r\nHost: x\r\n\r\n").starts_with("HTTP/1.1 405 "));
    under.is_well();
}

#[test]
fn a_head_of_64_mb_is_not_kept() {
    let under = start();
    under.is_well();
    let before = under.bridge.resident();
    let mut stream = under.connect();
    let _ = stream.write_all(b"GET /metrics HTTP/1.1\r\n");
    let line = format!("X: {}\r\n", "x".repeat(65_531));
    let sent = (0..1024).take_while(|_| stream.write_all(line.as_bytes()).is_ok()).count();
    assert!(sent < 1024, "all of it was taken");
    assert!(under.bridge.resident() < before + (4 << 20));
    under.is_well();
    let long = format!("GET /{} HTTP/1.1\r\nHost: x\r\n\r\n", "x".repeat(9000));
    let answer = under.answer(long.as_bytes());
    assert!(answer.starts_with("HTTP/1.1 4"), "{answer}");
    let fits = format!("GET /metrics?{} HTTP/1.1\r\nHost: x\r\n\r\n", "x".repeat(7000));
    assert!(under.answer(fits.as_bytes()).starts_with("HTTP/1.1 200 "));
}

#[test]
fn who_sends_half_a_request_or_does_not_read_keeps_nobody_waiting() {
    let under = start();
    under.is_well();
    let (threads, files) = (under.count("task"), under.count("fd"));
    let mut halves: Vec<TcpStream> = (0..500)
        .map(|at| {
            let mut stream = under.connect();
            let half: &[u8] = match at % 3 {
                0 => b"GET /met",
                1 => b"GET /metrics HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\n\r\n",
                // It asks, and never reads.
                _ => b"GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n",
            };
            let _ = stream.write_all(half);
            stream
        })
        .collect();
    under.is_well();
    // The attempts to reach a broker have a thread now and then.
    assert!(under.count("task") <= threads + 1);
    assert!(under.count("fd") <= files + 20, "{} and {files} before", under.count("fd"));
    // A client that sends a byte now and then has five seconds at the most, too.
    let mut slow = under.connect();
    let start = Instant::now();
    while slow.write_all(b"x").is_ok() {
        assert!(start.elapsed() < Duration::from_secs(20));
        std::thread::sleep(Duration::from_millis(200));
    }
    assert!(start.elapsed() < Duration::from_secs(8), "{:?}", start.elapsed());
    halves.retain_mut(|stream| stream.shutdown(Shutdown::Write).is_ok());
    under.is_well();
}

#[test]
fn a_process_without_descriptors_listens_again_once_it_has_some() {
    let under = start();
    under.is_well();
    let limit = |most: usize| {
        let pid = under.bridge.id().to_string();
        let mut command = std::process::Command::new("prlimit");
        assert!(command.args(["--pid", &pid, &format!("--nofile={most}:")]).status().unwrap().success());
    };
    // Room for the system's own: open files have the lowest numbers.
    limit(under.count("fd"));
    let waiting: Vec<TcpStream> = (0..40).map(|_| under.connect()).collect();
    std::thread::sleep(Duration::from_secs(1));
    limit(1024);
    drop(waiting);
    under.is_well();
}

#[test]
fn the_page_has_nothing_from_elsewhere_and_its_events_go_on() {
    let mut under = start();
    under.bridge.line("\"connected\"");
    for (path, kind) in [("/", "text/html"), ("/page.css", "text/css"), ("/page.js", "text/javascript")] {
        let answer = get(&under.bridge, path);
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        assert!(
            head.starts_with("HTTP/1.1 200 ") && head.contains(&format!("content-type: {kind}")),
            "{head}"
        );
        assert!(head.contains("content-security-policy: default-src 'none'; script-src 'self';"), "{head}");
        // No other host, no way for a text to become markup, nothing that is sent.
        for never in
            ["http:", "https:", "//cdn", "innerHTML", "insertAdjacentHTML", "eval(", "<form", "style="]
        {
            assert!(!body.contains(never), "{never} in {path}");
        }
    }
    let mut stream = under.connect();
    stream.write_all(b"GET /events HTTP/1.1\r\nHost: x\r\n\r\n").unwrap();
    let (start, mut text) = (Instant::now(), String::new());
    while start.elapsed() < Duration::from_secs(7) {
        let mut chunk = [0; 4096];
        let count = stream.read(&mut chunk).unwrap();
        assert!(count > 0, "it has ended after {:?}: {text}", start.elapsed());
        text.push_str(&String::from_utf8_lossy(&chunk[..count]));
    }
    let events: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("data: ")).collect();
    assert!((6..10).contains(&events.len()), "{text}");
    let event = |at: usize| serde_json::from_str::<serde_json::Value>(events[at]).unwrap();
    let number = |at: usize| event(at)["cells"][0]["number"].as_u64().unwrap();
    assert!(event(0)["cells"][0]["name"] == "ball" && number(5) > number(0), "{text}");
}

#[test]
fn who_does_not_read_the_events_is_dropped_and_blocks_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let cells = (0..300)
        .map(|cell| format!("[cell.\"{cell:>040}\"]\nlink = \"isra-ball\"\naddress = \"127.0.0.1:1\"\n"));
    let site = format!(
        "[broker]\naddress = \"127.0.0.1:1\"\ngroup = \"g\"\nnode = \"n\"\n[store]\nfile = \"s.redb\"\n\
         [health]\nlisten = \"127.0.0.1:0\"\n{}",
        cells.collect::<String>()
    );
    std::fs::write(folder.path().join("site.toml"), site).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire-bridge"));
    command.arg("--config").arg(folder.path().join("site.toml"));
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let bridge = Running::start(command);
    let under = Under { bridge, _ball: ball(), _folder: folder };
    let slow: Vec<TcpStream> = (0..8)
        .map(|_| {
            let socket = socket2::Socket::new(socket2::Domain::IPV4, socket2::Type::STREAM, None).unwrap();
            socket.set_recv_buffer_size(4096).unwrap();
            let place: std::net::SocketAddr = under.bridge.ready["health"].as_str().unwrap().parse().unwrap();
            socket.connect(&place.into()).unwrap();
            let mut stream: TcpStream = socket.into();
            stream.write_all(b"GET /events HTTP/1.1\r\nHost: x\r\n\r\n").unwrap();
            stream
        })
        .collect();
    let established = || {
        let tcp = std::fs::read_to_string("/proc/net/tcp").unwrap();
        let ours = |stream: &&TcpStream| {
            // The bridge's end, which has sent to this port.
            let (port, peer) = (stream.peer_addr().unwrap().port(), stream.local_addr().unwrap().port());
            tcp.contains(&format!("0100007F:{port:04X} 0100007F:{peer:04X} 01"))
        };
        slow.iter().filter(ours).count()
    };
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(established(), 8);
    let end = Instant::now() + DEADLINE;
    while established() > 0 {
        assert!(Instant::now() < end, "{} are still there", established());
        under.is_well();
        std::thread::sleep(Duration::from_millis(300));
    }
}
