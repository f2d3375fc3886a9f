//! The ends of links that stories drive: the table's, with the names of their states and inputs in testkit's tables.

mod names;

use core::time::Duration;

use anyhow::Result;
use cellwire_links::Link;
use cellwire_links::reference::story::{self, OmittedActions, StepResult, StoryInput};
use serde_json::{Map, Value};

/// The effects of a step of a session.
#[derive(Debug, Default)]
pub(crate) struct Step {
    pub(crate) done: StepResult,
    /// The cells of the machine's matrix: `state: input`.
    pub(crate) cells: Vec<String>,
}

/// A session that a story drives.
pub(crate) struct End {
    end: Box<dyn cellwire_links::end::End>,
    names: names::Names,
}

/// Returns the rules that can be disabled in the machine of an end, by number.
pub(crate) fn rules(link: &str, name: &str) -> Result<Vec<String>> {
    Ok((Link::by_name(link)?.end(name)?.rules)())
}

impl End {
    /// Creates an end with the fields of a configuration, and without the rule with a number.
    pub(crate) fn new(
        link: &str,
        name: &str,
        config: &Map<String, Value>,
        left_out: Option<usize>,
    ) -> Result<Self> {
        let mut end = (Link::by_name(link)?.end(name)?.make)(config, left_out)?;
        let names = names::names(link, name, config);
        (names.cells)(&mut *end);
        Ok(Self { end, names })
    }

    pub(crate) fn step(&mut self, now: Duration, input: &StoryInput, omits: OmittedActions) -> Result<Step> {
        let done = story::step(&mut *self.end, now, input, omits)?;
        Ok(Step { done, cells: (self.names.cells)(&mut *self.end) })
    }

    pub(crate) fn deadline(&self) -> Option<Duration> {
        self.end.poll_timeout()
    }

    pub(crate) fn state(&self) -> String {
        (self.names.state)(&*self.end)
    }
}
