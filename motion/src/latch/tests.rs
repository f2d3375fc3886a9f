use std::collections::{HashSet, VecDeque};

use super::LatchInput as On;
use super::*;

const MS: Duration = Duration::from_millis(1);
const FRESH: Duration = Duration::from_millis(100);

fn hand(now: Duration, rests: bool) -> On {
    On::Hand { rests, holds: false, fresh_until: now + FRESH }
}

/// The rules, written without the latch: the time for which the hand has rested, uninterrupted, with ALTER running,
/// and the time for which nothing has happened that forbids motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
struct Oracle {
    /// Whether ALTER runs and requests values.
    on: bool,
    /// Whether it is not interrupted.
    runs: bool,
    /// Whether the operator has stopped, and ALTER is not over.
    stopped: bool,
    ends: bool,
    /// The time since the first value of the current rest, limited to the required time.
    rested: Option<Duration>,
    /// The remaining time of the last value.
    fresh: Duration,
    allowed: bool,
    ready: bool,
}

impl Oracle {
    fn pass(&mut self, time: Duration, config: &LatchConfig) {
        self.fresh = self.fresh.saturating_sub(time);
        if self.fresh == Duration::ZERO {
            self.forbid();
        }
        self.rested = self.rested.map(|rested| (rested + time).min(config.rest));
    }

    fn forbid(&mut self) {
        (self.rested, self.allowed, self.ready) = (None, false, false);
    }

    fn take(&mut self, input: On, config: &LatchConfig) {
        match input {
            On::Running => (self.on, self.runs) = (true, true),
            On::Interrupted | On::Halted => {
                (self.on, self.runs) = (true, false);
                self.forbid();
            }
            On::Silent | On::Connected | On::Disconnected => {
                // After a stop the silence is on purpose, and lasts until ALTER is over.
                self.stopped &= input == On::Silent;
                (self.on, self.runs) = (self.stopped, false);
                self.forbid();
            }
            On::OldValues | On::InputLost | On::Profile => self.forbid(),
            On::Stop | On::End => {
                self.stopped |= self.on;
                self.ends |= input == On::End;
                self.forbid();
            }
            On::Confirm => self.allowed |= self.ready,
            On::Timeout => {}
            On::Hand { rests, holds, .. } => {
                self.fresh = FRESH;
                if !self.runs || self.stopped || self.ends {
                    return;
                }
                if self.allowed {
                    if config.hold_to_run && !rests && !holds {
                        self.forbid();
                    }
                    return;
                }
                if !rests {
                    return self.forbid();
                }
                if *self.rested.get_or_insert(Duration::ZERO) >= config.rest {
                    self.ready = true;
                    self.allowed = !config.confirm;
                }
            }
        }
    }
}

/// Explores every state that any sequence of inputs at any pace leads to, and asserts that the latch is armed only if the
/// oracle allows it; returns the number of states.
fn explore(config: &LatchConfig) -> usize {
    const EPOCH: Duration = Duration::from_secs(1);
    let mut seen = HashSet::new();
    let mut open = VecDeque::from([(Latch::NEW, Oracle::default())]);
    while let Some((latch, oracle)) = open.pop_front() {
        if !seen.insert((latch, oracle)) {
            continue;
        }
        for pass in [0, 50, 100, 150].map(|ms| ms * MS) {
            let now = EPOCH + pass;
            let hand = |rests, holds| On::Hand { rests, holds, fresh_until: now + FRESH };
            let inputs = [
                On::Running,
                On::Interrupted,
                On::Halted,
                On::Silent,
                On::Connected,
                On::Disconnected,
                hand(true, false),
                hand(false, false),
                hand(false, true),
                On::OldValues,
                On::InputLost,
                On::Profile,
                On::Confirm,
                On::Stop,
                On::End,
                On::Timeout,
            ];
            for input in inputs {
                let (mut latch, mut oracle) = (latch, oracle);
                oracle.pass(pass, config);
                oracle.take(input, config);
                latch.on(now, input, config);
                assert!(
                    !latch.is_armed(now) || oracle.allowed,
                    "{input:?} after {pass:?} leads to {latch:?}: {oracle:?}"
                );
                // The latch is not more careful than it reports: after a rest, the hand can move the arm.
                if oracle.allowed && oracle.runs && !oracle.stopped && !oracle.ends {
                    assert!(latch.is_armed(now), "{input:?} leads to {latch:?}: {oracle:?}");
                }
                // An end may have come in its own time.
                assert!(latch.is_on() == oracle.on || oracle.ends && !latch.is_on(), "{latch:?}: {oracle:?}");
                latch.each_time(|time| *time = EPOCH + time.saturating_sub(now));
                open.push_back((latch, oracle));
            }
        }
    }
    seen.len()
}

#[test]
fn whatever_comes_in_whatever_order_only_fresh_rest_arms() {
    for confirm in [false, true] {
        for hold_to_run in [false, true] {
            let config = LatchConfig { confirm, hold_to_run, ..LatchConfig::default() };
            let states = explore(&config);
            assert!(states > 100, "{states} states");
        }
    }
}

/// Drives the latch by a list of times and inputs.
fn after(config: &LatchConfig, inputs: &[(u32, On)]) -> Latch {
    let mut latch = Latch::NEW;
    for (at, input) in inputs {
        latch.on(*at * MS, *input, config);
    }
    latch
}

fn armed() -> Vec<(u32, On)> {
    let rest = (0..=12).map(|i| (30 * i, hand(30 * i * MS, true)));
    core::iter::once((0, On::Running)).chain(rest).collect()
}

#[test]
fn three_tenths_of_a_second_of_rest_arm_and_not_a_millisecond_less() {
    let config = LatchConfig::default();
    let mut inputs = vec![(0, On::Running), (0, hand(Duration::ZERO, true))];
    inputs.extend((1..=4).map(|i| (70 * i, hand(70 * i * MS, true))));
    let rested = |at: u32| {
        let mut inputs = inputs.clone();
        inputs.push((at, hand(at * MS, true)));
        after(&config, &inputs)
    };
    assert!(!rested(299).is_armed(299 * MS));
    assert!(rested(300).is_armed(300 * MS));
    assert!(rested(300).is_armed(399 * MS));
    assert!(!rested(300).is_armed(400 * MS), "its values are old");
    // Time alone arms nothing.
    let mut inputs = inputs.clone();
    inputs.push((310, On::Timeout));
    assert!(!after(&config, &inputs).is_armed(310 * MS));
}

/// Tests every danger of the operator's cell that a latch can meet: a push that continues meanwhile does not move the arm
/// afterwards.
#[test]
fn every_danger_disarms_and_a_push_that_goes_on_moves_nothing() {
    let config = LatchConfig::default();
    let dangers = [
        (vec![On::Disconnected, On::Running], Cause::Start),
        (vec![On::Interrupted, On::Running], Cause::Interruption),
        (vec![On::Halted, On::Running], Cause::Halt),
        (vec![On::OldValues], Cause::OldValues),
        (vec![On::InputLost], Cause::InputLost),
        (vec![On::Profile], Cause::Profile),
        (vec![On::Stop, On::Disconnected, On::Running], Cause::Start),
    ];
    for (danger, cause) in dangers {
        let mut inputs = armed();
        assert!(after(&config, &inputs).is_armed(360 * MS));
        inputs.push((370, hand(370 * MS, false)));
        assert!(after(&config, &inputs).is_armed(370 * MS), "a push moves the arm");
        inputs.extend(danger.iter().map(|input| (380, *input)));
        inputs.extend((13..100).map(|i| (30 * i, hand(30 * i * MS, false))));
        let latch = after(&config, &inputs);
        assert_eq!((latch, latch.cause()), (Latch::Disarmed(cause), Some(cause)), "{danger:?}");
        // Let go and rested, the hand moves it again.
        inputs.extend((100..=110).map(|i| (30 * i, hand(30 * i * MS, true))));
        assert!(after(&config, &inputs).is_armed(3300 * MS), "{danger:?}");
    }
}

#[test]
fn values_that_are_not_renewed_disarm_when_their_time_is_over() {
    let config = LatchConfig::default();
    let mut latch = after(&config, &armed());
    assert_eq!(latch.deadline(), Some(460 * MS));
    assert!(latch.is_armed(459 * MS));
    assert!(!latch.is_armed(460 * MS), "also before anybody says what time it is");
    latch.on(460 * MS, On::Timeout, &config);
    assert_eq!(latch, Latch::Disarmed(Cause::OldValues));
    latch.on(500 * MS, hand(400 * MS, true), &config);
    assert_eq!(latch, Latch::Disarmed(Cause::OldValues), "old when they come");
}

#[test]
fn a_key_confirms_and_a_key_that_is_let_go_disarms() {
    let config = LatchConfig { confirm: true, ..LatchConfig::default() };
    let mut inputs = armed();
    assert!(matches!(after(&config, &inputs), Latch::Ready { cause: Cause::Start, .. }));
    inputs.push((361, On::Confirm));
    assert!(after(&config, &inputs).is_armed(361 * MS));
    let mut pushed = armed();
    pushed.extend([(361, hand(361 * MS, false)), (362, On::Confirm)]);
    assert_eq!(after(&config, &pushed), Latch::Disarmed(Cause::Start));

    let config = LatchConfig { hold_to_run: true, ..LatchConfig::default() };
    let held = |holds, at: u32| On::Hand { rests: false, holds, fresh_until: at * MS + FRESH };
    let mut inputs = armed();
    inputs.push((370, held(true, 370)));
    assert!(after(&config, &inputs).is_armed(370 * MS));
    inputs.extend([(380, held(false, 380)), (390, held(true, 390))]);
    assert_eq!(after(&config, &inputs), Latch::Disarmed(Cause::KeyReleased));
}

#[test]
fn the_end_comes_when_alter_is_over_or_its_time_is() {
    let config = LatchConfig::default();
    let end = |more: &[(u32, On)]| {
        let mut inputs = armed();
        inputs.push((400, On::End));
        inputs.extend(more);
        after(&config, &inputs)
    };
    assert_eq!(after(&config, &[(5, On::End)]), Latch::Ended, "nothing runs");
    assert_eq!(end(&[]), Latch::Ending { by: 1900 * MS });
    assert_eq!(end(&[(500, On::End), (600, hand(600 * MS, true))]), Latch::Ending { by: 1900 * MS });
    assert_eq!(end(&[(900, On::Disconnected)]), Latch::Ended);
    assert_eq!(end(&[(900, On::Silent)]), Latch::Ending { by: 1050 * MS });
    assert_eq!(end(&[(900, On::Silent), (1050, On::Timeout)]), Latch::Ended);
    assert_eq!(end(&[(1899, On::Timeout)]), Latch::Ending { by: 1900 * MS });
    assert_eq!(end(&[(1900, On::Timeout)]), Latch::Ended);
    // A stop before makes no difference.
    let mut inputs = armed();
    inputs.extend([(370, On::Stop), (380, On::End), (390, On::Disconnected)]);
    assert_eq!(after(&config, &inputs), Latch::Ended);
}
