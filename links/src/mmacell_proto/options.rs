//! The configurations of both ends, by field.

use mmacell_task::TaskConfig;

use crate::settings::{ANY_TIME, Configure, SOME_TIME, Table, json};
use mmacell_proto::{CentralConfig, DeviceConfig, Dialect, ErrorCode};

impl Configure for Dialect {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.flag("itr", "ITR is STP", &mut self.itr);
        table.flag("ovrd", "OVRD is OVR", &mut self.ovrd);
        table.flag("clos", "HND…CLOS is HND…CLOSE", &mut self.clos);
        table.flag("off", "SRVOFF is SRVOF", &mut self.off);
        table.flag("lone_lf", "a line ends with a line feed alone", &mut self.lone_lf);
        table.flag("blank", "a blank follows the sign of an integer", &mut self.blank);
        let about = "all five digits of an integer count, also above 32767";
        table.flag("wide_integers", about, &mut self.wide_integers);
    }
}

impl Configure for DeviceConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        let mut refusal = i32::from(self.refusal);
        let about = "the error number of what the protocol itself refuses";
        table.whole("refusal", 1..=32767, "", about, &mut refusal);
        self.refusal = ErrorCode::from(refusal);
        table.group("accepts", |table| self.accepts.configure(table));
        table.group("writes", |table| self.writes.configure(table));
    }
}

impl Configure for CentralConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        table.time("timeout", SOME_TIME, "how long a reply may take", &mut self.timeout);
        let about = "a status asked for sooner after the start of a motion may be older than it";
        table.time("settle", ANY_TIME, about, &mut self.settle);
        let about = "how far from its target a device has arrived: 1 µm, 0.1 mrad";
        table.whole("tolerance", 0..=u32::MAX, "units", about, &mut self.tolerance);
        table.group("accepts", |table| self.accepts.configure(table));
        table.group("writes", |table| self.writes.configure(table));
    }
}

impl Configure for TaskConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        const ROBOT: &str = "[mm, mm, mm, rad]";
        table.parsed("robot_home", ROBOT, json(&self.robot_home), "the robot at rest", &mut self.robot_home);
        let (shape, default) = ("[rad, rad]", json(&self.platform_home));
        table.parsed("platform_home", shape, default, "the platform at rest", &mut self.platform_home);
        let about = "where the robot makes room for the camera; null where it need not";
        table.parsed("camera_1", ROBOT, json(&self.camera_1), about, &mut self.camera_1);
        table.parsed("camera_2", ROBOT, json(&self.camera_2), about, &mut self.camera_2);
        table.whole("percent", 0..=100, "%", "the override of robot and platform", &mut self.percent);
        table.time("poll", SOME_TIME, "how often a moving device is asked for its status", &mut self.poll);
        let about = "how long the robot waits at the part for the vacuum switch";
        table.time("grip_dwell", ANY_TIME, about, &mut self.grip_dwell);
        let about = "how long the robot is at rest in the place before it lets go";
        table.time("place_dwell", ANY_TIME, about, &mut self.place_dwell);
        table.time("blow", ANY_TIME, "how long it blows to free the part", &mut self.blow);
        table.whole(
            "attempts",
            1..=u32::MAX,
            "times",
            "how often a part is picked at most",
            &mut self.attempts,
        );
        let about = "how long it may take until all devices are ready";
        table.time("ready_timeout", ANY_TIME, about, &mut self.ready_timeout);
        let about = "how long a reply, a picture or the vacuum switch may take";
        table.time("order_timeout", SOME_TIME, about, &mut self.order_timeout);
        table.time("motion_timeout", SOME_TIME, "how long a motion may take", &mut self.motion_timeout);
    }
}
