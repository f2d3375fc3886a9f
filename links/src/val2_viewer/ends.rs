//! Both ends.

use anyhow::Result;
use robot_session::end::Rules;
use serde::Deserialize as _;
use val2_viewer::{
    ENQ, Host, HostConfig, Workstation, WorkstationConfig, WorkstationEvent, host, workstation,
};

use crate::end::{Act, Call, EndRow, Owner, PairedItem, PendingLimit, done, live_until};
use crate::given::GivenFields;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Workstation>(), EndRow::of::<Host>()];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    const CALLS: &'static [Call<Self>] =
        &[("set_pose", |host, now, argument| done(host.set_pose(now, <[i16; 12]>::deserialize(argument)?)))];

    const PAIRED: &'static [PairedItem] = &[
        PairedItem {
            begins: Act::Byte(ENQ),
            ends: &[Act::Sent, Act::Connection],
            room: PendingLimit::Merged,
        },
        PairedItem { begins: Act::Sent, ends: &[Act::Event("sent")], room: PendingLimit::Most(1) },
    ];

    fn new(given: GivenFields, rules: Rules<host::Rule>) -> Result<Self> {
        let made = given.configure(HostConfig::default().with_rules(rules))?;
        Ok(Self::new(made)?)
    }
}

impl Owner for Workstation {
    type End = Self;
    type Rule = workstation::Rule;

    const CALLS: &'static [Call<Self>] = &[("draw", |workstation, now, _| done(workstation.draw(now)))];

    const PAIRED: &'static [PairedItem] = &[PairedItem {
        begins: Act::Sent,
        ends: &[Act::Event("pose"), Act::Event("missed")],
        room: PendingLimit::Most(1),
    }];

    fn new(given: GivenFields, rules: Rules<workstation::Rule>) -> Result<Self> {
        let made = given.configure(WorkstationConfig::default().with_rules(rules))?;
        Ok(Self::new(made)?)
    }

    fn shows(&self, event: &WorkstationEvent) -> Option<(&'static str, String)> {
        matches!(event, WorkstationEvent::Pose(_)).then(|| live_until(self.live_until()))?
    }
}
