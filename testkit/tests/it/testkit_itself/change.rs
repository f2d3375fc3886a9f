//! Changes of values.

use arbitrary::{Arbitrary as _, Unstructured};
use robot_session::contract::Rng;
use serde_json::json;
use testkit::contract::Change;

#[test]
fn every_place_is_changed_and_keeps_its_kind() {
    let value = json!({"a": [1, 2.5], "b": {"c": "text", "d": true}, "e": 7});
    let mut changed = std::collections::BTreeSet::new();
    for seed in 0..500 {
        let mut other = value.clone();
        let bytes = Rng::new(seed).bytes(11);
        Change::arbitrary(&mut Unstructured::new(&bytes)).unwrap().apply(&mut other);
        for place in ["/a", "/a/0", "/a/1", "/b/c", "/b/d", "/e"] {
            if let (Some(other), Some(before)) = (other.pointer(place), value.pointer(place))
                && other != before
            {
                assert!(core::mem::discriminant(other) == core::mem::discriminant(before) || other.is_null());
                changed.insert(place);
            }
        }
    }
    assert_eq!(changed.len(), 6, "{changed:?}");
}
