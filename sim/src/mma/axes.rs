//! Simulated axes: straight from pose to pose, gently at both ends, at the speed of the override.

use core::fmt::Debug;
use core::time::Duration;

use mmacell_proto::{PlatformPose, Pose, RobotPose};

/// A pose that axes can be moved to.
pub trait Simulated: Pose + Debug + Send + 'static {
    /// The pose of the device at rest.
    const HOME: Self;

    /// Returns the pose after this share of the way, 0 to 1.
    fn towards(self, to: Self, share: f64) -> Self;

    /// Returns the time of the slowest axis at its highest speed, in seconds.
    fn time_to(self, to: Self) -> f64;
}

impl Simulated for RobotPose {
    const HOME: Self = Self::from_units([0, 0, 100_000, 0]);

    fn towards(self, to: Self, share: f64) -> Self {
        Self::from_units(blend(self.units(), to.units(), share))
    }

    /// Returns the time to this pose, at 250 mm/s and 3 rad/s.
    fn time_to(self, to: Self) -> f64 {
        slowest(self.units(), to.units(), [250e3, 250e3, 250e3, 30e3])
    }
}

impl Simulated for PlatformPose {
    const HOME: Self = Self::ORIGIN;

    fn towards(self, to: Self, share: f64) -> Self {
        Self::from_units(blend(self.units(), to.units(), share))
    }

    /// Returns the time to this pose, at 1.5 rad/s.
    fn time_to(self, to: Self) -> f64 {
        slowest(self.units(), to.units(), [15e3; 2])
    }
}

/// The axes of one device.
#[derive(Debug, Clone)]
pub(super) struct Axes<P> {
    from: P,
    to: P,
    /// The time of the motion at 100 %, in seconds.
    duration: f64,
    /// The share of that time that has passed, 0 to 1.
    progress: f64,
    percent: u8,
    now: Duration,
}

impl<P: Simulated> Axes<P> {
    /// Axes that stand here.
    pub(super) fn new(pose: P) -> Self {
        Self { from: pose, to: pose, duration: 0.0, progress: 1.0, percent: 100, now: Duration::ZERO }
    }

    /// Begins to move, from wherever the axes are.
    pub(super) fn go(&mut self, now: Duration, to: P) {
        self.advance(now);
        (self.from, self.to, self.progress) = (self.pose(), to, 0.0);
        // Gently at both ends: the highest speed is one and a half times the mean.
        self.duration = 1.5 * self.from.time_to(to);
    }

    /// Stops the axes at their current position.
    pub(super) fn stop(&mut self, now: Duration) {
        self.advance(now);
        let here = self.pose();
        (self.from, self.to, self.duration, self.progress) = (here, here, 0.0, 1.0);
    }

    /// Stops the axes at the half of their way, if they have come so far by now.
    pub(super) fn stop_half_way(&mut self) -> bool {
        if self.progress < 0.5 {
            return false;
        }
        self.progress = 0.5;
        self.stop(self.now);
        true
    }

    /// Changes the speed, also of a motion that is going on.
    pub(super) fn set_override(&mut self, now: Duration, percent: u8) {
        self.advance(now);
        self.percent = percent;
    }

    /// Moves on to this time.
    pub(super) fn advance(&mut self, now: Duration) {
        let passed = now.saturating_sub(self.now).as_secs_f64() * f64::from(self.percent) / 100.0;
        self.now = self.now.max(now);
        // A motion that takes no time is over: 1 is the smaller one of infinity, and of no number.
        self.progress = (self.progress + passed / self.duration).min(1.0);
    }

    /// Returns the time at which the axes have moved this share of the way at this override; `None` if never.
    pub(super) fn passes(&self, share: f64) -> Option<Duration> {
        let rest = (share - self.progress) * self.duration * 100.0 / f64::from(self.percent);
        // An override of zero never gets there.
        Duration::try_from_secs_f64(rest).ok()?.checked_add(self.now)
    }

    /// Returns the pose of the axes.
    pub(super) fn pose(&self) -> P {
        let share = self.progress * self.progress * (3.0 - 2.0 * self.progress);
        self.from.towards(self.to, share)
    }

    /// Returns whether the axes have arrived.
    pub(super) fn stand(&self) -> bool {
        self.progress >= 1.0
    }
}

#[expect(clippy::cast_possible_truncation, reason = "between two values of this type")]
fn blend<const N: usize>(mut from: [i32; N], to: [i32; N], share: f64) -> [i32; N] {
    for (axis, to) in from.iter_mut().zip(to) {
        *axis = (f64::from(*axis) + share * f64::from(to - *axis)).round() as i32;
    }
    from
}

fn slowest<const N: usize>(from: [i32; N], to: [i32; N], speeds: [f64; N]) -> f64 {
    let ways = from.into_iter().zip(to).map(|(from, to)| f64::from(from.abs_diff(to)));
    ways.zip(speeds).map(|(way, speed)| way / speed).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: Duration = Duration::from_secs(1);

    #[test]
    fn the_override_sets_the_pace_also_on_the_way() {
        let mut axes = Axes::new(RobotPose::ORIGIN);
        let to = RobotPose::from_mm_rad(500.0, -250.0, 0.0, 1.0);
        axes.go(S, to);
        axes.advance(S + S * 3 / 2);
        assert_eq!(axes.pose(), RobotPose::from_mm_rad(250.0, -125.0, 0.0, 0.5), "half of 3 s");
        axes.set_override(S + S * 3 / 2, 50);
        axes.advance(S * 5);
        assert!(!axes.stand());
        axes.advance(S * 11 / 2);
        assert!(axes.stand());
        assert_eq!(axes.pose(), to);
    }

    #[test]
    fn a_stop_holds_and_an_override_of_zero_stands_still() {
        let mut axes = Axes::new(PlatformPose::ORIGIN);
        axes.go(Duration::ZERO, PlatformPose::from_rad(1.5, 0.0));
        axes.set_override(S / 2, 0);
        let there = axes.pose();
        axes.advance(S * 100);
        assert_eq!(axes.pose(), there);
        assert!(!axes.stand());
        axes.stop(S * 100);
        assert!(axes.stand());
        axes.set_override(S * 100, 100);
        axes.advance(S * 200);
        assert_eq!(axes.pose(), there);
    }

    #[test]
    fn the_override_holds_through_a_stop_and_a_way_of_no_length_takes_no_time() {
        let mut axes = Axes::new(PlatformPose::ORIGIN);
        axes.set_override(S, 50);
        axes.stop(S);
        axes.go(S, PlatformPose::from_rad(3.0, -1.5));
        // 3 s at 100 %.
        axes.advance(S * 4);
        assert_eq!(axes.pose(), PlatformPose::from_rad(1.5, -0.75));
        assert_eq!((axes.passes(1.0), axes.stand()), (Some(S * 7), false));
        axes.stop(S * 4);
        axes.go(S * 4, PlatformPose::from_rad(1.5, -0.75));
        for now in [S * 4, S * 5] {
            axes.advance(now);
            assert!(axes.stand());
        }
    }

    #[test]
    fn axes_stop_half_way_once_they_have_come_so_far() {
        let mut axes = Axes::new(RobotPose::ORIGIN);
        let half = RobotPose::from_mm_rad(250.0, 0.0, 0.0, 0.0);
        for (at, stops) in [(1, false), (2, false), (3, true), (5, true)] {
            axes = Axes::new(RobotPose::ORIGIN);
            axes.go(S, RobotPose::from_mm_rad(500.0, 0.0, 0.0, 0.0));
            axes.advance(S + S / 2 * at);
            assert_eq!((axes.stop_half_way(), axes.stand()), (stops, stops), "{at} of 6");
        }
        assert_eq!(axes.pose(), half, "also when it is seen later");
    }
}
