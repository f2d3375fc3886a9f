//! The forces and keys of a control ball.

use std::time::Duration;

use anyhow::Result;
use isra_ball::{Host, HostConfig, HostEvent, Keys, Packet};
use robot_session::now;
use serde_json::json;

use super::address;
use super::client::{self, Adapter};
use crate::cell::bridge::end::End;
use crate::cell::bridge::hall::Cell;
use crate::cell::bridge::metric::{Definition, define, whole};
use crate::cell::bridge::payload::{Kind, Value};
use crate::cell::bridge::report::Command;
use crate::links::settings::{self, Configure, Setting, Table};

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

/// What can be set.
#[derive(Debug, Clone)]
struct Settings {
    report: Duration,
    session: HostConfig,
}

impl Default for Settings {
    fn default() -> Self {
        // Nothing is steered: values may be old, and polls far apart.
        let (period, max_age) = (Duration::from_millis(100), Duration::from_secs(1));
        let session = HostConfig { period, max_age, ..HostConfig::default() };
        Self { report: Duration::from_millis(500), session }
    }
}

impl Configure for Settings {
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { report, session } = self;
        let range = Duration::ZERO..=Duration::from_secs(3600);
        table.time("report", range, "the least from one report to the next, but for keys", report);
        session.configure(table);
    }
}

struct Ball {
    report: Duration,
    next: Duration,
    keys: Keys,
}

pub(super) fn client(cell: &Cell) -> Result<super::Client> {
    let Settings { report, session } = settings::read(&cell.link, Settings::default(), &cell.settings)?;
    let (place, host) = (address(cell)?, Host::new(session)?);
    let adapter = Ball { report, next: Duration::ZERO, keys: Keys::NONE };
    Ok(super::Client::new(&METRICS, move |end| client::run(adapter, host, &place, session.baud, end)))
}

pub(super) fn settings() -> Vec<Setting> {
    settings::list(Settings::default())
}

impl Adapter for Ball {
    type Session = Host;

    fn step(&mut self, _: &mut Host, _: &mut End) -> Option<Duration> {
        None
    }

    fn event(&mut self, _: &mut Host, event: HostEvent, end: &mut End) -> Result<(), String> {
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

    fn command(&mut self, _: &mut Host, _: Command) -> Result<(), String> {
        Err("a ball takes no commands".into())
    }
}

fn values(packet: &Packet) -> Vec<(&'static str, Value)> {
    let axes = packet.force.iter().chain(&packet.moment).map(|axis| whole(*axis));
    let values = axes.chain([whole(packet.keys.0), Value::Boolean(false)]);
    METRICS.iter().map(|definition| definition.name).zip(values).collect()
}
