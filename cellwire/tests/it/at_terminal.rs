//! Lines for people at a terminal of 80 columns.

use std::fs::{self, OpenOptions};
use std::process::Stdio;
use std::time::{Duration, Instant};

use rustix::termios::{Winsize, tcsetwinsize};

use crate::rig::pty::Pty;
use crate::tool::{DEADLINE, Running, cellwire};

const ROWS: u16 = 60;
const COLUMNS: u16 = 80;

/// Returns the lines of a terminal after a command.
fn screen(command: &str) -> Vec<String> {
    let (mut terminal, path) = Pty::new();
    let open = || Stdio::from(OpenOptions::new().read(true).write(true).open(&path).unwrap());
    let size = Winsize { ws_row: ROWS, ws_col: COLUMNS, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(OpenOptions::new().read(true).write(true).open(&path).unwrap(), size).unwrap();
    let mut tool = cellwire(command);
    let mut tool = tool.stdin(Stdio::null()).stdout(open()).stderr(open()).spawn().unwrap();
    let mut parser = vt100::Parser::new(ROWS, COLUMNS, 0);
    let (begin, mut buffer) = (Instant::now(), [0; 4096]);
    loop {
        let has_ended = tool.try_wait().unwrap().is_some();
        match terminal.read(Duration::from_millis(50), &mut buffer) {
            Ok(length) if length > 0 => parser.process(&buffer[..length]),
            _ if has_ended => break,
            _ => {}
        }
        assert!(begin.elapsed() < DEADLINE, "{}", parser.screen().contents());
    }
    parser.screen().contents().lines().map(|line| line.trim_end().to_owned()).collect()
}

#[test]
fn every_line_of_a_run_begins_at_the_left_edge() {
    let folder = tempfile::tempdir().unwrap();
    let jobs = folder.path().join("jobs.csv");
    fs::write(&jobs, "kind,x1,y1,x2,y2\n1,0,0,1,1\n1,1,1,2,2\n1,2,2,3,3\n").unwrap();
    let robot = Running::listening("kawasaki-robot");
    let journal = folder.path().join("j");
    let run = format!(
        "run kawasaki {} --journal {} --connect {}",
        jobs.display(),
        journal.display(),
        robot.address()
    );
    let lines = screen(&run);
    let text = lines.join("\n");
    // Not after the progress bar.
    let begins = |begin: &str| lines.iter().any(|line| line.starts_with(begin));
    assert!(begins("kawasaki is ready; connect: 127.0.0.1:"), "{text}");
    for begin in [
        "connected: ",
        "order started: ",
        "done: number",
        "disconnected: ",
        "ended: complete; done: 3; unknown: 0;",
    ] {
        assert!(begins(begin), "{begin}: {text}");
    }
    assert!(!text.contains('█') && !text.contains('░'), "{text}");
    let first = lines.iter().position(|line| line.starts_with("ended: ")).unwrap();
    assert!(lines[first + 1].starts_with("  machine: the robot has no jobs of this file queued;"), "{text}");
}

/// The remark on the capture is written by a thread of its own, and the screen covers it.
#[test]
fn nothing_is_written_between_what_a_screen_draws() {
    let folder = tempfile::tempdir().unwrap();
    for _ in 0..6 {
        let (mut terminal, path) = Pty::new();
        let open = || OpenOptions::new().read(true).write(true).open(&path).unwrap();
        let size = Winsize { ws_row: 24, ws_col: COLUMNS, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(open(), size).unwrap();
        let capture = folder.path().join("tap.pcapng");
        let command = format!(
            "tap fanuc --listen 127.0.0.1:0 --connect 127.0.0.1:1 --screen --capture {}",
            capture.display()
        );
        let mut tool = cellwire(&command);
        let mut tool = tool.stdin(open()).stdout(open()).stderr(open()).spawn().unwrap();
        let (begin, mut buffer, mut shown) = (Instant::now(), [0; 4096], String::new());
        while !shown.contains("q quits") {
            let length = terminal.read(Duration::from_millis(50), &mut buffer).unwrap_or(0);
            shown.push_str(&String::from_utf8_lossy(&buffer[..length]));
            assert!(begin.elapsed() < DEADLINE, "{shown}");
        }
        tool.kill().unwrap();
        tool.wait().unwrap();
        let (before, screen) = shown.split_once("\u{1b}[?1049h").unwrap();
        assert!(before.contains("capture: ") && !screen.contains("capture: "), "{shown:?}");
    }
}
