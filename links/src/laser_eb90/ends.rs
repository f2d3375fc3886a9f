//! Both ends; the controller with the motion task at the other end of its queue.

use core::borrow::{Borrow, BorrowMut};

use anyhow::{Context, Result};
use laser_eb90::{
    Controller, ControllerConfig, ControllerEvent, EncodeError, Host, HostConfig, HostEvent, Instruction,
    Item, Payload, Refusal, controller, host,
};
use robot_session::end::Rules;
use robot_work_queue::Reader;
use serde::Deserialize as _;
use serde_json::Value;

use crate::end::{Act, Call, EndRow, Owner, PairedItem, PendingLimit, called, done};
use crate::given::GivenFields;
use crate::json;

pub(super) const ENDS: &[EndRow] = &[EndRow::of::<Host>(), EndRow::of::<Robot>()];

/// The default capacity of the queue.
const QUEUE: usize = 8;
const MAX_NUMBER: u16 = 9999;

/// The outcomes of instructions; a withdrawn instruction has no outcome.
const OUTCOMES: &[Act<'static>] =
    &[Act::Event("done"), Act::Event("answer"), Act::Event("refused"), Act::Event("unknown")];

impl Owner for Host {
    type End = Self;
    type Rule = host::Rule;

    const CALLS: &'static [Call<Self>] = &[
        ("submit", |host, _, argument| {
            let word = u16::deserialize(argument.get("word").context("submit has a word")?)?;
            called(host.submit(word, |payload| write(payload, argument.get("parameters"))))
        }),
        ("take_back", |host, _, _| done(host.take_back())),
        ("resume", |host, _, _| done(host.resume())),
    ];

    const PAIRED: &'static [PairedItem] = &[
        PairedItem { begins: Act::Call("submit"), ends: OUTCOMES, room: PendingLimit::Most(u64::MAX) },
        PairedItem { begins: Act::Sent, ends: OUTCOMES, room: PendingLimit::Merged },
    ];

    fn new(given: GivenFields, rules: Rules<host::Rule>) -> Result<Self> {
        let baud = given.0.get("baud").map(u32::deserialize).transpose()?;
        let made = HostConfig::at_baud(baud.unwrap_or(laser_eb90::timing::BAUD));
        let made = given.configure(made.with_rules(rules))?;
        Ok(Self::new(made)?)
    }

    fn shows(&self, event: &HostEvent) -> Option<(&'static str, String)> {
        matches!(event, HostEvent::Answer { .. }).then(|| ("items", json::text(&self.answer())))
    }
}

/// The controller, and the motion task.
struct Robot {
    controller: Controller<'static, Job>,
    motion: Reader<'static, Job>,
    taken: Vec<Job>,
}

/// An instruction for the motion task. Its parameters contain no characters.
struct Job {
    word: u16,
    /// As JSON.
    parameters: String,
}

impl Owner for Robot {
    type End = Controller<'static, Job>;
    type Rule = controller::Rule;

    const CALLS: &'static [Call<Self>] = &[
        ("answer", |robot, now, items| {
            called(robot.controller.answer(now, |payload| write(payload, Some(items))))
        }),
        ("refuse", |robot, now, refusal| {
            called(robot.controller.refuse(now, Refusal::deserialize(refusal)?))
        }),
        ("take", |robot, _, count| {
            for _ in 0..u8::deserialize(count)? {
                robot.taken.extend(robot.motion.take().map(|taken| taken.complete()));
            }
            done(())
        }),
    ];

    const PAIRED: &'static [PairedItem] = &[PairedItem {
        begins: Act::Event("execute"),
        ends: &[Act::Call("answer"), Act::Call("refuse")],
        room: PendingLimit::Silent,
    }];

    fn new(mut given: GivenFields, rules: Rules<controller::Rule>) -> Result<Self> {
        let room = given.take("queue")?.unwrap_or(QUEUE);
        let made = given.configure(ControllerConfig::default().with_rules(rules))?;
        let (writer, motion) = robot_work_queue::boxed(room, MAX_NUMBER)?;
        Ok(Self { controller: Controller::new(made, writer)?, motion, taken: Vec::new() })
    }

    fn shows(&self, event: &ControllerEvent) -> Option<(&'static str, String)> {
        let ControllerEvent::Execute { .. } = event else { return None };
        self.controller.instruction().map(|instruction| ("parameters", json::text(&instruction.parameters)))
    }

    fn beside(&mut self) -> Option<String> {
        if self.taken.is_empty() {
            return None;
        }
        let Job { word, parameters } = self.taken.remove(0);
        Some(format!(r#"{{"event":"taken","word":{word},"parameters":{parameters}}}"#))
    }
}

impl Borrow<Controller<'static, Job>> for Robot {
    fn borrow(&self) -> &Controller<'static, Job> {
        &self.controller
    }
}

impl BorrowMut<Controller<'static, Job>> for Robot {
    fn borrow_mut(&mut self) -> &mut Controller<'static, Job> {
        &mut self.controller
    }
}

impl TryFrom<Instruction<'_>> for Job {
    type Error = ();

    fn try_from(instruction: Instruction<'_>) -> Result<Self, ()> {
        let Instruction { word, parameters } = instruction;
        if parameters.flatten().any(|item| matches!(item, Item::Char(_))) {
            return Err(());
        }
        Ok(Self { word, parameters: json::text(&parameters) })
    }
}

/// Writes the parameters of an instruction, as the items of a message object.
fn write(payload: &mut Payload<'_>, items: Option<&Value>) -> Result<(), EncodeError> {
    fn numbers<T: serde::de::DeserializeOwned>(values: &Value) -> Vec<T> {
        Vec::deserialize(values).unwrap_or_default()
    }
    for item in items.and_then(Value::as_array).into_iter().flatten() {
        for (tag, values) in item.as_object().into_iter().flatten() {
            match tag.as_str() {
                // JSON cannot represent infinities and NaN: they are `null`.
                "f32" => {
                    let values: Vec<Option<f32>> = numbers(values);
                    let values: Vec<f32> =
                        values.into_iter().map(|value| value.unwrap_or(f32::NAN)).collect();
                    payload.f32(&values)?
                }
                "i16" => payload.i16(&numbers::<i16>(values))?,
                "u8" => payload.u8(&numbers::<u8>(values))?,
                _ => payload.char(values.as_str().unwrap_or_default().as_bytes())?,
            };
        }
    }
    Ok(())
}
