//! `cellwire laser run` against `cellwire simulate laser`: both the real binary, on a pseudo-terminal.

use core::fmt::Write as _;
use core::time::Duration;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;

use serde_json::Value;

use crate::operated::{PATIENCE, Tool};

/// A place for a program, and a robot.
pub(crate) struct Cell {
    folder: tempfile::TempDir,
    /// The longest queue, and instructions that take no time, unless a test says otherwise.
    robot: Option<Tool>,
}

/// What a host may assume of a robot that was just started: nobody has sent anything before.
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

    /// A program of this many cuts.
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

    /// The arguments of a run.
    pub(crate) fn arguments(&self, program: &Path, more: &[&str]) -> Vec<String> {
        let port = self.path("laser");
        let mut args = vec!["laser", "run", program.to_str().unwrap(), "--port", port.to_str().unwrap()];
        args.extend(["--set", "baud=115200", "--set", "answer_timeout=2s"]);
        args.extend(FRESH);
        args.extend(more);
        args.into_iter().map(str::to_owned).collect()
    }

    /// How many instructions the robot has queued so far.
    pub(crate) fn queued(&self, at_least: u64) -> u64 {
        let robot = self.robot.as_ref().unwrap();
        let mut queued = 0;
        loop {
            let wait = if queued < at_least { PATIENCE } else { Duration::from_millis(300) };
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
    let run = cell.run(&program, &["--out", out.to_str().unwrap()]);
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
    assert_eq!(table.lines().nth(50), Some("50,51,0x0101,done"));

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
    assert_eq!(run.event("question")["first"], 8);
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
    assert_eq!(refused["why"], "the controller refuses: BadBatch");
    assert_eq!(run.event("ended")["why"], "refused");
    assert_eq!(run.end().0, Some(1));
    // With frames that it takes the same program goes on: nothing of it was taken.
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

/// The lines that a dry run prints, and its drawing.
fn dry_run(name: &str, program: &str) -> (Option<i32>, String, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let (file, drawing) = (folder.path().join(name), folder.path().join("plan.svg"));
    fs::write(&file, program).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_cellwire"))
        .args(["laser", "run", file.to_str().unwrap(), "--dry-run", "--draw", drawing.to_str().unwrap()])
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let svg = fs::read_to_string(drawing).unwrap_or_default();
    (output.status.code(), text(output.stdout), text(output.stderr), svg)
}

#[test]
fn a_dry_run_says_and_draws_what_would_happen() {
    let gcode = "%\nG21 G90\nG0 X10 Y10\nM3\nG1 X20 F600\nY20\nG2 X30 Y30 I10 J0\nM5\nG91 G0 X-30 Y-30\nM30\nG0 X999\n";
    let (code, line, said, svg) = dry_run("part.nc", gcode);
    assert_eq!((code, said.as_str()), (Some(0), ""));
    let line: Value = serde_json::from_str(&line).unwrap();
    let mm = &line["mm"];
    assert_eq!(
        (&mm["least"], &mm["most"]),
        (&serde_json::json!([0.0, 0.0]), &serde_json::json!([30.0, 30.0]))
    );
    assert_eq!(line["not_carried"], serde_json::json!(["f"]));
    // The arc in chords of at most 0.05 mm beside it: 2 acos(1 - 0.05 / 10) of a quarter.
    assert_eq!((&line["instructions"], &line["frames"]), (&(4 + 8).into(), &2.into()));
    assert!(
        svg.contains("stroke=\"black\"")
            && ["cut", "moved", "30", "start"].iter().all(|label| svg.contains(label)),
        "{svg}"
    );

    let drawing = |body: &str| {
        format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="30mm" viewBox="0 0 60 30">{body}</svg>"#
        )
    };
    let path = r#"<path d="M0 30 H 40 A 10 10 0 0 0 40 10" fill="none" stroke="black"/>"#;
    let (code, found, said, svg) = dry_run("part.svg", &drawing(path));
    assert_eq!((code, said.as_str()), (Some(0), ""));
    let found: Value = serde_json::from_str(&found).unwrap();
    let mm = &found["mm"];
    assert_eq!(
        (&mm["least"], &mm["most"]),
        (&serde_json::json!([0.0, 0.0]), &serde_json::json!([50.0, 20.0]))
    );
    assert_eq!(
        (&found["instructions"], &found["not_carried"]),
        (&(1 + 1 + 16).into(), &serde_json::json!([]))
    );
    assert!(svg.contains("stroke=\"black\""), "{svg}");
    let text = format!("{path}<text>hello</text>");
    let (code, _, said, _) = dry_run("part.svg", &drawing(&text));
    assert_eq!(code, Some(2));
    assert!(said.contains("has 1 text (line 1): convert them to paths"), "{said}");
}

#[test]
fn a_dxf_drawing_is_refused_with_the_command_that_converts_it() {
    for (name, content) in [
        ("part.dxf", "hello\n"),
        ("part.DXF", ""),
        ("part.nc", "  0\nSECTION\n  2\nHEADER\n"),
        ("part.nc", "\u{feff}0\r\nSECTION\r\n"),
        ("part.svg", "999\nwritten by a CAD program\n  0\nSECTION\n"),
        ("part", "AutoCAD Binary DXF\r\n\u{1a}\0"),
    ] {
        let (code, found, said, _) = dry_run(name, content);
        assert_eq!((code, found.as_str()), (Some(2), ""), "{name}: {said}");
        let [begin, end] =
            [said.find(name), said.find(" is a DXF drawing: convert it with `python3 dxf-to-svg.py ")];
        assert!(begin < end && said.lines().count() == 1, "{name}: {said}");
    }
}

/// Laser software writes its travel as cuts without power.
#[test]
fn a_cut_without_power_is_a_move() {
    let cuts = |gcode: &str| {
        let (code, _, said, svg) = dry_run("part.nc", gcode);
        assert_eq!((code, said.as_str()), (Some(0), ""));
        let is_cut = |line: &str| line.starts_with("<path") && line.contains("stroke=\"black\"");
        svg.lines().any(|line| is_cut(line) && !line.contains("d=\"\""))
    };
    let travel = "G21 G90\nM4 F600\nG1 X10 S0\nG1 Y10 S0\n";
    assert!(!cuts(travel));
    assert!(cuts(&travel.replace("Y10 S0", "Y10 S80")));
    assert!(cuts(&travel.replace(" S0", "")), "without S the plant's own power");
}

#[test]
fn a_program_that_is_not_understood_is_refused_with_its_line() {
    for (name, program, expected) in [
        ("a.csv", "cut,1,2\nfold,1,2\n", "line 2: `fold` is not a command word"),
        ("a.csv", "cut,1,two\n", "line 1: `two` is not a number"),
        ("a.csv", "0x0301\n", "line 1: 0x0301 is a query"),
        ("a.csv", "# nothing\n", "has no instructions"),
        ("a.csv", "cut,1e39\n", "line 1: number too large"),
        ("a.csv", "2305,1\n", "line 1: 0x0901 is not a command word"),
        ("a.nc", "G0 X1\nG41 X2\n", "line 2: G41 is not supported"),
        ("a.nc", "M3 F100\nG2 X10 Y0 R2\n", "line 2: the ends of the arc are farther apart than 2 R"),
        ("a.nc", "G2 X10 Y0 I3\n", "line 1: the arc begins 3.000 mm and ends 7.000 mm from its centre"),
        ("a.nc", "X10\n", "line 1: coordinates without a preceding G0, G1, G2 or G3"),
        ("a.nc", "G1 X1 X2\n", "line 1: X is given twice"),
        ("a.nc", "G1 X1 F0\n", "line 1: F0 is not a valid feed"),
        ("a.nc", "M6 T1\n", "line 1: M6 is not supported"),
        ("a.nc", "M3\nG0 X1\nG1 X2\n", "line 3: a cut without a feed rate: give F first"),
        ("a.nc", "M4 S-1\n", "line 1: S-1 is not a valid power"),
        ("a.nc", "G1 X\n", "line 1: \"X\" is not followed by a number"),
        (
            "a.nc",
            "M6\nG0 X1\nG41\nG0 Y2\n",
            "line 1: M6 is not supported; M2, M3, M4, M5 and M30 are\nline 3: G41",
        ),
        ("a.svg", "G0 X1\n", "a.svg is not an SVG file"),
        ("a.nc", " <svg", "a.nc is not an SVG file"),
    ] {
        let (code, _, said, _) = dry_run(name, program);
        assert_eq!(code, Some(2), "{program:?}: {said}");
        // The cause is said after what it is the cause of.
        let said = said.replace("part.nc: ", "");
        assert!(said.contains(expected), "{program:?}: {said}");
    }
}
