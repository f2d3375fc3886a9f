//! The controller of the laser, with the owner of its queue.

use core::time::Duration;
use std::collections::VecDeque;

use anyhow::{Result, bail};
use laser_eb90::controller::ControllerRule;
use laser_eb90::controller::machine::{ControllerInput, ControllerMachine, Fault, Receiving, Work};
use laser_eb90::{
    Controller, ControllerConfig, ControllerEvent, ControllerStatistics, Instruction, Item, Refusal,
    SessionError,
};
use robot_session::Session;
use robot_work_queue::Reader;
use serde_json::{Map, Value};

use super::laser_host::write;
use super::{Before, Do, Driven, Fields, Hooks, Maker, event, kind, show, unexpected};

pub(super) const MAKER: Maker = Maker {
    make: |config, without| Ok(Box::new(Driven::<LaserController>(robot(config, without)?))),
    rules: || ["IgnoreShort"].map(String::from).to_vec(),
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
    controller: Controller<'static, Job>,
    motion: Reader<'static, Job>,
    taken: VecDeque<Job>,
}

enum Happened {
    Taken(Job),
    Controller(ControllerEvent),
}

fn robot(config: &Map<String, Value>, without: Option<usize>) -> Result<Robot> {
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
    made.without = without.map(|_| ControllerRule::IgnoreShort);
    let (writer, motion) = robot_work_queue::boxed(room, MAX_NUMBER)?;
    Ok(Robot { controller: Controller::new(made, writer)?, motion, taken: VecDeque::new() })
}

impl Session for Robot {
    type Event = Happened;
    type Statistics = ControllerStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Controller::<Job>::MAX_TRANSMIT;

    fn handle_connected(&mut self, now: Duration) {
        self.controller.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.controller.handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.controller.handle_input(now, bytes);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.controller.handle_timeout(now);
    }

    fn poll_event(&mut self) -> Option<Happened> {
        let taken = self.taken.pop_front().map(Happened::Taken);
        taken.or_else(|| self.controller.poll_event().map(Happened::Controller))
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        self.controller.poll_transmit(now, out)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.controller.poll_timeout()
    }

    fn statistics(&self) -> ControllerStatistics {
        self.controller.statistics()
    }
}

impl Before for Robot {
    type Before = (ControllerMachine, ControllerStatistics);

    fn before(&self) -> Self::Before {
        (*self.controller.machine(), self.controller.statistics())
    }
}

struct LaserController;

impl Hooks for LaserController {
    type Session = Robot;

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

    fn event(robot: &Robot, happened: Happened) -> Result<String> {
        let happened = match happened {
            Happened::Taken(Job { word, parameters }) => {
                return Ok(event("taken").raw("word", word).raw("parameters", parameters).end());
            }
            Happened::Controller(happened) => happened,
        };
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

    fn state(robot: &Robot) -> String {
        row(robot.controller.machine())
    }

    fn cells(
        before: &(ControllerMachine, ControllerStatistics),
        after: &Robot,
        now: Duration,
        input: &Do,
        refused: bool,
    ) -> Vec<String> {
        let (machine, counted) = before;
        let mut walk = Walk { machine: *machine, now, cells: Vec::new() };
        match input {
            Do::Connected => walk.on("Connected", ControllerInput::Connected),
            Do::Disconnected => walk.on("Disconnected", ControllerInput::Disconnected),
            Do::Input(_) => {
                walk.on("Bytes", ControllerInput::Bytes);
                walk.frames(*counted, &after.controller);
            }
            Do::Timeout if machine.is_silent(now) => {
                if matches!(machine.line, Receiving::Bytes { partial: true, .. }) {
                    let is_answered = matches!(after.controller.machine().work, Work::Answering { .. });
                    walk.corrupt(is_answered);
                }
                walk.read(&after.controller);
                walk.on("Silence", ControllerInput::Silence);
            }
            Do::Call { name, .. } if !refused && name != "take" => {
                let (name, result) = match name.as_str() {
                    "answer" => ("Executed", Ok(())),
                    _ => ("Executed, failed", Err(Refusal::BadParameters)),
                };
                walk.on(name, ControllerInput::Executed(result));
                walk.frames(*counted, &after.controller);
            }
            Do::Call { .. } | Do::Timeout | Do::Transmitted | Do::Nothing => {}
        }
        walk.cells
    }

    fn transmit_cells(
        before: &(ControllerMachine, ControllerStatistics),
        now: Duration,
        sent: bool,
    ) -> Vec<String> {
        let mut walk = Walk { machine: before.0, now, cells: Vec::new() };
        if sent && !walk.machine.is_silent(now) {
            walk.on("Transmit", ControllerInput::Transmit);
        }
        walk.cells
    }
}

/// The inputs of a step, one after the other.
struct Walk {
    machine: ControllerMachine,
    now: Duration,
    cells: Vec<String>,
}

impl Walk {
    fn on(&mut self, name: &str, input: ControllerInput) {
        self.cells.push(format!("{}: {name}", row(&self.machine)));
        let _ = self.machine.on(self.now, input, &ControllerConfig::default());
    }

    /// What was read, if it was one frame or one error at most.
    fn frames(&mut self, counted: ControllerStatistics, after: &Controller<'static, Job>) {
        let now = after.statistics();
        let refused = now.refused - counted.refused;
        let corrupt = now.corrupt - counted.corrupt;
        match (now.queued - counted.queued, now.executed - counted.executed, refused, corrupt) {
            (0, 0, 0, 0) => {}
            (_, 0, 0, 0) => self.on("Queued", ControllerInput::Queued { word: 0 }),
            (0, 1, 0, 0) => self.on("Immediate", ControllerInput::Immediate { word: 0 }),
            (0, 0, 1, 0) => self.on("Refused", ControllerInput::Refused(Refusal::BadFrame)),
            (0, 0, 0, 1) => {
                let work = after.machine().work;
                self.corrupt(
                    matches!(work, Work::Listening { fault: Some(fault) } if fault.bytes >= Fault::ENOUGH),
                );
            }
            _ => return,
        }
        self.read(after);
    }

    /// Corrupt bytes, which together with those before are enough for an answer or not.
    fn corrupt(&mut self, is_enough: bool) {
        let bytes = if is_enough { Fault::ENOUGH } else { 0 };
        self.on("Corrupt", ControllerInput::Corrupt { refusal: Refusal::BadFrame, bytes });
    }

    fn read(&mut self, after: &Controller<'static, Job>) {
        if matches!(self.machine.line, Receiving::Bytes { .. }) {
            let partial = matches!(after.machine().line, Receiving::Bytes { partial: true, .. });
            let name = if partial { "Read, a partial frame" } else { "Read, nothing left" };
            self.on(name, ControllerInput::Read { partial });
        }
    }
}

/// The row of the matrix.
fn row(machine: &ControllerMachine) -> String {
    let line = match machine.line {
        Receiving::Disconnected => return machine.name().into(),
        Receiving::Silent => "silent",
        Receiving::Bytes { partial: true, .. } if matches!(machine.work, Work::Answering { .. }) => {
            "a partial frame"
        }
        Receiving::Bytes { .. } => "bytes",
    };
    match machine.work {
        Work::Executing { connected: false, .. } => "Executing for nobody".into(),
        Work::Listening { fault: Some(fault) } => {
            format!("Listening, fault of {} bytes", if fault.bytes < Fault::ENOUGH { 7 } else { 8 })
        }
        _ => format!("{}, {line}", machine.name()),
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
