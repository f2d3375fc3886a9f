//! What a robot's joints can do.

use super::trajectory::Trajectory;

/// The limits of six joints. J3 counts as in the trajectory: from the horizontal, as FANUC shows it.
///
/// Its file is JSON, a joint a line: `{"joints": [{"min": -170, "max": 170, "speed": 450}, …]}`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// J1 to J6.
    pub joints: [JointLimits; 6],
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
    /// What no arm can do, whichever it is: no joint turns more than twice around, none faster than 2000°/s.
    pub const ANY: Self = Self { joints: [JointLimits { min: -720.0, max: 720.0, speed: 2000.0 }; 6] };

    /// Reads a robot description.
    ///
    /// # Errors
    /// When it is none, a least angle is not below the greatest, or a speed is not above zero.
    pub fn from_json(text: &str) -> Result<Self, LimitsError> {
        let limits: Self = serde_json::from_str(text)
            .map_err(|error| LimitsError::Json { line: error.line(), column: error.column() })?;
        for (joint, limit) in (1..).zip(limits.joints) {
            if limit.min >= limit.max || limit.speed <= 0.0 {
                return Err(LimitsError::Joint { joint });
            }
        }
        Ok(limits)
    }

    /// Whether a robot with these limits can move so.
    ///
    /// # Errors
    /// The first joint that is out of its range, or has to move faster than it can from one sample to the next.
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

/// Why a file is no robot description.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitsError {
    /// It is no such JSON.
    #[error(
        "line {line}, column {column}: expected {{\"joints\": [{{\"min\": -170, \"max\": 170, \"speed\": 450}}, …]}} with six joints"
    )]
    Json {
        /// The line, from 1.
        line: usize,
        /// The column, from 1.
        column: usize,
    },
    /// A joint that could not move.
    #[error("J{joint}: min must be below max, and speed above 0")]
    Joint {
        /// The joint, from 1.
        joint: u8,
    },
}

/// What a robot cannot do.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LimitError {
    /// An angle out of the joint's range.
    #[error("J{joint} is {value:.3}° at {time:.3} s: the robot's range is {min}° to {max}°")]
    Angle {
        /// The joint, from 1.
        joint: u8,
        /// The time of the sample in s.
        time: f64,
        /// Its angle in degrees.
        value: f64,
        /// The least angle.
        min: f64,
        /// The greatest angle.
        max: f64,
    },
    /// A joint that would have to be faster than it can.
    #[error("J{joint} has to move at {value:.0}°/s up to {time:.3} s: the robot's limit is {limit}°/s")]
    Speed {
        /// The joint, from 1.
        joint: u8,
        /// The time of the later sample in s.
        time: f64,
        /// The speed in degrees a second.
        value: f64,
        /// The greatest speed.
        limit: f64,
    },
}
