//! Runs a program: one task, on its own time.

mod moves;
mod operations;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use fanuc_ls::{Expression, Instruction, Item, Operation};
use serde_json::{Value as Json, json};

use super::load::{LoadedProgram, Programs, Step};
use super::memory::{EvaluationContext, Fault, Memory, Value};
use super::position::RobotPosition;
use cellwire_motion::{Planner, Pose};
use cellwire_sim::fanuc::Tables;

/// The time of an instruction other than a motion, in s.
const INSTRUCTION: f64 = 0.001;
/// The interval at which a condition is checked, and the time of a motion restarts, in s: the interpolation period.
const PERIOD: f64 = 0.008;
/// The time in which the arm gets its speed, in s, with ACC100.
const RAMP: f64 = 0.2;
/// The speed of `max_speed`, in mm/s.
const FASTEST: f64 = 2000.0;
/// `$WAITTMOUT`, in s.
const TIMEOUT: f64 = 30.0;
/// Programs that call each other so deep are a mistake.
const DEEPEST: usize = 100;

/// A controller that runs a program.
#[derive(Debug)]
pub struct Machine {
    /// The registers, frames and other values that the program sets.
    pub memory: Memory,
    main: String,
    programs: Programs,
    planner: Planner,
    stack: Vec<Frame>,
    repeat: bool,
    now: f64,
    /// When the last motion ends.
    rest: f64,
    /// When the next instruction is due.
    due: f64,
    /// The time since which a `WAIT` waits, in s; `None` if it does not.
    waits: Option<f64>,
    state: State,
    /// The value of UFRAME_NUM; `None` before the program has selected one.
    pub frame: Option<u32>,
    /// The value of UTOOL_NUM; `None` before the program has selected one.
    pub tool: Option<u32>,
    /// The name of the robot, for an alarm that its arm cannot reach a place.
    pub robot: String,
    /// SKIP CONDITION.
    skip: Option<Expression>,
    /// The times at which the next S motions end: they are one curve.
    curve: VecDeque<f64>,
    /// When a motion with Skip ends, while it runs.
    skipping: Option<f64>,
    /// OFFSET CONDITION.
    offset: Option<Item>,
    /// The number of times that a program has jumped to each of its labels.
    jumps: BTreeMap<String, u32>,
    speed: f64,
    events: Vec<Json>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    Running,
    Ended,
}

#[derive(Debug)]
struct Frame {
    loaded: Arc<LoadedProgram>,
    next: usize,
    arguments: Vec<Value>,
}

/// The continuation after an instruction.
enum Flow {
    Next,
    To(usize),
    /// The same again, at this time.
    Again(f64),
    /// The next one, at this time.
    Later(f64),
    Call(String, Vec<Value>),
    Return,
    Stop(&'static str),
}

impl Machine {
    /// Creates a machine at the beginning of `main`, with the arm at rest.
    pub fn new(main: String, programs: Programs, planner: Planner, repeat: bool) -> Self {
        let mut machine = Self {
            memory: Memory::default(),
            main,
            programs,
            planner,
            stack: Vec::new(),
            repeat,
            now: 0.0,
            rest: 0.0,
            due: 0.0,
            waits: None,
            state: State::Running,
            frame: None,
            tool: None,
            robot: String::new(),
            skip: None,
            curve: VecDeque::new(),
            skipping: None,
            offset: None,
            jumps: BTreeMap::new(),
            speed: 1.0,
            events: Vec::new(),
        };
        machine.begin();
        machine
    }

    /// Runs until a time that is not before the last one.
    pub fn advance(&mut self, until: f64, tables: &mut Tables) {
        while self.state == State::Running && self.due <= until {
            self.now = self.now.max(self.due);
            self.end_pulses(tables);
            self.step(tables);
        }
        self.now = until;
        self.end_pulses(tables);
    }

    /// Returns whether the program has ended, and the arm is at rest.
    pub fn has_ended(&self) -> bool {
        self.state == State::Ended && self.now >= self.rest
    }

    /// Returns the tool's pose in the world frame now.
    pub fn pose(&mut self) -> Pose {
        self.planner.pose(self.now)
    }

    /// Returns the waiting instruction with its location, and the start of its wait in s.
    pub fn waiting(&self) -> Option<(String, f64)> {
        let frame = self.stack.last()?;
        let text = match frame.loaded.program.instructions.get(frame.next)? {
            Instruction::Other(text) => text.as_str(),
            _ => "an instruction",
        };
        let name = &frame.loaded.program.name;
        self.waits.map(|since| (format!("`{text}` in {name}:{}", frame.next + 1), since))
    }

    /// Returns whether the program waits for a condition that cannot change by itself: no pulse, motion, timer or timeout is
    /// running.
    pub fn waits_in_vain(&self) -> bool {
        let endless = self.waiting().is_some_and(|(text, since)| {
            self.now > since + 1.0
                && !text.contains("TIMER")
                && !text.contains("TIMEOUT")
                && !text.contains('$')
        });
        endless && self.memory.pulses.is_empty() && self.now > self.rest
    }

    /// Returns the most frequent target label of jumps, and the number of jumps to it.
    pub fn loop_of(&self) -> Option<(&str, u32)> {
        let most = self.jumps.iter().max_by_key(|(_, count)| **count)?;
        Some((most.0.as_str(), *most.1))
    }

    /// Returns the joints now.
    pub fn joints(&mut self) -> [f64; 6] {
        self.planner.at(self.now)
    }

    /// Returns the override in percent.
    pub fn override_percent(&self) -> f64 {
        self.speed * 100.0
    }

    /// Removes and returns the events since the last call.
    pub fn events(&mut self) -> Vec<Json> {
        std::mem::take(&mut self.events)
    }

    /// Adds an event.
    pub fn report(&mut self, event: Json) {
        self.events.push(event);
    }

    /// Returns the running program and its line, from 1.
    pub fn line(&self) -> Option<(&str, usize)> {
        self.stack.last().map(|frame| (frame.loaded.program.name.as_str(), frame.next + 1))
    }

    fn begin(&mut self) {
        if let Some(loaded) = self.programs.get(&self.main) {
            self.stack.push(Frame { loaded: Arc::clone(loaded), next: 0, arguments: Vec::new() });
        }
    }

    fn event(&mut self, name: &str, more: &Json) {
        let mut event = json!({"event": name, "time": (self.now * 1e3).round() / 1e3});
        let line = self.line().map(|(program, line)| format!("{program}:{line}"));
        if let (Some(event), Some(more)) = (event.as_object_mut(), more.as_object()) {
            event.extend(line.map(|line| ("at".into(), json!(line))));
            event.extend(more.clone());
        }
        self.events.push(event);
    }

    fn step(&mut self, tables: &mut Tables) {
        let Some(frame) = self.stack.last() else {
            if self.now < self.rest {
                self.due = self.rest;
                return;
            }
            if self.repeat {
                self.due = self.now + PERIOD; // an empty program ends at once, again and again
                self.begin();
            } else {
                self.event("program_ended", &json!({}));
                self.state = State::Ended;
            }
            return;
        };
        let loaded = Arc::clone(&frame.loaded);
        let flow = match loaded.steps.get(frame.next) {
            None => Ok(Flow::Return),
            Some(Step::Pass) => Ok(Flow::Next),
            Some(Step::Motion(motion)) => self.motion(motion, &loaded, tables),
            Some(Step::Operation(operation)) => self.operate(operation, &loaded, tables),
        };
        let flow = flow.unwrap_or_else(|why| {
            self.event("alarm", &json!({"why": why}));
            Flow::Stop("alarm")
        });
        self.follow(flow);
    }

    fn follow(&mut self, flow: Flow) {
        self.due = self.now + INSTRUCTION;
        if !matches!(flow, Flow::Again(_)) {
            self.waits = None;
        }
        let next = self.stack.last_mut().map(|frame| &mut frame.next);
        match flow {
            Flow::Next => next.into_iter().for_each(|next| *next += 1),
            Flow::To(step) => next.into_iter().for_each(|next| *next = step),
            Flow::Again(at) => self.due = at,
            Flow::Later(at) => {
                next.into_iter().for_each(|next| *next += 1);
                self.due = at;
            }
            Flow::Call(name, arguments) => {
                next.into_iter().for_each(|next| *next += 1);
                // A program that is not there was reported at the start.
                if let Some(loaded) = self.programs.get(&name.to_uppercase()) {
                    self.stack.push(Frame { loaded: Arc::clone(loaded), next: 0, arguments });
                }
                if self.stack.len() > DEEPEST {
                    self.event("alarm", &json!({"why": format!("programs call each other {DEEPEST} deep")}));
                    self.state = State::Ended;
                }
            }
            Flow::Return => drop(self.stack.pop()),
            Flow::Stop(why) => {
                self.event("program_stopped", &json!({"why": why}));
                self.state = State::Ended;
            }
        }
    }

    /// Calls `f` with the memory and the context of expressions.
    fn with<T>(
        &mut self,
        loaded: &LoadedProgram,
        tables: &mut Tables,
        f: impl FnOnce(&mut Memory, &mut Tables, &EvaluationContext<'_>) -> Result<T, Fault>,
    ) -> Result<T, Fault> {
        let joints = self.planner.at(self.now);
        let world = self.planner.pose(self.now);
        let here = self.user_frame(self.frame.unwrap_or(0)).inverse().then(world);
        let here = RobotPosition::Cartesian { xyzwpr: here.to_xyzwpr(), folded: None };
        let arguments: &[Value] = self.stack.last().map_or(&[], |frame| &frame.arguments);
        let around = EvaluationContext {
            now: self.now,
            arguments,
            here: (here, RobotPosition::Joints(joints)),
            program: &loaded.program,
        };
        f(&mut self.memory, tables, &around)
    }

    fn user_frame(&self, number: u32) -> Pose {
        self.memory.frames.get(&(false, number)).map_or(Pose::IDENTITY, |frame| Pose::from_xyzwpr(*frame))
    }

    fn end_pulses(&mut self, tables: &mut Tables) {
        let now = self.now;
        let (ended, going) = self.memory.pulses.drain(..).partition::<Vec<_>, _>(|(end, _)| *end <= now);
        self.memory.pulses = going;
        for (_, signal) in ended {
            self.memory.set_signal(signal, 0, tables);
        }
    }
}

/// Returns the item of a text, such as `P[R[1]]`.
pub(super) fn parsed(text: &str) -> Option<Item> {
    match Operation::decode(&format!("R[1]={text}")) {
        Some(Operation::Assign(_, Expression::Item(item))) => Some(item),
        _ => None,
    }
}
