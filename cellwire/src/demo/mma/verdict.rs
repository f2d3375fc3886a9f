//! The checks of a run: every part in its place, no step skipped, the vacuum never left on.

use mmacell_task::Step;

/// The attempts of a run, by the numbers of their steps, and how each ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The part was placed.
    Placed,
    /// The attempt was given up, and another one begun.
    GivenUp,
    /// A fault broke the attempt off.
    Fault,
    /// The attempt was still going on when the run ended.
    Open,
}

/// Cuts a run into attempts, each from step 7 on.
pub fn attempts(steps: impl Iterator<Item = Step>) -> Vec<(Vec<u8>, End)> {
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
pub fn is_in_order(numbers: &[u8], end: End) -> bool {
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

/// Returns whether a fault at this step leaves the fate of the part open: still placed, or taken home with the gripper.
pub fn leaves_open(numbers: &[u8], end: End) -> bool {
    end == End::Fault && matches!(numbers.last(), Some(19 | 21))
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
}
