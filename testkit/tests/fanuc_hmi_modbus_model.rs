//! Client and server over bytes do what the model does.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![cfg(feature = "links")]

use testkit::links::fanuc_hmi_modbus::refine_all;

#[test]
fn the_sessions_do_what_the_machines_do() {
    for refined in refine_all() {
        println!("{refined:?}");
        assert!(refined.states > 2000 && refined.walks > 500, "{refined:?}");
    }
}
