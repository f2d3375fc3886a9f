//! The pair of PC and robot: every state within small bounds, and a rule left out that shows.
#![cfg(feature = "links")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use testkit::links::kawasaki_msg::{PAIRS, refine, refined};
use testkit::model::{Depth, Options};

#[test]
fn every_property_holds_in_every_state() {
    for setting in PAIRS.iter().flat_map(|pair| (pair.settings)(Depth::Quick)) {
        let explored = setting.explore(&Options::default());
        println!(
            "{}: {} states, {} steps, {:?}, {:?}",
            setting.name, explored.states, explored.steps, explored.time, explored.longest_standing
        );
        assert!(explored.holds(), "{}: {:#?}", setting.name, explored.broken);
    }
}

#[test]
fn every_rule_is_needed() {
    for case in PAIRS.iter().flat_map(|pair| (pair.must_fail)()) {
        let caught = case.caught(&Options::default());
        let caught = caught.unwrap_or_else(|| panic!("{}: {} holds without it", case.rule, case.property));
        println!("{}: {} after {} steps", case.rule, caught.property, caught.steps);
    }
}

#[test]
fn the_sessions_do_what_the_machines_do() {
    for setup in refined() {
        let refined = refine(&setup);
        println!("{refined:?}");
        assert!(refined.states > 1000 && refined.walks > 300, "{refined:?}");
    }
}
