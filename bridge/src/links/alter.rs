//! The motion of an arm under VAL II ALTER. The bridge accepts ALTER and leaves the path as it is: every reply is zero.

use std::time::Duration;

use anyhow::Result;
use cellwire_io::latency::Deadline;
use robot_session::now;
use serde_json::json;
use val2_alter::tokio::ArmService;
use val2_alter::{HostConfig, HostEvent, MotionPhase, Transform};

use super::client::{self, Listener, PollSettings, RejectAll, Silence};
use super::paced::Paced;
use super::port::Port;
use crate::end::End;
use crate::metric::{Definition, NamedValue, define, text, whole};
use crate::payload::{Kind, Value};
use crate::site::Cell;

const METRICS: [Definition; 6] = [
    define("Motion/Phase", Kind::String),
    define("Motion/Segment", Kind::Int64),
    define("Motion/Fraction", Kind::Float),
    define("Position/X", Kind::Float),
    define("Position/Y", Kind::Float),
    define("Position/Z", Kind::Float),
];

impl Default for Paced<HostConfig> {
    fn default() -> Self {
        // Bytes that came together may be read far apart.
        Self {
            report: Duration::from_millis(500),
            silence: Duration::from_secs(10),
            session: HostConfig { gap: None, ..HostConfig::default() },
        }
    }
}

struct Alter {
    report: Duration,
    next: Duration,
}

pub(super) fn client(cell: &Cell, settings: Paced<HostConfig>) -> Result<super::Client> {
    let Paced { report, silence, session } = settings;
    let silence = Silence::of_speaker(silence);
    let terms = PollSettings { silence, every: None, deadline: Some(Deadline::of_alter(&session)) };
    let (arm, task) = val2_alter::tokio::host(session, None, Port::of(cell, Some(session.baud))?)?;
    let listener = Alter { report, next: Duration::ZERO };
    let refuses = RejectAll("only `cellwire alter` moves an arm under ALTER, where an operator can stop it");
    Ok(client::of(cell, &METRICS, terms, (arm.handle().clone(), task), listener, refuses))
}

impl Listener for Alter {
    type Service = ArmService;

    fn event(&mut self, event: HostEvent, end: &End) -> Result<(), String> {
        if matches!(event, HostEvent::Start(_) | HostEvent::Motion(_) | HostEvent::End(_)) {
            end.answered();
        }
        match event {
            HostEvent::Motion(motion) if now() >= self.next => {
                self.next = now().saturating_add(self.report);
                let phase = if motion.phase == MotionPhase::Running { "running" } else { "interrupted" };
                let mut values = vec![
                    ("Motion/Phase", text(phase)),
                    ("Motion/Segment", whole(motion.segment)),
                    ("Motion/Fraction", Value::Float(motion.fraction())),
                ];
                values.extend(motion.transform.into_iter().flat_map(position));
                end.values(values);
            }
            HostEvent::Start(start) => end.event(&json!({"event": "start", "mode": start.mode})),
            HostEvent::End(over) => end.event(&json!({"event": "end", "error": u8::from(over.error)})),
            HostEvent::Lost(reason) => end.event(&json!({"event": "lost", "reason": format!("{reason:?}")})),
            HostEvent::Delayed => end.event(&json!({"event": "delayed"})),
            HostEvent::Missed => end.event(&json!({"event": "missed"})),
            HostEvent::Rejected(error) => end.event(&json!({"event": "rejected", "error": u8::from(error)})),
            HostEvent::Corrupt(error) => end.event(&json!({"event": "corrupt", "error": error})),
            _ => {}
        }
        Ok(())
    }
}

/// Millimetres, from 1/32 mm.
fn position(Transform([.., x, y, z]): Transform) -> impl Iterator<Item = NamedValue> {
    let mm = |word: i16| Value::Float(f32::from(word) / 32.0);
    [("Position/X", mm(x)), ("Position/Y", mm(y)), ("Position/Z", mm(z))].into_iter()
}
