//! Every end of the table, with the configurations, calls and bytes of its stories.

use cellwire_links::Link;
use cellwire_links::end::EndRow;
use cellwire_links::vectors::unhex;
use serde_json::Value;

use super::session::{Held, Story};
use crate::reference;

impl Held {
    /// An end of the table.
    ///
    /// # Panics
    /// When it has a call that no story has.
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
