//! The jobs of a Kawasaki robot: a command is an order of jobs, and its outcome is the order's.

use std::convert::Infallible;
use std::io;
use std::sync::{Arc, PoisonError};
use std::time::Duration;

use anyhow::{Result, ensure};
use kawasaki_msg::tokio::{self as kawasaki, Error, LastOrder, OrderResult, Orders, Pc, ProgressStore};
use kawasaki_msg::{Charset, PcConfig, PcEvent, SessionError};
use robot_session::tokio::{Connector, Listen};
use serde::Deserialize;
use serde_json::{Map, Value as Json, json};
use tokio::select;
use tokio::sync::watch;
use tokio::time::sleep;

use super::client::{self, Listener, PollSettings, Silence, Worker};
use super::order;
use super::port::{Peer, PeerRecorder, Port};
use crate::end::End;
use crate::metric::{Definition, EVENT, define, text, whole};
use crate::payload::Kind;
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_links::kawasaki_msg::layout::{AnyWork, Layout};
use cellwire_links::kawasaki_msg::pc_settings;
use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::settings::{Configure, FieldVisitor};

/// The interval at which it is checked whether an order is to be broken off.
const CHECK_INTERVAL: Duration = Duration::from_millis(100);
/// The maximum number of jobs of a command.
const MAX_JOBS: usize = 10_000;

const METRICS: [Definition; 5] = [
    define("Robot/Phase", Kind::String),
    define("Robot/Order", Kind::Int64),
    define("Order/Number", Kind::Int64),
    define("Order/Executed", Kind::Int64),
    define("Order/Queued", Kind::Int64),
];

/// The settings of a cell.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    plant: Plant,
    session: PcConfig,
}

impl Default for Settings {
    fn default() -> Self {
        Self { plant: Plant::default(), session: PcConfig::tcp() }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { plant, session } = self;
        plant.configure(fields);
        pc_settings(fields, session);
    }
}

/// The content of a command: the jobs of an order.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Order {
    jobs: Vec<Map<String, Json>>,
}

/// The progress of the order.
#[derive(Debug, Clone, Copy, Default)]
struct OrderProgress {
    /// The robot has accepted the order.
    is_begun: bool,
    executed: u32,
    sent: u32,
}

/// Counts the jobs that are sent.
struct SentCounter(watch::Sender<OrderProgress>);

impl ProgressStore for SentCounter {
    async fn keep(&mut self, last: &LastOrder) -> io::Result<()> {
        if let LastOrder::Active(kept) = last {
            self.0.send_modify(|course| course.sent = kept.sent);
        }
        Ok(())
    }
}

/// Reports the robot's state.
struct State {
    course: watch::Sender<OrderProgress>,
    peer: Peer,
    /// The connection of the last status, and what was reported of it.
    connection: u64,
    status: String,
}

/// Gives the robot orders.
struct Kawasaki {
    pc: Pc<AnyWork, SentCounter>,
    course: watch::Sender<OrderProgress>,
    layout: Layout,
    charset: Charset,
    /// The number of the next order: an earlier process may have used any.
    next: u16,
}

pub(super) fn client(cell: &Cell, Settings { plant, session }: Settings) -> Result<super::Client> {
    let config = plant.pc(session)?;
    ensure!(
        !config.datagrams || cell.listen.is_some(),
        "over UDP the robot sends first: give listen instead of address"
    );
    let layout = plant.layout()?;
    let Some(listen) = &cell.listen else {
        return of(cell, config, layout, plant.charset, Port::of(cell, None)?);
    };
    // A port alone is one of this machine's loopback address.
    let listen = listen.parse().map_or_else(|_| listen.clone(), |port: u16| format!("127.0.0.1:{port}"));
    match config.datagrams {
        true => of(cell, config, layout, plant.charset, kawasaki::udp(listen, config.dialect)),
        false => of(cell, config, layout, plant.charset, Listen::at(listen)),
    }
}

fn of<C: Connector + 'static>(
    cell: &Cell,
    config: PcConfig,
    layout: Layout,
    charset: Charset,
    connector: C,
) -> Result<super::Client> {
    let (course, peer) = (watch::Sender::new(OrderProgress::default()), Peer::default());
    let place = cell.listen.as_ref().and_then(|listen| listen.parse().ok());
    let connector = PeerRecorder { connector, peer: Arc::clone(&peer), place };
    let (pc, task) =
        kawasaki::pc_with_ranges(config, layout.clone(), SentCounter(course.clone()), connector)?;
    // An order continues on the next connection, at any time.
    let (task, handle) = (task.give_up_after(Duration::MAX), pc.handle().clone());
    let terms = PollSettings { silence: Silence::of_session(), every: None, deadline: None };
    let state = State { course: course.clone(), peer, connection: 0, status: String::new() };
    let worker = Kawasaki { pc, course, layout, charset, next: fastrand::u16(1..) };
    Ok(client::of(cell, &METRICS, terms, (handle, task), state, worker))
}

impl Listener for State {
    type Service = Orders<AnyWork, SentCounter>;

    fn event(&mut self, event: PcEvent, end: &End) -> Result<(), String> {
        match event {
            PcEvent::Progress { executed, queued } => {
                self.course.send_modify(|course| course.executed = executed);
                end.values(vec![("Order/Executed", whole(executed)), ("Order/Queued", whole(queued))]);
            }
            PcEvent::PeerStatus { phase, order, .. } => {
                let before = core::mem::replace(&mut self.connection, end.connections());
                let is_new = before != self.connection;
                if is_new {
                    end.connected(&self.peer.lock().unwrap_or_else(PoisonError::into_inner));
                }
                end.answered();
                // The status comes in every cycle of the robot: only a change is news.
                let phase = serde_json::to_value(phase).unwrap_or_default();
                let phase = phase.as_str().map_or_else(|| phase.to_string(), str::to_owned);
                let before = core::mem::replace(&mut self.status, format!("{phase} {order}"));
                if before != self.status || is_new {
                    let shown = serde_json::to_string(&event).unwrap_or_default();
                    let values = [("Robot/Phase", text(phase)), ("Robot/Order", whole(order))];
                    end.values(values.into_iter().chain([(EVENT, text(shown))]).collect());
                }
            }
            PcEvent::JobUnfit { index, error, .. } => {
                end.event(&json!({"event": "job_unfit", "index": index, "why": error.to_string()}));
            }
            event => {
                if let PcEvent::OrderStarted { .. } = event {
                    self.course.send_modify(|course| course.is_begun = true);
                }
                end.event(&event);
            }
        }
        Ok(())
    }
}

impl Worker for Kawasaki {
    async fn command(&mut self, command: &Command, end: &End) -> (Outcome, String) {
        let works = match self.works(command) {
            Ok(works) => works,
            Err(why) => return (Outcome::Refused, why),
        };
        let (number, all) = (self.next, works.len());
        self.next = number.checked_add(1).unwrap_or(1);
        self.course.send_replace(OrderProgress::default());
        let order = match self.pc.start(number, works).await {
            Ok(order) => order,
            Err(closed) => return (Outcome::Unknown, closed.to_string()),
        };
        end.values(vec![
            ("Order/Number", whole(number)),
            ("Order/Executed", whole(0)),
            ("Order/Queued", whole(0)),
        ]);
        let over = select! {
            biased;
            over = order => over,
            never = self.break_off(end) => match never {},
        };
        match over {
            Ok(OrderResult { executed, complete: true, .. }) => (Outcome::Done, format!("{executed} jobs")),
            Ok(OrderResult { executed: 0, .. }) => {
                (Outcome::Refused, "the order ended before its first job".into())
            }
            Ok(OrderResult { executed, .. }) => {
                (Outcome::Partial, format!("{executed} of {all} jobs were executed; the rest will not be"))
            }
            Err(Error::OutcomeUnknown { executed, sent }) => (
                Outcome::Unknown,
                format!(
                    "jobs {} to {sent} are unknown; earlier ones are executed, later ones are not",
                    executed + 1
                ),
            ),
            Err(Error::Refused { active }) => (Outcome::Refused, format!("the robot is in order {active}")),
            Err(error @ (Error::Call(_) | Error::NotConnected(_))) => (Outcome::Refused, error.to_string()),
            Err(error) => (Outcome::Unknown, error.to_string()),
        }
    }

    fn unfinished(&self, why: &str, end: &End) -> String {
        let OrderProgress { executed, sent, .. } = *self.course.borrow();
        let first = executed + 1;
        let rest = match end.refusal(true) {
            _ if first > sent => "no job of the order is known to be sent".into(),
            None => {
                format!(
                    "jobs {first} to {sent} may still be executed: the robot did not end the order in time"
                )
            }
            Some(_) => format!("jobs {first} to {sent} may still be executed: the robot is not connected"),
        };
        format!("{why}; {rest}")
    }
}

impl Kawasaki {
    fn works(&self, command: &Command) -> Result<Vec<AnyWork>, String> {
        let Order { jobs } = order(&command.order)?;
        if jobs.is_empty() || jobs.len() > MAX_JOBS {
            return Err(format!("give 1 to {MAX_JOBS} jobs"));
        }
        let works =
            (1..).zip(&jobs).map(|(place, job)| self.job(job).map_err(|why| format!("job {place}: {why}")));
        works.collect()
    }

    /// Breaks the order off when the bridge ends, or if the connection is lost before the robot has accepted it: it would
    /// begin with the next one, whenever that is. It ends after the job that is being executed; if the plant has no message
    /// for that, after those that the robot has queued.
    async fn break_off(&self, end: &End) -> Infallible {
        loop {
            let is_lost = end.refusal(false).is_some() && !self.course.borrow().is_begun;
            if (end.is_stopped() || is_lost)
                && let Err(Error::Call(SessionError::Lacks { .. })) = self.pc.interrupt().await
            {
                // The order is ending already, or has not begun: then the call is retried.
                let _ = self.pc.end().await;
            }
            sleep(CHECK_INTERVAL).await;
        }
    }

    /// Returns a job from its named fields, as in a table of `cellwire run kawasaki`.
    fn job(&self, given: &Map<String, Json>) -> Result<AnyWork, String> {
        if let Some(name) = given.keys().find(|name| self.layout.place(name).is_none()) {
            let names: Vec<&str> = self.layout.fields().iter().map(|field| field.name.as_str()).collect();
            return Err(format!("a job has no field {name}: it has {}", names.join(", ")));
        }
        let mut texts = Vec::new();
        for (place, field) in (0..).zip(self.layout.fields()) {
            texts.push(match (given.get(&field.name), field.default) {
                (Some(Json::String(text)), _) => text.clone(),
                (Some(Json::Number(number)), _) => number.to_string(),
                (Some(_), _) => return Err(format!("{} must be a number or a string", field.name)),
                (None, Some(default)) => {
                    let mut work = AnyWork::default();
                    work.set(place, default);
                    self.layout.show(place, &work)
                }
                (None, None) => return Err(format!("missing: {}", field.name)),
            });
        }
        let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
        self.layout.job(&texts, self.charset).map_err(|error| error.to_string())
    }
}
