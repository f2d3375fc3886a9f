//! The computer that a workstation asks for poses.

use core::time::Duration;

use anyhow::{Result, bail};
use serde_json::{Map, Value};
use testkit::links::val2_viewer::rows;
use val2_viewer::{Host, HostConfig, HostEvent};

use super::{About, Fields, Maker, Noted, event, names, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<ViewerHost>::boxed(Host::new(configuration(config, rule)?)?)),
    rules: names::<val2_viewer::host::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<HostConfig> {
    let mut made = HostConfig { rules: without(rule), ..HostConfig::default() };
    let mut fields = Fields(config.clone());
    fields.time("interval", &mut made.interval)?;
    fields.time("max_age", &mut made.max_age)?;
    fields.end()?;
    Ok(made)
}

struct ViewerHost;

impl About for ViewerHost {
    type End = Host;
    type Rows = rows::Host;

    fn call(host: &mut Host, now: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        match name {
            "set_pose" => host.set_pose(now, serde_json::from_value(argument)?),
            _ => bail!("a host has no call {name}"),
        }
        Ok(Ok(()))
    }

    fn event(_: &Host, happened: HostEvent) -> Result<String> {
        Ok(match happened {
            HostEvent::Asked => event("asked").end(),
            HostEvent::Sent(packet) => event("sent").value("message", &packet)?.end(),
            HostEvent::Ignored => event("ignored").end(),
            HostEvent::Stale => event("stale").end(),
            HostEvent::Unknown(byte) => event("unknown").raw("byte", byte).end(),
            HostEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }
}
