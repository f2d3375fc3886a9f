//! Every end of the table, with the configurations, calls and bytes of its stories.

use core::time::Duration;

use arbitrary::Arbitrary;
use cellwire_links::Link;
use cellwire_links::end::{Act, EndRow, Make, PairedItem};
use cellwire_links::vectors::unhex;
use robot_session::contract::{Observed, Subject};
use serde_json::{Map, Value, json};

use super::Change;
use super::open::OpenItems;
use super::tabled::Tabled;
use crate::reference;

/// The part of a story with the inputs and calls that an end accepts.
#[derive(Debug)]
pub struct Story {
    /// The configuration.
    pub config: Map<String, Value>,
    /// Bytes that the other end may send.
    pub inputs: Vec<Vec<u8>>,
    /// The calls of the user, with their arguments.
    pub calls: Vec<(String, Value)>,
}

/// An input or a call of a story, by its number. Four of five are of the story of the session, the others of any story.
#[derive(Debug, Clone, Copy, Arbitrary)]
pub struct Piece(u16);

/// A call of a story, with changes of its argument.
#[derive(Debug, Clone, Arbitrary)]
pub struct Call {
    piece: Piece,
    changes: Vec<Change>,
}

/// An end, and the acts on it.
#[derive(Debug)]
pub struct TestedEnd {
    /// The name of the end.
    pub name: String,
    /// The constructor of the end.
    pub make: Make,
    /// The items that the end begins and ends.
    pub once: &'static [PairedItem],
    /// The stories of the end; at least one.
    pub stories: Vec<Story>,
    /// The fields of its configuration that are times, those that limit others last.
    pub times: Vec<String>,
}

impl TestedEnd {
    /// Creates an end of the table.
    ///
    /// # Panics
    /// If it has a call that no story has.
    pub fn of(link: &Link, row: &EndRow) -> Self {
        let all = reference(&format!("sessions/{}.json", link.name));
        let stories: Vec<Story> =
            list(&all["stories"]).iter().filter(|story| story["end"] == row.name).map(story).collect();
        for call in (row.calls)() {
            let is_known = stories.iter().flat_map(|story| &story.calls).any(|(name, _)| name == call);
            assert!(is_known, "{} {}: no story has the call {call}", link.name, row.name);
        }
        let config = format!("{}{}Config", row.name[..1].to_uppercase(), &row.name[1..]);
        let defaults = reference("defaults.json");
        let times = list(&defaults["fields"])
            .iter()
            .filter(|field| field["link"] == link.name && field["config"] == config.as_str())
            .filter(|field| field["unit"] == "ns" || field["unit"] == "cycles of 28 ms")
            .map(|field| field["field"].as_str().unwrap().to_owned());
        Self {
            name: format!("{} {}", link.name, row.name),
            make: row.make,
            once: row.once,
            stories,
            times: times.collect(),
        }
    }

    /// Returns the configuration with every time unlimited that can be, the longest of those that limit one another first.
    fn endless(&self, config: &Map<String, Value>) -> Map<String, Value> {
        let mut endless = config.clone();
        for time in self.times.iter().rev() {
            // For a gap, `null` means that there is no gap, so use the largest number.
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

    /// Returns the input or call of a piece; `None` if the stories have none of this kind.
    fn pick<T>(&self, Piece(number): Piece, story: usize, of: fn(&Story) -> &[T]) -> Option<&T> {
        let (own, number) = (of(&self.stories[story]), usize::from(number));
        if !own.is_empty() && !number.is_multiple_of(5) {
            return own.get(number / 5 % own.len());
        }
        let count = self.stories.iter().map(|story| of(story).len()).sum();
        self.stories.iter().flat_map(of).nth((number / 5).checked_rem(count)?)
    }
}

impl Subject for TestedEnd {
    type Session = Tabled;
    type Input = Piece;
    type Call = Call;

    fn name(&self) -> &str {
        &self.name
    }

    fn configurations(&self) -> usize {
        self.stories.len()
    }

    fn session(&self, story: usize, is_endless: bool) -> Tabled {
        let config = &self.stories[story].config;
        let endless = is_endless.then(|| self.endless(config));
        Tabled((self.make)(endless.as_ref().unwrap_or(config), None).unwrap())
    }

    fn input(&self, end: &Tabled, story: usize, piece: &Piece) -> Vec<u8> {
        let mut bytes = self.pick(*piece, story, |story| &story.inputs).unwrap().clone();
        bytes.truncate(end.0.max_input());
        bytes
    }

    fn call(&self, end: &mut Tabled, story: usize, now: Duration, call: &Call) -> Option<String> {
        let (name, argument) = self.pick(call.piece, story, |story| &story.calls)?;
        let mut argument = argument.clone();
        call.changes.iter().for_each(|change| change.apply(&mut argument));
        // A call that the state does not allow is refused, and has no effect.
        let result = end.0.call(now, name, &argument).ok();
        Some(format!("{name}: {result:?}"))
    }

    fn event(&self, event: &String) -> Option<String> {
        // An `out_of_step` event that holds until more bytes arrive depends on how the input is split.
        (!event.starts_with(r#"{"event":"out_of_step""#)).then(|| event.clone())
    }

    fn may_be_cut(&self, story: usize, bytes: &[u8]) -> bool {
        // A packet of Kawasaki's ends where a read ends outside of a message: one message may be cut anywhere, several not
        // between them.
        let is_one =
            matches!(bytes, [b'<', within @ .., b'>'] if !within.iter().any(|byte| b"<>".contains(byte)));
        let is_datagram = self.stories[story].config.get("datagrams") == Some(&json!(true));
        !is_datagram && (is_one || !self.name.starts_with("kawasaki"))
    }

    fn dropped_notices(&self, dropped: &u64) -> u64 {
        *dropped
    }

    fn watch(&self) -> impl FnMut(Observed<'_, String>) {
        let mut open = OpenItems::new(self.once);
        move |happened| match happened {
            Observed::Connection => open.note(Act::Connection, 1),
            Observed::Byte(byte) => open.note(Act::Byte(byte), 1),
            Observed::Sent(_) => open.note(Act::Sent, 1),
            Observed::Called(call) => {
                if let Some(name) = call.strip_suffix(": Some(Ok(()))") {
                    open.note(Act::Call(name), 1);
                }
            }
            Observed::Event(event) => {
                let object: Value = serde_json::from_str(event).unwrap();
                let times = object["count"].as_u64().unwrap_or(1);
                open.note(Act::Event(object["event"].as_str().unwrap()), times);
            }
        }
    }
}

fn story(story: &Value) -> Story {
    let config = story["config"].as_object().unwrap().clone();
    let (mut inputs, mut calls) = (Vec::new(), Vec::new());
    for step in list(&story["steps"]) {
        let (name, argument) = step["do"].as_object().unwrap().iter().next().unwrap();
        match name.as_str() {
            "connected" | "disconnected" | "timeout" | "transmitted" | "nothing" => {}
            "input" => inputs.push(unhex(argument.as_str().unwrap()).unwrap()),
            _ => calls.push((name.clone(), argument.clone())),
        }
    }
    Story { config, inputs, calls }
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}
