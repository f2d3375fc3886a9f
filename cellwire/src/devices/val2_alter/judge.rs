//! Whether the replies that the robot took kept the limits.

use val2_alter::{AXES, Accumulation, Limits};

/// A reply as it arrived.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReceivedReply {
    /// The how many-th ALTER it belongs to, from 1.
    pub session: u64,
    /// The how many-th cycle of the robot it answers.
    pub cycle: u64,
    /// The values of the reply.
    pub values: [i16; AXES],
}

/// The replies as the robot took them, judged as they come. Each ALTER begins from rest, and the arm stops if a reply is
/// missing: the replies after the gap begin from rest too.
#[derive(Debug, Clone, Default)]
pub struct Judge {
    /// The last reply, and its speeds.
    last: Option<(ReceivedReply, [i16; AXES])>,
    /// The most that was seen of the speeds.
    pub extremes: Extremes,
}

impl Judge {
    /// Adds the next reply.
    pub fn add(&mut self, taken: ReceivedReply, accumulation: Accumulation) {
        let before = self.last.filter(|(last, _)| last.session == taken.session);
        let speeds = match (accumulation, before) {
            (Accumulation::NonCumulative, Some((last, _))) => less(taken.values, last.values),
            _ => taken.values,
        };
        let moving = before.filter(|(last, _)| last.cycle + 1 == taken.cycle);
        self.extremes.add(moving.map_or([0; AXES], |(_, speeds)| speeds), speeds);
        self.last = Some((taken, speeds));
    }
}

/// The maximum observed, for each axis separately, in units of its words.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Extremes {
    /// The greatest step of a cycle, in units.
    pub velocity: [u32; AXES],
    /// The greatest change of the step from one cycle to the next, in units.
    pub acceleration: [u32; AXES],
}

impl Extremes {
    /// Adds one step from values to values.
    pub fn add(&mut self, before: [i16; AXES], values: [i16; AXES]) {
        let most = self.velocity.iter_mut().zip(&mut self.acceleration);
        for ((velocity, acceleration), (before, value)) in most.zip(before.into_iter().zip(values)) {
            *velocity = (*velocity).max(value.unsigned_abs().into());
            *acceleration = (*acceleration).max((i32::from(value) - i32::from(before)).unsigned_abs());
        }
    }

    /// Returns whether all axes stayed within their limits.
    pub fn keeps(&self, limits: &Limits) -> bool {
        let within = |seen: &[u32; AXES], most: &[u16; AXES]| {
            seen.iter().zip(most).all(|(seen, most)| *seen <= u32::from(*most))
        };
        within(&self.velocity, &limits.velocity) && within(&self.acceleration, &limits.acceleration)
    }
}

/// Offsets less the offsets before them.
pub fn less(values: [i16; AXES], offsets: [i16; AXES]) -> [i16; AXES] {
    let mut speeds = values;
    for (speed, offset) in speeds.iter_mut().zip(offsets) {
        *speed = speed.saturating_sub(offset);
    }
    speeds
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(session: u64, cycle: u64, x: i16) -> ReceivedReply {
        ReceivedReply { session, cycle, values: [x, 0, 0, 0, 0, 0] }
    }

    fn extremes(replies: &[ReceivedReply], accumulation: Accumulation) -> Extremes {
        let mut judge = Judge::default();
        replies.iter().for_each(|taken| judge.add(*taken, accumulation));
        judge.extremes
    }

    fn keeps(replies: &[ReceivedReply]) -> bool {
        extremes(replies, Accumulation::Cumulative).keeps(&LIMITS)
    }

    const LIMITS: Limits = Limits { velocity: [20; AXES], acceleration: [10; AXES] };

    #[test]
    fn a_step_beyond_the_limit_is_seen() {
        let good = [taken(1, 1, 10), taken(1, 2, 20), taken(1, 3, 10), taken(1, 4, 0), taken(1, 5, -10)];
        assert!(keeps(&good));
        assert_eq!(extremes(&good, Accumulation::Cumulative).acceleration[0], 10);
        assert!(!keeps(&[taken(1, 1, 11)]), "from rest");
        assert!(!keeps(&[taken(1, 1, 10), taken(1, 2, -1)]), "letting go");
        let fast = [taken(1, 1, 10), taken(1, 2, 20), taken(1, 3, 21)];
        assert!(!keeps(&fast), "velocity");
    }

    #[test]
    fn offsets_become_speeds_from_the_path_on() {
        let offsets = [taken(1, 1, 10), taken(1, 2, 30), taken(1, 4, 40), taken(2, 5, -10)];
        let seen = extremes(&offsets, Accumulation::NonCumulative);
        assert_eq!((seen.velocity[0], seen.acceleration[0]), (20, 10));
        assert_eq!(extremes(&offsets, Accumulation::Cumulative).velocity[0], 40);
    }

    #[test]
    fn behind_a_gap_the_arm_begins_from_rest() {
        assert!(!keeps(&[taken(1, 1, 10), taken(1, 3, 20)]), "a reply was missing");
        assert!(!keeps(&[taken(1, 1, 10), taken(2, 2, 20)]), "another session");
        assert!(keeps(&[taken(1, 1, 10), taken(1, 3, 10), taken(2, 4, -10)]));
    }
}
