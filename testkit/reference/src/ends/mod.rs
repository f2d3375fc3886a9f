//! The ends of links that stories drive: the table's, with what testkit's tables call their states and inputs.

mod names;

use core::time::Duration;

use anyhow::Result;
use cellwire_links::Link;
use serde_json::{Map, Value};

use crate::json;

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
pub(crate) struct End {
    end: Box<dyn cellwire_links::end::End>,
    names: names::Names,
}

/// The rules that the machine of an end can be told to leave out, by number.
pub(crate) fn rules(link: &str, name: &str) -> Result<Vec<String>> {
    Ok((Link::by_name(link)?.end(name)?.rules)())
}

impl End {
    /// With the fields of a configuration, and without the rule of a number.
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

    pub(crate) fn step(&mut self, now: Duration, input: &Do, omits: Omits) -> Result<Step> {
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

    pub(crate) fn deadline(&self) -> Option<Duration> {
        self.end.poll_timeout()
    }

    pub(crate) fn state(&self) -> String {
        (self.names.state)(&*self.end)
    }
}
