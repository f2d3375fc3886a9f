//! The task's configuration, field by field.

use mmacell_proto::robot_session::spec::{ANY_TIME, Configure, FieldVisitor, SOME_TIME};

use crate::config::TaskConfig;

impl Configure for TaskConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        const ROBOT: &str = "[mm, mm, mm, rad]";
        let Self {
            robot_home,
            platform_home,
            camera_1,
            camera_2,
            percent,
            poll,
            grip_dwell,
            place_dwell,
            blow,
            attempts,
            ready_timeout,
            order_timeout,
            motion_timeout,
        } = self;
        fields.parsed("robot_home", ROBOT, "the robot at rest", robot_home);
        fields.parsed("platform_home", "[rad, rad]", "the platform at rest", platform_home);
        let about = "the robot's position clear of the camera; null if not needed";
        fields.parsed("camera_1", ROBOT, about, camera_1);
        fields.parsed("camera_2", ROBOT, about, camera_2);
        fields.whole("percent", 0..=100, "%", "the override of robot and platform", percent);
        fields.time("poll", SOME_TIME, "how often a moving device is asked for its status", poll);
        let about = "how long the robot waits at the part for the vacuum switch";
        fields.time("grip_dwell", ANY_TIME, about, grip_dwell);
        let about = "how long the robot rests in the place before it releases the part";
        fields.time("place_dwell", ANY_TIME, about, place_dwell);
        fields.time("blow", ANY_TIME, "how long it blows to free the part", blow);
        fields.whole("attempts", 1..=u32::MAX, "times", "the maximum of attempts to pick a part", attempts);
        let about = "how long it may take until all devices are ready";
        fields.time("ready_timeout", ANY_TIME, about, ready_timeout);
        let about = "how long a reply, a picture or the vacuum switch may take";
        fields.time("order_timeout", SOME_TIME, about, order_timeout);
        fields.time("motion_timeout", SOME_TIME, "how long a motion may take", motion_timeout);
    }
}

#[cfg(feature = "settings")]
mmacell_proto::robot_session::deserialize!(TaskConfig, TaskConfig::default());
