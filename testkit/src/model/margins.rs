//! The tolerance of assumptions about time: the real time moves away from the assumed one until a property breaks.

use core::fmt;
use core::time::Duration;

use super::explore::Options;
use super::pair::Setting;

/// An assumption of an end about time.
#[derive(Debug)]
pub struct Margin {
    /// The end: `val2-alter host`.
    pub end: &'static str,
    /// The setting of the assumption, or the value in place of a setting.
    pub setting: &'static str,
    /// The real time that is longer than assumed, and where.
    pub real: &'static str,
    /// From steps that meet the assumption to steps that do not.
    pub steps: Vec<Step>,
}

/// Returns the property that breaks, if any.
type Check = Box<dyn Fn(&Options<'_>) -> Option<String> + Send + Sync>;

/// A pair of the assumed and the real time.
pub struct Step {
    /// The assumed time.
    pub assumed: Duration,
    /// The real time.
    pub real: Duration,
    check: Check,
}

/// The result of a [`Margin`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MarginResult {
    /// The last step in which everything holds: the assumed and the real time.
    pub holds: Option<(Duration, Duration)>,
    /// The first step in which something breaks: the assumed and the real time, and the property.
    pub breaks: Option<(Duration, Duration, String)>,
}

impl Step {
    /// Returns a step with its check, which returns the property that breaks, if any.
    pub fn new(
        assumed: Duration,
        real: Duration,
        check: impl Fn() -> Option<&'static str> + Send + Sync + 'static,
    ) -> Self {
        Self { assumed, real, check: Box::new(move |_| check().map(str::to_owned)) }
    }

    /// Returns a step whose system is explored: the property with the shortest trace breaks first.
    pub fn model(assumed: Duration, real: Duration, setting: Setting) -> Self {
        let check = move |options: &Options<'_>| {
            let explored = setting.explore(options);
            assert!(explored.complete, "{}: there are more states than were visited", setting.name);
            explored.broken.first().map(|broken| broken.property.to_owned())
        };
        Self { assumed, real, check: Box::new(check) }
    }
}

impl fmt::Debug for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Step").field(&self.assumed).field(&self.real).finish()
    }
}

impl Margin {
    /// Returns the margin whose real times go from half of the assumed one to twice that.
    pub fn around(
        [end, setting, real]: [&'static str; 3],
        assumed: Duration,
        check: fn(Duration) -> Option<&'static str>,
    ) -> Self {
        const MS: Duration = Duration::from_millis(1);
        let reals = [assumed / 2, assumed - MS / 10, assumed, assumed + MS / 10, assumed + MS, assumed * 2];
        let step = |real| Step::new(assumed, real, move || check(real));
        Self { end, setting, real, steps: reals.map(step).into() }
    }

    /// Goes from step to step until something breaks.
    pub fn measure(&self, options: &Options<'_>) -> MarginResult {
        let mut measured = MarginResult { holds: None, breaks: None };
        for Step { assumed, real, check } in &self.steps {
            if let Some(property) = check(options) {
                measured.breaks = Some((*assumed, *real, property));
                break;
            }
            measured.holds = Some((*assumed, *real));
        }
        measured
    }
}

impl MarginResult {
    /// Returns whether no property breaks while the assumption is met.
    pub fn is_kept(&self) -> bool {
        self.holds.is_some() && self.breaks.as_ref().is_none_or(|(assumed, real, _)| real >= assumed)
    }

    /// Returns the number of milliseconds by which the real time may be above the assumed one.
    pub fn margin(&self) -> Option<f64> {
        self.holds.map(|(assumed, real)| (real.as_secs_f64() - assumed.as_secs_f64()) * 1e3)
    }
}
