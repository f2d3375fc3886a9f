//! What was asked for, and what the limits made of it.

use std::time::Duration;

use val2_alter::{AXES, Accumulation};

use crate::devices::val2_alter::judge::{Extremes, less};

/// One reply of the host.
#[derive(Debug, Clone, Copy)]
pub struct Cycle {
    /// When it left.
    pub at: Duration,
    /// The how many-th ALTER, from 1.
    pub session: u32,
    /// How many cycles it has been at rest by then, without a good reply: after such a cycle the arm begins from rest.
    pub stood: u64,
    /// The robot's subroutine runs: it has stopped the arm, and the reply moves nothing.
    pub interrupted: bool,
    /// What the ball asked for, in units a cycle.
    pub demand: [i16; AXES],
    /// What the limits made of it.
    pub values: [i16; AXES],
}

/// The replies of the host: the last of them, and the most that was ever asked for. A day has three million.
#[derive(Debug)]
pub struct Cycles {
    accumulation: Accumulation,
    kept: Vec<Cycle>,
    /// Of the steps to all but the last of those that are gone.
    asked: Extremes,
    /// Whether the first that is kept was a last one before: it is there for the step from it.
    goes_on: bool,
}

impl Default for Cycles {
    fn default() -> Self {
        Self::new(Accumulation::Cumulative)
    }
}

impl Cycles {
    /// At least this many are kept, nine minutes.
    const KEPT: usize = 20_000;

    /// None yet.
    pub fn new(accumulation: Accumulation) -> Self {
        Self { accumulation, kept: Vec::new(), asked: Extremes::default(), goes_on: false }
    }

    /// The next reply.
    pub fn add(&mut self, cycle: Cycle) {
        self.kept.push(cycle);
        if self.kept.len() == 2 * Self::KEPT {
            let rest = self.kept.split_off(Self::KEPT - 1);
            self.kept.extend(rest.get(..2).unwrap_or_default());
            self.asked = self.asked();
            (self.kept, self.goes_on) = (rest, true);
        }
    }

    /// The robot has rejected the last one.
    pub fn reject(&mut self) {
        self.kept.pop();
    }

    /// The last ones, with speeds.
    pub fn last(&self) -> Vec<Cycle> {
        let mut speeds = speeds(&self.kept, self.accumulation);
        if self.goes_on {
            speeds.remove(0);
        }
        speeds
    }

    /// The most that was asked for, from cycle to cycle of one ALTER.
    pub fn asked(&self) -> Extremes {
        let mut asked = self.asked;
        for pair in self.last().windows(2) {
            if let [before, after] = pair
                && before.session == after.session
            {
                asked.add(before.demand, after.demand);
            }
        }
        asked
    }
}

/// The cycles with speeds in units a cycle: cumulative values are speeds, non-cumulative ones are offsets that begin at zero.
fn speeds(cycles: &[Cycle], accumulation: Accumulation) -> Vec<Cycle> {
    let mut speeds = cycles.to_vec();
    if accumulation == Accumulation::Cumulative {
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
        let speeds_of = |accumulation| x(speeds(&cycles, accumulation));
        assert_eq!(speeds_of(Accumulation::NonCumulative), [(20, 10), (40, 20), (20, 10), (-20, -10)]);
        assert_eq!(speeds_of(Accumulation::Cumulative), x(cycles.to_vec()));
    }

    #[test]
    fn what_is_gone_was_judged() {
        const K: usize = Cycles::KEPT;
        let mut rng = fastrand::Rng::with_seed(1);
        let modes = [Accumulation::Cumulative, Accumulation::NonCumulative];
        // The greatest step is where the first block is cut, or anywhere.
        let places = [K - 2, K - 1, K, K + 1, K + 2, 2 * K, 3 * K, rng.usize(..4 * K)];
        for (accumulation, greatest) in modes.into_iter().flat_map(|mode| places.map(|place| (mode, place))) {
            let (mut cycles, mut all) = (Cycles::new(accumulation), Vec::new());
            for n in 0..4 * K {
                let demand = [rng.i16(-9..9) + if n == greatest { 99 } else { 0 }; AXES];
                let session = if n < 10 { 1 } else { 2 };
                let (at, stood, interrupted, values) = (Duration::ZERO, 0, false, demand);
                let cycle = Cycle { at, session, stood, interrupted, demand, values };
                cycles.add(cycle);
                all.push(cycle);
                if n > 2 * K + 9 && rng.u8(..) == 0 {
                    cycles.reject();
                    all.pop();
                }
            }
            let mut asked = Extremes::default();
            for pair in speeds(&all, accumulation).windows(2) {
                if pair[0].session == pair[1].session {
                    asked.add(pair[0].demand, pair[1].demand);
                }
            }
            assert_eq!(cycles.asked(), asked, "{greatest}");
            assert!((K - 10..2 * K).contains(&cycles.last().len()));
        }
    }
}
