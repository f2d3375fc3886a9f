//! Files and outputs that cannot be written, or are damaged: the outcomes of a run.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};

use crate::operated::Tool;
use crate::stop::{Input, Run};
use crate::tool::Running;
use crate::{kawasaki_run, laser_run};

/// Starts the tool; a write beyond a limit is an error then, and no signal.
fn start(arguments: &[String]) -> Tool {
    let mut command = Command::new("bash");
    command.args(["-c", "trap '' XFSZ; exec \"$@\"", "bash", env!("CARGO_BIN_EXE_cellwire")]);
    command.args(arguments).stdin(Stdio::null());
    Tool::spawn(command)
}

/// Leaves a journal room for so many bytes.
fn fill(run: &Tool, journal: &Path, room: u64) {
    let limit = format!("--fsize={}:unlimited", fs::metadata(journal).unwrap().len() + room);
    let pid = run.process.id().to_string();
    assert!(Command::new("prlimit").args(["--pid", &pid, &limit]).status().unwrap().success());
}

#[test]
fn a_journal_that_cannot_be_written_ends_a_run_as_that() {
    let cell = laser_run::Cell::new(&["baud=9600"]);
    let program = cell.program(100);
    let run = start(&cell.arguments(&program, &["--set", "baud=9600"]));
    run.event("done");
    let journal = cell.path("part.csv.journal");
    fill(&run, &journal, 10);
    let (code, said) = run.end();
    assert_eq!(code, Some(7), "{said}");
    for part in [
        " of 100 done, ",
        " unknown",
        "cannot write the journal ",
        "part.csv.journal: File too large",
        "it lacks: ",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    // It is as it was before the entry, and the same command continues.
    assert!(fs::read(&journal).unwrap().ends_with(b"\n"));
    let mut run = Run::start(&cell.arguments(&program, &["--set", "baud=9600"]), Input::Pipe);
    loop {
        let line = run.0.line();
        if line["event"] == "question" {
            run.0.say("done");
        } else if line["event"] == "ended" {
            assert_eq!((&line["why"], &line["done"]), (&"complete".into(), &100.into()));
            break;
        }
    }
    assert_eq!(cell.queued(100), 100, "each once");
}

#[test]
fn a_job_that_the_journal_does_not_have_is_not_sent() {
    let mut cell = kawasaki_run::Cell::new(kawasaki_run::TCP, 300);
    let run = cell.ready(start(&cell.arguments(&[])));
    let _robot = cell.robot(&["job_time=10ms", "queue=20"]);
    run.event("done");
    fill(&run, &cell.path("pallet.csv.journal"), 10);
    let (code, said) = run.end();
    assert_eq!(code, Some(7), "{said}");
    for part in ["the packet was not sent, and the connection was closed", "File too large"] {
        assert!(said.contains(part), "{part}: {said}");
    }
    kawasaki_run::finish(cell.run(&[]), 300);
    cell.assert_executed_once();
}

#[test]
fn a_recording_that_cannot_be_written_ends_with_its_file_and_the_error() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    let robot = Running::listening("fanuc");
    let mut command = Command::new("bash");
    // Four times 1024 bytes.
    command.args(["-c", "trap '' XFSZ; ulimit -f 4; exec \"$@\"", "bash", env!("CARGO_BIN_EXE_cellwire")]);
    command.args(["fanuc", "log", &robot.address(), "--for", "60s", "--csv", file.to_str().unwrap()]);
    let output = command.stdin(Stdio::null()).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(7), "{said}");
    let error = format!("error: the recording ends early: cannot write {}: File too large", file.display());
    assert!(said.contains(&error), "{said}");
}

#[test]
fn a_changed_digit_in_a_journal_is_damage() {
    let cell = laser_run::Cell::new(&[]);
    let program = cell.program(100);
    let run = Run::start(&cell.arguments(&program, &[]), Input::Null);
    for _ in 0..4 {
        run.0.event("done");
    }
    run.0.kill();
    let journal = cell.path("part.csv.journal");
    let text = fs::read_to_string(&journal).unwrap();
    let changed = text.replacen("\"done\",\"first\":7,\"count\":7", "\"done\",\"first\":7,\"count\":9", 1);
    assert_ne!(text, changed);
    fs::write(&journal, &changed).unwrap();
    let (code, said) = Run::start(&cell.arguments(&program, &[]), Input::Null).0.end();
    assert_eq!(code, Some(2), "{said}");
    let known = "line 5 is damaged, or not a line of a journal: the lines before it have 7 of 100 parts as done, and the machine may have executed more";
    assert!(
        said.contains(known) && said.contains("--again does every part of this program, finished parts too"),
        "{said}"
    );
    assert_eq!(fs::read_to_string(&journal).unwrap(), changed, "it is left as it is");
}

/// Others wait for the first line.
#[test]
fn a_first_line_that_cannot_be_written_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let pty = folder.path().join("device").to_str().unwrap().to_owned();
    let kawasaki = ["kawasaki-robot", "--connect", "127.0.0.1:9"];
    let at_port: Vec<[&str; 3]> = ["kawasaki-pc", "fanuc", "mma-robot", "mma-platform", "laser", "ball"]
        .map(|device| [device, "--listen", "127.0.0.1:0"])
        .into_iter()
        .chain([kawasaki, ["puma", "--pty", &pty], ["viewer", "--pty", &pty]])
        .collect();
    let simulate = at_port.iter().map(|device| [&["simulate"][..], device].concat());
    let tap =
        ["tap", "laser-eb90", "--no-capture", "--listen", "127.0.0.1:0", "--connect", "127.0.0.1:9"].to_vec();
    for args in simulate.chain([tap]) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
        command
            .args(&args)
            .stdin(Stdio::null())
            .stdout(File::options().write(true).open("/dev/full").unwrap());
        let output = Command::output(command.stderr(Stdio::piped())).unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(4), "{args:?}: {said}");
        assert!(
            said.contains("cannot write to standard output: No space left on device"),
            "{args:?}: {said}"
        );
    }
}
