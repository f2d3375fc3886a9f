//! The robot: it runs the text of the program, as the controller of `simulate fanuc` does.

use anyhow::{Result, bail};

use crate::devices::fanuc_hmi_modbus::program::{Machine, load_text};
use cellwire_motion::{Arm, Kinematics as _, Limits, Planner, Pose};
use cellwire_sim::fanuc::Tables;

/// The time between two samples of the joints, in s.
const STEP: f64 = 0.002;

/// The joints of the robot while it runs the program once.
#[derive(Debug)]
pub(super) struct Run {
    arm: Arm,
    /// The joints from the start of the program on, at each [`STEP`].
    joints: Vec<[f64; 6]>,
    /// The time for which the robot is at rest first, in s.
    rest: f64,
}

impl Run {
    /// Runs a program from `joints` on.
    ///
    /// # Errors
    /// If it stops with an alarm.
    pub(super) fn new(text: &str, arm: Arm, joints: [f64; 6]) -> Result<Self> {
        let (main, programs) = load_text(text)?;
        let planner = Planner::new(arm, Limits::LR_MATE_200ID, joints);
        let (mut machine, mut tables) = (Machine::new(main, programs, planner, false), Tables::empty());
        let mut samples = Vec::new();
        for time in (0..).map(|step| f64::from(step) * STEP) {
            machine.advance(time, &mut tables);
            samples.push(machine.joints());
            if let Some(alarm) = machine.events().iter().find(|event| event["event"] == "alarm") {
                bail!("the robot stops: {}", alarm["why"]);
            }
            if machine.has_ended() {
                break;
            }
        }
        let rests = |sample: &&[f64; 6]| sample.iter().zip(joints).all(|(a, b)| (a - b).abs() < 1e-6);
        let rest = samples.iter().take_while(rests).count().saturating_sub(1);
        #[expect(clippy::cast_precision_loss, reason = "a number of samples")]
        let rest = rest as f64 * STEP;
        Ok(Self { arm, joints: samples, rest })
    }

    /// Returns the duration of the motion, in s.
    pub(super) fn seconds(&self) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a number of samples")]
        let last = self.joints.len().saturating_sub(1) as f64;
        last * STEP - self.rest
    }

    /// Returns the pose at a time since the motion began, in s; at rest before and after it.
    pub(super) fn at(&self, seconds: f64) -> Pose {
        let steps = ((seconds + self.rest) / STEP).max(0.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it is not negative")]
        let before = steps as usize;
        let last = self.joints.last().copied().unwrap_or_default();
        let at = |index: usize| self.joints.get(index).copied().unwrap_or(last);
        let (mut joints, to, share) = (at(before), at(before + 1), steps.fract());
        joints.iter_mut().zip(to).for_each(|(joint, to)| *joint += (to - *joint) * share);
        self.arm.forward(&joints)
    }
}
