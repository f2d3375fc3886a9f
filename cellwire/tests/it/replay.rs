//! `cellwire replay`: plays a tap's recording to a program or a device of the tool, over sockets and pseudo-terminals.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use crate::tool::{DEADLINE, Running, cellwire, run};
use serde_json::Value;
use tempfile::TempDir;

/// A device of the tool that a tap connects to, and the file of the tap.
struct Recorded {
    folder: TempDir,
    device: Running,
    tap: Running,
}

impl Recorded {
    fn new(link: &str, device: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let device = Running::listening(device);
        let tap = Running::start(cellwire(&format!(
            "tap {link} --listen 127.0.0.1:0 --connect {} --capture {}",
            device.address(),
            folder.path().join("tap.pcapng").display()
        )));
        Self { folder, device, tap }
    }

    /// Returns the capture once the tap has seen this many messages.
    fn capture(mut self, messages: usize) -> (TempDir, PathBuf) {
        (0..messages).for_each(|_| drop(self.tap.line("\"message\"")));
        thread::sleep(Duration::from_millis(100));
        self.tap.signal("-TERM");
        drop(self.device);
        let capture = self.folder.path().join("tap.pcapng");
        (self.folder, capture)
    }
}

fn replay(arguments: &str, capture: &Path) -> Running {
    Running::start(cellwire(&format!("replay {arguments} {}", capture.display())))
}

/// Returns the last line of a replay, and its status.
fn ended(mut replay: Running) -> (Value, Option<i32>) {
    let line = replay.line("\"event\":\"replayed\"");
    let status = replay.status();
    (serde_json::from_str(&line).unwrap(), status)
}

/// Sends each request and reads this many bytes of its answer.
fn exchange(stream: &mut (impl Read + Write), requests: &[&[u8]], answer: usize) -> Vec<Vec<u8>> {
    let ask = |request: &&[u8]| {
        stream.write_all(request).unwrap();
        let mut bytes = vec![0; answer];
        stream.read_exact(&mut bytes).unwrap();
        bytes
    };
    requests.iter().map(ask).collect()
}

const LASER: [&[u8]; 2] = [b"\xEB\x90\x82\xF0\xF1\x01\x01\x01\x90\x82\xF4"; 2];

#[test]
fn a_laser_is_played_to_a_program_and_its_program_to_a_laser() {
    let recorded = Recorded::new("laser-eb90", "laser");
    let mut client = recorded.tap.connect();
    // The bytes of an earlier host have passed.
    thread::sleep(Duration::from_millis(1600));
    let answers = exchange(&mut client, &LASER, LASER[0].len());
    drop(client);
    let (_folder, capture) = recorded.capture(4);

    let laser = Running::listening("laser");
    let (last, status) =
        ended(replay(&format!("laser-eb90 --as host --connect {}", laser.address()), &capture));
    assert_eq!((&last["same"], &last["departures"], status), (&2.into(), &0.into(), Some(0)), "{last}");

    let path = capture.with_file_name("laser");
    let player = replay(&format!("laser-eb90 --as controller --pty {}", path.display()), &capture);
    let mut port = serialport::new(path.to_str().unwrap(), 115_200).timeout(DEADLINE).open().unwrap();
    assert_eq!(exchange(&mut port, &LASER, LASER[0].len()), answers);
    let (last, status) = ended(player);
    assert_eq!((&last["sent"], &last["same"], status), (&2.into(), &2.into(), Some(0)), "{last}");
}

/// Only a number differs: where the laser cuts to, for example.
#[test]
fn a_wrong_number_of_a_command_is_a_departure() {
    let recorded = Recorded::new("laser-eb90", "laser");
    let mut client = recorded.tap.connect();
    thread::sleep(Duration::from_millis(1600));
    exchange(&mut client, &LASER, LASER[0].len());
    drop(client);
    let (_folder, capture) = recorded.capture(4);
    let path = capture.with_file_name("laser");
    for (option, departures, expected) in [("", 1, Some(1)), ("--ignore-commands", 0, Some(0))] {
        let player = replay(&format!("laser --as controller {option} --pty {}", path.display()), &capture);
        let mut port = serialport::new(path.to_str().unwrap(), 115_200).timeout(DEADLINE).open().unwrap();
        let wrong: [&[u8]; 2] = [LASER[0], b"\xEB\x90\x82\xF0\xF1\x01\x02\x01\x90\x82\xF5"];
        exchange(&mut port, &wrong, LASER[0].len());
        let (last, status) = ended(player);
        assert_eq!((&last["departures"], status), (&departures.into(), expected), "{option}: {last}");
        if departures > 0 {
            assert_eq!(
                (&last["command"], &last["first"]["departure"]),
                (&1.into(), &"command".into()),
                "{last}"
            );
        }
    }
}

/// A plant with the order number in the header of what the PC sends, and of all that either end sends.
const HEADERS: [&str; 2] = [
    "[messages.job]\nheader = [\"order\"]\nfields = [\"number\", \"work\"]
[messages.order_start]\nheader = [\"order\"]\nfields = [\"number\"]
[messages.order_end]\nheader = [\"order\"]\nfields = []
[messages.status]\nheader = [\"order\"]\nfields = [\"phase\", \"queued\", \"executed\", \"ended\"]\n",
    "[messages.job_ack]\nheader = [\"order\"]\nfields = [\"number\"]
[messages.job_request]\nheader = [\"order\"]\nfields = [\"number\"]
[messages.order_ack]\nheader = [\"order\"]\nfields = []
[messages.pause]\nheader = [\"order\"]\nfields = [\"queued\"]
[messages.end_ack]\nheader = [\"order\"]\nfields = [\"ended\", \"executed\"]\n",
];

#[test]
fn a_robot_that_is_played_draws_with_another_order() {
    for settings in ["", HEADERS[0], &HEADERS.concat()] {
        draws_with_another_order(settings);
    }
}

fn draws_with_another_order(settings: &str) {
    let folder = tempfile::tempdir().unwrap();
    let (picture, plant) = (folder.path().join("it.svg"), folder.path().join("plant.toml"));
    let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9\" height=\"9\"><path d=\"M0 0L9 0L9 9\" fill=\"none\" stroke=\"black\"/></svg>";
    fs::write(&picture, svg).unwrap();
    fs::write(&plant, settings).unwrap();
    let plant = format!("--settings {}", plant.display());
    let draw = || {
        let command = format!("run kawasaki {} --again --listen 127.0.0.1:0 {plant}", picture.display());
        Running::start(cellwire(&command))
    };
    let mut pc = draw();
    let capture = folder.path().join("tap.pcapng");
    let mut tap = Running::start(cellwire(&format!(
        "tap kawasaki-msg --listen 127.0.0.1:0 --connect {} --capture {}",
        pc.address(),
        capture.display()
    )));
    let command = format!("simulate kawasaki-robot --connect {} {plant}", tap.address());
    let robot = Running::start(cellwire(&command));
    pc.line("\"why\":\"complete\"");
    tap.line("\"event\":\"closed\"");
    thread::sleep(Duration::from_millis(100));
    tap.signal("-TERM");
    drop(robot);

    // The PC has the same jobs, and another order.
    let mut pc = draw();
    let command = format!("kawasaki-msg --as robot {plant} --connect {}", pc.address());
    let (last, status) = ended(replay(&command, &capture));
    pc.line("\"why\":\"complete\"");
    assert_eq!((&last["departures"], status), (&0.into(), Some(0)), "{last}");
    assert_eq!(last["sent"], last["of"], "{last}");
    // The message that brings the order; every other one has it.
    assert_eq!(last["values"], 1, "{last}");
    // As it was, it is another's.
    let pc = draw();
    let verbatim = "kawasaki-msg --as robot --verbatim --patience 200ms";
    let (last, status) = ended(replay(&format!("{verbatim} {plant} --connect {}", pc.address()), &capture));
    assert_eq!(status, Some(1), "{last}");
    assert!(last["first"]["before"].is_object(), "{last}");
}

const READ: &[u8] = &[0, 1, 0, 0, 0, 6, 1, 3, 0, 0, 0, 1];
const WRITE: &[u8] = &[0, 2, 0, 0, 0, 6, 1, 6, 0, 1, 0, 3];

/// The messages of a replay may move a device: a signal ends it, and the line has the number of sent messages.
#[test]
fn a_replay_that_is_interrupted_says_what_was_sent() {
    let recorded = Recorded::new("fanuc-hmi-modbus", "fanuc");
    let mut client = recorded.tap.connect();
    exchange(&mut client, &[READ], 11);
    thread::sleep(Duration::from_secs(5));
    exchange(&mut client, &[WRITE], 12);
    drop(client);
    let (_folder, capture) = recorded.capture(4);

    let server = Running::listening("fanuc");
    let arguments = format!("fanuc-hmi-modbus --as client --pace times --connect {}", server.address());
    let mut replay = replay(&arguments, &capture);
    thread::sleep(Duration::from_secs(1));
    assert_eq!(replay.signal("-TERM"), Some(130));
    replay.line("interrupted: 1 of 2 messages sent, which may have an effect");
}

#[test]
fn departures_are_said_message_by_message() {
    let recorded = Recorded::new("fanuc-hmi-modbus", "fanuc");
    let mut client = recorded.tap.connect();
    exchange(&mut client, &[READ], 11);
    exchange(&mut client, &[WRITE], 12);
    drop(client);
    let (_folder, capture) = recorded.capture(4);
    for pace in ["turns", "answers", "times"] {
        let mut player = replay(
            &format!("fanuc-hmi-modbus --as server --pace {pace} --listen 127.0.0.1:0 --patience 300ms"),
            &capture,
        );
        let mut client = player.connect();
        // Another transaction, and then something else than then.
        let read = [&[0, 9], &READ[2..]].concat();
        let answer = exchange(&mut client, &[&read], 11).remove(0);
        assert_eq!(answer[1], if pace == "times" { answer[1] } else { 9 }, "{pace}");
        client.write_all(&[&WRITE[..7], &[5, 0, 1, 0xFF, 0]].concat()).unwrap();
        let values = player.line("\"departure\":\"values\"");
        assert!(
            values.contains("\"number\":1,") && values.contains("\"now\":{\"transaction\":9,"),
            "{values}"
        );
        let other = player.line("\"departure\":\"other\"");
        assert!(other.contains("\"then\":{\"transaction\":2,\"unit\":1,\"function\":6,"), "{other}");
        assert!(other.contains("\"now\":{\"transaction\":2,\"unit\":1,\"function\":5,"), "{other}");
        let (last, status) = ended(player);
        assert_eq!((&last["departures"], status), (&1.into(), Some(1)), "{pace}: {last}");
    }
    // Nothing comes.
    let begin = Instant::now();
    let player = replay("fanuc-hmi-modbus --as server --listen 127.0.0.1:0 --patience 200ms", &capture);
    let client: TcpStream = player.connect();
    client.shutdown(std::net::Shutdown::Write).unwrap();
    let (last, status) = ended(player);
    assert_eq!((&last["departures"], &last["sent"], status), (&2.into(), &0.into(), Some(1)), "{last}");
    assert!(begin.elapsed() < DEADLINE);
}

#[test]
fn what_cannot_be_played_is_said() {
    let recorded = Recorded::new("fanuc-hmi-modbus", "fanuc");
    let mut client = recorded.tap.connect();
    exchange(&mut client, &[READ], 11);
    let (_folder, capture) = recorded.capture(2);
    let capture = capture.display();
    for (arguments, expected) in [
        (
            format!("fanuc-hmi-modbus --as robot --listen 0 {capture}"),
            "no end `robot` of fanuc: use --as client or --as server",
        ),
        (
            format!("fanuc-hmi-modbus --as client --listen 0 --conversation 2 {capture}"),
            "the capture has 1 conversation",
        ),
        (
            format!("fanuc-hmi-modbus --as client --listen 0 --port 7 {capture}"),
            "no conversation with bytes of both ends on port 7",
        ),
        (format!("fanuc-hmi-modbus --as client {capture}"), "--listen"),
        (
            format!("fanuc-hmi-modbus --as client --listen 0 --format hex {capture}"),
            "the capture needs both ends",
        ),
    ] {
        let (status, _, error) = run(cellwire(&format!("replay {arguments}")));
        assert_eq!(status, Some(2), "{arguments}: {error}");
        assert!(error.contains(expected), "{arguments}: {error}");
    }
}
