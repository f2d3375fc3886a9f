//! The instructions of a laser robot, and a query for its status.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::Duration;

use anyhow::Result;
use laser_eb90::tokio::{Command as Instruction, Error, Instructions, Laser};
use laser_eb90::{EncodeError, Host, HostConfig, HostEvent, Payload, SessionError, timing};
use serde::Deserialize;
use serde_json::json;

use super::client::{self, Listener, PollSettings, Silence, Worker};
use super::order;
use super::port::Port;
use crate::end::End;
use crate::metric::{Definition, define, text};
use crate::payload::Kind;
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::settings::{self, Configure, FieldVisitor};
use cellwire_sim::laser::STATUS;

const METRICS: [Definition; 1] = [define("Status/Values", Kind::String)];

/// The settings of a cell.
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
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
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

/// The content of a command: instructions that fit one frame.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Order {
    instructions: Vec<InstructionArgs>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct InstructionArgs {
    word: u16,
    #[serde(default)]
    values: Vec<f32>,
}

/// Reports answers and faults, and counts the attempts of a frame that had no answer.
struct AnswerReporter {
    unanswered: Arc<AtomicU8>,
}

/// Asks for the status, and sends instructions.
struct Sender {
    laser: Laser,
    settings: Settings,
    unanswered: Arc<AtomicU8>,
}

/// Instructions that were not sent when a connection was lost are given up after this time.
const GIVE_UP: Duration = Duration::from_secs(1);

pub(super) fn client(cell: &Cell, given: Settings) -> Result<super::Client> {
    // Some defaults follow from the rate.
    let baud = given.session.baud;
    let settings = settings::read(&cell.link, Settings::at_baud(baud), &cell.settings)?;
    // A device without a query has nothing to answer.
    let is_asked = settings.query != 0;
    let silence = if is_asked { settings.silence } else { Duration::ZERO };
    let silence = Silence::of_asked(silence, settings.poll);
    let terms = PollSettings { silence, every: is_asked.then_some(settings.poll), deadline: None };
    let (laser, task) = laser_eb90::tokio::host(settings.session, Port::of(cell, Some(baud))?)?;
    let (task, handle) = (task.give_up_after(GIVE_UP), laser.handle().clone());
    let answers = AnswerReporter { unanswered: Arc::default() };
    let unanswered = Arc::clone(&answers.unanswered);
    Ok(client::of(cell, &METRICS, terms, (handle, task), answers, Sender { laser, settings, unanswered }))
}

impl Listener for AnswerReporter {
    type Service = Instructions;

    fn event(&mut self, event: HostEvent, end: &End) -> Result<(), String> {
        match event {
            HostEvent::Answer { .. } | HostEvent::Refused { .. } => end.answered(),
            // An answer to an earlier connection's query is no evidence about this one: the device may still reject its
            // query.
            HostEvent::Done { unanswered, .. } => {
                self.unanswered.store(unanswered, Ordering::Relaxed);
                if unanswered == 0 {
                    end.answered();
                }
            }
            // The query of this connection waits for the longest execution; the next connection's is answered at once.
            HostEvent::Unasked { .. } if !end.is_alive() => {
                return Err("an answer to a query of an earlier connection".into());
            }
            HostEvent::Unasked { word } => end.event(&json!({"event": "unasked", "word": word})),
            HostEvent::Corrupt(error) => end.event(&json!({"event": "corrupt", "error": error})),
            HostEvent::Echo(error) => {
                end.event(&json!({"event": "echo", "error": error, "text": error.to_string()}));
            }
            _ => {}
        }
        Ok(())
    }
}

impl Worker for Sender {
    async fn poll(&mut self, end: &End) {
        let (outcome, why) = match self.laser.query(Instruction::bare(self.settings.query)).await {
            Ok(answer) if !answer.items().is_empty() => {
                let values = serde_json::to_string(&answer.items()).unwrap_or_default();
                return end.values(vec![("Status/Values", text(values))]);
            }
            Ok(_) => (Outcome::Done, self.without_answer()),
            Err(error) => outcome_of(&error),
        };
        end.event(&json!({"event": "query_failed", "outcome": outcome, "why": why}));
    }

    async fn command(&mut self, command: &Command, _: &End) -> (Outcome, String) {
        let order: Order = match order(&command.order) {
            Ok(order) => order,
            Err(why) => return (Outcome::Refused, why),
        };
        if let Err(why) = order.fits(&self.settings.session) {
            return (Outcome::Refused, why);
        }
        self.unanswered.store(0, Ordering::Relaxed);
        let mut instructions = order.instructions.into_iter().map(InstructionArgs::instruction);
        let done = match (instructions.next(), instructions.len()) {
            (Some(single), 0) => self.laser.query(single).await.map(Some),
            (first, _) => self.laser.run(first.into_iter().chain(instructions)).await.map(|()| None),
        };
        match done {
            Ok(Some(answer)) if !answer.items().is_empty() => {
                (Outcome::Done, serde_json::to_string(&answer.items()).unwrap_or_default())
            }
            Ok(_) => (Outcome::Done, self.without_answer()),
            Err(error) => outcome_of(&error),
        }
    }
}

impl Sender {
    /// Returns a sentence about a frame that was sent several times without an answer; empty for any other frame.
    fn without_answer(&self) -> String {
        match self.unanswered.swap(0, Ordering::Relaxed) {
            0 => String::new(),
            unanswered => format!("no answer after {unanswered} attempts"),
        }
    }
}

/// Returns the outcome of a frame with this error, and the reason.
fn outcome_of(error: &Error) -> (Outcome, String) {
    match error {
        Error::Refused { refusal, .. } => (Outcome::Refused, format!("the controller refuses: {refusal}")),
        Error::Unknown { reason, .. } => (Outcome::Unknown, reason.to_string()),
        Error::Closed(_) => (Outcome::Unknown, error.to_string()),
        _ => (Outcome::Refused, error.to_string()),
    }
}

impl Order {
    /// Checks that all instructions fit one frame.
    fn fits(&self, config: &HostConfig) -> Result<(), String> {
        if self.instructions.is_empty() {
            return Err("there are no instructions".into());
        }
        // A host without a connection, which is never used otherwise.
        let mut host = Host::new(*config).map_err(|error| error.to_string())?;
        for InstructionArgs { word, values } in &self.instructions {
            match host.submit(*word, |payload| write(payload, values)) {
                Ok(_) => {}
                Err(SessionError::Full) => {
                    return Err("more instructions than fit a frame, or of different classes".into());
                }
                Err(error) => return Err(format!("instruction {word:#06x}: {error}")),
            }
        }
        Ok(())
    }
}

impl InstructionArgs {
    fn instruction(self) -> Instruction {
        let Self { word, values } = self;
        Instruction::new(word, move |payload| write(payload, &values))
    }
}

fn write(payload: &mut Payload<'_>, values: &[f32]) -> Result<(), EncodeError> {
    if values.is_empty() { Ok(()) } else { payload.f32(values).map(drop) }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicU64;
    use std::sync::mpsc::sync_channel;

    use tokio::sync::watch;

    use super::*;
    use crate::end::Stop;

    #[test]
    fn an_answer_to_an_earlier_query_is_no_sign_of_life_and_ends_the_connection_of_a_dead_device() {
        let mut answers = AnswerReporter { unanswered: Arc::default() };
        let ((hub, reports), (_stop, told)) = (sync_channel(9), watch::channel(false));
        let counted: Arc<AtomicU64> = Arc::default();
        let end = End::new(3, "x".into(), hub, Stop::new(told, None), Arc::clone(&counted), counted);
        let unasked = || HostEvent::Unasked { word: STATUS };
        let why = "an answer to a query of an earlier connection";
        assert_eq!(answers.event(unasked(), &end), Err(why.into()));
        assert_eq!(reports.try_iter().count(), 0);
        end.answered();
        assert_eq!(answers.event(unasked(), &end), Ok(()));
        assert_eq!(reports.try_iter().count(), 2);
    }

    #[test]
    fn an_order_fits_one_frame_or_is_refused_as_a_whole() {
        let config = Settings::default().session;
        let fits = |words: &[u16]| {
            let instructions =
                words.iter().map(|word| InstructionArgs { word: *word, values: vec![1.0] }).collect();
            Order { instructions }.fits(&config)
        };
        assert_eq!(fits(&[]), Err("there are no instructions".into()));
        assert_eq!(fits(&[0x0101; 7]), Ok(()));
        let why = "more instructions than fit a frame, or of different classes";
        assert_eq!((fits(&[0x0101; 8]), fits(&[0x0101, 0x0201])), (Err(why.into()), Err(why.into())));
    }
}
