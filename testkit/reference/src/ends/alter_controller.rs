//! The controller of ALTER.

use core::time::Duration;

use anyhow::{Result, bail};
use robot_session::{Decoder as _, Session as _};
use serde_json::{Map, Value};
use val2_alter::machine::{ControllerPhase, ControllerRule, Progress, Turn};
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, DecodeError, Decoder, Exception, HostMessage, Reply,
    SegmentStatus, SessionError, StartCode, Transform, Unselected,
};

use super::{Do, Driven, Fields, Hooks, Maker, event, kind, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| {
        Ok(Box::new(Driven::<AlterController>(Controller::new(configuration(config, without)?)?)))
    },
    rules: || {
        [
            "ReportInterruption",
            "AfterRequest",
            "FirstReply",
            "EndOnMissing",
            "OneSubroutine",
            "Attempts",
            "RestInterrupted",
        ]
        .map(String::from)
        .to_vec()
    },
};

static RULES: [ControllerRule; 7] = [
    ControllerRule::ReportInterruption,
    ControllerRule::AfterRequest,
    ControllerRule::FirstReply,
    ControllerRule::EndOnMissing,
    ControllerRule::OneSubroutine,
    ControllerRule::Attempts,
    ControllerRule::RestInterrupted,
];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<ControllerConfig> {
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
    made.without = without.and_then(|rule| RULES.get(rule..=rule)).unwrap_or_default();
    Ok(made)
}

struct AlterController;

impl Hooks for AlterController {
    type Session = Controller;

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
        row(session, Duration::MAX)
    }

    fn cells(before: &Controller, after: &Controller, now: Duration, input: &Do, _: bool) -> Vec<String> {
        let due = before.poll_timeout().is_some_and(|due| now >= due);
        let inputs = match input {
            Do::Connected => vec!["connected"],
            Do::Disconnected => vec!["disconnected"],
            Do::Timeout if due && before.machine().gap_at.is_none() => {
                vec!["timeout, late", "window closed, late"]
            }
            Do::Timeout if !due => vec!["timeout"],
            Do::Input(bytes) => {
                let partial =
                    if after.machine().gap_at.is_some() { "bytes, a frame begins" } else { "bytes" };
                let mut cells = vec![format!("{}: {partial}", row(after, now))];
                if !due {
                    cells.extend(
                        received(before, bytes).map(|input| format!("{}: {input}", row(before, now))),
                    );
                }
                return cells;
            }
            Do::Call { name, .. } => match name.as_str() {
                "resume" => vec!["return"],
                "set_segment" | "set_transform" => Vec::new(),
                other => vec![other],
            },
            Do::Transmitted | Do::Nothing | Do::Timeout => Vec::new(),
        };
        inputs.iter().map(|input| format!("{}: {input}", row(before, now))).collect()
    }

    fn transmit_cells(before: &Controller, now: Duration, sent: bool) -> Vec<String> {
        if sent { vec![format!("{}: transmit", row(before, now))] } else { Vec::new() }
    }
}

/// The row of the matrix.
fn row(session: &Controller, now: Duration) -> String {
    let ControllerPhase::On(alter) = session.machine().phase else { return session.machine().name().into() };
    let sent = match alter.turn {
        Turn::Controller => "",
        Turn::Host { opens, .. } if now < opens => ", being sent",
        Turn::Host { .. } => ", sent",
    };
    let returned = if matches!(alter.progress, Progress::Interrupted { returned: true, .. }) {
        ", returned"
    } else {
        ""
    };
    format!("{}{returned}{sent}", session.machine().name())
}

/// The input of a step that has one answer.
fn received(session: &Controller, bytes: &[u8]) -> Option<&'static str> {
    let mut decoder = Decoder::<HostMessage>::new(session.config().framing);
    if session.machine().gap_at.is_some() || decoder.push(bytes) < bytes.len() {
        return None;
    }
    let first = decoder.next_frame();
    if decoder.corruption().is_some() || matches!(first, Some(Err(DecodeError::StartMark { .. }))) {
        return Some("corrupt bytes");
    }
    match first?.ok()?.message {
        HostMessage::StartReply(StartCode::Accept) => Some("accept"),
        HostMessage::StartReply(StartCode::Repeat) => Some("repeat"),
        HostMessage::StartReply(StartCode::Refuse) => Some("refuse"),
        HostMessage::Reply(Reply { exception: Exception::None, .. }) => Some("reply"),
        HostMessage::Reply(_) => Some("reply with an exception"),
    }
}
