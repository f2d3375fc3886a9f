//! What a run comes to, judged while it goes on: a run of a day keeps no more than its last attempts.

use std::time::Duration;

use mmacell_task::Step;

use super::central::Log;
use super::timeline::Shown;
use super::verdict::{End, attempts, is_in_order, leaves_open};
use super::workpiece::{Outcome, Record};
use crate::io::samples::Samples;

/// With this many steps, those of attempts that have ended are judged and forgotten.
pub const MOST_STEPS: usize = 4096;

/// How many attempts that went wrong are reported in words.
const MOST_FAILURES: usize = 20;

/// What has been judged so far.
#[derive(Debug, Default)]
pub struct Judged {
    /// Attempts.
    pub attempts: u64,
    /// Those that a fault broke off.
    pub broken_off: u64,
    /// Those after which the part may be in its place or not.
    pub open: u64,
    /// Attempts whose steps were out of order: the first ones in words, and how many there were.
    pub failures: (Vec<String>, u64),
    /// Parts that the task let go elsewhere than in their place, without a fault that made it close the valves.
    pub let_go_elsewhere: u64,
    /// The time of each part, from step 7 of its first attempt until it was placed.
    pub cycles: Samples,
    /// How long each step of the cycle took.
    pub steps: Vec<(Step, Samples)>,
    /// When the part that is under way began.
    begun: Option<Duration>,
    /// The beginning of the run, for the picture.
    shown: Option<Shown>,
}

impl Judged {
    /// Judges and forgets attempts that have ended, when there are many.
    pub fn go_on(&mut self, log: &mut Log, record: &mut Record) {
        if log.steps.len() >= MOST_STEPS {
            // Not the last attempt that has ended: what became of its part may be noted a little later.
            let begins = (0..).zip(&log.steps).filter(|(_, (_, step))| *step == Step::GoCamera1);
            let begins: Vec<usize> = begins.map(|(at, _)| at).collect();
            let last = begins.iter().rev().nth(1).copied().filter(|at| *at > 0);
            self.judge(last.unwrap_or(MOST_STEPS / 2), log, record);
        }
    }

    /// Judges the rest; the picture's part of the run.
    pub fn finish(&mut self, log: &mut Log, record: &mut Record) -> Shown {
        self.judge(log.steps.len(), log, record);
        self.shown.take().unwrap_or_default()
    }

    /// Judges and forgets this many steps, and what happened in their time.
    fn judge(&mut self, count: usize, log: &mut Log, record: &mut Record) {
        self.shown.get_or_insert_with(|| Shown::of(log, record));
        let end = log.steps.get(count).map_or(Duration::MAX, |(at, _)| *at);
        self.measure(log.steps.get(..=count).unwrap_or(&log.steps));
        let steps = log.steps.get(..count).unwrap_or(&log.steps);
        for (numbers, end) in attempts(steps.iter().map(|(_, step)| *step)) {
            self.attempts += 1;
            self.broken_off += u64::from(end == End::Fault);
            self.open += u64::from(leaves_open(&numbers, end));
            if !is_in_order(&numbers, end) {
                let (words, count) = &mut self.failures;
                *count += 1;
                if words.len() < MOST_FAILURES {
                    let number = self.attempts;
                    words.push(format!("attempt {number}: steps out of order: {numbers:?}, ended {end:?}"));
                }
            }
        }
        for (at, step) in steps {
            match step {
                Step::GoCamera1 => self.begun = self.begun.or(Some(*at)),
                Step::Placed => self.begun.take().into_iter().for_each(|begun| self.cycles.add(*at - begun)),
                _ => {}
            }
        }
        let step = |at: Duration| steps.iter().rev().find(|(begin, _)| *begin <= at).map(|(_, step)| *step);
        let count_outcomes = record.outcomes.partition_point(|(at, _)| *at < end);
        for (at, outcome) in record.outcomes.drain(..count_outcomes) {
            let by_fault = matches!(step(at), Some(Step::Faulted | Step::Resetting));
            self.let_go_elsewhere += u64::from(outcome == Outcome::Dropped && !by_fault);
        }
        for levels in [&mut record.vacuum, &mut record.blow, &mut record.switch] {
            // The last one is what holds.
            let past = levels.partition_point(|(at, _)| *at < end).min(levels.len().saturating_sub(1));
            levels.drain(..past);
        }
        log.steps.drain(..count.min(log.steps.len()));
    }

    /// How long each step of the cycle took.
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
