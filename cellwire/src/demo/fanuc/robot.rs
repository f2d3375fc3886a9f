//! The simulated arm: it runs an LS program of spline moves, as a controller with the Spline Motion option might.

use anyhow::{Context, Result, ensure};
use fanuc_ls::{Instruction, Motion, MotionKind, Program, Speed, SpeedUnit, Target};

use cellwire_motion::{Arm, Kinematics, Pose};

/// How finely a stretch of the path is measured.
const PIECES: u32 = 24;

/// A program on its way: where the joints are at each time since its first spline move began.
#[derive(Debug)]
pub(super) struct Run {
    arm: Arm,
    points: Vec<Point>,
}

#[derive(Debug, Clone, Copy)]
struct Point {
    time: f64,
    joints: [f64; 6],
    /// In degrees a second, through the point.
    rate: [f64; 6],
}

impl Run {
    /// Takes the points of a program whose first motion is a `J` and whose others are `S` in mm/sec. FANUC's curve is not
    /// published: this one is a cubic through the points, at rest at both ends, and each stretch takes its length by its
    /// speed.
    ///
    /// # Errors
    /// When the program is another kind.
    pub(super) fn new(program: &Program, arm: Arm) -> Result<Self> {
        let motions = program.instructions.iter().filter_map(|instruction| match instruction {
            Instruction::Motion(motion) => Some(motion),
            _ => None,
        });
        let mut stretches = Vec::new();
        let mut points = Vec::new();
        for motion in motions {
            let (joints, speed) = stretch(program, motion)?;
            points.push(Point { time: 0.0, joints, rate: [0.0; 6] });
            stretches.extend(speed);
        }
        ensure!(points.len() == stretches.len() + 1, "only the first motion may be a J");
        let mut run = Self { arm, points };
        // The lengths depend on the curve, the curve on the times, the times on the lengths: three rounds settle them.
        run.set_times(&stretches, |a, b| arm.forward(&a.joints).distance(&arm.forward(&b.joints)));
        for _ in 0..3 {
            run.set_times(&stretches, |a, b| length(&arm, a, b));
        }
        Ok(run)
    }

    /// The time from the first point to the last.
    pub(super) fn seconds(&self) -> f64 {
        self.points.last().map_or(0.0, |point| point.time)
    }

    /// The pose at a time; at rest before the first point and after the last.
    pub(super) fn at(&self, seconds: f64) -> Pose {
        let next = self.points.partition_point(|point| point.time <= seconds);
        let joints = match (self.points.get(next.wrapping_sub(1)), self.points.get(next)) {
            (Some(a), Some(b)) => between(a, b, (seconds - a.time) / (b.time - a.time)),
            (Some(point), None) | (None, Some(point)) => point.joints,
            (None, None) => [0.0; 6],
        };
        self.arm.forward(&joints)
    }

    fn set_times(&mut self, speeds: &[f64], length: impl Fn(&Point, &Point) -> f64) {
        let mut times = vec![0.0];
        for (pair, speed) in self.points.windows(2).zip(speeds) {
            if let ([a, b], Some(last)) = (pair, times.last()) {
                times.push(last + (length(a, b) / speed).max(1e-3));
            }
        }
        self.points.iter_mut().zip(times).for_each(|(point, time)| point.time = time);
        for index in 1..self.points.len().saturating_sub(1) {
            let Some(&[before, here, after]) =
                self.points.get(index - 1..=index + 1).and_then(|w| w.first_chunk())
            else {
                continue;
            };
            let (h0, h1) = (here.time - before.time, after.time - here.time);
            let mut rate = [0.0; 6];
            let joints = before.joints.iter().zip(here.joints).zip(after.joints);
            for (rate, ((a, b), c)) in rate.iter_mut().zip(joints) {
                // The slope of the parabola through the three.
                *rate = ((b - a) / h0 * h1 + (c - b) / h1 * h0) / (h0 + h1);
            }
            if let Some(point) = self.points.get_mut(index) {
                point.rate = rate;
            }
        }
    }
}

/// Where a motion goes, and for a spline move its speed in mm/s.
fn stretch(program: &Program, motion: &Motion) -> Result<([f64; 6], Option<f64>)> {
    let Target::Position { number, .. } = motion.target else {
        anyhow::bail!("{} is not a position", motion.target)
    };
    let joints = program.position(number).and_then(fanuc_ls::Position::joints);
    let joints = joints.with_context(|| format!("P[{number}] does not give six joints"))?;
    match (motion.kind, &motion.speed) {
        (MotionKind::Joint, _) => Ok((joints, None)),
        (MotionKind::Spline, &Speed::Fixed { value, unit: SpeedUnit::MmPerSec }) => Ok((joints, Some(value))),
        _ => anyhow::bail!("the simulated robot runs J, and S in mm/sec"),
    }
}

/// The cubic between two points that leaves and arrives with their rates.
fn between(a: &Point, b: &Point, share: f64) -> [f64; 6] {
    let (t, h) = (share.clamp(0.0, 1.0), b.time - a.time);
    let (t2, t3) = (t * t, t * t * t);
    let mut joints = a.joints;
    let rest = a.rate.iter().zip(b.joints).zip(b.rate);
    for (joint, ((rate, to), to_rate)) in joints.iter_mut().zip(rest) {
        *joint = *joint * (2.0 * t3 - 3.0 * t2 + 1.0)
            + rate * h * (t3 - 2.0 * t2 + t)
            + to * (3.0 * t2 - 2.0 * t3)
            + to_rate * h * (t3 - t2);
    }
    joints
}

/// The length of the tool's path, in mm.
fn length(arm: &Arm, a: &Point, b: &Point) -> f64 {
    let pose = |k: u32| arm.forward(&between(a, b, f64::from(k) / f64::from(PIECES)));
    (1..=PIECES).map(|k| pose(k - 1).distance(&pose(k))).sum()
}

#[cfg(test)]
mod tests {
    use fanuc_ls::{Builder, Rules, Termination};

    use super::*;

    #[test]
    fn a_stretch_takes_its_length_by_its_speed_and_ends_at_its_point() {
        let mut builder = Builder::new("A");
        let turned = |degrees| [degrees, 0.0, 0.0, 0.0, -90.0, 0.0];
        let points = [0.0, 10.0, 20.0, 30.0].map(|degrees| builder.joints(turned(degrees)));
        let [first, rest @ ..] = points;
        builder.joint(first, Speed::percent(2), Termination::Fine);
        for point in rest {
            builder.spline(point, Speed::mm_per_sec(50.0), Termination::Continuous(100));
        }
        let arm = Arm::LR_MATE_200ID;
        let run = Run::new(&builder.build(&Rules::default()).unwrap(), arm).unwrap();
        // 30° on a radius of 385 mm: the wrist's centre at 50 + 335, the flange straight below it.
        let length = 385.0 * 30f64.to_radians();
        assert!((run.seconds() - length / 50.0).abs() < 0.01, "{}", run.seconds());
        for (time, degrees) in [(-1.0, 0.0), (run.seconds() / 2.0, 15.0), (99.0, 30.0)] {
            assert!(run.at(time).distance(&arm.forward(&turned(degrees))) < 0.01, "{time} s");
        }
    }

    #[test]
    fn a_program_that_it_cannot_run_is_refused() {
        let mut builder = Builder::new("A");
        let point = builder.joints([0.0; 6]);
        builder.linear(point, Speed::mm_per_sec(50.0), Termination::Fine);
        let error = Run::new(&builder.build(&Rules::default()).unwrap(), Arm::LR_MATE_200ID).unwrap_err();
        assert_eq!(error.to_string(), "the simulated robot runs J, and S in mm/sec");
    }
}
