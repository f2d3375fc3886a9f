//! The file of a task: poses, times, and the parts.

use std::path::Path;
use std::time::Duration;

use anyhow::{Result, ensure};
use mmacell_proto::{CentralConfig, PlatformPose, RobotPose};
use mmacell_task::TaskConfig;
use serde::{Deserialize, Serialize};

use crate::io::journal::{Fingerprint, Outcome};
use crate::io::sheet;
use cellwire_links::json;
use cellwire_links::settings::{ANY_TIME, Configure, FieldVisitor};

/// The poses of a part: where it is, and where it goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// The pose in which the platform turns the part towards the gripper.
    pub platform: PlatformPose,
    /// The pose at which the robot takes the part.
    pub pick: RobotPose,
    /// The pose at which the robot puts the part.
    pub place: RobotPose,
}

/// The settings of a run.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The number of parts; 0: those of `part`.
    pub parts: usize,
    /// The parts that simulated cameras see.
    pub part: Vec<Part>,
    /// The time in which a simulated vacuum builds up.
    pub vacuum: Duration,
    /// The settings of the task.
    pub task: TaskConfig,
    /// The settings of the sessions with robot and platform.
    pub central: CentralConfig,
}

impl Default for Settings {
    fn default() -> Self {
        let vacuum = Duration::from_millis(50);
        Self {
            parts: 0,
            part: Vec::new(),
            vacuum,
            task: TaskConfig::DEFAULT,
            central: CentralConfig::DEFAULT,
        }
    }
}

impl Settings {
    /// Returns the number of parts.
    ///
    /// # Errors
    /// If there are no parts, or more than the simulated cameras see.
    pub fn count(&self, cameras_are_simulated: bool) -> Result<usize> {
        let count = if self.parts == 0 { self.part.len() } else { self.parts };
        ensure!(count > 0, "the task has no parts: give `parts`, or [[part]] with platform, pick and place");
        ensure!(
            !cameras_are_simulated || count <= self.part.len(),
            "simulated cameras have {} [[part]], but `parts` is {count}",
            self.part.len()
        );
        Ok(count)
    }

    /// Returns the value by which a journal recognizes this task.
    pub fn fingerprint(&self) -> String {
        let mut fingerprint = Fingerprint::default();
        fingerprint.add(format!("{} {}", self.parts, json::value(&self.part)).as_bytes());
        fingerprint.to_string()
    }

    /// Draws the ways of the robot seen from above: those with a part on the gripper are thick. With outcomes of the parts,
    /// the ways are marked by them.
    ///
    /// # Errors
    /// If only the cameras know the places, or the file cannot be written.
    pub fn draw(&self, file: &Path, outcomes: &[Outcome]) -> Result<()> {
        ensure!(!self.part.is_empty(), "nothing can be drawn: only the cameras know where the parts are");
        let place = |pose: RobotPose| {
            let [x, y, ..] = pose.units();
            [f64::from(x) / 1000.0, f64::from(y) / 1000.0]
        };
        let mut route = vec![(place(self.task.robot_home), false)];
        let mut marks: Vec<Outcome> = outcomes.first().copied().into_iter().collect();
        for (index, part) in self.part.iter().enumerate() {
            let cameras = [self.task.camera_1, self.task.camera_2].into_iter().flatten();
            route.extend(cameras.map(|pose| (place(pose), false)));
            route.extend([(place(part.pick), false), (place(part.place), true)]);
            if !outcomes.is_empty() {
                marks.resize(route.len(), outcomes.get(index).copied().unwrap_or(Outcome::NotSent));
            }
        }
        sheet::write_route(file, &route, &marks, ["with a part", "empty"])
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { parts, part, vacuum, task, central } = self;
        fields.whole("parts", 0..=1_000_000, "parts", "parts to place; 0: every [[part]]", parts);
        let shape = "[[part]] platform = [rad, rad], pick = [mm, mm, mm, rad], place = [mm, mm, mm, rad]";
        fields.parsed("part", shape, "the parts that simulated cameras report, in order", part);
        let about = "how long the vacuum of the simulated periphery builds up";
        fields.time("vacuum", ANY_TIME, about, vacuum);
        fields.group("task", |fields| task.configure(fields));
        fields.group("central", |fields| central.configure(fields));
    }
}
