//! `cellwire run mma` against simulated devices: the real binary at both ends, over TCP.

use core::fmt::Write as _;
use core::time::Duration;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::Command;
use std::thread;

use serde_json::Value;

use crate::operated::{TEST_TIMEOUT, Tool};

/// Waits for a step of the task.
pub(crate) fn step(tool: &Tool, step: &str) {
    while tool.event("step")["step"] != step {}
}

/// A device that moves this much faster than real time.
struct Device {
    tool: Tool,
    address: String,
}

impl Device {
    fn start(name: &str, address: &str, speed: u32) -> Self {
        let speed = format!("speed={speed}");
        let tool = Tool::start(&["simulate", name, "--listen", address, "--set", &speed]);
        let ready = tool.lines.recv_timeout(TEST_TIMEOUT).unwrap();
        let address = ready["listen"].as_str().unwrap().to_owned();
        Self { tool, address }
    }

    /// Returns the accepted motion commands so far.
    fn moves(&self) -> Vec<Value> {
        self.tool.lines.try_iter().filter(|line| line["event"] == "move").collect()
    }
}

pub(crate) struct Cell {
    folder: tempfile::TempDir,
    robot: Device,
    platform: Device,
}

impl Cell {
    pub(crate) fn new(speed: u32) -> Self {
        let robot = Device::start("mma-robot", "127.0.0.1:0", speed);
        let platform = Device::start("mma-platform", "127.0.0.1:0", speed);
        Self { folder: tempfile::tempdir().unwrap(), robot, platform }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn task(&self, parts: usize) -> PathBuf {
        let mut text = String::from("vacuum = \"5ms\"\n[task]\nrobot_home = [0.0, 0.0, 100.0, 0.0]\n");
        for n in 0..parts {
            let x = n as f64 * 10.0;
            writeln!(text, "[[part]]\nplatform = [0.01, 0.0]\npick = [{x:.1}, 20.0, 30.0, 0.0]\nplace = [{x:.1}, -20.0, 30.0, 0.5]").unwrap();
        }
        let path = self.path("plate.toml");
        fs::write(&path, text).unwrap();
        path
    }

    fn run(&self, parts: usize, more: &[&str]) -> Tool {
        let args = self.arguments(parts, more);
        Tool::start(&args.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// Returns the arguments of a run.
    pub(crate) fn arguments(&self, parts: usize, more: &[&str]) -> Vec<String> {
        let task = self.task(parts);
        let mut args = vec!["run", "mma", task.to_str().unwrap()];
        args.extend(["--robot", &self.robot.address, "--platform", &self.platform.address]);
        args.extend(more);
        args.into_iter().map(str::to_owned).collect()
    }
}

#[test]
fn every_part_is_placed_once() {
    let cell = Cell::new(1000);
    let out = cell.path("parts.csv");
    let run = cell.run(3, &["--outcomes", out.to_str().unwrap()]);
    for part in 1..=3 {
        assert_eq!(run.event("placed")["part"], part);
    }
    let ended = run.event("ended");
    assert_eq!(
        (&ended["why"], &ended["done"], &ended["unknown"]),
        (&"complete".into(), &3.into(), &0.into())
    );
    assert_eq!(run.end().0, Some(0));
    assert_eq!(fs::read_to_string(&out).unwrap(), "number,line,outcome\n1,4,done\n2,8,done\n3,12,done\n");
    assert_eq!(cell.robot.moves().len(), 7, "home, and for each part to it and to its place");

    // Again: not without being told to, and the robot does not move.
    let (code, said) = cell.run(3, &[]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("the task is finished according to") && said.contains("--again"), "{said}");
    let (code, said) = cell.run(4, &[]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("it belongs to another task"), "{said}");
    assert_eq!(cell.robot.moves(), [] as [Value; 0]);
    let run = cell.run(3, &["--again"]);
    assert_eq!(run.event("ended")["done"], 3);
}

#[test]
fn a_run_that_is_killed_asks_about_its_part_and_goes_on() {
    let cell = Cell::new(5); // slow enough to be killed in the middle of a part
    let run = cell.run(3, &["--set", "task.motion_timeout=never"]);
    assert_eq!(run.event("placed")["part"], 1);
    step(&run, "await_place"); // the second part is on the gripper
    run.kill();

    // Nobody answers: nothing moves.
    let mut run = cell.run(3, &[]);
    drop(run.stdin.take());
    assert_eq!(run.event("unanswered")["part"], 2);
    let ended = run.event("ended");
    assert_eq!((&ended["why"], &ended["done"], &ended["unknown"]), (&"stopped".into(), &1.into(), &1.into()));
    assert_eq!(run.end().0, Some(1));
    // The operator has put it into its place: it is not picked again.
    let mut run = cell.run(3, &[]);
    assert_eq!(run.event("resumed")["done"], 1);
    assert_eq!(run.event("question")["part"], 2);
    let (code, said) = cell.run(3, &[]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("another process is running this task"), "{said}");
    run.say("nonsense");
    run.event("hint");
    run.say("done");
    assert_eq!(run.event("placed")["part"], 3);
    assert_eq!(run.event("ended")["done"], 3);
    assert_eq!(run.end().0, Some(0));
}

#[test]
fn a_lost_connection_is_a_question_and_an_error_if_it_is_not_regained() {
    let mut cell = Cell::new(20);
    let mut run = cell.run(2, &[]);
    step(&run, "await_pick");
    let address = cell.robot.address.clone();
    cell.robot.tool.process.kill().unwrap();
    let question = run.event("question");
    assert_eq!(question["part"], 1);
    assert!(question["why"].as_str().unwrap().contains("the connection to the robot was lost"), "{question}");
    // The robot is back: its part is restarted.
    cell.robot.tool.process.wait().unwrap();
    cell.robot = Device::start("mma-robot", &address, 200);
    run.say("repeat");
    assert_eq!(run.event("placed")["part"], 1);
    assert_eq!(run.event("ended")["done"], 2);
    assert_eq!(run.end().0, Some(0));

    // It does not come back.
    let mut run = cell.run(2, &["--again"]);
    step(&run, "await_pick");
    cell.robot.tool.process.kill().unwrap();
    run.event("question");
    run.say("stop");
    let (code, said) = run.end();
    assert_eq!(code, Some(3), "{said}");
    // It was never there.
    let (code, said) = cell.run(2, &["--journal", cell.path("other").to_str().unwrap()]).end();
    assert_eq!(code, Some(2), "{said}");
}

#[test]
fn it_pauses_between_parts_and_stops_at_once_when_told() {
    let cell = Cell::new(200);
    let mut run = cell.run(3, &[]);
    step(&run, "go_pick");
    run.say("pause");
    run.event("paused");
    assert_eq!(run.event("placed")["part"], 1);
    assert_eq!(run.lines.recv_timeout(Duration::from_millis(500)).ok(), None, "it waits");
    run.say("continue");
    step(&run, "await_pick");
    run.say("abort");
    run.event("aborting");
    let ended = run.event("ended");
    assert_eq!((&ended["why"], &ended["done"], &ended["unknown"]), (&"stopped".into(), &1.into(), &1.into()));
    assert_eq!(run.end().0, Some(1));
}

#[test]
fn a_robot_that_refuses_to_move_is_a_question() {
    let cell = Cell::new(1000);
    let task = cell.task(2);
    let refusing = Tool::start(&[
        "simulate",
        "mma-robot",
        "--listen",
        "127.0.0.1:0",
        "--set",
        "speed=1000",
        "--set",
        "refuse_every=3",
    ]);
    let ready = refusing.lines.recv_timeout(TEST_TIMEOUT).unwrap();
    let mut run = Tool::start(&[
        "run",
        "mma",
        task.to_str().unwrap(),
        "--robot",
        ready["listen"].as_str().unwrap(),
        "--platform",
        &cell.platform.address,
    ]);
    let question = run.event("question");
    let why = question["why"].as_str().unwrap();
    let (error, rest) = (" has refused an order (generic error (1))", ": it may still be moving");
    assert!(why.starts_with("the robot") && why.ends_with(&format!("{error}{rest}")), "{question}");
    run.say("stop");
    assert_eq!(run.event("ended")["why"], "stopped");
    assert_eq!(run.end().0, Some(1));
}

/// Cameras, valves and switch in lines of text, by hand: it sees one part, then nothing, then a part again.
fn periphery() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut pictures = 0;
        for line in BufReader::new(stream.try_clone().unwrap()).lines() {
            let answer = match line.unwrap().as_str() {
                "acquire 1" => {
                    pictures += 1;
                    if pictures == 2 { "none\n" } else { "part [0.01,0.0] [5.0,20.0,30.0,0.0]\n" }
                }
                "acquire 2" => "slot [5.0,-20.0,30.0,0.5]\r\n",
                "vacuum on" => "ok\nswitch high\n",
                "vacuum off" => "ok\nswitch low\n",
                "blow on" | "blow off" => "ok\n",
                _ => "error what\n",
            };
            // In two pieces.
            let (a, b) = answer.as_bytes().split_at(1);
            for piece in [a, b] {
                if stream.write_all(piece).is_err() {
                    return;
                }
                thread::sleep(Duration::from_millis(1));
            }
        }
    });
    address
}

#[test]
fn a_periphery_in_lines_of_text_sees_the_parts() {
    let cell = Cell::new(1000);
    let task = cell.path("task.toml");
    fs::write(&task, "parts = 2\n").unwrap();
    let mut run = Tool::start(&[
        "run",
        "mma",
        task.to_str().unwrap(),
        "--robot",
        &cell.robot.address,
        "--platform",
        &cell.platform.address,
        "--periphery",
        &periphery(),
    ]);
    assert_eq!(run.event("placed")["part"], 1);
    let question = run.event("question");
    assert_eq!((&question["part"], &question["why"]), (&2.into(), &"a camera found nothing".into()));
    run.say("repeat");
    assert_eq!(run.event("placed")["part"], 2);
    assert_eq!(run.event("ended")["why"], "complete");
    assert_eq!(run.end().0, Some(0));
}

/// The devices stop before the run ends: they do not continue to where they were sent.
#[test]
fn a_periphery_that_is_lost_stops_the_devices() {
    let cell = Cell::new(1);
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let run = cell.run(1, &["--periphery", &address]);
    let (stream, _) = listener.accept().unwrap();
    step(&run, "await_home");
    drop(stream);
    let (code, said) = run.end();
    assert_eq!(code, Some(3), "{said}");
    assert!(said.contains("the connection to the periphery was lost; 0 of 1 done, 0 unknown"), "{said}");
    assert_eq!(cell.robot.tool.event("closed")["reason"], "agreed");
}

#[test]
fn a_dry_run_draws_and_a_task_that_is_wrong_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (task, drawing) = (folder.path().join("task.toml"), folder.path().join("plan.svg"));
    let dry = |text: &str| {
        fs::write(&task, text).unwrap();
        let args = ["run", "mma", task.to_str().unwrap(), "--dry-run", "--picture"];
        let output = Command::new(env!("CARGO_BIN_EXE_cellwire")).args(args).arg(&drawing).output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (output.status.code(), text(output.stdout), text(output.stderr))
    };
    let part =
        "[[part]]\nplatform = [0.0, 0.0]\npick = [0.0, 0.0, 0.0, 0.0]\nplace = [50.0, 0.0, 0.0, 0.0]\n";
    let (code, line, said) = dry(&part.repeat(3));
    assert_eq!((code, said.as_str()), (Some(0), ""));
    let lines: Vec<Value> = line.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!((&lines[0]["parts"], &lines[0]["override_percent"], lines.len()), (&3.into(), &100.into(), 4));
    assert_eq!((&lines[0]["steps"][5], &lines[0]["periphery"]), (&"go_pick".into(), &"simulated".into()));
    assert_eq!((&lines[3]["part"], &lines[3]["line"]), (&3.into(), &9.into()));
    assert_eq!(lines[3]["place"], serde_json::json!([50.0, 0.0, 0.0, 0.0]));
    assert!(fs::read_to_string(&drawing).unwrap().contains("stroke-dasharray"));
    for (text, expected) in [
        ("", "the task has no parts"),
        (
            "parts = 5\n[[part]]\nplatform = [0.0, 0.0]\npick = [0.0, 0.0, 0.0, 0.0]\nplace = [0.0, 0.0, 0.0, 0.0]\n",
            "simulated cameras have 1 [[part]]",
        ),
        ("[task]\npercent = 101\n", "task.percent=101: out of range, give 0 to 100 %"),
        ("[task]\nspeed = 1\n", "the task has no setting `task.speed`: it has parts, part"),
        ("parts = = 1\n", "line 1, column 9"),
        ("[[part]]\npick = [1.0]\n", "give [[part]] platform = [rad, rad]"),
    ] {
        let (code, _, said) = dry(text);
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(expected), "{text}: {said}");
    }
}
