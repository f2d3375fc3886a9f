//! The jobs of a Kawasaki robot: a command is an order of jobs, and its outcome is the order's.

use std::time::{Duration, Instant};

use anyhow::{Result, ensure};
use kawasaki_msg::{Charset, JobSource, LargePc, PcConfig, PcEvent, SessionError, Supply};
use serde::Deserialize;
use serde_json::{Map, Value as Json, json};

use super::order;
use crate::end::{ENDS, End, Inbox};
use crate::metric::{Definition, EVENT, Named, define, text, whole};
use crate::payload::Kind;
use crate::report::{Command, Outcome};
use crate::site::Cell;
use cellwire_io::endpoint::Endpoint;
use cellwire_io::kawasaki::meeting::Meeting;
use cellwire_io::kawasaki::pc::{self, Notification, Program};
use cellwire_io::tcp::Dialing;
use cellwire_io::trace::TraceArgs;
use cellwire_links::kawasaki_msg::layout::{AnyWork, Layout};
use cellwire_links::kawasaki_msg::pc_settings;
use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::settings::{Configure, Fields};

/// How often a failed open is retried.
const RETRY: Duration = Duration::from_secs(5);
/// How often commands are looked for meanwhile.
const LOOK: Duration = Duration::from_millis(100);
/// The most jobs of a command.
const MOST: usize = 10_000;

const METRICS: [Definition; 5] = [
    define("Robot/Phase", Kind::String),
    define("Robot/Order", Kind::Int64),
    define("Order/Number", Kind::Int64),
    define("Order/Executed", Kind::Int64),
    define("Order/Queued", Kind::Int64),
];

/// What can be set.
#[derive(Debug, Clone)]
pub(super) struct Settings {
    plant: Plant,
    session: PcConfig,
}

impl Default for Settings {
    fn default() -> Self {
        Self { plant: Plant::default(), session: PcConfig::TCP }
    }
}

impl Configure for Settings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { plant, session } = self;
        plant.configure(fields);
        pc_settings(fields, session);
    }
}

/// What a command may order.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Order {
    jobs: Vec<Map<String, Json>>,
}

/// The jobs of an order.
struct Jobs(Vec<AnyWork>);

impl JobSource for Jobs {
    type Work = AnyWork;

    fn job(&mut self, index: u32) -> Supply<AnyWork> {
        let index = usize::try_from(index).unwrap_or(usize::MAX);
        self.0.get(index).map_or(Supply::End, |work| Supply::Job(*work))
    }
}

struct Kawasaki<'a> {
    end: &'a End,
    inbox: &'a mut Inbox,
    layout: Layout,
    charset: Charset,
    /// The number of the next order: an earlier process may have used any.
    next: u16,
    /// How many jobs the order has.
    jobs: usize,
    /// What the robot's status was when it was reported last.
    status: Option<String>,
    is_connected: bool,
    /// Where the robot is that has connected, until its first message.
    place: Option<String>,
}

pub(super) fn client(cell: &Cell, Settings { plant, session }: Settings) -> Result<super::Client> {
    let config = plant.pc(session)?;
    ensure!(
        !config.datagrams || cell.listen.is_some(),
        "over UDP the robot sends first: give listen instead of address"
    );
    let (layout, charset, dialing) = (plant.layout()?, plant.charset, super::dialing(cell));
    let endpoint = match (&cell.address, &cell.listen) {
        (Some(address), _) => Endpoint::Connect(address.clone()),
        (None, listen) => Endpoint::Listen(listen.clone().unwrap_or_default()),
    };
    Ok(super::Client::new(&METRICS, async move |end: End, mut inbox: Inbox| {
        // It waits for its robot by itself.
        let cell = move || {
            let mut next = fastrand::u16(1..);
            while !end.is_stopped() {
                let ends = (&end, &mut inbox);
                let ended = run(ends, (&endpoint, dialing), config, &layout, charset, &mut next);
                let why =
                    ended.err().map_or_else(|| "the bridge ends".to_owned(), |error| format!("{error:#}"));
                end.finish(Outcome::Unknown, why.clone());
                end.disconnected(&why);
                wait(&end, &mut inbox);
            }
            inbox.refuse(&end, ENDS);
            end.flush_in_thread();
        };
        let _ = tokio::task::spawn_blocking(cell).await;
    }))
}

/// Waits for the next attempt; commands are refused meanwhile.
fn wait(end: &End, inbox: &mut Inbox) {
    let until = Instant::now() + RETRY;
    while Instant::now() < until && !end.is_stopped() {
        inbox.refuse(end, "the link is not connected");
        end.flush_in_thread();
        std::thread::sleep(LOOK);
    }
}

fn run(
    (end, inbox): (&End, &mut Inbox),
    (endpoint, dialing): (&Endpoint, Dialing),
    config: PcConfig,
    layout: &Layout,
    charset: Charset,
    next: &mut u16,
) -> Result<()> {
    let (mut meeting, ..) = Meeting::of_pc(endpoint, config.datagrams, config.dialect, dialing)?;
    let session = LargePc::<Jobs>::with_ranges(config, layout.clone())?;
    let mut program = Kawasaki {
        end,
        inbox,
        layout: layout.clone(),
        charset,
        next: *next,
        jobs: 0,
        status: None,
        is_connected: false,
        place: None,
    };
    let ended = pc::run(&mut meeting, session, &TraceArgs::off().start("kawasaki"), &mut program);
    *next = program.next;
    ended.map(drop)
}

impl Program for Kawasaki<'_> {
    type Session = LargePc<Jobs>;

    fn step(&mut self, session: &mut Self::Session) -> Result<bool> {
        self.end.flush_in_thread();
        if session.order().is_none()
            && let Some(command) = self.inbox.try_next(self.end)
            && let Err(why) = self.begin(session, &command)
        {
            self.end.finish(Outcome::Refused, why);
        }
        if self.end.is_over() {
            if session.order().is_some() {
                let (first, sent) = (session.executed() + 1, session.sent());
                let why = match self.is_connected {
                    _ if first > sent => "no job of the order is known to be sent".into(),
                    true => format!(
                        "jobs {first} to {sent} may still be executed: the robot did not end the order in time"
                    ),
                    false => {
                        format!("jobs {first} to {sent} may still be executed: the robot is not connected")
                    }
                };
                self.end.finish(Outcome::Unknown, format!("the bridge has ended; {why}"));
            }
            return Ok(false);
        }
        if self.end.is_stopped() && session.order().is_some() {
            pc::break_off(session);
        }
        Ok(true)
    }

    fn notify(&mut self, _: &mut Self::Session, notification: Notification<'_>) -> Result<()> {
        match notification {
            Notification::Connected(place) => self.place = Some(place),
            Notification::Disconnected(why) => {
                (self.is_connected, self.place) = (false, None);
                self.end.disconnected(why);
            }
            Notification::Event(event) => self.event(event),
            Notification::Traced(_) => {}
        }
        Ok(())
    }
}

impl Kawasaki<'_> {
    fn begin(&mut self, session: &mut LargePc<Jobs>, command: &Command) -> Result<(), String> {
        // The session would begin it with the next connection, whenever that is.
        if !self.is_connected {
            return Err("the link is not connected".into());
        }
        let Order { jobs } = order(&command.order)?;
        if jobs.is_empty() || jobs.len() > MOST {
            return Err(format!("give 1 to {MOST} jobs"));
        }
        let works =
            (1..).zip(&jobs).map(|(place, job)| self.job(job).map_err(|why| format!("job {place}: {why}")));
        let works = works.collect::<Result<Vec<AnyWork>, String>>()?;
        self.jobs = works.len();
        let number = self.next;
        self.next = number.checked_add(1).unwrap_or(1);
        session.start(number, Jobs(works)).map_err(|error: SessionError| error.to_string())?;
        self.end.values(vec![
            ("Order/Number", whole(number)),
            ("Order/Executed", whole(0)),
            ("Order/Queued", whole(0)),
        ]);
        Ok(())
    }

    /// A job from its fields by their names, as in a table of `cellwire run kawasaki`.
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

    fn event(&mut self, event: PcEvent) {
        let shown = serde_json::to_string(&event).unwrap_or_default();
        let mut values: Vec<Named> = Vec::new();
        match event {
            PcEvent::Progress { executed, queued } => {
                values.extend([("Order/Executed", whole(executed)), ("Order/Queued", whole(queued))]);
                return self.end.values(values);
            }
            PcEvent::PeerStatus { phase, order, .. } => {
                if let Some(place) = self.place.take() {
                    self.is_connected = true;
                    self.end.connected(&place);
                    self.status = None;
                }
                // It comes in every cycle of the robot: only another one is news.
                let phase = serde_json::to_value(phase).unwrap_or_default();
                let phase = phase.as_str().map_or_else(|| phase.to_string(), str::to_owned);
                let status = format!("{phase} {order}");
                if self.status.as_deref() == Some(&status) {
                    return;
                }
                self.status = Some(status);
                values.extend([("Robot/Phase", text(phase)), ("Robot/Order", whole(order))]);
            }
            PcEvent::OrderOver { executed, complete: true, .. } => {
                self.end.finish(Outcome::Done, format!("{executed} jobs"));
            }
            PcEvent::OrderOver { executed: 0, .. } => {
                self.end.finish(Outcome::Refused, "the order ended before its first job");
            }
            PcEvent::OrderOver { executed, .. } => {
                let all = self.jobs;
                self.end.finish(
                    Outcome::Partial,
                    format!("{executed} of {all} jobs were executed; the rest will not be"),
                );
            }
            PcEvent::OutcomeUnknown { executed, sent, .. } => {
                self.end.finish(
                    Outcome::Unknown,
                    format!(
                        "jobs {} to {sent} are unknown; earlier ones are executed, later ones are not",
                        executed + 1
                    ),
                );
            }
            PcEvent::OrderRefused { given_up: true, active, .. } => {
                self.end.finish(Outcome::Refused, format!("the robot is in order {active}"));
            }
            PcEvent::JobUnfit { index, error, .. } => {
                let event = json!({"event": "job_unfit", "index": index, "why": error.to_string()});
                return self.end.event(&event);
            }
            _ => {}
        }
        values.push((EVENT, text(shown)));
        self.end.values(values);
    }
}
