use core::time::Duration;

use mmacell_proto::{PlatformPose, RobotPose};

/// The set-up of the cell, which the source leaves open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskConfig {
    /// Home of the robot. Default: the origin.
    pub robot_home: RobotPose,
    /// Home of the platform. Default: the origin.
    pub platform_home: PlatformPose,
    /// The pose in which the robot is out of the way of camera 1; `None` if it need not move (§6 step 7). Default:
    /// `None`.
    pub camera_1: Option<RobotPose>,
    /// The pose in which the robot is out of the way of camera 2; `None` if it need not move (§6 step 11). Default:
    /// `None`.
    pub camera_2: Option<RobotPose>,
    /// Override of robot and platform, 0 to 100 %. Default: 100.
    pub percent: u8,
    /// The interval at which a moving device is polled for its status. Default: 20 ms.
    pub poll: Duration,
    /// The time for which the robot waits at the part for the vacuum switch, if it has not gone high on the way.
    /// Default: 200 ms.
    pub grip_dwell: Duration,
    /// The time for which the robot is at rest in the place before it lets go. Default: 0.
    pub place_dwell: Duration,
    /// The length of the blow that frees the part: "a few milliseconds" (§6 step 21). Default: 5 ms.
    pub blow: Duration,
    /// The largest number of attempts to pick a part, until [`Step::Unpicked`](crate::Step::Unpicked); 0 counts as 1.
    /// Default: 3.
    pub attempts: u32,
    /// The longest time until all devices are ready. Default: no timeout.
    pub ready_timeout: Duration,
    /// The longest time of a step that waits for replies, a picture or the vacuum switch. Default: 10 s.
    pub order_timeout: Duration,
    /// The longest time of a step that waits for the end of a motion. Default: 60 s.
    pub motion_timeout: Duration,
}

impl TaskConfig {
    /// The documented defaults.
    pub const DEFAULT: Self = Self {
        robot_home: RobotPose::ORIGIN,
        platform_home: PlatformPose::ORIGIN,
        camera_1: None,
        camera_2: None,
        percent: 100,
        poll: Duration::from_millis(20),
        grip_dwell: Duration::from_millis(200),
        place_dwell: Duration::ZERO,
        blow: Duration::from_millis(5),
        attempts: 3,
        ready_timeout: Duration::MAX,
        order_timeout: Duration::from_secs(10),
        motion_timeout: Duration::from_secs(60),
    };
}

impl Default for TaskConfig {
    fn default() -> Self {
        Self::DEFAULT
    }
}
