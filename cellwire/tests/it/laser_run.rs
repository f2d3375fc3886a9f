//! `cellwire run laser` against `cellwire simulate laser`: both the real binary, on a pseudo-terminal.

use core::fmt::Write as _;
use core::time::Duration;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread;

use crate::operated::{TEST_TIMEOUT, Tool};

/// A place for a program, and a robot.
pub(crate) struct Cell {
    folder: tempfile::TempDir,
    /// The longest queue, and instructions that take no time, unless a test sets them otherwise.
    robot: Option<Tool>,
}

/// The settings of a host for a robot that was just started: no earlier host has sent anything.
const FRESH: [&str; 6] = ["--set", "longest_frame=1", "--set", "max_pause=0", "--set", "settle=100ms"];

impl Cell {
    pub(crate) fn new(settings: &[&str]) -> Self {
        let mut cell = Self { folder: tempfile::tempdir().unwrap(), robot: None };
        cell.start_robot(settings);
        cell
    }

    fn start_robot(&mut self, settings: &[&str]) {
        self.robot = None;
        let pty = self.path("laser");
        let mut args = vec!["simulate", "laser", "--pty", pty.to_str().unwrap()];
        args.extend(["--set", "queue=9999", "--set", "execution=0", "--set", "baud=115200"]);
        args.extend(settings.iter().flat_map(|setting| ["--set", setting]));
        let robot = Tool::start(&args);
        assert_eq!(robot.line()["ready"], "laser");
        self.robot = Some(robot);
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a program of this many cuts.
    pub(crate) fn program(&self, cuts: usize) -> PathBuf {
        let mut text = String::from("word,x,y,z,a,b,length\n");
        for n in 0..cuts {
            writeln!(text, "cut,{n},{},0,0,0,{n}", n % 7).unwrap();
        }
        let path = self.path("part.csv");
        fs::write(&path, text).unwrap();
        path
    }

    pub(crate) fn run(&self, program: &Path, more: &[&str]) -> Tool {
        let args = self.arguments(program, more);
        Tool::start(&args.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// Returns the arguments of a run.
    pub(crate) fn arguments(&self, program: &Path, more: &[&str]) -> Vec<String> {
        let port = self.path("laser");
        let mut args = vec!["run", "laser", program.to_str().unwrap(), "--serial", port.to_str().unwrap()];
        args.extend(["--set", "baud=115200", "--set", "answer_timeout=2s"]);
        args.extend(FRESH);
        args.extend(more);
        args.into_iter().map(str::to_owned).collect()
    }

    /// Waits until the robot has queued at least this many instructions; returns their number.
    pub(crate) fn queued(&self, at_least: u64) -> u64 {
        let robot = self.robot.as_ref().unwrap();
        let mut queued = 0;
        loop {
            let wait = if queued < at_least { TEST_TIMEOUT } else { Duration::from_millis(300) };
            match robot.lines.recv_timeout(wait) {
                Ok(line) if line["event"] == "queued" => queued += line["count"].as_u64().unwrap(),
                Ok(_) => {}
                Err(_) => return queued,
            }
        }
    }
}

#[test]
fn a_program_is_run_once() {
    let cell = Cell::new(&[]);
    let program = cell.program(50);
    let out = cell.path("outcomes.csv");
    let run = cell.run(&program, &["--outcomes", out.to_str().unwrap()]);
    assert_eq!(run.line()["ready"], "laser");
    let first = run.line();
    assert_eq!((&first["event"], &first["first"], &first["count"]), (&"done".into(), &1.into(), &7.into()));
    assert_eq!(first["lines"], serde_json::json!([2, 8]));
    let ended = run.event("ended");
    assert_eq!(
        (&ended["why"], &ended["done"], &ended["not_sent"]),
        (&"complete".into(), &50.into(), &0.into())
    );
    assert_eq!(run.end().0, Some(0));
    assert_eq!(cell.queued(50), 50);
    let table = fs::read_to_string(&out).unwrap();
    assert_eq!(table.lines().count(), 51);
    assert_eq!(table.lines().nth(50), Some("50,51,done"));

    // Again: not without being told to.
    let (code, said) = cell.run(&program, &[]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("the program is finished according to") && said.contains("--again"), "{said}");
    let run = cell.run(&program, &["--again"]);
    assert_eq!(run.event("ended")["done"], 50);
    assert_eq!(run.end().0, Some(0));
    assert_eq!(cell.queued(50), 50);

    // A program that was changed is another one.
    fs::write(&program, "cut,1,2,3,4,5,6\n").unwrap();
    let (code, said) = cell.run(&program, &[]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("it belongs to another program"), "{said}");
}

#[cfg(unix)]
#[test]
fn an_interrupt_stops_after_the_frame_in_flight_and_nothing_is_unknown() {
    let cell = Cell::new(&[]);
    let program = cell.program(400);
    let run = cell.run(&program, &[]);
    run.event("done");
    run.interrupt();
    let ended = run.event("ended");
    assert_eq!((&ended["why"], &ended["unknown"]), (&"stopped".into(), &0.into()));
    let done = ended["done"].as_u64().unwrap();
    assert!((7..400).contains(&done), "{done}");
    assert_eq!(run.end().0, Some(1));
    assert_eq!(cell.queued(done), done);

    let run = cell.run(&program, &[]);
    assert_eq!(run.event("resumed")["done"], done);
    assert_eq!(run.event("ended")["done"], 400);
    assert_eq!(done + cell.queued(400 - done), 400, "each once");
}

#[test]
fn a_run_that_is_killed_goes_on_and_asks_about_the_frame_in_flight() {
    let cell = Cell::new(&[]);
    let program = cell.program(400);
    let run = cell.run(&program, &[]);
    for _ in 0..5 {
        run.event("done");
    }
    run.kill(); // as kill -9
    let robot_has = cell.queued(35);

    let mut run = cell.run(&program, &[]);
    let mut line = run.line();
    assert_eq!(line["event"], "resumed");
    let done = line["done"].as_u64().unwrap();
    assert_eq!(run.line()["ready"], "laser");
    line = run.line();
    // It may have been killed between two frames: then there is no question.
    if line["event"] == "question" {
        assert_eq!((line["first"].as_u64().unwrap(), &line["count"]), (done + 1, &7.into()));
        assert!(robot_has == done || robot_has == done + 7, "{robot_has}, {done}");
        run.say(if robot_has == done { "repeat" } else { "done" });
        assert_eq!(run.line()["event"], "answered");
    }
    let ended = run.event("ended");
    assert_eq!((&ended["why"], &ended["done"]), (&"complete".into(), &400.into()));
    assert_eq!(run.end().0, Some(0));
    assert_eq!(robot_has + cell.queued(400 - robot_has), 400, "each once");
}

#[test]
fn a_run_that_is_killed_before_its_first_frame_leaves_nothing_unknown() {
    let cell = Cell::new(&[]);
    let program = cell.program(20);
    let run = cell.run(&program, &["--set", "settle=30s"]);
    assert_eq!(run.line()["ready"], "laser");
    thread::sleep(Duration::from_millis(300));
    run.kill();
    let run = cell.run(&program, &[]);
    let ended = run.event("ended");
    assert_eq!((&ended["done"], &ended["unknown"]), (&20.into(), &0.into()));
    assert_eq!(run.end().0, Some(0));
    assert_eq!(cell.queued(20), 20);
}

#[test]
fn a_lost_connection_is_an_error_and_its_frame_a_question() {
    let mut cell = Cell::new(&["baud=9600"]);
    let program = cell.program(100);
    let slow = ["--set", "baud=9600"];
    let run = cell.run(&program, &slow);
    run.event("done");
    thread::sleep(Duration::from_millis(60)); // of the 226 ms of the next frame
    cell.robot = None;
    let unknown = run.event("unknown");
    assert_eq!((&unknown["first"], &unknown["count"]), (&8.into(), &7.into()));
    let (code, said) = run.end();
    assert_eq!(code, Some(3), "{said}");

    cell.start_robot(&["baud=9600"]);
    // Nobody answers: nothing is sent.
    let mut run = cell.run(&program, &slow);
    drop(run.stdin.take());
    assert_eq!(run.event("unanswered")["first"], 8);
    let ended = run.event("ended");
    assert_eq!((&ended["why"], &ended["done"], &ended["unknown"]), (&"stopped".into(), &7.into(), &7.into()));
    assert_eq!(run.end().0, Some(1));
    // The new robot has nothing: the operator has them sent again.
    let mut run = cell.run(&program, &slow);
    run.event("question");
    run.say("what?");
    assert_eq!(run.line()["event"], "hint");
    run.say("repeat");
    assert_eq!(run.event("answered")["answer"], "repeat");
    let done = run.event("done");
    assert_eq!((&done["first"], &done["count"]), (&8.into(), &7.into()));
    run.say("stop");
    assert_eq!(run.event("ended")["why"], "stopped");
    assert_eq!(run.end().0, Some(1));
}

#[test]
fn an_answer_that_does_not_come_stops_it_until_the_operator_has_looked() {
    let mut cell = Cell::new(&[]);
    let program = cell.program(30);
    // The robot's frames end otherwise: it takes nothing, and answers nothing that the host reads.
    cell.start_robot(&["tail=etx", "silence=never"]);
    let mut run = cell.run(&program, &["--set", "answer_timeout=300ms"]);
    let unknown = run.event("unknown");
    assert_eq!(
        (&unknown["first"], &unknown["count"], &unknown["why"]),
        (&1.into(), &7.into(), &"no answer within 300ms".into())
    );
    assert_eq!(run.line()["event"], "question");
    assert_eq!(run.lines.recv_timeout(Duration::from_millis(500)).ok(), None, "nothing is sent unasked");
    run.say("stop");
    let ended = run.event("ended");
    assert_eq!(
        (&ended["why"], &ended["unknown"], &ended["not_sent"]),
        (&"stopped".into(), &7.into(), &23.into())
    );
    assert_eq!(run.end().0, Some(1));
}

#[test]
fn it_pauses_and_goes_on() {
    let cell = Cell::new(&["baud=9600"]);
    let program = cell.program(60);
    let mut run = cell.run(&program, &["--set", "baud=9600"]);
    run.event("done");
    run.say("pause");
    run.event("paused");
    // The frame in flight has its outcome; then there is silence.
    let more = run.lines.recv_timeout(Duration::from_secs(2)).ok();
    assert!(more.is_none_or(|line| line["event"] == "done"));
    assert_eq!(run.lines.recv_timeout(Duration::from_millis(700)).ok(), None);
    run.say("continue");
    run.event("continued");
    assert_eq!(run.event("ended")["done"], 60);
    assert_eq!(run.end().0, Some(0));
    assert_eq!(cell.queued(60), 60);
}

#[test]
fn what_the_controller_refuses_ends_it() {
    let mut cell = Cell::new(&[]);
    let program = cell.program(20);
    cell.start_robot(&["batch=3"]);
    let run = cell.run(&program, &[]);
    let refused = run.event("refused");
    assert_eq!((&refused["first"], &refused["count"]), (&1.into(), &7.into()));
    assert_eq!(
        refused["why"],
        "the controller refuses: too many instructions in a frame, or one that must be alone"
    );
    assert_eq!(run.event("ended")["why"], "refused");
    assert_eq!(run.end().0, Some(1));
    // With frames that it takes the same program continues: nothing of it was taken.
    let run = cell.run(&program, &["--set", "batch=3"]);
    assert_eq!(run.event("ended")["done"], 20);
    assert_eq!(cell.queued(20), 20);
}

#[test]
fn two_runs_at_once_are_refused() {
    let cell = Cell::new(&["baud=9600"]);
    let program = cell.program(60);
    let first = cell.run(&program, &["--set", "baud=9600"]);
    first.event("done");
    let (code, said) = cell.run(&program, &["--set", "baud=9600"]).end();
    assert_eq!(code, Some(2));
    assert!(said.contains("another process is running this program"), "{said}");
    assert_eq!(first.event("ended")["done"], 60);
}
