//! What both ends of the Kawasaki link share: the plant as data, and jobs of its layout.

use core::ops::ControlFlow;
use core::time::Duration;
use std::rc::Rc;

use anyhow::{Context, Result, bail, ensure};
use kawasaki_msg::{
    Charset, DecodeError, Dialect, Entry, Field, Fields, MessageError, Role, SessionError, Text, Unfit, Work,
};
use robot_session::{Output, Session, settle};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::{Omits, Step, event, kind, show};
use crate::json::{self, Object};

/// The most fields of a job.
const FIELDS: usize = 8;

/// The most characters of a text in a job.
const TEXT: usize = 8;

/// The fields of a job in the order of the wire.
#[derive(Debug, Clone)]
pub(super) struct Layout(Rc<[JobField]>);

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct JobField {
    name: String,
    /// Decimals of a number.
    #[serde(default)]
    places: u8,
    /// Of a number, in units of its last decimal.
    #[serde(default = "widest")]
    range: [i32; 2],
    /// Of a text; without it the field is a number.
    length: Option<[usize; 2]>,
}

fn widest() -> [i32; 2] {
    [-9_999_999, 9_999_999]
}

/// The line of a drawing.
impl Default for Layout {
    fn default() -> Self {
        let number = |name: &str, range| JobField { name: name.into(), places: 0, range, length: None };
        let coordinates = ["x1", "y1", "x2", "y2"].map(|name| number(name, widest()));
        Self([number("kind", [1, 2])].into_iter().chain(coordinates).collect())
    }
}

/// A job of any layout: each field is in its place in one of the lists.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct AnyWork {
    numbers: [i32; FIELDS],
    texts: [Text<TEXT>; FIELDS],
}

impl Work for AnyWork {
    type Ranges = Layout;

    fn fields<F: Fields>(&mut self, layout: &Layout, fields: &mut F) -> Result<(), Unfit> {
        let places = self.numbers.iter_mut().zip(&mut self.texts);
        for (JobField { name, places, range: [min, max], length }, (number, text)) in
            layout.0.iter().zip(places)
        {
            match length {
                None => fields.decimal(name, number, *places, *min..=*max)?,
                Some([least, most]) => fields.text(name, text, *least..=*most)?,
            }
        }
        Ok(())
    }
}

impl Layout {
    /// A job as an object of its fields.
    pub(super) fn show(&self, work: &AnyWork) -> Result<String> {
        let mut object = Object::new();
        for (field, (number, text)) in self.0.iter().zip(work.numbers.iter().zip(&work.texts)) {
            object = match field.length {
                None => object.raw(&field.name, number),
                Some(_) => object.value(&field.name, &text.to_string())?,
            };
        }
        Ok(object.end())
    }

    /// The jobs of a list of objects.
    pub(super) fn read(&self, jobs: &Value) -> Result<Vec<AnyWork>> {
        jobs.as_array().context("jobs are a list")?.iter().map(|job| self.read_one(job)).collect()
    }

    fn read_one(&self, job: &Value) -> Result<AnyWork> {
        let mut work = AnyWork::default();
        let given = job.as_object().context("a job is an object")?;
        ensure!(given.len() == self.0.len(), "{job} has not the fields of the layout");
        for (field, (number, text)) in self.0.iter().zip(work.numbers.iter_mut().zip(&mut work.texts)) {
            let value = given.get(&field.name).with_context(|| format!("{job} has no {}", field.name))?;
            match field.length {
                None => *number = serde_json::from_value(value.clone())?,
                Some(_) => {
                    let given = value.as_str().with_context(|| format!("{value} is no text"))?;
                    *text = Text::new(given).with_context(|| format!("{given} cannot be in a job"))?;
                }
            }
        }
        Ok(work)
    }
}

/// What is agreed on beside the settings: `charset`, `messages` and `job` of a configuration.
pub(super) fn plant(fields: &mut super::Fields) -> Result<(Dialect<'static>, Layout)> {
    let mut charset = Charset::Ascii;
    fields.take("charset", &mut charset)?;
    let (mut messages, mut job) = (Map::new(), None::<Vec<JobField>>);
    fields.take("messages", &mut messages)?;
    fields.take("job", &mut job)?;
    let layout = match job {
        None => Layout::default(),
        Some(job) => {
            ensure!(job.len() <= FIELDS, "a job of a story has at most {FIELDS} fields");
            Layout(job.into())
        }
    };
    if messages.is_empty() {
        return Ok((Dialect::DEFAULT.with_charset(charset), layout));
    }
    let mut table = Dialect::DEFAULT.entries().to_vec();
    for (name, message) in messages {
        let role = role(&name)?;
        let place = table.iter().position(|entry| entry.role == role);
        let default = place.map(|place| table.remove(place));
        if message.is_null() {
            continue;
        }
        let Given { name, header, fields } = serde_json::from_value(message)?;
        table.push(Entry {
            role,
            name: name.leak(),
            header: fields_of(header)?,
            fields: fields_of(fields)?,
            reply: default.and_then(|entry| entry.reply),
            past_queue: default.is_none_or(|entry| entry.past_queue),
        });
    }
    // A dialect borrows its table.
    Ok((Dialect::new(table.leak())?.with_charset(charset), layout))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Given {
    name: String,
    #[serde(default)]
    header: Vec<String>,
    fields: Vec<String>,
}

fn role(name: &str) -> Result<Role> {
    if let Some(id) = name.strip_prefix("command_") {
        return Ok(Role::Command(id.parse()?));
    }
    serde_json::from_value(name.into()).with_context(|| format!("no message has the role {name}"))
}

fn fields_of(names: Vec<String>) -> Result<&'static [Field<'static>]> {
    let mut fields = Vec::new();
    for name in names {
        fields.push(match name.as_str() {
            "order" => Field::Order,
            "ended" => Field::Ended,
            "phase" => Field::Phase,
            "number" => Field::Number,
            "queued" => Field::Queued,
            "executed" => Field::Executed,
            "value" => Field::Value,
            "work" => Field::Work,
            "unused" => Field::Unused,
            constant => match constant.strip_prefix('=') {
                Some(text) => Field::Constant(text.to_owned().leak()),
                None => bail!("no field is called {name}"),
            },
        });
    }
    Ok(fields.leak())
}

/// A call that is refused.
pub(super) fn refused(error: SessionError) -> String {
    match error {
        SessionError::OrderActive { active } => kind_with("order_active", "active", active),
        SessionError::NoOrder => kind("no_order"),
        SessionError::OrderZero => kind("order_zero"),
        SessionError::NotInFlight { .. } => kind("not_in_flight"),
        SessionError::NotQueued { number } => kind_with("not_queued", "number", number),
        SessionError::UnknownCommand { id } => kind_with("unknown_command", "id", id),
        SessionError::Lacks { .. } => kind("lacks"),
        SessionError::TooManyEvents => kind("too_many_events"),
        SessionError::TooManyCommands { .. } => kind("too_many_commands"),
        _ => kind("refused"),
    }
}

fn kind_with(name: &str, key: &str, value: impl core::fmt::Display) -> String {
    Object::new().raw("kind", format_args!("\"{name}\"")).raw(key, value).end()
}

pub(super) fn corrupt(error: &DecodeError) -> String {
    event("corrupt").raw("error", show(error)).end()
}

pub(super) fn rejected(error: &MessageError) -> String {
    event("rejected").raw("error", show(error)).end()
}

/// An event whose fields are those of its type.
pub(super) fn plain(event: &impl serde::Serialize) -> Result<String> {
    json::text(event)
}

/// Takes what a session reports and sends.
pub(super) fn outputs<S: Session>(
    session: &mut S,
    now: Duration,
    omits: Omits,
    step: &mut Step,
    shown: fn(&S::Event) -> Result<String>,
) -> Result<()> {
    ensure!(!omits.events, "stories of this link take every event");
    if omits.transmit {
        while let Some(happened) = session.poll_event() {
            step.events.push(shown(&happened)?);
        }
        return Ok(());
    }
    let mut buffer = vec![0; S::MAX_TRANSMIT];
    let settled = settle(session, now, &mut buffer, |_, output| {
        match output {
            Output::Transmit(bytes) => step.transmit.push(bytes.to_vec()),
            Output::Event(happened) => match shown(&happened) {
                Ok(shown) => step.events.push(shown),
                Err(error) => return ControlFlow::Break(error),
            },
        }
        ControlFlow::Continue(())
    });
    match settled {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(error) => Err(error),
    }
}
