//! The lines of a tap.

use std::sync::mpsc::RecvTimeoutError;

use cellwire_links::shadow::Complaint;
use humantime::format_rfc3339_micros;
use serde_json::{Map, Value, json};

use super::SILENCE;
use super::decoding::{DecodedEvent, Entry, TapDecoder, UNKNOWN, hex};
use crate::io::tap::{ConnectionTransport, TapReceiver};
use cellwire_io::output::{self, remark};

/// Prints the observations until there are no more.
pub(super) fn print(mut decoding: TapDecoder<'_>, seen: &TapReceiver) {
    let mut tell = |entry: Entry| if admits(&entry) { output::log(&line(entry)) } else { Ok(()) };
    loop {
        let outcome = match seen.next_within(SILENCE) {
            Ok(seen) => decoding.take(&seen, &mut tell),
            Err(RecvTimeoutError::Timeout) => decoding.silence(&mut tell),
            Err(RecvTimeoutError::Disconnected) => return,
        };
        if let Err(error) = outcome {
            remark(&format!("warning: {error:#}: no more lines; bytes are still forwarded"));
            while !matches!(seen.next_within(SILENCE), Err(RecvTimeoutError::Disconnected)) {}
            return;
        }
    }
}

/// The most bytes of a line. A poll is shorter.
const MAX_BYTES: usize = 512;

/// Returns whether an entry is to be printed: all messages are, and of corrupt bytes, of long runs of bytes and of
/// complaints of a kind as many as [`output::admits`].
fn admits(entry: &Entry) -> bool {
    match &entry.what {
        DecodedEvent::Corrupt { error, .. } => {
            output::admits(error.get("kind").and_then(Value::as_str).unwrap_or_default())
        }
        DecodedEvent::Wrong(complaint) => output::admits(complaint.clause),
        DecodedEvent::Bytes(bytes) => bytes.len() <= MAX_BYTES || output::admits("bytes"),
        _ => true,
    }
}

fn line(entry: Entry) -> Value {
    let Entry { at, connection, end, what } = entry;
    let mut line = Map::new();
    let mut put = |name: &str, value: Value| drop(line.insert(name.into(), value));
    put("time", json!(format_rfc3339_micros(at).to_string()));
    put("connection", json!(connection));
    if !matches!(what, DecodedEvent::Opened(_)) {
        put("from", json!((end != UNKNOWN).then_some(end)));
    }
    match what {
        DecodedEvent::Opened(place) => {
            put("event", json!("opened"));
            match place {
                ConnectionTransport::Tcp(a, b) | ConnectionTransport::Udp(a, b) => {
                    put("a", json!(a.to_string()));
                    put("b", json!(b.to_string()));
                }
                ConnectionTransport::Ports([a, b]) => {
                    put("a", json!(a));
                    put("b", json!(b));
                }
                ConnectionTransport::Line(port) => put("port", json!(port)),
            }
        }
        DecodedEvent::Message { offset, length, content } => {
            put("offset", json!(offset));
            put("length", json!(length));
            put("message", content);
        }
        DecodedEvent::Corrupt { offset, error, clause, bytes } => {
            put("offset", json!(offset));
            put("length", json!(bytes.len()));
            put("error", error);
            put("clause", json!(clause));
            put("bytes", json!(first_bytes(&bytes)));
        }
        DecodedEvent::Wrong(Complaint { kind, clause, text, .. }) => {
            put("shadow", json!(kind));
            put("clause", json!(clause));
            put("text", json!(text));
        }
        DecodedEvent::Bytes(bytes) => {
            if bytes.len() > MAX_BYTES {
                put("length", json!(bytes.len()));
            }
            put("bytes", json!(first_bytes(&bytes)));
        }
        DecodedEvent::Missed(missing) => put("error", json!({"kind": "gap", "missing": missing})),
        DecodedEvent::Closed(why) => {
            put("event", json!("closed"));
            if let Some(why) = why {
                put("why", json!(why));
            }
        }
    }
    Value::Object(line)
}

/// Returns the first bytes as hex text.
fn first_bytes(bytes: &[u8]) -> String {
    hex(bytes.get(..MAX_BYTES).unwrap_or(bytes))
}
