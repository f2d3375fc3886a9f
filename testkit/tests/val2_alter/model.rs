//! The pair of machines, every state of it.

use testkit::links::val2_alter::PAIR;
use testkit::model::{Depth, Options};

#[test]
fn every_state_keeps_every_property() {
    for setting in (PAIR.settings)(Depth::Quick) {
        let explored = setting.explore(&Options::default());
        println!("{}: {} states, {:?}", explored.setting, explored.states, explored.time);
        assert!(explored.holds(), "{explored:#?}");
        assert!(explored.states > 100_000, "{}", explored.states);
    }
}

#[test]
fn each_rule_is_needed() {
    let mut missed = Vec::new();
    for case in (PAIR.must_fail)() {
        let caught = case.caught(&Options::default());
        println!("{}: {:?}", case.rule, caught.as_ref().map(|broken| (broken.property, broken.steps)));
        missed.extend(caught.is_none().then_some(case.rule));
    }
    assert_eq!(missed, [""; 0]);
}
