//! A joint trajectory as spline moves, in the three ways of the source ("Datový postprocesor").

use libm::{fabs, round, sqrt};

use fanuc_ls::{Builder, EncodeError, Program, Rules, Speed, Termination};

use super::kinematics::{Kinematics, Pose};
use super::trajectory::{JointSample, Trajectory};

/// The choice of points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sampling {
    /// After each such way of the tool, in mm.
    Distance(f64),
    /// After each such turn of the tool, in degrees.
    Angle(f64),
    /// After each such time, in s.
    Time(f64),
    /// Samples after `max` seconds if nothing accelerates, after `min` seconds at the greatest acceleration, and in
    /// proportion between: dense where the motion changes. The source rates this sampling best. The acceleration is taken
    /// over `min` on either side, so that the last decimal of a table does not count as one.
    Dynamic {
        /// The shortest step in s (tdMin).
        min: f64,
        /// The longest step in s (tdMax).
        max: f64,
        /// The acceleration on which the step depends.
        by: Acceleration,
    },
}

/// The acceleration that [`Sampling::Dynamic`] uses, as a share of the greatest in the trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Acceleration {
    /// The acceleration of the position.
    Translation,
    /// The acceleration of the orientation.
    Rotation,
    /// The greater share of the two.
    #[default]
    Either,
}

/// The rounding of speeds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SpeedStep {
    /// To whole mm/s, as the source does.
    #[default]
    Whole,
    /// To tenths of mm/s.
    Tenth,
}

/// The settings for making a program of a trajectory.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Resampling {
    /// The choice of points on the trajectory.
    pub sampling: Sampling,
    /// The rounding of speeds. No speed is below 1 mm/s.
    pub speed: SpeedStep,
    /// UFRAME of the program and its positions: 0, the world, by default.
    pub user_frame: u16,
    /// UTOOL of the program and its positions: 1 by default.
    pub user_tool: u16,
    /// The joint speed of the way to the first point, in %: 2 by default, as in the source.
    pub approach: u8,
}

impl Resampling {
    /// Creates the defaults with this sampling.
    pub fn new(sampling: Sampling) -> Self {
        Self { sampling, speed: SpeedStep::default(), user_frame: 0, user_tool: 1, approach: 2 }
    }

    /// Creates the program, with its name and comment, and a report of the differences from the trajectory.
    ///
    /// `J P[1]` goes to the first sample and stops there; an `S` with CNT100 goes to each point, the last with FINE. The
    /// speed of a move is the length of the tool's path from the previous point, divided by the time of the trajectory for
    /// it. The controller's curve between the points is not published: expect the deviations that the source measured, 4 mm
    /// and 0.5° at 100 mm/s.
    ///
    /// # Errors
    /// If a step makes no sense, the points do not fit a program, or the program cannot be written.
    pub fn program(
        &self,
        name: &str,
        comment: &str,
        trajectory: &Trajectory,
        kinematics: &impl Kinematics,
        rules: &Rules,
    ) -> Result<(Program, Report), ResampleError> {
        let path = Path::new(trajectory, kinematics);
        let times = self.times(&path, trajectory, kinematics)?;
        let mut report = Report::default();
        let mut builder = Builder::new(name);
        builder.comment(comment).user_tool(self.user_tool).user_frame(self.user_frame);
        let start = builder.joints(trajectory.at(times.first().copied().unwrap_or_default()));
        builder.joint(start, Speed::percent(self.approach), Termination::Fine);
        for (index, step) in (2..).zip(times.windows(2)) {
            let &[from, to] = step else { continue };
            let ((s0, a0), (s1, a1)) = (path.travelled(from), path.travelled(to));
            let planned = (s1 - s0) / (to - from);
            let written = self.written(planned);
            report.add(Step { index, seconds: to - from, mm: s1 - s0, degrees: a1 - a0, planned, written });
            let target = builder.joints(trajectory.at(to));
            let termination =
                if times.last() == Some(&to) { Termination::Fine } else { Termination::Continuous(100) };
            builder.spline(target, Speed::mm_per_sec(written), termination);
        }
        report.finish();
        Ok((builder.build(rules)?, report))
    }

    /// Returns the times of the points, including the first and the last sample.
    fn times(
        &self,
        path: &Path,
        trajectory: &Trajectory,
        kinematics: &impl Kinematics,
    ) -> Result<Vec<f64>, ResampleError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        let valid = match self.sampling {
            Sampling::Distance(step) | Sampling::Angle(step) | Sampling::Time(step) => positive(step),
            Sampling::Dynamic { min, max, .. } => positive(min) && positive(max) && min <= max,
        };
        if !valid {
            return Err(ResampleError::Step);
        }
        let mut times = Vec::new();
        let (Some(first), Some(last)) = (path.knots.first(), path.knots.last()) else {
            return Err(ResampleError::Step);
        };
        push(&mut times, first.time)?;
        match self.sampling {
            Sampling::Time(seconds) => {
                let mut count = 1.0;
                while first.time + count * seconds < last.time {
                    push(&mut times, first.time + count * seconds)?;
                    count += 1.0;
                }
            }
            Sampling::Distance(mm) => path.every(mm, |knot| knot.mm, &mut times)?,
            Sampling::Angle(degrees) => path.every(degrees, |knot| knot.degrees, &mut times)?,
            Sampling::Dynamic { min, max, by } => {
                let shares = accelerations(trajectory, kinematics, min, by);
                let mut time = first.time;
                loop {
                    time = path.dynamic(time, min, max, &shares);
                    if time >= last.time {
                        break;
                    }
                    push(&mut times, time)?;
                }
            }
        }
        // A last step that is almost nothing would bend the spline: the point before it gives way.
        let short = match self.sampling {
            Sampling::Distance(mm) => times.last().is_some_and(|&t| last.mm - path.travelled(t).0 < mm / 2.0),
            Sampling::Angle(deg) => {
                times.last().is_some_and(|&t| last.degrees - path.travelled(t).1 < deg / 2.0)
            }
            Sampling::Time(step) => times.last().is_some_and(|t| last.time - t < step / 2.0),
            Sampling::Dynamic { min, .. } => times.last().is_some_and(|t| last.time - t < min),
        };
        if short && times.len() > 1 {
            times.pop();
        }
        push(&mut times, last.time)?;
        Ok(times)
    }

    fn written(&self, planned: f64) -> f64 {
        let rounded = match self.speed {
            SpeedStep::Whole => round(planned),
            SpeedStep::Tenth => round(planned * 10.0) / 10.0,
        };
        rounded.max(1.0)
    }
}

/// The most points of a program.
const MAX_POINTS: usize = 32_766;

fn push(times: &mut Vec<f64>, time: f64) -> Result<(), ResampleError> {
    times.push(time);
    if times.len() > MAX_POINTS { Err(ResampleError::Points) } else { Ok(()) }
}

/// The results of converting a trajectory to a program.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
#[non_exhaustive]
pub struct Report {
    /// The number of spline moves.
    pub moves: usize,
    /// The length of the tool's path in mm.
    pub length: f64,
    /// The angle by which the tool turns on it, in degrees.
    pub rotation: f64,
    /// The time of the trajectory in s.
    pub planned_time: f64,
    /// The time at the speeds as they are written, in s.
    pub written_time: f64,
    /// The greatest error that rounding makes in a speed, as a share of the planned one, and the point it leads to. Moves
    /// below 1 mm/s are counted apart.
    pub worst_rounding: f64,
    /// The point that the move with the greatest error leads to.
    pub worst_point: u32,
    /// The mean of these errors, without their signs.
    pub mean_rounding: f64,
    /// The moves whose planned speed is below the slowest that is written, 1 mm/s: turns on the spot, and rests.
    pub slow_moves: usize,
    /// The longest move in mm.
    pub longest_move: f64,
    /// The greatest turn in one move, in degrees.
    pub greatest_turn: f64,
    /// The shortest time of a move in s.
    pub shortest_time: f64,
    /// The longest time of a move in s.
    pub longest_time: f64,
}

struct Step {
    index: u32,
    seconds: f64,
    mm: f64,
    degrees: f64,
    planned: f64,
    written: f64,
}

impl Report {
    fn add(&mut self, step: Step) {
        self.shortest_time =
            if self.moves == 0 { step.seconds } else { self.shortest_time.min(step.seconds) };
        self.longest_time = self.longest_time.max(step.seconds);
        self.longest_move = self.longest_move.max(step.mm);
        self.greatest_turn = self.greatest_turn.max(step.degrees);
        self.moves += 1;
        self.length += step.mm;
        self.rotation += step.degrees;
        self.planned_time += step.seconds;
        self.written_time += step.mm / step.written;
        if step.planned < 1.0 {
            self.slow_moves += 1;
            return;
        }
        let error = (step.written - step.planned) / step.planned;
        self.mean_rounding += fabs(error);
        if fabs(error) > fabs(self.worst_rounding) {
            (self.worst_rounding, self.worst_point) = (error, step.index);
        }
    }

    fn finish(&mut self) {
        let counted = u32::try_from(self.moves - self.slow_moves).unwrap_or(u32::MAX);
        if counted > 0 {
            self.mean_rounding /= f64::from(counted);
        }
    }
}

/// The reason that a trajectory cannot become a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ResampleError {
    /// A step that is not above zero, or a shortest step that is longer than the longest.
    #[error("steps must be above zero, and the shortest not longer than the longest")]
    Step,
    /// More points than fit a program.
    #[error("the step is too short: more than {MAX_POINTS} points")]
    Points,
    /// The program cannot be written.
    #[error(transparent)]
    Encode(#[from] EncodeError),
}

/// The tool's way at each sample of the trajectory.
struct Path {
    knots: Vec<Knot>,
}

#[derive(Clone, Copy)]
struct Knot {
    time: f64,
    /// The length of the tool's path up to here, in mm.
    mm: f64,
    /// The angle by which it has turned, in degrees.
    degrees: f64,
}

impl Path {
    fn new(trajectory: &Trajectory, kinematics: &impl Kinematics) -> Self {
        let mut last: Option<Pose> = None;
        let (mut mm, mut degrees) = (0.0, 0.0);
        let knot = |sample: &JointSample| {
            let pose = kinematics.forward(&sample.joints);
            if let Some(from) = last {
                mm += from.distance(&pose);
                degrees += norm(from.rotation_to(&pose));
            }
            last = Some(pose);
            Knot { time: sample.time, mm, degrees }
        };
        Self { knots: trajectory.samples().iter().map(knot).collect() }
    }

    /// Returns the length and the turned angle of the tool's path at a time of the trajectory, in mm and degrees.
    fn travelled(&self, time: f64) -> (f64, f64) {
        let next = self.knots.partition_point(|knot| knot.time <= time);
        match (self.knots.get(next.saturating_sub(1)), self.knots.get(next)) {
            (Some(a), Some(b)) => {
                let share = (time - a.time) / (b.time - a.time);
                (a.mm + (b.mm - a.mm) * share, a.degrees + (b.degrees - a.degrees) * share)
            }
            (Some(a), _) => (a.mm, a.degrees),
            (None, _) => (0.0, 0.0),
        }
    }

    /// Appends the times at which `of` has grown by another `step`.
    fn every(&self, step: f64, of: fn(&Knot) -> f64, times: &mut Vec<f64>) -> Result<(), ResampleError> {
        let mut count = 1.0;
        for pair in self.knots.windows(2) {
            let [a, b] = pair else { continue };
            while count * step <= of(b) {
                let share = (count * step - of(a)) / (of(b) - of(a));
                push(times, a.time + (b.time - a.time) * share)?;
                count += 1.0;
            }
        }
        Ok(())
    }

    /// Returns the time of the next point: after the longest step that its accelerations allow.
    fn dynamic(&self, from: f64, min: f64, max: f64, shares: &[f64]) -> f64 {
        let mut end = from + max;
        let first = self.knots.partition_point(|knot| knot.time < from);
        for (knot, share) in self.knots.iter().zip(shares).skip(first) {
            if knot.time >= end {
                break;
            }
            let allowed = from + max - (max - min) * share;
            // An acceleration that begins later ends the step at its beginning, not before.
            end = end.min(allowed.max(knot.time));
        }
        end
    }
}

/// The lower limit of the greatest acceleration, in mm/s² or °/s²: with it, the shares of rounding errors in an even motion
/// are small.
const LEAST_ACCELERATION: f64 = 1.0;

/// Returns the acceleration at each sample, as a share of the greatest. It is taken from `window` seconds before the sample to
/// `window` seconds after it, within the trajectory.
fn accelerations(
    trajectory: &Trajectory,
    kinematics: &impl Kinematics,
    window: f64,
    by: Acceleration,
) -> Vec<f64> {
    let (start, end) = trajectory.span();
    let mut translation = Vec::new();
    let mut rotation = Vec::new();
    for sample in trajectory.samples() {
        let (mut linear, mut angular) = (0.0, 0.0);
        if end - start >= 2.0 * window {
            let time = sample.time.clamp(start + window, end - window);
            let [before, at, after] =
                [time - window, time, time + window].map(|time| kinematics.forward(&trajectory.at(time)));
            linear = change(step(before.position, at.position), step(at.position, after.position));
            angular = change(before.rotation_to(&at), at.rotation_to(&after));
        }
        translation.push(linear / (window * window));
        rotation.push(angular / (window * window));
    }
    let greatest = |all: &[f64]| all.iter().copied().fold(LEAST_ACCELERATION, f64::max);
    let (most, fastest) = (greatest(&translation), greatest(&rotation));
    let shares = translation.iter().zip(&rotation).map(|(linear, angular)| match by {
        Acceleration::Translation => linear / most,
        Acceleration::Rotation => angular / fastest,
        Acceleration::Either => (linear / most).max(angular / fastest),
    });
    shares.collect()
}

fn step([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [x - a, y - b, z - c]
}

fn norm([x, y, z]: [f64; 3]) -> f64 {
    sqrt(x * x + y * y + z * z)
}

fn change(from: [f64; 3], to: [f64; 3]) -> f64 {
    norm(step(from, to))
}
