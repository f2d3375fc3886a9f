//! The motion from telemetry blocks: time from the life counter, speeds without the controller's jumps.

use core::time::Duration;

use fanuc_hmi_modbus::TelemetryBlock;

use super::orientation::Quaternion;

/// Turns telemetry blocks, in the order in which they were read, into samples of the motion.
///
/// The background task counts its runs. The difference of two counts, modulo 2³², times the period is the time
/// between two blocks, however late they were read; a block that was read twice is not a sample. The source's task
/// divides by its fixed period, and jumps when `Q_1` passes zero (a false speed of -250 /s). This tracker divides by
/// the time that passed, and gives each quaternion the sign that follows the previous one.
///
/// ```
/// use fanuc_hmi_modbus::TelemetryBlock;
/// use cellwire_motion::{Observation, Tracker};
///
/// let mut tracker = Tracker::new();
/// let block = |life_counter, x| TelemetryBlock { life_counter, position: [x, 0.0, 0.0], quaternion: [1.0, 0.0, 0.0, 0.0], ..Default::default() };
/// assert_eq!(tracker.push(&block(u32::MAX, 0.0)), Observation::First);
/// let Observation::Sample(sample) = tracker.push(&block(1, 1.6)) else { panic!() };
/// assert_eq!((sample.missed, sample.time.as_millis()), (1, 16)); // run 0 was not read
/// assert!((sample.velocity[0] - 100.0).abs() < 1e-5); // 1.6 mm in 16 ms
/// ```
#[derive(Debug, Clone)]
pub struct Tracker {
    period: Duration,
    /// The runs from one block to the next when no read is missed.
    expected: u32,
    last: Option<LastSample>,
    counts: Counts,
}

#[derive(Debug, Clone, Copy)]
struct LastSample {
    counter: u32,
    runs: u64,
    position: [f64; 3],
    orientation: Quaternion,
}

/// The result of a new block, compared with the previous ones.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Observation {
    /// The first block: there is nothing to compare it with. (The controller's own first speeds are differences from
    /// unset registers.)
    First,
    /// The life counter has not moved: the same run, read twice.
    Repeated,
    /// The life counter has gone back: the controller was restarted, and this is a first block.
    Restarted,
    /// A new run of the task, with the motion since the previous block.
    Sample(MotionSample),
}

/// The motion at a run of the background task.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct MotionSample {
    /// The time since the first block, by the life counter.
    pub time: Duration,
    /// The runs since the previous block that were not read and that the polling interval does not skip.
    pub missed: u32,
    /// X, Y, Z in mm.
    pub position: [f64; 3],
    /// The orientation; its sign follows the sample before.
    pub orientation: Quaternion,
    /// The velocity along X, Y, Z in mm/s, from the block before to this one.
    pub velocity: [f64; 3],
    /// The quaternion's derivative a second, from the block before to this one.
    pub quaternion_rate: [f64; 4],
    /// The angular velocity about the world's axes, in degrees a second.
    pub angular_velocity_world: [f64; 3],
    /// The angular velocity about the tool's axes, in degrees a second.
    pub angular_velocity_body: [f64; 3],
}

/// Counts of the blocks that were read, and of missed runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct Counts {
    /// The number of blocks that were compared with one before them.
    pub samples: u64,
    /// The number of blocks that were read twice.
    pub repeated: u64,
    /// The number of times that runs were missed: more than half a polling interval beyond one.
    pub gaps: u64,
    /// The number of runs that were missed, without those that the polling interval skips.
    pub missed: u64,
    /// The number of restarts of the controller.
    pub restarts: u64,
}

impl Tracker {
    /// Creates a tracker for a task that runs every 8 ms.
    pub fn new() -> Self {
        Self::with_period(Duration::from_millis(8))
    }

    /// Creates a tracker for a task that runs with this period, which is not zero.
    pub fn with_period(period: Duration) -> Self {
        Self::with_polls(period, period)
    }

    /// Creates a tracker for a task that runs with this period, which is not zero, and whose blocks are read at this
    /// interval.
    pub fn with_polls(period: Duration, poll: Duration) -> Self {
        let expected = poll.as_nanos().div_ceil(period.as_nanos().max(1)).max(1);
        let expected = u32::try_from(expected).unwrap_or(u32::MAX);
        Self { period, expected, last: None, counts: Counts::default() }
    }

    /// Takes the next block.
    pub fn push(&mut self, block: &TelemetryBlock) -> Observation {
        let position = block.position.map(f64::from);
        let orientation = Quaternion::normalised(block.quaternion.map(f64::from));
        let first = LastSample { counter: block.life_counter, runs: 0, position, orientation };
        let Some(last) = self.last else {
            self.last = Some(first);
            return Observation::First;
        };
        let step = block.life_counter.wrapping_sub(last.counter);
        if step == 0 {
            self.counts.repeated += 1;
            return Observation::Repeated;
        }
        if step > u32::MAX / 2 {
            self.counts.restarts += 1;
            self.last = Some(first);
            return Observation::Restarted;
        }
        let orientation = orientation.near(last.orientation);
        let runs = last.runs + u64::from(step);
        self.last = Some(LastSample { runs, orientation, ..first });
        self.counts.samples += 1;
        let is_gap = 2 * u64::from(step) > 3 * u64::from(self.expected);
        let missed = if is_gap { step - self.expected } else { 0 };
        self.counts.gaps += u64::from(is_gap);
        self.counts.missed += u64::from(missed);

        let seconds = f64::from(step) * self.period.as_secs_f64();
        let rotation = last.orientation.rotation_to(orientation);
        let world = rotation.map(|part| part / seconds);
        Observation::Sample(MotionSample {
            time: span(self.period, runs),
            missed,
            position,
            orientation,
            velocity: rates(last.position, position, seconds),
            quaternion_rate: rates(last.orientation.to_array(), orientation.to_array(), seconds),
            angular_velocity_world: world,
            angular_velocity_body: orientation.conjugate().rotate(world),
        })
    }

    /// Returns the counts of blocks and missed runs.
    pub fn counts(&self) -> Counts {
        self.counts
    }
}

impl Default for Tracker {
    fn default() -> Self {
        Self::new()
    }
}

fn rates<const N: usize>(from: [f64; N], mut to: [f64; N], seconds: f64) -> [f64; N] {
    for (to, from) in to.iter_mut().zip(from) {
        *to = (*to - from) / seconds;
    }
    to
}

/// Returns the time of this many periods; there are more of them than a `u32` counts before a controller is switched
/// off.
fn span(period: Duration, runs: u64) -> Duration {
    let nanos = period.as_nanos().saturating_mul(u128::from(runs));
    Duration::from_nanos(u64::try_from(nanos).unwrap_or(u64::MAX))
}
