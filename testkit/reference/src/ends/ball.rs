//! The ball.

use core::time::Duration;

use anyhow::{Result, bail};
use isra_ball::ball::Rule;
use isra_ball::ball::machine::Input;
use isra_ball::{Ball, BallConfig, BallEvent, ENQ, Keys};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::{Do, Driven, Fields, Hooks, Maker, event, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(Driven::<TheBall>(Ball::new(configuration(config, without)?)?))),
    rules: &["MarkOld", "ForgetPoll"],
};

const RULES: [Rule; 2] = [Rule::MarkOld, Rule::ForgetPoll];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<BallConfig> {
    let mut made = BallConfig::default();
    let mut fields = Fields(config.clone());
    fields.take("sensor_type", &mut made.sensor_type)?;
    fields.take("sensor", &mut made.sensor)?;
    fields.end()?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
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

impl Hooks for TheBall {
    type Session = Ball;

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

    fn state(ball: &Ball) -> String {
        ball.machine().name().into()
    }

    fn cells(before: &Ball, _: &Ball, now: Duration, input: &Do, _: bool) -> Vec<String> {
        let inputs = match input {
            Do::Connected => vec![Input::Connected],
            Do::Disconnected => vec![Input::Disconnected],
            Do::Input(bytes) => bytes.iter().filter(|byte| **byte == ENQ).map(|_| Input::Enquiry).collect(),
            Do::Call { .. } => vec![Input::Measured],
            Do::Timeout | Do::Transmitted | Do::Nothing => Vec::new(),
        };
        let mut machine = *before.machine();
        let cell = |input: Input| {
            let cell = format!("{}: {}", machine.name(), input.name());
            machine.on(now, input, &BallConfig::default()).is_ok().then_some(cell)
        };
        inputs.into_iter().filter_map(cell).collect()
    }

    fn transmit_cells(before: &Ball, _: Duration, sent: bool) -> Vec<String> {
        if sent { vec![format!("{}: Reply", before.machine().name())] } else { Vec::new() }
    }
}
