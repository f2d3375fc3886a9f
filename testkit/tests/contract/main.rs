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
use std::sync::Mutex;

use testkit::contract::{End, session};
use testkit::rng::Rng;
use testkit::vectors::{Outcome, vectors};

/// The strings of calls that each session is tried with.
const SEEDS: u64 = 300;

/// The valid frames of a link's vectors, sent by one side and written with the default options.
fn frames(link: &str, from: Option<&str>) -> Vec<Vec<u8>> {
    let mut all = vectors(link);
    all.retain(|v| v.result == Outcome::Valid && v.options.is_empty());
    all.retain(|v| from.is_none() || v.from.as_deref() == from);
    all.into_iter().map(|v| v.hex).collect()
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
    fanuc_hmi_modbus::decoder();
    isra_ball::decoder();
    kawasaki_msg::decoder();
    laser_eb90::decoder();
    mmacell_proto::decoder();
    val2_alter::decoder();
    val2_viewer::decoder();
}
