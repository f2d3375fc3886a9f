//! A bridge that ends while commands are executed: their outcomes are waited for.

use std::io::{Read as _, Write as _};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use cellwire_bridge::payload::{Kind, Metric, Payload, Value};
use prost::Message as _;

use crate::broker::{Broker, Peer};
use crate::tool::Running;
use crate::{ball, simulated, site_command, until};

/// Starts a bridge with one cell.
fn start(folder: &Path, broker: &Broker, cell: &str) -> Running {
    let command = site_command(folder, &broker.address(), "", &[]);
    let file = folder.join("site.toml");
    let head = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, format!("{head}[cell.cell]\ncommands = true\n{cell}\n")).unwrap();
    Running::start(command)
}

fn order(peer: &mut Peer, text: &str) {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    let at = u64::try_from(now.as_millis()).unwrap();
    let metric = Metric::new("Command/Request", Kind::String, at, Some(Value::String(text.into())));
    let payload = Payload { timestamp: None, metrics: vec![metric], seq: None };
    peer.publish("spBv1.0/g/DCMD/n/cell", &payload.encode_to_vec());
}

/// Receives the next outcome of a command: its id, outcome and detail.
fn outcome(peer: &mut Peer) -> [String; 3] {
    loop {
        let message = peer.message();
        peer.acknowledge(&message, 0);
        if let Some(id) = message.text("Command/Id") {
            return [id, message.text("Command/Outcome").unwrap(), message.text("Command/Detail").unwrap()];
        }
    }
}

/// Waits until a record has this text.
fn see(peer: &mut Peer, text: &str) {
    loop {
        let message = peer.message();
        peer.acknowledge(&message, 0);
        if message.text("Event").is_some_and(|event| event.contains(text)) {
            return;
        }
    }
}

fn terminate(bridge: &Running) -> Instant {
    let status = Command::new("kill").args(["-TERM", &bridge.id().to_string()]).status();
    assert!(status.unwrap().success());
    Instant::now()
}

fn free_port() -> String {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string()
}

/// Lines of 25 mm.
fn lines(count: usize) -> String {
    let job = |n: usize| {
        let (a, b) = if n.is_multiple_of(2) { (0, 2500) } else { (2500, 0) };
        format!("{{\"kind\":1,\"x1\":{a},\"y1\":0,\"x2\":{b},\"y2\":0}}")
    };
    let jobs: Vec<String> = (0..count).map(job).collect();
    format!("{{\"id\":\"lines\",\"jobs\":[{}]}}", jobs.join(","))
}

/// Starts a bridge with a robot that draws at this speed, in mm/s, in the middle of an order of 60 lines.
fn drawing(folder: &Path, broker: &Broker, speed: u32) -> (Running, Running, Peer) {
    let address = free_port();
    let bridge = start(folder, broker, &format!("link = \"kawasaki-msg\"\nlisten = \"{address}\""));
    let (speed, record) = (format!("speed={speed}"), format!("record={}", folder.join("record").display()));
    let robot = simulated(&["kawasaki-robot", "--connect", &address, "--set", &speed, "--set", &record]);
    let mut peer = broker.accept(&[]);
    see(&mut peer, "\"connected\"");
    order(&mut peer, &lines(60));
    assert_eq!(outcome(&mut peer)[1], "accepted");
    see(&mut peer, "\"order_started\"");
    (bridge, robot, peer)
}

fn executed(folder: &Path) -> usize {
    let text = std::fs::read_to_string(folder.join("record")).unwrap_or_default();
    text.lines().count().saturating_sub(1)
}

#[test]
fn an_order_is_interrupted_and_the_rest_is_not_executed() {
    let folder = tempfile::tempdir().unwrap();
    let broker = Broker::new();
    let (mut bridge, _robot, mut peer) = drawing(folder.path(), &broker, 250);
    until("executed jobs", || executed(folder.path()) > 2);
    terminate(&bridge);
    let [id, outcome, detail] = outcome(&mut peer);
    let count = executed(folder.path());
    assert_eq!((id.as_str(), outcome.as_str()), ("lines", "partial"), "{detail}");
    assert_eq!(detail, format!("{count} of 60 jobs were executed; the rest will not be"));
    assert_eq!(bridge.status(), Some(0));
    thread::sleep(Duration::from_millis(500));
    assert_eq!(executed(folder.path()), count);
}

#[test]
fn an_order_that_does_not_end_in_time_is_unknown_and_a_second_signal_ends_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let broker = Broker::new();
    // The first line takes 25 s.
    let (mut bridge, _robot, mut peer) = drawing(folder.path(), &broker, 1);
    let begin = terminate(&bridge);
    let [_, outcome, detail] = outcome(&mut peer);
    let took = begin.elapsed();
    assert!(took >= Duration::from_secs(5) && took < Duration::from_secs(9), "{took:?}");
    let why = "may still be executed: the robot did not end the order in time";
    assert!(detail.starts_with("the bridge ends; jobs 1 to ") && detail.ends_with(why), "{detail}");
    assert_eq!((outcome.as_str(), bridge.status()), ("unknown", Some(0)));

    let folder = tempfile::tempdir().unwrap();
    let broker = Broker::new();
    let (mut bridge, _robot, _peer) = drawing(folder.path(), &broker, 1);
    terminate(&bridge);
    thread::sleep(Duration::from_millis(300));
    terminate(&bridge);
    assert_eq!(bridge.status(), Some(130));
    bridge.line(
        "a second signal ended the program: commands without an outcome are reported as unknown at the next start",
    );
}

/// Over TCP its address is in use at first; over UDP the robot sends first.
#[test]
fn a_robot_that_connects_draws_over_tcp_and_udp() {
    for settings in ["", "settings = { udp = true }"] {
        let folder = tempfile::tempdir().unwrap();
        let broker = Broker::new();
        let other = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = other.local_addr().unwrap().to_string();
        let cell = format!("link = \"kawasaki-msg\"\nlisten = \"{address}\"\n{settings}");
        let _bridge = start(folder.path(), &broker, &cell);
        let mut peer = broker.accept(&[]);
        if settings.is_empty() {
            see(&mut peer, &format!("cannot listen at {address}: "));
        }
        drop(other);
        let mut robot = vec!["kawasaki-robot", "--connect", &address];
        robot.extend(if settings.is_empty() { [].as_slice() } else { &["--set", "udp=true"] });
        let _robot = simulated(&robot);
        see(&mut peer, "{\"event\":\"connected\",\"place\":\"127.0.0.1:");
        order(&mut peer, &lines(2));
        assert_eq!(outcome(&mut peer)[1], "accepted");
        assert_eq!(outcome(&mut peer), ["lines", "done", "2 jobs"]);
    }
}

/// Starts a proxy between a robot and its PC. Returns its address, whether the robot receives bytes, and the connections, to
/// cut them.
fn between(pc: String) -> (String, Arc<AtomicBool>, Arc<Mutex<Vec<TcpStream>>>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let (address, is_open) = (listener.local_addr().unwrap().to_string(), Arc::new(AtomicBool::new(true)));
    let (connections, open) = (Arc::<Mutex<Vec<TcpStream>>>::default(), Arc::clone(&is_open));
    let kept = Arc::clone(&connections);
    thread::spawn(move || {
        for robot in listener.incoming() {
            let (robot, pc) = (robot.unwrap(), TcpStream::connect(&pc).unwrap());
            kept.lock().unwrap().extend([robot.try_clone().unwrap(), pc.try_clone().unwrap()]);
            for (mut from, mut to, is_to_robot) in
                [(robot.try_clone().unwrap(), pc.try_clone().unwrap(), false), (pc, robot, true)]
            {
                let open = Arc::clone(&open);
                thread::spawn(move || {
                    let mut bytes = [0; 4096];
                    while let Ok(length @ 1..) = from.read(&mut bytes) {
                        if (!is_to_robot || open.load(Ordering::SeqCst))
                            && to.write_all(&bytes[..length]).is_err()
                        {
                            return;
                        }
                    }
                });
            }
        }
    });
    (address, is_open, connections)
}

#[test]
fn an_order_that_the_robot_has_not_accepted_does_not_begin_with_the_next_connection() {
    let folder = tempfile::tempdir().unwrap();
    let broker = Broker::new();
    let address = free_port();
    let cell = format!("link = \"kawasaki-msg\"\nlisten = \"{address}\"");
    let _bridge = start(folder.path(), &broker, &cell);
    let mut peer = broker.accept(&[]);
    let (through, is_open, connections) = between(address);
    let record = format!("record={}", folder.path().join("record").display());
    let _robot = simulated(&["kawasaki-robot", "--connect", &through, "--set", &record]);
    see(&mut peer, "\"connected\"");
    is_open.store(false, Ordering::SeqCst);
    order(&mut peer, &lines(2));
    assert_eq!(outcome(&mut peer)[1], "accepted");
    // The start of the order is sent, and lost.
    thread::sleep(Duration::from_millis(300));
    for connection in connections.lock().unwrap().drain(..) {
        let _ = connection.shutdown(Shutdown::Both);
    }
    is_open.store(true, Ordering::SeqCst);
    let refused = ["lines", "refused", "the order ended before its first job"];
    assert_eq!(outcome(&mut peer), refused);
    order(&mut peer, &lines(3).replace("\"lines\"", "\"next\""));
    assert_eq!(outcome(&mut peer)[1], "accepted");
    assert_eq!(outcome(&mut peer), ["next", "done", "3 jobs"]);
    assert_eq!(executed(folder.path()), 3);
}

/// Answers reads at once, and writes 1.5 s late. Returns its address, the written registers, and whether a write is in flight.
fn slow_server() -> (String, Arc<Mutex<Vec<u16>>>, Arc<AtomicBool>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (written, is_writing) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
    let (kept, busy) = (Arc::clone(&written), Arc::clone(&is_writing));
    thread::spawn(move || {
        for stream in listener.incoming() {
            let _ = serve(stream.unwrap(), &kept, &busy);
        }
    });
    (address, written, is_writing)
}

fn serve(mut stream: TcpStream, written: &Mutex<Vec<u16>>, is_writing: &AtomicBool) -> std::io::Result<()> {
    loop {
        let mut head = [0; 12];
        stream.read_exact(&mut head)?;
        let [t0, t1, _, _, _, _, unit, function, a0, a1, v0, v1] = head;
        if function == 6 {
            is_writing.store(true, Ordering::SeqCst);
            thread::sleep(Duration::from_millis(1500));
            written.lock().unwrap().push(u16::from_be_bytes([v0, v1]));
            stream.write_all(&[t0, t1, 0, 0, 0, 6, unit, 6, a0, a1, v0, v1])?;
            is_writing.store(false, Ordering::SeqCst);
        } else {
            let mut reply = vec![t0, t1, 0, 0, 0, 3 + 2 * v1, unit, function, 2 * v1];
            reply.resize(reply.len() + 2 * usize::from(v1), 0);
            stream.write_all(&reply)?;
        }
    }
}

#[test]
fn a_write_in_flight_gets_its_outcome_and_a_waiting_one_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let broker = Broker::new();
    let (address, written, is_writing) = slow_server();
    let settings = "settings = { timeout = \"4s\", poll = \"1h\", silence = \"0s\" }";
    let cell = format!("link = \"fanuc-hmi-modbus\"\naddress = \"{address}\"\n{settings}");
    let mut bridge = start(folder.path(), &broker, &cell);
    let mut peer = broker.accept(&[]);
    see(&mut peer, "\"connected\"");
    for (id, value) in [("first", 7), ("second", 8)] {
        order(
            &mut peer,
            &format!("{{\"id\":\"{id}\",\"write_register\":{{\"address\":40,\"value\":{value}}}}}"),
        );
        assert_eq!(outcome(&mut peer)[1], "accepted");
    }
    until("a write in flight", || is_writing.load(Ordering::SeqCst));
    terminate(&bridge);
    let mut outcomes = [outcome(&mut peer), outcome(&mut peer)];
    outcomes.sort();
    let refused = "not begun: the bridge ends, or the cell is changed";
    assert_eq!(outcomes, [["first", "done", ""], ["second", "refused", refused]]);
    assert_eq!(bridge.status(), Some(0));
    assert_eq!(*written.lock().unwrap(), [7]);
}

#[test]
fn a_ready_line_that_cannot_be_written_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let broker = Broker::new();
    let ball = ball();
    let mut command = site_command(folder.path(), &broker.address(), "", &[("ball", &ball)]);
    command.stdout(std::fs::File::options().write(true).open("/dev/full").unwrap());
    let output = command.output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(4), "{said}");
    assert!(said.contains("cannot write to standard output: No space left on device"), "{said}");
}
