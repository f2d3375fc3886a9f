//! The rules of [`Session`].

use core::time::Duration;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

use arbitrary::Unstructured;

use super::driven::{BUFFER_LEN, Driven, DriverOutput};
use super::script::{Caller, Step, all};
use super::{Observed, Rng, Script, Subject};
use crate::Session;

/// Holds a session to the contract, on `seeds` random strings of calls; each takes one of its configurations, in turn.
///
/// # Panics
/// If the session breaks a rule.
pub fn session(subject: &impl Subject, seeds: u64) {
    for seed in 0..seeds {
        let bytes = Rng::new(seed).bytes(1000);
        let mut steps = all(&mut Unstructured::new(&bytes)).unwrap();
        steps.truncate(60);
        let mut script = Script {
            configuration: seed as u16,
            is_endless: false,
            is_careless: seed.is_multiple_of(4),
            ends: seed.is_multiple_of(3),
            caller: Caller::Often,
            steps,
        };
        for is_endless in [false, true] {
            script.is_endless = is_endless;
            compare(subject, &script, &Caller::ALL);
        }
    }
}

/// Holds a session to the contract, on a string of calls: for a fuzzer, which draws it as an
/// [`Arbitrary`](arbitrary::Arbitrary) value.
///
/// # Panics
/// If the session breaks a rule.
pub fn scripted<U: Subject>(subject: &U, script: &Script<U::Input, U::Call>) {
    compare(subject, script, &[script.caller]);
}

/// The number of events or transmissions without an end.
const MAX_OUTPUTS: usize = 10_000;

/// The latest time at which a deadline may still lie ahead: [`Duration::MAX`] means never.
const LATEST: Duration = Duration::MAX.saturating_sub(Duration::from_nanos(1));

/// Compares the run with those of other callers, which must make no difference.
fn compare<U: Subject>(subject: &U, script: &Script<U::Input, U::Call>, callers: &[Caller]) {
    let once = run(subject, script, None);
    for caller in callers {
        if *caller == Caller::Pieces && script.is_careless {
            continue;
        }
        let other = run(subject, script, Some(*caller));
        if *caller == Caller::Pieces && once.dropped + other.dropped > 0 {
            continue;
        }
        let (once, other) = (&once.all, &other.all);
        let place = once.iter().zip(other).position(|(one, other)| one != other);
        let from = place.unwrap_or(once.len().min(other.len())).saturating_sub(6);
        assert_eq!(once[from..], other[from..], "{}: {script:?}, {caller:?}, from {from}", subject.name());
    }
}

/// Makes the calls as a caller does; `None` is the plain one.
fn run<U: Subject>(subject: &U, script: &Script<U::Input, U::Call>, caller: Option<Caller>) -> Trace {
    let configuration = usize::from(script.configuration) % subject.configurations();
    let mut run = Run {
        subject,
        session: subject.session(configuration, script.is_endless),
        configuration,
        is_careless: script.is_careless,
        caller,
        watch: subject.watch(),
        connected: false,
        all: Vec::new(),
        driven: Driven::default(),
    };
    let mut now = Duration::ZERO;
    for step in &script.steps {
        match step {
            Step::Call(call) => run.call(now, call),
            Step::Input(input) => {
                let bytes = subject.input(&run.session, configuration, input);
                run.arrive(now, bytes);
            }
            Step::Corrupt(input, bit) => {
                let mut bytes = subject.input(&run.session, configuration, input);
                let at = usize::from(*bit).checked_rem(8 * bytes.len());
                if let Some(at) = at {
                    bytes[at / 8] ^= 1 << (at % 8);
                }
                run.arrive(now, bytes);
            }
            Step::Noise(bytes) => run.arrive(now, bytes.clone()),
            Step::Connected => run.connection(now, true),
            Step::Disconnected => run.connection(now, false),
            Step::Transmitted => run.session.handle_transmitted(now),
            Step::Deadline => {
                let due = run.session.poll_timeout().filter(|at| *at < LATEST || script.ends);
                now = due.unwrap_or(now).clamp(now, LATEST);
            }
            Step::Later(time) => now = now.saturating_add(*time).min(LATEST),
            Step::End if script.ends => now = LATEST,
            Step::End => {}
        }
        run.drain(now);
    }
    let Run { mut session, all, .. } = run;
    let dropped = subject.dropped_notices(&session.statistics());
    // Every deadline is due then, again and again: the reports need not end, but nothing panics.
    for _ in 0..10 {
        session.handle_timeout(Duration::MAX);
        let _ = session.poll_event();
        let _ = session.poll_transmit(Duration::MAX, &mut vec![0; U::Session::MAX_TRANSMIT]);
    }
    Trace { all, dropped }
}

/// The record of a session's behaviour.
struct Trace {
    /// Each event and each transmission, in sequence.
    all: Vec<String>,
    /// The number of dropped notices, including those that depend on how the input is divided into reads.
    dropped: u64,
}

/// A session in a string of calls.
struct Run<'a, U: Subject, W> {
    subject: &'a U,
    session: U::Session,
    configuration: usize,
    is_careless: bool,
    caller: Option<Caller>,
    watch: W,
    connected: bool,
    all: Vec<String>,
    /// The bytes, events and transmissions of a microcontroller's driver.
    driven: Driven<EventOf<U>>,
}

type EventOf<U> = <<U as Subject>::Session as Session>::Event;

impl<U: Subject, W: FnMut(Observed<'_, EventOf<U>>)> Run<'_, U, W> {
    fn connection(&mut self, now: Duration, connected: bool) {
        self.connected = connected;
        if connected {
            self.session.handle_connected(now);
        } else {
            self.session.handle_disconnected(now);
        }
        (self.watch)(Observed::Connection);
    }

    fn call(&mut self, now: Duration, call: &U::Call) {
        if let Some(result) = self.subject.call(&mut self.session, self.configuration, now, call) {
            (self.watch)(Observed::Called(&result));
            self.all.push(result);
        }
    }

    /// Passes bytes that arrive to the session, if it accepts some.
    fn arrive(&mut self, now: Duration, mut bytes: Vec<u8>) {
        bytes.truncate(U::Session::MAX_INPUT.min(BUFFER_LEN));
        if !((self.connected && self.session.wants_input()) || self.is_careless) {
            return;
        }
        if self.connected {
            bytes.iter().for_each(|byte| (self.watch)(Observed::Byte(*byte)));
        }
        match self.caller {
            // A driver reads nothing that is not wanted.
            Some(Caller::Polls | Caller::Awaits) if self.connected && self.session.wants_input() => {
                self.driven.received = bytes;
            }
            _ => {
                let in_pieces = self.caller == Some(Caller::Pieces)
                    && self.subject.may_be_cut(self.configuration, &bytes);
                let size = if in_pieces { 1 } else { bytes.len().max(1) };
                bytes.chunks(size).for_each(|piece| self.session.handle_input(now, piece));
            }
        }
    }

    fn event(&mut self, now: Duration, event: &EventOf<U>) {
        (self.watch)(Observed::Event(event));
        self.all.extend(self.subject.event(event).map(|event| format!("{now:?} {event}")));
    }

    fn sent(&mut self, now: Duration, bytes: &[u8]) {
        assert!(!bytes.is_empty(), "{}: a transmission without bytes", self.subject.name());
        assert!(self.connected, "{}: a transmission without a connection", self.subject.name());
        (self.watch)(Observed::Sent(bytes));
        self.all.push(format!("{now:?} {bytes:02X?}"));
    }

    /// Polls until the session has nothing to do: then its timeout lies ahead.
    fn drain(&mut self, now: Duration) {
        let name = self.subject.name();
        for round in 0.. {
            assert!(round < MAX_OUTPUTS, "{name}: at {now:?} a timeout is due again and again");
            let before = self.all.len();
            self.session.handle_timeout(now);
            match self.caller {
                Some(Caller::Polls) => self.driven.poll(&mut self.session, now),
                Some(Caller::Awaits) => self.driven.turn(&mut self.session, now),
                _ => self.poll(now),
            }
            for done in core::mem::take(&mut self.driven.done) {
                match done {
                    DriverOutput::Event(event) => self.event(now, &event),
                    DriverOutput::Sent(bytes) => self.sent(now, &bytes),
                }
            }
            let is_due = self.session.poll_timeout().is_some_and(|at| at <= now);
            if self.caller == Some(Caller::Often) {
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

    /// Polls the events, then the bytes to be sent.
    fn poll(&mut self, now: Duration) {
        let (begin, name) = (self.all.len(), self.subject.name());
        let mut out = vec![0; U::Session::MAX_TRANSMIT];
        while let Some(event) = self.session.poll_event() {
            self.event(now, &event);
            assert!(
                self.all.len() < begin + MAX_OUTPUTS,
                "{name}: events without end: {:?}",
                self.all.last()
            );
        }
        loop {
            if self.caller == Some(Caller::SmallBuffer) {
                // A message may be short enough for any longer one.
                let length = self.session.poll_transmit(now, &mut []);
                assert_eq!(length, None, "{name}: a transmission without bytes");
            }
            let Some(length) = self.session.poll_transmit(now, &mut out) else { break };
            self.sent(now, &out[..length]);
            assert!(self.all.len() < begin + MAX_OUTPUTS, "{name}: transmissions without end");
        }
    }
}
