//! Bridges that share cells: they agree over the broker alone which of them has which cell. docs/bridge-shared.md explains why it
//! holds.
//!
//! Each bridge announces every 1.5 s, on a topic of its own, the cells that it offers and has, and the other bridges that it
//! knows. The broker returns the message to the bridge: this shows that the broker has it, and that every connected client
//! gets it before any message that the broker accepts later. The bridge's cells are its own for [`LEASE`] from the time at
//! which it sent the message. A bridge that was silent for 16 s has no cells any more.
//!
//! A command is on a page of its bridge's ledger, which the broker stores, before the cell has it. A bridge gives a command
//! whose id has no time only after it has read the ledgers of the others.

mod message;
#[cfg(test)]
mod model;
mod reading;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod world;

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use super::commands::{CommandReport, Commands};
use super::history::Entry;
use super::lease::Lease;
use super::ledger::page_of;
use super::report::Command;
use message::{BridgeState, Message, Page, ShareBody};
use reading::Reading;

/// The interval at which a bridge announces itself.
const EVERY: Duration = Duration::from_millis(1500);
/// The time for which a bridge's cells are its own, from the time of a message that came back to it.
pub const LEASE: Duration = Duration::from_secs(6);
/// A thread lets its device go within this time, and clocks go as fast as one another to within the rest.
const MARGIN: Duration = Duration::from_secs(4);
/// A bridge that was silent for this long has no cells. The time covers its lease and that of the observing bridge: the last
/// message that came back to the observer was sent at most one lease ago, and messages that the broker has had since then
/// may not have arrived yet.
const SILENT: Duration = Duration::from_secs(2 * LEASE.as_secs() + MARGIN.as_secs());
/// The shortest interval at which the whole ledger is published again for a bridge that lacks it.
const REPUBLISH_INTERVAL: Duration = Duration::from_secs(5);
/// The last level of the topic of a ledger's last page.
const LAST_PAGE: &str = "last";

/// A bridge's view of the bridges that it shares cells with.
#[derive(Debug)]
pub struct Share {
    node: String,
    store: String,
    lease: Arc<Lease>,
    peers: BTreeMap<String, Peer>,
    /// A word that changes each time that the bridge loses its lease or offers other cells: a bridge that knows the word has
    /// received the messages with it.
    term: String,
    held: bool,
    /// The number of the next message.
    number: u64,
    /// The time by which a command may be dated ahead, in milliseconds.
    ahead: u64,
    /// The messages that have not come back, and the times at which they were sent.
    sent: VecDeque<(u64, Duration)>,
    /// The time since which all messages are received, and the time of day then.
    since: Option<(Duration, u64)>,
    /// The last announcement of this bridge, and its time on this connection.
    said: Option<BridgeState>,
    said_at: Option<Duration>,
    /// Outcomes of commands that are not in the ledger.
    news: VecDeque<CommandReport>,
    /// Pages of the ledger to publish, and the first and the last page when it was published; without them, all of it is to be.
    pages: BTreeSet<u64>,
    bounds: Option<(u64, u64)>,
    all_at: Option<Duration>,
    /// Commands whose page is to be published.
    unsaid: Vec<(u64, usize, Command)>,
    /// Commands that are given when the message of this number has come back.
    waiting: VecDeque<(u64, usize, Command)>,
    /// The time at which the last message came back.
    back_at: Option<Duration>,
    reading: Reading,
    ends: bool,
}

/// Another bridge, by its messages on this connection.
#[derive(Debug, Default)]
struct Peer {
    heard: Option<Duration>,
    term: String,
    alive: BridgeState,
    /// The number of the peer's latest command when the first message came: later ones are received one by one.
    until: u64,
}

/// The result of a received message.
#[derive(Debug, PartialEq)]
pub enum ShareEvent {
    /// A message has come back.
    Back {
        /// The commands on the page: every connected bridge has them, and they are to be given.
        give: Vec<(usize, Command)>,
        /// The commands on earlier pages that did not come back: they are not to be given.
        lost: Vec<(usize, Command)>,
    },
    /// The outcomes of commands that other bridges have accepted or refused.
    Commands(Vec<CommandReport>),
    /// The message is not understood; the reason.
    Malformed(String),
}

impl Share {
    /// Makes a bridge that has no cell yet.
    pub fn new(node: &str, store: &str, bridges: &[String], max_age: Duration) -> Self {
        let others = bridges.iter().filter(|name| *name != node);
        Self {
            ahead: u64::try_from(max_age.as_millis()).unwrap_or(u64::MAX),
            node: node.into(),
            store: store.into(),
            lease: Arc::default(),
            peers: others.map(|name| (name.clone(), Peer::default())).collect(),
            term: term(),
            held: false,
            // A number that an earlier process has not used.
            number: fastrand::u64(..1 << 50),
            sent: VecDeque::new(),
            since: None,
            said: None,
            said_at: None,
            news: VecDeque::new(),
            pages: BTreeSet::new(),
            bounds: None,
            all_at: None,
            unsaid: Vec::new(),
            waiting: VecDeque::new(),
            back_at: None,
            reading: Reading::default(),
            ends: false,
        }
    }

    /// Returns the lease, which the threads of the cells check.
    pub fn lease(&self) -> Arc<Lease> {
        Arc::clone(&self.lease)
    }

    /// Called when there is another connection. Pages that the broker has stored may come before [`connected`](Self::connected).
    pub fn opened(&mut self) {
        let was_dead = |peer: &Peer| self.back_at.is_some_and(|at| self.lives(peer, at) == Some(false));
        let dead: BTreeSet<String> =
            self.peers.iter().filter(|(_, peer)| was_dead(peer)).map(|(name, _)| name.clone()).collect();
        self.reading.opened(|node| dead.contains(node));
    }

    /// Called when all messages are received from now on; `today` is in milliseconds since 1970 UTC. Returns the commands of
    /// which it is not known whether another bridge has received them: they must not be given.
    pub fn connected(&mut self, now: Duration, today: u64) -> Vec<(usize, Command)> {
        // A bridge that was dead when the last message came back, and runs again, takes nothing for as long from then on.
        if self.back_at.is_none_or(|at| now.saturating_sub(at) >= SILENT) {
            self.reading.forget(|_| true);
        }
        self.peers.values_mut().for_each(|peer| *peer = Peer::default());
        self.sent.clear();
        (self.since, self.said_at, self.bounds) = (Some((now, today)), None, None);
        self.waiting.drain(..).map(|(_, place, command)| (place, command)).collect()
    }

    /// Returns the commands that are not to be given, if the lease was lost since the last call.
    pub fn lapsed(&mut self, now: Duration) -> Option<Vec<(usize, Command)>> {
        if !self.held || self.lease.holds_at(now) {
            return None;
        }
        (self.held, self.term) = (false, term());
        self.sent.clear();
        let lost = self.unsaid.drain(..).chain(self.waiting.drain(..));
        Some(lost.map(|(_, place, command)| (place, command)).collect())
    }

    /// Called when the bridge has released every cell, and takes no more cells.
    pub fn end(&mut self) {
        self.ends = true;
    }

    /// Returns whether [`end`](Self::end) was called.
    pub fn has_ended(&self) -> bool {
        self.ends
    }

    /// Handles a message of this bridge, or of another: `from` is the topic after `cellwire/GROUP/`. The broker has stored it, if
    /// it is retained.
    pub fn receive(
        &mut self,
        from: &str,
        payload: &[u8],
        is_retained: bool,
        now: Duration,
    ) -> Option<ShareEvent> {
        let (from, page_of) = from.split_once('/').map_or((from, None), |(node, page)| (node, Some(page)));
        let store = page_of.and_then(|page| page.split('/').next());
        let is_own = from == self.node && store.is_none_or(|store| store == self.store);
        // A page was removed, or the broker returns a message of this bridge on an earlier connection.
        if payload.is_empty() || is_retained && (is_own || store.is_none()) {
            return None;
        }
        let message: Message = match serde_json::from_slice(payload) {
            Ok(message) => message,
            Err(error) => {
                return Some(ShareEvent::Malformed(format!("message of {from} about shared cells: {error}")));
            }
        };
        if is_own {
            return self.came_back(message.number, now);
        }
        let peer = self.peers.get_mut(from);
        if peer.is_none() && from != self.node {
            return Some(ShareEvent::Malformed(format!(
                "{from} shares cells of this group but is not in share.bridges: list every bridge in every site file"
            )));
        }
        match message.what {
            ShareBody::Page(page) => {
                self.reading.read(from, store.unwrap_or_default(), &page);
                Some(ShareEvent::Commands(page.commands.into_iter().map(|told| by(from, told)).collect()))
            }
            ShareBody::Command(told) => Some(ShareEvent::Commands(vec![by(from, told)])),
            ShareBody::Alive(alive) => {
                let peer = peer?;
                if peer.heard.replace(now).is_none() {
                    peer.until = alive.until;
                    self.reading.forget(|node| node == from);
                }
                if alive.lacks.contains(&self.node)
                    && self.all_at.is_none_or(|at| now.saturating_sub(at) >= REPUBLISH_INTERVAL)
                {
                    self.bounds = None;
                }
                (peer.term, peer.alive) = (message.term, alive);
                None
            }
        }
    }

    fn came_back(&mut self, number: u64, now: Duration) -> Option<ShareEvent> {
        if self.held && !self.lease.holds_at(now) {
            return None; // too late: it has lapsed
        }
        let place = self.sent.iter().position(|(sent, _)| *sent == number)?;
        let (_, at) = self.sent.drain(..=place).next_back()?;
        self.lease.renew(at + LEASE);
        self.back_at = Some(now);
        // A message that was sent too long ago does not give a lease.
        self.held |= self.lease.holds_at(now);
        let known = self.waiting.iter().take_while(|(waits, ..)| *waits <= number).count();
        let (mut give, mut lost) = (Vec::new(), Vec::new());
        for (waits, place, command) in self.waiting.drain(..known) {
            if waits == number { &mut give } else { &mut lost }.push((place, command));
        }
        (!give.is_empty() || !lost.is_empty()).then_some(ShareEvent::Back { give, lost })
    }

    /// Returns whether every id that another bridge has executed is known here.
    fn is_read(&self, name: &str, peer: &Peer) -> bool {
        self.reading.is_read(name, peer.heard.map(|_| &*peer.alive.store))
    }

    /// Returns the reason to refuse ids without a time, if there is one.
    pub fn unread(&self) -> Option<String> {
        let mut unread = self.peers.iter().filter(|(name, peer)| !self.is_read(name, peer));
        let (name, advice) = match unread.next() {
            Some((name, _)) => (name, "start that bridge, or use UUIDs of version 7 as ids"),
            None if self.reading.has_gap(&self.node) => {
                (&self.node, "use UUIDs of version 7 as ids, or send the command again with another id")
            }
            None => return None,
        };
        Some(format!("the ids that {name} has executed are not all known: {advice}"))
    }

    /// Returns whether a bridge lives; `None` as long as that is not known.
    fn lives(&self, peer: &Peer, now: Duration) -> Option<bool> {
        let (since, _) = self.since?;
        let is_silent = now.saturating_sub(peer.heard.unwrap_or(since)) >= SILENT;
        match peer.heard {
            Some(_) => Some(!is_silent && !peer.alive.ends),
            None => is_silent.then_some(false),
        }
    }

    /// Returns the time until which other bridges may have given commands that this one has not received, in milliseconds
    /// since 1970 UTC; `None` if this bridge may not take the cell. The bridge does not have the cell yet.
    pub fn may_take(&self, cell: &str, now: Duration) -> Option<u64> {
        let (_, today) = self.since.filter(|_| !self.ends && self.held && self.lease.holds_at(now))?;
        let mut until = 0;
        for (name, peer) in &self.peers {
            if self.lives(peer, now)? {
                // The other bridge knows that this bridge lives, and so does not take cells that are this one's by rank.
                let knows_this = peer.alive.knows.get(&self.node) == Some(&self.term);
                let comes_after =
                    peer.alive.cells.get(cell).is_none_or(|has| !has && self.is_before(name, cell));
                if !knows_this || !comes_after || !self.is_read(name, peer) {
                    return None;
                }
            }
            // A command of another bridge is dated so far ahead of its clock, and its clock may be so far ahead of this one.
            let unheard = today.saturating_add(2 * self.ahead);
            until = until.max(match peer.heard {
                Some(_) => peer.until,
                None if self.is_read(name, peer) => self.reading.until(name),
                None => unheard,
            });
        }
        Some(until.max(self.reading.until(&self.node)))
    }

    /// Returns whether a cell that this bridge has is by rank that of another bridge, which lives.
    pub fn must_give(&self, cell: &str, now: Duration) -> bool {
        self.peers.iter().any(|(name, peer)| {
            self.lives(peer, now) == Some(true)
                && peer.alive.cells.contains_key(cell)
                && !self.is_before(name, cell)
        })
    }

    /// Returns whether this bridge comes before another for a cell: any two agree, and the cells of each are spread over the
    /// others.
    fn is_before(&self, other: &str, cell: &str) -> bool {
        (rank(&self.node, cell), &*self.node) > (rank(other, cell), other)
    }

    /// Returns the bridge that has a cell, as far as is known.
    pub fn owner(&self, cell: &str, now: Duration) -> Option<&str> {
        let has =
            |peer: &Peer| self.lives(peer, now) == Some(true) && peer.alive.cells.get(cell) == Some(&true);
        self.peers.iter().find(|(_, peer)| has(peer)).map(|(name, _)| &**name)
    }

    /// Queues the outcome of a command for the other bridges. With a place, the command is given to the cell there when they know
    /// of it.
    pub fn tell(&mut self, cell: &str, id: &str, entry: &Entry, give: Option<(usize, Command)>) {
        if entry.is_in_ledger() {
            let page = page_of(entry.number);
            self.pages.insert(page);
            self.unsaid.extend(give.map(|(place, command)| (page, place, command)));
        } else {
            self.news.push_back(CommandReport { cell: cell.into(), id: id.into(), entry: entry.clone() });
        }
    }

    /// Publishes due messages, by the topic after that of this bridge: outcomes of commands, pages of the ledger, and then, when
    /// it is due, the announcement of the cells that are offered, whether this bridge has them, and the time of the latest
    /// command that it knows.
    pub fn say(
        &mut self,
        now: Duration,
        cells: BTreeMap<String, bool>,
        commands: &Commands,
        mut publish: impl FnMut(&str, Vec<u8>) -> bool,
    ) {
        if self.since.is_none() {
            return;
        }
        while let Some(told) = self.news.pop_front() {
            if !self.publish(now, "", ShareBody::Command(told.clone()), &mut publish) {
                return self.news.push_front(told);
            }
        }
        if !self.say_pages(now, commands, &mut publish) {
            return;
        }
        if self.said.as_ref().is_some_and(|said| !said.cells.keys().eq(cells.keys())) {
            self.term = term();
        }
        let lives = |(_, peer): &(&String, &Peer)| self.lives(peer, now) == Some(true);
        let knows = self.peers.iter().filter(lives).map(|(name, peer)| (name.clone(), peer.term.clone()));
        let lacks = self.peers.iter().filter(lives).filter(|(name, peer)| !self.is_read(name, peer));
        let alive = BridgeState {
            store: self.store.clone(),
            cells,
            knows: knows.collect(),
            lacks: lacks.map(|(name, _)| name.clone()).collect(),
            until: commands.latest(),
            ends: self.ends,
        };
        let is_due = self.said_at.is_none_or(|at| now.saturating_sub(at) >= EVERY);
        let is_news = self.said.as_ref().is_none_or(|said| !said.says_the_same(&alive));
        if (is_due || is_news) && self.publish(now, "", ShareBody::Alive(alive.clone()), &mut publish) {
            (self.said, self.said_at) = (Some(alive), Some(now));
        }
    }

    /// Publishes the pages that have changed, the last one last. Returns false if not all of them fit.
    fn say_pages(
        &mut self,
        now: Duration,
        commands: &Commands,
        publish: &mut impl FnMut(&str, Vec<u8>) -> bool,
    ) -> bool {
        let (first, last) = commands.pages().into_inner();
        match self.bounds.replace((first, last)) {
            None => {
                self.all_at = Some(now);
                self.pages.extend(first..=last);
            }
            Some(before) if before == (first, last) => {}
            // Pages before the first one are removed, and the page that was the last one has another topic now.
            Some((before, last_before)) => self.pages.extend((before..first).chain(last_before..=last)),
        }
        while let Some(&page) = self.pages.first() {
            let topic = match page == last {
                true => format!("/{}/{LAST_PAGE}", self.store),
                false => format!("/{}/{page}", self.store),
            };
            let is_said = if page < first {
                publish(&topic, Vec::new())
            } else {
                let first = (page == last).then_some(first);
                let (until, commands) = (commands.latest(), commands.page(page));
                self.publish(now, &topic, ShareBody::Page(Page { page, first, until, commands }), publish)
            };
            if !is_said {
                return false;
            }
            self.pages.pop_first();
            let (said, unsaid) =
                core::mem::take(&mut self.unsaid).into_iter().partition(|(on, ..)| *on == page);
            self.unsaid = unsaid;
            let said: Vec<(u64, usize, Command)> = said;
            self.waiting.extend(said.into_iter().map(|(_, place, command)| (self.number, place, command)));
        }
        true
    }

    fn publish(
        &mut self,
        now: Duration,
        topic: &str,
        what: ShareBody,
        publish: &mut impl FnMut(&str, Vec<u8>) -> bool,
    ) -> bool {
        let message = Message { term: self.term.clone(), number: self.number + 1, what };
        let is_said = publish(topic, serde_json::to_vec(&message).unwrap_or_default());
        if is_said {
            self.number += 1;
            self.sent.push_back((self.number, now));
        }
        is_said
    }
}

fn by(node: &str, told: CommandReport) -> CommandReport {
    CommandReport { entry: Entry { by: node.into(), ..told.entry }, ..told }
}

fn term() -> String {
    format!("{:016x}", fastrand::u64(..))
}

/// Returns the rank of a bridge for a cell: FNV-1a with its bits mixed, because the highest bits decide.
fn rank(bridge: &str, cell: &str) -> u64 {
    let bytes = bridge.bytes().chain([0]).chain(cell.bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let mixed = (hash ^ hash >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    mixed ^ mixed >> 33
}
