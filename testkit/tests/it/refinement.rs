//! The ends over bytes follow the model.
#![allow(missing_docs)]

use testkit::links::work_queue::{Looks, Queue};
use testkit::links::{PAIRS, isra_ball, val2_viewer, work_queue};
use testkit::model::{Options, System, explore, explore_whole};

#[test]
fn the_ends_do_what_the_machines_do() {
    for pair in PAIRS {
        for refined in (pair.refined)() {
            println!("{}: {refined:?}", pair.name);
            assert!(refined.states > 20 && refined.walks > 0 && refined.transitions > 0, "{}", pair.name);
        }
    }
}

#[test]
#[ignore = "36 million steps: .ci/queue-proof runs it optimised"]
fn a_queue_of_three_does_what_the_model_does() {
    println!("{:?}", work_queue::refined(3));
}

#[test]
fn fingerprints_lose_no_state() {
    fn count(system: &impl System) {
        let (graph, whole) =
            (explore(system, &Options::default()), explore_whole(system, &Options::default()));
        assert_eq!((graph.states, graph.steps), (whole.states, whole.steps));
    }
    count(&isra_ball::any_ball(true));
    count(&val2_viewer::any_host(true));
    count(&Queue::new(2, Looks::Find));
}
