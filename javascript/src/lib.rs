//! The table of the links as WebAssembly, for `cellwire.js`: built for `wasm32-unknown-unknown` by `.ci/javascript`.
//!
//! One buffer holds the input of a call and its output. The caller reserves space with `reserve`, writes bytes there, calls
//! a function that returns the length of its output, and reads the output at `answered`. Requests and most answers are JSON;
//! bytes of a stream and of a transmission are themselves. Decoders and sessions have numbers. Times are nanoseconds.

#![allow(clippy::std_instead_of_core, reason = "a program with std")]

use core::time::Duration;
use std::cell::RefCell;

use anyhow::{Context, Result, bail};
use cellwire_links::codec::{Codec, EncodeError, Item, Stream};
use cellwire_links::end::End;
use cellwire_links::explain::explain;
use cellwire_links::vectors::unhex;
use cellwire_links::{LINKS, Link};
use serde_json::{Map, Value, json};

thread_local! {
    static STATE: RefCell<State> = const { RefCell::new(State { buffer: Vec::new(), held: Vec::new() }) };
}

/// The state of the module.
struct State {
    buffer: Vec<u8>,
    /// The decoders and sessions by number; `None` is a number to use again.
    held: Vec<Option<CallerObject>>,
}

/// A decoder or a session of the caller's.
enum CallerObject {
    Decoder(Stream),
    Session(Box<dyn End>),
}

/// Functions by name for JavaScript.
macro_rules! exports {
    ($($(#[$doc:meta])* fn $name:ident($($argument:ident: $type:ty),*) -> $result:ty $body:block)*) => { $(
        $(#[$doc])*
        #[expect(unsafe_code, reason = "a name for JavaScript")]
        #[unsafe(no_mangle)]
        pub extern "C" fn $name($($argument: $type),*) -> $result $body
    )* };
}

exports! {
    /// Reserves the buffer for an input of this length; returns its address.
    fn reserve(length: usize) -> *mut u8 {
        STATE.with_borrow_mut(|state| {
            state.buffer.clear();
            state.buffer.resize(length, 0);
            state.buffer.as_mut_ptr()
        })
    }

    /// Returns the address of the output.
    fn answered() -> *const u8 {
        STATE.with_borrow(|state| state.buffer.as_ptr())
    }

    /// Answers the JSON request in the buffer: an object, or one with the key `refused` or `wrong`.
    fn answer() -> usize {
        STATE.with_borrow_mut(|state| {
            let request = core::mem::take(&mut state.buffer);
            let answer = state.reply(&request).unwrap_or_else(|error| json!({ "wrong": format!("{error:#}") }));
            state.output(answer.to_string())
        })
    }

    /// Passes the bytes in the buffer to a decoder; the items that are complete as a JSON list.
    fn push(decoder: usize) -> usize {
        STATE.with_borrow_mut(|state| {
            let bytes = core::mem::take(&mut state.buffer);
            state.items(decoder, |stream, emit| stream.push(&bytes, emit), "")
        })
    }

    /// Ends the stream of a decoder; the items that the end gives as a JSON list.
    fn finish(decoder: usize) -> usize {
        STATE.with_borrow_mut(|state| state.items(decoder, |stream, emit| stream.finish(emit), "\"end\":true,"))
    }

    /// Calls the `handle_…` of a session: 0 connected, 1 disconnected, 2 timeout, 3 transmitted, 4 input, which is the buffer.
    fn handle(session: usize, what: u32, now: u64) -> () {
        STATE.with_borrow_mut(|state| {
            let (bytes, now) = (core::mem::take(&mut state.buffer), Duration::from_nanos(now));
            let Some(end) = state.session(session) else { return };
            match what {
                0 => end.handle_connected(now),
                1 => end.handle_disconnected(now),
                2 => end.handle_timeout(now),
                3 => end.handle_transmitted(now),
                _ => end.handle_input(now, &bytes),
            }
        });
    }

    /// Writes the bytes that a session transmits now; returns their number, or −1.
    fn poll_transmit(session: usize, now: u64) -> isize {
        STATE.with_borrow_mut(|state| {
            let mut bytes = core::mem::take(&mut state.buffer);
            let length = state.session(session).and_then(|end| {
                bytes.resize(end.max_transmit(), 0);
                end.poll_transmit(Duration::from_nanos(now), &mut bytes)
            });
            state.buffer = bytes;
            length.and_then(|length| isize::try_from(length).ok()).unwrap_or(-1)
        })
    }

    /// Writes the next event of a session as JSON; returns 0 without an event.
    fn poll_event(session: usize) -> usize {
        STATE.with_borrow_mut(|state| {
            let event = state.session(session).and_then(|end| end.poll_event());
            state.output(event.unwrap_or_default())
        })
    }

    /// Returns the deadline of a session; the greatest number without a deadline.
    fn poll_timeout(session: usize) -> u64 {
        STATE.with_borrow_mut(|state| {
            let deadline = state.session(session).and_then(|end| end.poll_timeout());
            deadline.and_then(|deadline| u64::try_from(deadline.as_nanos()).ok()).unwrap_or(u64::MAX)
        })
    }

    /// Returns whether a session reads input now.
    fn wants_input(session: usize) -> bool {
        STATE.with_borrow_mut(|state| state.session(session).is_some_and(|end| end.wants_input()))
    }

    /// Drops a decoder or a session.
    fn release(number: usize) -> () {
        STATE.with_borrow_mut(|state| drop(state.held.get_mut(number).and_then(Option::take)));
    }
}

/// The fields of a request. They are looked up, not derived: a module is loaded over a network.
struct RequestFields<'a>(&'a Value);

impl RequestFields<'_> {
    fn text(&self, name: &str) -> Result<&str> {
        self.0[name].as_str().with_context(|| format!("{name} is a text"))
    }

    fn object(&self, name: &str) -> Map<String, Value> {
        self.0[name].as_object().cloned().unwrap_or_default()
    }

    fn link(&self) -> Result<&'static Link> {
        Link::by_name(self.text("link")?)
    }

    /// Returns the codec of the sending side, with its settings.
    fn codec(&self) -> Result<Box<dyn Codec>> {
        let link = self.link()?;
        (link.codec)(link.side(self.0["from"].as_str())?, &self.object("options"))
    }
}

impl State {
    fn reply(&mut self, request: &[u8]) -> Result<Value> {
        // As a text: the links read JSON from texts, and one reader is smaller than two.
        let request: Value = serde_json::from_str(core::str::from_utf8(request)?)?;
        let (name, fields) = match &request {
            Value::Object(object) => object.iter().next().context("a request has one key")?,
            _ => return Ok(LINKS.iter().map(describe).collect()),
        };
        let fields = RequestFields(fields);
        Ok(match name.as_str() {
            "explain" => {
                let bytes = unhex(fields.text("hex")?)?;
                let frames =
                    explain(fields.link()?, fields.text("side")?, &fields.object("settings"), &bytes)?;
                json!({ "bytes": bytes, "frames": serde_json::to_value(frames).context("no JSON")? })
            }
            "encode" => match fields.codec()?.encode(fields.0["message"].clone()) {
                Ok(bytes) => json!({ "bytes": bytes }),
                Err(error) => refused(&error)?,
            },
            "decoder" => self.hold(CallerObject::Decoder(Stream::new(fields.codec()?))),
            "session" => {
                match (fields.link()?.end(fields.text("end")?)?.make)(&fields.object("config"), None) {
                    Ok(session) => self.hold(CallerObject::Session(session)),
                    Err(error) => json!({ "refused": { "kind": "config" }, "text": format!("{error:#}") }),
                }
            }
            "call" => {
                let end = self.asked(&fields)?;
                let now = Duration::from_nanos(fields.0["now"].as_u64().context("now is a time")?);
                match end.call(now, fields.text("name")?, &fields.0["argument"])? {
                    Ok(()) => json!({}),
                    Err(refusal) => json!({ "refused": serde_json::from_str::<Value>(&refusal)? }),
                }
            }
            "statistics" => serde_json::from_str(&self.asked(&fields)?.statistics())?,
            _ => bail!("no request is called {name}"),
        })
    }

    /// Returns the session that a request names.
    fn asked(&mut self, fields: &RequestFields<'_>) -> Result<&mut Box<dyn End>> {
        let number = fields.0["session"].as_u64().and_then(|number| usize::try_from(number).ok());
        number.and_then(|number| self.session(number)).context("there is no such session")
    }

    fn hold(&mut self, held: CallerObject) -> Value {
        let number = self.held.iter().position(Option::is_none).unwrap_or_else(|| {
            self.held.push(None);
            self.held.len() - 1
        });
        if let Some(place) = self.held.get_mut(number) {
            *place = Some(held);
        }
        json!({ "number": number })
    }

    fn session(&mut self, number: usize) -> Option<&mut Box<dyn End>> {
        match self.held.get_mut(number)?.as_mut()? {
            CallerObject::Session(end) => Some(end),
            CallerObject::Decoder(_) => None,
        }
    }

    /// Answers with the items that a decoder emits, each with this label.
    fn items(
        &mut self,
        number: usize,
        run: impl FnOnce(&mut Stream, &mut dyn FnMut(Item<'_>) -> Result<()>) -> Result<()>,
        label: &str,
    ) -> usize {
        let mut out = vec![b'['];
        if let Some(Some(CallerObject::Decoder(stream))) = self.held.get_mut(number) {
            // A decoder that makes no progress is a bug: its items so far are returned.
            let _ = run(stream, &mut |item| {
                if out.len() > 1 {
                    out.push(b',');
                }
                Ok(item.write_line(label, &mut out)?)
            });
        }
        out.push(b']');
        self.output(out)
    }

    fn output(&mut self, bytes: impl Into<Vec<u8>>) -> usize {
        self.buffer = bytes.into();
        self.buffer.len()
    }
}

fn refused(error: &EncodeError) -> Result<Value> {
    Ok(json!({ "refused": serde_json::from_str::<Value>(error.json())?, "text": error.to_string() }))
}

fn describe(link: &Link) -> Value {
    let settings = (link.settings)().into_iter().map(|setting| {
        json!({
            "name": setting.name,
            "values": setting.values,
            "choices": setting.choices,
            "default": setting.default,
            "about": setting.about,
        })
    });
    json!({
        "name": link.name,
        "about": link.about,
        "sides": link.sides,
        "settings": settings.collect::<Value>(),
        "ends": link.ends.iter().map(|end| (end.name.to_owned(), json!((end.calls)()))).collect::<Map<_, _>>(),
    })
}
