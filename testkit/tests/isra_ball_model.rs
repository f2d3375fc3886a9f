//! Host and ball over bytes do what the model does.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![cfg(feature = "links")]

use testkit::links::isra_ball::{Exchange, refine};
use testkit::model::{Options, explore, explore_whole};

#[test]
fn the_sessions_do_what_the_machines_do() {
    let noisy = Exchange { noise: true, faults: 2, ..Exchange::steady() };
    for exchange in [Exchange { faults: 0, ..Exchange::slow() }, Exchange::slow(), noisy] {
        let refined = refine(&exchange);
        println!("{refined:?}");
        assert!(refined.states > 1000 && refined.walks > 300, "{refined:?}");
    }
}

#[test]
fn fingerprints_lose_no_state() {
    let exchange = Exchange::steady();
    let (graph, whole) =
        (explore(&exchange, &Options::default()), explore_whole(&exchange, &Options::default()));
    assert_eq!((graph.states, graph.steps), (whole.states, whole.steps));
}
