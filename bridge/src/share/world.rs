//! Three bridges, a broker and a sender on a virtual clock, with random faults.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use fastrand::Rng;

use super::{Share, ShareEvent};
use crate::bucket::Rate;
use crate::commands::{CommandReport, Commands, Decision, Write};
use crate::metric::REQUEST;
use crate::payload::{Kind, Metric, Payload, Value};
use crate::report::{Command, Outcome};
use crate::store::Batch;

pub(super) const STEP: Duration = Duration::from_millis(50);
pub(super) const NAMES: [&str; 3] = ["bridge-1", "bridge-2", "bridge-3"];
pub(super) const CELLS: [&str; 6] = ["handling", "painter", "cutter", "assembly", "arm", "ball"];
/// The longest time for which a thread may continue work that it has begun.
const THREAD: Duration = Duration::from_secs(2);
const MAX_AGE: Duration = Duration::from_secs(30);
/// The maximum difference of the clocks of the bridges and of the sender, in milliseconds.
const SKEW: u64 = 15_000;
const TODAY: u64 = 1_790_000_000_000;

pub(super) fn milliseconds(count: u64) -> Duration {
    Duration::from_millis(count)
}

/// A command for a cell, as it is sent once: the cell, a name, and the time.
type SentCommand = (usize, String, u64);

/// A message of a bridge with its topic; without one, a subscription.
type FromBridge = Option<(String, Vec<u8>)>;

/// A message to a bridge.
#[derive(Clone)]
enum ToBridge {
    /// The answer to the subscription.
    Subscribed,
    /// A message of a bridge, by its topic, and whether the broker has stored it.
    Said(String, Vec<u8>, bool),
    Command(SentCommand),
}

/// A bridge with its threads, its disk, and its connection to the broker.
pub(super) struct Bridge {
    pub(super) share: Share,
    commands: Commands,
    disk: BTreeMap<String, String>,
    store: String,
    /// The time by which the bridge's clock is ahead, in milliseconds.
    ahead: u64,
    /// The cells that the bridge has, and the time at which the thread of a cell that it lets go ends.
    cells: BTreeMap<usize, Option<Duration>>,
    is_connected: bool,
    /// The messages to the broker and from it, and the time at which each arrives.
    up: VecDeque<(Duration, FromBridge)>,
    down: VecDeque<(Duration, ToBridge)>,
    /// The time until which the bridge's process or its network is stopped.
    frozen: Duration,
    jam: Duration,
    pub(super) dead_until: Option<Duration>,
}

impl Bridge {
    fn new(name: &str, disk: BTreeMap<String, String>, store: String, ahead: u64) -> Self {
        let names = NAMES.map(str::to_owned);
        let (mut batch, rate) = (Batch::default(), Rate { per_second: 100.0, burst: 1000 });
        let known = |prefix: &str| {
            let known = disk.iter().filter(|(name, _)| name.starts_with(prefix));
            Ok(known.map(|(name, value)| (name.clone(), value.clone())).collect())
        };
        let commands = Commands::open(known, MAX_AGE, rate, &mut batch).unwrap().0;
        let mut bridge = Self {
            share: Share::new(name, &store, &names, MAX_AGE),
            commands,
            disk,
            store,
            ahead,
            cells: BTreeMap::new(),
            is_connected: false,
            up: VecDeque::new(),
            down: VecDeque::new(),
            frozen: Duration::ZERO,
            jam: Duration::ZERO,
            dead_until: None,
        };
        bridge.write(batch);
        bridge
    }

    fn write(&mut self, batch: Batch) {
        for (name, value) in batch.names {
            match value {
                Some(value) => drop(self.disk.insert(name, value)),
                None => drop(self.disk.remove(&name)),
            }
        }
    }

    fn later<T>(queue: &VecDeque<(Duration, T)>, at: Duration) -> Duration {
        queue.back().map_or(at, |(last, _)| at.max(*last))
    }

    /// Ends the connection; messages on their way to the broker may arrive all the same.
    pub(super) fn cut(&mut self, rng: &mut Rng) {
        self.is_connected = false;
        self.down.clear();
        let keep = rng.usize(..=self.up.len());
        self.up.truncate(keep);
        self.up.retain(|(_, what)| what.is_some());
    }

    fn has(&self, cell: usize, now: Duration) -> bool {
        self.cells.get(&cell) == Some(&None) && self.share.lease.holds_at(now)
    }

    fn over(&mut self, cell: usize, id: &str, outcome: Outcome) {
        let mut batch = Batch::default();
        self.commands.finish(CELLS[cell], id, outcome, String::new(), &mut batch);
        self.write(batch);
        self.tell(cell, id, None);
    }

    fn tell(&mut self, cell: usize, id: &str, give: Option<Command>) {
        let entry = self.commands.entry(CELLS[cell], id).unwrap().clone();
        self.share.tell(CELLS[cell], id, &entry, give.map(|command| (cell, command)));
    }

    fn not_given(&mut self, commands: Vec<(usize, Command)>) {
        commands.into_iter().for_each(|(cell, command)| self.over(cell, &command.id, Outcome::Refused));
    }

    /// Handles a command that arrives, as the hub does.
    fn command(&mut self, (cell, id, at): SentCommand, now: Duration) {
        let text = Value::String(format!(r#"{{"id":"{id}"}}"#));
        let metric = Metric::new(REQUEST, Kind::String, at, Some(text));
        let payload = Payload { timestamp: Some(at), metrics: vec![metric], seq: None };
        let (unread, mut batch) = (self.share.unread(), Batch::default());
        let write = Write {
            cell: CELLS[cell],
            is_allowed: true,
            payload: &payload,
            unfit: (self.cells.get(&cell) != Some(&None)).then_some("another bridge has the cell"),
            is_shared: true,
            unread: unread.as_deref(),
        };
        let decision = self.commands.decide(write, self.today(now), &mut batch);
        self.write(batch);
        match decision {
            Decision::Give(command, _) => self.tell(cell, &id, Some(command)),
            Decision::Refuse(..) => self.tell(cell, &id, None),
            Decision::Report(_) | Decision::Malformed(_) => {}
        }
    }

    fn today(&self, now: Duration) -> u64 {
        today(now) + self.ahead
    }
}

pub(super) fn today(now: Duration) -> u64 {
    TODAY + u64::try_from(now.as_millis()).unwrap()
}

pub(super) struct World {
    pub(super) rng: Rng,
    pub(super) now: Duration,
    pub(super) bridges: Vec<Bridge>,
    /// The messages that the broker has stored, by topic.
    pub(super) stored: BTreeMap<String, Vec<u8>>,
    /// Whether stores are lost, too.
    loses_stores: bool,
    /// The last owner of each cell, and the time until which it may have moved the device.
    moved: BTreeMap<usize, (usize, Duration)>,
    pub(super) takes: usize,
    /// The ids that were sent to each cell; `executed` has the number of times that each was executed.
    ids: Vec<(usize, String)>,
    pub(super) executed: BTreeMap<(usize, String), usize>,
}

impl World {
    pub(super) fn new(seed: u64, loses_stores: bool) -> Self {
        let mut rng = Rng::with_seed(seed);
        let bridge = |name: &&str| Bridge::new(name, BTreeMap::new(), (*name).into(), rng.u64(0..SKEW));
        Self {
            bridges: NAMES.iter().map(bridge).collect(),
            rng,
            now: milliseconds(1000),
            stored: BTreeMap::new(),
            loses_stores,
            moved: BTreeMap::new(),
            takes: 0,
            ids: Vec::new(),
            executed: BTreeMap::new(),
        }
    }

    fn moves(&mut self, bridge: usize, cell: usize, until: Duration) {
        let (last, busy) = self.moved.insert(cell, (bridge, until)).unwrap_or((bridge, Duration::ZERO));
        assert!(
            last == bridge || busy <= self.now,
            "{} and {} have {} at {:?}",
            NAMES[last],
            NAMES[bridge],
            CELLS[cell],
            self.now
        );
    }

    /// Sends a command to some bridges: a new one, or an earlier one in another message with the current time.
    pub(super) fn send(&mut self, is_new: bool) {
        let at = today(self.now) + self.rng.u64(0..SKEW);
        if is_new || self.ids.is_empty() {
            let id = match self.rng.bool() {
                true => format!("plain-{}", self.ids.len()),
                false => {
                    let (time, rest) = (format!("{at:012x}"), self.rng.u64(..) >> 16);
                    format!("{}-{}-7000-8000-{rest:012x}", &time[..8], &time[8..])
                }
            };
            self.ids.push((self.rng.usize(..CELLS.len()), id));
        }
        let (cell, id) = match is_new {
            true => self.ids.last().unwrap().clone(),
            false => self.ids[self.rng.usize(..self.ids.len())].clone(),
        };
        for bridge in &mut self.bridges {
            if bridge.is_connected && self.rng.u8(..3) > 0 {
                let arrives = Bridge::later(&bridge.down, self.now.max(bridge.jam));
                bridge.down.push_back((arrives, ToBridge::Command((cell, id.clone(), at))));
            }
        }
    }

    pub(super) fn step(&mut self, is_broker_there: bool) {
        self.now += STEP;
        let now = self.now;
        // The broker takes the messages that have arrived, in some order of the connections, and passes them at once to every
        // subscriber.
        for at in 0..self.bridges.len() {
            while let Some((arrives, what)) = self.bridges[at].up.front() {
                if *arrives > now || !is_broker_there {
                    break;
                }
                let what = what.clone();
                self.bridges[at].up.pop_front();
                match what {
                    None => self.subscribe(at),
                    Some((topic, message)) => self.say(&topic, &message),
                }
            }
        }
        for at in 0..self.bridges.len() {
            self.bridge(at, is_broker_there);
        }
    }

    /// Subscribes: stored messages come before the answer or after it.
    fn subscribe(&mut self, at: usize) {
        let stored = self.stored.iter();
        let mut down: Vec<ToBridge> =
            stored.map(|(topic, message)| ToBridge::Said(topic.clone(), message.clone(), true)).collect();
        down.insert(if self.rng.bool() { 0 } else { down.len() }, ToBridge::Subscribed);
        let bridge = &mut self.bridges[at];
        for message in down {
            let delay = self.now.max(bridge.jam) + milliseconds(self.rng.u64(0..120));
            let arrives = Bridge::later(&bridge.down, delay);
            bridge.down.push_back((arrives, message));
        }
    }

    fn say(&mut self, topic: &str, message: &[u8]) {
        if topic.contains('/') {
            match message.is_empty() {
                true => drop(self.stored.remove(topic)),
                false => drop(self.stored.insert(topic.to_owned(), message.to_owned())),
            }
        }
        for bridge in self.bridges.iter_mut().filter(|bridge| bridge.is_connected) {
            // A connection that has not subscribed yet gets the stored messages, and no earlier ones.
            if bridge.up.iter().any(|(_, what)| what.is_none()) {
                continue;
            }
            let delay = self.now.max(bridge.jam) + milliseconds(self.rng.u64(0..120));
            let arrives = Bridge::later(&bridge.down, delay);
            bridge.down.push_back((arrives, ToBridge::Said(topic.to_owned(), message.to_owned(), false)));
        }
    }

    fn bridge(&mut self, at: usize, is_broker_there: bool) {
        let now = self.now;
        // The threads of its cells continue while the hub is stopped, as long as the lease lasts. A thread that is to end
        // begins nothing.
        let cells = self.bridges[at].cells.iter().filter(|(_, ends)| ends.is_none());
        let cells: Vec<usize> = cells.map(|(cell, _)| *cell).collect();
        if self.bridges[at].share.lease.holds_at(now) {
            cells.iter().for_each(|cell| self.moves(at, *cell, now + THREAD));
        }
        let bridge = &mut self.bridges[at];
        if bridge.dead_until.take_if(|until| *until <= now).is_some() {
            let (jam, ahead) = (bridge.jam, bridge.ahead);
            let mut disk = core::mem::take(&mut bridge.disk);
            let mut store = core::mem::take(&mut bridge.store);
            if self.loses_stores && self.rng.u8(..3) == 0 {
                (disk, store) = (BTreeMap::new(), format!("{store}x"));
            }
            *bridge = Bridge { jam, ..Bridge::new(NAMES[at], disk, store, ahead) };
        }
        if bridge.dead_until.is_some() || bridge.frozen > now {
            return;
        }
        if !bridge.is_connected && is_broker_there && bridge.jam <= now && self.rng.u8(..20) == 0 {
            bridge.is_connected = true;
            bridge.down.clear();
            bridge.share.opened();
            let arrives = Bridge::later(&bridge.up, now + milliseconds(30));
            bridge.up.push_back((arrives, None));
        }
        let mut give = Vec::new();
        while bridge.down.front().is_some_and(|(arrives, _)| *arrives <= now) {
            match bridge.down.pop_front().unwrap().1 {
                ToBridge::Subscribed => {
                    let lost = bridge.share.connected(now, bridge.today(now));
                    bridge.not_given(lost);
                }
                ToBridge::Command(sent) => bridge.command(sent, now),
                ToBridge::Said(topic, message, is_stored) => {
                    match bridge.share.receive(&topic, &message, is_stored, now) {
                        Some(ShareEvent::Back { give: known, lost }) => {
                            give.extend(known);
                            bridge.not_given(lost);
                        }
                        Some(ShareEvent::Commands(commands)) => {
                            let mut batch = Batch::default();
                            for CommandReport { cell, id, entry } in commands {
                                bridge.commands.merge_report(
                                    &cell,
                                    &id,
                                    entry,
                                    bridge.today(now),
                                    &mut batch,
                                );
                            }
                            bridge.write(batch);
                        }
                        Some(ShareEvent::Malformed(why)) => panic!("{why}"),
                        None => {}
                    }
                }
            }
        }
        // As the hub does.
        let lost = bridge.share.lapsed(now);
        let lapsed = lost.is_some();
        bridge.not_given(lost.unwrap_or_default());
        let mut takes = Vec::new();
        for (cell, name) in CELLS.iter().enumerate() {
            match bridge.cells.get_mut(&cell) {
                Some(ends) => {
                    let must_give = bridge.share.must_give(name, now);
                    if (lapsed || must_give) && ends.is_none() {
                        *ends = Some(now + milliseconds(self.rng.u64(0..2000)));
                    }
                }
                None => takes.extend(bridge.share.may_take(name, now).map(|until| (cell, until))),
            }
        }
        for (cell, command) in give {
            let bridge = &mut self.bridges[at];
            if !bridge.has(cell, now) {
                bridge.over(cell, &command.id, Outcome::Refused);
                continue;
            }
            *self.executed.entry((cell, command.id.clone())).or_default() += 1;
            // Some have no outcome before the next fault.
            if self.rng.u8(..4) > 0 {
                bridge.over(cell, &command.id, Outcome::Done);
            }
        }
        // A thread that has ended does nothing more.
        let bridge = &mut self.bridges[at];
        bridge.cells.retain(|cell, ends| {
            let is_over = ends.is_some_and(|ends| ends <= now);
            if let Some((last, busy)) = self.moved.get_mut(cell).filter(|_| is_over)
                && *last == at
            {
                *busy = now;
            }
            !is_over
        });
        for (cell, until) in &takes {
            let mut batch = Batch::default();
            bridge.commands.take(CELLS[*cell], *until, &mut batch);
            bridge.write(batch);
            bridge.cells.insert(*cell, None);
        }
        let offered = CELLS.iter().enumerate();
        let offered =
            offered.map(|(cell, name)| ((*name).to_owned(), bridge.cells.contains_key(&cell))).collect();
        let (up, jam, is_connected) = (&mut bridge.up, bridge.jam, bridge.is_connected);
        let delay = self.rng.u64(0..120);
        bridge.share.say(now, offered, &bridge.commands, |below, message| {
            let arrives = Bridge::later(up, now.max(jam) + milliseconds(delay));
            is_connected && {
                up.push_back((arrives, Some((format!("{}{below}", NAMES[at]), message))));
                true
            }
        });
        self.takes += takes.len();
        for (cell, _) in takes {
            self.moves(at, cell, now + THREAD);
        }
    }

    /// Ends the process, and its threads with it.
    pub(super) fn kill(&mut self, at: usize, until: Duration) {
        let bridge = &mut self.bridges[at];
        bridge.cut(&mut self.rng);
        bridge.dead_until = Some(until);
        for cell in core::mem::take(&mut bridge.cells).into_keys() {
            if let Some((last, busy)) = self.moved.get_mut(&cell)
                && *last == at
            {
                *busy = self.now;
            }
        }
    }

    pub(super) fn fault(&mut self) {
        let at = self.rng.usize(..self.bridges.len());
        let time = self.now + milliseconds(self.rng.u64(0..25_000));
        let bridge = &mut self.bridges[at];
        match self.rng.u8(..4) {
            0 => bridge.cut(&mut self.rng),
            // Nothing arrives, and then everything does.
            1 => {
                bridge.jam = time;
                for (arrives, _) in &mut bridge.up {
                    *arrives = (*arrives).max(time);
                }
                for (arrives, _) in &mut bridge.down {
                    *arrives = (*arrives).max(time);
                }
            }
            2 => bridge.frozen = time,
            _ => self.kill(at, time),
        }
    }

    pub(super) fn owners(&self, cell: usize) -> Vec<&str> {
        let has = |bridge: &&Bridge| bridge.cells.get(&cell) == Some(&None);
        let of =
            |bridge: &Bridge| NAMES[self.bridges.iter().position(|it| core::ptr::eq(it, bridge)).unwrap()];
        self.bridges.iter().filter(has).map(of).collect()
    }

    /// Returns the number of ids that were sent and not executed.
    pub(super) fn unexecuted(&self) -> usize {
        self.ids.len() - self.executed.len()
    }
}
