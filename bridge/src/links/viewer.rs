//! A graphics workstation that draws an arm: its requests, and poses for it by command.

use std::pin::pin;
use std::time::Duration;

use anyhow::Result;
use serde::Deserialize;
use serde_json::json;
use tokio::select;
use tokio::sync::watch;
use tokio::time::sleep;
use val2_viewer::tokio::{Error, Poses, Screen};
use val2_viewer::{HostConfig, HostEvent, timing};

use super::client::{self, Listener, PollSettings, Silence, Worker};
use super::order;
use super::port::Port;
use crate::end::End;
use crate::metric::{Definition, define, whole};
use crate::payload::Kind;
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::settings::{Configure, FieldVisitor, LINE};

const METRICS: [Definition; 2] = [define("Viewer/Requests", Kind::Int64), define("Viewer/Sent", Kind::Int64)];

/// The settings of a cell.
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
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { report, silence, baud, session } = self;
        let range = Duration::from_millis(10)..=Duration::from_secs(3600);
        fields.time("report", range, "the time between reports", report);
        Silence::configure(fields, silence);
        fields.baud(LINE, baud);
        session.configure(fields);
    }
}

/// The content of a command: a pose.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Order {
    pose: [i16; 12],
}

/// Counts requests and packets.
struct Viewer {
    counts: watch::Sender<Counts>,
}

/// The requests that have come, and the packets that were sent.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    asked: i64,
    sent: i64,
}

/// Reports the counts, and shows poses.
struct Showing {
    report: Duration,
    counts: watch::Receiver<Counts>,
    screen: Screen,
}

pub(super) fn client(cell: &Cell, settings: Settings) -> Result<super::Client> {
    let Settings { report, silence, baud, session } = settings;
    let terms = PollSettings { silence: Silence::of_speaker(silence), every: Some(report), deadline: None };
    let (screen, task) = val2_viewer::tokio::host(session, Port::of(cell, Some(baud))?)?;
    let (counts, counted) = watch::channel(Counts::default());
    let (handle, worker) = (screen.handle().clone(), Showing { report, counts: counted, screen });
    Ok(client::of(cell, &METRICS, terms, (handle, task), Viewer { counts }, worker))
}

impl Listener for Viewer {
    type Service = Poses;

    fn event(&mut self, event: HostEvent, end: &End) -> Result<(), String> {
        match event {
            HostEvent::Asked => {
                self.counts.send_modify(|counts| counts.asked += 1);
                end.answered();
            }
            HostEvent::Ignored => end.answered(),
            HostEvent::Sent(_) => self.counts.send_modify(|counts| counts.sent += 1),
            HostEvent::HoldEnded => end.event(&json!({"event": "hold_ended"})),
            HostEvent::Unknown(byte) => end.event(&json!({"event": "unknown", "byte": byte})),
            _ => {}
        }
        Ok(())
    }
}

impl Showing {
    fn values(&self, end: &End) {
        let Counts { asked, sent } = *self.counts.borrow();
        end.values(vec![("Viewer/Requests", whole(asked)), ("Viewer/Sent", whole(sent))]);
    }
}

impl Worker for Showing {
    async fn poll(&mut self, end: &End) {
        self.values(end);
    }

    async fn command(&mut self, command: &Command, end: &End) -> (Outcome, String) {
        let Order { pose } = match order(&command.order) {
            Ok(order) => order,
            Err(why) => return (Outcome::Refused, why),
        };
        let mut showing = pin!(self.screen.show(pose));
        let shown = loop {
            select! {
                shown = &mut showing => break shown,
                () = sleep(self.report) => self.values(end),
            }
        };
        match shown {
            Ok(packet) => (Outcome::Done, format!("packet {}", packet.count)),
            Err(error @ Error::Closed(_)) => (Outcome::Unknown, error.to_string()),
            Err(error) => (Outcome::Refused, error.to_string()),
        }
    }
}
