//! The ends of links that stories drive.

mod kawasaki;
mod kawasaki_pc;
mod kawasaki_robot;
mod table;

use core::time::Duration;

use anyhow::{Result, bail};
use cellwire_links::Link;
use robot_session::{Rule, Rules, Session};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use testkit::model::Rows;

use crate::json::{self, Object};

/// An input of a session.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Do {
    Connected,
    Disconnected,
    Input(Vec<u8>),
    Timeout,
    Transmitted,
    Nothing,
    Call { name: String, argument: Value },
}

impl Do {
    /// Gives it to a session. A call of the end's user is the end's own: its name and argument.
    fn give(&self, session: &mut impl Session, now: Duration) -> Option<(&str, &Value)> {
        match self {
            Self::Connected => session.handle_connected(now),
            Self::Disconnected => session.handle_disconnected(now),
            Self::Input(bytes) => session.handle_input(now, bytes),
            Self::Timeout => session.handle_timeout(now),
            Self::Transmitted => session.handle_transmitted(now),
            Self::Nothing => {}
            Self::Call { name, argument } => return Some((name, argument)),
        }
        None
    }
}

/// What the driver of a session does not do in a step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Omits {
    /// `hold`: it asks for nothing to transmit.
    pub(crate) transmit: bool,
    /// `keep`: it takes no event.
    pub(crate) events: bool,
}

/// What a session did.
#[derive(Debug, Default)]
pub(crate) struct Step {
    pub(crate) refused: Option<String>,
    pub(crate) events: Vec<String>,
    pub(crate) transmit: Vec<Vec<u8>>,
    /// The cells of the machine's matrix: `state: input`.
    pub(crate) cells: Vec<String>,
}

/// A session that a story drives.
pub(crate) trait End {
    fn step(&mut self, now: Duration, input: &Do, omits: Omits) -> Result<Step>;
    fn deadline(&self) -> Option<Duration>;
    fn state(&self) -> String;
}

/// A configuration's fields, and the number of the rule that is left out.
type Make = fn(&Map<String, Value>, Option<usize>) -> Result<Box<dyn End>>;

/// How to make an end, and the rules that its machine can be told to leave out, by number.
pub(crate) struct Maker {
    pub(crate) make: Make,
    pub(crate) rules: fn() -> Vec<String>,
}

/// The names of rules.
fn names<R: Rule>() -> Vec<String> {
    R::ALL.iter().map(|rule| format!("{rule:?}")).collect()
}

/// Makes an end of a link.
pub(crate) fn make(
    link: &str,
    name: &str,
    config: &Map<String, Value>,
    left_out: Option<usize>,
) -> Result<Box<dyn End>> {
    let link = Link::by_name(link)?;
    if link.ends.is_empty() {
        return (ends(link.name, name)?.make)(config, left_out);
    }
    let (mut end, names) = ((link.end(name)?.make)(config, left_out)?, table::names(link.name, name, config));
    (names.cells)(&mut *end);
    Ok(Box::new(Driven { end, names }))
}

/// The rules that the machine of an end can be told to leave out, by number.
pub(crate) fn rules(link: &str, name: &str) -> Result<Vec<String>> {
    let link = Link::by_name(link)?;
    Ok(if link.ends.is_empty() { (ends(link.name, name)?.rules)() } else { (link.end(name)?.rules)() })
}

/// An end of the table.
struct Driven {
    end: Box<dyn cellwire_links::end::End>,
    names: table::Names,
}

impl End for Driven {
    fn step(&mut self, now: Duration, input: &Do, omits: Omits) -> Result<Step> {
        let (end, mut step) = (&mut *self.end, Step::default());
        match input {
            Do::Connected => end.handle_connected(now),
            Do::Disconnected => end.handle_disconnected(now),
            Do::Input(bytes) => end.handle_input(now, bytes),
            Do::Timeout => end.handle_timeout(now),
            Do::Transmitted => end.handle_transmitted(now),
            Do::Nothing => {}
            Do::Call { name, argument } => {
                step.refused = end.call(now, name, argument)?.err().map(|json| json::spaced(&json));
            }
        }
        let mut buffer = vec![0; end.max_transmit()];
        loop {
            let mut idle = true;
            while !omits.events
                && let Some(event) = end.poll_event()
            {
                step.events.push(json::spaced(&event));
                idle = false;
            }
            while !omits.transmit
                && let Some(length) = end.poll_transmit(now, &mut buffer)
            {
                step.transmit.push(buffer.get(..length).unwrap_or_default().to_vec());
                idle = false;
            }
            if idle {
                break;
            }
        }
        step.cells = (self.names.cells)(end);
        Ok(step)
    }

    fn deadline(&self) -> Option<Duration> {
        self.end.poll_timeout()
    }

    fn state(&self) -> String {
        (self.names.state)(&*self.end)
    }
}

/// An end of a link by its name.
pub(crate) fn ends(link: &str, end: &str) -> Result<Maker> {
    Ok(match (link, end) {
        ("kawasaki-msg", "pc") => kawasaki_pc::MAKER,
        ("kawasaki-msg", "robot") => kawasaki_robot::MAKER,
        _ => bail!("no stories drive the {end} of {link}"),
    })
}

/// The cell of a table.
fn cell<R: Rows>(
    machine: &R::Machine,
    at: Duration,
    input: &<R::Machine as robot_session::Machine>::Input,
) -> Vec<String> {
    let column = R::column_at(machine, at, input);
    if column.is_empty() { Vec::new() } else { vec![format!("{}: {column}", R::row(machine, at))] }
}

/// What a machine was given, with the time and its state.
type Moves<M> = Option<Vec<(Duration, M, <M as robot_session::Machine>::Input)>>;

/// The cells that were reached since it was asked last.
fn reached<M: robot_session::Machine>(
    moves: &mut Moves<M>,
    cells: impl Fn(&M, Duration, &M::Input) -> Vec<String>,
) -> Vec<String> {
    let moves = moves.replace(Vec::new()).unwrap_or_default();
    moves.into_iter().flat_map(|(at, machine, input)| cells(&machine, at, &input)).collect()
}

/// The rule of a number.
fn without<R: Rule>(rule: Option<usize>) -> Rules<R> {
    rule.and_then(|rule| R::ALL.get(rule)).map_or(Rules::ALL, |rule| Rules::without(*rule))
}

fn event(name: &str) -> Object {
    Object::new().raw("event", format_args!("\"{name}\""))
}

/// An error object without fields.
fn kind(name: &str) -> String {
    Object::new().raw("kind", format_args!("\"{name}\"")).end()
}

fn show(value: &impl serde::Serialize) -> String {
    json::text(value).unwrap_or_else(|error| format!("\"{error}\""))
}

/// The fields of a configuration that a story sets.
struct Fields(Map<String, Value>);

impl Fields {
    fn take<T: DeserializeOwned>(&mut self, name: &str, field: &mut T) -> Result<()> {
        if let Some(value) = self.0.remove(name) {
            *field = serde_json::from_value(value)?;
        }
        Ok(())
    }

    /// A time in nanoseconds; `null` is for ever.
    fn time(&mut self, name: &str, field: &mut Duration) -> Result<()> {
        if let Some(value) = self.0.remove(name) {
            let nanoseconds: Option<u64> = serde_json::from_value(value)?;
            *field = nanoseconds.map_or(Duration::MAX, Duration::from_nanos);
        }
        Ok(())
    }

    fn end(self) -> Result<()> {
        match self.0.keys().next() {
            Some(name) => bail!("the configuration has no field {name}"),
            None => Ok(()),
        }
    }
}
