//! Both ends.

use anyhow::Result;
use isra_ball::{Ball, BallConfig, ENQ, Host, HostConfig, HostEvent, Keys, ball, host};
use robot_session::end::Rules;
use serde::Deserialize;

use crate::end::{Act, Call, EndRow, Owner, PairedItem, PendingLimit, done, live_until};
use crate::given::GivenFields;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Host>(), EndRow::of::<Ball>()];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    const PAIRED: &'static [PairedItem] = &[PairedItem {
        begins: Act::Sent,
        ends: &[Act::Event("new"), Act::Event("old"), Act::Event("missed")],
        room: PendingLimit::Most(1),
    }];

    fn new(given: GivenFields, rules: Rules<host::Rule>) -> Result<Self> {
        let made = given.configure(HostConfig::default().with_rules(rules))?;
        Ok(Self::new(made)?)
    }

    fn shows(&self, event: &HostEvent) -> Option<(&'static str, String)> {
        matches!(event, HostEvent::Packet(_)).then(|| live_until(self.live_until()))?
    }
}

impl Owner for Ball {
    type End = Self;
    type Rule = ball::Rule;

    const CALLS: &'static [Call<Self>] = &[("measure", |ball, _, argument| {
        let MeasuredValues { force, moment, keys } = MeasuredValues::deserialize(argument)?;
        done(ball.measure(force, moment, keys))
    })];

    const PAIRED: &'static [PairedItem] = &[
        PairedItem {
            begins: Act::Byte(ENQ),
            ends: &[Act::Sent, Act::Connection],
            room: PendingLimit::Merged,
        },
        PairedItem { begins: Act::Sent, ends: &[Act::Event("reply")], room: PendingLimit::Most(1) },
    ];

    fn new(given: GivenFields, rules: Rules<ball::Rule>) -> Result<Self> {
        let made = given.configure(BallConfig::default().with_rules(rules))?;
        Ok(Self::new(made)?)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeasuredValues {
    force: [i8; 3],
    moment: [i8; 3],
    keys: Keys,
}
