//! A client that speaks over pipes to a server.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read, Write};

use serde_json::{Value, json};

/// The two ends of a connection, and the messages that were read while another was expected.
pub(crate) struct Client<R, W> {
    input: BufReader<R>,
    output: Option<W>,
    unread: VecDeque<Value>,
    last: i32,
}

impl<R: Read, W: Write> Client<R, W> {
    pub(crate) fn new(input: R, output: W) -> Self {
        Self { input: BufReader::new(input), output: Some(output), unread: VecDeque::new(), last: 0 }
    }

    /// Writes bytes as they are.
    pub(crate) fn write(&mut self, bytes: &[u8]) {
        let output = self.output.as_mut().expect("the client has not gone");
        output.write_all(bytes).expect("the server reads");
        output.flush().expect("the server reads");
    }

    pub(crate) fn send(&mut self, message: &Value) {
        let body = message.to_string();
        self.write(format!("Content-Length: {}\r\n\r\n{body}", body.len()).as_bytes());
    }

    /// Closes the connection to the server.
    pub(crate) fn leave(&mut self) {
        self.output = None;
    }

    /// Reads the next message; `None` if the server has closed the connection.
    pub(crate) fn read(&mut self) -> Option<Value> {
        let mut length = 0;
        loop {
            let mut line = String::new();
            if self.input.read_line(&mut line).expect("text") == 0 {
                return None;
            }
            match line.trim().split_once(": ") {
                Some((_, value)) => length = value.parse().expect("a number"),
                None => break,
            }
        }
        let mut body = vec![0; length];
        self.input.read_exact(&mut body).expect("the body");
        Some(serde_json::from_slice(&body).expect("JSON"))
    }

    pub(crate) fn notify(&mut self, method: &str, params: Value) {
        self.send(&json!({"jsonrpc": "2.0", "method": method, "params": params}));
    }

    /// Sends a request and returns its id.
    pub(crate) fn ask(&mut self, method: &str, params: Value) -> i32 {
        self.last += 1;
        self.send(&json!({"jsonrpc": "2.0", "id": self.last, "method": method, "params": params}));
        self.last
    }

    /// Waits for the answer to a request, and returns all of it.
    pub(crate) fn answer(&mut self, id: i32) -> Value {
        self.wait(|message| message["id"] == id && message["method"].is_null())
    }

    /// Sends a request; returns its result or its error.
    pub(crate) fn request(&mut self, method: &str, params: Value) -> Value {
        let id = self.ask(method, params);
        let answer = self.answer(id);
        answer.get("result").unwrap_or(&answer["error"]).clone()
    }

    /// Waits for the next notification with this method; returns its parameters.
    pub(crate) fn notification(&mut self, method: &str) -> Value {
        self.wait(|message| message["method"] == method)["params"].clone()
    }

    fn wait(&mut self, is_meant: impl Fn(&Value) -> bool) -> Value {
        if let Some(at) = self.unread.iter().position(&is_meant) {
            return self.unread.remove(at).expect("it is there");
        }
        loop {
            let message = self.read().expect("the server answers");
            if is_meant(&message) {
                return message;
            }
            self.unread.push_back(message);
        }
    }

    /// Begins the connection, with the folder of a workspace or without.
    pub(crate) fn initialize(&mut self, root: Option<&str>, encodings: &[&str]) -> Value {
        let capabilities = json!({"general": {"positionEncodings": encodings}});
        let answer = self
            .request("initialize", json!({"processId": null, "rootUri": root, "capabilities": capabilities}));
        self.notify("initialized", json!({}));
        answer
    }

    pub(crate) fn open(&mut self, uri: &str, text: &str) {
        let document = json!({"uri": uri, "languageId": "fanuc-ls", "version": 1, "text": text});
        self.notify("textDocument/didOpen", json!({"textDocument": document}));
    }

    /// Ends the connection as an editor does.
    pub(crate) fn exit(&mut self) {
        assert_eq!(self.request("shutdown", Value::Null), Value::Null);
        self.notify("exit", Value::Null);
    }
}
