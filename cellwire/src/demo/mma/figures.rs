//! The verdict on a run, from its steps and from the fate of the parts.

use std::time::Duration;

use mmacell_task::Step;

use super::central::Log;
use super::verdict::{End, attempts, is_in_order, leaves_open};
use super::workpiece::{Outcome, Record};
use crate::io::samples::Samples;

/// The figures of a run.
#[derive(Debug, Default)]
pub struct RunFigures {
    /// The attempts to place a part.
    pub attempts: u64,
    /// The attempts that a fault broke off.
    pub broken_off: u64,
    /// The attempts after which the part may be in its place or not.
    pub open: u64,
    /// The attempts whose steps were out of order.
    pub failures: Vec<String>,
    /// Parts that the task let go elsewhere than in their place, without a fault that made it close the valves.
    pub let_go_elsewhere: u64,
    /// The time of each part, from step 7 of its first attempt until it was placed.
    pub cycles: Samples,
    /// The duration of each step of the cycle.
    pub steps: Vec<(Step, Samples)>,
}

impl RunFigures {
    /// Judges a run.
    pub fn of(log: &Log, record: &Record) -> Self {
        let mut judged = Self::default();
        judged.measure(&log.steps);
        for (numbers, end) in attempts(log.steps.iter().map(|(_, step)| *step)) {
            judged.attempts += 1;
            judged.broken_off += u64::from(end == End::Fault);
            judged.open += u64::from(leaves_open(&numbers, end));
            if !is_in_order(&numbers, end) {
                let number = judged.attempts;
                judged
                    .failures
                    .push(format!("attempt {number}: steps out of order: {numbers:?}, ended {end:?}"));
            }
        }
        let mut begun = None;
        for (at, step) in &log.steps {
            match step {
                Step::GoCamera1 => begun = begun.or(Some(*at)),
                Step::Placed => begun.take().into_iter().for_each(|begun| judged.cycles.add(*at - begun)),
                _ => {}
            }
        }
        for (at, outcome) in &record.outcomes {
            let before = log.steps.partition_point(|(begin, _)| begin <= at).checked_sub(1);
            let step = before.and_then(|last| log.steps.get(last)).map(|(_, step)| *step);
            let by_fault = matches!(step, Some(Step::Faulted | Step::Resetting));
            judged.let_go_elsewhere += u64::from(*outcome == Outcome::Dropped && !by_fault);
        }
        judged
    }

    /// Measures the duration of each step of the cycle.
    fn measure(&mut self, steps: &[(Duration, Step)]) {
        for pair in steps.windows(2) {
            let [(begin, step), (end, _)] = pair else { continue };
            if step.number().is_none_or(|number| number < 7) && *step != Step::Resetting {
                continue;
            }
            match self.steps.iter_mut().find(|(known, _)| known == step) {
                Some((_, samples)) => samples.add(*end - *begin),
                None => {
                    let mut samples = Samples::default();
                    samples.add(*end - *begin);
                    self.steps.push((*step, samples));
                }
            }
        }
    }
}
