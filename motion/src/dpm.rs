//! Offsets for DYNAMIC PATH MODIFIER: the values of the group inputs of six axes for every interpolation period.
//!
//! The option (R739) adds the number in a group input to the robot's position in every interpolation period (ITP, 8 ms):
//! the number is a speed. It has 16 bits, a scale, a limit a period and a limit a path (Fig. 13), and it must go back to zero
//! when its source falls silent: the robot would drift on.
//!
//! The exact meaning of the controller's `Scale factor` is disputed: with a group input, one user ran into the limit at once
//! with a scale of 1, another reports that 75 gives 1 : 1. So measure `mm_per_count`: send 100 counts in one period, and
//! divide the distance that the robot moved by 100. `Offset accumulate: FALSE` of Fig. 13 and the increments of the text
//! agree only if FALSE means that no offset is kept from one path to the next: test this before you rely on it. Motion must
//! have begun before the offsets do (`DPMO-005 NO Zero Dist Motion` otherwise).

use core::time::Duration;

use libm::{floor, round};

/// One axis: X, Y, Z in mm, W, P, R in degrees.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Axis {
    /// The motion of the robot per count, in mm or degrees. Measured: see the module's page.
    pub mm_per_count: f64,
    /// The most in one period, in mm or degrees: `Max offset/ITP`, 0.20 in Fig. 13 (25 mm/s).
    pub max_per_period: f64,
    /// The most on one path, from where DPM was switched on: `Max offset/path`, 10.00 in Fig. 13.
    pub max_per_path: f64,
}

impl Axis {
    /// Returns the limits of Fig. 13 with this scale.
    pub const fn new(mm_per_count: f64) -> Self {
        Self { mm_per_count, max_per_period: 0.20, max_per_path: 10.0 }
    }
}

/// The configuration of a [`Modifier`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Config {
    /// X, Y, Z, W, P, R; None for an axis that is not modified.
    pub axes: [Option<Axis>; 6],
    /// The interpolation period: 8 ms by default.
    pub period: Duration,
    /// The age at which a demand expires and the offsets become zero: 24 ms by default, three periods.
    pub timeout: Duration,
}

impl Config {
    /// Creates the defaults with these axes.
    pub const fn new(axes: [Option<Axis>; 6]) -> Self {
        Self { axes, period: Duration::from_millis(8), timeout: Duration::from_millis(24) }
    }
}

/// Makes the group inputs of each period from speeds.
///
/// Call [`demand`](Self::demand) whenever the source gives new speeds, and [`next_period`](Self::next_period) once in
/// every interpolation period; its counts go to the group inputs. A remainder below a count is carried to the next
/// period, so no motion is lost to rounding. Motion beyond a limit is dropped: the robot does not catch up later.
///
/// ```
/// use core::time::Duration;
/// use cellwire_motion::dpm::{Axis, Config, Modifier};
///
/// let mut modifier = Modifier::new(Config::new([Some(Axis::new(0.001)), None, None, None, None, None]))?;
/// let ms = Duration::from_millis;
/// modifier.demand(ms(0), [10.06, 0.0, 0.0, 0.0, 0.0, 0.0])?; // 80.48 counts a period
/// let counts: [i16; 4] = core::array::from_fn(|_| modifier.next_period(ms(8)).counts[0]);
/// assert_eq!(counts, [80, 81, 80, 81]);
/// modifier.demand(ms(16), [500.0, 0.0, 0.0, 0.0, 0.0, 0.0])?; // Fig. 13 allows 25 mm/s
/// assert_eq!(modifier.next_period(ms(16)).counts[0], 200);
/// assert!(modifier.next_period(ms(100)).lost); // the source has fallen silent: zero
/// # Ok::<(), cellwire_motion::dpm::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Modifier {
    config: Config,
    /// The speeds in mm/s or degrees a second, with the time of their arrival; `None` before the first.
    demand: Option<([f64; 6], Duration)>,
    state: [AxisState; 6],
}

#[derive(Debug, Clone, Copy, Default)]
struct AxisState {
    /// The remainder that is smaller than a count, in mm or degrees.
    rest: f64,
    /// The counts since the path began.
    path: i64,
}

/// The group inputs of one period.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Offsets {
    /// X, Y, Z, W, P, R, as signed 16-bit numbers; a group input has the same 16 bits.
    pub counts: [i16; 6],
    /// The axes whose offset was reduced by their limit per period, or by the 16 bits.
    pub limited: [bool; 6],
    /// The axes that have reached their limit a path.
    pub at_path_limit: [bool; 6],
    /// Whether the demand was too old or missing: every count is zero.
    pub lost: bool,
}

impl Modifier {
    /// Offsets of zero until there is a demand.
    ///
    /// # Errors
    /// If a scale, a limit or the period is not above zero.
    pub fn new(config: Config) -> Result<Self, Error> {
        for (axis, index) in config.axes.iter().zip(0..) {
            let Some(axis) = axis else { continue };
            let positive = |value: f64| value.is_finite() && value > 0.0;
            if !positive(axis.mm_per_count) || !positive(axis.max_per_period) || !positive(axis.max_per_path)
            {
                return Err(Error::Axis { index });
            }
        }
        if config.period.is_zero() {
            return Err(Error::Period);
        }
        Ok(Self { config, demand: None, state: [AxisState::default(); 6] })
    }

    /// Sets the speeds from now on, in mm/s and degrees a second; those of an axis that is not modified are ignored.
    ///
    /// # Errors
    /// If a speed is not a number. The previous demand stays valid until it is too old.
    pub fn demand(&mut self, now: Duration, speeds: [f64; 6]) -> Result<(), Error> {
        if let Some(index) = (0..).zip(speeds).find(|(_, speed)| !speed.is_finite()).map(|(index, _)| index) {
            return Err(Error::Speed { index });
        }
        self.demand = Some((speeds, now));
        Ok(())
    }

    /// Returns the offsets of the period that begins now.
    pub fn next_period(&mut self, now: Duration) -> Offsets {
        let speeds = match self.demand {
            Some((speeds, at)) if now.saturating_sub(at) <= self.config.timeout => speeds,
            _ => {
                // Drop the remainder: it is part of a motion that was given up.
                self.state.iter_mut().for_each(|state| state.rest = 0.0);
                return Offsets { lost: true, ..Offsets::default() };
            }
        };
        let seconds = self.config.period.as_secs_f64();
        let mut offsets = Offsets::default();
        let outputs = offsets.counts.iter_mut().zip(&mut offsets.limited).zip(&mut offsets.at_path_limit);
        let axes = self.config.axes.iter().zip(&mut self.state).zip(speeds);
        for (((axis, state), speed), ((count, limited), at_path_limit)) in axes.zip(outputs) {
            let Some(axis) = axis else { continue };
            (*count, *limited, *at_path_limit) = state.next(axis, speed * seconds);
        }
        offsets
    }

    /// Begins a new path: DPM was switched off and on again, and the limits a path count from here.
    pub fn begin_path(&mut self) {
        self.state = [AxisState::default(); 6];
    }

    /// Returns the distance of each axis from the beginning of the path, in mm or degrees.
    pub fn path(&self) -> [f64; 6] {
        let mut path = [0.0; 6];
        for ((path, axis), state) in path.iter_mut().zip(&self.config.axes).zip(&self.state) {
            *path = axis.map_or(0.0, |axis| to_f64(state.path) * axis.mm_per_count);
        }
        path
    }
}

impl AxisState {
    fn next(&mut self, axis: &Axis, increment: f64) -> (i16, bool, bool) {
        let most = whole(axis.max_per_period / axis.mm_per_count).min(i64::from(i16::MAX));
        let path = whole(axis.max_per_path / axis.mm_per_count);
        let wanted = increment + self.rest;
        let most_mm = axis.max_per_period.min(f64::from(i16::MAX) * axis.mm_per_count);
        let allowed = wanted.clamp(-most_mm, most_mm);
        let nearest = round(allowed / axis.mm_per_count);
        let within = to_i64(nearest).clamp(-most, most);
        let counts = within.clamp(-path - self.path, path - self.path);
        self.path += counts;
        // Beyond a limit there is nothing to catch up with. Back from it, less than a count is carried as everywhere.
        let beyond = (wanted > 0.0 && self.path == path) || (wanted < 0.0 && self.path == -path);
        let at_path_limit = counts != within || (counts == 0 && beyond);
        self.rest = if at_path_limit { 0.0 } else { allowed - to_f64(counts) * axis.mm_per_count };
        (i16::try_from(counts).unwrap_or_default(), allowed != wanted, at_path_limit)
    }
}

/// The reason that offsets cannot be made: the caller's fault. Axes count from 0 for X to 5 for R.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, serde::Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum Error {
    /// A scale or a limit that is not above zero.
    #[error("axis {index}: the scale and the limits must be above zero")]
    Axis {
        /// The index of the axis, 0 for X to 5 for R.
        index: usize,
    },
    /// The interpolation period is zero.
    #[error("the interpolation period must not be zero")]
    Period,
    /// A speed that is not a number.
    #[error("axis {index}: the speed is not a finite number")]
    Speed {
        /// The index of the axis, 0 for X to 5 for R.
        index: usize,
    },
}

/// Returns the number of counts that fit, allowing for the last digit: 0.20 / 0.001 is 200.
fn whole(counts: f64) -> i64 {
    to_i64(floor(counts + 1e-6).min(9e15))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the cast saturates, and so do the limits that are made of it"
)]
fn to_i64(value: f64) -> i64 {
    value as i64
}

#[expect(clippy::cast_precision_loss, reason = "a path has fewer than 2^53 counts")]
fn to_f64(counts: i64) -> f64 {
    counts as f64
}
