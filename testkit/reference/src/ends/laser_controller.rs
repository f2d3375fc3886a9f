//! The controller of the laser, with the owner of its queue.

use core::time::Duration;

use anyhow::{Result, bail};
use laser_eb90::{Controller, ControllerConfig, ControllerEvent, Instruction, Item, Refusal, SessionError};
use robot_session::{ActionOf, CoreOf, End, EventOf, InputOf, Room, TransmitOf, Unexpected};
use robot_work_queue::Reader;
use serde_json::{Map, Value};
use testkit::links::laser_eb90::rows;
use testkit::model::Rows as _;

use super::laser_host::write;
use super::{About, Fields, Maker, Noted, event, kind, names, show, unexpected, without};

pub(super) const MAKER: Maker = Maker {
    make: |config, rule| Ok(Noted::<LaserController>::boxed(robot(config, rule)?)),
    rules: names::<laser_eb90::controller::Rule>,
};

/// The room of the queue, if a story gives none.
const QUEUE: usize = 8;
const MAX_NUMBER: u16 = 9999;

/// What the motion task takes: an instruction without characters among its parameters.
struct Job {
    word: u16,
    /// As JSON.
    parameters: String,
}

impl TryFrom<Instruction<'_>> for Job {
    type Error = ();

    fn try_from(instruction: Instruction<'_>) -> Result<Self, ()> {
        let Instruction { word, parameters } = instruction;
        if parameters.flatten().any(|item| matches!(item, Item::Char(_))) {
            return Err(());
        }
        Ok(Self { word, parameters: show(&parameters) })
    }
}

/// The controller, and the motion task at the other end of its queue.
struct Robot {
    controller: Inner,
    motion: Reader<'static, Job>,
    taken: Vec<Job>,
}

/// The session of a robot is its controller's.
type Inner = Controller<'static, Job>;

fn robot(config: &Map<String, Value>, rule: Option<usize>) -> Result<Robot> {
    let mut made = ControllerConfig::default();
    let mut fields = Fields(config.clone());
    let mut room = QUEUE;
    fields.take("queue", &mut room)?;
    fields.take("profile", &mut made.profile)?;
    fields.take("words", &mut made.words)?;
    fields.take("batch", &mut made.batch)?;
    fields.time("tick", &mut made.tick)?;
    fields.time("silence", &mut made.silence)?;
    fields.end()?;
    made.rules = without(rule);
    let (writer, motion) = robot_work_queue::boxed(room, MAX_NUMBER)?;
    Ok(Robot { controller: Controller::new(made, writer)?, motion, taken: Vec::new() })
}

impl End for Robot {
    type Machine = <Inner as End>::Machine;
    type Decoder = <Inner as End>::Decoder;
    type Events = <Inner as End>::Events;
    type Statistics = <Inner as End>::Statistics;
    type Payload = <Inner as End>::Payload;

    const MAX_INPUT: usize = <Inner as End>::MAX_INPUT;
    const MAX_TRANSMIT: usize = <Inner as End>::MAX_TRANSMIT;
    const ROOM: Room = Inner::ROOM;

    fn core(&self) -> &CoreOf<Self> {
        self.controller.core()
    }

    fn core_mut(&mut self) -> &mut CoreOf<Self> {
        self.controller.core_mut()
    }

    fn next_input(&mut self) -> Option<(InputOf<Self>, Option<Self::Payload>)> {
        self.controller.next_input()
    }

    fn act(&mut self, now: Duration, action: ActionOf<Self>, payload: Option<Self::Payload>) {
        self.controller.act(now, action, payload);
    }

    fn write(
        &mut self,
        now: Duration,
        what: TransmitOf<Self>,
        out: &mut [u8],
    ) -> Option<(usize, InputOf<Self>)> {
        self.controller.write(now, what, out)
    }

    fn unexpected(unexpected: Unexpected) -> EventOf<Self> {
        Inner::unexpected(unexpected)
    }

    fn counters(&self) -> Self::Statistics {
        self.controller.counters()
    }

    fn begin_input(&mut self, now: Duration) -> bool {
        self.controller.begin_input(now)
    }

    fn end_input(&mut self, now: Duration) {
        self.controller.end_input(now);
    }
}

struct LaserController;

impl About for LaserController {
    type End = Robot;
    type Rows = rows::Controller;

    fn call(robot: &mut Robot, now: Duration, name: &str, argument: Value) -> Result<Result<(), String>> {
        let result = match name {
            "answer" => {
                let items = argument.as_array().cloned().unwrap_or_default();
                robot.controller.answer(now, |payload| write(payload, &items))
            }
            "refuse" => robot.controller.refuse(now, refusal(&argument)?),
            "take" => {
                for _ in 0..serde_json::from_value::<u8>(argument)? {
                    robot.taken.extend(robot.motion.take().map(|taken| taken.complete()));
                }
                Ok(())
            }
            _ => bail!("a controller has no call {name}"),
        };
        Ok(result.map_err(|error| match error {
            SessionError::NotExecuting => kind("not_executing"),
            SessionError::Encode(error) => show(&error),
            _ => kind("not_a_controller's"),
        }))
    }

    fn state(robot: &Robot) -> String {
        Self::Rows::row(&robot.core().machine, Duration::ZERO)
    }

    fn event(robot: &Robot, happened: ControllerEvent) -> Result<String> {
        Ok(match happened {
            ControllerEvent::Execute { class, word } => event("execute")
                .value("class", &class)?
                .raw("word", word)
                .optional("parameters", robot.controller.instruction().map(|i| i.parameters).as_ref())?
                .end(),
            ControllerEvent::Queued { count } => event("queued").raw("count", count).end(),
            ControllerEvent::Refused(refusal) => event("refused").value("refusal", &refusal)?.end(),
            ControllerEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            ControllerEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    /// What the motion task has taken.
    fn beside(robot: &mut Robot) -> Vec<String> {
        let taken = robot.taken.drain(..);
        let show = |job: Job| event("taken").raw("word", job.word).raw("parameters", job.parameters).end();
        taken.map(show).collect()
    }
}

fn refusal(value: &Value) -> Result<Refusal> {
    Ok(match value.as_str() {
        Some("bad_checksum") => Refusal::BadChecksum,
        Some("bad_frame") => Refusal::BadFrame,
        Some("unknown_command") => Refusal::UnknownCommand,
        Some("bad_batch") => Refusal::BadBatch,
        Some("bad_parameters") => Refusal::BadParameters,
        Some("queue_full") => Refusal::QueueFull,
        _ => bail!("no refusal {value}"),
    })
}
