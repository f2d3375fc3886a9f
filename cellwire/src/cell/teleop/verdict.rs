//! Whether the recorded values kept the limits.

use val2_alter::{AXES, Accumulation, Limits};

use super::cell::Cycle;
use crate::links::val2_alter::puma::Taken;

/// A record of values over a run of ALTER.
pub trait Recorded: Copy {
    /// Which ALTER it belongs to.
    fn session(&self) -> u64;
    /// The values that mean offsets in non-cumulative ALTER.
    fn values(&mut self) -> Vec<&mut [i16; AXES]>;
}

impl Recorded for Taken {
    fn session(&self) -> u64 {
        self.session
    }

    fn values(&mut self) -> Vec<&mut [i16; AXES]> {
        vec![&mut self.values]
    }
}

impl Recorded for Cycle {
    fn session(&self) -> u64 {
        self.session.into()
    }

    fn values(&mut self) -> Vec<&mut [i16; AXES]> {
        vec![&mut self.demand, &mut self.values]
    }
}

/// The records with speeds in units a cycle: cumulative values are speeds, non-cumulative ones are offsets that begin at zero.
pub fn speeds<R: Recorded>(records: &[R], accumulation: Accumulation) -> Vec<R> {
    let mut speeds = records.to_vec();
    if accumulation == Accumulation::Cumulative {
        return speeds;
    }
    let mut last: Option<R> = None;
    for record in &mut speeds {
        let here = *record;
        let mut before = last.filter(|last| last.session() == here.session());
        let before = before.as_mut().map(R::values).unwrap_or_default();
        let offsets = before.into_iter().map(|values| *values).chain(core::iter::repeat([0; AXES]));
        for (values, offsets) in record.values().into_iter().zip(offsets) {
            for (value, offset) in values.iter_mut().zip(offsets) {
                *value = value.saturating_sub(offset);
            }
        }
        last = Some(here);
    }
    speeds
}

/// The most that was seen, each axis by itself, in units of its words.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Extremes {
    /// Units in a cycle.
    pub velocity: [u32; AXES],
    /// Units in a cycle, from one cycle to the next.
    pub acceleration: [u32; AXES],
}

impl Extremes {
    /// Of speeds as the robot took them. Each ALTER begins from rest, and the arm stands where a reply is missing: what
    /// comes after the gap begins from rest too.
    pub fn of(replies: &[Taken]) -> Self {
        let mut extremes = Self::default();
        let mut last: Option<&Taken> = None;
        for taken in replies {
            let follows = |last: &&Taken| last.session == taken.session && last.cycle + 1 == taken.cycle;
            let before = last.filter(follows).map_or([0; AXES], |last| last.values);
            extremes.add(before, taken.values);
            last = Some(taken);
        }
        extremes
    }

    /// One step from values to values.
    pub fn add(&mut self, before: [i16; AXES], values: [i16; AXES]) {
        let most = self.velocity.iter_mut().zip(&mut self.acceleration);
        for ((velocity, acceleration), (before, value)) in most.zip(before.into_iter().zip(values)) {
            *velocity = (*velocity).max(value.unsigned_abs().into());
            *acceleration = (*acceleration).max((i32::from(value) - i32::from(before)).unsigned_abs());
        }
    }

    /// Whether no axis went beyond its limits.
    pub fn keeps(&self, limits: &Limits) -> bool {
        let within = |seen: &[u32; AXES], most: &[u16; AXES]| {
            seen.iter().zip(most).all(|(seen, most)| *seen <= u32::from(*most))
        };
        within(&self.velocity, &limits.velocity) && within(&self.acceleration, &limits.acceleration)
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn taken(session: u64, cycle: u64, x: i16) -> Taken {
        Taken { at: Duration::ZERO, session, cycle, values: [x, 0, 0, 0, 0, 0] }
    }

    const LIMITS: Limits = Limits { velocity: [20; AXES], acceleration: [10; AXES] };

    #[test]
    fn a_step_beyond_the_limit_is_seen() {
        let good = [taken(1, 1, 10), taken(1, 2, 20), taken(1, 3, 10), taken(1, 4, 0), taken(1, 5, -10)];
        assert!(Extremes::of(&good).keeps(&LIMITS));
        assert_eq!(Extremes::of(&good).acceleration[0], 10);
        assert!(!Extremes::of(&[taken(1, 1, 11)]).keeps(&LIMITS), "from rest");
        assert!(!Extremes::of(&[taken(1, 1, 10), taken(1, 2, -1)]).keeps(&LIMITS), "letting go");
        let fast = [taken(1, 1, 10), taken(1, 2, 20), taken(1, 3, 21)];
        assert!(!Extremes::of(&fast).keeps(&LIMITS), "velocity");
    }

    #[test]
    fn offsets_become_speeds_from_the_path_on() {
        let offsets = [taken(1, 1, 10), taken(1, 2, 30), taken(1, 4, 40), taken(2, 5, -10)];
        let x = |taken: Vec<Taken>| taken.iter().map(|t| t.values[0]).collect::<Vec<_>>();
        assert_eq!(x(speeds(&offsets, Accumulation::NonCumulative)), [10, 20, 10, -10]);
        assert_eq!(x(speeds(&offsets, Accumulation::Cumulative)), [10, 30, 40, -10]);
    }

    #[test]
    fn behind_a_gap_the_arm_begins_from_rest() {
        assert!(!Extremes::of(&[taken(1, 1, 10), taken(1, 3, 20)]).keeps(&LIMITS), "a reply was missing");
        assert!(!Extremes::of(&[taken(1, 1, 10), taken(2, 2, 20)]).keeps(&LIMITS), "another session");
        assert!(Extremes::of(&[taken(1, 1, 10), taken(1, 3, 10), taken(2, 4, -10)]).keeps(&LIMITS));
    }
}
