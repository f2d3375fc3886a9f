//! One end of any link: a session whose events, calls and statistics are JSON.

use core::borrow::BorrowMut;
use core::time::Duration;
#[cfg(feature = "model")]
use std::any::Any;

use anyhow::{Context, Result, ensure};
use robot_session::Session;
use robot_session::end::{End as _, EventOf, Machine, Rule, Rules};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::given::GivenFields;
use crate::json;

/// An end of a link in the table.
#[derive(Debug, Clone, Copy)]
pub struct EndRow {
    /// The name of the end.
    pub name: &'static str,
    /// The rules that can be disabled in its machine.
    pub rules: fn() -> Vec<String>,
    /// Returns the names of the calls.
    pub calls: fn() -> Vec<&'static str>,
    /// The items that the end begins and ends, such as requests.
    pub once: &'static [PairedItem],
    /// Makes it of the fields of a configuration that are not the defaults, as stories have them: times are nanoseconds. With the
    /// feature `model` the rule of a number is left out.
    pub make: Make,
}

/// An item that ends once for each time that it begins, such as a request with its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PairedItem {
    /// The call, event or bytes that begin the item.
    pub begins: Act<'static>,
    /// The events that end the item.
    pub ends: &'static [Act<'static>],
    /// The number of items that may be pending.
    pub room: PendingLimit,
}

/// An act of an end, or of its user, peer or connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act<'a> {
    /// A call that is not refused.
    Call(&'a str),
    /// An event; one with a `count` counts this often.
    Event(&'a str),
    /// An event that ends all open items.
    All(&'a str),
    /// A transmission of the end.
    Sent,
    /// A byte that is read.
    Byte(u8),
    /// A connection is made or lost: it ends all open items.
    Connection,
}

/// The number of items that may be pending.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PendingLimit {
    /// This number of items.
    Most(u64),
    /// One item, until whose end nothing is sent.
    Silent,
    /// One item: a second beginning refers to the same item.
    Merged,
}

/// Makes an end.
pub type Make = fn(config: &Map<String, Value>, left_out: Option<usize>) -> Result<Box<dyn End>>;

/// A session in the table of ends; its methods are those of [`Session`].
#[allow(missing_docs, reason = "the methods are those of Session")]
pub trait End {
    fn handle_connected(&mut self, now: Duration);
    fn handle_disconnected(&mut self, now: Duration);
    fn handle_input(&mut self, now: Duration, bytes: &[u8]);
    fn handle_timeout(&mut self, now: Duration);
    fn handle_transmitted(&mut self, now: Duration);
    fn wants_input(&self) -> bool;
    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize>;
    fn poll_timeout(&self) -> Option<Duration>;
    fn max_input(&self) -> usize;
    fn max_transmit(&self) -> usize;

    /// Removes and returns the next event, as JSON.
    fn poll_event(&mut self) -> Option<String>;

    /// Returns the counters as JSON.
    fn statistics(&self) -> String;

    /// Makes a call by its name. The inner error is the object of a refusal.
    ///
    /// # Errors
    /// If there is no such call, or if it has another argument.
    fn call(&mut self, now: Duration, name: &str, argument: &Value) -> CallResult;

    /// Returns the name of the machine's state.
    fn state(&self) -> &'static str;

    /// Returns the machine.
    #[cfg(feature = "model")]
    fn machine(&self) -> &dyn Any;

    /// Returns the field `moves` of [`robot_session::end::Core`].
    #[cfg(feature = "model")]
    fn moves(&mut self) -> &mut dyn Any;
}

/// The result of a call: nothing, or the reason for its refusal.
pub type CallResult = Result<Result<(), String>>;

/// A call by its name.
pub(crate) type Call<O> = (&'static str, fn(&mut O, Duration, &Value) -> CallResult);

/// A session with the other objects of its user, such as the other end of its queue.
pub(crate) trait Owner: BorrowMut<Self::End> + Sized + 'static {
    /// The session.
    type End: robot_session::end::End<
            Machine: 'static,
            Events: robot_session::end::Events<Event: Serialize>,
            Statistics: Serialize,
        >;
    /// The rules of its machine.
    type Rule: Rule;

    /// The calls, by name.
    const CALLS: &'static [Call<Self>] = &[];

    /// The items that the end begins and ends.
    const PAIRED: &'static [PairedItem] = &[];

    /// Creates the end with the given fields of a configuration, and the defaults of all others.
    fn new(given: GivenFields, rules: Rules<Self::Rule>) -> Result<Self>;

    /// Returns a value of the session that a story shows beside an event: a key, and JSON.
    fn shows(&self, _event: &EventOf<Self::End>) -> Option<(&'static str, String)> {
        None
    }

    /// Performs the user's immediate reaction after each step.
    fn then(&mut self) {}

    /// Removes and returns an event beside the session, such as a job that the motion task took, as JSON.
    fn beside(&mut self) -> Option<String> {
        None
    }
}

impl EndRow {
    /// Returns the end of this owner.
    pub(crate) const fn of<O: Owner>() -> Self {
        Self {
            name: <O::End as Session>::END,
            rules: rules::<O>,
            calls: calls::<O>,
            once: O::PAIRED,
            make: make::<O>,
        }
    }
}

fn rules<O: Owner>() -> Vec<String> {
    O::Rule::ALL.iter().map(|rule| format!("{rule:?}")).collect()
}

fn calls<O: Owner>() -> Vec<&'static str> {
    O::CALLS.iter().map(|(name, _)| *name).collect()
}

fn make<O: Owner>(config: &Map<String, Value>, left_out: Option<usize>) -> Result<Box<dyn End>> {
    let owner = O::new(GivenFields(config.clone()), kept(left_out)?)?;
    Ok(Box::new(Boxed(owner)))
}

/// Returns all rules except the one with this number.
fn kept<R: Rule>(left_out: Option<usize>) -> Result<Rules<R>> {
    #[cfg(feature = "model")]
    if let Some(rule) = left_out.and_then(|number| R::ALL.get(number)) {
        return Ok(Rules::without(*rule));
    }
    ensure!(left_out.is_none(), "there is no such rule, or none can be left out");
    Ok(Rules::ALL)
}

struct Boxed<O>(O);

impl<O: Owner> Boxed<O> {
    fn with<T>(&mut self, act: impl FnOnce(&mut O::End) -> T) -> T {
        let result = act(self.0.borrow_mut());
        self.0.then();
        result
    }
}

impl<O: Owner> End for Boxed<O> {
    fn handle_connected(&mut self, now: Duration) {
        self.with(|session| session.handle_connected(now));
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.with(|session| session.handle_disconnected(now));
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.with(|session| session.handle_input(now, bytes));
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.with(|session| session.handle_timeout(now));
    }

    fn handle_transmitted(&mut self, now: Duration) {
        self.with(|session| session.handle_transmitted(now));
    }

    fn wants_input(&self) -> bool {
        self.0.borrow().wants_input()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.with(|session| session.poll_transmit(now, out))
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.0.borrow().poll_timeout()
    }

    fn max_input(&self) -> usize {
        <O::End as Session>::MAX_INPUT
    }

    fn max_transmit(&self) -> usize {
        <O::End as Session>::MAX_TRANSMIT
    }

    fn poll_event(&mut self) -> Option<String> {
        if let Some(beside) = self.0.beside() {
            return Some(beside);
        }
        let event = self.with(Session::poll_event)?;
        let text = json::text(&event);
        Some(match self.0.shows(&event) {
            Some((key, value)) => format!("{},\"{key}\":{value}}}", text.strip_suffix('}').unwrap_or(&text)),
            None => text,
        })
    }

    fn statistics(&self) -> String {
        json::text(&self.0.borrow().statistics())
    }

    fn call(&mut self, now: Duration, name: &str, argument: &Value) -> CallResult {
        let known = O::CALLS.iter().find(|(known, _)| *known == name);
        let (_, call) = known.with_context(|| format!("it has no call {name}"))?;
        let result = call(&mut self.0, now, argument);
        self.0.then();
        result
    }

    fn state(&self) -> &'static str {
        self.0.borrow().core().machine.name()
    }

    #[cfg(feature = "model")]
    fn machine(&self) -> &dyn Any {
        &self.0.borrow().core().machine
    }

    #[cfg(feature = "model")]
    fn moves(&mut self) -> &mut dyn Any {
        &mut self.0.borrow_mut().core_mut().moves
    }
}

/// Returns the result of a call that the session may refuse.
pub(crate) fn called<T>(result: Result<T, impl Serialize>) -> CallResult {
    Ok(result.map(drop).map_err(|refusal| json::text(&refusal)))
}

/// Returns the result of a call that is never refused.
pub(crate) fn done<T>(_: T) -> CallResult {
    Ok(Ok(()))
}

/// Returns the time at which something expires, in nanoseconds; `None` if it does not expire.
pub(crate) fn live_until(until: Option<Duration>) -> Option<(&'static str, String)> {
    let until = until.filter(|until| *until < Duration::MAX)?;
    Some(("live_until", until.as_nanos().to_string()))
}
