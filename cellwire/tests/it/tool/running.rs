//! A program that runs until the test ends.

use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;
use std::process::{Child, Command};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;

/// Nothing that is waited for takes this long, also on a machine with a great load.
pub(crate) const DEADLINE: Duration = Duration::from_secs(60);

/// A program that runs until the test ends.
pub(crate) struct Running {
    child: Child,
    /// Lines of both outputs, as they come.
    lines: Receiver<String>,
    /// Lines that came while another line was waited for.
    passed: Vec<String>,
    /// The first line of the program.
    pub(crate) ready: Value,
}

impl Running {
    /// Starts it and waits for its first line.
    pub(crate) fn start(mut command: Command) -> Self {
        let mut child = command.spawn().unwrap();
        let (sender, lines) = channel();
        let (out, err) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        for output in [Box::new(out) as Box<dyn Read + Send>, Box::new(err)] {
            let sender = sender.clone();
            thread::spawn(move || {
                for line in BufReader::new(output).lines().map_while(Result::ok) {
                    if sender.send(line).is_err() {
                        return;
                    }
                }
            });
        }
        let mut running = Self { child, lines, passed: Vec::new(), ready: Value::Null };
        let line = running.line("\"ready\"");
        running.ready = serde_json::from_str(&line).unwrap();
        running
    }

    /// Returns the id of the process.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Returns the address at which the device listens.
    pub(crate) fn address(&self) -> String {
        self.ready["listen"].as_str().unwrap().to_owned()
    }

    /// Connects to the device; returns a connection whose reads end after the deadline.
    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address()).unwrap();
        stream.set_read_timeout(Some(DEADLINE)).unwrap();
        stream
    }

    /// Returns the first line that contains a text and was not returned before.
    pub(crate) fn line(&mut self, text: &str) -> String {
        if let Some(at) = self.passed.iter().position(|line| line.contains(text)) {
            return self.passed.remove(at);
        }
        let end = Instant::now() + DEADLINE;
        loop {
            match self.lines.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(line) if line.contains(text) => return line,
                Ok(line) => self.passed.push(line),
                Err(error) => {
                    let ended = error == RecvTimeoutError::Disconnected;
                    let last = &self.passed[self.passed.len().saturating_sub(20)..];
                    panic!("no line with {text}, ended: {ended}; the last lines: {last:#?}")
                }
            }
        }
    }

    /// Waits for the end; returns the remaining lines.
    pub(crate) fn rest(&mut self) -> Vec<String> {
        let mut lines = std::mem::take(&mut self.passed);
        lines.extend(self.lines.iter());
        lines
    }

    /// Returns the resident memory of the program, in bytes.
    pub(crate) fn resident(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS:")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 1024
    }

    /// Sends a signal and waits for its end; the exit status.
    pub(crate) fn signal(&mut self, signal: &str) -> Option<i32> {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        self.child.wait().unwrap().code()
    }
}

impl Running {
    /// Returns the exit status of the program, once it has ended.
    pub(crate) fn status(&mut self) -> Option<i32> {
        self.child.wait().unwrap().code()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
