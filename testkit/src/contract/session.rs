//! The rules of [`robot_session::Session`].

use core::time::Duration;

use cellwire_links::end::{By, End, Make, Once};
use serde_json::{Map, Value, json};

use super::change;
use super::driven::{Done, Driven};
use super::open::Open;
use crate::rng::Rng;

/// What an end has done: each event and each transmission, in order.
#[derive(Debug, Default)]
struct Trace {
    all: Vec<String>,
    /// Whether there is a connection.
    connected: bool,
    open: Open,
    /// What goes through a driver of a microcontroller.
    driven: Driven,
    /// How many notices it has dropped, those that depend on how the input is cut among them.
    dropped: u64,
}

impl Trace {
    fn connection(&mut self, connected: bool) {
        self.connected = connected;
        self.open.note(By::Connection, 1);
    }

    fn event(&mut self, now: Duration, event: &str) {
        // What is so until more bytes come depends on how the input is cut.
        if event.starts_with(r#"{"event":"out_of_step""#) {
            return;
        }
        let object: Value = serde_json::from_str(event).unwrap();
        let times = object["count"].as_u64().unwrap_or(1);
        self.open.note(By::Event(object["event"].as_str().unwrap()), times);
        self.all.push(format!("{now:?} {event}"));
    }

    fn sent(&mut self, now: Duration, bytes: &[u8]) {
        assert!(!bytes.is_empty(), "a transmission without bytes");
        assert!(self.connected, "a transmission without a connection");
        self.open.note(By::Sent, 1);
        self.all.push(format!("{now:?} {bytes:02X?}"));
    }
}

/// A story, as far as it says what may be done with an end.
#[derive(Debug)]
pub struct Story {
    /// The configuration.
    pub config: Map<String, Value>,
    /// Bytes that the other end may send.
    pub inputs: Vec<Vec<u8>>,
    /// What its user may call, and with what.
    pub calls: Vec<(String, Value)>,
}

/// An end, and what is done with it.
#[derive(Debug)]
pub struct Held {
    /// Its name.
    pub name: String,
    /// How it is made.
    pub make: Make,
    /// What it begins and ends again.
    pub once: &'static [Once],
    /// At least one.
    pub stories: Vec<Story>,
    /// The fields of its configuration that are times, those that limit others last.
    pub times: Vec<String>,
}

/// Holds an end to the contract, on `seeds` random strings of calls; each takes the configuration of a story, in turn.
pub fn session(held: &Held, seeds: u64) {
    for seed in 0..seeds {
        let story = seed as usize % held.stories.len();
        let (is_careless, ends) = (seed.is_multiple_of(4), seed.is_multiple_of(3));
        for is_endless in [false, true] {
            let script = Script { story, is_endless, is_careless, ends, steps: 60, choices: Rng::new(seed) };
            held.compare(&script, &Caller::OTHERS);
        }
    }
}

/// Holds an end to the contract, on the string of calls that these bytes choose.
pub fn scripted(held: &Held, bytes: &[u8]) {
    let mut choices = Rng::of(bytes);
    let story = choices.below(held.stories.len());
    let how = choices.below(256);
    let is = |bit: u32| how >> bit & 1 == 1;
    let (is_endless, is_careless, ends, steps) = (is(0), is(1) && is(2), is(3), bytes.len());
    let script = Script { story, is_endless, is_careless, ends, steps, choices };
    held.compare(&script, &[Caller::OTHERS[(how >> 4) % Caller::OTHERS.len()]]);
}

/// A string of calls.
#[derive(Debug)]
struct Script {
    /// The story whose configuration it takes, and most of its bytes and calls.
    story: usize,
    /// Every time of the configuration is for ever.
    is_endless: bool,
    /// Bytes also come without a connection. Each such call may be reported, so pieces are not the same there.
    is_careless: bool,
    /// Time comes to its end.
    ends: bool,
    /// How many there are at most.
    steps: usize,
    choices: Rng,
}

/// Ways to call a session that must make no difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Caller {
    Plain,
    /// Asks for the timeout, and handles it, more often than it must.
    Often,
    /// First with a buffer that is too small.
    SmallBuffer,
    /// Input byte by byte.
    Pieces,
    /// The loop over `embedded-io`.
    Polls,
    /// The loop over `embedded-io-async`.
    Awaits,
}

impl Caller {
    const OTHERS: [Self; 5] = [Self::Often, Self::SmallBuffer, Self::Pieces, Self::Polls, Self::Awaits];
}

/// So many are endless.
const MANY: usize = 10_000;

/// The latest time at which a deadline may still lie ahead: [`Duration::MAX`] is never.
const LATEST: Duration = Duration::MAX.saturating_sub(Duration::from_nanos(1));

impl Held {
    /// With every time for ever that may be, the longest of those that limit one another first.
    fn endless(&self, config: &Map<String, Value>) -> Map<String, Value> {
        let mut endless = config.clone();
        for time in self.times.iter().rev() {
            // Of a gap `null` is none.
            let most = if time == "gap" { u64::MAX.into() } else { Value::Null };
            for never in [most, u32::MAX.into()] {
                let before = endless.insert(time.clone(), never);
                if (self.make)(&endless, None).is_ok() {
                    break;
                }
                endless.remove(time);
                endless.extend(before.map(|before| (time.clone(), before)));
            }
        }
        endless
    }

    /// Does the same in other ways, which must make no difference.
    fn compare(&self, script: &Script, callers: &[Caller]) {
        let mut config = self.stories[script.story].config.clone();
        let is_datagram = config.get("datagrams") == Some(&json!(true));
        if script.is_endless {
            config = self.endless(&config);
        }
        let once = self.run(script, &config, Caller::Plain);
        for caller in callers {
            // The borders of datagrams mean something.
            if *caller == Caller::Pieces && (is_datagram || script.is_careless) {
                continue;
            }
            let other = self.run(script, &config, *caller);
            if *caller == Caller::Pieces && once.dropped + other.dropped > 0 {
                continue;
            }
            let (once, other) = (&once.all, &other.all);
            let place = once.iter().zip(other).position(|(one, other)| one != other);
            let from = place.unwrap_or(once.len().min(other.len())).saturating_sub(6);
            let context = || format!("{}: {script:?}, {config:?}, {caller:?}", self.name);
            assert_eq!(once[from..], other[from..], "{}, from {from}", context());
        }
    }

    /// One of what a story has; of all stories now and then, or where it has none.
    fn pick<'a, T>(&'a self, rng: &mut Rng, story: usize, of: fn(&Story) -> &[T]) -> Option<&'a T> {
        let own = of(&self.stories[story]);
        if !own.is_empty() && rng.chance(0.8) {
            return own.get(rng.below(own.len()));
        }
        let count = self.stories.iter().map(|story| of(story).len()).sum();
        let place = rng.below(count);
        self.stories.iter().flat_map(of).nth(place)
    }

    /// A packet of Kawasaki's ends where a read ends outside of a message: one message may be cut anywhere, several not between them.
    fn may_be_cut(&self, bytes: &[u8]) -> bool {
        let is_one =
            matches!(bytes, [b'<', within @ .., b'>'] if !within.iter().any(|byte| b"<>".contains(byte)));
        is_one || !self.name.starts_with("kawasaki")
    }

    fn run(&self, script: &Script, config: &Map<String, Value>, caller: Caller) -> Trace {
        let Script { story, is_careless, ends, .. } = *script;
        let mut rng = script.choices.clone();
        let mut end = (self.make)(config, None).unwrap();
        let (end, mut now) = (&mut *end, Duration::ZERO);
        let mut trace = Trace { open: Open::new(self.once), ..Trace::default() };
        for _ in 0..script.steps {
            if rng.is_spent() {
                break;
            }
            match rng.below(16) {
                0 => {
                    end.handle_connected(now);
                    trace.connection(true);
                }
                1 if rng.chance(0.3) => {
                    end.handle_disconnected(now);
                    trace.connection(false);
                }
                2..7 => {
                    if let Some((name, argument)) = self.pick(&mut rng, story, |story| &story.calls) {
                        let mut argument = argument.clone();
                        if rng.chance(0.2) {
                            change(&mut argument, &mut rng);
                        }
                        // What the state does not allow is refused, and changes nothing.
                        let result = end.call(now, name, &argument).ok();
                        if let Some(Ok(())) = result {
                            trace.open.note(By::Call(name), 1);
                        }
                        trace.all.push(format!("{name}: {result:?}"));
                    }
                }
                kind @ 7..12 => {
                    let mut bytes = self.pick(&mut rng, story, |story| &story.inputs).unwrap().clone();
                    if kind == 11 {
                        bytes = (0..rng.below(80)).map(|_| rng.below(256) as u8).collect();
                    }
                    if rng.chance(0.2) && !bytes.is_empty() {
                        let at = rng.below(bytes.len());
                        bytes[at] ^= 1 << rng.below(8);
                    }
                    bytes.truncate(end.max_input());
                    if (trace.connected && end.wants_input()) || is_careless {
                        if trace.connected {
                            bytes.iter().for_each(|byte| trace.open.note(By::Byte(*byte), 1));
                        }
                        let in_pieces = caller == Caller::Pieces && self.may_be_cut(&bytes);
                        let size = if in_pieces { 1 } else { bytes.len().max(1) };
                        match caller {
                            // A driver reads nothing that is not wanted.
                            Caller::Polls | Caller::Awaits if trace.connected && end.wants_input() => {
                                trace.driven.received = bytes;
                            }
                            _ => bytes.chunks(size).for_each(|piece| end.handle_input(now, piece)),
                        }
                    }
                }
                12 => {
                    let due = end.poll_timeout().filter(|at| *at < LATEST || ends);
                    now = due.unwrap_or(now).clamp(now, LATEST);
                }
                13 => {
                    let step = rng.log_uniform(Duration::from_micros(10), Duration::from_secs(100));
                    now = now.saturating_add(step).min(LATEST);
                }
                14 if ends && rng.chance(0.1) => now = LATEST,
                15 => end.handle_transmitted(now),
                _ => {}
            }
            self.drain(end, now, caller, &mut trace);
        }
        let counters: Value = serde_json::from_str(&end.statistics()).unwrap();
        trace.dropped = counters["dropped_notices"].as_u64().unwrap_or_default();
        // Every deadline is due then, again and again: what is reported need not end, but nothing panics.
        for _ in 0..10 {
            end.handle_timeout(Duration::MAX);
            let _ = end.poll_event();
            let _ = end.poll_transmit(Duration::MAX, &mut vec![0; end.max_transmit()]);
        }
        trace
    }

    /// Until the session has nothing to do: then its timeout lies ahead.
    fn drain(&self, end: &mut dyn End, now: Duration, caller: Caller, trace: &mut Trace) {
        let name = &self.name;
        for round in 0.. {
            assert!(round < MANY, "{name}: at {now:?} a timeout is due again and again");
            let before = trace.all.len();
            end.handle_timeout(now);
            match caller {
                Caller::Polls => trace.driven.poll(end, now),
                Caller::Awaits => trace.driven.turn(end, now),
                _ => self.call(end, now, caller, trace),
            }
            for done in core::mem::take(&mut trace.driven.done) {
                match done {
                    Done::Event(event) => trace.event(now, &event),
                    Done::Sent(bytes) => trace.sent(now, &bytes),
                }
            }
            let is_due = end.poll_timeout().is_some_and(|at| at <= now);
            if caller == Caller::Often {
                let _ = end.poll_timeout();
                end.handle_timeout(now);
                end.handle_timeout(now);
            }
            // A transmission that is given up makes a timeout due at once.
            if trace.all.len() == before && !is_due {
                break;
            }
        }
        assert!(end.poll_timeout().is_none_or(|at| at > now), "{name}: nothing is left to do");
        assert!(end.poll_event().is_none(), "{name}: an event that nothing has caused");
    }

    /// Events, then what is to be sent.
    fn call(&self, end: &mut dyn End, now: Duration, caller: Caller, trace: &mut Trace) {
        let (begin, name) = (trace.all.len(), &self.name);
        let mut out = vec![0; end.max_transmit()];
        while let Some(event) = end.poll_event() {
            trace.event(now, &event);
            assert!(trace.all.len() < begin + MANY, "{name}: events without end: {:?}", trace.all.last());
        }
        loop {
            if caller == Caller::SmallBuffer {
                // A message may be short enough for any longer one.
                let length = end.poll_transmit(now, &mut []);
                assert_eq!(length, None, "{name}: a transmission without bytes");
            }
            let Some(length) = end.poll_transmit(now, &mut out) else { break };
            trace.sent(now, &out[..length]);
            assert!(trace.all.len() < begin + MANY, "{name}: transmissions without end");
        }
    }
}
