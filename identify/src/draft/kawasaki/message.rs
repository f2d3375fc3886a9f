//! The messages of a draft as tables that every command accepts.

use core::fmt::Write as _;

use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::settings::{self, RefusedSetting};
use serde_json::{Map, Value, json};

use super::super::toml_text;
use super::{Guess, Line, UsedNames};

/// The roles that a plant may lack.
const OPTIONAL: [&str; 3] = ["job_ack", "pause", "order_interrupt"];

/// The table of a message.
#[derive(Clone)]
pub(super) struct Message {
    role: &'static str,
    /// The remark on the name; `None` where the capture has no such message.
    found: Option<String>,
    name: String,
    sent: bool,
    header: Line,
    fields: Line,
    /// The fields that no such message can lack, and that were not recognized in the capture.
    added: Vec<String>,
}

/// Returns the tables of the messages, after changes to those that a plant cannot have.
pub(super) fn accepted(guesses: &[Guess<'_>], fields: &UsedNames<'_>, charset: &str) -> Vec<Message> {
    let mut messages: Vec<Message> = guesses.iter().map(Message::new).collect();
    let plant = settings::list(Plant::default());
    let known = |role: &str| -> Vec<String> {
        let name = format!("messages.{role}.fields");
        let value = plant.iter().find(|setting| setting.name == name).map(|it| it.default.clone());
        value.and_then(|value| serde_json::from_value(value).ok()).unwrap_or_default()
    };
    for message in &mut messages {
        message.keep_only(&known(message.role));
        if message.found.is_none() {
            message.name = unused_name(message.role, fields);
            message.fields.fields = known(message.role);
        }
    }
    while let Some(role) = refused_role(&messages, charset) {
        let Some(at) = messages.iter().position(|it| it.role == role) else { break };
        let Some(message) = messages.get(at) else { break };
        let lacking: Vec<String> = known(&role).into_iter().filter(|it| !message.has(it)).collect();
        let with = |field: &String| {
            let mut changed = messages.clone();
            changed.get_mut(at)?.add(field);
            Some(changed)
        };
        let is_enough = |changed: &Vec<Message>| refused_role(changed, charset).as_ref() != Some(&role);
        let Some(changed) =
            lacking.iter().filter_map(with).find(is_enough).or_else(|| with(lacking.first()?))
        else {
            // Another message has its name.
            let name = unused_name(&role, fields);
            match messages.get_mut(at).filter(|it| it.name != name) {
                Some(message) => (message.name, message.found) = (name, None),
                None => break,
            }
            continue;
        };
        messages = changed;
    }
    messages
}

/// Returns a name that is not used by any message of the capture.
fn unused_name(role: &str, fields: &UsedNames<'_>) -> String {
    let mut name = role.to_owned();
    while fields.kinds.iter().any(|kind| kind.name == name) {
        name.push('_');
    }
    name
}

/// Returns the role whose message no plant can have.
fn refused_role(messages: &[Message], charset: &str) -> Option<String> {
    let tables: Map<String, Value> = messages.iter().map(|it| (it.role.to_owned(), it.value())).collect();
    let given =
        Map::from_iter([("messages".to_owned(), tables.into()), ("charset".to_owned(), charset.into())]);
    let refused = match settings::read("plant", Plant::default(), &given) {
        Err(refused) => refused,
        Ok(plant) => plant.check().err()?.downcast::<RefusedSetting>().ok()?,
    };
    Some(refused.name.split('.').nth(1)?.to_owned())
}

impl Message {
    fn new(guess: &Guess<'_>) -> Self {
        let Guess { role, kind, why, others, is_sure, header, fields } = guess;
        let doubt = if *is_sure { "" } else { "? " };
        Self {
            role,
            found: kind.map(|kind| {
                let from = if *others > 0 { " from both ends" } else { "" };
                format!("{doubt}{} of them{from}: {why}", kind.all.len() + others)
            }),
            name: kind.map_or_else(String::new, |kind| kind.name.clone()),
            sent: kind.is_some() || !OPTIONAL.contains(role),
            header: header.clone(),
            fields: fields.clone(),
            added: Vec::new(),
        }
    }

    /// Makes fields unused that such a message cannot have, or has twice.
    fn keep_only(&mut self, known: &[String]) {
        let Self { header, fields, .. } = self;
        let mut used: Vec<String> = Vec::new();
        for (line, in_header) in [(header, true), (fields, false)] {
            for field in &mut line.fields {
                if field == "unused" || field.starts_with('=') {
                    continue;
                }
                let is_valid = known.contains(field) && !(in_header && field == "work");
                if is_valid && !used.contains(field) {
                    used.push(field.clone());
                } else {
                    "unused".clone_into(field);
                    line.is_sure = false;
                }
            }
        }
    }

    fn has(&self, field: &String) -> bool {
        self.header.fields.contains(field) || self.fields.fields.contains(field)
    }

    /// Adds a field, in the place of an unused one if there is one.
    fn add(&mut self, field: &str) {
        let Self { header, fields, added, .. } = self;
        let in_header = header.fields.iter_mut().filter(|_| field != "work");
        match fields.fields.iter_mut().chain(in_header).find(|it| *it == "unused") {
            Some(unused) => field.clone_into(unused),
            None => fields.fields.push(field.to_owned()),
        }
        fields.is_sure = false;
        added.push(field.to_owned());
    }

    fn value(&self) -> Value {
        match self.sent {
            true => json!({ "name": self.name, "header": self.header.fields, "fields": self.fields.fields }),
            false => json!({ "sent": false }),
        }
    }

    /// Returns the table as TOML.
    pub(super) fn text(&self) -> String {
        let Self { role, found, name, header, fields, added, .. } = self;
        let mut text = format!("\n[messages.{role}]\n");
        // Writing to a string cannot fail.
        let mut line = |line: core::fmt::Arguments<'_>| {
            let _ = writeln!(text, "{line}");
        };
        let Some(found) = found else {
            match self.sent {
                false if *role == "order_interrupt" => line(format_args!(
                    "sent = false # ? not in the capture; without it a PC ends an order after the queued jobs"
                )),
                false => line(format_args!("sent = false # ? not in the capture")),
                true => line(format_args!(
                    "name = {} # ? not in the capture: fill in its name, header and fields",
                    toml_text(name)
                )),
            }
            return text;
        };
        line(format_args!("name = {} # {found}", toml_text(name)));
        for (key, Line { fields, is_sure }) in [("header", header), ("fields", fields)] {
            let doubt = match is_sure {
                false if !added.is_empty() && key == "fields" => {
                    format!(" # ? not recognized, and needed: {}", added.join(", "))
                }
                false => " # ? guessed from few messages".into(),
                true => String::new(),
            };
            line(format_args!("{key} = {}{doubt}", list(fields)));
        }
        text
    }
}

fn list(fields: &[String]) -> String {
    let texts: Vec<String> = fields.iter().map(|field| toml_text(field)).collect();
    format!("[{}]", texts.join(", "))
}
