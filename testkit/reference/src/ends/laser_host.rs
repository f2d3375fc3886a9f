//! The host of the laser.

use core::time::Duration;

use anyhow::{Context, Result, bail};
use laser_eb90::{EncodeError, Host, HostConfig, HostEvent, Payload, SessionError, UnknownReason};
use robot_session::End as _;
use serde_json::{Map, Value};
use testkit::links::laser_eb90::rows;
use testkit::model::Rows as _;

use super::{About, Fields, Maker, Noted, event, kind, names, show, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<LaserHost>::boxed(Host::new(configuration(config, rule)?)?)),
    rules: names::<laser_eb90::host::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<HostConfig> {
    let mut fields = Fields(config.clone());
    let mut baud = laser_eb90::timing::BAUD;
    fields.take("baud", &mut baud)?;
    let mut made = HostConfig::at_baud(baud);
    fields.take("profile", &mut made.profile)?;
    fields.take("words", &mut made.words)?;
    fields.take("batch", &mut made.batch)?;
    fields.take("resends", &mut made.resends)?;
    fields.take("resend_on_silence", &mut made.resend_on_silence)?;
    fields.take("longest_frame", &mut made.longest_frame)?;
    fields.take("controller_drops_partial", &mut made.controller_drops_partial)?;
    fields.time("answer_timeout", &mut made.answer_timeout)?;
    fields.time("execution_timeout", &mut made.execution_timeout)?;
    fields.time("settle", &mut made.settle)?;
    fields.time("max_pause", &mut made.max_pause)?;
    fields.time("reply_time", &mut made.reply_time)?;
    fields.time("earlier_execution", &mut made.earlier_execution)?;
    fields.time("backoff", &mut made.backoff)?;
    fields.time("full_timeout", &mut made.full_timeout)?;
    fields.end()?;
    made.rules = without(rule);
    Ok(made)
}

struct LaserHost;

impl About for LaserHost {
    type End = Host;
    type Rows = rows::Host;

    fn call(host: &mut Host, _: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        match name {
            "resume" => host.resume(),
            "take_back" => drop(host.take_back()),
            "submit" => {
                let word: u16 =
                    serde_json::from_value(argument.get("word").context("submit has a word")?.clone())?;
                let items = argument.get("parameters").and_then(Value::as_array).cloned().unwrap_or_default();
                return Ok(host.submit(word, |payload| write(payload, &items)).map(drop).map_err(|error| {
                    match error {
                        SessionError::Full => kind("full"),
                        SessionError::UnknownWord { .. } => kind("unknown_word"),
                        SessionError::LoneShort => kind("lone_short"),
                        SessionError::Encode(error) => show(&error),
                        _ => kind("not_a_host's"),
                    }
                }));
            }
            _ => bail!("a host has no call {name}"),
        }
        Ok(Ok(()))
    }

    fn state(host: &Host) -> String {
        Self::Rows::row(&host.core().machine, Duration::ZERO)
    }

    fn event(host: &Host, happened: HostEvent) -> Result<String> {
        Ok(match happened {
            HostEvent::Done { first, count, resends, unanswered } => event("done")
                .raw("first", first)
                .raw("count", count)
                .raw("resends", resends)
                .raw("unanswered", unanswered)
                .end(),
            HostEvent::Answer { ticket } => {
                event("answer").raw("ticket", ticket).value("items", &host.answer())?.end()
            }
            HostEvent::Refused { first, count, refusal } => {
                event("refused").raw("first", first).raw("count", count).value("refusal", &refusal)?.end()
            }
            HostEvent::Unknown { first, count, reason } => {
                let object = event("unknown").raw("first", first).raw("count", count);
                match reason {
                    UnknownReason::Silence => object.value("reason", "silence")?,
                    UnknownReason::Corrupt => object.value("reason", "corrupt")?,
                    UnknownReason::OtherWord { expected, found } => {
                        object.value("reason", "other_word")?.raw("expected", expected).raw("found", found)
                    }
                    UnknownReason::PartialFrame => object.value("reason", "partial_frame")?,
                    UnknownReason::ExecutionFailed => object.value("reason", "execution_failed")?,
                    UnknownReason::Disconnected => object.value("reason", "disconnected")?,
                    _ => bail!("a reason without a name"),
                }
                .end()
            }
            HostEvent::Unasked { word } => event("unasked").raw("word", word).end(),
            HostEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            HostEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }
}

/// The parameters of an instruction, as the items of a message object.
pub(super) fn write(payload: &mut Payload<'_>, items: &[Value]) -> Result<(), EncodeError> {
    fn numbers<T: serde::de::DeserializeOwned>(values: &Value) -> Vec<T> {
        serde_json::from_value(values.clone()).unwrap_or_default()
    }
    for item in items {
        for (tag, values) in item.as_object().into_iter().flatten() {
            match tag.as_str() {
                // A value that is no number cannot be written in JSON: `null`.
                "f32" => {
                    let values: Vec<Option<f32>> = numbers(values);
                    let values: Vec<f32> =
                        values.into_iter().map(|value| value.unwrap_or(f32::NAN)).collect();
                    payload.f32(&values)?
                }
                "i16" => payload.i16(&numbers::<i16>(values))?,
                "u8" => payload.u8(&numbers::<u8>(values))?,
                _ => payload.char(values.as_str().unwrap_or_default().as_bytes())?,
            };
        }
    }
    Ok(())
}
