//! The controller of ALTER.

use core::time::Duration;

use anyhow::{Result, bail};
use serde_json::{Map, Value};
use testkit::links::val2_alter::rows;
use testkit::model::Rows as _;
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, HostMessage, SegmentStatus, SessionError, Transform,
    Unselected,
};

use super::{About, Fields, Maker, Noted, event, kind, names, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<AlterController>::boxed(Controller::new(configuration(config, rule)?)?)),
    rules: names::<val2_alter::controller::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<ControllerConfig> {
    let mut made = ControllerConfig::default();
    let mut fields = Fields(config.clone());
    fields.take("framing", &mut made.framing)?;
    fields.take("baud", &mut made.baud)?;
    fields.take("mode", &mut made.mode.0)?;
    fields.take("data", &mut made.data)?;
    fields.take("subroutine", &mut made.subroutine)?;
    fields.take("attempts", &mut made.attempts)?;
    if let Some(gap) = fields.0.remove("gap") {
        made.gap = serde_json::from_value::<Option<u64>>(gap)?.map(Duration::from_nanos);
    }
    if let Some(unselected) = fields.0.remove("unselected") {
        made.unselected = match unselected.as_str() {
            Some("by_mode") => Unselected::ByMode,
            Some("hold") => Unselected::Hold,
            Some("zero") => Unselected::Zero,
            _ => bail!("unselected: {unselected}"),
        };
    }
    fields.end()?;
    made.rules = without(rule);
    Ok(made)
}

struct AlterController;

impl About for AlterController {
    type End = Controller;
    type Rows = rows::Controller;

    fn call(
        session: &mut Controller,
        now: Duration,
        name: &str,
        argument: Value,
    ) -> Result<Result<(), String>> {
        let result = match name {
            "start" => session.start(now),
            "finish" => session.finish(now),
            "interrupt" => session.interrupt(now),
            "resume" => session.resume(now),
            "set_segment" => {
                let (status, number, percent): (u8, u16, u16) = serde_json::from_value(argument)?;
                session.set_segment(SegmentStatus::from(status), number, percent);
                Ok(())
            }
            "set_transform" => {
                session.set_transform(Transform(serde_json::from_value(argument)?));
                Ok(())
            }
            _ => bail!("a controller has no call {name}"),
        };
        Ok(result.map_err(|error| {
            kind(match error {
                SessionError::NotRunning => "not_running",
                SessionError::NotConnected => "not_connected",
                SessionError::AlreadyStarted => "already_started",
                SessionError::EventsFull => "events_full",
                _ => "not_a_controller's",
            })
        }))
    }

    fn event(_: &Controller, happened: ControllerEvent) -> Result<String> {
        Ok(match happened {
            ControllerEvent::Started => event("started").end(),
            ControllerEvent::Refused => event("refused").end(),
            ControllerEvent::GaveUp => event("gave_up").end(),
            ControllerEvent::Reply { reply, values } => {
                event("reply").value("message", &HostMessage::Reply(reply))?.value("values", &values)?.end()
            }
            ControllerEvent::BadReply(code) => event("bad_reply").raw("error", u8::from(code)).end(),
            ControllerEvent::Exception(code) => event("exception").raw("exception", u8::from(code)).end(),
            ControllerEvent::Aborted(code) => event("aborted").raw("exception", u8::from(code)).end(),
            ControllerEvent::Ended(code) => event("ended").raw("error", u8::from(code)).end(),
            ControllerEvent::Stray(message) => event("stray").value("message", &message)?.end(),
            ControllerEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(session: &Controller) -> String {
        Self::Rows::row(session.machine(), Duration::MAX)
    }
}
