//! Both ends.

use anyhow::Result;
use isra_ball::{Ball, BallConfig, Host, HostConfig, HostEvent, Keys, ball, host};
use robot_session::Rules;
use serde::Deserialize;

use crate::end::{Call, EndRow, Owner, done, live_until};
use crate::fields::Fields;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Host>("host"), EndRow::of::<Ball>("ball")];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    fn new(fields: &mut Fields, rules: Rules<host::Rule>) -> Result<Self> {
        let mut made = HostConfig { rules, ..HostConfig::default() };
        fields.take("baud", &mut made.baud)?;
        fields.time("period", &mut made.period)?;
        fields.time("max_delay", &mut made.max_delay)?;
        fields.time("max_age", &mut made.max_age)?;
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

    fn new(fields: &mut Fields, rules: Rules<ball::Rule>) -> Result<Self> {
        let mut made = BallConfig { rules, ..BallConfig::default() };
        fields.take("sensor_type", &mut made.sensor_type)?;
        fields.take("sensor", &mut made.sensor)?;
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
