//! The forces and keys of a control ball.

use std::time::Duration;

use anyhow::Result;
use cellwire_io::latency::Deadline;
use isra_ball::tokio::PollService;
use isra_ball::{HostConfig, HostEvent, Keys, Packet};
use robot_session::now;
use serde_json::json;

use super::client::{self, Listener, PollSettings, RejectAll, Silence};
use super::paced::Paced;
use super::port::Port;
use crate::end::End;
use crate::metric::{Definition, define, whole};
use crate::payload::{Kind, Value};
use crate::site::Cell;

const METRICS: [Definition; 8] = [
    define("Force/X", Kind::Int64),
    define("Force/Y", Kind::Int64),
    define("Force/Z", Kind::Int64),
    define("Moment/X", Kind::Int64),
    define("Moment/Y", Kind::Int64),
    define("Moment/Z", Kind::Int64),
    define("Keys", Kind::Int64),
    define("Stale", Kind::Boolean),
];

impl Default for Paced<HostConfig> {
    fn default() -> Self {
        // Nothing is steered: values may be old, and polls far apart.
        let (period, max_age) = (Duration::from_millis(100), Duration::from_secs(1));
        let session = HostConfig { period, max_age, ..HostConfig::default() };
        Self { report: Duration::from_millis(500), silence: Duration::from_secs(2), session }
    }
}

struct Ball {
    report: Duration,
    next: Duration,
    keys: Keys,
}

pub(super) fn client(cell: &Cell, settings: Paced<HostConfig>) -> Result<super::Client> {
    let Paced { report, silence, session } = settings;
    let silence = Silence::of_asked(silence, session.period);
    let terms = PollSettings { silence, every: None, deadline: Some(Deadline::of_ball(&session)) };
    let (ball, task) = isra_ball::tokio::host(session, Port::of(cell, Some(session.baud))?)?;
    let listener = Ball { report, next: Duration::ZERO, keys: Keys::NONE };
    Ok(client::of(cell, &METRICS, terms, (ball.handle, task), listener, RejectAll("a ball has no commands")))
}

impl Listener for Ball {
    type Service = PollService;

    fn event(&mut self, event: HostEvent, end: &End) -> Result<(), String> {
        if matches!(event, HostEvent::Packet(_) | HostEvent::Old(_) | HostEvent::Unasked(_)) {
            end.answered();
        }
        match event {
            HostEvent::Packet(packet) if now() >= self.next || packet.keys != self.keys => {
                (self.next, self.keys) = (now().saturating_add(self.report), packet.keys);
                end.values(values(&packet));
            }
            HostEvent::Stale => end.values(vec![("Stale", Value::Boolean(true))]),
            HostEvent::Corrupt(error) => end.event(&json!({"event": "corrupt", "error": error})),
            _ => {}
        }
        Ok(())
    }
}

fn values(packet: &Packet) -> Vec<(&'static str, Value)> {
    let axes = packet.force.iter().chain(&packet.moment).map(|axis| whole(*axis));
    let values = axes.chain([whole(packet.keys.0), Value::Boolean(false)]);
    METRICS.iter().map(|definition| definition.name).zip(values).collect()
}
