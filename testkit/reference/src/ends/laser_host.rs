//! The host of the laser.

use core::time::Duration;

use anyhow::{Context, Result, bail};
use laser_eb90::host::HostRule;
use laser_eb90::host::machine::HostLink;
use laser_eb90::{
    Decoder, EncodeError, Host, HostConfig, HostEvent, Instruction, Payload, Refusal, SessionError,
    UnknownReason,
};
use robot_session::{Decoder as _, Session as _};
use serde_json::{Map, Value};

use super::{Do, Driven, Fields, Hooks, Maker, event, kind, show, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(Driven::<LaserHost>(Host::new(configuration(config, without)?)?))),
    rules: || {
        [
            "DrainFirst",
            "ConfirmLate",
            "FinalCodes",
            "FailedIsUnknown",
            "OutlastExecution",
            "UnansweredIsUnknown",
            "CompareWord",
        ]
        .map(String::from)
        .to_vec()
    },
};

const RULES: [HostRule; 7] = [
    HostRule::DrainFirst,
    HostRule::ConfirmLate,
    HostRule::FinalCodes,
    HostRule::FailedIsUnknown,
    HostRule::OutlastExecution,
    HostRule::UnansweredIsUnknown,
    HostRule::CompareWord,
];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<HostConfig> {
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
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(made)
}

struct LaserHost;

impl Hooks for LaserHost {
    type Session = Host;

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

    fn state(host: &Host) -> String {
        let filled = host.machine().name() == "Idle" && host.machine().next.is_some();
        format!("{}{}", host.machine().name(), if filled { ", filled" } else { "" })
    }

    fn cells(before: &Host, _: &Host, now: Duration, input: &Do, refused: bool) -> Vec<String> {
        let due = before.poll_timeout().is_some_and(|due| now >= due);
        let input = match input {
            Do::Connected => "Connected".into(),
            Do::Disconnected => "Disconnected".into(),
            Do::Timeout if due => "Timeout".into(),
            Do::Transmitted => "Transmitted".into(),
            Do::Input(bytes) => match received(before, bytes) {
                Some(input) => input,
                None => return Vec::new(),
            },
            Do::Call { name, .. } if !refused => match name.as_str() {
                "submit" => "Submit",
                "take_back" => "TakeBack",
                _ => "Resume",
            }
            .into(),
            Do::Call { .. } | Do::Timeout | Do::Nothing => return Vec::new(),
        };
        vec![format!("{}: {input}", Self::state(before))]
    }

    fn transmit_cells(before: &Host, _: Duration, sent: bool) -> Vec<String> {
        if sent { vec![format!("{}: Transmit", Self::state(before))] } else { Vec::new() }
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

/// The input of a step that has one answer, in a story with the default words.
fn received(host: &Host, bytes: &[u8]) -> Option<String> {
    let mut decoder = Decoder::new(&HostConfig::default().profile);
    if decoder.push(bytes) < bytes.len() {
        return None;
    }
    let first =
        decoder.next_frame()?.and_then(|frame| Instruction::single(frame.items())).map(|answer| answer.word);
    if decoder.next_frame().is_some() {
        return None;
    }
    let expected = match host.machine().link {
        HostLink::Awaiting(sent) => sent.batch.word,
        HostLink::Resending { batch, .. } | HostLink::AwaitingRest { batch, .. } => batch.word,
        _ => 0x0101,
    };
    Some(match first {
        Err(_) => "Corrupt".into(),
        Ok(word) => match HostConfig::default().words.errors().refusal(word) {
            None if word == expected => "Answer, the word".into(),
            None => "Answer, another word".into(),
            Some(Refusal::BadChecksum) => "ErrorCode BadChecksum".into(),
            Some(other) => format!("ErrorCode {other:?}"),
        },
    })
}
