//! The demands of a hand on the ball, beside the values that the limits let through.

use std::time::Duration;

use val2_alter::{AXES, Accumulation};

use crate::devices::val2_alter::judge::{Extremes, less};

/// One reply of the host.
#[derive(Debug, Clone, Copy)]
pub struct Cycle {
    /// The time at which the reply left.
    pub at: Duration,
    /// The number of the ALTER, from 1.
    pub session: u32,
    /// The number of cycles for which the arm has been at rest by then, without a good reply: after such a cycle it begins from
    /// rest.
    pub stood: u64,
    /// Whether the robot's subroutine runs: it has stopped the arm, and the reply moves nothing.
    pub interrupted: bool,
    /// The demand of the ball, in units a cycle.
    pub demand: [i16; AXES],
    /// The demand within the limits, as it was sent.
    pub values: [i16; AXES],
}

/// The replies of the host.
#[derive(Debug)]
pub struct Cycles {
    accumulation: Accumulation,
    all: Vec<Cycle>,
}

impl Default for Cycles {
    fn default() -> Self {
        Self::new(Accumulation::Cumulative)
    }
}

impl Cycles {
    /// Creates a record without replies.
    pub fn new(accumulation: Accumulation) -> Self {
        Self { accumulation, all: Vec::new() }
    }

    /// Adds the next reply.
    pub fn add(&mut self, cycle: Cycle) {
        self.all.push(cycle);
    }

    /// Called when the robot has rejected the last reply.
    pub fn reject(&mut self) {
        self.all.pop();
    }

    /// Returns the replies with speeds in units per cycle: cumulative values are speeds, non-cumulative ones are offsets
    /// that begin at zero.
    pub fn speeds(&self) -> Vec<Cycle> {
        let mut speeds = self.all.clone();
        if self.accumulation == Accumulation::Cumulative {
            return speeds;
        }
        let mut last: Option<Cycle> = None;
        for cycle in &mut speeds {
            let here = *cycle;
            if let Some(last) = last.filter(|last| last.session == here.session) {
                cycle.demand = less(here.demand, last.demand);
                cycle.values = less(here.values, last.values);
            }
            last = Some(here);
        }
        speeds
    }

    /// Returns the maximum of the commanded values, and of their changes from cycle to cycle of one ALTER.
    pub fn asked(&self) -> Extremes {
        let mut asked = Extremes::default();
        for pair in self.speeds().windows(2) {
            if let [before, after] = pair
                && before.session == after.session
            {
                asked.add(before.demand, after.demand);
            }
        }
        asked
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn offsets_become_speeds_from_the_path_on() {
        let cycle = |session, x| Cycle {
            at: Duration::ZERO,
            session,
            stood: 0,
            interrupted: false,
            demand: [2 * x, 0, 0, 0, 0, 0],
            values: [x, 0, 0, 0, 0, 0],
        };
        let cycles = [cycle(1, 10), cycle(1, 30), cycle(1, 40), cycle(2, -10)];
        let x = |cycles: Vec<Cycle>| cycles.iter().map(|c| (c.demand[0], c.values[0])).collect::<Vec<_>>();
        let all = |accumulation| {
            let mut all = Cycles::new(accumulation);
            cycles.iter().for_each(|cycle| all.add(*cycle));
            all
        };
        let speeds_of = |accumulation| x(all(accumulation).speeds());
        assert_eq!(speeds_of(Accumulation::NonCumulative), [(20, 10), (40, 20), (20, 10), (-20, -10)]);
        assert_eq!(speeds_of(Accumulation::Cumulative), x(cycles.to_vec()));
        let asked = |accumulation| {
            let Extremes { velocity, acceleration } = all(accumulation).asked();
            (velocity[0], acceleration[0])
        };
        assert_eq!(asked(Accumulation::NonCumulative), (40, 20));
        assert_eq!(asked(Accumulation::Cumulative), (80, 40));
    }
}
