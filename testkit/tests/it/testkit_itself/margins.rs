//! Margins of assumptions about time.

use core::time::Duration;

use testkit::model::{Margin, Options, Step};

const MS: Duration = Duration::from_millis(1);

/// Returns a margin whose assumed time is 10 ms, and whose property breaks from `from` ms on.
fn margin(from: u32) -> Margin {
    let steps = (8..13).map(|ms| Step::new(10 * MS, ms * MS, move || (ms >= from).then_some("it holds")));
    Margin { end: "an end", setting: "a time", real: "so late", steps: steps.collect() }
}

#[test]
fn the_margin_is_what_holds_before_the_first_step_that_breaks() {
    let measured = margin(12).measure(&Options::default());
    assert_eq!(measured.holds, Some((10 * MS, 11 * MS)));
    assert_eq!(measured.breaks, Some((10 * MS, 12 * MS, "it holds".into())));
    assert_eq!(measured.margin().map(f64::round), Some(1.0));
    assert!(measured.is_kept());
}

#[test]
fn what_never_breaks_has_no_first_step_that_does() {
    let measured = margin(99).measure(&Options::default());
    assert_eq!((measured.holds, measured.breaks.is_none()), (Some((10 * MS, 12 * MS)), true));
    assert!(measured.is_kept());
}

#[test]
fn an_assumption_that_is_true_and_not_enough_is_not_kept() {
    assert!(margin(10).measure(&Options::default()).is_kept(), "at its very limit it may break");
    assert!(!margin(9).measure(&Options::default()).is_kept());
    assert!(!margin(8).measure(&Options::default()).is_kept(), "nothing holds");
}
