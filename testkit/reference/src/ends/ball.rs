//! The ball.

use core::time::Duration;

use anyhow::{Result, bail};
use isra_ball::{Ball, BallConfig, BallEvent, Keys};
use serde::Deserialize;
use serde_json::{Map, Value};
use testkit::links::isra_ball::rows;

use super::{About, Fields, Maker, Noted, event, names, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<TheBall>::boxed(Ball::new(configuration(config, rule)?)?)),
    rules: names::<isra_ball::ball::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<BallConfig> {
    let mut made = BallConfig { rules: without(rule), ..BallConfig::default() };
    let mut fields = Fields(config.clone());
    fields.take("sensor_type", &mut made.sensor_type)?;
    fields.take("sensor", &mut made.sensor)?;
    fields.end()?;
    Ok(made)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Measured {
    force: [i8; 3],
    moment: [i8; 3],
    keys: Keys,
}

struct TheBall;

impl About for TheBall {
    type End = Ball;
    type Rows = rows::Ball;

    fn call(ball: &mut Ball, _: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        match name {
            "measure" => {
                let Measured { force, moment, keys } = serde_json::from_value(argument)?;
                ball.measure(force, moment, keys);
                Ok(Ok(()))
            }
            _ => bail!("a ball has no call {name}"),
        }
    }

    fn event(_: &Ball, happened: BallEvent) -> Result<String> {
        Ok(match happened {
            BallEvent::Reply(packet) => event("reply").value("message", &packet)?.end(),
            BallEvent::Ignored => event("ignored").end(),
            BallEvent::Unknown(byte) => event("unknown").raw("byte", byte).end(),
            BallEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }
}
