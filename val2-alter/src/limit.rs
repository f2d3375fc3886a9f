//! Velocity and acceleration limits for each axis (§9.2).

use crate::message::AXES;

/// The limits of each axis, in units of its words: a unit is 1/32 mm or 360/65536 degrees, and a cycle is 28 ms, so that one
/// unit a cycle is 1.116 mm/s or 0.196 °/s.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// The most that a value may move the arm in one cycle.
    pub velocity: [u16; AXES],
    /// The most by which that may change from one cycle to the next, braking included.
    pub acceleration: [u16; AXES],
}

impl Limits {
    /// No limit but the range of a word.
    pub const NONE: Self = Self { velocity: [u16::MAX; AXES], acceleration: [u16::MAX; AXES] };

    /// 100 mm/s and 30 °/s, reached in ten cycles. The source gives no numbers: these are ours, and gentle.
    pub const GENTLE: Self =
        Self { velocity: [90, 90, 90, 150, 150, 150], acceleration: [9, 9, 9, 15, 15, 15] };
}

impl Default for Limits {
    fn default() -> Self {
        Self::GENTLE
    }
}

/// Makes the values of each cycle keep the [`Limits`], from rest. "Diese maximale Änderung wird auch im abbremsenden Betrieb
/// berücksichtigt, so daß in keinem Fall höhere Beschleunigungen auftreten" (§9.2).
///
/// ```
/// use val2_alter::{Limiter, Limits};
///
/// let mut limiter = Limiter::new(Limits { velocity: [25; 6], acceleration: [10; 6] });
/// let x: Vec<i16> = [100, 100, 100, 100, 0, 0, 0].map(|x| limiter.speeds([x, 0, 0, 0, 0, 0])[0]).into();
/// assert_eq!(x, [10, 20, 25, 25, 15, 5, 0]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limiter {
    limits: Limits,
    speed: [i32; AXES],
    position: [i32; AXES],
}

impl Limiter {
    /// At rest on the path.
    pub const fn new(limits: Limits) -> Self {
        Self { limits, speed: [0; AXES], position: [0; AXES] }
    }

    /// The next values of cumulative ALTER, where a value is a speed: as near to `target` as the limits allow.
    pub fn speeds(&mut self, target: [i16; AXES]) -> [i16; AXES] {
        let Limits { velocity, acceleration } = &self.limits;
        for (((speed, target), most), change) in
            self.speed.iter_mut().zip(target).zip(velocity).zip(acceleration)
        {
            *speed = approach(*speed, i32::from(target), *most, *change);
        }
        self.speed.map(narrow)
    }

    /// The next values of non-cumulative ALTER, where a value is an offset from the path: on the way to `target` with a
    /// speed from which it can stop there. A target that comes nearer than the arm can brake is passed and come back to. At
    /// the ends of a word (±1024 mm) the arm stops at once.
    pub fn positions(&mut self, target: [i16; AXES]) -> [i16; AXES] {
        let Limits { velocity, acceleration } = &self.limits;
        let axes = self.speed.iter_mut().zip(&mut self.position).zip(target);
        for (((speed, position), target), (most, change)) in axes.zip(velocity.iter().zip(acceleration)) {
            let way = i32::from(target) - *position;
            let wanted = way.signum() * braking_speed(way.unsigned_abs(), u32::from(*change));
            *speed = approach(*speed, wanted, *most, *change);
            let moved = i32::from(narrow(*position + *speed));
            *speed = moved - *position;
            *position = moved;
        }
        self.position.map(narrow)
    }

    /// The controller could not read the last value: the arm did not move by it, and stands.
    pub fn rejected(&mut self) {
        for (position, speed) in self.position.iter_mut().zip(&mut self.speed) {
            *position = i32::from(narrow(*position - *speed));
            *speed = 0;
        }
    }

    /// Begins anew, at rest on the path.
    pub fn restart(&mut self) {
        *self = Self::new(self.limits);
    }

    /// The offset of each axis: the last result of [`Limiter::positions`].
    pub fn position(&self) -> [i16; AXES] {
        self.position.map(narrow)
    }

    /// Whether no axis moves.
    pub fn is_at_rest(&self) -> bool {
        self.speed == [0; AXES]
    }

    /// The limits.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }
}

fn approach(speed: i32, target: i32, most: u16, change: u16) -> i32 {
    let (most, change) = (i32::from(most), i32::from(change));
    target.clamp(-most, most).clamp(speed - change, speed + change)
}

/// The highest speed from which `change` a cycle stops within `way`, this cycle's move included.
///
/// From n·change + r, with r < change, the moves add up to change·n(n+1)/2 + (n+1)·r.
fn braking_speed(way: u32, change: u32) -> i32 {
    let Some(ratio) = way.checked_div(change) else { return 0 };
    let n = ((8 * ratio + 1).isqrt() - 1) / 2;
    let r = (way - change * (n * (n + 1) / 2)) / (n + 1);
    i32::try_from(n * change + r).unwrap_or(i32::MAX)
}

#[expect(clippy::cast_possible_truncation, reason = "clamped to the range of a word")]
fn narrow(value: i32) -> i16 {
    value.clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16
}
