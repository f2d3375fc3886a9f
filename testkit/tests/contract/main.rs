//! The contract of `robot-session`, for every decoder and every session of the workspace.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod session;

use std::io;

use cellwire_links::codec::{Codec, Kind};
use cellwire_links::vectors::{Outcome, Vector};
use cellwire_links::{LINKS, Link};
use robot_session::Decoder;
use serde_json::{Map, Value};
use testkit::contract;

/// The strings of calls that each session is tried with.
const SEEDS: u64 = 300;

fn vectors(link: &str) -> Vec<Vector> {
    let path = format!("{}/../reference/vectors/{link}.json", env!("CARGO_MANIFEST_DIR"));
    cellwire_links::vectors::vectors(path).unwrap()
}

/// A file of the reference.
fn reference(path: &str) -> Value {
    let path = format!("{}/../reference/{path}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn every_session() {
    std::thread::scope(|scope| {
        for link in LINKS.iter().filter(|link| testkit::is_tested(link.name)) {
            for row in link.ends {
                scope.spawn(move || contract::session(&session::held(link, row), SEEDS));
            }
        }
    });
}

#[test]
fn every_decoder() {
    for link in LINKS.iter().filter(|link| testkit::is_tested(link.name)) {
        let mut known = Vec::new();
        for vector in vectors(link.name) {
            let codec = (link.side(vector.from.as_deref()).unwrap(), vector.options);
            if !known.contains(&codec) {
                hold(link, codec.0, &codec.1);
                known.push(codec);
            }
        }
    }
}

fn hold(link: &'static Link, side: &str, options: &Map<String, Value>) {
    let is_tcp = link.name == "fanuc-hmi-modbus" && options.is_empty();
    let mut valid = vectors(link.name);
    valid.retain(|v| v.result == Outcome::Valid && v.options == *options);
    valid.retain(|v| link.side(v.from.as_deref()).unwrap() == side);
    // After corruption nothing says where a frame begins whose function has no length, or another one than its own.
    valid.retain(|v| !is_tcp || !v.flags.iter().any(|flag| flag == "other"));
    let frames: Vec<_> = valid.into_iter().map(|v| v.bytes).collect();
    if frames.is_empty() {
        return;
    }
    println!("{} {side} {options:?}", link.name);
    let new = || Json((link.codec)(side, options).unwrap());
    contract::decoder_where(link.name, new, &frames, |frame, at| match link.name {
        // Nothing says that a length is wrong which a frame can have, and what it covers is lost: all six of a stream at most.
        "fanuc-hmi-modbus" if is_tcp => {
            let length = u16::from_be_bytes([frame[4], frame[5]]);
            if matches!(at, 4 | 5) && (2..=254).contains(&length) { 6 } else { 0 }
        }
        // A corrupt end mark takes the next message with it, and its last DLE may belong to the start mark after that.
        "val2-alter" => 2,
        // A corrupt end, or a value that looks like a beginning, takes the next frame with it.
        _ => 1,
    });
}

/// A codec as a decoder, of objects.
struct Json(Box<dyn Codec>);

impl Decoder for Json {
    type Frame<'a> = String;
    type Error = io::Error;

    fn push(&mut self, bytes: &[u8]) -> usize {
        self.0.push(bytes)
    }

    fn next_frame(&mut self) -> Option<Result<String, io::Error>> {
        let mut json = Vec::new();
        let kind = self.0.next(&mut json)?;
        let json = String::from_utf8(json).unwrap();
        Some(if kind == Kind::Message { Ok(json) } else { Err(io::Error::other(json)) })
    }

    fn finish(&mut self) {
        self.0.finish();
    }

    fn position(&self) -> u64 {
        self.0.position()
    }

    fn clear(&mut self) {
        self.0.clear();
    }
}
