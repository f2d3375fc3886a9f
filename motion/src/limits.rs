//! The limits of a robot's joints.

use super::kinematics::{Arm, Pose};
use super::trajectory::Trajectory;

/// A robot's description: the limits of six joints, and the arm. J3 counts as in the trajectory: from the horizontal, as FANUC
/// shows it.
///
/// The file is JSON, a joint a line: `{"joints": [{"min": -170, "max": 170, "speed": 450}, …], "arm": {"shoulder": 50,
/// "upper_arm": 330, "elbow": 35, "forearm": 335, "flange": 80}}`. The arm may be left out.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// The limits of J1 to J6.
    pub joints: [JointLimits; 6],
    /// The lengths of the arm; `None` if they are not known.
    #[serde(default)]
    pub arm: Option<Dimensions>,
}

/// The lengths of an [`Arm`], in mm.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dimensions {
    /// The distance from the axis of J1 to the axis of J2, horizontally.
    pub shoulder: f64,
    /// The distance from J2 to J3; above 0.
    pub upper_arm: f64,
    /// The distance from J3 up to the axis of J4, with the forearm level.
    pub elbow: f64,
    /// The distance from J3 to the wrist's centre along the forearm; above 0.
    pub forearm: f64,
    /// The distance from the wrist's centre to the flange.
    pub flange: f64,
}

impl Dimensions {
    /// Returns the arm with a tool frame.
    pub fn arm(self, tool: Pose) -> Arm {
        let Self { shoulder, upper_arm, elbow, forearm, flange } = self;
        Arm { shoulder, upper_arm, elbow, forearm, flange, tool }
    }
}

/// The limits of a joint.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointLimits {
    /// The least angle in degrees.
    pub min: f64,
    /// The greatest angle in degrees.
    pub max: f64,
    /// The greatest speed in degrees a second, in both directions.
    pub speed: f64,
}

impl Limits {
    /// The limits of any arm: no joint turns more than twice around, none faster than 2000°/s.
    pub const ANY: Self =
        Self { joints: [JointLimits { min: -720.0, max: 720.0, speed: 2000.0 }; 6], arm: None };

    /// The LR Mate 200iD's, of FANUC's data sheet, J3 as it counts here with J2 upright.
    pub const LR_MATE_200ID: Self = {
        const fn joint(most: f64, speed: f64) -> JointLimits {
            JointLimits { min: -most, max: most, speed }
        }
        let j2 = JointLimits { min: -100.0, max: 145.0, speed: 380.0 };
        let j3 = JointLimits { min: -70.0, max: 205.0, speed: 520.0 };
        let j1 = joint(170.0, 450.0);
        Self {
            joints: [j1, j2, j3, joint(190.0, 550.0), joint(125.0, 545.0), joint(360.0, 1000.0)],
            arm: None,
        }
    };

    /// Reads a robot description.
    ///
    /// # Errors
    /// The text is not a description, a least angle is not below the greatest, a speed is not above zero, or a part
    /// of the arm has no length.
    pub fn from_json(text: &str) -> Result<Self, LimitsError> {
        let limits: Self = serde_json::from_str(text)
            .map_err(|error| LimitsError::Json { line: error.line(), column: error.column() })?;
        for (joint, limit) in (1..).zip(limits.joints) {
            if limit.min >= limit.max || limit.speed <= 0.0 {
                return Err(LimitsError::Joint { joint });
            }
        }
        if limits.arm.is_some_and(|arm| arm.upper_arm <= 0.0 || arm.forearm <= 0.0) {
            return Err(LimitsError::Arm);
        }
        Ok(limits)
    }

    /// Checks that a robot with these limits can execute the trajectory.
    ///
    /// # Errors
    /// The first joint that is out of its range, or must move faster than it can from one sample to the next.
    pub fn check(&self, trajectory: &Trajectory) -> Result<(), LimitError> {
        for (index, sample) in trajectory.samples().iter().enumerate() {
            let before = index.checked_sub(1).and_then(|before| trajectory.samples().get(before));
            for ((joint, limit), (at, &value)) in (1..).zip(self.joints).zip(sample.joints.iter().enumerate())
            {
                let time = sample.time;
                if !(limit.min..=limit.max).contains(&value) {
                    return Err(LimitError::Angle { joint, time, value, min: limit.min, max: limit.max });
                }
                let Some(before) = before else { continue };
                let from = before.joints.get(at).copied().unwrap_or(value);
                let speed = (value - from).abs() / (time - before.time);
                if speed > limit.speed {
                    return Err(LimitError::Speed { joint, time, value: speed, limit: limit.speed });
                }
            }
        }
        Ok(())
    }
}

/// The reason that a file is not a robot description.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitsError {
    /// The text is not JSON of this form.
    #[error(
        "line {line}, column {column}: expected {{\"joints\": [{{\"min\": -170, \"max\": 170, \"speed\": 450}}, …]}} with six joints"
    )]
    Json {
        /// The line of the text, from 1.
        line: usize,
        /// The column of the line, from 1.
        column: usize,
    },
    /// A joint that could not move.
    #[error("J{joint}: min must be below max, and speed above 0")]
    Joint {
        /// The number of the joint, 1 to 6.
        joint: u8,
    },
    /// An arm whose links have no length.
    #[error("arm: upper_arm and forearm must be above 0")]
    Arm,
}

/// A limit that a robot would exceed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitError {
    /// An angle out of the joint's range.
    #[error("J{joint} is {value:.3}° at {time:.3} s: the robot's range is {min}° to {max}°")]
    Angle {
        /// The number of the joint, 1 to 6.
        joint: u8,
        /// The time of the sample in s.
        time: f64,
        /// The angle of the sample, in degrees.
        value: f64,
        /// The least angle of the joint, in degrees.
        min: f64,
        /// The greatest angle of the joint, in degrees.
        max: f64,
    },
    /// A joint that would exceed its greatest speed.
    #[error("J{joint} moves at {value:.0}°/s until {time:.3} s: the robot's limit is {limit}°/s")]
    Speed {
        /// The number of the joint, 1 to 6.
        joint: u8,
        /// The time of the later sample in s.
        time: f64,
        /// The speed in degrees a second.
        value: f64,
        /// The greatest speed of the joint, in degrees a second.
        limit: f64,
    },
}
