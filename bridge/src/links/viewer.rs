//! A graphics workstation that draws an arm: its requests, and poses for it by command.

use std::time::Duration;

use anyhow::Result;
use robot_session::now;
use serde::Deserialize;
use serde_json::json;
use val2_viewer::{Host, HostConfig, HostEvent, timing};

use super::client::{self, Adapter, Line, Silence};
use super::order;
use crate::end::End;
use crate::metric::{Definition, define, whole};
use crate::payload::Kind;
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::settings::{Configure, Fields, LINE};

const METRICS: [Definition; 2] = [define("Viewer/Requests", Kind::Int64), define("Viewer/Sent", Kind::Int64)];

/// What can be set.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    report: Duration,
    silence: Duration,
    baud: u32,
    session: HostConfig,
}

impl Default for Settings {
    fn default() -> Self {
        // A pose that was ordered waits for the next request.
        let session = HostConfig { max_age: Duration::from_secs(5), ..HostConfig::default() };
        Self {
            report: Duration::from_millis(500),
            silence: Duration::from_secs(10),
            baud: timing::BAUD,
            session,
        }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { report, silence, baud, session } = self;
        let range = Duration::from_millis(10)..=Duration::from_secs(3600);
        fields.time("report", range, "the time between reports", report);
        Silence::configure(fields, silence);
        fields.baud(LINE, baud);
        session.configure(fields);
    }
}

/// What a command may order.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Order {
    pose: [i16; 12],
}

struct Viewer {
    report: Duration,
    next: Duration,
    /// Where the pose that was ordered expires, if it is not sent before.
    until: Option<Duration>,
    max_age: Duration,
    pose: [i16; 12],
}

pub(super) fn client(cell: &Cell, settings: Settings) -> Result<super::Client> {
    let Settings { report, silence, baud, session } = settings;
    let silence = Silence::of_speaker(silence);
    let max_age = session.max_age;
    let adapter = Viewer { report, next: Duration::ZERO, until: None, max_age, pose: [0; 12] };
    client::of(cell, &METRICS, Some(Line { baud, deadline: None }), silence, Host::new(session)?, adapter)
}

impl Adapter for Viewer {
    type Session = Host;

    fn is_answer(event: &HostEvent) -> bool {
        matches!(event, HostEvent::Asked | HostEvent::Ignored)
    }

    fn step(&mut self, host: &mut Host, end: &mut End) -> Option<Duration> {
        let now = now();
        if now >= self.next {
            self.next = now.saturating_add(self.report);
            let seen = robot_session::Session::statistics(host);
            let whole = |count: u64| whole(i64::try_from(count).unwrap_or(i64::MAX));
            end.values(vec![("Viewer/Requests", whole(seen.asked)), ("Viewer/Sent", whole(seen.sent))]);
        }
        if self.until.take_if(|until| now >= *until).is_some() {
            end.finish(Outcome::Refused, "the workstation did not request a pose before it was too old");
        }
        Some(self.next.saturating_sub(now))
    }

    fn event(&mut self, _: &mut Host, event: HostEvent, end: &mut End) -> Result<(), String> {
        match event {
            HostEvent::Sent(packet) if packet.pose == self.pose && self.until.take().is_some() => {
                end.finish(Outcome::Done, format!("packet {}", packet.count));
            }
            HostEvent::HoldEnded => end.event(&json!({"event": "hold_ended"})),
            HostEvent::Unknown(byte) => end.event(&json!({"event": "unknown", "byte": byte})),
            _ => {}
        }
        Ok(())
    }

    fn command(&mut self, host: &mut Host, command: Command) -> Result<(), String> {
        let Order { pose } = order(&command.order)?;
        let now = now();
        (self.pose, self.until) = (pose, Some(now.saturating_add(self.max_age)));
        host.set_pose(now, pose);
        Ok(())
    }

    fn lost(&mut self) {
        self.until = None;
    }
}
