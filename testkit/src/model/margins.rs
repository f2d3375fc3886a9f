//! By how much an assumption about time may be wrong: what is assumed and what is real go apart until a property breaks.

use core::fmt;
use core::time::Duration;

use super::explore::Options;
use super::pair::Setting;

/// An assumption of an end about time.
#[derive(Debug)]
pub struct Margin {
    /// The end: `val2-alter host`.
    pub end: &'static str,
    /// Its setting, or what it has in its place.
    pub setting: &'static str,
    /// What is longer than is assumed, and where.
    pub real: &'static str,
    /// From what keeps the assumption to what does not.
    pub steps: Vec<Step>,
}

/// What breaks, if anything.
type Check = Box<dyn Fn(&Options<'_>) -> Option<String> + Send + Sync>;

/// One pair of what is assumed and what is real.
pub struct Step {
    /// What is assumed.
    pub assumed: Duration,
    /// What is real.
    pub real: Duration,
    check: Check,
}

/// What became of a [`Margin`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Measured {
    /// The last step in which everything holds: what is assumed, and what is real.
    pub holds: Option<(Duration, Duration)>,
    /// The first one in which something breaks, and what.
    pub breaks: Option<(Duration, Duration, String)>,
}

impl Step {
    /// A step, and what breaks in it, if anything.
    pub fn new(
        assumed: Duration,
        real: Duration,
        check: impl Fn() -> Option<&'static str> + Send + Sync + 'static,
    ) -> Self {
        Self { assumed, real, check: Box::new(move |_| check().map(str::to_owned)) }
    }

    /// A step whose system is explored: what breaks first is the property with the shortest trace.
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
    /// What is assumed is measured from half of it to twice.
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
    pub fn measure(&self, options: &Options<'_>) -> Measured {
        let mut measured = Measured { holds: None, breaks: None };
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

impl Measured {
    /// Whether nothing breaks where the assumption is kept.
    pub fn is_kept(&self) -> bool {
        self.holds.is_some() && self.breaks.as_ref().is_none_or(|(assumed, real, _)| real >= assumed)
    }

    /// By how many milliseconds the real time may be above the assumed one.
    pub fn margin(&self) -> Option<f64> {
        self.holds.map(|(assumed, real)| (real.as_secs_f64() - assumed.as_secs_f64()) * 1e3)
    }
}
