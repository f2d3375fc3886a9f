//! Turns the inputs of an end into a story: the actions of our end, and the differences from the capture.

use std::time::Duration;

use anyhow::{Context, Result, ensure};
use cellwire_links::codec::items;
use cellwire_links::end::End;
use cellwire_links::reference::json::{Object, hex};
use cellwire_links::reference::story::{OmittedActions, StoryInput, line, step};
use serde_json::{Map, Value, json};

use super::OutArgs;
use super::message::Message;
use super::range::RangeArgs;
use crate::command::compare::{Compare, Follow};

/// Writes a story of the session at one end, from the messages that this end received, at the captured times
///
/// A capture has bytes and times, but not a program's calls of its session: give those with --call. Prints one line of JSON for
/// each message of the session that differs from the captured one, as replay does; the exit status is 1 if more than values
/// differ.
#[derive(Debug, clap::Args)]
#[command(override_usage = "\
cellwire capture to-story [OPTIONS] --as <END> --source <TEXT>
           --out <FILE> <LINK> [FILE]")]
pub(super) struct Args {
    #[command(flatten)]
    stretch: RangeArgs,
    /// The end
    #[arg(long = "as", value_name = "END")]
    end: String,
    /// The non-default fields of its configuration, as in stories: '{"resend_on_silence":true}'
    #[arg(long, value_name = "JSON", default_value = "{}", value_parser = object)]
    config: Map<String, Value>,
    /// A call of its user, with the time in seconds since the connection: '1.5={"submit":{"word":257}}'
    #[arg(long, value_name = "TIME=JSON", value_parser = call)]
    call: Vec<Call>,
    /// A description of the story
    #[arg(long, value_name = "TEXT")]
    comment: Option<String>,
    #[command(flatten)]
    out: OutArgs,
}

#[derive(Debug, Clone)]
struct Call {
    at: Duration,
    input: StoryInput,
}

fn object(text: &str) -> Result<Map<String, Value>, String> {
    serde_json::from_str(text).map_err(|error| format!("not a JSON object: {error}"))
}

fn call(text: &str) -> Result<Call, String> {
    let (at, call) = text.split_once('=').ok_or("give TIME=JSON")?;
    let at = at.parse().ok().and_then(|at| Duration::try_from_secs_f64(at).ok());
    let at = at.ok_or("the time is not a number of seconds")?;
    let input = StoryInput::read(&object(call)?).map_err(|error| error.to_string())?;
    Ok(Call { at, input })
}

/// The maximum number of steps of a story: an end that polls makes one each time.
const MAX_STEPS: usize = 10_000;

pub(super) fn run(args: &Args) -> Result<bool> {
    let of = &args.stretch.of;
    let (conversation, messages) = args.stretch.read()?;
    let [ours, other] = conversation.ends(of.link, &args.end)?;
    let row = of.link.end(if of.link.end(&args.end).is_ok() { &args.end } else { "device" })?;
    let mut playing = StoryPlayer {
        end: (row.make)(&args.config, None).context("the configuration")?,
        now: Duration::ZERO,
        lines: Vec::new(),
        sent: Vec::new(),
    };
    playing.take(Duration::ZERO, &StoryInput::Connected)?;
    let begin = messages.first().map_or(Duration::ZERO, |first| first.at);
    let mut inputs: Vec<(Duration, StoryInput)> = messages
        .iter()
        .filter(|message| message.is_first == other.is_first)
        .map(|message| (message.at - begin, StoryInput::Input(message.bytes.clone())))
        .chain(args.call.iter().map(|call| (call.at, call.input.clone())))
        .collect();
    ensure!(!inputs.is_empty(), "`{}` received nothing in the range", args.end);
    inputs.sort_by_key(|(at, _)| *at);
    for (at, input) in &inputs {
        playing.until(*at)?;
        playing.take(*at, input)?;
    }
    let last = messages.last().map_or(Duration::ZERO, |last| last.at - begin);
    playing.until(last + Duration::from_nanos(1))?;

    let seen: Vec<&Message> = messages.iter().filter(|message| message.is_first == ours.is_first).collect();
    let is_same = compare(args, ours.side, &playing.sent, &seen)?;
    let comment = args.comment.clone().unwrap_or_else(|| {
        let numbers = [messages.first(), messages.last()].map(|it| it.map_or(0, |it| it.number));
        format!("What was sent to the end in messages {} to {} of a capture", numbers[0], numbers[1])
    });
    let story = Object::new()
        .raw("id", 1)
        .value("comment", &comment)?
        .value("end", row.name)?
        .value("config", &args.config)?
        .raw("clauses", "[]")
        .raw("covers", "[]")
        .raw("needs", "[]")
        .raw("steps", format_args!("[\n      {}\n    ]", playing.lines.join(",\n      ")));
    args.out.write(of.link.name, &[("stories", vec![story.end()])])?;
    Ok(is_same)
}

struct StoryPlayer {
    end: Box<dyn End>,
    now: Duration,
    lines: Vec<String>,
    /// The bytes that our end sent.
    sent: Vec<(Duration, Vec<u8>)>,
}

impl StoryPlayer {
    fn take(&mut self, at: Duration, input: &StoryInput) -> Result<()> {
        ensure!(
            self.lines.len() < MAX_STEPS,
            "the story has more than {MAX_STEPS} steps: choose a shorter range"
        );
        self.now = self.now.max(at);
        let done = step(&mut *self.end, self.now, input, OmittedActions::default())?;
        let (deadline, state) = (self.end.poll_timeout(), self.end.state());
        self.lines.push(line(self.now, input, OmittedActions::default(), &done, deadline, state)?);
        self.sent.extend(done.transmit.into_iter().map(|bytes| (self.now, bytes)));
        Ok(())
    }

    /// Handles the deadlines before a time.
    fn until(&mut self, at: Duration) -> Result<()> {
        while let Some(due) = self.end.poll_timeout().filter(|due| *due < at) {
            // A deadline that is still due after its step was not possible: a second attempt has no effect.
            if due <= self.now && self.lines.last().is_some_and(|last| last.contains("\"timeout\"")) {
                return Ok(());
            }
            self.take(due, &StoryInput::Timeout)?;
        }
        Ok(())
    }
}

/// Prints the differences between the bytes that the project's end sends and the recorded ones.
fn compare(
    args: &Args,
    side: Option<&'static str>,
    ours: &[(Duration, Vec<u8>)],
    seen: &[&Message],
) -> Result<bool> {
    let of = &args.stretch.of;
    let show = |bytes: &[u8]| -> Result<Vec<Value>> {
        let Some(side) = side else { return Ok(vec![json!({"bytes": hex(bytes)})]) };
        let found = items(of.codec_of(side)?, &[vec![bytes]])?;
        found.iter().map(|it| Ok(it.value()?.unwrap_or_else(|error| json!({"error": error})))).collect()
    };
    let then = |message: &&Message| match &message.content {
        Ok(Value::Null) => json!({"bytes": hex(&message.bytes)}),
        Ok(content) => content.clone(),
        Err(error) => json!({"error": error}),
    };
    let mut compare = Compare::new(seen.iter().map(then).collect(), Follow::default(), true);
    for (at, bytes) in ours {
        show(bytes)?.iter().try_for_each(|message| compare.take(*at, message))?;
    }
    compare.finish("compared", &[])
}
