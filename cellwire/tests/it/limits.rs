//! The tool without threads for its devices, without a reader of its output, or after the loss of a serial port.

use std::fs;
use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use std::time::{Duration, Instant};

use crate::rig::pty::Pty;
use crate::tool::{DEADLINE, Running, cellwire, run};
use serde_json::Value;

const MB: u64 = 1 << 20;

/// A simulator whose outputs are not read after the first line; it is killed when the test ends.
struct Unread {
    child: Child,
    address: String,
}

impl Unread {
    fn start(arguments: &str) -> Self {
        let mut child = cellwire(&format!("simulate {arguments} --listen 127.0.0.1:0")).spawn().unwrap();
        // Byte by byte: a buffer would take more than the line.
        let (mut line, mut byte) = (Vec::new(), [0]);
        while byte != *b"\n" {
            child.stdout.as_mut().unwrap().read_exact(&mut byte).unwrap();
            line.extend(byte);
        }
        let ready: Value = serde_json::from_slice(&line).unwrap();
        Self { child, address: ready["listen"].as_str().unwrap().to_owned() }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.address).unwrap();
        stream.set_read_timeout(Some(DEADLINE)).unwrap();
        stream
    }

    /// Returns the lines of the output, from now on.
    fn lines(&mut self) -> impl Iterator<Item = Value> + use<> {
        let (stdout, (sender, lines)) = (self.child.stdout.take().unwrap(), channel());
        thread::spawn(move || BufReader::new(stdout).lines().try_for_each(|line| sender.send(line.unwrap())));
        core::iter::from_fn(move || lines.recv_timeout(DEADLINE).ok())
            .map(|line| serde_json::from_str(&line).unwrap())
    }

    fn resident(&self) -> u64 {
        let status = fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 1024
    }
}

impl Drop for Unread {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn an_output_that_nobody_reads_stops_no_peer_and_what_is_dropped_is_counted() {
    const REQUESTS: u64 = 50_000;
    let mut robot = Unread::start("mma-robot");
    let mut client = robot.connect();
    client.set_nodelay(true).unwrap();
    for number in 0..REQUESTS {
        client.write_all(b"SRVON\r\n").unwrap();
        let mut reply = [0; 4];
        client.read_exact(&mut reply).unwrap_or_else(|error| panic!("reply {number}: {error}"));
        assert_eq!(&reply, b"OK\r\n");
    }
    assert!(robot.resident() < 64 * MB, "{} bytes", robot.resident());
    // Read at last: every line is there, or counted.
    let (mut seen, mut dropped) = (0, 0);
    for line in robot.lines() {
        match line["event"].as_str().unwrap() {
            "servo" => seen += 1,
            "lines_dropped" => dropped += line["lines"].as_u64().unwrap(),
            "connected" => {}
            other => panic!("{other}"),
        }
        if seen + dropped >= REQUESTS {
            break;
        }
    }
    assert_eq!(seen + dropped, REQUESTS);
    assert!(dropped > 0, "{seen} lines waited");
}

#[test]
fn a_flood_of_refused_requests_is_counted() {
    const REQUESTS: u64 = 20_000;
    let mut fanuc = Unread::start("fanuc");
    let begin = Instant::now();
    // Function 99 does not exist.
    let request = [0, 7, 0, 0, 0, 2, 1, 99];
    let mut client = fanuc.connect();
    for _ in 0..REQUESTS / 100 {
        client.write_all(&request.repeat(100)).unwrap();
        client.read_exact(&mut [0; 900]).unwrap();
    }
    let most = 10 * (begin.elapsed().as_secs() + 2);
    drop(client);
    let (mut seen, mut left_out) = (0, 0);
    for line in fanuc.lines() {
        match (line["event"].as_str().unwrap(), &line["of"]) {
            ("refused", _) => seen += 1,
            ("left_out", of) if of == "refused" => left_out += line["count"].as_u64().unwrap(),
            ("disconnected", _) => break,
            _ => {}
        }
    }
    assert_eq!(seen + left_out, REQUESTS);
    assert!(seen <= most, "{seen} lines");
}

#[test]
fn errors_that_nobody_reads_stop_no_peer() {
    let mut ball = Unread::start("ball --set baud=4000000");
    let mut first = ball.connect();
    // Each is refused with a line of some 70 bytes on standard error, which a pipe of 64 KiB does not hold. While one waits
    // for the end of the first, the others are refused at once.
    let refused = AtomicUsize::new(0);
    thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while refused.fetch_add(1, Ordering::Relaxed) < 1500 {
                    let mut second = ball.connect();
                    assert_eq!(second.read(&mut [0]).unwrap_or(0), 0);
                }
            });
        }
    });
    first.write_all(&[5]).unwrap();
    first.read_exact(&mut [0; 12]).unwrap();
    let mut lines = BufReader::new(ball.child.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert_eq!(lines.by_ref().take(1500).filter(|line| line.contains("refused the client")).count(), 1500);
}

#[test]
fn what_was_printed_before_an_interrupt_is_written() {
    let mut fanuc = Unread::start("fanuc");
    for _ in 0..20 {
        drop(fanuc.connect());
    }
    let mut client = fanuc.connect();
    client.write_all(&[0, 7, 0, 0, 0, 2, 1, 99]).unwrap();
    client.read_exact(&mut [0; 9]).unwrap();
    let pid = fanuc.child.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &pid]).status().unwrap().success());
    let mut text = String::new();
    fanuc.child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
    // Of the lines that are left out the last ones are counted at the end.
    assert_eq!(text.matches("{\"event\":\"connected\"").count(), 10, "{text}");
    let counts = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let left_out: u64 =
        counts.filter(|line| line["of"] == "connected").map(|line| line["count"].as_u64().unwrap()).sum();
    assert_eq!(left_out, 11, "{text}");
    assert!(text.contains("\"refused\""), "{text}");
    assert_eq!(fanuc.child.wait().unwrap().code(), Some(130));
}

/// Makes a copy of the tool that any user can run.
fn copy(folder: &tempfile::TempDir) -> String {
    fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).unwrap();
    let copy = folder.path().join("cellwire");
    fs::copy(env!("CARGO_BIN_EXE_cellwire"), &copy).unwrap();
    copy.to_str().unwrap().to_owned()
}

#[test]
fn without_a_thread_a_device_says_so_or_serves() {
    // The limit counts the threads of a user, and root has no limit: run as a user without other processes.
    let is_root = Command::new("id").arg("-u").output().unwrap().stdout == b"0\n";
    if !is_root {
        eprintln!("skipped: only root can run the tool as a user without other processes");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let tool = copy(&folder);
    for (device, first, reply) in [
        ("fanuc", &[0, 7, 0, 0, 0, 6, 1, 3, 0x40, 0, 0, 1][..], 11),
        ("ball", &[5], 12),
        ("laser", &[], 0),
        ("mma-robot", b"STP\r\n", 4),
        ("kawasaki-pc", b"<Tila$6#0$0$$$#>", 5),
    ] {
        let mut served = 0;
        for threads in 1..=7 {
            let script = format!(
                "ulimit -u {threads}; exec setpriv --reuid 54321 --clear-groups --no-new-privs {tool} simulate {device} --listen 127.0.0.1:0"
            );
            let mut command = Command::new("bash");
            command.args(["-c", &script]).current_dir(folder.path());
            command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
            let mut child = command.spawn().unwrap();
            let mut line = String::new();
            BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
            let ready: Value = serde_json::from_str(&line).unwrap_or_default();
            // A device may be ready before it needs its last thread.
            let answers = ready["listen"].as_str().is_some_and(|address| {
                let Ok(mut client) = TcpStream::connect(address) else { return false };
                client.set_read_timeout(Some(DEADLINE)).unwrap();
                thread::sleep(Duration::from_millis(300));
                client.write_all(first).is_ok()
                    && client.read_exact(&mut vec![0; reply]).is_ok()
                    && child.try_wait().unwrap().is_none()
            });
            if answers {
                served += 1;
                child.kill().unwrap();
            }
            let output = child.wait_with_output().unwrap();
            let said = String::from_utf8(output.stderr).unwrap();
            assert!(!said.contains("panicked"), "{device} with {threads}: {said}");
            if !answers {
                assert_eq!(output.status.code(), Some(2), "{device} with {threads}: {said}");
                assert!(said.contains("error: cannot"), "{device} with {threads}: {said}");
                assert_eq!(served, 0, "{device} with {threads}, and was served with less: {said}");
            }
        }
        assert!((1..7).contains(&served), "{device} was served {served} times");
    }
}

/// Waits for this many bytes from the program that opens the other end.
fn receive(device: &mut Pty, count: usize) {
    let (mut received, end) = (0, Instant::now() + DEADLINE);
    while received < count {
        assert!(Instant::now() < end, "{received} bytes came");
        match device.read(Duration::from_millis(50), &mut [0; 256]) {
            Ok(length) => received += length,
            Err(_) => thread::sleep(Duration::from_millis(5)), // nobody is there
        }
    }
}

#[test]
fn a_port_that_vanishes_under_a_client_is_a_lost_connection() {
    let folder = tempfile::tempdir().unwrap();
    let requests = folder.path().join("requests.jsonl");
    fs::write(&requests, "{\"unit\":1,\"function\":3,\"address\":0,\"quantity\":1}\n".repeat(3)).unwrap();
    let program = folder.path().join("part.csv");
    fs::write(&program, "cut,1,2,3,4,5,6\n".repeat(50)).unwrap();
    let (requests, program) = (requests.display(), program.display());
    for (arguments, count) in [
        (format!("modbus send PORT {requests} --set timeout=2000ms"), 8),
        ("modbus poll PORT holding:0-3 --for 5s --set timeout=2000ms".to_owned(), 8),
        ("modbus scan PORT --set timeout=2000ms".to_owned(), 8),
        (format!("run laser {program} --serial PORT --set answer_timeout=2s"), 11),
    ] {
        let (device, path) = Pty::new();
        let mut device = device.raw();
        let mut command = cellwire(&arguments.replace("PORT", &path));
        command.current_dir(folder.path());
        let client = thread::spawn(move || run(command));
        receive(&mut device, count);
        drop(device);
        let (code, _, said) = client.join().unwrap();
        assert_eq!(code, Some(3), "{arguments}: {said}");
        assert!(said.contains("error: "), "{arguments}: {said}");
    }
}

#[test]
fn a_flood_takes_no_memory_from_the_other_devices_either() {
    // A robot whose PC floods it.
    let pc = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = pc.local_addr().unwrap();
    let robot = Running::start(cellwire(&format!("simulate kawasaki-robot --connect {address}")));
    let (mut stream, _) = pc.accept().unwrap();
    flood(&mut stream, b"<TyoLahetys$1#");
    assert!(robot.resident() < 64 * MB, "kawasaki-robot needs {} bytes", robot.resident());
    // RTU frames that never end, and commands whose sender does not wait for a reply.
    for (device, bytes) in [("fanuc --set framing=rtu", &[1, 16, 0, 0][..]), ("mma-platform", b"ITR 1 2 3 ")]
    {
        let device = Running::listening(device);
        flood(&mut device.connect(), bytes);
        assert!(device.resident() < 64 * MB, "{} bytes", device.resident());
    }
    // A serial line.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball");
    let ball = Running::start(cellwire(&format!("simulate ball --pty {}", path.display())));
    let mut port =
        serialport::new(path.to_str().unwrap(), 9600).timeout(Duration::from_millis(200)).open().unwrap();
    // A write waits for the line; it ends with the simulator.
    let is_gone = |error: std::io::Error| error.kind() != ErrorKind::TimedOut;
    thread::spawn(move || while !port.write_all(&[5; 4096]).is_err_and(is_gone) {});
    thread::sleep(Duration::from_secs(3));
    assert!(ball.resident() < 64 * MB, "ball needs {} bytes", ball.resident());
}

/// Writes for three seconds, or until nothing is taken for one.
fn flood(stream: &mut TcpStream, bytes: &[u8]) {
    stream.set_write_timeout(Some(Duration::from_secs(1))).unwrap();
    let (bytes, end) = (bytes.repeat(1000), Instant::now() + Duration::from_secs(3));
    while Instant::now() < end && stream.write_all(&bytes).is_ok() {}
}
