//! The checks of a run, from its steps and the record of the parts: every part in its place, no step skipped.

use std::time::Duration;

use mmacell_task::Step;

use super::workpiece::{Outcome, Record};
use crate::io::samples::Samples;

/// The end of an attempt to place a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    /// The part was placed.
    Placed,
    /// The attempt was given up, and another one begun.
    GivenUp,
    /// A fault broke the attempt off.
    Fault,
    /// The attempt was still going on when the run ended.
    Open,
}

/// The figures of a run.
#[derive(Debug, Default)]
pub struct RunFigures {
    /// The attempts to place a part.
    pub attempts: u64,
    /// The attempts that a fault broke off.
    pub broken_off: u64,
    /// The attempts whose steps were out of order.
    pub failures: Vec<String>,
    /// Parts that the task let go elsewhere than in their place, without a fault that made it close the valves.
    pub let_go_elsewhere: u64,
    /// The time of each part, from step 7 of its first attempt until it was placed.
    pub cycles: Samples,
}

impl RunFigures {
    /// Judges a run by its steps, each with the time at which it began.
    pub fn of(steps: &[(Duration, Step)], record: &Record) -> Self {
        let mut judged = Self::default();
        for (numbers, end) in attempts(steps.iter().map(|(_, step)| *step)) {
            judged.attempts += 1;
            judged.broken_off += u64::from(end == End::Fault);
            if !is_in_order(&numbers, end) {
                let number = judged.attempts;
                judged
                    .failures
                    .push(format!("attempt {number}: steps out of order: {numbers:?}, ended {end:?}"));
            }
        }
        let mut begun = None;
        for (at, step) in steps {
            match step {
                Step::GoCamera1 => begun = begun.or(Some(*at)),
                Step::Placed => begun.take().into_iter().for_each(|begun| judged.cycles.add(*at - begun)),
                _ => {}
            }
        }
        for (at, outcome) in &record.outcomes {
            let before = steps.partition_point(|(begin, _)| begin <= at).checked_sub(1);
            let step = before.and_then(|last| steps.get(last)).map(|(_, step)| *step);
            let by_fault = matches!(step, Some(Step::Faulted | Step::Resetting));
            judged.let_go_elsewhere += u64::from(*outcome == Outcome::Dropped && !by_fault);
        }
        judged
    }
}

/// Returns the attempts of a run, each from step 7 on: the numbers of its steps, and its end.
fn attempts(steps: impl Iterator<Item = Step>) -> Vec<(Vec<u8>, End)> {
    let mut attempts: Vec<(Vec<u8>, End)> = Vec::new();
    for step in steps {
        if step == Step::GoCamera1 {
            attempts.push((Vec::new(), End::Open));
        }
        let Some((numbers, end)) = attempts.last_mut().filter(|(_, end)| *end == End::Open) else { continue };
        // Steps 18 and 21 have several parts.
        numbers.extend(step.number().filter(|number| numbers.last() != Some(number)));
        match step {
            Step::Placed => *end = End::Placed,
            Step::GiveUp => *end = End::GivenUp,
            Step::Faulted => *end = End::Fault,
            _ => {}
        }
    }
    attempts
}

/// Returns whether an attempt went through the steps of §6 in sequence, which are repeated here: 7 to 16, 17 if the switch
/// went high on the way, 18, and then 19 and 21, or 20 with or without 19. A fault may end the attempt anywhere.
fn is_in_order(numbers: &[u8], end: End) -> bool {
    let Some((first, rest)) = numbers.split_at_checked(10) else {
        return matches!(end, End::Fault | End::Open)
            && (7..=16).take(numbers.len()).eq(numbers.iter().copied());
    };
    let rest = rest.strip_prefix(&[17]).unwrap_or(rest);
    let good = match end {
        End::Placed => rest == [18, 19, 21],
        End::GivenUp => rest == [18, 20] || rest == [18, 19, 20],
        End::Fault | End::Open => [18, 19, 21].starts_with(rest) || rest == [18, 20] || rest == [18, 19, 20],
    };
    good && (7..=16).eq(first.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skipped_or_repeated_step_is_seen() {
        let placed: Vec<u8> = (7..=19).chain([21]).collect();
        assert!(is_in_order(&placed, End::Placed));
        assert!(!is_in_order(&placed, End::GivenUp));
        for at in 0..placed.len() {
            let mut skipped = placed.clone();
            let number = skipped.remove(at);
            assert_eq!(is_in_order(&skipped, End::Placed), number == 17, "without {number}");
            let mut repeated = placed.clone();
            repeated.insert(at, number);
            assert!(!is_in_order(&repeated, End::Placed), "{number} twice");
            assert!(is_in_order(&placed[..at], End::Fault), "up to {number}");
        }
        assert!(is_in_order(&[7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 20], End::GivenUp));
        assert!(!is_in_order(&[7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 18, 19], End::GivenUp));
        assert!(!is_in_order(&[7, 9], End::Fault));
    }

    #[test]
    fn a_part_that_is_let_go_in_the_wrong_place_is_counted_unless_a_fault_closed_the_valves() {
        let at = Duration::from_secs;
        let record = Record { outcomes: vec![(at(3), Outcome::Dropped)], ..Record::default() };
        let mut steps = vec![(at(1), Step::AwaitPlace), (at(2), Step::Release), (at(4), Step::Blow)];
        assert_eq!(RunFigures::of(&steps, &record).let_go_elsewhere, 1);
        steps.insert(2, (at(2), Step::Faulted));
        assert_eq!(RunFigures::of(&steps, &record).let_go_elsewhere, 0);
    }
}
