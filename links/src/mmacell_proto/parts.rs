use crate::explain::{Part, Parts, ReadMessage, count};

/// The bytes that end a number.
const NO_DIGITS: &[u8] = b"+-TFOC\r\n";

pub(super) fn parts(read: &ReadMessage<'_>) -> Vec<Part> {
    let (mut line, message) = (Line(Parts::new(read.bytes)), read.message);
    let axes = count(message, "axes");
    match message["command"].as_str() {
        Some(command) => {
            line.0.take(3, "/command", "4.1");
            match command {
                "SRV" => line.word("/on", "4.1"),
                "OVR" => line.number("/percent", "MM-65"),
                "MOV" => {
                    line.0.take(1, "/mode", "4.1");
                    line.axes(axes);
                }
                "ACQ" => line.number("/camera", "MM-65"),
                "HND" => {
                    line.number("/gripper", "MM-15");
                    line.word("/open", "MM-15");
                }
                _ => {}
            }
        }
        None => {
            line.0.take(2, "/reply", "4.2");
            if message.get("moving").is_some() {
                line.0.take(1, "/moving", "MM-19");
                line.axes(axes);
                line.0.take(1, "/servo", "4.2");
                line.number("/override", "MM-65");
            }
            if message.get("error").is_some() {
                line.number("/error", "MM-66");
            }
        }
    }
    line.0.end("end", "MM-5")
}

struct Line<'a>(Parts<'a>);

impl Line<'_> {
    /// Adds a number: a sign, blanks and digits; the last letter of another reading of the command may precede it.
    fn number(&mut self, name: impl Into<String>, clause: &'static str) {
        if !matches!(self.0.peek(), None | Some(b'+' | b'-' | b'\r' | b'\n')) {
            self.0.until(b"+-\r\n", "letter", "MM-29");
        }
        self.0.after(1, NO_DIGITS, name, clause);
    }

    fn axes(&mut self, axes: usize) {
        for axis in 0..axes {
            self.number(format!("/axes/{axis}"), "MM-65");
        }
    }

    fn word(&mut self, name: &str, clause: &'static str) {
        self.0.until(b"\r\n", name, clause);
    }
}
