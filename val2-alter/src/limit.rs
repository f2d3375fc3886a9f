//! Velocity and acceleration limits for each axis (§9.2).

use crate::message::AXES;

/// The limits of each axis, in units of its words: a unit is 1/32 mm or 360/65536 degrees, and a cycle is 28 ms, so that one
/// unit a cycle is 1.116 mm/s or 0.196 °/s. More than 32767 counts as 32767.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// The most that a value may move the arm in one cycle.
    pub velocity: [u16; AXES],
    /// The most by which that may change from one cycle to the next, braking included.
    pub acceleration: [u16; AXES],
}

impl Limits {
    /// As good as none: a meter, or half a turn, in each cycle.
    pub const NONE: Self = Self { velocity: [u16::MAX; AXES], acceleration: [u16::MAX; AXES] };

    /// 100 mm/s and 30 °/s, reached in ten cycles. The source gives no numbers: these are the project's choice, and gentle.
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
    most: [i16; AXES],
    change: [i16; AXES],
    axes: Axes,
}

/// The speed of each axis, and its distance from the path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Axes {
    pub(crate) speed: [i16; AXES],
    pub(crate) position: [i16; AXES],
}

impl Limiter {
    /// Creates a limiter at rest on the path.
    pub fn new(limits: Limits) -> Self {
        let words = |limits: [u16; AXES]| limits.map(|limit| i16::try_from(limit).unwrap_or(i16::MAX));
        Self { limits, most: words(limits.velocity), change: words(limits.acceleration), axes: Axes::REST }
    }

    /// Returns the next values of cumulative ALTER, whose values are speeds: as near to `target` as the limits allow.
    pub fn speeds(&mut self, target: [i16; AXES]) -> [i16; AXES] {
        self.axes = self.speeds_from(self.axes, target);
        self.axes.speed
    }

    /// Returns the next values of non-cumulative ALTER, whose values are offsets from the path: on the way to `target` with
    /// a speed from which it can stop there. If a target comes nearer than the braking distance, the arm passes it and
    /// returns. At the ends of a word (±1024 mm) the arm stops at once.
    pub fn positions(&mut self, target: [i16; AXES]) -> [i16; AXES] {
        self.axes = self.positions_from(self.axes, target);
        self.axes.position
    }

    /// Called when the controller could not read the last value: the arm did not move by the value, and is at rest.
    pub fn rejected(&mut self) {
        let Axes { speed, position } = &mut self.axes;
        for (position, speed) in position.iter_mut().zip(speed) {
            *position = position.saturating_sub(*speed);
        }
        self.rest();
    }

    /// Called when the controller had no value in the last cycle: the arm is at rest.
    pub fn rest(&mut self) {
        self.axes.speed = [0; AXES];
    }

    /// Sets speed and offset of these axes (bit *i* is axis *i*) to zero: their words were not sent, so they must stay on
    /// the path, at rest.
    pub fn hold(&mut self, axes: u8) {
        let Axes { speed, position } = &mut self.axes;
        for (axis, (speed, position)) in speed.iter_mut().zip(position).enumerate() {
            if axes >> axis & 1 != 0 {
                (*speed, *position) = (0, 0);
            }
        }
    }

    /// Restarts, at rest on the path.
    pub fn restart(&mut self) {
        self.axes = Axes::REST;
    }

    /// Returns the offset of each axis: the last result of [`Limiter::positions`].
    pub fn position(&self) -> [i16; AXES] {
        self.axes.position
    }

    /// Returns whether all axes are at rest.
    pub fn is_at_rest(&self) -> bool {
        self.axes.speed == [0; AXES]
    }

    /// Returns the limits.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    pub(crate) fn axes(&self) -> Axes {
        self.axes
    }

    /// Records the axes of a reply that was sent, as [`Limiter::speeds`] or [`Limiter::positions`] would have moved
    /// them.
    pub(crate) fn set_axes(&mut self, axes: Axes) {
        self.axes = axes;
    }

    /// Moves the axes as [`Limiter::speeds`] does.
    pub(crate) fn speeds_from(&self, mut axes: Axes, target: [i16; AXES]) -> Axes {
        let limits = self.most.iter().zip(&self.change);
        for ((speed, target), (most, change)) in axes.speed.iter_mut().zip(&target).zip(limits) {
            *speed = approach(*speed, *target, *most, *change);
        }
        axes
    }

    /// Moves the axes as [`Limiter::positions`] does.
    #[inline(never)]
    pub(crate) fn positions_from(&self, mut axes: Axes, target: [i16; AXES]) -> Axes {
        let limits = self.most.iter().zip(&self.change);
        let each = axes.speed.iter_mut().zip(&mut axes.position);
        for (((speed, position), target), (most, change)) in each.zip(target).zip(limits) {
            let way = i32::from(target) - i32::from(*position);
            let wanted = braking_speed(way.unsigned_abs(), u32::from(change.unsigned_abs()));
            *speed = approach(*speed, if way < 0 { -wanted } else { wanted }, *most, *change);
            let next = position.saturating_add(*speed);
            *speed = next.saturating_sub(*position);
            *position = next;
        }
        axes
    }
}

impl Axes {
    const REST: Self = Self { speed: [0; AXES], position: [0; AXES] };
}

/// The limits of an arm's commanded position on each axis, in units of its words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reach {
    /// At least; not above zero.
    pub low: [i32; AXES],
    /// At most; not below zero.
    pub high: [i32; AXES],
}

impl Reach {
    /// Returns the speeds (cumulative) nearest to `target` from which an arm at the way of `odometer`, which brakes
    /// with `acceleration`, stops within reach. Beyond the reach, no speed leads further away.
    pub fn speeds(
        &self,
        odometer: [i32; AXES],
        mut target: [i16; AXES],
        acceleration: &[u16; AXES],
    ) -> [i16; AXES] {
        let ends = self.low.iter().zip(&self.high).zip(odometer);
        for ((target, ((low, high), at)), change) in target.iter_mut().zip(ends).zip(acceleration) {
            let change = u32::from(*change);
            let way =
                |to: i32, from: i32| u32::try_from(to.saturating_sub(from)).unwrap_or(0).min(MAX_DISTANCE);
            let (down, up) = (braking_speed(way(at, *low), change), braking_speed(way(*high, at), change));
            *target = (*target).max(-down).min(up);
        }
        target
    }

    /// Returns the offsets (non-cumulative) within reach that are nearest to `target`.
    pub fn offsets(&self, target: [i16; AXES]) -> [i16; AXES] {
        let mut offsets = target;
        for (offset, (low, high)) in offsets.iter_mut().zip(self.low.iter().zip(&self.high)) {
            let within = i32::from(*offset).max(*low).min(*high);
            *offset = i16::try_from(within).unwrap_or(*offset);
        }
        offsets
    }
}

/// A way from which no speed of a word is too fast to stop at the least change.
const MAX_DISTANCE: u32 = 1 << 28;

/// Limits a change of speed. It does not call `clamp`, whose check of the arguments prevents that all axes are computed at
/// once.
fn approach(speed: i16, target: i16, most: i16, change: i16) -> i16 {
    let wanted = target.max(-most).min(most);
    wanted.max(speed.saturating_sub(change)).min(speed.saturating_add(change))
}

/// Returns the highest speed from which `change` a cycle stops within `way`, this cycle's move included.
///
/// From n·change + r, with r < change, the moves add up to change·n(n+1)/2 + (n+1)·r.
fn braking_speed(way: u32, change: u32) -> i16 {
    let Some(ratio) = way.checked_div(change) else { return 0 };
    let n = ((8 * ratio + 1).isqrt() - 1) / 2;
    let r = (way - change * (n * (n + 1) / 2)) / (n + 1);
    i16::try_from(n * change + r).unwrap_or(i16::MAX)
}
