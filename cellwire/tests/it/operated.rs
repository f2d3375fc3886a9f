//! The tool as a process that an operator types to.

use core::time::Duration;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::Instant;

use serde_json::Value;

/// Nothing that is waited for takes this long, also on a machine with a great load.
pub(crate) const TEST_TIMEOUT: Duration = Duration::from_secs(90);

/// A program of the tool, with its lines of JSON.
pub(crate) struct Tool {
    pub(crate) process: Child,
    pub(crate) stdin: Option<ChildStdin>,
    pub(crate) lines: Receiver<Value>,
}

impl Tool {
    pub(crate) fn start(args: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
        command.args(args).stdin(Stdio::piped());
        Self::spawn(command)
    }

    /// Starts the program with the standard input of the command.
    pub(crate) fn spawn(mut command: Command) -> Self {
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let (sender, lines) = mpsc::channel();
        let stdout = process.stdout.take().unwrap();
        thread::spawn(move || {
            for line in BufReader::new(stdout).lines() {
                if sender.send(serde_json::from_str(&line.unwrap()).unwrap()).is_err() {
                    return;
                }
            }
        });
        let stdin = process.stdin.take();
        Self { process, stdin, lines }
    }

    pub(crate) fn line(&self) -> Value {
        self.lines.recv_timeout(TEST_TIMEOUT).expect("a line")
    }

    /// Reads the next line of this event.
    pub(crate) fn event(&self, event: &str) -> Value {
        let begin = Instant::now();
        while begin.elapsed() < TEST_TIMEOUT {
            let line = self.line();
            if line["event"] == event {
                return line;
            }
        }
        panic!("no {event}");
    }

    pub(crate) fn say(&mut self, word: &str) {
        writeln!(self.stdin.as_mut().unwrap(), "{word}").unwrap();
    }

    /// Waits until it has ended by itself; returns its status and its remarks.
    pub(crate) fn end(mut self) -> (Option<i32>, String) {
        drop(self.stdin.take());
        let begin = Instant::now();
        let status = loop {
            match self.process.try_wait().unwrap() {
                Some(status) => break status.code(),
                None => assert!(begin.elapsed() < TEST_TIMEOUT, "it does not end"),
            }
            thread::sleep(Duration::from_millis(5));
        };
        let mut said = String::new();
        self.process.stderr.take().unwrap().read_to_string(&mut said).unwrap();
        (status, said)
    }

    /// Interrupts the program as Ctrl-C does.
    #[cfg(unix)]
    pub(crate) fn interrupt(&self) {
        self.signal("-INT");
    }

    #[cfg(unix)]
    pub(crate) fn signal(&self, signal: &str) {
        let kill = Command::new("kill").args([signal, &self.process.id().to_string()]).status().unwrap();
        assert!(kill.success());
    }

    pub(crate) fn kill(mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Tool {
    fn drop(&mut self) {
        drop(self.process.kill());
        drop(self.process.wait());
    }
}
