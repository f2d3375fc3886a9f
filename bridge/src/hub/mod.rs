//! The hub: receives the reports of the cells, stores them, and publishes them from the store.
//!
//! ```text
//!  device ◀──link──▶ cell's task ────reports──▶ hub ──▶ store ──▶ uplink ──▶ broker
//!                          ▲                     │ ▲                           │
//!                          └──────commands───────┘ └────────commands───────────┘
//! ```
//!
//! One thread has the store. A turn collects the reports that have come, writes them at once, and then acts on them: only
//! records on the disk are published, only remembered commands are given to a cell, and a record leaves the store when the
//! broker has it.

mod power;
mod records;
mod reload;
mod sharing;

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

use anyhow::Result;
use robot_session::now;
use serde_json::{Value as Json, json};
use tokio::runtime;

use super::bucket::Rate;
use super::cell::Cell;
use super::commands::{Commands, Decision, InterruptedCommand, Write};
use super::compact::NameNumbers;
use super::end::COMMAND_TIMEOUT;
use super::health::{BrokerHealth, Figures, Health};
use super::links::Client;
use super::metric::{self, COMMAND, CONNECTED, DETAIL, EVENT, NamedValue};
use super::notify::Notify;
use super::outages::Outages;
use super::payload::{Payload, Quality, Value};
use super::recent;
use super::refusals::DroppedRecord;
use super::report::{Command, Input, Outcome, Report, ReportBody};
use super::share::Share;
use super::site::{Broker, ShareSettings, Site};
use super::uplink::{self, CellIndices, Event, Uplink};
use crate::store::{Batch, Store};
use cellwire_io::interrupt;
pub use records::check;
use sharing::SharedCommand;

/// The number of reports that may wait for the hub.
const REPORT_QUEUE_LEN: usize = 10_000;
/// Reports that arrive within this time are written together: a disk takes some hundred writes a second.
const GATHER: Duration = Duration::from_millis(20);
/// The maximum number of inputs that are written together.
const MAX_BATCH: usize = 5_000;
/// The interval at which health and interrupts are checked.
const TICK: Duration = Duration::from_millis(200);
/// The interval at which old commands are forgotten.
const FORGET: Duration = Duration::from_secs(3600);
/// The time that the links get at the end: their last commands, and a moment to report the outcomes.
const LINKS_END: Duration = COMMAND_TIMEOUT.saturating_add(Duration::from_millis(500));
/// The time that the broker gets at the end to acknowledge records.
const FAREWELL: Duration = Duration::from_secs(2);
/// The maximum number of reasons that are logged: a sender with another one each time does not fill the disk.
const REASONS: usize = 200;

/// The hub.
#[allow(missing_debug_implementations, reason = "it holds a store")]
pub struct Hub<'a> {
    cells: Vec<Cell>,
    places: CellIndices,
    /// The record numbers of the cells in the store, even of cells that are not in the site file.
    numbers: HashMap<String, u64>,
    /// The name of the store.
    identity: String,
    /// The sender that new cells report with.
    sender: SyncSender<Input>,
    /// Runs the cells, in one thread.
    runtime: runtime::Handle,
    site: Site,
    /// Whether the site file is to be reloaded.
    reload: Arc<AtomicBool>,
    reading: Option<reload::Reading>,
    store: Store,
    words: NameNumbers,
    uplink: Uplink,
    commands: Commands,
    latest: recent::Commands,
    share: Option<Share>,
    inbox: Receiver<Input>,
    busy: Arc<AtomicU64>,
    health: Arc<Health>,
    figures: Figures,
    log: &'a mut dyn FnMut(Json),
    outages: Outages,
    /// The numbers of commands that were refused at once, by cell and reason.
    refusals: BTreeMap<(usize, &'static str), u64>,
    /// The reasons why messages of the broker were not understood, as logged.
    strange: HashSet<String>,
    /// The cells whose records were refused for good, and the reasons.
    refused: HashSet<(usize, String)>,
    forget_at: Instant,
    show_at: Instant,
    notify: Notify,
}

/// The results of a turn: names and records to write, and actions for when they are written.
#[derive(Default)]
struct Turn {
    batch: Batch,
    give: Vec<(usize, Command)>,
    /// Commands of shared cells, to report to the other bridges.
    tell: Vec<SharedCommand>,
}

impl<'a> Hub<'a> {
    /// Opens the store and starts the cells. `log` gets the messages for people.
    ///
    /// # Errors
    /// If the store cannot be opened, or the system has no room for a thread.
    pub fn start(
        site: Site,
        clients: Vec<Client>,
        health: Arc<Health>,
        reload: Arc<AtomicBool>,
        log: &'a mut dyn FnMut(Json),
    ) -> Result<Self> {
        let mut store = Store::open(&site.store.file, site.store.bytes)?;
        store.belong_to(&format!("{}/{}", site.broker.group, site.broker.node))?;
        let mut turn = Turn::default();
        let mut words = NameNumbers::open(&store)?;
        for (name, client) in site.cell.keys().zip(&clients) {
            words.learn(name, &client.definitions().collect::<Vec<_>>(), &mut turn.batch);
        }
        let Broker { address, group, node, .. } = &site.broker;
        let broker = BrokerHealth {
            address: address.to_string(),
            group: group.clone(),
            node: node.clone(),
            why: String::new(),
        };
        let figures = Figures { broker, ..Figures::default() };
        let mut numbers = records::numbers_of(&mut store, &words)?;
        if power::restarted_while_running(&store, &mut turn.batch)? {
            let why = "the machine stopped without ending the bridge: the last records may be lost, and record numbers have a gap";
            log(json!({"store": "power", "why": why}));
            site.cell.keys().for_each(|name| *numbers.entry(name.clone()).or_default() += power::NUMBER_GAP);
        }
        let identity = match store.get("store")? {
            Some(identity) => identity,
            None => {
                let identity = format!("{:016x}", fastrand::u64(..));
                turn.batch.names.push(("store".into(), Some(identity.clone())));
                identity
            }
        };
        let rate = Rate { per_second: site.commands.rate, burst: site.commands.burst };
        let names = |prefix: &str| store.names(prefix);
        let (commands, unknown) = Commands::open(names, site.commands.max_age, rate, &mut turn.batch)?;
        let (sender, inbox) = sync_channel(REPORT_QUEUE_LEN);
        let bd_seq = store.get(uplink::BD_SEQ)?.and_then(|text| text.parse().ok()).unwrap_or_default();
        let uplink = Uplink::new(&site.broker, site.share.is_some(), bd_seq, sender.clone())?;
        let share = |with: &ShareSettings| {
            Share::new(&site.broker.node, &identity, &with.bridges, site.commands.max_age)
        };
        let share = site.share.as_ref().map(share);
        let (forget_at, show_at) = (Instant::now(), Instant::now());
        let mut hub = Self {
            cells: Vec::new(),
            places: CellIndices::new(),
            numbers,
            identity,
            sender,
            runtime: reload::cells()?,
            site,
            reload,
            reading: None,
            store,
            words,
            uplink,
            commands,
            latest: recent::Commands::default(),
            share,
            inbox,
            busy: Arc::default(),
            health,
            figures,
            log,
            outages: Outages::default(),
            refusals: BTreeMap::new(),
            strange: HashSet::new(),
            refused: HashSet::new(),
            forget_at,
            show_at,
            notify: Notify::from_environment(),
        };
        for ((name, cell), client) in hub.site.cell.clone().iter().zip(clients) {
            hub.begin(name, cell, client)?;
        }
        for InterruptedCommand { cell, report } in unknown {
            let Some(&place) = hub.places.get(&cell) else { continue };
            hub.is_unknown(place, report, &mut turn);
        }
        hub.write(&mut turn.batch)?;
        hub.say(turn.tell);
        Ok(hub)
    }

    /// Runs until it is interrupted.
    ///
    /// # Errors
    /// If the store cannot be read or written, or standard output is closed.
    pub fn run(mut self) -> Result<()> {
        self.notify.say("READY=1");
        while !interrupt::requested() {
            self.turn(false)?;
        }
        self.notify.say("STOPPING=1");
        for cell in &self.cells {
            cell.stop.send_replace(true);
        }
        // The last reports of the links are stored, and published if there is a broker.
        self.until(LINKS_END, |hub| hub.cells.iter().all(Cell::has_ended))?;
        if let Some(share) = self.share.as_mut().filter(|_| self.cells.iter().all(Cell::has_ended)) {
            share.end();
        }
        self.turn(true)?;
        self.uplink.disconnect();
        self.until(FAREWELL, |hub| hub.uplink.is_offline())?;
        // Everything is on the disk: a loss of power after this loses no records.
        let mut batch = Batch::default();
        power::ended(&mut batch);
        self.write(&mut batch)
    }

    /// Takes turns until the condition is met, but no longer than `limit`.
    fn until(&mut self, limit: Duration, is_so: impl Fn(&Self) -> bool) -> Result<()> {
        let end = Instant::now() + limit;
        while !is_so(self) && Instant::now() < end {
            self.turn(true)?;
        }
        Ok(())
    }

    fn turn(&mut self, ends: bool) -> Result<()> {
        let mut turn = Turn::default();
        let now = Instant::now();
        let due = self
            .uplink
            .due()
            .filter(|_| !ends)
            .into_iter()
            .chain(self.store.due())
            .min()
            .map_or(TICK, |due| due.saturating_duration_since(now).min(TICK));
        let (over, mut is_drained) = (self.over(), true);
        match self.inbox.recv_timeout(due) {
            Ok(input) => {
                is_drained = false;
                self.take(input, &mut turn);
                let gathered = Instant::now() + GATHER;
                for _ in 0..MAX_BATCH {
                    let left = gathered.saturating_duration_since(Instant::now());
                    match self.inbox.recv_timeout(left) {
                        Ok(input) => self.take(input, &mut turn),
                        Err(_) => {
                            is_drained = true;
                            break;
                        }
                    }
                }
            }
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {}
        }
        if !ends {
            self.renew(if is_drained { over } else { Vec::new() }, &mut turn)?;
            self.share_out(&mut turn)?;
        }
        if now >= self.forget_at {
            self.forget_at = now + FORGET;
            self.commands.forget(metric::now(), &mut turn.batch);
        }
        let (orphans, apart) = self.uplink.prepare(ends, &mut turn.batch);
        apart.into_iter().for_each(|apart| self.refused(apart));
        if orphans > 0 && self.figures.dropped_orphans == 0 {
            let why = "records of cells that are no longer in the site file are dropped";
            (self.log)(json!({"store": "orphans", "why": why}));
        }
        self.figures.dropped_orphans += orphans;
        self.write(&mut turn.batch)?;
        self.say(turn.tell);
        for (place, command) in turn.give {
            if let Some(cell) = self.cells.get(place) {
                // A task that is gone has reported nothing: the command is unknown at the next start.
                let _ = cell.commands.send(command);
            }
        }
        if let Some(why) = self.uplink.turn((&mut self.store, &self.words), &mut self.cells, &self.places)? {
            self.lost(why);
        }
        if now >= self.show_at {
            self.show_at = now + TICK;
            self.show();
        }
        Ok(())
    }

    fn take(&mut self, input: Input, turn: &mut Turn) {
        match input {
            Input::Cell(place, Report { at, body: ReportBody::Values(named) }) => {
                let is_connected = named.iter().find_map(|(name, value)| match value {
                    Value::Boolean(connected) if *name == CONNECTED => Some(*connected),
                    _ => None,
                });
                if let (Some(is_connected), Some(cell)) = (is_connected, self.cells.get_mut(place)) {
                    if core::mem::replace(&mut cell.is_connected, is_connected) != is_connected {
                        cell.since = at;
                    }
                    let event: Option<Json> = named.iter().find_map(|(name, value)| match value {
                        Value::String(text) if *name == EVENT => serde_json::from_str(text).ok(),
                        _ => None,
                    });
                    let why = event.as_ref().and_then(|event| event.get("why")?.as_str());
                    cell.why = why.unwrap_or_default().to_owned();
                    (self.log)(json!({"cell": cell.name, "link": event.unwrap_or(Json::Null)}));
                }
                let has_values = named.iter().any(|(name, _)| *name != EVENT);
                if let Some(cell) = self.cells.get_mut(place).filter(|cell| cell.is_connected && has_values) {
                    // The device's values were implausible until now.
                    cell.why.clear();
                }
                let mut named = named;
                let quality = (is_connected == Some(false)).then_some(Quality::Stale);
                if let Some(cell) = self.cells.get(place)
                    && let Some(bands) = &cell.bands
                {
                    bands.filter(&mut named, |name| cell.values.get(name).map(|(_, value)| value));
                    if named.is_empty() {
                        return;
                    }
                }
                self.record_with(place, at, named, quality, &mut turn.batch);
            }
            Input::Cell(place, Report { body: ReportBody::Failed(event), .. }) => {
                let Some(cell) = self.cells.get_mut(place) else { return };
                let event: Json = serde_json::from_str(&event).unwrap_or_default();
                if let Some(why) = event.get("why").and_then(Json::as_str) {
                    why.clone_into(&mut cell.why);
                }
                (self.log)(json!({"cell": cell.name, "link": event}));
            }
            Input::Cell(place, Report { at, body: ReportBody::Bad(named) }) => {
                self.implausible(place, &named);
                self.record_with(place, at, named, Some(Quality::Bad), &mut turn.batch);
            }
            Input::Cell(place, Report { at, body: ReportBody::Outcome { id, outcome, detail } }) => {
                let Some(cell) = self.cells.get(place) else { return };
                (self.log)(json!({"cell": cell.name, "command": id, "outcome": outcome, "detail": detail}));
                self.latest.note(&cell.name, &id, at, outcome, &detail);
                let named = self.commands.finish(&cell.name, &id, outcome, detail, &mut turn.batch);
                self.count(outcome.name());
                turn.tell.push((place, id, None));
                self.record(place, at, named, &mut turn.batch);
            }
            Input::Broker(generation, happened) => {
                let event = self.uplink.on_broker_event(generation, happened, &mut turn.batch);
                self.broker(event, turn);
            }
        }
    }

    fn broker(&mut self, event: Event, turn: &mut Turn) {
        match event {
            Event::None => {}
            Event::Opened => self.share.iter_mut().for_each(Share::opened),
            Event::Connected => {
                let ungiven = self.share.as_mut().map(|share| share.connected(now(), metric::now()));
                self.not_given(ungiven.unwrap_or_default(), turn);
                self.figures.broker.why.clear();
                if self.outages.over(Instant::now()) {
                    (self.log)(json!({"broker": "connected", "address": self.uplink.address()}));
                }
            }
            Event::Held { place, why } => self.held(place, &why),
            Event::Released(place) => {
                if let Some(cell) = self.cells.get(place) {
                    (self.log)(json!({"cell": cell.name, "records": "released"}));
                }
            }
            Event::Rebirth => (self.log)(json!({"broker": "rebirth"})),
            Event::Lost(why) => self.lost(why),
            Event::Share { from, is_retained, payload } => self.heard(&from, &payload, is_retained, turn),
            Event::Malformed(why) => self.strange(why),
            Event::Write { device, payload, unfit } => self.command(&device, payload, unfit, turn),
        }
    }

    /// Logs the loss of a connection, once for each reason: attempts continue.
    fn lost(&mut self, why: String) {
        self.figures.broker.why.clone_from(&why);
        if self.outages.is_news(&why, Instant::now()) {
            (self.log)(json!({"broker": "disconnected", "why": why}));
        }
    }

    /// Logs a message that is not understood, once for each reason: every one is counted.
    fn strange(&mut self, why: String) {
        self.figures.strange += 1;
        if self.strange.len() < REASONS && self.strange.insert(why.clone()) {
            (self.log)(json!({"broker": "strange", "why": why}));
        }
    }

    fn held(&mut self, place: usize, why: &str) {
        if let Some(cell) = self.cells.get(place) {
            let advice = "its records are held and one is retried each minute: check the broker's access control for this cell's topics, and held_records";
            (self.log)(json!({"cell": cell.name, "records": "held", "why": why, "advice": advice}));
        }
    }

    /// Logs a record that was refused for good, once for each cell and reason: every one is counted.
    fn refused(&mut self, DroppedRecord { place, why, .. }: DroppedRecord) {
        if self.refused.insert((place, why.clone()))
            && let Some(cell) = self.cells.get(place)
        {
            let advice = "this and similar records are dropped: check the broker's limits, and dropped_total{why=\"refused\"}";
            (self.log)(json!({"cell": cell.name, "record": "refused", "why": why, "advice": advice}));
        }
    }

    fn command(&mut self, device: &str, payload: Payload, unfit: Option<String>, turn: &mut Turn) {
        let Some((place, cell)) =
            self.places.get(device).and_then(|place| Some((*place, self.cells.get(*place)?)))
        else {
            return self.strange(format!("a command for {device}, which is not a cell"));
        };
        if cell.is_gone() {
            return self.strange(format!("a command for {device}, which is no longer a cell"));
        }
        let unfit = unfit.or_else(|| self.is_elsewhere(cell));
        let mut payload = payload;
        for metric in &mut payload.metrics {
            let named = metric.alias.filter(|_| metric.name.is_none());
            metric.name =
                named.and_then(|alias| cell.by_alias(place, alias)).map(str::to_owned).or(metric.name.take());
        }
        let now = metric::now();
        let (is_allowed, cell_is_shared) = (cell.takes_commands, cell.is_shared);
        let unread = self.share.as_ref().filter(|_| cell_is_shared).and_then(Share::unread);
        let write = Write {
            cell: device,
            is_allowed,
            payload: &payload,
            unfit: unfit.as_deref(),
            is_shared: cell_is_shared,
            unread: unread.as_deref(),
        };
        match self.commands.decide(write, now, &mut turn.batch) {
            Decision::Give(command, named) => {
                (self.log)(json!({"cell": device, "command": command.id, "outcome": Outcome::Accepted}));
                self.latest.note(device, &command.id, now, Outcome::Accepted, "");
                self.record(place, now, named, &mut turn.batch);
                self.count("accepted");
                match cell_is_shared {
                    true => turn.tell.push((place, command.id.clone(), Some(command))),
                    false => turn.give.push((place, command)),
                }
            }
            Decision::Report(named) => {
                self.count("not_given");
                self.record(place, now, named, &mut turn.batch);
            }
            Decision::Refuse(why, named) => {
                self.count("not_given");
                *self.refusals.entry((place, why)).or_default() += 1;
                if let (Some(id), Some(detail)) = (text_of(&named, COMMAND), text_of(&named, DETAIL)) {
                    turn.tell.push((place, id.to_owned(), None));
                    self.latest.note(device, id, now, Outcome::Refused, detail);
                }
                self.record(place, now, named, &mut turn.batch);
            }
            Decision::Malformed(why) => {
                let event = json!({"event": "command_refused", "why": why});
                (self.log)(json!({"cell": device, "command": event}));
                self.count("not_given");
                self.record(place, now, vec![(EVENT, metric::text(event.to_string()))], &mut turn.batch);
            }
        }
    }
}

/// Returns the text of a metric.
fn text_of<'a>(named: &'a [NamedValue], name: &str) -> Option<&'a str> {
    named.iter().find_map(|(found, value)| match value {
        Value::String(text) if *found == name => Some(text.as_str()),
        _ => None,
    })
}
