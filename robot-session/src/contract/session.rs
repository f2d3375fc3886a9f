//! The rules of [`Session`].

use core::time::Duration;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use super::driven::{Done, Driven, MOST};
use super::{Happened, Rng, Subject};
use crate::Session;

/// Holds a session to the contract, on `seeds` random strings of calls; each takes one of its configurations, in turn.
///
/// # Panics
/// When the session breaks a rule.
pub fn session(subject: &impl Subject, seeds: u64) {
    for seed in 0..seeds {
        let configuration = (seed % subject.configurations() as u64) as usize;
        let (is_careless, ends) = (seed.is_multiple_of(4), seed.is_multiple_of(3));
        for is_endless in [false, true] {
            let script =
                Script { configuration, is_endless, is_careless, ends, steps: 60, choices: Rng::new(seed) };
            compare(subject, &script, &Caller::OTHERS);
        }
    }
}

/// Holds a session to the contract, on the string of calls that these bytes choose: for a fuzzer.
///
/// # Panics
/// When the session breaks a rule.
pub fn scripted(subject: &impl Subject, bytes: &[u8]) {
    let mut choices = Rng::of(bytes);
    let configuration = choices.below(subject.configurations());
    let how = choices.below(256);
    let is = |bit: u32| how >> bit & 1 == 1;
    let (is_endless, is_careless, ends, steps) = (is(0), is(1) && is(2), is(3), bytes.len());
    let script = Script { configuration, is_endless, is_careless, ends, steps, choices };
    compare(subject, &script, &[Caller::OTHERS[(how >> 4) % Caller::OTHERS.len()]]);
}

/// A string of calls.
#[derive(Debug)]
struct Script {
    configuration: usize,
    /// Each timeout of the configuration is the longest that is allowed.
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

/// How many are endless.
const MANY: usize = 10_000;

/// The latest time at which a deadline may still lie ahead: [`Duration::MAX`] means never.
const LATEST: Duration = Duration::MAX.saturating_sub(Duration::from_nanos(1));

/// Does the same in other ways, which must make no difference.
fn compare<U: Subject>(subject: &U, script: &Script, callers: &[Caller]) {
    let once = run(subject, script, Caller::Plain);
    for caller in callers {
        if *caller == Caller::Pieces && script.is_careless {
            continue;
        }
        let other = run(subject, script, *caller);
        if *caller == Caller::Pieces && once.dropped + other.dropped > 0 {
            continue;
        }
        let (once, other) = (&once.all, &other.all);
        let place = once.iter().zip(other).position(|(one, other)| one != other);
        let from = place.unwrap_or(once.len().min(other.len())).saturating_sub(6);
        assert_eq!(once[from..], other[from..], "{}: {script:?}, {caller:?}, from {from}", subject.name());
    }
}

fn run<U: Subject>(subject: &U, script: &Script, caller: Caller) -> Trace {
    let Script { configuration, is_careless, ends, .. } = *script;
    let mut rng = script.choices.clone();
    let session = subject.session(configuration, script.is_endless);
    let mut run = Run {
        subject,
        session,
        caller,
        watch: subject.watch(),
        connected: false,
        all: Vec::new(),
        driven: Driven::default(),
    };
    let mut now = Duration::ZERO;
    for _ in 0..script.steps {
        if rng.is_spent() {
            break;
        }
        match rng.below(16) {
            0 => run.connection(now, true),
            1 if rng.chance(0.3) => run.connection(now, false),
            2..7 => {
                if let Some(result) = subject.call(&mut run.session, configuration, now, &mut rng) {
                    (run.watch)(Happened::Called(&result));
                    run.all.push(result);
                }
            }
            kind @ 7..12 => {
                let mut bytes = subject.input(&run.session, configuration, &mut rng);
                if kind == 11 {
                    bytes = (0..rng.below(80)).map(|_| rng.below(256) as u8).collect();
                }
                if rng.chance(0.2) && !bytes.is_empty() {
                    let at = rng.below(bytes.len());
                    bytes[at] ^= 1 << rng.below(8);
                }
                bytes.truncate(U::Session::MAX_INPUT.min(MOST));
                if (run.connected && run.session.wants_input()) || is_careless {
                    let in_pieces = caller == Caller::Pieces && subject.may_be_cut(configuration, &bytes);
                    run.input(now, bytes, in_pieces);
                }
            }
            12 => {
                let due = run.session.poll_timeout().filter(|at| *at < LATEST || ends);
                now = due.unwrap_or(now).clamp(now, LATEST);
            }
            13 => {
                let step = rng.log_uniform(Duration::from_micros(10), Duration::from_secs(100));
                now = now.saturating_add(step).min(LATEST);
            }
            14 if ends && rng.chance(0.1) => now = LATEST,
            15 => run.session.handle_transmitted(now),
            _ => {}
        }
        run.drain(now);
    }
    let Run { mut session, all, .. } = run;
    let dropped = subject.dropped_notices(&session.statistics());
    // Every deadline is due then, again and again: what is reported need not end, but nothing panics.
    for _ in 0..10 {
        session.handle_timeout(Duration::MAX);
        let _ = session.poll_event();
        let _ = session.poll_transmit(Duration::MAX, &mut vec![0; U::Session::MAX_TRANSMIT]);
    }
    Trace { all, dropped }
}

/// What a session has done.
struct Trace {
    /// Each event and each transmission, in order.
    all: Vec<String>,
    /// How many notices it has dropped, those that depend on how the input is cut among them.
    dropped: u64,
}

/// A session in a string of calls.
struct Run<'a, U: Subject, W> {
    subject: &'a U,
    session: U::Session,
    caller: Caller,
    watch: W,
    connected: bool,
    all: Vec<String>,
    /// What goes through a driver of a microcontroller.
    driven: Driven<EventOf<U>>,
}

type EventOf<U> = <<U as Subject>::Session as Session>::Event;

impl<U: Subject, W: FnMut(Happened<'_, EventOf<U>>)> Run<'_, U, W> {
    fn connection(&mut self, now: Duration, connected: bool) {
        self.connected = connected;
        if connected {
            self.session.handle_connected(now);
        } else {
            self.session.handle_disconnected(now);
        }
        (self.watch)(Happened::Connection);
    }

    fn input(&mut self, now: Duration, bytes: Vec<u8>, in_pieces: bool) {
        if self.connected {
            bytes.iter().for_each(|byte| (self.watch)(Happened::Byte(*byte)));
        }
        match self.caller {
            // A driver reads nothing that is not wanted.
            Caller::Polls | Caller::Awaits if self.connected && self.session.wants_input() => {
                self.driven.received = bytes;
            }
            _ => {
                let size = if in_pieces { 1 } else { bytes.len().max(1) };
                bytes.chunks(size).for_each(|piece| self.session.handle_input(now, piece));
            }
        }
    }

    fn event(&mut self, now: Duration, event: &EventOf<U>) {
        (self.watch)(Happened::Event(event));
        self.all.extend(self.subject.event(event).map(|event| format!("{now:?} {event}")));
    }

    fn sent(&mut self, now: Duration, bytes: &[u8]) {
        assert!(!bytes.is_empty(), "{}: a transmission without bytes", self.subject.name());
        assert!(self.connected, "{}: a transmission without a connection", self.subject.name());
        (self.watch)(Happened::Sent(bytes));
        self.all.push(format!("{now:?} {bytes:02X?}"));
    }

    /// Until the session has nothing to do: then its timeout lies ahead.
    fn drain(&mut self, now: Duration) {
        let name = self.subject.name();
        for round in 0.. {
            assert!(round < MANY, "{name}: at {now:?} a timeout is due again and again");
            let before = self.all.len();
            self.session.handle_timeout(now);
            match self.caller {
                Caller::Polls => self.driven.poll(&mut self.session, now),
                Caller::Awaits => self.driven.turn(&mut self.session, now),
                _ => self.poll(now),
            }
            for done in core::mem::take(&mut self.driven.done) {
                match done {
                    Done::Event(event) => self.event(now, &event),
                    Done::Sent(bytes) => self.sent(now, &bytes),
                }
            }
            let is_due = self.session.poll_timeout().is_some_and(|at| at <= now);
            if self.caller == Caller::Often {
                let _ = self.session.poll_timeout();
                self.session.handle_timeout(now);
                self.session.handle_timeout(now);
            }
            // A transmission that is given up makes a timeout due at once.
            if self.all.len() == before && !is_due {
                break;
            }
        }
        assert!(self.session.poll_timeout().is_none_or(|at| at > now), "{name}: nothing is left to do");
        let event = self.session.poll_event();
        assert!(event.is_none(), "{name}: an event that nothing has caused: {event:?}");
    }

    /// Events, then what is to be sent.
    fn poll(&mut self, now: Duration) {
        let (begin, name) = (self.all.len(), self.subject.name());
        let mut out = vec![0; U::Session::MAX_TRANSMIT];
        while let Some(event) = self.session.poll_event() {
            self.event(now, &event);
            assert!(self.all.len() < begin + MANY, "{name}: events without end: {:?}", self.all.last());
        }
        loop {
            if self.caller == Caller::SmallBuffer {
                // A message may be short enough for any longer one.
                let length = self.session.poll_transmit(now, &mut []);
                assert_eq!(length, None, "{name}: a transmission without bytes");
            }
            let Some(length) = self.session.poll_transmit(now, &mut out) else { break };
            self.sent(now, &out[..length]);
            assert!(self.all.len() < begin + MANY, "{name}: transmissions without end");
        }
    }
}
