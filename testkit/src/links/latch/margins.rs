//! The tolerance of the latch for wrong assumptions about its operator, its controller and its end.

use core::time::Duration;

use cellwire_motion::latch::{Latch, LatchAction, LatchConfig, LatchInput};

use crate::model::{Margin, Step};

const MS: Duration = Duration::from_millis(1);
const END: &str = "cellwire-motion latch";

/// Returns the assumptions of the latch about time.
pub fn margins() -> Vec<Margin> {
    let LatchConfig { rest, end_within, farewell, .. } = LatchConfig::default();
    let around = |assumed: Duration, check: fn(Duration) -> Option<&'static str>| {
        let step = |real| Step::new(assumed, real, move || check(real));
        [MS, assumed - 50 * MS, assumed - MS, assumed, assumed + 50 * MS].map(step).into()
    };
    vec![
        Margin {
            end: END,
            setting: "rest",
            real: "a movement passes through rest for so long",
            steps: around(rest, passes),
        },
        Margin {
            end: END,
            setting: "end_within",
            real: "the values go to zero for so long",
            steps: around(end_within, ramps),
        },
        Margin {
            end: END,
            setting: "farewell",
            real: "the controller ends ALTER so much later",
            steps: around(farewell, says_farewell),
        },
    ]
}

/// Returns a latch while ALTER runs.
fn running(config: &LatchConfig) -> Latch {
    let mut latch = Latch::NEW;
    for input in [LatchInput::Connected, LatchInput::Running] {
        let _ = latch.on(Duration::ZERO, input, config);
    }
    latch
}

fn passes(through: Duration) -> Option<&'static str> {
    let config = LatchConfig::default();
    let (mut latch, mut now) = (running(&config), Duration::ZERO);
    while now <= through {
        let hand = LatchInput::Hand { rests: true, holds: false, fresh_until: now + 150 * MS };
        let _ = latch.on(now, hand, &config);
        if latch.is_armed(now) {
            return Some("a hand that only passes through rest does not arm");
        }
        now += MS;
    }
    None
}

fn ramps(time: Duration) -> Option<&'static str> {
    let config = LatchConfig::default();
    let mut latch = running(&config);
    let _ = latch.on(Duration::ZERO, LatchInput::End, &config);
    let _: LatchAction = latch.on(time, LatchInput::Timeout, &config);
    (latch == Latch::Ended).then_some("the program ends after the values are zero")
}

fn says_farewell(time: Duration) -> Option<&'static str> {
    let config = LatchConfig::default();
    let mut latch = running(&config);
    for input in [LatchInput::End, LatchInput::Silent] {
        let _ = latch.on(Duration::ZERO, input, &config);
    }
    let _ = latch.on(time, LatchInput::Timeout, &config);
    (latch == Latch::Ended).then_some("the program ends after ALTER is over")
}
