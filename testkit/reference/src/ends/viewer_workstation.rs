//! The workstation that draws the arm.

use core::time::Duration;

use anyhow::{Result, bail};
use serde_json::{Map, Value};
use testkit::links::val2_viewer::rows;
use val2_viewer::{Workstation, WorkstationConfig, WorkstationEvent};

use super::{About, Fields, Maker, Noted, event, live_until, names, show, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| {
        Ok(Noted::<ViewerWorkstation>::boxed(Workstation::new(configuration(config, rule)?)?))
    },
    rules: names::<val2_viewer::workstation::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<WorkstationConfig> {
    let mut made = WorkstationConfig { rules: without(rule), ..WorkstationConfig::default() };
    let mut fields = Fields(config.clone());
    fields.time("pause", &mut made.pause)?;
    fields.time("stale_after", &mut made.stale_after)?;
    fields.end()?;
    Ok(made)
}

struct ViewerWorkstation;

impl About for ViewerWorkstation {
    type End = Workstation;
    type Rows = rows::Workstation;

    fn call(
        workstation: &mut Workstation,
        now: Duration,
        name: &str,
        _: Value,
    ) -> Result<Result<(), String>> {
        match name {
            "draw" => workstation.draw(now),
            _ => bail!("a workstation has no call {name}"),
        }
        Ok(Ok(()))
    }

    fn event(workstation: &Workstation, happened: WorkstationEvent) -> Result<String> {
        Ok(match happened {
            WorkstationEvent::Pose(packet) => event("pose")
                .value("message", &packet)?
                .optional("live_until", live_until(workstation.live_until()).as_ref())?
                .end(),
            WorkstationEvent::Missed => event("missed").end(),
            WorkstationEvent::Stale => event("stale").end(),
            WorkstationEvent::Unasked(packet) => event("unasked").value("message", &packet)?.end(),
            WorkstationEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            WorkstationEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }
}
