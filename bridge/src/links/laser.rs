//! The instructions of a laser robot, and a query for its status.

use std::time::Duration;

use anyhow::Result;
use laser_eb90::{Host, HostConfig, HostEvent, SessionError, timing};
use robot_session::now;
use serde::Deserialize;
use serde_json::{Value as Json, json};

use super::client::{self, Adapter, Line, Silence};
use super::order;
use crate::end::{ENDS, End};
use crate::metric::{Definition, define, text};
use crate::payload::Kind;
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::settings::{self, Configure, Fields};
use cellwire_sim::laser::STATUS;

const METRICS: [Definition; 1] = [define("Status/Values", Kind::String)];

/// What can be set.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    query: u16,
    poll: Duration,
    silence: Duration,
    session: HostConfig,
}

impl Default for Settings {
    fn default() -> Self {
        Self::at_baud(timing::BAUD)
    }
}

impl Settings {
    fn at_baud(baud: u32) -> Self {
        let (poll, silence) = (Duration::from_secs(1), Duration::from_secs(10));
        Self { query: STATUS, poll, silence, session: HostConfig::at_baud(baud) }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { query, poll, silence, session } = self;
        fields.whole(
            "query",
            0..=u16::MAX,
            "",
            "the command word of the query for the status; 0: none",
            query,
        );
        let range = Duration::from_millis(100)..=Duration::from_secs(3600);
        fields.time("poll", range, "the polling period of the query", poll);
        Silence::configure(fields, silence);
        session.configure(fields);
    }
}

/// What a command may order: instructions that fit one frame.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Order {
    instructions: Vec<Instruction>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Instruction {
    word: u16,
    #[serde(default)]
    values: Vec<f32>,
}

struct Laser {
    settings: Settings,
    next: Duration,
    order: Option<Order>,
    /// The number of the first instruction of the order that the session has.
    running: Option<u64>,
}

pub(super) fn client(cell: &Cell, given: Settings) -> Result<super::Client> {
    // Some defaults follow from the rate.
    let baud = given.session.baud;
    let settings = settings::read(&cell.link, Settings::at_baud(baud), &cell.settings)?;
    let session = Host::new(settings.session)?;
    // Who is asked nothing has nothing to answer.
    let silence = if settings.query == 0 { Duration::ZERO } else { settings.silence };
    let silence = Silence::of_asked(silence, settings.poll);
    let adapter = Laser { settings, next: Duration::ZERO, order: None, running: None };
    client::of(cell, &METRICS, Some(Line { baud, deadline: None }), silence, session, adapter)
}

impl Adapter for Laser {
    type Session = Host;

    fn is_answer(event: &HostEvent) -> bool {
        match event {
            HostEvent::Answer { .. } | HostEvent::Refused { .. } => true,
            // An answer to an earlier connection's query says nothing about this one: the device may still not take its query.
            HostEvent::Done { unanswered, .. } => *unanswered == 0,
            _ => false,
        }
    }

    fn step(&mut self, host: &mut Host, end: &mut End) -> Option<Duration> {
        let now = now();
        if !host.is_idle() {
            return None;
        }
        if let Some(order) = self.order.take() {
            if end.is_stopped() {
                end.finish(Outcome::Refused, ENDS);
                return None;
            }
            match order.submit(host) {
                Ok(first) => self.running = Some(first),
                Err(why) => {
                    host.take_back();
                    end.finish(Outcome::Refused, why);
                }
            }
        } else if self.settings.query != 0 && now >= self.next {
            self.next = now.saturating_add(self.settings.poll);
            if let Err(error) = host.submit(self.settings.query, |_| Ok(())) {
                end.event(&json!({"event": "no_query", "why": error.to_string()}));
            }
        }
        Some(self.next.saturating_sub(now).max(Duration::from_millis(1)))
    }

    fn event(&mut self, host: &mut Host, event: HostEvent, end: &mut End) -> Result<(), String> {
        let (first, outcome, why) = match event {
            HostEvent::Done { first, unanswered, .. } => {
                let why = if unanswered > 0 {
                    format!("no answer after {unanswered} attempts")
                } else {
                    String::new()
                };
                (first, Outcome::Done, why)
            }
            HostEvent::Answer { ticket } if self.running == Some(ticket) => {
                (ticket, Outcome::Done, serde_json::to_string(&host.answer()).unwrap_or_default())
            }
            HostEvent::Answer { .. } => {
                let values = serde_json::to_string(&host.answer()).unwrap_or_default();
                end.values(vec![("Status/Values", text(values))]);
                return Ok(());
            }
            HostEvent::Refused { first, refusal, .. } => {
                host.resume();
                (first, Outcome::Refused, format!("the controller refuses: {refusal}"))
            }
            HostEvent::Unknown { first, reason, .. } => {
                host.resume();
                (first, Outcome::Unknown, format!("{reason:?}"))
            }
            // The query of this connection waits for the longest execution; the next connection's is answered at once.
            HostEvent::Unasked { .. } if !end.is_alive() => {
                return Err("an answer to a query of an earlier connection".into());
            }
            HostEvent::Unasked { word } => {
                end.event(&json!({"event": "unasked", "word": word}));
                return Ok(());
            }
            HostEvent::Corrupt(error) => {
                end.event(&json!({"event": "corrupt", "error": error}));
                return Ok(());
            }
            HostEvent::Echo(error) => {
                end.event(&json!({"event": "echo", "error": error, "text": error.to_string()}));
                return Ok(());
            }
            _ => return Ok(()),
        };
        // A frame is never mixed: it is the order's, or the query for the status.
        match self.running.take_if(|running| *running == first) {
            Some(_) => end.finish(outcome, why),
            None => {
                end.event(&json!({"event": "query_failed", "outcome": outcome, "why": Json::String(why)}))
            }
        }
        Ok(())
    }

    fn command(&mut self, _: &mut Host, command: Command) -> Result<(), String> {
        let order: Order = order(&command.order)?;
        if order.instructions.is_empty() {
            return Err("there are no instructions".into());
        }
        self.order = Some(order);
        Ok(())
    }

    fn lost(&mut self) {
        (self.order, self.running) = (None, None);
    }
}

impl Order {
    /// Submits all of it into one frame; the number of the first instruction.
    fn submit(&self, host: &mut Host) -> Result<u64, String> {
        let mut first = None;
        for Instruction { word, values } in &self.instructions {
            let ticket = host.submit(*word, |parameters| match values.as_slice() {
                [] => Ok(()),
                values => parameters.f32(values).map(drop),
            });
            match ticket {
                Ok(ticket) => drop(first.get_or_insert(ticket)),
                Err(SessionError::Full) => {
                    return Err("more instructions than fit a frame, or of different classes".into());
                }
                Err(error) => return Err(format!("instruction {word:#06x}: {error}")),
            }
        }
        first.ok_or_else(|| "there are no instructions".into())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::mpsc::{channel, sync_channel};

    use super::*;
    use crate::end::Stop;

    #[test]
    fn an_answer_to_an_earlier_query_is_no_sign_of_life_and_ends_the_connection_of_a_dead_device() {
        let settings = Settings::default();
        let mut host = Host::new(settings.session).unwrap();
        let mut laser = Laser { settings, next: Duration::ZERO, order: None, running: None };
        let ((hub, reports), (_commands, inbox)) = (sync_channel(9), channel());
        let mut end = End::new(3, hub, inbox, Stop::default(), Arc::default(), Arc::default());
        let unasked = || HostEvent::Unasked { word: STATUS };
        assert!(!Laser::is_answer(&unasked()));
        let why = "an answer to a query of an earlier connection";
        assert_eq!(laser.event(&mut host, unasked(), &mut end), Err(why.into()));
        assert_eq!(reports.try_iter().count(), 0);
        end.connected("x");
        assert_eq!(laser.event(&mut host, unasked(), &mut end), Ok(()));
        assert_eq!(reports.try_iter().count(), 2);
    }
}
