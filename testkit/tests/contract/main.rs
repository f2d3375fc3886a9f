//! The contract of `robot-session`, for every decoder and every session of the workspace.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod fanuc_hmi_modbus;
mod isra_ball;
mod kawasaki_msg;
mod laser_eb90;
mod mmacell_proto;
mod session;
mod val2_alter;
mod val2_viewer;

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

/// A file of the reference.
fn reference(path: &str) -> serde_json::Value {
    let path = format!("{}/../reference/{path}", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn every_session() {
    std::thread::scope(|scope| {
        for link in &cellwire_links::LINKS {
            for row in link.ends {
                scope.spawn(move || testkit::contract::session(&session::held(link, row), SEEDS));
            }
        }
    });
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
