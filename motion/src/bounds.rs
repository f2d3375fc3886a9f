//! The confidence of a comparison's figures.

use super::evaluate::{Deviation, State};

/// The bounds within which a share of 95 % of the results of other stretches of the same motion lie.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Bounds {
    /// The least value, in the unit of the figure.
    pub low: f64,
    /// The greatest value, in the unit of the figure.
    pub high: f64,
}

/// The bounds of a comparison's delay and of the root mean squares of its deviations.
///
/// A bootstrap: the comparison is divided into blocks that are long enough to be nearly independent, and computed
/// again of blocks drawn at random. An error that is in all of them alike, such as a wrong tool frame, is not in the
/// bounds.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Confidence {
    /// The bounds of the delay, in s: how far the true one may be from the one that was found.
    pub delay: Bounds,
    /// The bounds of the position's error, in mm.
    pub position: Bounds,
    /// The bounds of the orientation's error, in degrees.
    pub rotation: Bounds,
    /// The bounds of the velocity's error, in mm/s.
    pub velocity: Bounds,
    /// The bounds of the angular velocity's error, in degrees a second.
    pub angular_velocity: Bounds,
}

impl Confidence {
    /// The length of a block, in s.
    pub const BLOCK: f64 = 0.25;
    /// Fewer blocks are not significant.
    pub const LEAST_BLOCKS: usize = 8;
    const DRAWS: usize = 1000;

    /// Returns the bounds of deviations and of the recorded states to which they belong, in the order of their times. `None`
    /// if there are too few.
    pub fn of(compared: &[(Deviation, State)]) -> Option<Self> {
        let mut blocks: Vec<Sums> = Vec::new();
        let mut end = f64::NEG_INFINITY;
        for (deviation, state) in compared {
            if deviation.time >= end {
                end = deviation.time + Self::BLOCK;
                blocks.push(Sums::default());
            }
            if let Some(block) = blocks.last_mut() {
                block.add(deviation, state);
            }
        }
        if blocks.len() < Self::LEAST_BLOCKS {
            return None;
        }
        let mut rng = fastrand::Rng::with_seed(1);
        let mut draws: [Vec<f64>; 5] = Default::default();
        for _ in 0..Self::DRAWS {
            let mut drawn = Sums::default();
            for _ in 0..blocks.len() {
                if let Some(block) = blocks.get(rng.usize(..blocks.len())) {
                    drawn.merge(block);
                }
            }
            for (values, value) in draws.iter_mut().zip(drawn.figures()) {
                values.push(value);
            }
        }
        let [delay, position, rotation, velocity, angular_velocity] = draws.map(|mut values| {
            values.sort_by(f64::total_cmp);
            let at = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
            Bounds { low: at(Self::DRAWS / 40), high: at(Self::DRAWS - 1 - Self::DRAWS / 40) }
        });
        Some(Self { delay, position, rotation, velocity, angular_velocity })
    }
}

/// The contribution of a block to the figures.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: f64,
    squares: [f64; 4],
    /// Of the deviation times the speed, and of the speed squared: an error of the delay moves a state in proportion to its
    /// speed.
    moved: f64,
    speed: f64,
}

impl Sums {
    fn add(&mut self, deviation: &Deviation, state: &State) {
        let parts = [deviation.position, deviation.rotation, deviation.velocity, deviation.angular_velocity];
        self.count += 1.0;
        for (square, part) in self.squares.iter_mut().zip(parts) {
            *square += dot(part, part);
        }
        self.moved +=
            dot(deviation.position, state.velocity) + dot(deviation.rotation, state.angular_velocity);
        self.speed +=
            dot(state.velocity, state.velocity) + dot(state.angular_velocity, state.angular_velocity);
    }

    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.squares.iter_mut().zip(other.squares).for_each(|(mine, theirs)| *mine += theirs);
        self.moved += other.moved;
        self.speed += other.speed;
    }

    /// Returns the error of the delay that fits these blocks best, then the root mean squares.
    fn figures(&self) -> [f64; 5] {
        let delay = if self.speed > 0.0 { -self.moved / self.speed } else { 0.0 };
        let [position, rotation, velocity, angular] = self.squares.map(|square| (square / self.count).sqrt());
        [delay, position, rotation, velocity, angular]
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
