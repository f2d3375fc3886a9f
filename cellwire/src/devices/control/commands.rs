//! The commands that every device has, and the answers.

use std::time::Duration;

use cellwire_sim::{Device, Fault, Remote, Script};
use serde::Deserialize;
use serde_json::{Value, json};

use super::args::{Args, Command, Time, one_of};
use super::{Fields, OwnCommands, fields};

/// The time within which the thread of a device begins a command.
const BEGINS_WITHIN: Duration = Duration::from_secs(2);

/// The time without power, if a restart does not have one.
const OFF: Duration = Duration::from_secs(1);

/// The most messages that one command affects, and the most entries of an answer.
const MAX_COUNT: usize = 1000;

/// The commands of every device.
const COMMON: [Command; 14] = [
    Command {
        name: "drop",
        about: "the next message is lost; `next`: number of messages (default 1), or `every`: one in so many; `of`: answer (default) or request",
        examples: &[r#"{"do":"drop","next":2}"#],
    },
    Command {
        name: "delay",
        about: "the next message comes later, by `ms` or `seconds`, and those behind it wait for it; `next`, `every` and `of` as for drop",
        examples: &[r#"{"do":"delay","ms":200}"#],
    },
    Command {
        name: "corrupt",
        about: "a bit of the next message is flipped; `next`, `every` and `of` as for drop",
        examples: &[r#"{"do":"corrupt","next":1}"#],
    },
    Command {
        name: "cut",
        about: "the connection ends in the middle of the next message; `next`, `every` and `of` as for drop; `now`: true for all connections at once",
        examples: &[r#"{"do":"cut"}"#],
    },
    Command {
        name: "close",
        about: "the connection ends before the next message; fields as for cut",
        examples: &[r#"{"do":"close","now":true}"#],
    },
    Command {
        name: "twice",
        about: "the next message is sent twice; `next`, `every` and `of` as for drop",
        examples: &[r#"{"do":"twice","every":100}"#],
    },
    Command {
        name: "freeze",
        about: "the device neither reads nor sends for `ms` or `seconds`",
        examples: &[r#"{"do":"freeze","seconds":2}"#],
    },
    Command {
        name: "restart",
        about: "the device loses power, and is back after `ms` or `seconds` (default 1 s)",
        examples: &[r#"{"do":"restart"}"#],
    },
    Command {
        name: "forget",
        about: "the device loses what it holds and has not executed; the connection stays",
        examples: &[r#"{"do":"forget"}"#],
    },
    Command {
        name: "clear",
        about: "faults that have not happened are withdrawn, those of settings too",
        examples: &[r#"{"do":"clear"}"#],
    },
    Command {
        name: "happened",
        about: "the last `most` faults (default 100), oldest first, in seconds since the start",
        examples: &[r#"{"do":"happened"}"#],
    },
    Command {
        name: "executed",
        about: "the executed commands from index `from` (default 0) on, `most` of them (default 100), in seconds since the start",
        examples: &[r#"{"do":"executed","from":0,"most":10}"#],
    },
    Command {
        name: "counts",
        about: "the numbers of requests, answers, executed commands and faults",
        examples: &[r#"{"do":"counts"}"#],
    },
    Command {
        name: "help",
        about: "the commands of this device, each with an example",
        examples: &[r#"{"do":"help"}"#],
    },
];

/// The commands to one device.
pub(super) struct Commands<D: Device> {
    pub(super) device: &'static str,
    pub(super) remote: Remote<D>,
    pub(super) own: OwnCommands<D>,
}

/// The messages that a fault affects.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Messages {
    next: Option<usize>,
    every: Option<u64>,
    of: Option<MessageSender>,
    #[serde(default)]
    now: bool,
    ms: Option<f64>,
    seconds: Option<f64>,
}

/// The sender of a message.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "snake_case")]
enum MessageSender {
    Answer,
    Request,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ListRange {
    #[serde(default)]
    from: u64,
    most: Option<usize>,
}

impl<D: Device + 'static> Commands<D> {
    /// Executes the command of a line; returns the answer.
    pub(super) fn answer(&self, line: &[u8]) -> Value {
        let (id, args) = Args::parse(line);
        let mut answer: Fields = id.into_iter().map(|id| ("id".into(), id)).collect();
        match args.and_then(|args| self.execute(args)) {
            Ok(fields) => {
                answer.insert("ok".into(), true.into());
                answer.extend(fields);
            }
            Err(error) => {
                answer.insert("ok".into(), false.into());
                answer.insert("error".into(), error.into());
            }
        }
        Value::Object(answer)
    }

    fn execute(&self, args: Args) -> Result<Fields, String> {
        let name = args.name.clone();
        let mut names = self.all().map(|command| command.name);
        if !names.any(|known| known == name) {
            let names: Vec<&str> = self.all().map(|command| command.name).collect();
            return Err(format!("unknown command `{name}`; {} has {}", self.device, one_of(&names)));
        }
        self.dispatch(args).map_err(|error| format!("{name}: {error}"))
    }

    fn dispatch(&self, args: Args) -> Result<Fields, String> {
        match args.name.as_str() {
            "drop" | "delay" | "corrupt" | "cut" | "close" | "twice" => self.message(args),
            "freeze" => self.at_once(Fault::Freeze(args.read::<Time>()?.required()?)),
            "restart" => self.at_once(Fault::Restart(args.read::<Time>()?.read()?.unwrap_or(OFF))),
            "forget" => args.none().and_then(|()| self.at_once(Fault::Forget)),
            "clear" => {
                args.none()?;
                self.remote.faults().clear();
                Ok(Fields::new())
            }
            "happened" => self.happened(args),
            "executed" => self.executed(args),
            "counts" => {
                args.none()?;
                let faults = self.remote.faults();
                let (requests, answers) = faults.messages();
                let (executed, _) = self.remote.executed(0, 0);
                let faults = faults.happened().len();
                Ok(fields([
                    ("requests", requests.into()),
                    ("answers", answers.into()),
                    ("executed", executed.into()),
                    ("faults", faults.into()),
                ]))
            }
            "help" => {
                args.none()?;
                let commands = self.all().map(|Command { name, about, examples }| {
                    let examples: Vec<Value> =
                        examples.iter().filter_map(|text| serde_json::from_str(text).ok()).collect();
                    json!({"do": name, "about": about, "examples": examples})
                });
                Ok(fields([("device", self.device.into()), ("commands", commands.collect())]))
            }
            _ => {
                let execute = self.own.execute;
                let called =
                    self.remote.call(BEGINS_WITHIN, move |device| execute(device.device_mut(), args));
                called.ok_or("the device is busy, and did not begin the command within 2 s; try again")?
            }
        }
    }

    /// Adds a fault of messages.
    fn message(&self, args: Args) -> Result<Fields, String> {
        let name = args.name.clone();
        let Messages { next, every, of, now, ms, seconds } = args.read()?;
        let time = Time::new(ms, seconds);
        let fault = match name.as_str() {
            "delay" => Fault::Delay(time.required()?),
            _ if ms.is_some() || seconds.is_some() => {
                return Err(
                    "unknown field `ms` or `seconds`; only delay, freeze and restart have a time".into()
                );
            }
            "drop" => Fault::Drop,
            "corrupt" => Fault::Corrupt,
            "cut" => Fault::Cut,
            "close" => Fault::Close,
            _ => Fault::Twice,
        };
        let faults = self.remote.faults();
        match (next, every) {
            _ if now && !matches!(fault, Fault::Cut | Fault::Close) => {
                return Err("only cut and close have `now`".into());
            }
            (None, None) if now && of.is_none() => return self.at_once(fault),
            _ if now => return Err("with `now`, there is no `next`, `every` or `of`".into()),
            (Some(_), Some(_)) => return Err("give `next` or `every`, not both".into()),
            (_, Some(every @ 1..)) => faults.follow(match of.unwrap_or(MessageSender::Answer) {
                MessageSender::Answer => Script::new().every_answer(every, fault),
                MessageSender::Request => Script::new().every_request(every, fault),
            }),
            (_, Some(0)) => return Err("`every` is 1 or more".into()),
            (next, None) => {
                let next = next.unwrap_or(1);
                if !(1..=MAX_COUNT).contains(&next) {
                    return Err("`next` is 1 to 1000".into());
                }
                for _ in 0..next {
                    match of.unwrap_or(MessageSender::Answer) {
                        MessageSender::Answer => faults.next_answer(fault),
                        MessageSender::Request => faults.next_request(fault),
                    }
                }
            }
        }
        Ok(Fields::new())
    }

    /// Causes a fault, which has happened when the answer is sent.
    fn at_once(&self, fault: Fault) -> Result<Fields, String> {
        self.remote.faults().at_once(fault);
        let happened = self.remote.call(BEGINS_WITHIN, |_| ());
        happened.ok_or("the device is busy: the fault has not happened within 2 s, and happens later")?;
        Ok(Fields::new())
    }

    fn happened(&self, args: Args) -> Result<Fields, String> {
        let ListRange { from, most } = args.read()?;
        if from != 0 {
            return Err("unknown field `from`, expected `most`".into());
        }
        let (happened, most) = (self.remote.faults().happened(), number(most)?);
        let last = happened.get(happened.len().saturating_sub(most)..).unwrap_or_default();
        let last = last.iter().map(|(at, fault)| {
            let mut shown = json!({"at": at.as_secs_f64(), "fault": name_of(*fault)});
            if let Fault::Delay(time) | Fault::Freeze(time) | Fault::Restart(time) = fault
                && let Value::Object(shown) = &mut shown
            {
                shown.insert("seconds".into(), time.as_secs_f64().into());
            }
            shown
        });
        Ok(fields([("total", happened.len().into()), ("happened", last.collect())]))
    }

    fn executed(&self, args: Args) -> Result<Fields, String> {
        let ListRange { from, most } = args.read()?;
        let (total, executed) = self.remote.executed(from, number(most)?);
        let shown = executed.iter().map(|(index, done)| {
            json!({"index": index, "at": done.at.as_secs_f64(), "work": (self.own.show)(&done.work)})
        });
        Ok(fields([("total", total.into()), ("executed", shown.collect())]))
    }

    fn all(&self) -> impl Iterator<Item = &Command> {
        COMMON.iter().chain(self.own.commands)
    }
}

/// Returns the number of entries of an answer.
fn number(most: Option<usize>) -> Result<usize, String> {
    Some(most.unwrap_or(100)).filter(|most| *most <= MAX_COUNT).ok_or_else(|| "`most` is 0 to 1000".into())
}

fn name_of(fault: Fault) -> &'static str {
    match fault {
        Fault::Drop => "drop",
        Fault::Delay(_) => "delay",
        Fault::Corrupt => "corrupt",
        Fault::Cut => "cut",
        Fault::Close => "close",
        Fault::Twice => "twice",
        Fault::Freeze(_) => "freeze",
        Fault::Restart(_) => "restart",
        Fault::Forget => "forget",
        _ => "unknown",
    }
}
