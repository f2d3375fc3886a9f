//! `cellwire-bridge`: errors in a site file are found before anything is connected. The behaviour with a broker is tested by
//! `.ci/bridge`.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]
#![allow(clippy::std_instead_of_core, reason = "a test of a program")]

mod broker;
mod certificates;
mod commands;
mod devices;
mod file;
mod held;
mod http;
mod limits;
mod operation;
mod stop;
#[allow(dead_code, reason = "the tests of the tool need more")]
#[path = "../../../cellwire/tests/it/tool/running.rs"]
mod tool;

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use broker::Broker;
use cellwire::command::simulate;
use clap::Parser;
use tool::{DEADLINE, Running};

/// Starts a simulated ball.
fn ball() -> Running {
    simulated(&["ball", "--listen", "127.0.0.1:0"])
}

/// Starts a simulated device: this program once more, because the tool is not part of this package.
fn simulated(arguments: &[&str]) -> Running {
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["-q", "--exact", "simulated_device", "--ignored", "--nocapture"]);
    command.env("SIMULATE", arguments.join(" "));
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    Running::start(command)
}

#[test]
#[ignore = "a process of the other tests"]
fn simulated_device() {
    #[derive(Parser)]
    struct Simulate {
        #[command(flatten)]
        args: simulate::Args,
    }
    let arguments = std::env::var("SIMULATE").unwrap();
    let Simulate { args } = Simulate::parse_from(["simulate"].into_iter().chain(arguments.split(' ')));
    simulate::run(&args).unwrap();
}

/// Returns the address of a device, or the path of its pseudo-terminal.
fn place(device: &Running) -> &str {
    device.ready.get("listen").or(device.ready.get("pty")).unwrap().as_str().unwrap()
}

/// Starts a bridge whose broker is at `broker` and whose one cell is a ball.
fn bridge(folder: &Path, broker: &str, ball: &Running) -> Running {
    Running::start(bridge_command(folder, broker, ball))
}

fn bridge_command(folder: &Path, broker: &str, ball: &Running) -> Command {
    site_command(folder, broker, "", &[("ball", ball)])
}

/// Returns the command of a bridge whose broker is at `broker`, with `store` among the settings of its store, and with these
/// cells.
fn site_command(folder: &Path, broker: &str, store: &str, balls: &[(&str, &Running)]) -> Command {
    let cells = balls.iter().map(|(name, ball)| {
        format!(
            "[cell.{name}]\nlink = \"isra-ball\"\naddress = \"{}\"\nsettings = {{ report = \"0s\" }}\n",
            place(ball)
        )
    });
    let site = format!(
        "[broker]\naddress = \"{broker}\"\ngroup = \"g\"\nnode = \"n\"\n\
         [store]\nfile = \"s.redb\"\n{store}\n[health]\nlisten = \"127.0.0.1:0\"\n{}",
        cells.collect::<String>()
    );
    let file = folder.join("site.toml");
    std::fs::write(&file, site).unwrap();
    // A write beyond a limit is an error then, and no signal.
    let mut command = Command::new("bash");
    command
        .args(["-c", "trap '' XFSZ; exec \"$0\" --config \"$1\"", env!("CARGO_BIN_EXE_cellwire-bridge")])
        .arg(file);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Changes the site file.
fn edit(folder: &Path, from: &str, to: &str) {
    let file = folder.join("site.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains(from), "{text}");
    std::fs::write(&file, text.replace(from, to)).unwrap();
}

/// Returns the bridge's answer to a request for a path.
fn get(bridge: &Running, path: &str) -> String {
    let mut stream = TcpStream::connect(bridge.ready["health"].as_str().unwrap()).unwrap();
    stream.set_read_timeout(Some(DEADLINE)).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: bridge\r\nConnection: close\r\n\r\n").unwrap();
    let mut text = String::new();
    stream.read_to_string(&mut text).unwrap();
    text
}

const REFUSED: &str = "dropped_total{why=\"refused\"}";

fn figure(bridge: &Running, name: &str) -> u64 {
    figure_in(&get(bridge, "/metrics"), name)
}

fn figure_in(text: &str, name: &str) -> u64 {
    let value = text.lines().find_map(|line| line.strip_prefix(&format!("cellwire_bridge_{name} ")));
    value.unwrap_or_else(|| panic!("{name} in {text}")).parse().unwrap()
}

fn until(what: &str, is_so: impl Fn() -> bool) {
    let end = Instant::now() + DEADLINE;
    while !is_so() {
        assert!(Instant::now() < end, "{what}");
        std::thread::sleep(Duration::from_millis(100));
    }
}

#[test]
fn what_a_full_disk_does_not_take_waits() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let mut bridge = bridge(folder.path(), &nobody, &ball);
    until("records", || figure(&bridge, "store_records") > 3);
    let limit = |size: &str| {
        let pid = bridge.id().to_string();
        let status =
            Command::new("prlimit").args(["--pid", &pid, &format!("--fsize={size}:unlimited")]).status();
        assert!(status.unwrap().success());
    };
    limit("1");
    until("a store that is stuck", || figure(&bridge, "store_stuck") == 1);
    assert!(get(&bridge, "/health").contains("the store cannot be written"));
    limit("unlimited");
    until("a store that is written", || figure(&bridge, "store_stuck") == 0);
    let before = figure(&bridge, "store_records");
    until("more records", || figure(&bridge, "store_records") > before + 3);
    let stuck = bridge.line("\"store\":\"stuck\"");
    assert!(stuck.contains("File too large"), "{stuck}");
    bridge.line("\"store\":\"written\"");
    // Each record that was made waits for the broker; also those of the end.
    let text = get(&bridge, "/metrics");
    for nothing in ["full", "busy", "orphan"] {
        assert!(text.contains(&format!("dropped_total{{why=\"{nothing}\"}} 0")), "{text}");
    }
    assert_eq!(bridge.signal("-TERM"), Some(0));
    drop(bridge);
    let bridge = self::bridge(folder.path(), &nobody, &ball);
    until("the same records", || {
        let text = get(&bridge, "/metrics");
        let value = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)).map(str::to_owned);
        let numbers = ["store_records ", "record_number{cell=\"ball\"} "];
        let [stored, number] = numbers.map(|name| value(&format!("cellwire_bridge_{name}")));
        stored.is_some() && stored == number
    });
}

#[test]
fn a_broker_that_refuses_or_is_silent_is_reported_once() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = TcpListener::bind("127.0.0.1:0").unwrap();
    let mut bridge = bridge(folder.path(), &broker.local_addr().unwrap().to_string(), &ball);
    // The connection is accepted by the system, and is not read.
    let line = bridge.line("\"broker\"");
    assert!(line.contains("the broker does not answer"), "{line}");
    // CONNACK, reason 87h.
    for stream in broker.incoming().take(4) {
        let mut stream = stream.unwrap();
        let _ = stream.write_all(&[0x20, 3, 0, 0x87, 0]);
        let mut first = [0];
        let _ = stream.read(&mut first);
    }
    let line = bridge.line("\"broker\"");
    let why = "the broker refuses the connection: NotAuthorized: check user, password_file";
    assert!(line.contains(why), "{line}");
    assert!(figure(&bridge, "store_records") > 0);
    assert_eq!(figure(&bridge, "online"), 0);
    assert_eq!(bridge.signal("-TERM"), Some(0));
}

#[test]
fn a_record_that_is_refused_for_good_is_dropped_and_the_next_ones_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let mut bridge = bridge(folder.path(), &broker.address(), &ball);
    let mut peer = broker.accept(&[]);
    for place in 0..40 {
        let message = peer.message();
        // Payload format invalid.
        peer.acknowledge(&message, if [2, 5, 6, 9].contains(&place) { 0x99 } else { 0 });
    }
    until("acknowledged records", || figure(&bridge, "acknowledged_total") == 36);
    assert_eq!((figure(&bridge, REFUSED), figure(&bridge, "rejected_total")), (4, 4));
    assert_eq!(figure(&bridge, "connections_total"), 1);
    let made = figure(&bridge, "records_total");
    assert!(figure(&bridge, "store_records") <= made - 40 + 9, "they are in the store no more");
    let line = bridge.line("\"refused\"");
    assert!(line.contains("PayloadFormatInvalid") && line.contains("\"cell\":\"ball\""), "{line}");
    assert!(line.contains("records are dropped"), "{line}");
    assert_eq!(bridge.signal("-TERM"), Some(0));
    assert!(!bridge.rest().iter().any(|line| line.contains("\"refused\"")), "once for each reason");
}

#[test]
fn a_record_that_is_too_long_is_dropped_where_the_broker_does_not_say_which() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let mut bridge = bridge(folder.path(), &broker.address(), &ball);
    let mut peer = broker.accept(&[]);
    let first = peer.message();
    // Mosquitto's answer, which is not one of PUBACK's reason codes.
    peer.acknowledge(&first, 0x95);
    drop(peer);
    until("a record that is dropped", || figure(&bridge, REFUSED) == 1);
    let line = bridge.line("\"broker\":\"disconnected\"");
    assert!(line.contains("the message is too long for the broker: see its"), "{line}");
    let made = figure(&bridge, "records_total");
    let mut peer = broker.accept(&[]);
    let mut seen = Vec::new();
    while seen.last().is_none_or(|last| *last <= made) {
        let message = peer.message();
        seen.push(message.record());
        peer.acknowledge(&message, 0);
    }
    assert_eq!((1..=made).filter(|number| !seen.contains(number)).count(), 1);
    let count = seen.len() as u64;
    until("acknowledged records", || figure(&bridge, "acknowledged_total") == count);
    assert_eq!(figure(&bridge, REFUSED), 1);
    let line = bridge.line("\"refused\"");
    assert!(line.contains("PacketTooLarge"), "{line}");
}

#[test]
fn a_record_that_may_be_taken_later_waits() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let mut bridge = bridge(folder.path(), &broker.address(), &ball);
    let mut peer = broker.accept(&[]);
    let first = peer.message();
    // Quota exceeded.
    peer.acknowledge(&first, 0x97);
    let line = bridge.line("\"broker\":\"disconnected\"");
    assert!(line.contains("the broker refuses a record for now: QuotaExceeded"), "{line}");
    drop(peer);
    let mut peer = broker.accept(&[]);
    let again = peer.message();
    assert!(again.contains("\"event\":\"connected\"") && first.contains("\"event\":\"connected\""));
    peer.acknowledge(&again, 0);
    until("an acknowledged record", || figure(&bridge, "acknowledged_total") == 1);
    assert_eq!(figure(&bridge, REFUSED), 0);
}

#[test]
fn a_broker_that_ends_each_connection_is_tried_again_soon() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let mut bridge = bridge(folder.path(), &broker.address(), &ball);
    // Like a broker that restarts repeatedly: that is not another client with the name.
    let mut last = Instant::now();
    for _ in 0..7 {
        broker.accept(&[]).message();
        assert!(last.elapsed() < Duration::from_secs(15), "{:?}", last.elapsed());
        last = Instant::now();
    }
    let before = figure(&bridge, "store_records");
    until("records that wait", || figure(&bridge, "store_records") > before);

    // Another one with the same store.
    let second = bridge_command(folder.path(), &broker.address(), &ball).output().unwrap();
    let error = String::from_utf8(second.stderr).unwrap();
    assert_eq!(second.status.code(), Some(2), "{error}");
    assert!(
        error.trim_end().ends_with("is open in another process: each bridge needs its own store"),
        "{error}"
    );
    until("records that wait", || figure(&bridge, "store_records") > before + 1);
    assert_eq!(bridge.signal("-TERM"), Some(0));
    assert!(!bridge.rest().iter().any(|line| line.contains("another client")));
}

#[test]
fn a_state_from_the_future_is_not_taken_and_what_follows_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let command = bridge_command(folder.path(), &broker.address(), &ball);
    edit(folder.path(), "node = \"n\"", "node = \"n\"\nprimary_host = \"h\"");
    let mut bridge = Running::start(command);
    let mut peer = broker.accept(&[]);
    let state = |online: bool, ahead: u64| {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
        let at = (now + Duration::from_secs(ahead)).as_millis();
        format!("{{\"online\":{online},\"timestamp\":{at}}}")
    };
    peer.publish("spBv1.0/STATE/h", state(true, 365 * 86_400).as_bytes());
    let line = bridge.line("\"strange\"");
    assert!(line.contains("dated more than 300 s ahead"), "{line}");
    until("a STATE that is counted", || figure(&bridge, "states_ahead_total") == 1);
    assert_eq!(figure(&bridge, "online"), 0);
    // No two clocks agree.
    peer.publish("spBv1.0/STATE/h", state(true, 200).as_bytes());
    peer.message();
    until("online", || figure(&bridge, "online") == 1);
}

#[test]
fn a_bridge_whose_name_is_taken_leaves_it() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let mut bridge = bridge(folder.path(), &broker.address(), &ball);
    let mut peer = broker.accept(&[]);
    peer.message();
    // DISCONNECT: session taken over.
    peer.send(&[0xE0, 2, 0x8E, 0]);
    let line = bridge.line("\"broker\":\"disconnected\"");
    assert!(line.contains("another client has this name: give each bridge a different node"), "{line}");
    assert!(broker.is_left_alone(Duration::from_secs(5)));
}

#[test]
fn a_disk_that_does_not_answer_does_not_keep_the_bridge() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    // Once the file SLOW is there each write to the disk takes an hour.
    let (source, library, slow) =
        (folder.path().join("slow.c"), folder.path().join("slow.so"), folder.path().join("slow"));
    let text = "#include <stdlib.h>\n#include <unistd.h>\n\
                static int wait(void) { if (access(getenv(\"SLOW\"), F_OK) == 0) sleep(3600); return 0; }\n\
                int fsync(int f) { (void)f; return wait(); }\nint fdatasync(int f) { (void)f; return wait(); }\n";
    std::fs::write(&source, text).unwrap();
    let built = Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&library, &source]).status();
    assert!(built.unwrap().success());
    let mut command = bridge_command(folder.path(), &nobody, &ball);
    let mut bridge = Running::start({
        command.env("LD_PRELOAD", &library).env("SLOW", &slow);
        command
    });
    until("records", || figure(&bridge, "store_records") > 3);
    std::fs::write(&slow, "").unwrap();
    let before = figure(&bridge, "records_total");
    std::thread::sleep(Duration::from_secs(2));
    assert!(figure(&bridge, "records_total") <= before + 100, "the store is written no more");
    let start = Instant::now();
    assert_eq!(bridge.signal("-TERM"), Some(130));
    let took = start.elapsed();
    assert!(took >= Duration::from_secs(10) && took < Duration::from_secs(20), "{took:?}");
    let line = bridge.line("the bridge did not end");
    let account = "commands without an outcome are reported as unknown at the next start; the store is kept";
    assert_eq!(line, format!("the bridge did not end within 10 s and was terminated: {account}"));
}

#[test]
fn systemd_is_told_when_it_is_ready_and_that_it_lives() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let path = folder.path().join("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    socket.set_read_timeout(Some(DEADLINE)).unwrap();
    let mut command = bridge_command(folder.path(), &nobody, &ball);
    command.env("NOTIFY_SOCKET", &path).env("WATCHDOG_USEC", "1500000");
    let mut bridge = Running::start(command);
    let said = || {
        let mut text = [0; 100];
        let length = socket.recv(&mut text).unwrap();
        String::from_utf8(text[..length].to_vec()).unwrap()
    };
    assert_eq!(said(), "READY=1");
    let start = Instant::now();
    for _ in 0..4 {
        assert_eq!(said(), "WATCHDOG=1");
    }
    assert!(start.elapsed() > Duration::from_secs(1), "{:?}", start.elapsed());
    assert_eq!(bridge.signal("-TERM"), Some(0));
    while said() != "STOPPING=1" {}
}
