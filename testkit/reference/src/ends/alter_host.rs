//! The host of ALTER.

use core::time::Duration;

use anyhow::{Result, bail};
use robot_session::{Decoder as _, Session as _};
use serde_json::{Map, Value};
use val2_alter::machine::{HostPhase, HostRule, Pending, Stage};
use val2_alter::{
    DecodeError, Decoder, ErrorCode, Exception, ExceptionOutcome, Host, HostConfig, HostEvent, LostReason,
    Mode, MotionPhase, Policy, RobotMessage, SessionError, UnknownReason,
};

use super::{Do, Driven, Fields, Hooks, Maker, event, kind, show, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(Driven::<AlterHost>(Host::new(configuration(config, without)?)?))),
    rules: || {
        [
            "Mode",
            "WordsUntilRead",
            "WordsInterrupted",
            "WordsKept",
            "InTime",
            "InSequence",
            "Unread",
            "SendOnce",
            "NotInterrupted",
            "ZerosRead",
            "Silent",
            "Stale",
            "Restart",
            "Lost",
            "Late",
            "Forget",
        ]
        .map(String::from)
        .to_vec()
    },
};

const RULES: [HostRule; 16] = [
    HostRule::Mode,
    HostRule::WordsUntilRead,
    HostRule::WordsInterrupted,
    HostRule::WordsKept,
    HostRule::InTime,
    HostRule::InSequence,
    HostRule::Unread,
    HostRule::SendOnce,
    HostRule::NotInterrupted,
    HostRule::ZerosRead,
    HostRule::Silent,
    HostRule::Stale,
    HostRule::Restart,
    HostRule::Lost,
    HostRule::Late,
    HostRule::Forget,
];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<HostConfig> {
    static LEFT_OUT: [HostRule; 16] = RULES;
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
    made.without = without.and_then(|rule| LEFT_OUT.get(rule..=rule)).unwrap_or_default();
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

impl Hooks for AlterHost {
    type Session = Host;

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
        match &host.machine().phase {
            HostPhase::Repeating { answer: Some(_), .. } => "repeating, an answer is due".into(),
            HostPhase::Active(active) => match (active.stage, active.request, active.exception) {
                (Stage::Running, _, Pending::Unsent(_)) => "running, an exception to be sent",
                (Stage::Running, _, Pending::Sent { .. }) => "running, an exception sent",
                (Stage::Running, _, Pending::Unread { .. }) => "running, an exception not read",
                (Stage::Running, Some(_), Pending::None) => "running, a reply is due",
                (Stage::Running, None, Pending::None) => "running",
                (Stage::Interrupted, ..) => "interrupted, a reply is due",
                (Stage::Stopping { zeros_sent: true }, ..) => "stopping, zeros sent",
                (Stage::Stopping { .. }, ..) => "stopping",
                (Stage::Accepted, ..) => "accepted",
            }
            .into(),
            _ => host.machine().name().into(),
        }
    }

    fn cells(before: &Host, after: &Host, now: Duration, input: &Do, _: bool) -> Vec<String> {
        let due = before.poll_timeout().is_some_and(|due| now >= due);
        let inputs = match input {
            Do::Connected => vec!["connected"],
            Do::Disconnected => vec!["disconnected"],
            Do::Timeout => vec![if due { "timeout, late" } else { "timeout" }],
            Do::Transmitted | Do::Nothing => Vec::new(),
            Do::Input(bytes) => {
                let partial = if is_partial(after) { "bytes, a frame begins" } else { "bytes" };
                let mut cells = vec![format!("{}: {partial}", Self::state(after))];
                // What a silence has changed before is another input.
                if !due {
                    cells.extend(
                        received(before, bytes).map(|input| format!("{}: {input}", Self::state(before))),
                    );
                }
                return cells;
            }
            Do::Call { name, .. } => vec![match name.as_str() {
                "set_target" => "target",
                "clear_target" => "no target",
                "set_policy" => "policy",
                "set_subroutine" => "subroutine",
                other => other,
            }],
        };
        inputs.iter().map(|input| format!("{}: {input}", Self::state(before))).collect()
    }

    fn transmit_cells(before: &Host, now: Duration, sent: bool) -> Vec<String> {
        let late = before.reply_by().is_some_and(|by| now >= by);
        match (before.reply_by(), sent) {
            (None, _) => Vec::new(),
            (Some(_), false) if late => vec![format!("{}: transmit, late", Self::state(before))],
            (Some(_), _) => vec![format!("{}: transmit", Self::state(before))],
        }
    }
}

/// The session tells its machine whether a frame has begun; the deadline of its silence shows it.
fn is_partial(host: &Host) -> bool {
    host.machine().gap_at.is_some()
}

/// The input of a step that has one message, or the first one of a step that begins with noise.
fn received(host: &Host, bytes: &[u8]) -> Option<&'static str> {
    let mut decoder = Decoder::<RobotMessage>::new(host.config().framing);
    if host.machine().gap_at.is_some() || decoder.push(bytes) < bytes.len() {
        return None;
    }
    let first = decoder.next_frame();
    let corrupt = decoder.corruption().is_some();
    if matches!(first, Some(Err(DecodeError::StartMark { .. }))) {
        return Some("noise");
    }
    if decoder.next_frame().is_some() {
        return None;
    }
    Some(match first {
        None if corrupt => "corrupt frame",
        None => return None,
        Some(Err(_)) => return None,
        Some(Ok(received)) => match received.message {
            RobotMessage::Start(start) if start.mode == Mode(host.config().mode.0) => "start message",
            RobotMessage::Start(_) => "start message, another mode",
            RobotMessage::End(_) => "end message",
            RobotMessage::Motion(motion) => match (motion.phase, motion.error) {
                (MotionPhase::Running, ErrorCode::None) => "standard message",
                (MotionPhase::Running, ErrorCode::Checksum) => "standard message, bad checksum",
                (MotionPhase::Running, ErrorCode::Timeout) => "standard message, timeout",
                (MotionPhase::Interrupted, ErrorCode::None) => "standard message, interrupted",
                _ => return None,
            },
        },
    })
}
