//! Messages as bytes: `Content-Length: N`, an empty line, and N bytes of JSON.

use std::io::{self, BufRead, Read, Write};

use lsp_server::{ErrorCode, Message};
use serde::de::IgnoredAny;
use serde_json::{Value, json};

/// The longest message that is read, in bytes: a document of 50 MB whose characters are all escaped fits.
const MAX_MESSAGE: usize = 512 << 20;
/// The longest header line, in bytes.
const MAX_HEADER: u64 = 4096;

/// A message, or bytes in the place of one.
#[derive(Debug)]
pub(crate) enum Incoming {
    /// A message of the client.
    Message(Message),
    /// A body that is not a message: the code and the text of the answer. The next message can be read.
    Malformed(i32, String),
}

/// Reads the next message; None at the end of the input.
///
/// # Errors
/// If a header is not one, or announces too many bytes: where the next message begins is unknown.
pub(crate) fn read(input: &mut impl BufRead) -> io::Result<Option<Incoming>> {
    let Some(length) = read_head(input)? else { return Ok(None) };
    let mut body = Vec::new();
    // Memory is taken as bytes arrive: a head may announce more than there is.
    input.by_ref().take(length as u64).read_to_end(&mut body)?;
    if body.len() < length {
        return Ok(None);
    }
    let malformed = |code, error: &dyn core::fmt::Display| Incoming::Malformed(code, error.to_string());
    Ok(Some(match serde_json::from_slice(&body) {
        // An id that is neither a number of 32 bits nor a text is left out by the type.
        Ok(Message::Notification(_))
            if serde_json::from_slice::<Head>(&body).is_ok_and(|head| head.id.is_some()) =>
        {
            malformed(ErrorCode::InvalidRequest as i32, &"the id is not a number of 32 bits or a text")
        }
        Ok(message) => Incoming::Message(message),
        Err(error) => match serde_json::from_slice::<IgnoredAny>(&body) {
            Ok(_) => malformed(ErrorCode::InvalidRequest as i32, &error),
            Err(error) => malformed(ErrorCode::ParseError as i32, &error),
        },
    }))
}

/// The field that distinguishes a request from a notification.
#[derive(serde::Deserialize)]
struct Head {
    id: Option<IgnoredAny>,
}

/// Reads the head of a message and returns the length of its body, in bytes.
fn read_head(input: &mut impl BufRead) -> io::Result<Option<usize>> {
    let mut length = None;
    loop {
        let mut line = Vec::new();
        let count = input.by_ref().take(MAX_HEADER).read_until(b'\n', &mut line)?;
        if !line.ends_with(b"\n") && (count as u64) < MAX_HEADER {
            return Ok(None);
        }
        let line = String::from_utf8_lossy(&line);
        let header = line.trim();
        if header.is_empty() {
            return length.map(Some).ok_or_else(|| invalid("a message has no Content-Length"));
        }
        let (name, value) = header.split_once(':').ok_or_else(|| invalid("a header has no colon"))?;
        if name.trim().eq_ignore_ascii_case("Content-Length") {
            let value: Option<usize> = value.trim().parse().ok().filter(|length| *length <= MAX_MESSAGE);
            length = Some(value.ok_or_else(|| invalid("Content-Length is not a number up to 512 MB"))?);
        }
    }
}

/// Writes a message.
///
/// # Errors
/// If `out` fails: the client no longer reads.
pub(crate) fn write(out: &mut impl Write, message: &Message) -> io::Result<()> {
    message.write(out)
}

/// Writes the answer to bytes that are not a message; its id is null.
///
/// # Errors
/// If `out` fails.
pub(crate) fn write_malformed(out: &mut impl Write, code: i32, message: &str) -> io::Result<()> {
    let answer = json!({"jsonrpc": "2.0", "id": Value::Null, "error": {"code": code, "message": message}});
    let text = answer.to_string();
    write!(out, "Content-Length: {}\r\n\r\n{text}", text.len())?;
    out.flush()
}

fn invalid(text: &'static str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(mut bytes: &[u8]) -> Vec<String> {
        let mut found = Vec::new();
        loop {
            match read(&mut bytes) {
                Ok(Some(Incoming::Message(Message::Notification(it)))) => found.push(it.method),
                Ok(Some(Incoming::Message(it))) => found.push(format!("{it:?}")),
                Ok(Some(Incoming::Malformed(code, _))) => found.push(code.to_string()),
                Ok(None) => return found,
                Err(error) => {
                    found.push(error.to_string());
                    return found;
                }
            }
        }
    }

    fn framed(body: &str) -> String {
        format!("Content-Length: {}\r\n\r\n{body}", body.len())
    }

    #[test]
    fn a_malformed_body_does_not_end_the_connection() {
        let good = framed(r#"{"jsonrpc":"2.0","method":"exit"}"#);
        let deep = framed(&"[".repeat(100_000));
        for (bad, code) in
            [("{", "-32700"), ("", "-32700"), ("[]", "-32600"), ("{\"a\":1}", "-32600"), ("\u{1}", "-32700")]
        {
            assert_eq!(all((framed(bad) + &good).as_bytes()), [code, "exit"], "{bad}");
        }
        assert_eq!(all((deep + &good).as_bytes()), ["-32700", "exit"]);
        let other = "content-length:33\nContent-Type: x\n\n{\"jsonrpc\":\"2.0\",\"method\":\"exit\"}";
        assert_eq!(all(other.as_bytes()), ["exit"]);
    }

    #[test]
    fn a_head_that_cannot_be_read_ends_it() {
        let cases = [
            ("Content-Length: 99999999999999999999\r\n\r\n", "Content-Length is not a number up to 512 MB"),
            ("Content-Length: -1\r\n\r\n", "Content-Length is not a number up to 512 MB"),
            ("Content-Type: x\r\n\r\n{}", "a message has no Content-Length"),
            ("hello\r\n", "a header has no colon"),
        ];
        for (bytes, error) in cases {
            assert_eq!(all(bytes.as_bytes()), [error]);
        }
        // A body that ends early, and a head that announces far more than arrives.
        assert_eq!(all(b"Content-Length: 500000000\r\n\r\n{}"), [""; 0]);
        assert_eq!(all("x".repeat(1 << 20).as_bytes()), ["a header has no colon"]);
    }
}
