//! Runs that continue after an interruption: the journal in a dry run's output and drawing, and runs without an operator.

use core::time::Duration;
use std::fs;
use std::process::Command;
use std::thread;
use std::time::Instant;

use serde_json::{Value, json};

use crate::operated::{TEST_TIMEOUT, Tool};
use crate::stop::{Input, Run};
use crate::{kawasaki_run, laser_run, mma_run};

/// Returns the last line of a dry run.
fn dry_run(arguments: &[String]) -> Value {
    let output =
        Command::new(env!("CARGO_BIN_EXE_cellwire")).args(arguments).arg("--dry-run").output().unwrap();
    let (out, said) = (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert_eq!(said, "");
    serde_json::from_str(out.lines().last().unwrap()).unwrap()
}

fn wait_for(condition: impl Fn() -> bool) {
    let begin = Instant::now();
    while !condition() {
        assert!(begin.elapsed() < TEST_TIMEOUT, "in vain");
        thread::sleep(Duration::from_millis(20));
    }
}

/// Asserts that a run without a keyboard names the option that answers, and ends as stopped, each time the same.
fn assert_unanswered(start: impl Fn() -> Run, span: &[(&str, Value)]) {
    for _ in 0..2 {
        let run = start();
        let unanswered = loop {
            let line = run.0.line();
            assert_ne!(line["event"], "question", "{line}");
            if line["event"] == "unanswered" {
                break line;
            }
        };
        for (name, value) in span {
            assert_eq!(&unanswered[*name], value, "{unanswered}");
        }
        assert!(
            unanswered["what"].as_str().unwrap().contains("--unknown done, --unknown repeat"),
            "{unanswered}"
        );
        assert_eq!(run.0.event("ended")["why"], "stopped");
        assert_eq!(run.0.end().0, Some(1));
    }
}

#[test]
fn a_laser_program_that_was_killed_is_described_and_answered_by_an_option() {
    let cell = laser_run::Cell::new(&["baud=9600"]);
    let program = cell.program(100);
    let picture = cell.path("plan.svg");
    let arguments = |more: &[&str]| cell.arguments(&program, &[&["--set", "baud=9600"], more].concat());
    let drawn = arguments(&["--picture", picture.to_str().unwrap()]);
    assert_eq!(dry_run(&drawn)["event"], Value::Null, "there is no journal");
    assert!(
        !cell.path("part.csv.journal").exists() && !fs::read_to_string(&picture).unwrap().contains("unknown")
    );
    let run = Run::start(&arguments(&[]), Input::Null);
    run.0.event("done");
    thread::sleep(Duration::from_millis(60)); // of the 226 ms of the next frame
    run.0.kill();
    let before = fs::read(cell.path("part.csv.journal")).unwrap();
    let standing = dry_run(&drawn);
    assert_eq!(
        [&standing["of"], &standing["done"], &standing["unknown"], &standing["not_sent"]],
        [100, 7, 7, 86]
    );
    let spans = json!([
        {"outcome": "done", "first": 1, "count": 7, "lines": [2, 8]},
        {"outcome": "unknown", "first": 8, "count": 7, "lines": [9, 15]},
        {"outcome": "not_sent", "first": 15, "count": 86, "lines": [16, 101]},
    ]);
    assert_eq!(standing["outcomes"], spans);
    assert_eq!(standing["next"], "a run asks whether 8 to 14 are done, unless --unknown answers");
    let plan = fs::read_to_string(&picture).unwrap();
    for word in ["cut, done", "cut, unknown", "cut, to do"] {
        assert!(plan.lines().any(|line| line.trim() == word), "{word}: {plan}");
    }
    assert_unanswered(
        || Run::start(&arguments(&[]), Input::Null),
        &[("first", 8.into()), ("count", 7.into())],
    );
    for (wrong, more) in [("15", &[][..]), ("6", &[]), ("15", &["--dry-run"])] {
        let arguments = arguments(&[&["--unknown", wrong], more].concat());
        let output = Command::new(env!("CARGO_BIN_EXE_cellwire")).args(arguments).output().unwrap();
        assert_eq!(output.status.code(), Some(2));
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(
            said.contains("8 to 14 are unknown; give the number of the last that is done, 7 if none is"),
            "{said}"
        );
    }
    let table = cell.path("outcomes.csv");
    let outcomes = ["--unknown", "10", "--outcomes", table.to_str().unwrap()];
    assert_eq!(dry_run(&arguments(&outcomes))["next"], "a run goes on at 11");
    assert!(fs::read_to_string(&table).unwrap().contains("\n7,8,done\n8,9,unknown\n"));
    assert_eq!(fs::read(cell.path("part.csv.journal")).unwrap(), before, "nothing has changed");
    let run = Run::start(&arguments(&["--unknown", "10"]), Input::Null);
    let answered = run.0.event("answered");
    assert_eq!(["first", "count", "answer"].map(|key| answered[key].clone()), [8, 7, 10].map(|it| json!(it)));
    assert_eq!(run.0.event("ended")["done"], 100);
    assert_eq!(run.0.end().0, Some(0));
    assert_eq!(dry_run(&arguments(&[]))["next"], "the program is finished; --again repeats it");
}

#[test]
fn a_journal_of_another_program_is_a_warning_of_a_dry_run() {
    let cell = laser_run::Cell::new(&[]);
    let run = cell.run(&cell.program(10), &[]);
    assert_eq!(run.event("ended")["done"], 10);
    let arguments = cell.arguments(&cell.program(11), &["--dry-run"]);
    let output = Command::new(env!("CARGO_BIN_EXE_cellwire")).args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        said.contains("warning: the journal ") && said.contains("it belongs to another program"),
        "{said}"
    );
}

#[test]
fn jobs_that_a_restarted_robot_has_lost_are_answered_by_an_option() {
    let mut cell = kawasaki_run::Cell::new(kawasaki_run::TCP, 30);
    let mut run = Run::start(&cell.arguments(&[]), Input::Null);
    run.0 = cell.ready(run.0);
    let robot = cell.robot(&["job_time=50ms", "queue=20"]);
    run.0.event("done");
    run.0.kill();
    let standing = dry_run(&cell.arguments(&[])[..]);
    assert!(standing["unknown"].as_u64() > Some(5), "{standing}");
    assert!(standing["next"].as_str().unwrap().starts_with("a run takes over what the machine has queued"));
    drop(robot);
    let _robot = cell.robot(&["job_time=0"]);
    assert_unanswered(|| Run::start(&cell.arguments(&[]), Input::Null), &[]);
    let standing = dry_run(&cell.arguments(&[])[..]);
    assert!(standing["next"].as_str().unwrap().starts_with("a run asks whether "), "{standing}");
    kawasaki_run::finish(Run::start(&cell.arguments(&["--unknown", "repeat"]), Input::Null).0, 30);
}

/// The first signal interrupts the order, the second one ends the run before the robot has answered.
#[test]
fn an_order_that_two_signals_have_broken_off_is_gone_on_with_unasked() {
    let mut cell = kawasaki_run::Cell::new(kawasaki_run::TCP, 30);
    let mut run = Run::start(&cell.arguments(&[]), Input::Null);
    run.0 = cell.ready(run.0);
    let _robot = cell.robot(&["job_time=300ms", "queue=20"]);
    run.0.event("done");
    run.0.signal("-INT");
    run.0.event("stopping");
    thread::sleep(Duration::from_millis(50)); // later than what belongs to the first
    run.0.signal("-INT");
    assert_eq!(run.0.end().0, Some(130));
    let run = Run::start(&cell.arguments(&[]), Input::Null);
    assert_eq!(run.0.event("order_over")["complete"], false);
    kawasaki_run::finish(run.0, 30);
    cell.assert_executed_once();
}

#[test]
fn an_answer_that_finishes_the_work_is_described() {
    let cell = mma_run::Cell::new(50);
    let run = Run::start(&cell.arguments(1, &[]), Input::Null);
    mma_run::step(&run.0, "vacuum_on");
    run.0.kill();
    let next = |answer| dry_run(&cell.arguments(1, &["--unknown", answer]))["next"].clone();
    assert_eq!(next("done"), "a run only records the answer: the task is finished then");
    assert_eq!(next("repeat"), "a run goes on at 1");
}

#[test]
fn a_part_that_was_begun_is_described_and_answered_by_an_option() {
    let cell = mma_run::Cell::new(50);
    let run = Run::start(&cell.arguments(3, &[]), Input::Null);
    mma_run::step(&run.0, "vacuum_on");
    run.0.kill();
    let standing = dry_run(&cell.arguments(3, &[]));
    assert_eq!(
        standing["outcomes"][0],
        json!({"outcome": "unknown", "first": 1, "count": 1, "lines": [4, 4]})
    );
    assert_eq!(standing["next"], "a run asks whether 1 to 1 are done, unless --unknown answers");
    assert_unanswered(|| Run::start(&cell.arguments(3, &[]), Input::Null), &[("part", 1.into())]);
    let run = Run::start(&cell.arguments(3, &["--unknown", "done"]), Input::Null);
    assert_eq!(run.0.event("placed")["part"], 2);
    assert_eq!(run.0.event("ended")["done"], 3);
    assert_eq!(run.0.end().0, Some(0));
}

/// Two squares and a line: the outlines are numbered in the order of the file, and the robot's sheet has both orders.
#[test]
fn the_outcomes_of_a_drawing_name_its_outlines_and_the_robots_sheet_keeps_all_orders() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let square = |x: u32| format!(r#"<path d="M{x} 10 h50 v50 h-50 Z" fill="none" stroke="black"/>"#);
    let drawing = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 420 297">{}{}<path d="M10 200 H400" stroke="black"/></svg>"#,
        square(10),
        square(100)
    );
    fs::write(path("plan.svg"), drawing).unwrap();
    let (file, table, out) = (path("plan.svg"), path("outcomes.csv"), format!("out={}", path("out.svg")));
    let run = |more: &[&str]| {
        let args =
            [&["run", "kawasaki", &file, "--listen", "127.0.0.1:0", "--outcomes", &table][..], more].concat();
        let run = Tool::start(&args);
        let address = run.line()["listen"].as_str().unwrap().to_owned();
        (run, address)
    };
    let (first, address) = run(&[]);
    let args = ["simulate", "kawasaki-robot", "--connect", &address, "--set", &out, "--set", "speed=100000"];
    let robot = Tool::start(&args);
    let done = first.event("done");
    assert_eq!(done["outlines"][0], 1, "{done}");
    assert_eq!(first.event("ended")["done"], 12);
    assert_eq!(first.end().0, Some(0));
    let rows = fs::read_to_string(&table).unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    let outlines = [1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 3, 3];
    assert_eq!(rows[0], "number,outline,outcome");
    for (number, (row, outline)) in (1..).zip(rows[1..].iter().zip(outlines)) {
        assert_eq!(*row, format!("{number},{outline},done"));
    }
    robot.event("drawn");
    let lines = || fs::read_to_string(path("out.svg")).unwrap().matches(" L").count() + 1;
    let once = lines();
    // The same order again, on the same sheet.
    drop(robot.event("order_over"));
    let args = ["run", "kawasaki", &file, "--again", "--listen", &address];
    let second = Tool::start(&args);
    assert_eq!(second.event("ended")["done"], 12);
    robot.event("drawn");
    wait_for(|| lines() > once);
}

#[test]
fn the_record_of_a_laser_robot_is_a_program_of_what_it_has_executed() {
    let folder = tempfile::tempdir().unwrap();
    let record = folder.path().join("record.csv");
    let setting = format!("record={}", record.display());
    let cell = laser_run::Cell::new(&[&setting]);
    for more in [&[][..], &["--again"]] {
        assert_eq!(cell.run(&cell.program(3), more).event("ended")["done"], 3);
    }
    let rows = || fs::read_to_string(&record).unwrap_or_default();
    wait_for(|| rows().lines().count() >= 6);
    let once = ["0x0101,0,0,0,0,0,0", "0x0101,1,1,0,0,0,1", "0x0101,2,2,0,0,0,2"];
    assert_eq!(rows().lines().collect::<Vec<_>>(), [once, once].concat());
    let picture = folder.path().join("record.svg");
    let arguments = ["run", "laser", record.to_str().unwrap(), "--picture", picture.to_str().unwrap()];
    assert_eq!(dry_run(&arguments.map(str::to_owned))["instructions"], 6);
    assert!(picture.exists());
}
