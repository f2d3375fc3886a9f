//! The tool after a loss: the reader of its output, a connection, disk space, or a path that is in use.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::thread;

const NOISE: &str = "00 ";

fn cellwire(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(args).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn run(command: &mut Command) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = command.output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

/// Runs with an input that the program may not read to its end.
fn with_input(command: &mut Command, input: &[u8]) -> (ExitStatus, Vec<u8>, String) {
    let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
    let (mut stdin, input) = (child.stdin.take().unwrap(), input.to_vec());
    let writer = thread::spawn(move || drop(stdin.write_all(&input)));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    (output.status, output.stdout, String::from_utf8(output.stderr).unwrap())
}

#[test]
fn a_reader_that_has_enough_ends_it_quietly() {
    let mut child = cellwire(&["decode", "isra-ball"]).stdin(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let mut stdin = child.stdin.take().unwrap();
    let writer = thread::spawn(move || drop(stdin.write_all(NOISE.repeat(200_000).as_bytes())));
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!((child.wait().unwrap().code(), said.as_str()), (Some(0), ""));
    writer.join().unwrap();
}

#[test]
fn an_output_without_room_is_an_error_and_no_panic() {
    let full = || fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let (status, _, said) =
        with_input(cellwire(&["decode", "isra-ball"]).stdout(full()), NOISE.repeat(9).as_bytes());
    assert_eq!(status.code(), Some(4));
    assert!(said.starts_with("error: ") && said.contains("No space left"), "{said}");
    let (status, ..) = with_input(cellwire(&["decode", "isra-ball", "--from", "host"]).stderr(full()), b"");
    assert_eq!(status.code(), Some(2), "nobody reads the error either");
}

#[test]
fn a_server_that_vanishes_is_an_error_of_its_own() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let server = thread::spawn(move || {
        for _ in 0..2 {
            let (mut stream, _) = listener.accept().unwrap();
            stream.read_exact(&mut [0; 4]).unwrap();
        }
    });
    let request = br#"{"unit":1,"function":3,"address":0,"quantity":1}"#;
    let (status, _, said) = with_input(&mut cellwire(&["modbus", "send", &address]), request);
    assert_eq!(status.code(), Some(3), "{said}");
    assert!(said.starts_with("error: line 1: "), "{said}");

    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("run.csv");
    fs::write(&csv, "an earlier run\n").unwrap();
    let args = ["fanuc", "log", &address, "--csv", csv.to_str().unwrap(), "--for", "4s"];
    let (code, _, said) = run(&mut cellwire(&args));
    assert_eq!(code, Some(3), "{said}");
    assert_eq!(fs::read_to_string(&csv).unwrap(), "an earlier run\n");
    assert!(fs::read_to_string(folder.path().join("run-2.csv")).unwrap().starts_with("utc,time_s,"));
    server.join().unwrap();
}

#[test]
fn a_full_disk_leaves_the_earlier_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("BG_TELEMETRY.LS");
    let write = |limit: &str| {
        // A file size of zero blocks, and the error of a write instead of the signal.
        let script = format!("trap '' XFSZ; {limit}; exec \"$0\" ls background --out \"$1\"");
        let mut command = Command::new("bash");
        run(command.args(["-c", &script, env!("CARGO_BIN_EXE_cellwire")]).arg(&file))
    };
    assert_eq!(write("true").0, Some(0));
    let whole = fs::read(&file).unwrap();
    let (code, _, said) = write("ulimit -f 0");
    assert_eq!(code, Some(7), "{said}");
    assert!(said.contains("cannot write"), "{said}");
    assert_eq!(fs::read(&file).unwrap(), whole);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file remains");
}

#[test]
fn a_peers_text_gives_no_orders_to_a_terminal() {
    let message = b"<A\x1b[2J$3#\x07\x9bm#>";
    let (status, out, _) = with_input(
        &mut cellwire(&["decode", "kawasaki-msg", "--format", "raw", "--set", "charset=latin1"]),
        message,
    );
    let out = String::from_utf8(out).unwrap();
    assert_eq!(status.code(), Some(0), "{out}");
    assert!(out.contains(r"A\u001b[2J") && out.contains(r"\u0007\u009bm"), "{out}");
    assert!(out.trim_end().chars().all(|c| !c.is_control()), "{out:?}");
}

/// A simulator that is killed when the test ends.
struct Simulator(Child);

impl Simulator {
    /// Runs a ball at a path until it is ready.
    fn at(path: &Path) -> Self {
        let mut child = cellwire(&["simulate", "ball", "--pty", path.to_str().unwrap()]).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        assert!(line.contains("ready"), "{line}");
        Self(child)
    }

    fn signal(&mut self, signal: &str) -> Option<i32> {
        let pid = self.0.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        self.0.wait().unwrap().code()
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn the_path_of_a_pseudo_terminal_is_taken_from_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball");
    let ball = |path: &Path| run(&mut cellwire(&["simulate", "ball", "--pty", path.to_str().unwrap()]));

    let mut first = Simulator::at(&path);
    let leads_to = fs::read_link(&path).unwrap();
    let (code, _, said) = ball(&path);
    assert_eq!(code, Some(2));
    assert!(said.contains("another simulator may be running"), "{said}");
    assert_eq!(fs::read_link(&path).unwrap(), leads_to);

    // Killed, it leaves its link, which leads nowhere: the next one takes it, and removes it in the end.
    assert_eq!(first.signal("-KILL"), None);
    assert!(path.is_symlink() && !path.exists());
    let mut second = Simulator::at(&path);
    assert_eq!(second.signal("-TERM"), Some(130));
    assert!(!path.is_symlink());

    // Somebody else's link in its place stays, and so does a file.
    let mut third = Simulator::at(&path);
    fs::remove_file(&path).unwrap();
    std::os::unix::fs::symlink("/somewhere/else", &path).unwrap();
    third.signal("-TERM");
    assert_eq!(fs::read_link(&path).unwrap(), Path::new("/somewhere/else"));
    let file = folder.path().join("notes.txt");
    fs::write(&file, "mine").unwrap();
    assert_eq!(ball(&file).0, Some(2));
    assert_eq!(fs::read(&file).unwrap(), b"mine");
}

#[test]
fn a_drawing_that_no_machine_draws_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("tiny.svg");
    let svg = r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1e-30 1e-30"><circle r="5" stroke="red"/></svg>"#;
    fs::write(&file, svg).unwrap();
    let args = ["demo", "kawasaki-msg", "--drawing", file.to_str().unwrap()];
    let (code, _, said) = run(&mut cellwire(&args));
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("has a view box of"), "{said}");
}
