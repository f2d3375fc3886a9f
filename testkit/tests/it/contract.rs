//! The contract of `robot-session`, for every decoder and every session of the workspace.

use cellwire_links::vectors::{Outcome, Vector};
use cellwire_links::{LINKS, Link};
use robot_session::contract;
use serde_json::{Map, Value};
use testkit::contract::{Objects, TestedEnd};

/// The strings of calls that each session is tried with.
const SEEDS: u64 = 300;

fn vectors(link: &str) -> Vec<Vector> {
    cellwire_links::vectors::vectors(testkit::reference_file(&format!("vectors/{link}.json"))).unwrap()
}

#[test]
fn every_session() {
    std::thread::scope(|scope| {
        for link in LINKS.iter().filter(|link| testkit::is_tested(link.name)) {
            for row in link.ends {
                scope.spawn(move || contract::session(&TestedEnd::of(link, row), SEEDS));
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
    // After corruption, the beginning of a frame is unknown if its function has no length, as 8 and 43, or is not one of its
    // own.
    let function = |message: &Option<Value>| message.as_ref()?["function"].as_u64();
    valid.retain(|v| {
        let has_none =
            matches!(function(&v.message), Some(8 | 43)) || v.flags.iter().any(|flag| flag == "other");
        !is_tcp || !has_none
    });
    let frames: Vec<_> = valid.into_iter().map(|v| v.bytes).collect();
    if frames.is_empty() {
        return;
    }
    println!("{} {side} {options:?}", link.name);
    let new = || Objects((link.codec)(side, options).unwrap());
    contract::decoder_where(link.name, new, &frames, |frame, at| match link.name {
        // A wrong length that a frame can have is not detected, and the bytes that it covers are lost: at most all six of a
        // stream.
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
