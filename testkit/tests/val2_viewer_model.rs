//! Host and workstation over bytes do what the model does.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![cfg(feature = "links")]

use testkit::links::val2_viewer::{Exchange, refine};
use testkit::model::{Options, explore, explore_whole};

#[test]
fn the_sessions_do_what_the_machines_do() {
    for exchange in [Exchange::steady(), Exchange::free(), Exchange::first_workstation()] {
        let refined = refine(&exchange);
        println!("{refined:?}");
        let least = if exchange.steady { 20 } else { 10_000 };
        assert!(refined.states > least, "{refined:?}");
    }
}

#[test]
fn fingerprints_lose_no_state() {
    let exchange = Exchange::free();
    let (graph, whole) =
        (explore(&exchange, &Options::default()), explore_whole(&exchange, &Options::default()));
    assert_eq!((graph.states, graph.steps), (whole.states, whole.steps));
}
