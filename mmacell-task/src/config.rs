use core::time::Duration;

use mmacell_proto::{PlatformPose, RobotPose};

/// What the source leaves to the set-up of the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TaskConfig {
    /// Home of the robot. Default: the origin.
    pub robot_home: RobotPose,
    /// Home of the platform. Default: the origin.
    pub platform_home: PlatformPose,
    /// Where the robot makes room for camera 1; `None` where it need not (§6 step 7). Default: `None`.
    pub camera_1: Option<RobotPose>,
    /// Where the robot makes room for camera 2; `None` where it need not (§6 step 11). Default: `None`.
    pub camera_2: Option<RobotPose>,
    /// Override of robot and platform, 0 to 100 %. Default: 100.
    pub percent: u8,
    /// How often a moving device is asked for its status. Default: 20 ms.
    pub poll: Duration,
    /// How long the robot waits at the part for the vacuum switch, if it has not gone high on the way. Default: 200 ms.
    pub grip_dwell: Duration,
    /// How long the robot is at rest in the place before it lets go. Default: 0.
    pub place_dwell: Duration,
    /// The length of the blow that frees the part: "a few milliseconds" (§6 step 21). Default: 5 ms.
    pub blow: Duration,
    /// How often a part is picked at most, until [`Step::Unpicked`](crate::Step::Unpicked); 0 counts as 1. Default: 3.
    pub attempts: u32,
    /// How long it may take until all devices are ready. Default: no timeout.
    pub ready_timeout: Duration,
    /// How long a step may take that waits for replies, a picture or the vacuum switch. Default: 10 s.
    pub order_timeout: Duration,
    /// How long a step may take that waits for the end of a motion. Default: 60 s.
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
