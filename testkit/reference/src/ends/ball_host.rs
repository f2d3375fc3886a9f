//! The computer that polls the ball.

use anyhow::{Result, bail};
use isra_ball::{Host, HostConfig, HostEvent};
use serde_json::{Map, Value};
use testkit::links::isra_ball::rows;

use super::{About, Fields, Maker, Noted, event, live_until, names, show, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<BallHost>::boxed(Host::new(configuration(config, rule)?)?)),
    rules: names::<isra_ball::host::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<HostConfig> {
    let mut made = HostConfig { rules: without(rule), ..HostConfig::default() };
    let mut fields = Fields(config.clone());
    fields.take("baud", &mut made.baud)?;
    fields.time("period", &mut made.period)?;
    fields.time("max_delay", &mut made.max_delay)?;
    fields.time("max_age", &mut made.max_age)?;
    fields.end()?;
    Ok(made)
}

struct BallHost;

impl About for BallHost {
    type End = Host;
    type Rows = rows::Host;

    fn event(host: &Host, happened: HostEvent) -> Result<String> {
        Ok(match happened {
            HostEvent::Packet(packet) => event("new")
                .value("message", &packet)?
                .optional("live_until", live_until(host.live_until()).as_ref())?
                .end(),
            HostEvent::Old(packet) => event("old").value("message", &packet)?.end(),
            HostEvent::Missed => event("missed").end(),
            HostEvent::Stale => event("stale").end(),
            HostEvent::Unasked(packet) => event("unasked").value("message", &packet)?.end(),
            HostEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            HostEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }
}
