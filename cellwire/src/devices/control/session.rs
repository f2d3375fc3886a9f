//! The connection of a client that sends commands.

use std::sync::Arc;
use std::time::Duration;

use cellwire_sim::Device;
use cellwire_sim::host::{HostedSession, Request};
use robot_session::Session;

use super::commands::Commands;

/// The longest line of a client, its line feed excluded.
const MAX_LINE: usize = 64 * 1024;

/// A client: lines in, answers out.
pub(super) struct Client<D: Device> {
    commands: Arc<Commands<D>>,
    /// The beginning of a line.
    line: Vec<u8>,
    /// Answers that are not sent.
    unsent: Vec<u8>,
    /// The reason to close the connection once the answers are sent.
    closes: Option<&'static str>,
}

impl<D: Device + 'static> Client<D> {
    pub(super) fn new(commands: Arc<Commands<D>>) -> Self {
        Self { commands, line: Vec::new(), unsent: Vec::new(), closes: None }
    }

    /// Answers a line without its line feed.
    fn execute(&mut self, line: &[u8]) {
        let line = line.trim_ascii();
        if line.is_empty() {
            return;
        }
        // A browser can be made to send commands in the body of a request to this machine.
        if line.ends_with(b" HTTP/1.1") || line.ends_with(b" HTTP/1.0") {
            return self.refuse("this is not HTTP: send lines of JSON over TCP");
        }
        self.unsent.extend(self.commands.answer(line).to_string().into_bytes());
        self.unsent.push(b'\n');
    }

    /// Reports an error that ends the connection.
    fn refuse(&mut self, why: &'static str) {
        self.unsent.extend(serde_json::json!({"ok": false, "error": why}).to_string().into_bytes());
        self.unsent.push(b'\n');
        self.closes = Some(why);
    }
}

impl<D: Device + 'static> HostedSession for Client<D> {
    fn another(&self) -> Option<Self> {
        Some(Self::new(Arc::clone(&self.commands)))
    }

    fn request(why: &&'static str) -> Option<Request> {
        Some(Request::Close(why))
    }
}

impl<D: Device + 'static> Session for Client<D> {
    /// The reason to close the connection.
    type Event = &'static str;
    type Statistics = ();
    const MAX_INPUT: usize = 1024;
    /// Also the size of a read: it bounds the answers to a client that does not read them.
    const MAX_TRANSMIT: usize = 1024;

    fn handle_connected(&mut self, _: Duration) {}

    fn handle_disconnected(&mut self, _: Duration) {}

    fn handle_input(&mut self, _: Duration, bytes: &[u8]) {
        let mut bytes = bytes;
        while let (None, Some(end)) = (self.closes, bytes.iter().position(|byte| *byte == b'\n')) {
            let (head, rest) = bytes.split_at(end);
            let mut line = core::mem::take(&mut self.line);
            line.extend_from_slice(head);
            if line.len() > MAX_LINE {
                return self.refuse("the line is longer than 64 KiB");
            }
            self.execute(&line);
            bytes = rest.get(1..).unwrap_or_default();
        }
        self.line.extend_from_slice(bytes);
        if self.closes.is_none() && self.line.len() > MAX_LINE {
            self.refuse("the line is longer than 64 KiB");
        }
    }

    fn handle_timeout(&mut self, _: Duration) {}

    fn wants_input(&self) -> bool {
        self.closes.is_none()
    }

    fn poll_event(&mut self) -> Option<&'static str> {
        if self.unsent.is_empty() { self.closes.take() } else { None }
    }

    fn poll_transmit(&mut self, _: Duration, out: &mut [u8]) -> Option<usize> {
        let length = self.unsent.len().min(out.len());
        let (into, from) = (out.get_mut(..length)?, self.unsent.get(..length)?);
        into.copy_from_slice(from);
        self.unsent.drain(..length);
        (length > 0).then_some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        None
    }

    fn statistics(&self) {}
}
