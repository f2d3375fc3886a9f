//! Both ends.

use anyhow::Result;
use isra_ball::{Ball, BallConfig, ENQ, Host, HostConfig, HostEvent, Keys, ball, host};
use robot_session::end::Rules;
use serde::Deserialize;

use crate::end::{By, Call, EndRow, Once, Owner, Room, done, live_until};
use crate::given::Given;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Host>(), EndRow::of::<Ball>()];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    const ONCE: &'static [Once] = &[Once {
        begins: By::Sent,
        ends: &[By::Event("new"), By::Event("old"), By::Event("missed")],
        room: Room::Most(1),
    }];

    fn new(given: Given, rules: Rules<host::Rule>) -> Result<Self> {
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
        let Measured { force, moment, keys } = Measured::deserialize(argument)?;
        done(ball.measure(force, moment, keys))
    })];

    const ONCE: &'static [Once] = &[
        Once { begins: By::Byte(ENQ), ends: &[By::Sent, By::Connection], room: Room::Merged },
        Once { begins: By::Sent, ends: &[By::Event("reply")], room: Room::Most(1) },
    ];

    fn new(given: Given, rules: Rules<ball::Rule>) -> Result<Self> {
        let made = given.configure(BallConfig::default().with_rules(rules))?;
        Ok(Self::new(made)?)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Measured {
    force: [i8; 3],
    moment: [i8; 3],
    keys: Keys,
}
