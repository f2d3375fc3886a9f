//! The contract of `robot-session`, for every decoder and every session of the workspace.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod fanuc_hmi_modbus;
mod isra_ball;
mod kawasaki_msg;
mod laser_eb90;
mod mmacell_proto;
mod val2_alter;
mod val2_viewer;

use std::collections::BTreeMap;
use std::io;
use std::sync::Mutex;

use cellwire_links::codec::{Codec, Kind};
use cellwire_links::vectors::{Outcome, Vector};
use cellwire_links::{LINKS, Link};
use robot_session::Decoder;
use serde_json::{Map, Value};
use testkit::contract::{self, End, session};
use testkit::rng::Rng;

/// The strings of calls that each session is tried with.
const SEEDS: u64 = 300;

fn vectors(link: &str) -> Vec<Vector> {
    let path = format!("{}/../reference/vectors/{link}.json", env!("CARGO_MANIFEST_DIR"));
    cellwire_links::vectors::vectors(path).unwrap()
}

/// The valid frames of a link's vectors, sent by one side and written with the default options.
fn frames(link: &str, from: Option<&str>) -> Vec<Vec<u8>> {
    let mut all = vectors(link);
    all.retain(|v| v.result == Outcome::Valid && v.options.is_empty());
    all.retain(|v| from.is_none() || v.from.as_deref() == from);
    all.into_iter().map(|v| v.bytes).collect()
}

/// One of them.
fn any_frame(link: &'static str, from: Option<&'static str>, rng: &mut Rng) -> Vec<u8> {
    type Known = BTreeMap<(&'static str, Option<&'static str>), Vec<Vec<u8>>>;
    static KNOWN: Mutex<Known> = Mutex::new(BTreeMap::new());
    let mut known = KNOWN.lock().unwrap();
    let frames = known.entry((link, from)).or_insert_with(|| frames(link, from));
    frames[rng.below(frames.len())].clone()
}

#[test]
fn every_session() {
    fn hold<E: End>() {
        println!("{}", E::NAME);
        session::<E>(SEEDS);
    }
    hold::<fanuc_hmi_modbus::Client<false>>();
    hold::<fanuc_hmi_modbus::Client<true>>();
    hold::<fanuc_hmi_modbus::Server<false>>();
    hold::<fanuc_hmi_modbus::Server<true>>();
    hold::<isra_ball::Host>();
    hold::<isra_ball::Ball>();
    hold::<kawasaki_msg::Pc<false>>();
    hold::<kawasaki_msg::Pc<true>>();
    hold::<kawasaki_msg::Robot<false>>();
    hold::<kawasaki_msg::Robot<true>>();
    hold::<laser_eb90::Host>();
    hold::<laser_eb90::Controller>();
    hold::<mmacell_proto::Central>();
    hold::<mmacell_proto::Device>();
    hold::<val2_alter::Host>();
    hold::<val2_alter::Controller>();
    hold::<val2_viewer::Host>();
    hold::<val2_viewer::Workstation>();
}

#[test]
fn every_decoder() {
    for link in &LINKS {
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
