//! `cellwire fanuc`: the log of a robot with faults, over connections that break; typed registers; comparisons.

use std::net::TcpListener;
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::fanuc_cell::{Folder, Simulator, err, object, out};
use fanuc_hmi_modbus::{Exception, Registers, Server, ServerConfig, TelemetryBlock, WordOrder, WordsMut};
use serde_json::{Value, json};

/// An arm that reaches all of the simulated robot's circle.
const ROBOT: &str = r#"{"joints": [
  {"min": -180, "max": 180, "speed": 200}, {"min": -120, "max": 160, "speed": 200},
  {"min": -180, "max": 270, "speed": 200}, {"min": -200, "max": 200, "speed": 400},
  {"min": -180, "max": 180, "speed": 400}, {"min": -360, "max": 360, "speed": 600}],
 "arm": {"shoulder": 150, "upper_arm": 600, "elbow": 200, "forearm": 640, "flange": 100}}"#;

/// Returns the notes of a recording, without their figures, each once in the sequence in which they begin.
fn notes(table: &str) -> Vec<&str> {
    let mut notes: Vec<&str> = table.lines().skip(1).filter_map(|row| row.rsplit(',').next()).collect();
    notes.retain(|note| !note.is_empty());
    let mut kinds: Vec<&str> = notes.into_iter().map(|note| note.split(' ').next().unwrap()).collect();
    kinds.dedup();
    kinds
}

#[test]
fn every_fault_of_a_robot_is_marked_counted_and_ends_the_log_with_5() {
    let folder = Folder::new("faults");
    folder.write("robot.json", ROBOT);
    let faults = "faults=nan:1-1.3,infinite:1.6-1.9,denormal:2.2-2.5,quaternion:2.8-3.1,unreachable:3.4-3.7,\
                  standstill:4-5,restart:5.3-5.4,busy:5.6-5.8,disconnect:6-6.4";
    let simulator = Simulator::start("127.0.0.1:0", &["--set", faults]);
    let address = &simulator.address;
    let output =
        folder.run(&format!("fanuc log {address} --csv run.csv --for 8500ms --limits robot.json --json"));
    assert_eq!(output.status.code(), Some(5), "{}", err(&output));
    let (report, table) = (object(&output), folder.read("run.csv"));
    let expected = ["nan", "infinite", "denormal", "quaternion", "unreachable", "standstill", "restarted"];
    let (faults, connections) = (notes(&table), notes(&table).split_off(7));
    assert_eq!(faults[..7], expected);
    assert!(connections.starts_with(&["disconnected", "reconnected"]), "{connections:?}");
    assert_eq!(connections.last(), Some(&"reconnected"));
    let tries = report["disconnected"].as_u64().unwrap();
    assert!((1..=3).contains(&tries), "after 0.1, 0.2, 0.4 s: {report}");
    assert!(report["failed"].as_u64().unwrap() > 5, "refused while the controller was busy: {report}");
    for fault in &expected[..6] {
        let noted = table.lines().filter(|row| row.rsplit(',').next().unwrap().starts_with(fault)).count();
        assert!(noted > 0 && report[fault] == noted, "{fault}: {noted} {report}");
    }
    assert_eq!(report["restarts"], 1);
    let wrong = report["implausible"].as_u64().unwrap();
    assert_eq!(wrong, expected[..6].iter().map(|fault| report[fault].as_u64().unwrap()).sum::<u64>());
    assert!(err(&output).contains(&format!("error: {wrong} of ")), "{}", err(&output));
    assert!(report["samples"].as_u64().unwrap() > 100, "what is sound is there too: {report}");
    // Every row has its columns; a sample has no note and numbers in all of the others.
    for row in table.lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        assert_eq!(fields.len(), 33, "{row}");
        assert!(is_clock_time(fields[0]), "{row}");
        if fields[32].is_empty() {
            assert!(fields[1..32].iter().all(|field| field.parse::<f64>().unwrap().is_finite()), "{row}");
        }
    }
}

#[test]
fn a_sound_robot_is_not_blamed() {
    let folder = Folder::new("sound");
    folder.write("robot.json", ROBOT);
    let simulator = Simulator::start("127.0.0.1:0", &[]);
    let output = folder.run(&format!(
        "fanuc log {} --csv run.csv --for 1500ms --limits robot.json --json",
        simulator.address
    ));
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    assert_eq!((&object(&output)["implausible"], notes(&folder.read("run.csv"))), (&json!(0), vec![]));
    // By an arm that is too short for the circle, all of it is out of reach.
    let output = folder.run(&format!(
        "fanuc log {} --csv run.csv --for 500ms --limits robot.json --arm 0,100,0,100,0 --json",
        simulator.address
    ));
    let report = object(&output);
    assert_eq!((output.status.code(), &report["samples"]), (Some(5), &json!(0)));
}

#[test]
fn a_robot_that_restarts_is_connected_to_again_and_the_recording_says_so() {
    let folder = Folder::new("again");
    let first = Simulator::start("127.0.0.1:0", &[]);
    let address = first.address.clone();
    let log = ["fanuc", "log", &address, "--csv", "run.csv", "--json"];
    let mut log = folder.command(&log).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(|| rows(&folder) > 50);
    drop(first);
    wait_for(|| folder.read("run.csv").contains("disconnected"));
    let second = Simulator::start(&address, &[]);
    wait_for(|| folder.read("run.csv").contains("restarted"));
    let before = rows(&folder);
    wait_for(|| rows(&folder) > before + 50);
    // An interrupt ends the log as its end does, with the report.
    let pid = log.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert_eq!(ended(&mut log), Some(0));
    let report: Value = serde_json::from_reader(log.stdout.take().unwrap()).unwrap();
    assert_eq!((&report["disconnected"], &report["restarts"]), (&json!(1), &json!(1)));
    assert_eq!(notes(&folder.read("run.csv")), ["disconnected", "reconnected", "restarted"]);
    drop(second);
}

/// Returns whether a text is a time such as 2026-01-31T12:00:00.123Z, of the last minute.
fn is_clock_time(text: &str) -> bool {
    let at = humantime::parse_rfc3339(text).unwrap();
    text.len() == 24 && at.elapsed().is_ok_and(|age| age < Duration::from_secs(60))
}

#[test]
fn a_robot_that_is_off_at_the_start_is_waited_for_and_an_unknown_name_is_not() {
    let folder = Folder::new("off");
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let log = ["fanuc", "log", &address, "--csv", "run.csv", "--json"];
    let mut log = folder.command(&log).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(|| rows(&folder) > 1);
    let simulator = Simulator::start(&address, &[]);
    wait_for(|| rows(&folder) > 20);
    let pid = log.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    assert_eq!(ended(&mut log), Some(0));
    drop(simulator);
    assert_eq!(notes(&folder.read("run.csv")), ["not", "connected"]);
    let said = std::io::read_to_string(log.stderr.take().unwrap()).unwrap();
    let waits = format!(
        "cannot connect to {address}: Connection refused (os error 111); waiting for the controller\n"
    );
    assert!(said.starts_with(&waits) && said.contains("\nconnected after "), "{said}");
    let report: Value = serde_json::from_reader(log.stdout.take().unwrap()).unwrap();
    assert_eq!(report["disconnected"], 0, "nothing was lost: {report}");
    for (address, why) in
        [("nonsense", "give HOST:PORT"), ("no.such.invalid:502", "cannot connect to no.such")]
    {
        let output = folder.run(&format!("fanuc log {address} --csv other.csv"));
        assert_eq!(output.status.code(), Some(2), "{}", err(&output));
        assert!(err(&output).contains(why), "{}", err(&output));
    }
    assert!(!folder.0.join("other.csv").exists());
}

#[test]
fn a_log_that_ends_without_a_connection_ends_with_3() {
    let folder = Folder::new("gone");
    let simulator = Simulator::start("127.0.0.1:0", &[]);
    let log = ["fanuc", "log", &simulator.address, "--csv", "run.csv", "--for", "4s", "--json"];
    let mut log = folder.command(&log).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    wait_for(|| rows(&folder) > 20);
    let connected = begin.elapsed().as_secs_f64();
    drop(simulator);
    assert_eq!(ended(&mut log), Some(3));
    let report: Value = serde_json::from_reader(log.stdout.take().unwrap()).unwrap();
    let away = report["away_s"].as_f64().unwrap();
    assert!(away > 3.0 - connected && away <= 4.0, "{connected} s, {report}");
    assert_eq!(notes(&folder.read("run.csv")), ["disconnected"]);
}

#[test]
fn a_controller_that_answers_no_more_counts_as_gone() {
    let folder = Folder::new("silent");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    // It takes every connection and every byte, as a network does whose robot is off.
    thread::spawn(move || listener.incoming().map(Result::unwrap).collect::<Vec<_>>());
    let output = folder.run(&format!("fanuc log {address} --csv run.csv --for 7s --json"));
    let report = object(&output);
    assert!(report["disconnected"].as_u64().unwrap() >= 1, "{report}");
    assert!(folder.read("run.csv").contains("reconnected after"));
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
}

/// A cable without signal holds the bytes of both sides, and the connection survives it.
#[test]
fn a_time_without_a_block_is_a_note() {
    let folder = Folder::new("held");
    let simulator = Simulator::start("127.0.0.1:0", &[]);
    let log = ["fanuc", "log", &simulator.address, "--csv", "run.csv", "--json", "--set", "timeout=500ms"];
    let mut log = folder.command(&log).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    wait_for(|| rows(&folder) > 20);
    let signal = |name: &str, id: u32| {
        assert!(Command::new("kill").args([name, &id.to_string()]).status().unwrap().success());
    };
    signal("-STOP", simulator.process.id());
    thread::sleep(Duration::from_millis(800));
    signal("-CONT", simulator.process.id());
    wait_for(|| folder.read("run.csv").contains("no block for "));
    let before = rows(&folder);
    wait_for(|| rows(&folder) > before + 20);
    signal("-INT", log.id());
    assert_eq!(ended(&mut log), Some(0));
    let table = folder.read("run.csv");
    let note = table.lines().find_map(|row| row.split_once("no block for ")).unwrap().1;
    let time: f64 = note.trim_end_matches(" s").parse().unwrap();
    assert!((0.5..30.0).contains(&time), "{note}");
    assert_eq!(notes(&table), ["no"]);
    let report: Value = serde_json::from_reader(log.stdout.take().unwrap()).unwrap();
    assert_eq!(report["disconnected"], 0, "{report}");
}

/// A telemetry block from PDU address 100 on, whose task runs every 20 ms.
struct Elsewhere(Instant);

impl Registers for Elsewhere {
    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        if (address, out.len()) != (100, 37) {
            return Err(Exception::IllegalDataAddress);
        }
        let life_counter = u32::try_from(self.0.elapsed().as_millis() / 20).unwrap();
        let block = TelemetryBlock { life_counter, quaternion: [1.0, 0.0, 0.0, 0.0], ..Default::default() };
        out.copy_from(&block.to_registers(WordOrder::LowFirst));
        Ok(())
    }
}

#[test]
fn the_block_may_be_elsewhere_and_be_read_less_often_than_it_is_written() {
    let folder = Folder::new("elsewhere");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let mut server = Server::<_, 4>::new(ServerConfig::tcp(), Elsewhere(Instant::now())).unwrap();
            let _ =
                robot_session::drive(&mut server, stream, |_, _| core::ops::ControlFlow::<()>::Continue(()));
        }
    });
    let output = folder.run(&format!(
        "fanuc log {address} --csv run.csv --for 2s --period 20ms --poll 100ms --address 100 --json"
    ));
    assert_eq!(output.status.code(), Some(0), "{}", err(&output));
    let report = object(&output);
    let samples = report["samples"].as_u64().unwrap();
    assert!((5..=20).contains(&samples), "one every 100 ms: {report}");
    assert!(report["missed"].as_u64().unwrap() < samples, "skipped runs are not missed: {report}");
    // Time goes by the life counter, whose period is 20 ms.
    let table = folder.read("run.csv");
    let last: f64 = table.lines().last().unwrap().split(',').nth(1).unwrap().parse().unwrap();
    assert!((1.0..=2.2).contains(&last), "{last}");
    let output = folder.run(&format!("fanuc log {address} --csv other.csv --for 1s"));
    assert_eq!(output.status.code(), Some(1));
    assert!(err(&output).contains("no samples"), "{}", err(&output));
}

#[test]
fn a_counter_that_does_not_count_is_telemetry_that_cannot_be() {
    let folder = Folder::new("still");
    let simulator = Simulator::start("127.0.0.1:0", &["--set", "faults=standstill:0-1000"]);
    let log = format!("fanuc log {} --csv run.csv --poll 1ms --for 60s", simulator.address);
    let output = folder.run(&log);
    assert_eq!(output.status.code(), Some(5), "{}", err(&output));
    assert!(err(&output).contains("error: the life counter does not count (it reads "), "{}", err(&output));
    assert_eq!(notes(&folder.read("run.csv")), ["word"], "the blocks are in the recording all the same");
}

#[test]
fn registers_are_read_and_written_by_their_types() {
    let folder = Folder::new("typed");
    let simulator = Simulator::start("127.0.0.1:0", &[]);
    let address = simulator.address.as_str();
    let position = r#"{"cartesian":{"xyzwpr":[500.0,-1.5,300.0,180.0,0.0,45.0],"external":[0.0,0.0,0.0],"configuration":{"flip":0,"left":0,"up":1,"front":1,"turns":[0,0,-1]}},"user_frame":1,"user_tool":2}"#;
    for (kind, at, value, quantity, more) in [
        ("int16", "1000", "-1234", 1, &[][..]),
        ("int32", "1002", "100000", 2, &[]),
        ("int32", "1004", "-12.34", 2, &["--multiply", "100"]),
        ("real", "1006", "0.5", 2, &["--word-order", "high_first"]),
        ("string", "1010", "\"PART 7\"", 10, &["--size", "10"]),
        ("string", "1020", "\"PART 7\"", 40, &[]),
        ("position", "1100", position, 50, &[]),
    ] {
        let place = [&[address, kind, "--address", at][..], more].concat();
        let write = folder.command(&[&["fanuc", "write"][..], &place, &[value]].concat()).output().unwrap();
        assert_eq!(write.status.code(), Some(0), "{kind}: {}", err(&write));
        let (written, value) = (object(&write), serde_json::from_str::<Value>(value).unwrap());
        let same =
            |found: &Value| found == &value || found.as_f64().is_some_and(|it| Some(it) == value.as_f64());
        assert!(same(&written["value"]) && written["written"] == true, "{kind}: {written}");
        let first = at.parse::<u16>().unwrap();
        assert_eq!(written["registers"], json!([first, first + quantity - 1]), "{kind}");
        let read = folder.command(&[&["fanuc", "read"][..], &place].concat()).output().unwrap();
        assert!(same(&object(&read)["value"]), "{kind}: {}", out(&read));
    }
    // The controller refuses addresses that it does not have; the tool refuses values that do not fit; registers without a
    // position are reported.
    for (arguments, code, message) in [
        (vec!["read", address, "real", "--address", "16447"], 6, "error: the controller refuses: "),
        (vec!["write", address, "int16", "--address", "5", "40000"], 2, "error: 40000 does not fit"),
        (
            vec!["write", address, "int16", "--address", "5", "1.5"],
            2,
            "error: 1.5 does not fit: int16 holds ",
        ),
        (
            vec!["write", address, "string", "--address", "5", "--size", "2", "\"ABCDE\""],
            2,
            "error: a string of 5",
        ),
        (vec!["write", address, "string", "--address", "5", "ABC"], 2, "error: ABC is not JSON: "),
        (vec!["write", address, "position", "--address", "5", "{}"], 2, "error: a position has either "),
    ] {
        let output = folder.command(&[&["fanuc"][..], &arguments].concat()).output().unwrap();
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", err(&output));
        assert!(err(&output).starts_with(message), "{arguments:?}: {}", err(&output));
    }
    // The background task counts in R[1], which is not what was written: unless it is read back before the task runs again.
    let overwritten = || folder.run(&format!("fanuc write {address} int32 --address 0 -7"));
    let output = (0..200).map(|_| overwritten()).find(|output| output.status.code() != Some(0)).unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", err(&output));
    assert!(err(&output).starts_with("error: -7 was written, the controller holds "), "{}", err(&output));
    let output = folder.run(&format!("fanuc read {address} position --address 16400"));
    assert_eq!(out(&output), "", "it ends at 16447");
    let output = folder.run(&format!("fanuc read {address} int16 --address 199 --count 3"));
    let values: Vec<Value> = out(&output).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(values[2], json!({"address": 201, "value": 202}));
}

fn rows(folder: &Folder) -> usize {
    std::fs::read_to_string(folder.0.join("run.csv")).map_or(0, |table| table.lines().count())
}

/// Waits for a process; returns its exit status.
fn ended(process: &mut std::process::Child) -> Option<i32> {
    let begin = Instant::now();
    loop {
        if let Some(status) = process.try_wait().unwrap() {
            return status.code();
        }
        if begin.elapsed() > Duration::from_secs(30) {
            process.kill().unwrap();
            panic!("it does not end");
        }
        thread::sleep(Duration::from_millis(20));
    }
}

fn wait_for(condition: impl Fn() -> bool) {
    let begin = Instant::now();
    while !condition() {
        assert!(begin.elapsed() < Duration::from_secs(60), "in vain");
        thread::sleep(Duration::from_millis(20));
    }
}
