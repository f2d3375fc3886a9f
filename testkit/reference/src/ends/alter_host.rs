//! The host of ALTER.

use core::time::Duration;

use anyhow::{Result, bail};
use serde_json::{Map, Value};
use testkit::links::val2_alter::rows;
use testkit::model::Rows as _;
use val2_alter::{
    Exception, ExceptionOutcome, Host, HostConfig, HostEvent, LostReason, Policy, RobotMessage, SessionError,
    UnknownReason,
};

use super::{About, Fields, Maker, Noted, event, kind, names, show, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<AlterHost>::boxed(Host::new(configuration(config, rule)?)?)),
    rules: names::<val2_alter::host::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<HostConfig> {
    let mut made = HostConfig::default();
    let mut fields = Fields(config.clone());
    fields.take("framing", &mut made.framing)?;
    fields.take("baud", &mut made.baud)?;
    fields.take("mode", &mut made.mode.0)?;
    fields.take("subroutine", &mut made.subroutine)?;
    fields.take("repeats", &mut made.repeats)?;
    fields.take("silence_cycles", &mut made.silence_cycles)?;
    if let Some(gap) = fields.0.remove("gap") {
        made.gap = serde_json::from_value::<Option<u64>>(gap)?.map(Duration::from_nanos);
    }
    fields.time("target_timeout", &mut made.target_timeout)?;
    fields.time("reserve", &mut made.reserve)?;
    fields.time("max_delay", &mut made.max_delay)?;
    if let Some(chosen) = fields.0.remove("policy") {
        made.policy = policy(&chosen)?;
    }
    if let Some(limits) = fields.0.remove("limits") {
        let Value::Object(limits) = limits else { bail!("limits is an object") };
        let mut limits = Fields(limits);
        limits.take("velocity", &mut made.limits.velocity)?;
        limits.take("acceleration", &mut made.limits.acceleration)?;
        limits.end()?;
    }
    fields.end()?;
    made.rules = without(rule);
    Ok(made)
}

fn policy(value: &Value) -> Result<Policy> {
    Ok(match value.as_str() {
        Some("accept") => Policy::Accept,
        Some("refuse") => Policy::Refuse,
        Some("ignore") => Policy::Ignore,
        _ => bail!("no policy {value}"),
    })
}

struct AlterHost;

impl About for AlterHost {
    type End = Host;
    type Rows = rows::Host;

    fn call(host: &mut Host, now: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        match name {
            "set_target" => host.set_target(now, serde_json::from_value(argument)?),
            "clear_target" => host.clear_target(now),
            "stop" => host.stop(now),
            "set_policy" => host.set_policy(now, policy(&argument)?),
            "set_subroutine" => host.set_subroutine(now, serde_json::from_value(argument)?),
            "exception" => {
                let code: u8 = serde_json::from_value(argument)?;
                return Ok(host.exception(now, Exception::from(code)).map_err(|error| {
                    kind(match error {
                        SessionError::NoSubroutine => "no_subroutine",
                        SessionError::NotRunning => "not_running",
                        SessionError::ExceptionPending { .. } => "exception_pending",
                        SessionError::EventsFull => "events_full",
                        _ => "not_a_host's",
                    })
                }));
            }
            _ => bail!("a host has no call {name}"),
        }
        Ok(Ok(()))
    }

    fn event(_: &Host, happened: HostEvent) -> Result<String> {
        Ok(match happened {
            HostEvent::Start(start) => event("start").value("message", &RobotMessage::Start(start))?.end(),
            HostEvent::Motion(motion) => {
                event("motion").value("message", &RobotMessage::Motion(motion))?.end()
            }
            HostEvent::End(end) => event("end").value("message", &RobotMessage::End(end))?.end(),
            HostEvent::Lost(reason) => {
                let reason = match reason {
                    LostReason::Silence => "silence",
                    LostReason::Restart => "restart",
                    LostReason::Disconnected => "disconnected",
                };
                event("lost").value("reason", reason)?.end()
            }
            HostEvent::Exception(exception, outcome) => {
                let (outcome, reason) = match outcome {
                    ExceptionOutcome::Done => ("done", None),
                    ExceptionOutcome::NotDone => ("not_done", None),
                    ExceptionOutcome::Unknown(reason) => (
                        "unknown",
                        Some(match reason {
                            UnknownReason::Ended => "ended",
                            UnknownReason::OutOfSequence => "out_of_sequence",
                            UnknownReason::Unclear => "unclear",
                        }),
                    ),
                };
                event("exception")
                    .raw("exception", u8::from(exception))
                    .value("outcome", outcome)?
                    .optional("reason", reason)?
                    .end()
            }
            HostEvent::Stopped => event("stopped").end(),
            HostEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            HostEvent::Missed => event("missed").end(),
            HostEvent::Rejected(code) => event("rejected").raw("error", u8::from(code)).end(),
            HostEvent::TargetStale => event("target_stale").end(),
            HostEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(host: &Host) -> String {
        Self::Rows::row(host.machine(), Duration::ZERO)
    }
}
