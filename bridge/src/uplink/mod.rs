//! The connection to the broker: births, deaths, and the records of the store in their order.

mod event;
mod publish;

use std::collections::HashMap;
use std::sync::mpsc::SyncSender;
use std::time::{Duration, Instant};

use anyhow::Result;

use super::cell::Cell;
use super::compact::NameNumbers;
use super::holds::{Holds, RefusedRecord};
use super::metric::{self, whole};
use super::node::{Node, NodeMessage, Publication};
use super::payload::Value;
use super::reconnect::Reconnect;
use super::refusals::{DroppedRecord, Refusals};
use super::report::Input;
use super::site::{Broker, BrokerAddress};
use crate::broker::{BrokerEvent, Options, Refusal, Session};
use crate::store::{Batch, Store};
pub use event::Event;

/// The time after which an attempt without a result is given up.
const ATTEMPT_TIMEOUT: Duration = Duration::from_secs(15);
/// The maximum time by which the state of a host application may be dated ahead: no two clocks agree. A state that is dated
/// further ahead would hide later ones with the right time.
const MAX_CLOCK_LEAD: Duration = Duration::from_secs(300);

/// The name, in the store, of the number of the next connection.
pub const BD_SEQ: &str = "bdseq";

/// The indices of the cells, by their names.
pub type CellIndices = HashMap<String, usize>;

/// The connection.
#[allow(missing_debug_implementations, reason = "it holds a session with the broker")]
pub struct Uplink {
    options: Options,
    /// The addresses of the brokers, and the index of the broker that is tried, or connected.
    brokers: Vec<BrokerAddress>,
    broker: usize,
    /// The prefix of the topics on which records are published as JSON, too.
    json: Option<String>,
    /// The topic on which bridges that share cells announce themselves, before the name of each.
    share: Option<String>,
    aliases: bool,
    group: String,
    name: String,
    host: Option<String>,
    acknowledged: bool,
    hub: SyncSender<Input>,
    node: Node,
    /// The number of the next connection in its births and deaths.
    bd_seq: u8,
    /// The number of the connection: later reports of an earlier one are ignored.
    generation: u64,
    phase: Phase,
    reconnect: Reconnect,
    /// When the host application has been online last.
    host_at: u64,
    is_born: bool,
    /// The first record that was not published on this connection.
    next: u64,
    /// Records from this one on were made on this connection, and are not historical.
    live: u64,
    flight: HashMap<u64, InFlight>,
    refusals: Refusals,
    /// The cells whose topics the broker refuses.
    holds: Holds,
    /// Records that the broker refuses for good.
    apart: Vec<DroppedRecord>,
    /// The longest packet that the broker takes.
    longest: usize,
    /// Records of cells that do not exist any more.
    orphans: Vec<u64>,
    /// The counters of the uplink.
    pub counts: Counts,
}

/// The counters of an uplink.
#[derive(Debug, Clone, Copy, Default)]
pub struct Counts {
    /// Accepted connections to the broker.
    pub connections: u64,
    /// Records that were published, again or for the first time.
    pub published: u64,
    /// Records that the broker has acknowledged.
    pub acknowledged: u64,
    /// Refusals of records by the broker.
    pub rejected: u64,
    /// Records that the broker refuses for good: they are dropped.
    pub refused: u64,
    /// States of the host application that are dated too far ahead.
    pub ahead: u64,
}

/// A record on its way.
struct InFlight {
    /// The cell.
    place: usize,
    /// The bytes of its packet.
    length: usize,
}

enum Phase {
    /// Waits until the next attempt.
    Offline { until: Instant },
    /// Waits until the store has the number of the connection.
    Ready,
    /// Waits until the broker has accepted connection and subscriptions.
    Opening { session: Session, until: Instant },
    /// Waits until the host application is online; with several brokers not for long, since it may be at another broker.
    Waiting { session: Session, until: Option<Instant> },
    /// Publishes records.
    Online { session: Session },
    /// Waits, after a death was published, until the broker closes the connection.
    Leaving { _session: Session, until: Instant },
}

impl Uplink {
    /// Returns a connection that is opened at the first turn.
    ///
    /// # Errors
    /// If a file of the broker's settings cannot be read.
    pub fn new(broker: &Broker, shares: bool, bd_seq: u8, hub: SyncSender<Input>) -> Result<Self> {
        let brokers = broker.places()?;
        let BrokerAddress { host, port, url } = brokers.first().cloned().unwrap_or_default();
        let client = broker.client.clone().unwrap_or_else(|| format!("{}-{}", broker.group, broker.node));
        let (login, tls, will) = (broker.login()?, broker.tls()?, (String::new(), Vec::new()));
        let (version, keep_alive) = (broker.mqtt, broker.keep_alive);
        let options = Options { host, port, url, client, login, tls, version, keep_alive, will };
        Ok(Self {
            options,
            brokers,
            broker: 0,
            json: broker.json.clone(),
            share: shares.then(|| format!("cellwire/{}/", broker.group)),
            aliases: broker.aliases,
            group: broker.group.clone(),
            name: broker.node.clone(),
            host: broker.primary_host.clone(),
            acknowledged: broker.qos == 1,
            hub,
            node: Node::new(&broker.group, &broker.node, bd_seq),
            bd_seq,
            generation: 0,
            phase: Phase::Offline { until: Instant::now() },
            reconnect: Reconnect::default(),
            host_at: 0,
            is_born: false,
            next: 0,
            live: 0,
            flight: HashMap::new(),
            refusals: Refusals::default(),
            holds: Holds::default(),
            apart: Vec::new(),
            longest: usize::MAX,
            orphans: Vec::new(),
            counts: Counts::default(),
        })
    }

    /// Returns whether records are published.
    pub fn is_online(&self) -> bool {
        matches!(self.phase, Phase::Online { .. })
    }

    /// Returns the address of the connected broker, or of the one being tried.
    pub fn address(&self) -> String {
        format!("{}:{}", self.options.host, self.options.port)
    }

    /// Returns the host application that the uplink waits for.
    pub fn waits_for(&self) -> Option<&str> {
        self.host.as_deref().filter(|_| matches!(self.phase, Phase::Waiting { .. }))
    }

    /// Returns whether there is no connection.
    pub fn is_offline(&self) -> bool {
        matches!(self.phase, Phase::Offline { .. } | Phase::Ready)
    }

    /// Returns the number of records that are on their way.
    pub fn in_flight(&self) -> usize {
        self.flight.len()
    }

    /// Returns the number of the cell's records that wait because the broker refuses its topic.
    pub fn held(&self, place: usize) -> usize {
        self.holds.count(place)
    }

    /// Called when the store has no more records below this key.
    pub fn made_room(&mut self, first: u64) {
        self.holds.made_room(first);
    }

    /// Returns the latest time at which [`turn`](Self::turn) has something to do.
    pub fn due(&self) -> Option<Instant> {
        match self.phase {
            Phase::Offline { until } | Phase::Opening { until, .. } | Phase::Leaving { until, .. } => {
                Some(until)
            }
            Phase::Waiting { until, .. } => until,
            Phase::Ready | Phase::Online { .. } => None,
        }
    }

    /// Handles an event of the connection with this number; returns its meaning for the hub. Adds the removal of finished
    /// records to the batch.
    pub fn on_broker_event(&mut self, generation: u64, happened: BrokerEvent, batch: &mut Batch) -> Event {
        if generation != self.generation {
            return Event::None;
        }
        match happened {
            BrokerEvent::Connected(longest) => {
                self.counts.connections += 1;
                self.longest = longest.map_or(usize::MAX, |longest| longest as usize);
                self.reconnect.accepted(Instant::now());
                let state = self.host.iter().map(|host| Node::state_of(host));
                let share =
                    self.share.iter().flat_map(|share| [format!("{share}+"), format!("{share}+/+/+")]);
                let more: Vec<String> = state.chain(share).collect();
                if let Phase::Opening { session, .. } = &self.phase {
                    session.subscribe(&self.node.subscriptions(), &more);
                }
                Event::Opened
            }
            BrokerEvent::Subscribed => {
                let until = (self.brokers.len() > 1).then(|| Instant::now() + ATTEMPT_TIMEOUT);
                self.advance(|session| Phase::Waiting { session, until });
                if self.host.is_none() {
                    self.go_online();
                }
                Event::Connected
            }
            BrokerEvent::Message { topic, payload, is_retained } => {
                if let Some(from) = self.share.as_ref().and_then(|share| topic.strip_prefix(share)) {
                    return Event::Share { from: from.to_owned(), is_retained, payload };
                }
                self.received(self.node.receive(&topic, &payload, is_retained))
            }
            BrokerEvent::Skipped { topic, length } => Event::Malformed(format!(
                "{topic}: dropped a message of {length} bytes: delete it at the broker"
            )),
            BrokerEvent::Published(key) => self.published(key, batch),
            BrokerEvent::Rejected { token: key, why, refusal } => self.rejected(key, why, refusal),
            BrokerEvent::NotTaken(why) => {
                Event::Malformed(format!("the broker refuses a message that is not a record: {why}"))
            }
            BrokerEvent::TooLong => {
                // If any is too long the longest is.
                if let Some(key) =
                    self.flight.iter().max_by_key(|(_, flying)| flying.length).map(|(key, _)| *key)
                {
                    self.counts.rejected += 1;
                    self.set_apart(key, "PacketTooLarge".into());
                }
                Event::None
            }
            BrokerEvent::TakenOver => self.leave_name(),
            BrokerEvent::Closed(why) => {
                let was_left = matches!(self.phase, Phase::Leaving { .. });
                self.closed();
                if was_left { Event::None } else { Event::Lost(why) }
            }
        }
    }

    /// Called when the broker has acknowledged a message. If that ends a hold, the held messages are next.
    fn published(&mut self, key: u64, batch: &mut Batch) -> Event {
        let Some(InFlight { place, .. }) = self.flight.remove(&key) else { return Event::None };
        self.counts.acknowledged += 1;
        self.refusals.forget(key);
        batch.remove.push(key);
        let Some(held) = self.holds.take(place, key) else { return Event::None };
        self.live = self.live.max(self.next);
        self.next = held.first().map_or(self.next, |first| self.next.min(*first));
        Event::Released(place)
    }

    /// Called when the broker has rejected a message. After a gap in the message numbers the births are repeated, which
    /// restart the numbers at 0.
    fn rejected(&mut self, key: u64, why: String, refusal: Refusal) -> Event {
        self.counts.rejected += 1;
        match refusal {
            Refusal::Topic => {
                let Some(InFlight { place, .. }) = self.flight.remove(&key) else { return Event::None };
                self.refusals.forget(key);
                let refused = self.holds.refuse(place, key, Instant::now());
                self.is_born &= refused == RefusedRecord::Another;
                if refused == RefusedRecord::Begins { Event::Held { place, why } } else { Event::None }
            }
            Refusal::Passing if !self.refusals.is_for_good(key, Instant::now()) => {
                self.disconnect();
                Event::Lost(format!("the broker refuses a record for now: {why}"))
            }
            Refusal::Message | Refusal::Passing => {
                self.set_apart(key, why);
                Event::None
            }
        }
    }

    /// Notes a record that was refused for good: the next turn drops it.
    fn set_apart(&mut self, key: u64, why: String) {
        if let Some(InFlight { place, .. }) = self.flight.remove(&key) {
            self.refusals.forget(key);
            self.holds.forget(place, key);
            self.apart.push(DroppedRecord { key, place, why });
        }
    }

    /// Leaves the name to another client that has it: two clients that fight for a name would deliver nothing.
    fn leave_name(&mut self) -> Event {
        let wait = self.reconnect.leave_name(Instant::now()).as_secs();
        self.disconnect();
        Event::Lost(format!(
            "another client has this name: give each bridge a different node and client; retrying in about {wait} s"
        ))
    }

    fn received(&mut self, received: NodeMessage) -> Event {
        match received {
            NodeMessage::Rebirth => {
                self.bear_again();
                Event::Rebirth
            }
            NodeMessage::Write { device, payload, unfit } => Event::Write { device, payload, unfit },
            NodeMessage::State { host, online, timestamp } => {
                if self.host.as_deref() != Some(host.as_str()) || timestamp < self.host_at {
                    return Event::Malformed(format!(
                        "ignored a STATE of {host} that is older than the last"
                    ));
                }
                let ahead = timestamp.saturating_sub(metric::now());
                if u128::from(ahead) > MAX_CLOCK_LEAD.as_millis() {
                    self.counts.ahead += 1;
                    let most = MAX_CLOCK_LEAD.as_secs();
                    return Event::Malformed(format!(
                        "ignored a STATE of {host}, dated more than {most} s ahead: set the clock of the host application or of this machine"
                    ));
                }
                self.host_at = timestamp;
                match (online, &self.phase) {
                    (true, Phase::Waiting { .. }) => self.go_online(),
                    (false, Phase::Online { .. }) => {
                        self.disconnect();
                        return Event::Lost(format!("the host application {host} is offline"));
                    }
                    _ => {}
                }
                Event::None
            }
            NodeMessage::Malformed(why) => Event::Malformed(why),
            NodeMessage::Nothing => Event::None,
        }
    }

    /// Births follow, then every record from the oldest on.
    fn go_online(&mut self) {
        self.advance(|session| Phase::Online { session });
        (self.is_born, self.next, self.live) = (false, 0, u64::MAX);
        self.flight.clear();
        self.holds.connected(Instant::now());
    }

    fn advance(&mut self, next: impl FnOnce(Session) -> Phase) {
        let offline = Phase::Offline { until: Instant::now() };
        self.phase = match core::mem::replace(&mut self.phase, offline) {
            Phase::Opening { session, .. } | Phase::Waiting { session, .. } | Phase::Online { session } => {
                next(session)
            }
            other => other,
        };
    }

    /// Publishes a message to the bridges that share cells; the broker stores it if it has a topic below that of this
    /// bridge. Returns false if it cannot, now.
    pub fn say(&self, below: &str, message: Vec<u8>) -> bool {
        let (Phase::Waiting { session, .. } | Phase::Online { session }, Some(share)) =
            (&self.phase, &self.share)
        else {
            return false;
        };
        let topic = format!("{share}{}{below}", self.name);
        match below.is_empty() {
            true => session.publish(&topic, message, true, None),
            false => session.store(&topic, message),
        }
    }

    /// Repeats all births.
    pub fn bear_again(&mut self) {
        self.is_born = false;
    }

    /// Says the node's death, and ends the connection.
    pub fn disconnect(&mut self) {
        if let Phase::Online { session } = &self.phase {
            let Publication { topic, payload } = self.node.death();
            session.publish(&topic, payload, true, None);
        }
        let until = Instant::now() + Duration::from_secs(1);
        self.advance(|session| {
            session.close();
            Phase::Leaving { _session: session, until }
        });
    }

    fn closed(&mut self) {
        self.generation += 1;
        self.broker = (self.broker + 1) % self.brokers.len().max(1);
        let now = Instant::now();
        let wait = self.reconnect.next(now);
        self.phase = Phase::Offline { until: now + wait };
    }

    /// Adds to `batch` the changes that must be written before [`turn`](Self::turn): the number of a connection that is due,
    /// and the removal of dropped records. Returns how many are of cells that do not exist any more, and those that the broker
    /// refuses.
    pub fn prepare(&mut self, ends: bool, batch: &mut Batch) -> (u64, Vec<DroppedRecord>) {
        if let Phase::Offline { until } = self.phase
            && until <= Instant::now()
            && !ends
        {
            self.node = Node::new(&self.group, &self.name, self.bd_seq);
            self.bd_seq = self.bd_seq.wrapping_add(1);
            batch.names.push((BD_SEQ.into(), Some(self.bd_seq.to_string())));
            self.phase = Phase::Ready;
        }
        let orphans = self.orphans.len() as u64;
        batch.remove.append(&mut self.orphans);
        let apart = core::mem::take(&mut self.apart);
        batch.remove.extend(apart.iter().map(|apart| apart.key));
        self.counts.refused += apart.len() as u64;
        (orphans, apart)
    }

    /// Does the work that is due: connects, and publishes the available records. Returns the reason of a failed connection.
    ///
    /// # Errors
    /// If the store cannot be read.
    pub fn turn(
        &mut self,
        (store, words): (&mut Store, &NameNumbers),
        cells: &mut [Cell],
        places: &CellIndices,
    ) -> Result<Option<String>> {
        let is_due = self.due().is_some_and(|due| due <= Instant::now());
        match &self.phase {
            Phase::Ready => {
                if let Err(error) = self.open() {
                    self.closed();
                    return Ok(Some(format!("{error:#}")));
                }
            }
            Phase::Opening { .. } if is_due => {
                self.closed();
                return Ok(Some("the broker does not answer".into()));
            }
            Phase::Waiting { .. } if is_due => {
                self.disconnect();
                let host = self.host.as_deref().unwrap_or_default();
                return Ok(Some(format!("the host application {host} is not online at {}", self.address())));
            }
            Phase::Leaving { .. } if is_due => self.closed(),
            Phase::Online { .. } => self.publish((store, words), cells, places)?,
            _ => {}
        }
        Ok(None)
    }

    fn open(&mut self) -> Result<()> {
        if let Some(BrokerAddress { host, port, url }) = self.brokers.get(self.broker) {
            let is_another = (&self.options.host, self.options.port) != (host, *port);
            (self.options.host, self.options.port, self.options.url) = (host.clone(), *port, url.clone());
            // The time of a state at another broker does not count here.
            self.host_at = if is_another { 0 } else { self.host_at };
        }
        let Publication { topic, payload } = self.node.death();
        self.options.will = (topic, payload);
        let (hub, generation) = (self.hub.clone(), self.generation);
        let session = Session::open(&self.options, move |happened| {
            let _ = hub.send(Input::Broker(generation, happened));
        })?;
        self.phase = Phase::Opening { session, until: Instant::now() + ATTEMPT_TIMEOUT };
        Ok(())
    }
}

/// Returns the number of a record, as a value.
pub fn number(number: u64) -> Value {
    whole(i64::try_from(number).unwrap_or(i64::MAX))
}
