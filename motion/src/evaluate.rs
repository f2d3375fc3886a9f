//! Compares a recorded motion with the requested one: errors of position, orientation and their speeds, after the delay
//! between them has been found.
//!
//! The source found 4 mm at 100 mm/s, which is a delay of 40 ms: without the fit, an error shows more about the time than
//! about the position. Nothing is stored here: both motions are slices of the caller's.

use core::ops::RangeInclusive;

use libm::sqrt;

use super::orientation::Quaternion;
use super::tracker::MotionSample;

/// The motion at a time.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct State {
    /// The time on the motion's own clock, in s.
    pub time: f64,
    /// X, Y, Z in mm.
    pub position: [f64; 3],
    /// The tool's orientation in the world frame.
    pub orientation: Quaternion,
    /// The velocity of the tool along X, Y, Z, in mm/s.
    pub velocity: [f64; 3],
    /// The angular velocity about the world's axes, in degrees a second.
    pub angular_velocity: [f64; 3],
}

impl State {
    /// Creates a state at rest; [`differentiate`] gives it its speeds.
    pub fn at(time: f64, position: [f64; 3], orientation: Quaternion) -> Self {
        Self { time, position, orientation, velocity: [0.0; 3], angular_velocity: [0.0; 3] }
    }
}

impl From<&MotionSample> for State {
    /// Creates the state of a sample with the sample's speeds, which are those of the middle between it and the previous
    /// one.
    fn from(sample: &MotionSample) -> Self {
        Self {
            time: sample.time.as_secs_f64(),
            position: sample.position,
            orientation: sample.orientation,
            velocity: sample.velocity,
            angular_velocity: sample.angular_velocity_world,
        }
    }
}

/// Sets the speeds of states in the order of their times: from the previous to the next neighbour, so that they are
/// neither early nor late; at the ends from the only neighbour. Both motions must get theirs in the same way.
pub fn differentiate(states: &mut [State]) {
    let mut before: Option<State> = None;
    for index in 0..states.len() {
        let next = states.get(index + 1).copied();
        let Some(state) = states.get_mut(index) else { return };
        let here = *state;
        let (from, to) = (before.unwrap_or(here), next.unwrap_or(here));
        let seconds = to.time - from.time;
        if seconds > 0.0 {
            state.velocity = difference(to.position, from.position).map(|part| part / seconds);
            state.angular_velocity = from.orientation.rotation_to(to.orientation).map(|part| part / seconds);
        }
        before = Some(here);
    }
}

/// The error of the recording at one of its states: recorded minus requested.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Deviation {
    /// The time on the recording's clock, in s.
    pub time: f64,
    /// The error of X, Y, Z, in mm.
    pub position: [f64; 3],
    /// The rotation from the requested orientation to the recorded one: a rotation vector in degrees (footnote 5).
    pub rotation: [f64; 3],
    /// The error of the velocity along X, Y, Z, in mm/s.
    pub velocity: [f64; 3],
    /// The error of the angular velocity about the world's axes, in degrees a second.
    pub angular_velocity: [f64; 3],
}

/// Returns the deviation of each recorded state from the reference `delay` seconds earlier. Before its first state and after
/// its last, the reference rests there. No items if the reference is empty.
pub fn deviations<'a>(
    reference: &'a [State],
    recording: &'a [State],
    delay: f64,
) -> impl Iterator<Item = Deviation> + 'a {
    recording
        .iter()
        .filter_map(move |state| Some(deviation(state, &interpolate(reference, state.time - delay)?)))
}

/// Returns the deviations, at a delay of zero, of the states that are recorded while the reference lasts, and in which at
/// least one of the two moves, each with its state; and the number of states that are omitted because both are idle.
pub fn compare(reference: &[State], recording: &[State]) -> (Vec<(Deviation, State)>, u64) {
    let (Some(first), Some(last)) = (reference.first(), reference.last()) else { return (Vec::new(), 0) };
    let mut idle = 0;
    let compared = recording.iter().filter_map(|state| {
        let asked =
            interpolate(reference, state.time).filter(|_| (first.time..=last.time).contains(&state.time));
        match asked {
            Some(asked) if moving(state) || moving(&asked) => Some((deviation(state, &asked), *state)),
            _ => {
                idle += 1;
                None
            }
        }
    });
    (compared.collect(), idle)
}

fn deviation(state: &State, asked: &State) -> Deviation {
    Deviation {
        time: state.time,
        position: difference(state.position, asked.position),
        rotation: asked.orientation.rotation_to(state.orientation),
        velocity: difference(state.velocity, asked.velocity),
        angular_velocity: difference(state.angular_velocity, asked.angular_velocity),
    }
}

/// The result of [`fit_delay`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Delay {
    /// The delay with the least squares, in seconds.
    Found(f64),
    /// The least squares are at the border of the range, here: the delay is not within it, or the motions have nothing in common.
    AtBorder(f64),
}

/// Finds the delay, within `range` in seconds, with the least squares of position (mm) and orientation (degrees). The delay
/// includes the offset between the two clocks. Only recorded states that are [`moving`] count, since the others do not show
/// the time.
///
/// Searches the range in steps of `step` seconds, then closer around the best: a step of a tenth of the time in which the
/// motion turns back finds the right valley. `None` if a motion is empty or at rest, or if the range is empty or has more
/// than a million steps.
pub fn fit_delay(
    reference: &[State],
    recording: &[State],
    range: RangeInclusive<f64>,
    step: f64,
) -> Option<Delay> {
    let (first, last) = range.into_inner();
    let valid = first.is_finite() && first <= last && step > 0.0 && (last - first) / step <= MAX_STEPS;
    let moved: Vec<State> = recording.iter().filter(|state| moving(state)).copied().collect();
    if reference.is_empty() || moved.is_empty() || !valid {
        return None;
    }
    let cost = |delay: f64| -> f64 {
        deviations(reference, &moved, delay).map(|d| square(d.position) + square(d.rotation)).sum()
    };
    let (mut best, mut least) = (first, cost(first));
    let mut count = 1.0;
    while first + count * step <= last {
        let delay = first + count * step;
        let found = cost(delay);
        if found < least {
            (best, least) = (delay, found);
        }
        count += 1.0;
    }
    let (low, high) = ((best - step).max(first), (best + step).min(last));
    let found = golden_section(low, high, cost);
    // The search ends within a microsecond or so.
    let is_border = found - first < 1e-5 || last - found < 1e-5;
    Some(if is_border { Delay::AtBorder(found) } else { Delay::Found(found) })
}

const MAX_STEPS: f64 = 1e6;

/// Returns whether a state moves: above 1 mm/s or 0.2°/s, which the noise of a robot at rest does not reach.
pub fn moving(state: &State) -> bool {
    square(state.velocity) > 1.0 || square(state.angular_velocity) > 0.2 * 0.2
}

/// The greatest and the root mean square of the deviations.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Summary {
    /// The number of compared states.
    pub count: u64,
    /// The figures of the position's norm, in mm.
    pub position: Figures,
    /// The figures of the rotation's angle, in degrees.
    pub rotation: Figures,
    /// The figures of the velocity's norm, in mm/s.
    pub velocity: Figures,
    /// The figures of the angular velocity's norm, in degrees a second.
    pub angular_velocity: Figures,
}

/// The greatest and the root mean square of a deviation.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct Figures {
    /// The greatest value, 0 without any.
    pub max: f64,
    /// The root mean square of the values, 0 without any.
    pub rms: f64,
}

impl FromIterator<Deviation> for Summary {
    fn from_iter<I: IntoIterator<Item = Deviation>>(deviations: I) -> Self {
        let mut summary = Self::default();
        let mut count = 0.0;
        for deviation in deviations {
            summary.count += 1;
            count += 1.0;
            let parts =
                [deviation.position, deviation.rotation, deviation.velocity, deviation.angular_velocity];
            for (figures, part) in summary.figures().into_iter().zip(parts) {
                figures.max = figures.max.max(sqrt(square(part)));
                figures.rms += square(part);
            }
        }
        if count > 0.0 {
            summary.figures().into_iter().for_each(|figures| figures.rms = sqrt(figures.rms / count));
        }
        summary
    }
}

impl Summary {
    fn figures(&mut self) -> [&mut Figures; 4] {
        [&mut self.position, &mut self.rotation, &mut self.velocity, &mut self.angular_velocity]
    }
}

/// Returns the reference at a time: between two states, at rest before the first and after the last.
fn interpolate(reference: &[State], time: f64) -> Option<State> {
    let (first, last) = (reference.first()?, reference.last()?);
    let resting = |state: &State| State::at(time, state.position, state.orientation);
    if time < first.time {
        return Some(resting(first));
    }
    let next = reference.partition_point(|state| state.time <= time);
    let (Some(a), Some(b)) = (reference.get(next.wrapping_sub(1)), reference.get(next)) else {
        return Some(if time > last.time { resting(last) } else { *last });
    };
    let share = (time - a.time) / (b.time - a.time);
    let between = |a: [f64; 3], b: [f64; 3]| {
        let mut value = a;
        value.iter_mut().zip(b).for_each(|(value, b)| *value += (b - *value) * share);
        value
    };
    let turn = a.orientation.rotation_to(b.orientation).map(|part| part * share);
    Some(State {
        time,
        position: between(a.position, b.position),
        orientation: Quaternion::from_rotation_vector(turn) * a.orientation,
        velocity: between(a.velocity, b.velocity),
        angular_velocity: between(a.angular_velocity, b.angular_velocity),
    })
}

/// Finds the lowest point of a valley, to about a microsecond.
fn golden_section(mut low: f64, mut high: f64, cost: impl Fn(f64) -> f64) -> f64 {
    const SHARE: f64 = 0.618_033_988_749_895;
    for _ in 0..64 {
        if high - low < 1e-6 {
            break;
        }
        let (a, b) = (high - (high - low) * SHARE, low + (high - low) * SHARE);
        if cost(a) <= cost(b) { high = b } else { low = a }
    }
    f64::midpoint(low, high)
}

fn difference([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [a - x, b - y, c - z]
}

fn square([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}
