//! Shadow ends: compare the messages of both ends of a conversation with the link's specification while they pass.
//!
//! A shadow gets the events of a tap in sequence of time, and reports an end that breaks a rule or misses a budget of the
//! source, and a session's assumption that is wrong. It may begin in the middle of a conversation: it does not report
//! anything that depends on unseen bytes. Bytes that are not a message are not reported: they are already an error of the
//! decoder, with a clause of its own.

use core::time::Duration;

use anyhow::Result;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::given::GivenFields;
use crate::settings::Configure;

/// An observer of one conversation of a link.
pub trait Shadow {
    /// Handles an event. Never called with an earlier time than before.
    fn see(&mut self, seen: &LineEvent<'_>, report: &mut Report<'_>);

    /// Called when time has passed without an event: reports messages that are missing by now.
    fn pass(&mut self, report: &mut Report<'_>);

    /// Returns the state of the conversation in a few words.
    fn state(&self) -> String;
}

/// Makes the shadow of a link.
pub type MakeShadow = fn(setup: &Setup<'_>) -> Result<Box<dyn Shadow>>;

/// The known properties of the two ends.
#[derive(Debug, Clone, Copy)]
pub struct Setup<'a> {
    /// The settings of the codec.
    pub settings: &'a Map<String, Value>,
    /// The fields of the ends' configurations that are not the defaults, by end, as stories have them.
    pub configs: &'a Map<String, Value>,
    /// The rate of a serial line, in baud; `None` if it is not known.
    pub baud: Option<u32>,
    /// Whether nothing but a line is between the ends.
    pub is_serial: bool,
}

/// An event between the ends.
#[derive(Debug, Clone, Copy)]
pub enum LineEvent<'a> {
    /// A connection is made. It has not carried any bytes.
    Opened,
    /// The connection is lost or closed.
    Closed,
    /// An end has sent bytes. The messages that are whole with them follow.
    Bytes {
        /// The end that sent the bytes.
        from: &'static str,
        /// All bytes that were sent at once.
        bytes: &'a [u8],
    },
    /// Sent bytes are a message.
    Message {
        /// The end that sent it.
        from: &'static str,
        /// The number of bytes of the message.
        length: u64,
        /// The message as its codec shows it.
        message: &'a Value,
    },
    /// Sent bytes are not a message.
    Corrupt {
        /// The end that sent the bytes.
        from: &'static str,
        /// The number of bytes without a message.
        length: u64,
        /// The error of the decoder.
        error: &'a Value,
    },
    /// Some bytes passed unobserved: the state of the ends is unknown from now on.
    Missed {
        /// The end that sent them.
        from: &'static str,
    },
}

/// A fault that a shadow has found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Complaint {
    /// The time at which the fault was clear.
    #[serde(skip)]
    pub at: Duration,
    /// The end that is to blame.
    #[serde(skip)]
    pub end: &'static str,
    /// The kind of the fault.
    #[serde(rename = "shadow")]
    pub kind: Kind,
    /// The clause of the link's specification.
    pub clause: &'static str,
    /// The fault in words, for a person.
    pub text: String,
}

/// The kinds of complaints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A rule of the specification is broken.
    Rule,
    /// A time of the source was missed.
    Budget,
    /// A session with this setting would have been wrong.
    Assumption,
}

/// The receiver of complaints.
#[derive(Debug)]
pub struct Report<'a> {
    /// The time of the current event.
    pub now: Duration,
    /// The complaints of all events up to now.
    pub complaints: &'a mut Vec<Complaint>,
}

impl Report<'_> {
    /// Reports that a rule is broken.
    pub fn rule(&mut self, end: &'static str, clause: &'static str, text: impl Into<String>) {
        self.say(Kind::Rule, end, clause, text.into());
    }

    /// Reports that a budget was missed.
    pub fn budget(&mut self, end: &'static str, clause: &'static str, text: impl Into<String>) {
        self.say(Kind::Budget, end, clause, text.into());
    }

    /// Reports that a session that assumes this would have been wrong.
    pub fn assumption(&mut self, end: &'static str, clause: &'static str, text: impl Into<String>) {
        self.say(Kind::Assumption, end, clause, text.into());
    }

    fn say(&mut self, kind: Kind, end: &'static str, clause: &'static str, text: String) {
        self.complaints.push(Complaint { at: self.now, end, kind, clause, text });
    }
}

/// A shadow with its complaints.
#[allow(missing_debug_implementations, reason = "not every shadow implements it")]
pub struct Watcher {
    shadow: Box<dyn Shadow>,
    complaints: Vec<Complaint>,
    now: Duration,
}

impl Watcher {
    /// Watches a conversation that may have begun before.
    pub fn new(shadow: Box<dyn Shadow>) -> Self {
        Self { shadow, complaints: Vec::new(), now: Duration::ZERO }
    }

    /// Called when an event has happened; returns the complaints about it. A clock that goes back counts as stopped.
    pub fn see(&mut self, at: Duration, seen: &LineEvent<'_>) -> Vec<Complaint> {
        self.now = self.now.max(at);
        let mut report = Report { now: self.now, complaints: &mut self.complaints };
        self.shadow.pass(&mut report);
        self.shadow.see(seen, &mut report);
        core::mem::take(&mut self.complaints)
    }

    /// Called when no event has happened until `at`.
    pub fn pass(&mut self, at: Duration) -> Vec<Complaint> {
        self.now = self.now.max(at);
        self.shadow.pass(&mut Report { now: self.now, complaints: &mut self.complaints });
        core::mem::take(&mut self.complaints)
    }

    /// Returns the state of the conversation in a few words.
    pub fn state(&self) -> String {
        self.shadow.state()
    }
}

impl Setup<'_> {
    /// Returns the configuration of an end: `made` with the given fields, except for those of `beside`.
    pub(crate) fn config<C: Configure>(&self, end: &str, made: C, beside: &[&str]) -> Result<C> {
        let GivenFields(mut given) = self.given(end);
        given.retain(|name, _| !beside.contains(&name.as_str()));
        GivenFields(given).configure(made)
    }

    /// Returns the fields given for an end.
    pub(crate) fn given(&self, end: &str) -> GivenFields {
        GivenFields(self.configs.get(end).and_then(Value::as_object).cloned().unwrap_or_default())
    }

    /// Returns whether a field of an end is given.
    pub(crate) fn has(&self, end: &str, field: &str) -> bool {
        self.configs.get(end).is_some_and(|end| end.get(field).is_some())
    }

    /// Returns the rate of the line, given with one of the ends or beside them.
    pub(crate) fn baud(&self) -> Option<u32> {
        let given = self.configs.values().find_map(|end| end.get("baud")?.as_u64()?.try_into().ok());
        given.or(self.baud)
    }
}

/// The difference that two observed times may have from the real ones: adapters and drivers deliver bytes late.
pub(crate) const JITTER: Duration = Duration::from_millis(20);

/// Returns a time as a text for people.
pub(crate) fn ms(time: Duration) -> String {
    format!("{} ms", (time.as_secs_f64() * 1e4).round() / 10.0)
}

/// The state of a conversation whose beginning, or some bytes since, were not seen or not decoded.
pub(crate) const UNSEEN: &str = "the state is not known yet";
