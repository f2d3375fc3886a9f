//! The central controller's end of a platform's connection.

use core::time::Duration;

use anyhow::{Result, bail};
use mmacell_proto::central::machine::{self, CentralMachine};
use mmacell_proto::{
    Central, CentralConfig, CentralEvent, Closing, Command, Miss, PlatformPose, Progress, SessionError,
    Unfinished,
};
use serde_json::{Map, Value};
use testkit::links::mmacell_proto::rows;

use super::{About, Fields, Maker, Noted, cell, event, kind, names, show, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<MmaCentral>::boxed(Central::new(configuration(config, rule)?)?)),
    rules: names::<mmacell_proto::central::Rule>,
};

fn configuration(config: &Map<String, Value>, rule: Option<usize>) -> Result<CentralConfig> {
    let mut made = CentralConfig { rules: without(rule), ..CentralConfig::DEFAULT };
    let mut fields = Fields(config.clone());
    fields.take("accepts", &mut made.accepts)?;
    fields.take("writes", &mut made.writes)?;
    fields.time("timeout", &mut made.timeout)?;
    fields.time("settle", &mut made.settle)?;
    fields.take("tolerance", &mut made.tolerance)?;
    fields.end()?;
    Ok(made)
}

type Session = Central<PlatformPose>;

struct MmaCentral;

impl About for MmaCentral {
    type End = Session;
    type Rows = rows::Central;

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

    fn cells(
        machine: &CentralMachine<PlatformPose>,
        at: Duration,
        input: &machine::Input<PlatformPose>,
    ) -> Vec<String> {
        [cell::<rows::Central>(machine, at, input), cell::<rows::Progress>(machine, at, input)].concat()
    }
}
