//! The clauses of docs/bridge.md and docs/bridge-shared.md by which no id is executed twice, explored: two bridges that
//! share a cell, a broker that stores pages, delays messages and may lose its stored pages, and a sender that repeats an id
//! with another time at any moment. In every reachable state the id was executed at most once; without any one of the
//! clauses there is a way to execute it twice.

use std::collections::HashSet;

/// A clause that can be taken out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Clause {
    /// The id is on the bridge's disk before the command is given.
    Disk,
    /// The command is given when its page has come back.
    Back,
    /// The broker stores the page.
    Stored,
    /// An id without a time is accepted only when the ledger of the other is read.
    Read,
    /// The ledger is read once more on each connection.
    Again,
    /// A cell is taken only when every message that was sent before has arrived.
    Arrived,
    /// An id is not forgotten for others; one that has a time leaves a mark, and is refused if it is not later.
    Mark,
    /// The mark of a bridge that was not read is ahead by twice the greatest age.
    Twice,
}

const CLAUSES: [Clause; 8] = [
    Clause::Disk,
    Clause::Back,
    Clause::Stored,
    Clause::Read,
    Clause::Again,
    Clause::Arrived,
    Clause::Mark,
    Clause::Twice,
];

/// The time in the id, if it has one.
const TIME: u8 = 3;
/// The greatest age of a command, and the greatest difference of the two clocks.
const AGE: u8 = 1;
/// The latest time: the id is too old by every clock then.
const LAST_TIME: u8 = 5;

/// A page: whether the id is on it, and whether the mark is at its time or later.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Page {
    has: bool,
    bars: bool,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
struct Bridge {
    /// On its disk: the id, whether it is in its own ledger, and whether the mark is at the time of the id or later.
    knows: bool,
    own: bool,
    bars: bool,
    runs: bool,
    /// Whether it is connected: whether a mark of that time is at the time of the id or later. And the page that it has not
    /// received yet.
    since: Option<bool>,
    inbox: Option<Page>,
    /// Whether it has read the ledger of the other on this connection.
    has_read: bool,
    /// The broker has the bridge's page of this connection.
    is_said: bool,
    /// Whether the command was accepted, and its page is to be sent, or to come back.
    unsaid: bool,
    waits: bool,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
struct State {
    now: u8,
    bridges: [Bridge; 2],
    stored: [Option<Page>; 2],
    owner: Option<usize>,
    executed: u8,
}

struct Model {
    without: Option<Clause>,
    has_time: bool,
    /// The time by which the clock of the second bridge is slow.
    behind: u8,
    /// Whether the broker may lose its stored pages.
    loses: bool,
}

impl Model {
    fn holds(&self, clause: Clause) -> bool {
        self.without != Some(clause)
    }

    fn today(&self, at: usize, now: u8) -> u8 {
        now + AGE - if at == 1 { self.behind } else { 0 }
    }

    /// Returns all possible next states.
    fn next(&self, state: &State) -> Vec<State> {
        let mut next = Vec::new();
        let mut step = |change: &dyn Fn(&mut State)| {
            let mut after = state.clone();
            change(&mut after);
            if after != *state {
                next.push(after);
            }
        };
        if self.has_time {
            step(&|after| after.now = LAST_TIME.min(after.now + 1));
        }
        if self.loses {
            // It restarts.
            step(&|after| {
                after.stored = [None; 2];
                (0..2).for_each(|at| self.cut(after, at));
            });
        }
        for (at, bridge) in state.bridges.iter().enumerate() {
            let other = 1 - at;
            if !bridge.runs {
                step(&|after| after.bridges[at].runs = true);
                continue;
            }
            step(&|after| {
                self.cut(after, at);
                let bridge = &mut after.bridges[at];
                if !self.holds(Clause::Disk) {
                    (bridge.knows, bridge.own, bridge.bars) = (false, false, false);
                }
                (bridge.runs, bridge.has_read) = (false, false);
            });
            if bridge.since.is_none() {
                step(&|after| {
                    let mark =
                        self.today(at, after.now) + if self.holds(Clause::Twice) { 2 } else { 1 } * AGE;
                    let stored = after.stored[other];
                    let bridge = &mut after.bridges[at];
                    bridge.since = Some(self.has_time && mark >= TIME);
                    bridge.has_read &= !self.holds(Clause::Again);
                    bridge.inbox = stored;
                });
                continue;
            }
            step(&|after| self.cut(after, at));
            if bridge.inbox.is_some() {
                // The broker may repeat it.
                step(&|after| self.receive(after, at));
                step(&|after| {
                    self.receive(after, at);
                    after.bridges[at].inbox = None;
                });
            }
            if state.bridges[other].inbox.is_none() && (!bridge.is_said || bridge.unsaid) {
                step(&|after| self.say(after, at));
            }
            if bridge.waits {
                // The bridge's own page has come back.
                step(&|after| self.give(after, at));
            }
            let has_arrived = bridge.inbox.is_none() || !self.holds(Clause::Arrived);
            if state.owner.is_none() && has_arrived && bridge.is_said {
                step(&|after| self.take(after, at));
            }
            if state.owner == Some(at) && !bridge.unsaid && !bridge.waits {
                step(&|after| after.owner = None);
            }
            if state.owner == Some(at) && self.accepts(state, at) {
                step(&|after| {
                    let bridge = &mut after.bridges[at];
                    (bridge.knows, bridge.own, bridge.unsaid) = (true, true, true);
                    after.executed += u8::from(!self.holds(Clause::Back));
                });
            }
            // Others make room: an id without a time is not forgotten.
            if bridge.knows && !bridge.unsaid && !bridge.waits && (self.has_time || !self.holds(Clause::Mark))
            {
                step(&|after| {
                    let bridge = &mut after.bridges[at];
                    (bridge.knows, bridge.own) = (false, false);
                    bridge.is_said = false;
                    bridge.bars |= self.holds(Clause::Mark);
                });
            }
        }
        next
    }

    /// Cuts the connection, and with it the cell.
    fn cut(&self, after: &mut State, at: usize) {
        let bridge = &mut after.bridges[at];
        (bridge.since, bridge.is_said, bridge.unsaid, bridge.waits) = (None, false, false, false);
        bridge.inbox = None;
        after.owner = after.owner.filter(|owner| *owner != at);
    }

    fn receive(&self, after: &mut State, at: usize) {
        let bridge = &mut after.bridges[at];
        let Some(page) = bridge.inbox else { return };
        bridge.knows |= page.has;
        bridge.bars |= page.bars;
        bridge.has_read = true;
    }

    fn say(&self, after: &mut State, at: usize) {
        let bridge = &mut after.bridges[at];
        let page = Page { has: bridge.own, bars: bridge.bars };
        bridge.is_said = true;
        if core::mem::take(&mut bridge.unsaid) {
            bridge.waits = self.holds(Clause::Back);
        }
        if self.holds(Clause::Stored) || !page.has {
            after.stored[at] = Some(page);
        }
        let other = &mut after.bridges[1 - at];
        if other.since.is_some() {
            other.inbox = Some(page);
        }
    }

    fn give(&self, after: &mut State, at: usize) {
        let bridge = &mut after.bridges[at];
        bridge.waits = false;
        if after.owner == Some(at) {
            after.executed += 1;
        }
    }

    fn take(&self, after: &mut State, at: usize) {
        after.owner = Some(at);
        let bridge = &mut after.bridges[at];
        bridge.bars |= !bridge.has_read && bridge.since == Some(true);
    }

    /// Returns whether the owner accepts the id, which is sent with the current time.
    fn accepts(&self, state: &State, at: usize) -> bool {
        let (bridge, today) = (&state.bridges[at], self.today(at, state.now));
        if bridge.knows || bridge.unsaid || bridge.waits {
            return false;
        }
        match self.has_time {
            true => today.abs_diff(TIME) <= AGE && !bridge.bars,
            false => bridge.has_read || !self.holds(Clause::Read),
        }
    }

    /// Explores the states. Returns their number, or the way to a state in which the id was executed twice.
    fn explore(&self) -> Result<usize, Vec<State>> {
        let mut states = vec![(State::default(), 0)];
        let mut seen = HashSet::from([State::default()]);
        let mut at = 0;
        while let Some((state, _)) = states.get(at) {
            for state in self.next(&state.clone()) {
                if seen.insert(state.clone()) {
                    let is_twice = state.executed > 1;
                    states.push((state, at));
                    if is_twice {
                        return Err(way(&states));
                    }
                }
            }
            at += 1;
        }
        Ok(states.len())
    }
}

/// Returns the way to the last state.
fn way(states: &[(State, usize)]) -> Vec<State> {
    let (mut way, mut at) = (Vec::new(), states.len() - 1);
    while at > 0 {
        way.push(states[at].0.clone());
        at = states[at].1;
    }
    way.reverse();
    way
}

fn models(without: Option<Clause>) -> impl Iterator<Item = Model> {
    let models = [(false, 0), (true, 0), (true, 1)].into_iter();
    models.flat_map(move |(has_time, behind)| {
        [false, true].map(|loses| Model { without, has_time, behind, loses })
    })
}

#[test]
fn an_id_is_executed_once_at_the_most_in_every_state() {
    for model in models(None) {
        match model.explore() {
            Ok(states) => {
                println!(
                    "{states} states: time {}, behind {}, loses {}",
                    model.has_time, model.behind, model.loses
                );
                assert!(states > 1000, "{states}");
            }
            Err(way) => panic!("time {}, loses {}: {way:#?}", model.has_time, model.loses),
        }
    }
}

#[test]
fn without_any_one_of_the_clauses_an_id_is_executed_twice() {
    for clause in CLAUSES {
        assert!(models(Some(clause)).any(|model| model.explore().is_err()), "{clause:?}");
    }
}
