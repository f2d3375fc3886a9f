//! The central controller's end of a platform's connection.

use core::time::Duration;

use anyhow::{Result, bail};
use mmacell_proto::central::CentralRule;
use mmacell_proto::central::machine::{CentralLink, Motion, Target};
use mmacell_proto::{
    Central, CentralConfig, CentralEvent, Closing, Command, Decoder, Miss, PlatformPose, Progress, Reply,
    SessionError, Unfinished,
};
use robot_session::{Decoder as _, Session as _};
use serde_json::{Map, Value};

use super::{Do, Driven, Fields, Hooks, Maker, event, kind, show, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| {
        Ok(Box::new(Driven::<MmaCentral>(Central::new(configuration(config, without)?)?)))
    },
    rules: || {
        ["ServoOn", "UnknownWhenSent", "ForgetMotion", "ForgetTarget", "AbortEnds", "StrayEnds"]
            .map(String::from)
            .to_vec()
    },
};

const RULES: [CentralRule; 6] = [
    CentralRule::ServoOn,
    CentralRule::UnknownWhenSent,
    CentralRule::ForgetMotion,
    CentralRule::ForgetTarget,
    CentralRule::AbortEnds,
    CentralRule::StrayEnds,
];

fn configuration(config: &Map<String, Value>, without: Option<usize>) -> Result<CentralConfig> {
    let mut made = CentralConfig::DEFAULT;
    let mut fields = Fields(config.clone());
    fields.take("accepts", &mut made.accepts)?;
    fields.take("writes", &mut made.writes)?;
    fields.time("timeout", &mut made.timeout)?;
    fields.time("settle", &mut made.settle)?;
    fields.take("tolerance", &mut made.tolerance)?;
    fields.end()?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(made)
}

type Session = Central<PlatformPose>;

struct MmaCentral;

impl Hooks for MmaCentral {
    type Session = Session;

    fn call(central: &mut Session, now: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        match name {
            "abort" => central.abort(now),
            "request" => {
                let command: Command<PlatformPose> = serde_json::from_value(argument)?;
                return Ok(central.request(command).map_err(|error| match error {
                    SessionError::Busy => kind("busy"),
                    SessionError::NotConnected => kind("not_connected"),
                    SessionError::Encode(error) => show(&error),
                    _ => kind("not_a_central's"),
                }));
            }
            _ => bail!("a central controller has no call {name}"),
        }
        Ok(Ok(()))
    }

    fn event(_: &Session, happened: CentralEvent<PlatformPose>) -> Result<String> {
        Ok(match happened {
            CentralEvent::Connected => event("connected").end(),
            CentralEvent::Done { command } => event("done").value("command", &command)?.end(),
            CentralEvent::Refused { command, error } => {
                event("refused").value("command", &command)?.value("error", &error)?.end()
            }
            CentralEvent::Status { status, motion } => {
                let motion = match motion {
                    Progress::Still => "still",
                    Progress::Starting => "starting",
                    Progress::Moving => "moving",
                    Progress::Stopping => "stopping",
                    Progress::Arrived => "arrived",
                    Progress::Missed(Miss::Elsewhere) => "missed_elsewhere",
                    Progress::Missed(Miss::ServoOff) => "missed_servo_off",
                };
                event("status").value("status", &status)?.value("motion", motion)?.end()
            }
            CentralEvent::Aborted { command } => event("aborted").value("command", &command)?.end(),
            CentralEvent::Closed { reason, unfinished } => {
                let (reason, error) = match reason {
                    Closing::Agreed => ("agreed", None),
                    Closing::Timeout => ("timeout", None),
                    Closing::Aborted => ("aborted", None),
                    Closing::Disconnected => ("disconnected", None),
                    Closing::Malformed(error) => ("malformed", Some(error)),
                    Closing::Mismatch => ("mismatch", None),
                    _ => bail!("a closing without a name"),
                };
                let object = event("closed").value("reason", reason)?.optional("error", error.as_ref())?;
                match unfinished {
                    Unfinished::Nothing => object,
                    Unfinished::NotSent(command) => object.value("not_sent", &command)?,
                    Unfinished::Unknown(command) => object.value("unknown", &command)?,
                }
                .end()
            }
            CentralEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(central: &Session) -> String {
        match central.machine().link {
            CentralLink::Down => "Down".into(),
            CentralLink::Idle => "Idle".into(),
            CentralLink::Sending { .. } => format!("Sending {{ command: {GO} }}"),
            CentralLink::Awaiting { command, .. } => {
                format!("Awaiting {{ command: {}, deadline: 1s }}", of(command))
            }
            CentralLink::Ended => "Ended".into(),
        }
    }

    fn cells(before: &Session, _: &Session, now: Duration, input: &Do, refused: bool) -> Vec<String> {
        let mut cells = Vec::new();
        let input = match input {
            Do::Connected => "Connected".to_owned(),
            Do::Disconnected => "Disconnected".into(),
            Do::Timeout => "Due".into(),
            Do::Call { name, .. } if name == "abort" => "Abort".into(),
            Do::Call { .. } if !refused => format!("Request({GO})"),
            Do::Call { .. } | Do::Transmitted | Do::Nothing => return Vec::new(),
            Do::Input(bytes) => {
                let Some(reply) = received(before, bytes) else { return Vec::new() };
                if let (Some(reply), CentralLink::Awaiting { command, .. }) = (reply, before.machine().link) {
                    let state = motion(before.machine().motion, now);
                    cells.push(format!("{state}: {} to {}", short(CentralReply(reply)), short(command)));
                }
                match reply {
                    None => "Corrupt(Incomplete)".into(),
                    Some(Reply::Ok) => "Reply(Ok)".into(),
                    Some(Reply::Error { .. }) => "Reply(Error { error: Generic })".into(),
                    Some(Reply::Status(_)) => STATUS.into(),
                }
            }
        };
        let to = match before.machine().link {
            CentralLink::Awaiting { command, .. } => format!(" to {}", of(command)),
            _ => String::new(),
        };
        // At a deadline that has not come nothing happens, and the matrix asks at the deadline.
        let due = before.poll_timeout().is_none_or(|due| now >= due);
        if input != "Due" || due {
            cells.push(format!("{}: {input}{to}", Self::state(before)));
        }
        cells
    }

    fn transmit_cells(before: &Session, _: Duration, sent: bool) -> Vec<String> {
        if sent { vec![format!("{}: Transmit", Self::state(before))] } else { Vec::new() }
    }
}

/// The commands of the matrix.
const GO: &str = "Move { mode: Absolute, pose: there }";
const STATUS: &str =
    "Reply(Status(Status { moving: false, pose: here, servo: true, percent: 100, error: None }))";

fn of(command: Command<PlatformPose>) -> &'static str {
    match command {
        Command::Status => "Status",
        Command::Close => "Close",
        _ => GO,
    }
}

/// As the matrix prints it.
struct CentralReply(Reply<PlatformPose>);

impl core::fmt::Debug for CentralReply {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Reply({:?})", self.0)
    }
}

fn short(value: impl core::fmt::Debug) -> String {
    format!("{value:?}")
        .replace("PlatformPose { a: Angle(0), b: Angle(0) }", "here")
        .replace("PlatformPose { a: Angle(500), b: Angle(0) }", "there")
}

/// The motion's state, with the time at which "at rest" is believed as one that has come or has not.
fn motion(motion: Motion<PlatformPose>, now: Duration) -> String {
    short(match motion {
        Motion::Starting { target, believed_from } => {
            let later = now < believed_from && !matches!(target, Target::Unknown);
            Motion::Starting { target, believed_from: Duration::from_secs(later.into()) }
        }
        other => other,
    })
}

/// The reply of a step that has one line; no reply: a line that is none.
fn received(central: &Session, bytes: &[u8]) -> Option<Option<Reply<PlatformPose>>> {
    let accepts = central.config().accepts;
    let mut decoder = Decoder::new(accepts);
    if decoder.push(bytes) < bytes.len() {
        return None;
    }
    let reply = decoder.next_frame()?.and_then(|line| Reply::decode(line, &accepts)).ok();
    if decoder.next_frame().is_some() { None } else { Some(reply) }
}
