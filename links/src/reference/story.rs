//! The steps of a session's story.

use core::time::Duration;

use anyhow::{Context, Result, ensure};
use serde::Deserialize;
use serde_json::{Map, Number, Value};

use super::json::{self, Object};
use crate::end::End;
use crate::link::Link;
use crate::vectors::unhex;

/// An input of a session.
#[derive(Debug, Clone, PartialEq)]
pub enum StoryInput {
    /// The caller has made a connection.
    Connected,
    /// The caller reports that the connection is lost.
    Disconnected,
    /// The caller has read these bytes.
    Input(Vec<u8>),
    /// The caller reports that a deadline has passed.
    Timeout,
    /// The last byte has left the port.
    Transmitted,
    /// The end is only polled.
    Nothing,
    /// A call of the end's user.
    Call {
        /// The name of the call.
        name: String,
        /// The argument of the call, or null.
        argument: Value,
    },
}

impl StoryInput {
    /// Returns the input as a step has it: an object with one key.
    pub fn json(&self) -> String {
        match self {
            Self::Connected => r#"{"connected": true}"#.into(),
            Self::Disconnected => r#"{"disconnected": true}"#.into(),
            Self::Timeout => r#"{"timeout": true}"#.into(),
            Self::Transmitted => r#"{"transmitted": true}"#.into(),
            Self::Nothing => r#"{"nothing": true}"#.into(),
            Self::Input(bytes) => format!("{{\"input\": \"{}\"}}", json::hex(bytes)),
            Self::Call { name, argument } => {
                Object::new().raw(name, json::spaced(&argument.to_string())).end()
            }
        }
    }

    /// Reads the input of a step.
    ///
    /// # Errors
    /// If it is not an input.
    pub fn read(step: &Map<String, Value>) -> Result<Self> {
        let (name, argument) = step.iter().next().context("a step does something")?;
        Ok(match name.as_str() {
            "connected" => Self::Connected,
            "disconnected" => Self::Disconnected,
            "timeout" => Self::Timeout,
            "transmitted" => Self::Transmitted,
            "nothing" => Self::Nothing,
            "input" => Self::Input(unhex(argument.as_str().context("input is hex")?)?),
            _ => Self::Call { name: name.clone(), argument: argument.clone() },
        })
    }
}

/// The driver's actions that a step omits.
#[derive(Debug, Clone, Copy, Default)]
pub struct OmittedActions {
    /// Whether it does not poll for bytes to transmit: `hold`.
    pub transmit: bool,
    /// Whether it takes no event: `keep`.
    pub events: bool,
}

/// The result of a step.
#[derive(Debug, Default)]
pub struct StepResult {
    /// The refusal of a call, as JSON; `None` if no call was refused.
    pub refused: Option<String>,
    /// The events that were polled, as JSON.
    pub events: Vec<String>,
    /// The bytes that the session sent.
    pub transmit: Vec<Vec<u8>>,
}

/// Does a step.
///
/// # Errors
/// If the end has no such call.
pub fn step(
    end: &mut dyn End,
    now: Duration,
    input: &StoryInput,
    omits: OmittedActions,
) -> Result<StepResult> {
    let mut done = StepResult::default();
    match input {
        StoryInput::Connected => end.handle_connected(now),
        StoryInput::Disconnected => end.handle_disconnected(now),
        StoryInput::Input(bytes) => end.handle_input(now, bytes),
        StoryInput::Timeout => end.handle_timeout(now),
        StoryInput::Transmitted => end.handle_transmitted(now),
        StoryInput::Nothing => {}
        StoryInput::Call { name, argument } => {
            done.refused = end.call(now, name, argument)?.err().map(|json| json::spaced(&json));
        }
    }
    let mut buffer = vec![0; end.max_transmit()];
    loop {
        let mut idle = true;
        while !omits.events
            && let Some(event) = end.poll_event()
        {
            done.events.push(json::spaced(&event));
            idle = false;
        }
        while !omits.transmit
            && let Some(length) = end.poll_transmit(now, &mut buffer)
        {
            done.transmit.push(buffer.get(..length).unwrap_or_default().to_vec());
            idle = false;
        }
        if idle {
            return Ok(done);
        }
    }
}

/// Returns a step as a line of a story; `state` is a name for readers.
///
/// # Errors
/// Never: everything in the line can be written as JSON.
pub fn line(
    now: Duration,
    input: &StoryInput,
    omits: OmittedActions,
    done: &StepResult,
    deadline: Option<Duration>,
    state: &str,
) -> Result<String> {
    let transmit: Vec<String> =
        done.transmit.iter().map(|bytes| format!("\"{}\"", json::hex(bytes))).collect();
    let object = Object::new().raw("at", now.as_nanos()).raw("do", input.json());
    let object = if omits.transmit { object.raw("hold", true) } else { object };
    let object = if omits.events { object.raw("keep", true) } else { object };
    let object = if let Some(refused) = &done.refused { object.raw("refused", refused) } else { object };
    let deadline = deadline.map_or("null".to_owned(), |deadline| deadline.as_nanos().to_string());
    let object = object.list("events", &done.events).list("transmit", &transmit).raw("deadline", deadline);
    Ok(object.value("state", state)?.end())
}

/// A story of a file.
#[derive(Debug, Clone, Deserialize)]
pub struct Story {
    /// The number of the story.
    pub id: u32,
    /// A description of the story.
    pub comment: String,
    /// The end that it drives.
    pub end: String,
    /// The fields of its configuration that are not the defaults.
    pub config: Map<String, Value>,
    steps: Vec<Step>,
}

#[derive(Debug, Clone, Deserialize)]
struct Step {
    at: u64,
    #[serde(rename = "do")]
    input: Map<String, Value>,
    #[serde(default)]
    hold: bool,
    #[serde(default)]
    keep: bool,
    refused: Option<Value>,
    #[serde(default)]
    events: Vec<Value>,
    #[serde(default)]
    transmit: Vec<String>,
    /// One that is longer than 64 bits is never.
    deadline: Option<Number>,
}

impl Story {
    /// Checks that our end acts as the story states, step by step; does not check the name of its state.
    ///
    /// # Errors
    /// The first difference.
    pub fn check(&self, link: &Link) -> Result<()> {
        let mut end = (link.end(&self.end)?.make)(&self.config, None)?;
        for (number, step) in (1..).zip(&self.steps) {
            let now = Duration::from_nanos(step.at);
            let omits = OmittedActions { transmit: step.hold, events: step.keep };
            let done = self::step(&mut *end, now, &StoryInput::read(&step.input)?, omits)?;
            let values = |texts: &[String]| -> serde_json::Result<Vec<Value>> {
                texts.iter().map(|text| serde_json::from_str(text)).collect()
            };
            let refused = done.refused.as_deref().map(serde_json::from_str).transpose()?;
            ensure!(refused == step.refused, "step {number}: the call is refused: {refused:?}");
            let events = values(&done.events)?;
            ensure!(events == step.events, "step {number}: its events are {}", Value::from(events));
            let expected = step.transmit.iter().map(|hex| unhex(hex)).collect::<Result<Vec<_>>>()?;
            ensure!(done.transmit == expected, "step {number}: it sends {:02X?}", done.transmit);
            const NEVER: u64 = 1 << 63;
            let deadline = end.poll_timeout().map(|deadline| deadline.as_nanos());
            let expected = step.deadline.as_ref().map(|it| it.as_u64().unwrap_or(u64::MAX));
            let is_same = deadline == expected.map(u128::from)
                || deadline.is_none_or(|it| it >= NEVER.into()) && expected.is_none_or(|it| it >= NEVER);
            ensure!(is_same, "step {number}: its deadline is {deadline:?}");
        }
        Ok(())
    }
}
