use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use fastrand::Rng;

use super::{Heard, LEASE, SILENT, Share};
use crate::remembered::Entry;
use crate::report::{Command, Outcome};

const STEP: Duration = Duration::from_millis(50);
const NAMES: [&str; 3] = ["bridge-1", "bridge-2", "bridge-3"];
const CELLS: [&str; 6] = ["handling", "painter", "cutter", "assembly", "arm", "ball"];
/// How long a thread may go on with what it has begun, at the most.
const THREAD: Duration = Duration::from_secs(2);

fn milliseconds(count: u64) -> Duration {
    Duration::from_millis(count)
}

/// Who has said something, and what.
type Said = (usize, Vec<u8>);

/// A bridge with its threads, and its connection to the broker.
struct Bridge {
    share: Share,
    /// The cells that it has, and when the thread of one that it lets go ends.
    cells: BTreeMap<usize, Option<Duration>>,
    is_connected: bool,
    /// What is on its way to the broker and back, and when it arrives; nothing to go by is a subscription.
    up: VecDeque<(Duration, Option<Vec<u8>>)>,
    down: VecDeque<(Duration, Option<Said>)>,
    /// Its process or its network is stopped until then.
    frozen: Duration,
    jam: Duration,
    dead_until: Option<Duration>,
}

impl Bridge {
    fn new(name: &str) -> Self {
        let names = NAMES.map(str::to_owned);
        Self {
            share: Share::new(name, &names, Duration::from_secs(30)),
            cells: BTreeMap::new(),
            is_connected: false,
            up: VecDeque::new(),
            down: VecDeque::new(),
            frozen: Duration::ZERO,
            jam: Duration::ZERO,
            dead_until: None,
        }
    }

    fn later<T>(queue: &VecDeque<(Duration, T)>, at: Duration) -> Duration {
        queue.back().map_or(at, |(last, _)| at.max(*last))
    }

    /// The connection is gone; what was on its way to the broker may arrive all the same.
    fn cut(&mut self, rng: &mut Rng) {
        self.is_connected = false;
        self.down.clear();
        let keep = rng.usize(..=self.up.len());
        self.up.truncate(keep);
        self.up.retain(|(_, what)| what.is_some());
    }
}

struct World {
    rng: Rng,
    now: Duration,
    bridges: Vec<Bridge>,
    /// Who has had each cell last, and until when it may have moved its device.
    moved: BTreeMap<usize, (usize, Duration)>,
    takes: usize,
}

impl World {
    fn new(seed: u64) -> Self {
        let bridges = NAMES.iter().map(|name| Bridge::new(name)).collect();
        Self { rng: Rng::with_seed(seed), now: milliseconds(1000), bridges, moved: BTreeMap::new(), takes: 0 }
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

    fn step(&mut self, is_broker_there: bool) {
        self.now += STEP;
        let now = self.now;
        // The broker takes what has arrived, in some order of the connections, and hands it to whoever is subscribed at once.
        for at in 0..self.bridges.len() {
            while let Some((arrives, what)) = self.bridges[at].up.front() {
                if *arrives > now || !is_broker_there {
                    break;
                }
                let what = what.clone();
                self.bridges[at].up.pop_front();
                for (to, bridge) in self.bridges.iter_mut().enumerate() {
                    let delay = now.max(bridge.jam) + milliseconds(self.rng.u64(0..120));
                    let arrives = Bridge::later(&bridge.down, delay);
                    match &what {
                        None if to == at => bridge.down.push_back((arrives, None)),
                        Some(message) if bridge.is_connected => {
                            bridge.down.push_back((arrives, Some((at, message.clone()))));
                        }
                        _ => {}
                    }
                }
            }
        }
        for at in 0..self.bridges.len() {
            self.bridge(at, is_broker_there);
        }
    }

    fn bridge(&mut self, at: usize, is_broker_there: bool) {
        let now = self.now;
        // The threads of its cells go on while the hub is stopped, as long as the lease lasts. Who is told to end begins nothing.
        let cells = self.bridges[at].cells.iter().filter(|(_, ends)| ends.is_none());
        let cells: Vec<usize> = cells.map(|(cell, _)| *cell).collect();
        if self.bridges[at].share.lease.holds_at(now) {
            cells.iter().for_each(|cell| self.moves(at, *cell, now + THREAD));
        }
        let bridge = &mut self.bridges[at];
        if bridge.dead_until.take_if(|until| *until <= now).is_some() {
            let jam = bridge.jam;
            *bridge = Bridge { jam, ..Bridge::new(NAMES[at]) };
        }
        if bridge.dead_until.is_some() || bridge.frozen > now {
            return;
        }
        if !bridge.is_connected && is_broker_there && bridge.jam <= now && self.rng.u8(..20) == 0 {
            bridge.is_connected = true;
            bridge.down.clear();
            let arrives = Bridge::later(&bridge.up, now + milliseconds(30));
            bridge.up.push_back((arrives, None));
        }
        while bridge.down.front().is_some_and(|(arrives, _)| *arrives <= now) {
            match bridge.down.pop_front().unwrap().1 {
                None => drop(bridge.share.connected(now, 1_000_000)),
                Some((from, message)) => {
                    let heard = bridge.share.hear(NAMES[from], &message, now);
                    assert!(!matches!(heard, Some(Heard::Strange(_))), "{heard:?}");
                }
            }
        }
        // As the hub does.
        let lapsed = bridge.share.lapsed(now).is_some();
        let mut takes = Vec::new();
        for (cell, name) in CELLS.iter().enumerate() {
            match bridge.cells.get_mut(&cell) {
                Some(ends) => {
                    let must_give = bridge.share.must_give(name, now);
                    if (lapsed || must_give) && ends.is_none() {
                        *ends = Some(now + milliseconds(self.rng.u64(0..2000)));
                    }
                }
                None => takes.extend(bridge.share.may_take(name, now).map(|_| cell)),
            }
        }
        // A thread that has ended does nothing more.
        bridge.cells.retain(|cell, ends| {
            let is_over = ends.is_some_and(|ends| ends <= now);
            if let Some((last, busy)) = self.moved.get_mut(cell).filter(|_| is_over)
                && *last == at
            {
                *busy = now;
            }
            !is_over
        });
        for cell in &takes {
            bridge.cells.insert(*cell, None);
        }
        let offered = CELLS.iter().enumerate();
        let offered =
            offered.map(|(cell, name)| ((*name).to_owned(), bridge.cells.contains_key(&cell))).collect();
        let (up, jam, is_connected) = (&mut bridge.up, bridge.jam, bridge.is_connected);
        let delay = self.rng.u64(0..120);
        bridge.share.say(now, offered, 7, |message| {
            let arrives = Bridge::later(up, now.max(jam) + milliseconds(delay));
            is_connected && {
                up.push_back((arrives, Some(message)));
                true
            }
        });
        self.takes += takes.len();
        for cell in takes {
            self.moves(at, cell, now + THREAD);
        }
    }

    /// The process is gone, and its threads with it.
    fn kill(&mut self, at: usize, until: Duration) {
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

    fn fault(&mut self) {
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

    fn owners(&self, cell: usize) -> Vec<&str> {
        let has = |bridge: &&Bridge| bridge.cells.get(&cell) == Some(&None);
        let of =
            |bridge: &Bridge| NAMES[self.bridges.iter().position(|it| core::ptr::eq(it, bridge)).unwrap()];
        self.bridges.iter().filter(has).map(of).collect()
    }
}

#[test]
fn no_two_bridges_have_a_cell_whatever_fails_and_one_has_it_soon_after() {
    for seed in 0..25 {
        let mut world = World::new(seed);
        for round in 0..20 {
            let outage = (round % 5 == 4).then(|| world.now + milliseconds(world.rng.u64(500..20_000)));
            if outage.is_some() {
                // The broker restarts without its memory.
                world.bridges.iter_mut().for_each(|bridge| bridge.cut(&mut Rng::with_seed(round)));
                world.bridges.iter_mut().for_each(|bridge| bridge.up.clear());
            } else {
                world.fault();
            }
            for _ in 0..world.rng.u32(20..400) {
                world.step(outage.is_none_or(|until| until <= world.now));
            }
        }
        // Every fault is over.
        for _ in 0..600 {
            world.step(true);
        }
        let end = world.now + SILENT + 3 * LEASE;
        while world.now < end {
            world.step(true);
        }
        for (cell, name) in CELLS.iter().enumerate() {
            let first = NAMES.iter().max_by_key(|bridge| super::rank(bridge, name)).unwrap();
            assert_eq!(world.owners(cell), [*first], "seed {seed}: {name}");
        }
        assert!(world.takes > 2 * CELLS.len(), "nothing was taken over");
    }
}

#[test]
fn the_cells_of_a_bridge_that_dies_are_taken_within_half_a_minute_and_given_back() {
    let mut world = World::new(3);
    let run = |world: &mut World, seconds: u64| {
        let end = world.now + Duration::from_secs(seconds);
        while world.now < end {
            world.step(true);
        }
    };
    run(&mut world, 8);
    let before: Vec<_> = (0..CELLS.len()).map(|cell| world.owners(cell)[0].to_owned()).collect();
    assert!(before.iter().any(|owner| owner == NAMES[0]), "{before:?}");
    world.kill(0, world.now + Duration::from_secs(3600));
    run(&mut world, 20);
    for (cell, owner) in before.iter().enumerate() {
        let (now, is_dead) = (world.owners(cell), owner == NAMES[0]);
        assert!(now.len() == 1 && (now[0] == owner) != is_dead, "{owner}: {now:?}");
    }
    world.bridges[0].dead_until = Some(world.now);
    run(&mut world, 8);
    assert_eq!((0..CELLS.len()).map(|cell| world.owners(cell)[0]).collect::<Vec<_>>(), before);
}

#[test]
fn a_command_is_given_when_it_has_come_back_and_not_when_the_connection_is_another() {
    let mut share = Share::new("a", &["a".into(), "b".into()], Duration::from_secs(30));
    let entry =
        Entry { at: 5, sent: 4, outcome: Outcome::Accepted, detail: String::new(), by: String::new() };
    let command = Command { id: "x".into(), order: serde_json::Map::new(), until: 9 };
    let (now, mut said) = (milliseconds(1000), Vec::new());
    let mut say = |share: &mut Share, now| {
        said.clear();
        share.say(now, BTreeMap::new(), 4, |message| {
            said.push(message);
            true
        });
        said.clone()
    };
    assert_eq!(share.connected(now, 100), []);
    share.tell("f", "x", entry.clone(), Some((3, command.clone())));
    let messages = say(&mut share, now);
    assert_eq!((messages.len(), share.lease.holds_at(now)), (2, false), "the command, and that it lives");
    assert_eq!(share.hear("a", &messages[0], now), Some(Heard::Give(vec![(3, command.clone())])));
    assert!(share.lease.holds_at(now + LEASE - STEP) && !share.lease.holds_at(now + LEASE));
    assert_eq!(share.hear("a", &messages[0], now), None, "once");
    // The other one hears whose it is.
    let mut other = Share::new("b", &["a".into(), "b".into()], Duration::from_secs(30));
    other.connected(now, 100);
    let by = Entry { by: "a".into(), ..entry.clone() };
    let heard = Heard::Command { cell: "f".into(), id: "x".into(), entry: by };
    assert_eq!(other.hear("a", &messages[0], now), Some(heard));

    share.tell("f", "y", entry, Some((3, command.clone())));
    let messages = say(&mut share, now + STEP);
    assert_eq!(share.connected(now + STEP, 100), [(3, command)]);
    assert_eq!(share.hear("a", &messages[0], now + STEP), None, "of an earlier connection");
}

#[test]
fn who_has_not_heard_a_bridge_knows_nothing_of_commands_before() {
    let (mut a, mut b) = (
        Share::new("a", &["a".into(), "b".into()], Duration::from_secs(30)),
        Share::new("b", &["a".into(), "b".into()], Duration::from_secs(30)),
    );
    let cells = |has| BTreeMap::from([("f".to_owned(), has)]);
    let exchange = |from: &mut Share, name: &str, to: &mut Share, has, until, now| {
        let mut said = Vec::new();
        from.say(now, cells(has), until, |message| {
            said.push(message);
            true
        });
        for message in said {
            assert_eq!((from.hear(name, &message, now), to.hear(name, &message, now)), (None, None));
        }
    };
    let start = milliseconds(1000);
    a.connected(start, 500_000);
    b.connected(start, 500_000);
    exchange(&mut a, "a", &mut b, false, 0, start);
    assert_eq!((a.may_take("f", start), b.may_take("f", start)), (None, None));
    // Nobody was heard: after a while it is alone, and commands that another may have had are barred.
    let mut now = start;
    while a.may_take("f", now).is_none() {
        now += milliseconds(500);
        exchange(&mut a, "a", &mut Share::new("x", &["a".into()], LEASE), false, 0, now);
    }
    assert_eq!((now - start, a.may_take("f", now)), (SILENT, Some(530_000)));
    // Another one was heard, with the latest command that it knows. It may take the cell until it has heard this one.
    let mut now = now + milliseconds(500);
    exchange(&mut b, "b", &mut a, false, 450_000, now);
    assert_eq!(a.may_take("f", now), None);
    exchange(&mut b, "b", &mut a, true, 455_000, now);
    assert_eq!((a.may_take("f", now), a.owner("f", now)), (None, Some("b")));
    now += milliseconds(1500);
    exchange(&mut a, "a", &mut b, false, 0, now);
    assert!(b.must_give("f", now) && !a.must_give("f", now));
    exchange(&mut b, "b", &mut a, false, 460_000, now);
    assert_eq!((a.may_take("f", now), b.may_take("f", now)), (Some(450_000), None));
}
