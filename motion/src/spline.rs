//! A curve of the joints through several positions: the simulated spline move.

use super::kinematics::{Arm, Kinematics};

/// The pieces in which the length of a segment is measured.
const PIECES: u32 = 24;

/// A motion through several positions, at rest at both ends. FANUC's curve is not published: this one is a cubic, and each
/// stretch takes the time of its length at its speed.
#[derive(Debug, Clone)]
pub(crate) struct Spline {
    points: Vec<Point>,
}

#[derive(Debug, Clone, Copy)]
struct Point {
    time: f64,
    joints: [f64; 6],
    /// The speed of each joint through the point, in degrees a second.
    rate: [f64; 6],
}

/// The speed or the duration of a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum SegmentTiming {
    /// The speed of the tool, in mm/s.
    Speed(f64),
    /// The time, in s.
    Time(f64),
}

impl Spline {
    /// Creates a spline from `start` through the joints of each stretch.
    pub(crate) fn new(arm: &Arm, start: [f64; 6], segments: &[([f64; 6], SegmentTiming)]) -> Self {
        let joints = segments.iter().map(|(joints, _)| *joints);
        let points = core::iter::once(start).chain(joints);
        let points = points.map(|joints| Point { time: 0.0, joints, rate: [0.0; 6] }).collect();
        let mut spline = Self { points };
        // The lengths depend on the curve, the curve on the times, the times on the lengths: three rounds settle them.
        spline.set_times(segments, |a, b| arm.forward(&a.joints).distance(&arm.forward(&b.joints)));
        for _ in 0..3 {
            spline.set_times(segments, |a, b| length(arm, a, b));
        }
        spline
    }

    /// Returns the times of the positions after the first, in s.
    pub(crate) fn times(&self) -> impl Iterator<Item = f64> {
        self.points.iter().skip(1).map(|point| point.time)
    }

    /// Returns the joints at a time in s; at rest before the first position and after the last.
    pub(crate) fn at(&self, seconds: f64) -> [f64; 6] {
        let next = self.points.partition_point(|point| point.time <= seconds);
        match (self.points.get(next.wrapping_sub(1)), self.points.get(next)) {
            (Some(a), Some(b)) => between(a, b, (seconds - a.time) / (b.time - a.time)),
            (Some(point), None) | (None, Some(point)) => point.joints,
            (None, None) => [0.0; 6],
        }
    }

    fn set_times(&mut self, segments: &[([f64; 6], SegmentTiming)], length: impl Fn(&Point, &Point) -> f64) {
        let mut times = vec![0.0];
        for (pair, (_, segment)) in self.points.windows(2).zip(segments) {
            if let ([a, b], Some(last)) = (pair, times.last()) {
                let time = match segment {
                    SegmentTiming::Speed(speed) => length(a, b) / speed,
                    SegmentTiming::Time(time) => *time,
                };
                times.push(last + time.max(1e-3));
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
                // The slope of the parabola through the three positions.
                *rate = ((b - a) / h0 * h1 + (c - b) / h1 * h0) / (h0 + h1);
            }
            if let Some(point) = self.points.get_mut(index) {
                point.rate = rate;
            }
        }
    }
}

/// Returns the cubic between two points that has their rates at its ends.
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

/// Returns the length of the tool's path, in mm.
fn length(arm: &Arm, a: &Point, b: &Point) -> f64 {
    let pose = |k: u32| arm.forward(&between(a, b, f64::from(k) / f64::from(PIECES)));
    (1..=PIECES).map(|k| pose(k - 1).distance(&pose(k))).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_takes_its_length_by_its_speed_and_ends_at_its_point() {
        let turned = |degrees| [degrees, 0.0, 0.0, 0.0, -90.0, 0.0];
        let arm = Arm::LR_MATE_200ID;
        let segments = [10.0, 20.0, 30.0].map(|degrees| (turned(degrees), SegmentTiming::Speed(50.0)));
        let spline = Spline::new(&arm, turned(0.0), &segments);
        let seconds = spline.times().last().unwrap_or(0.0);
        // 30° on a radius of 385 mm: the wrist's centre at 50 + 335, the flange straight below it.
        let length = 385.0 * 30f64.to_radians();
        assert!((seconds - length / 50.0).abs() < 0.01, "{seconds}");
        for (time, degrees) in [(-1.0, 0.0), (seconds / 2.0, 15.0), (99.0, 30.0)] {
            let here = arm.forward(&spline.at(time));
            assert!(here.distance(&arm.forward(&turned(degrees))) < 0.01, "{time} s");
        }
    }

    /// Between two positions that it passes, a curve through positions on a parabola is the parabola.
    #[test]
    fn the_rate_at_a_position_is_the_slope_through_its_neighbours() {
        let on = |time: f64| [time * time, -2.0 * time * time, time, 0.0, 5.0 - time, 3.0];
        let segments = [1.0, 3.0, 2.0].into_iter().scan(0.0, |sum, time| {
            *sum += time;
            Some((on(*sum), SegmentTiming::Time(time)))
        });
        let spline = Spline::new(&Arm::LR_MATE_200ID, on(0.0), &segments.collect::<Vec<_>>());
        assert_eq!(spline.times().collect::<Vec<_>>(), [1.0, 4.0, 6.0]);
        for time in [1.0, 1.5, 2.0, 3.0, 4.0] {
            for (found, expected) in spline.at(time).into_iter().zip(on(time)) {
                assert!((found - expected).abs() < 1e-9, "{time} s: {found}, expected {expected}");
            }
        }
    }

    /// The chord of 120° is a sixth shorter.
    #[test]
    fn a_length_is_that_of_the_curve() {
        let turned = |degrees| [degrees, 0.0, 0.0, 0.0, -90.0, 0.0];
        let segment = (turned(120.0), SegmentTiming::Speed(50.0));
        let spline = Spline::new(&Arm::LR_MATE_200ID, turned(0.0), &[segment]);
        let seconds = spline.times().last().unwrap_or(0.0);
        assert!((seconds - 385.0 * 120f64.to_radians() / 50.0).abs() < 0.05, "{seconds}");
    }
}
