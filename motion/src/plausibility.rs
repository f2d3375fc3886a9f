//! Implausible telemetry: values that no robot reports, and a stalled life counter.

use core::num::FpCategory;
use core::time::Duration;

use fanuc_hmi_modbus::TelemetryBlock;

use crate::{Arm, Limits, Pose, Quaternion};

/// The reason that a block is implausible.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fault {
    /// A value is not a number.
    Nan,
    /// A value is plus or minus infinity.
    Infinite,
    /// A value is above zero and below 1.2e-38: an integer that is read as a real, or words in the wrong order.
    Denormal,
    /// The quaternion's length is not 1.
    Quaternion,
    /// No joint angles of this robot bring its tool there.
    Unreachable,
    /// The life counter shows the same run as before, for too long.
    StandsStill,
}

impl Fault {
    /// Every one, with the key of its count in a report and the words for people.
    pub const ALL: [(Self, &'static str, &'static str); 6] = [
        (Self::Nan, "nan", "blocks with NaN"),
        (Self::Infinite, "infinite", "blocks with an infinite value"),
        (Self::Denormal, "denormal", "blocks with a denormal value"),
        (Self::Quaternion, "quaternion", "blocks with a quaternion not of unit length"),
        (Self::Unreachable, "unreachable", "blocks with an unreachable pose"),
        (Self::StandsStill, "standstill", "blocks with a stalled life counter"),
    ];

    /// Returns the name of the fault in a row of the recording.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(fault, ..)| *fault == self).map_or("", |(_, name, _)| name)
    }
}

/// Checks each block separately, and the life counter over time.
#[derive(Debug, Clone)]
pub struct Plausibility {
    robot: Option<(Arm, Limits)>,
    /// The time for which the life counter may show the same run.
    patience: Duration,
    /// The run that was shown last, and since when.
    run: Option<(u32, Duration)>,
}

/// The tolerance of a real: single precision, and a robot that is a little worn.
const SLACK: f64 = 1.0;
/// The greatest reach of any arm, in mm, regardless of its mounting.
const FARTHEST: f32 = 100_000.0;

impl Plausibility {
    /// Makes the check of a robot, if it is known, whose background task runs with this period and whose blocks are read every
    /// `poll`.
    pub fn new(robot: Option<(Arm, Limits)>, period: Duration, poll: Duration) -> Self {
        // A controller that is busy lets its background task wait; 0.25 s of that is more than any report speaks of.
        let patience = (period * 10).max(poll * 3).max(Duration::from_millis(250));
        Self { robot, patience, run: None }
    }

    /// Returns the reason that a block read at `now` is implausible, and the value that shows it; `None` if it is
    /// plausible.
    pub fn check(&mut self, block: &TelemetryBlock, now: Duration) -> Option<(Fault, &'static str)> {
        let since = match self.run {
            Some((run, since)) if run == block.life_counter => since,
            _ => now,
        };
        self.run = Some((block.life_counter, since));
        self.values(block).or_else(|| {
            let stands_still = now.saturating_sub(since) > self.patience;
            stands_still.then_some((Fault::StandsStill, "life_counter"))
        })
    }

    /// Called when a connection was made: the earlier life counter is no longer comparable.
    pub fn reconnected(&mut self) {
        self.run = None;
    }

    fn values(&self, block: &TelemetryBlock) -> Option<(Fault, &'static str)> {
        let reals = block.position.iter().chain(&block.wpr).chain(&block.quaternion);
        let reals = reals.chain(&block.velocity).chain(&block.quaternion_rate);
        let names = TelemetryBlock::FIELDS.iter().skip(2).map(|field| field.name);
        let bad = reals.zip(names).filter_map(|(real, name)| match real.classify() {
            FpCategory::Nan => Some((Fault::Nan, name)),
            FpCategory::Infinite => Some((Fault::Infinite, name)),
            FpCategory::Subnormal => Some((Fault::Denormal, name)),
            FpCategory::Zero | FpCategory::Normal => None,
        });
        bad.min_by_key(|(fault, _)| *fault).or_else(|| {
            let length = block.quaternion.iter().map(|part| f64::from(*part).powi(2)).sum::<f64>().sqrt();
            if (length - 1.0).abs() > 1e-3 {
                return Some((Fault::Quaternion, "Q_1"));
            }
            (!self.reaches(block)).then_some((Fault::Unreachable, "POS_X"))
        })
    }

    fn reaches(&self, block: &TelemetryBlock) -> bool {
        let Some((arm, limits)) = &self.robot else {
            return block.position.iter().all(|part| part.abs() <= FARTHEST);
        };
        let position = block.position.map(f64::from);
        let orientation = Quaternion::from_wpr(block.wpr.map(f64::from)).to_array();
        arm.reaches(&Pose { position, orientation }, limits, SLACK)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    fn good() -> TelemetryBlock {
        TelemetryBlock {
            life_counter: 7,
            position: [465.0, 0.0, 365.0],
            wpr: [180.0, -90.0, 0.0],
            quaternion: [0.0, 0.707_106_77, 0.0, 0.707_106_77],
            ..TelemetryBlock::default()
        }
    }

    fn checker(robot: Option<(Arm, Limits)>) -> Plausibility {
        Plausibility::new(robot, 8 * MS, 8 * MS)
    }

    #[test]
    fn each_fault_is_seen_and_named() {
        let robot = Some((Arm::LR_MATE_200ID, Limits::LR_MATE_200ID));
        let fault = |change: fn(&mut TelemetryBlock)| {
            let mut block = good();
            change(&mut block);
            checker(robot).check(&block, MS)
        };
        assert_eq!(fault(|_| {}), None);
        assert_eq!(fault(|b| b.velocity[1] = f32::NAN), Some((Fault::Nan, "SPD_Y")));
        assert_eq!(fault(|b| b.wpr[2] = f32::NEG_INFINITY), Some((Fault::Infinite, "POS_R")));
        assert_eq!(fault(|b| b.quaternion[0] = 1e-40), Some((Fault::Denormal, "Q_1")));
        assert_eq!(fault(|b| b.quaternion[1] = 0.9), Some((Fault::Quaternion, "Q_1")));
        assert_eq!(fault(|b| b.position[0] = 900.0), Some((Fault::Unreachable, "POS_X")));
        // The worst of several faults; without a robot, only values that no robot reaches.
        assert_eq!(fault(|b| (b.position[0], b.wpr[0]) = (1e-40, f32::NAN)), Some((Fault::Nan, "POS_W")));
        let mut far = good();
        far.position[0] = 900.0;
        assert_eq!(checker(None).check(&far, MS), None);
        far.position[0] = 2e5;
        assert_eq!(checker(None).check(&far, MS), Some((Fault::Unreachable, "POS_X")));
    }

    #[test]
    fn a_life_counter_may_wait_and_must_not_stand_still() {
        let mut checker = checker(None);
        let mut block = good();
        for at in 0..=250 {
            assert_eq!(checker.check(&block, at * MS), None, "{at} ms");
        }
        assert_eq!(checker.check(&block, 251 * MS), Some((Fault::StandsStill, "life_counter")));
        block.life_counter += 1;
        assert_eq!(checker.check(&block, 260 * MS), None);
        checker.reconnected();
        assert_eq!(checker.check(&block, 9999 * MS), None);
    }
}
