//! Central controller and device over bytes do what the model does.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![cfg(feature = "links")]

use testkit::links::mmacell_proto::{refine, setup};

#[test]
fn the_sessions_do_what_the_machines_do() {
    for (jobs, faults) in [(2, 0), (1, 1)] {
        let refined = refine(&setup(jobs, faults));
        println!("{refined:?}");
        assert!(refined.states > 1000 && refined.walks > 300, "{refined:?}");
    }
}
