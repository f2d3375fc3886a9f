//! Bridges that share cells: which of them has which, found out over the broker alone. docs/bridge.md says why it holds.
//!
//! Each bridge says every 1.5 s on a topic of its own which cells it offers and has, and which others it knows. What it has said comes
//! back to it: so the broker has it, and everybody who is connected has it before whatever the broker takes later. Its cells are its
//! own for [`LEASE`] from then that it said it. A bridge that was not heard for 16 s has none any more.

mod message;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use super::lease::Lease;
use super::remembered::Entry;
use super::report::Command;
use message::{Alive, Message, What};

/// How often a bridge announces itself.
const EVERY: Duration = Duration::from_millis(1500);
/// How long its cells are its own, from the time of a message that came back to it.
pub const LEASE: Duration = Duration::from_secs(6);
/// A thread lets its device go within this time, and clocks go as fast as one another to within the rest.
const MARGIN: Duration = Duration::from_secs(4);
/// A bridge that was not heard for this long has no cell. Its lease, and that of the one who judges: what came back to that one last was
/// said so long ago at the most, and what the broker has had since then may not have come yet.
const SILENT: Duration = Duration::from_secs(2 * LEASE.as_secs() + MARGIN.as_secs());

/// What a bridge knows of those that it shares cells with.
#[derive(Debug)]
pub struct Share {
    node: String,
    lease: Arc<Lease>,
    peers: BTreeMap<String, Peer>,
    /// Another one each time that it has lost its lease, or offers other cells: who knows it has heard what was said with it.
    term: String,
    held: bool,
    /// The number of the next message.
    number: u64,
    /// A command may be dated so far ahead, in milliseconds.
    ahead: u64,
    /// The messages that have not come back, and when they were said.
    sent: VecDeque<(u64, Duration)>,
    /// Since when everything is heard, and the time of day then.
    since: Option<(Duration, u64)>,
    /// What was said last of itself, and when on this connection.
    said: Option<Alive>,
    said_at: Option<Duration>,
    news: VecDeque<News>,
    /// Commands that are given when the message of this number has come back.
    waiting: VecDeque<(u64, usize, Command)>,
    ends: bool,
}

/// Another bridge, as it was heard since everything is.
#[derive(Debug, Default)]
struct Peer {
    heard: Option<Duration>,
    term: String,
    alive: Alive,
    /// Its latest command when it was heard first: those after it were heard one by one.
    until: u64,
}

/// What the others are to know of a command.
#[derive(Debug)]
struct News {
    cell: String,
    id: String,
    entry: Entry,
    /// The command is given to the cell of this place when they do.
    give: Option<(usize, Command)>,
}

/// What was heard.
#[derive(Debug, PartialEq)]
pub enum Heard {
    /// These commands are known to whoever listens: they are to be given.
    Give(Vec<(usize, Command)>),
    /// What became of another bridge's command.
    Command {
        /// The cell.
        cell: String,
        /// The command.
        id: String,
        /// What became of it, and whose it is.
        entry: Entry,
    },
    /// Nothing that is understood, and why.
    Strange(String),
}

impl Share {
    /// One that has no cell yet.
    pub fn new(node: &str, bridges: &[String], max_age: Duration) -> Self {
        let others = bridges.iter().filter(|name| *name != node);
        Self {
            ahead: u64::try_from(max_age.as_millis()).unwrap_or(u64::MAX),
            node: node.into(),
            lease: Arc::default(),
            peers: others.map(|name| (name.clone(), Peer::default())).collect(),
            term: term(),
            held: false,
            // None that an earlier process has used.
            number: fastrand::u64(..1 << 50),
            sent: VecDeque::new(),
            since: None,
            said: None,
            said_at: None,
            news: VecDeque::new(),
            waiting: VecDeque::new(),
            ends: false,
        }
    }

    /// What the threads of the cells ask.
    pub fn lease(&self) -> Arc<Lease> {
        Arc::clone(&self.lease)
    }

    /// From now on everything is heard; `today` is in milliseconds since 1970 UTC. The commands of which it is not known whether anybody
    /// has heard: they are not to be given.
    pub fn connected(&mut self, now: Duration, today: u64) -> Vec<(usize, Command)> {
        self.peers.values_mut().for_each(|peer| *peer = Peer::default());
        self.sent.clear();
        (self.since, self.said_at) = (Some((now, today)), None);
        self.waiting.drain(..).map(|(_, place, command)| (place, command)).collect()
    }

    /// Whether the lease was lost since this was asked last, and the commands that are not to be given.
    pub fn lapsed(&mut self, now: Duration) -> Option<Vec<(usize, Command)>> {
        if !self.held || self.lease.holds_at(now) {
            return None;
        }
        (self.held, self.term) = (false, term());
        self.sent.clear();
        let unsaid = self.news.iter_mut().filter_map(|news| news.give.take());
        Some(unsaid.chain(self.waiting.drain(..).map(|(_, place, command)| (place, command))).collect())
    }

    /// It has let every cell go and takes none.
    pub fn end(&mut self) {
        self.ends = true;
    }

    /// Whether it has.
    pub fn has_ended(&self) -> bool {
        self.ends
    }

    /// A message of this bridge, or of another.
    pub fn hear(&mut self, from: &str, payload: &[u8], now: Duration) -> Option<Heard> {
        let message: Message = match serde_json::from_slice(payload) {
            Ok(message) => message,
            Err(error) => {
                return Some(Heard::Strange(format!("message of {from} about shared cells: {error}")));
            }
        };
        if from == self.node {
            return self.came_back(message.number, now);
        }
        let Some(peer) = self.peers.get_mut(from) else {
            return Some(Heard::Strange(format!(
                "{from} shares cells of this group but is not in share.bridges: list every bridge in every site file"
            )));
        };
        match message.what {
            What::Alive(alive) => {
                if peer.heard.replace(now).is_none() {
                    peer.until = alive.until;
                }
                (peer.term, peer.alive) = (message.term, alive);
                None
            }
            What::Command { cell, id, entry } => {
                let entry = Entry { by: from.into(), ..entry };
                Some(Heard::Command { cell, id, entry })
            }
        }
    }

    fn came_back(&mut self, number: u64, now: Duration) -> Option<Heard> {
        if self.held && !self.lease.holds_at(now) {
            return None; // too late: it has lapsed
        }
        let place = self.sent.iter().position(|(sent, _)| *sent == number)?;
        let (_, at) = self.sent.drain(..=place).next_back()?;
        self.lease.renew(at + LEASE);
        // What was said too long ago is no lease.
        self.held |= self.lease.holds_at(now);
        let known = self.waiting.iter().take_while(|(waits, ..)| *waits <= number).count();
        let give: Vec<_> = self.waiting.drain(..known).map(|(_, place, command)| (place, command)).collect();
        (!give.is_empty()).then_some(Heard::Give(give))
    }

    /// Whether a bridge lives; nothing as long as that is not known.
    fn lives(&self, peer: &Peer, now: Duration) -> Option<bool> {
        let (since, _) = self.since?;
        let is_silent = now.saturating_sub(peer.heard.unwrap_or(since)) >= SILENT;
        match peer.heard {
            Some(_) => Some(!is_silent && !peer.alive.ends),
            None => is_silent.then_some(false),
        }
    }

    /// Whether a cell that this bridge has not is its to take; then, until when commands may have been given by others without being
    /// heard of, in milliseconds since 1970 UTC.
    pub fn may_take(&self, cell: &str, now: Duration) -> Option<u64> {
        let (_, today) = self.since.filter(|_| !self.ends && self.held && self.lease.holds_at(now))?;
        let mut until = 0;
        for (name, peer) in &self.peers {
            if self.lives(peer, now)? {
                // It has heard that this bridge lives, and so takes nothing of what is this one's by rank.
                let knows_this = peer.alive.knows.get(&self.node) == Some(&self.term);
                let comes_after =
                    peer.alive.cells.get(cell).is_none_or(|has| !has && self.is_before(name, cell));
                if !knows_this || !comes_after {
                    return None;
                }
            }
            until =
                until.max(if peer.heard.is_some() { peer.until } else { today.saturating_add(self.ahead) });
        }
        Some(until)
    }

    /// Whether a cell that this bridge has is another's by rank, which lives.
    pub fn must_give(&self, cell: &str, now: Duration) -> bool {
        self.peers.iter().any(|(name, peer)| {
            self.lives(peer, now) == Some(true)
                && peer.alive.cells.contains_key(cell)
                && !self.is_before(name, cell)
        })
    }

    /// Whether this bridge comes before another for a cell: any two agree, and the cells of each are spread over the others.
    fn is_before(&self, other: &str, cell: &str) -> bool {
        (rank(&self.node, cell), &*self.node) > (rank(other, cell), other)
    }

    /// The bridge that has a cell, as far as is known.
    pub fn owner(&self, cell: &str, now: Duration) -> Option<&str> {
        let has =
            |peer: &Peer| self.lives(peer, now) == Some(true) && peer.alive.cells.get(cell) == Some(&true);
        self.peers.iter().find(|(_, peer)| has(peer)).map(|(name, _)| &**name)
    }

    /// What became of a command, for the others. With a place it is to be given to the cell there when they know of it.
    pub fn tell(&mut self, cell: &str, id: &str, entry: Entry, give: Option<(usize, Command)>) {
        self.news.push_back(News { cell: cell.into(), id: id.into(), entry, give });
    }

    /// Says what is to be said: what became of commands, and then, when that is due, which cells are offered, and whether this bridge
    /// has them, and the time of the latest command that it knows.
    pub fn say(
        &mut self,
        now: Duration,
        cells: BTreeMap<String, bool>,
        until: u64,
        mut publish: impl FnMut(Vec<u8>) -> bool,
    ) {
        if self.since.is_none() {
            return;
        }
        while let Some(News { cell, id, entry, give }) = self.news.pop_front() {
            let what = What::Command { cell: cell.clone(), id: id.clone(), entry: entry.clone() };
            if !self.publish(now, what, &mut publish) {
                return self.news.push_front(News { cell, id, entry, give });
            }
            self.waiting.extend(give.map(|(place, command)| (self.number, place, command)));
        }
        if self.said.as_ref().is_some_and(|said| !said.cells.keys().eq(cells.keys())) {
            self.term = term();
        }
        let lives = |(_, peer): &(&String, &Peer)| self.lives(peer, now) == Some(true);
        let knows = self.peers.iter().filter(lives).map(|(name, peer)| (name.clone(), peer.term.clone()));
        let alive = Alive { cells, knows: knows.collect(), until, ends: self.ends };
        let is_due = self.said_at.is_none_or(|at| now.saturating_sub(at) >= EVERY);
        let is_news = self.said.as_ref().is_none_or(|said| !said.says_the_same(&alive));
        if (is_due || is_news) && self.publish(now, What::Alive(alive.clone()), &mut publish) {
            (self.said, self.said_at) = (Some(alive), Some(now));
        }
    }

    fn publish(&mut self, now: Duration, what: What, publish: &mut impl FnMut(Vec<u8>) -> bool) -> bool {
        let message = Message { term: self.term.clone(), number: self.number + 1, what };
        let is_said = publish(serde_json::to_vec(&message).unwrap_or_default());
        if is_said {
            self.number += 1;
            self.sent.push_back((self.number, now));
        }
        is_said
    }
}

fn term() -> String {
    format!("{:016x}", fastrand::u64(..))
}

/// FNV-1a, and then a mix of its bits: they decide by the highest.
fn rank(bridge: &str, cell: &str) -> u64 {
    let bytes = bridge.bytes().chain([0]).chain(cell.bytes());
    let hash = bytes.fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    let mixed = (hash ^ hash >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    mixed ^ mixed >> 33
}
