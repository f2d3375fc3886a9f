//! The codecs of cellwire for a page without a server: built for `wasm32-unknown-unknown` by `.ci/site`, called by `playground.js`.
//!
//! One buffer holds what goes in and what comes out: a caller asks for room with `reserve`, writes a request there as JSON, calls `answer`,
//! which gives the length of the answer, and reads it at `answered`. Nothing is called while another call runs.

#![allow(clippy::std_instead_of_core, reason = "a program with std")]

use std::cell::RefCell;

use anyhow::{Context, Result};
use cellwire_links::explain::explain;
use cellwire_links::vectors::unhex;
use cellwire_links::{LINKS, Link};
use serde::Deserialize;
use serde_json::{Map, Value, json};

thread_local! {
    static BUFFER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Room for a request of so many bytes.
#[expect(unsafe_code, reason = "a name for the page")]
#[unsafe(no_mangle)]
pub extern "C" fn reserve(length: usize) -> *mut u8 {
    BUFFER.with_borrow_mut(|buffer| {
        buffer.clear();
        buffer.resize(length, 0);
        buffer.as_mut_ptr()
    })
}

/// Answers the request; the length of the answer.
#[expect(unsafe_code, reason = "a name for the page")]
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> usize {
    BUFFER.with_borrow_mut(|buffer| {
        *buffer = reply(buffer)
            .unwrap_or_else(|error| json!({ "refused": format!("{error:#}") }))
            .to_string()
            .into();
        buffer.len()
    })
}

/// Where the answer is.
#[expect(unsafe_code, reason = "a name for the page")]
#[unsafe(no_mangle)]
pub extern "C" fn answered() -> *const u8 {
    BUFFER.with_borrow(|buffer| buffer.as_ptr())
}

/// What a page asks.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum Request {
    /// Every link, its sides and its settings.
    Links,
    /// What these bytes are.
    Explain {
        link: String,
        side: String,
        /// Other than the defaults.
        settings: Map<String, Value>,
        hex: String,
    },
}

/// The answer to a request.
///
/// # Errors
/// When it is none, or says what is not there.
pub fn reply(request: &[u8]) -> Result<Value> {
    Ok(match serde_json::from_slice(request)? {
        Request::Links => LINKS.iter().map(describe).collect(),
        Request::Explain { link, side, settings, hex } => {
            let bytes = unhex(&hex)?;
            let frames = explain(Link::by_name(&link)?, &side, &settings, &bytes)?;
            json!({ "bytes": bytes, "frames": serde_json::to_value(frames).context("no JSON")? })
        }
    })
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
    })
}
