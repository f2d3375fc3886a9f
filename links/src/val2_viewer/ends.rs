//! Both ends.

use anyhow::Result;
use robot_session::Rules;
use serde::Deserialize as _;
use val2_viewer::{Host, HostConfig, Workstation, WorkstationConfig, WorkstationEvent, host, workstation};

use crate::end::{Call, EndRow, Owner, done, live_until};
use crate::fields::Fields;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Workstation>("workstation"), EndRow::of::<Host>("host")];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    const CALLS: &'static [Call<Self>] =
        &[("set_pose", |host, now, argument| done(host.set_pose(now, <[i16; 12]>::deserialize(argument)?)))];

    fn new(fields: &mut Fields, rules: Rules<host::Rule>) -> Result<Self> {
        let mut made = HostConfig { rules, ..HostConfig::default() };
        fields.time("interval", &mut made.interval)?;
        fields.time("max_age", &mut made.max_age)?;
        Ok(Self::new(made)?)
    }
}

impl Owner for Workstation {
    type End = Self;
    type Rule = workstation::Rule;

    const CALLS: &'static [Call<Self>] = &[("draw", |workstation, now, _| done(workstation.draw(now)))];

    fn new(fields: &mut Fields, rules: Rules<workstation::Rule>) -> Result<Self> {
        let mut made = WorkstationConfig { rules, ..WorkstationConfig::default() };
        fields.time("pause", &mut made.pause)?;
        fields.time("stale_after", &mut made.stale_after)?;
        Ok(Self::new(made)?)
    }

    fn shows(&self, event: &WorkstationEvent) -> Option<(&'static str, String)> {
        matches!(event, WorkstationEvent::Pose(_)).then(|| live_until(self.live_until()))?
    }
}
