//! The tasks of a controller.

use core::task::Poll;
use core::time::Duration;

use crate::error::{Error, Fault, ParseError};
use crate::evaluate::Scope;
use crate::expression::{Expression, VariableRef};
use crate::host::{Host, Motion};
use crate::memory::{Cell, Memory, index};
use crate::names::Variable;
use crate::program::Program;
use crate::routine::Routine;
use crate::statement::StatementKind;
use crate::value::{Pose, VariableContents, whole};

/// A controller with a program in it.
#[derive(Debug)]
pub struct Machine {
    program: Program,
    memory: Memory,
    tasks: Vec<Task>,
}

/// The result of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// A statement is executed.
    Done,
    /// The statement waits: nothing has changed.
    Waits,
    /// The task is over.
    Ended,
}

#[derive(Debug)]
struct Task {
    program: usize,
    frames: Vec<Frame>,
    statements: u64,
    /// The time at which the waiting statement began; `None` if the task is not waiting.
    since: Option<Duration>,
    /// The time at which the wait ends; `None` if it has no limit.
    wakes_at: Option<Duration>,
}

#[derive(Debug)]
struct Frame {
    routine: usize,
    at: usize,
    locals: Vec<Cell>,
    /// The caller's variables that the parameters are copied to.
    results: Vec<(usize, Variable, Option<usize>)>,
}

/// The continuation after a statement.
enum Continuation {
    Statement,
    At(usize),
    Wait(Option<Duration>),
    Enter(Frame),
    Leave,
}

const DEEPEST: usize = 20;

impl Machine {
    /// Creates a machine without values and running tasks.
    pub fn new(program: Program) -> Self {
        let memory = Memory::new(program.globals.len());
        Self { program, memory, tasks: Vec::new() }
    }

    /// Begins a task with a program, and gives its number, from 0.
    ///
    /// # Errors
    /// If there is no program of this name.
    pub fn start(&mut self, program: &str) -> Result<usize, ParseError> {
        let found = self.program.routines.iter().position(|routine| routine.name == program);
        let Some(routine) = found else {
            return Err(ParseError { line: 0, why: format!("there is no program {program}") });
        };
        self.tasks.push(Task {
            program: routine,
            frames: Vec::new(),
            statements: 0,
            since: None,
            wakes_at: None,
        });
        self.restart(self.tasks.len() - 1);
        Ok(self.tasks.len() - 1)
    }

    /// Restarts the program of a task after a stop; the state that tasks share is unchanged.
    pub fn restart(&mut self, task: usize) {
        if let Some(task) = self.tasks.get_mut(task) {
            task.frames = frame(&self.program, task.program).into_iter().collect();
            (task.since, task.wakes_at) = (None, None);
        }
    }

    /// Executes one statement of a task.
    ///
    /// # Errors
    /// An error that stopped the task: the task has ended.
    pub fn step(&mut self, task: usize, host: &mut impl Host) -> Result<Step, Fault> {
        let Self { program, memory, tasks } = self;
        let Some(state) = tasks.get_mut(task) else { return Ok(Step::Ended) };
        let depth = state.frames.len();
        let Some(top) = state.frames.last_mut() else { return Ok(Step::Ended) };
        let Some(routine) = program.routines.get(top.routine) else { return Ok(Step::Ended) };
        let Some(statement) = routine.statements.get(top.at) else { return Ok(Step::Ended) };
        let since = *state.since.get_or_insert_with(|| host.now());
        let mut executing = Executing { program, memory, frame: top, since, task, host };
        let next = match executing.statement(&statement.what) {
            Ok(next) => next,
            Err(error) => {
                state.frames.clear();
                return Err(Fault { error, program: routine.name.clone(), line: statement.line });
            }
        };
        match next {
            Continuation::Wait(until) => {
                state.wakes_at = until;
                return Ok(Step::Waits);
            }
            Continuation::Statement => top.at += 1,
            Continuation::At(place) => top.at = place,
            Continuation::Enter(_) if depth == DEEPEST => {
                state.frames.clear();
                let (program, line) = (routine.name.clone(), statement.line);
                return Err(Fault { error: Error::Depth, program, line });
            }
            Continuation::Enter(frame) => {
                top.at += 1;
                state.frames.push(frame);
            }
            Continuation::Leave => leave(&mut state.frames, memory),
        }
        state.statements += 1;
        (state.since, state.wakes_at) = (None, None);
        Ok(Step::Done)
    }

    /// Returns the number of tasks that were begun.
    pub fn tasks(&self) -> usize {
        self.tasks.len()
    }

    /// Returns the number of statements that a task has executed.
    pub fn statements(&self, task: usize) -> u64 {
        self.tasks.get(task).map_or(0, |task| task.statements)
    }

    /// Returns the programs that a task executes, the outermost first.
    pub fn calls(&self, task: usize) -> impl Iterator<Item = &str> {
        let frames = self.tasks.get(task).map_or(&[][..], |task| &task.frames);
        frames
            .iter()
            .filter_map(|frame| self.program.routines.get(frame.routine))
            .map(|found| found.name.as_str())
    }

    /// Returns the time at which a waiting task continues by itself.
    pub fn wakes_at(&self, task: usize) -> Option<Duration> {
        self.tasks.get(task)?.wakes_at
    }

    /// Returns the number of strings that were truncated after 255 bytes.
    pub fn truncations(&self) -> u64 {
        self.memory.truncations
    }

    /// Returns a real; `None` while it has no value.
    pub fn real(&self, name: &str) -> Option<f32> {
        self.cell(name)?.get(None).ok()?.real().ok()
    }

    /// Returns an element of an array of reals.
    pub fn element(&self, name: &str, index: usize) -> Option<f32> {
        self.cell(name)?.get(Some(index)).ok()?.real().ok()
    }

    /// Returns a string, byte for byte as characters.
    pub fn text(&self, name: &str) -> Option<String> {
        Some(self.cell(name)?.get(None).ok()?.text().ok()?.iter().map(|byte| char::from(*byte)).collect())
    }

    /// Sets a real, as an operator would. Whether the program has it.
    pub fn set_real(&mut self, name: &str, value: f32) -> bool {
        self.set(name, VariableContents::Real(value))
    }

    /// Teaches a location. Whether the program has it.
    pub fn set_pose(&mut self, name: &str, value: Pose) -> bool {
        self.set(name, VariableContents::Pose(value))
    }

    /// Sets a string. Whether the program has it.
    pub fn set_text(&mut self, name: &str, value: &str) -> bool {
        self.set(name, VariableContents::Text(value.bytes().collect()))
    }

    /// Returns whether a signal is on.
    pub fn signal(&self, number: usize) -> bool {
        self.memory.signals.get(number) == Some(&true)
    }

    /// Sets a signal.
    pub fn set_signal(&mut self, number: usize, on: bool) {
        self.memory.set_signal(number, on);
    }

    fn set(&mut self, name: &str, value: VariableContents) -> bool {
        let Some(at) = self.program.globals.get(name) else { return false };
        self.memory.set(&mut [], Variable::Global(*at), None, value);
        true
    }

    fn cell(&self, name: &str) -> Option<&Cell> {
        self.memory.globals.get(*self.program.globals.get(name)?)
    }
}

fn frame(program: &Program, routine: usize) -> Option<Frame> {
    let locals = vec![Cell::default(); program.routines.get(routine)?.locals];
    Some(Frame { routine, at: 0, locals, results: Vec::new() })
}

/// Returns to the caller, with the values of the parameters.
fn leave(frames: &mut Vec<Frame>, memory: &mut Memory) {
    let Some(left) = frames.pop() else { return };
    let Some(caller) = frames.last_mut() else { return };
    for (parameter, variable, index) in left.results {
        if let Some(value) = left.locals.get(parameter).and_then(|cell| cell.single.clone()) {
            memory.set(&mut caller.locals, variable, index, value);
        }
    }
}

/// A statement that is being executed.
struct Executing<'a, H> {
    program: &'a Program,
    memory: &'a mut Memory,
    frame: &'a mut Frame,
    since: Duration,
    task: usize,
    host: &'a mut H,
}

impl<H: Host> Executing<'_, H> {
    fn statement(&mut self, what: &StatementKind) -> Result<Continuation, Error> {
        let now = self.host.now();
        match what {
            StatementKind::Nothing => {}
            StatementKind::Assign(place, expression) => {
                let value = self.scope().value(expression)?.into_stored();
                self.set(place, value)?;
            }
            StatementKind::Unless(condition, otherwise) => {
                if !self.scope().value(condition)?.is_true()? {
                    return Ok(Continuation::At(*otherwise));
                }
            }
            StatementKind::GoTo(place) => return Ok(Continuation::At(*place)),
            StatementKind::For { variable, from, to, kept, end } => {
                let (from, to) = (self.scope().real(from)?, self.scope().real(to)?);
                self.set(variable, VariableContents::Real(from))?;
                self.memory.set(
                    &mut self.frame.locals,
                    Variable::Local(*kept),
                    None,
                    VariableContents::Real(to),
                );
                if from > to {
                    return Ok(Continuation::At(*end));
                }
            }
            StatementKind::Next { variable, kept, begin } => {
                let scope = self.scope();
                let last = scope.read(Variable::Local(*kept), None)?.real()?;
                let next = scope.read(variable.variable, scope.index(variable)?)?.real()? + 1.0;
                self.set(variable, VariableContents::Real(next))?;
                return Ok(if next > last { Continuation::Statement } else { Continuation::At(begin + 1) });
            }
            StatementKind::Call(called, arguments) => return self.call(*called, arguments),
            StatementKind::Return => return Ok(Continuation::Leave),
            StatementKind::Wait(condition) => {
                if !self.scope().value(condition)?.is_true()? {
                    return Ok(Continuation::Wait(None));
                }
            }
            StatementKind::WaitTime(time) => {
                let until = self.since + self.time(time)?;
                if now < until {
                    return Ok(Continuation::Wait(Some(until)));
                }
            }
            StatementKind::SetTimer(timer, value) => {
                let timer = whole(self.scope().real(timer)?, Memory::TIMERS).ok_or(Error::Argument)?;
                let value = self.scope().real(value)?;
                self.memory.set_timer(timer, now, value);
            }
            StatementKind::Signal(numbers) => {
                for number in numbers {
                    let number = self.scope().real(number)?;
                    let signal = whole(number.abs(), Memory::SIGNALS).ok_or(Error::Argument)?;
                    self.memory.set_signal(signal, number > 0.0);
                }
            }
            StatementKind::Move { straight, to } => {
                let motion = Motion { straight: *straight, to: self.scope().value(to)?.pose()? };
                if self.host.give(motion).is_pending() {
                    return Ok(Continuation::Wait(None));
                }
            }
            StatementKind::Arrive => {
                if self.host.arrived().is_pending() {
                    return Ok(Continuation::Wait(None));
                }
            }
            StatementKind::Print(values) => {
                let mut line = String::new();
                for value in values {
                    match self.scope().value(value)?.into_stored() {
                        VariableContents::Real(real) => line += &crate::value::decimal(real),
                        VariableContents::Text(text) => line.extend(text.into_iter().map(char::from)),
                        VariableContents::Pose(_) => return Err(Error::Type),
                    }
                }
                self.host.print(self.task, &line);
            }
            StatementKind::Connect { .. } | StatementKind::Send { .. } | StatementKind::Receive { .. } => {
                return self.network(what);
            }
            StatementKind::Close { result, socket } => {
                let socket = self.scope().real(socket)?;
                let closed = self.host.close(number(socket));
                self.set(result, VariableContents::Real(result_of(closed)))?;
            }
            StatementKind::Status { count, columns } => self.status(count, columns)?,
        }
        Ok(Continuation::Statement)
    }

    fn call(&self, called: usize, arguments: &[Expression]) -> Result<Continuation, Error> {
        let mut frame = frame(self.program, called).ok_or(Error::Undefined)?;
        let parameters =
            self.program.routines.get(called).map_or(&[][..], |Routine { parameters, .. }| parameters);
        if parameters.len() != arguments.len() {
            return Err(Error::Argument);
        }
        for (parameter, argument) in parameters.iter().zip(arguments) {
            let scope = self.scope();
            let value = match argument {
                Expression::Variable(place) => {
                    let index = scope.index(place)?;
                    frame.results.push((*parameter, place.variable, index));
                    // One without a value is a result alone.
                    scope.read(place.variable, index).ok()
                }
                other => Some(scope.value(other)?),
            };
            if let Some(cell) = frame.locals.get_mut(*parameter) {
                cell.single = value.map(crate::value::Value::into_stored);
            }
        }
        Ok(Continuation::Enter(frame))
    }

    fn network(&mut self, what: &StatementKind) -> Result<Continuation, Error> {
        let since = self.since;
        match what {
            StatementKind::Connect { socket, port, ip, timeout } => {
                let (port, timeout) = (self.scope().real(port)?, self.time(timeout)?);
                let port =
                    whole(port, 65535.0).and_then(|port| u16::try_from(port).ok()).ok_or(Error::Argument)?;
                let first = self.scope().index(ip)?.ok_or(Error::Type)?;
                let mut address = [0; 4];
                for (i, byte) in address.iter_mut().enumerate() {
                    let part = self.scope().read(ip.variable, Some(first + i))?.real()?;
                    *byte =
                        whole(part, 255.0).and_then(|part| u8::try_from(part).ok()).ok_or(Error::Argument)?;
                }
                let Poll::Ready(found) = self.host.connect(since, timeout, address, port) else {
                    return Ok(Continuation::Wait(Some(since + timeout)));
                };
                self.set(socket, VariableContents::Real(result_of(found)))?;
            }
            StatementKind::Send { result, socket, strings, count, timeout } => {
                let scope = self.scope();
                let (socket, timeout) = (number(scope.real(socket)?), self.time(timeout)?);
                let (first, count) =
                    (scope.index(strings)?.ok_or(Error::Type)?, index(&scope.value(count)?)?);
                let values: Vec<_> = (first..first + count)
                    .map(|i| scope.read(strings.variable, Some(i)))
                    .collect::<Result<_, _>>()?;
                let texts = values.iter().map(|value| value.text().map(<[u8]>::to_vec));
                let texts: Vec<Vec<u8>> = texts.collect::<Result<_, _>>()?;
                let texts: Vec<&[u8]> = texts.iter().map(Vec::as_slice).collect();
                let Poll::Ready(sent) = self.host.send(since, timeout, socket, &texts) else {
                    return Ok(Continuation::Wait(Some(since + timeout)));
                };
                self.set(result, VariableContents::Real(result_of(sent)))?;
            }
            StatementKind::Receive { result, socket, strings, count, timeout, longest } => {
                let scope = self.scope();
                let (socket, timeout) = (number(scope.real(socket)?), self.time(timeout)?);
                let longest = whole(scope.real(longest)?, 255.0).ok_or(Error::Argument)?;
                let first = scope.index(strings)?.ok_or(Error::Type)?;
                let Poll::Ready((found, texts)) = self.host.receive(since, timeout, socket, longest) else {
                    return Ok(Continuation::Wait(Some(since + timeout)));
                };
                self.set(count, VariableContents::Real(length(texts.len())))?;
                for (i, text) in texts.into_iter().enumerate() {
                    self.memory.set(
                        &mut self.frame.locals,
                        strings.variable,
                        Some(first + i),
                        VariableContents::Text(text),
                    );
                }
                self.set(result, VariableContents::Real(result_of(found)))?;
            }
            _ => {}
        }
        Ok(Continuation::Statement)
    }

    fn status(&mut self, count: &VariableRef, columns: &[VariableRef; 5]) -> Result<(), Error> {
        let sockets = self.host.sockets();
        self.set(count, VariableContents::Real(length(sockets.len())))?;
        for (i, socket) in sockets.iter().enumerate() {
            let values = [f32::from(socket.port), result_of(socket.id), result_of(socket.error), 0.0];
            let values =
                values.map(VariableContents::Real).into_iter().chain([VariableContents::Text(Vec::new())]);
            for (place, value) in columns.iter().zip(values) {
                let first = self.scope().index(place)?.ok_or(Error::Type)?;
                self.memory.set(&mut self.frame.locals, place.variable, Some(first + i), value);
            }
        }
        Ok(())
    }

    fn scope(&self) -> Scope<'_> {
        Scope { memory: self.memory, locals: &self.frame.locals, now: self.host.now() }
    }

    fn set(&mut self, place: &VariableRef, value: VariableContents) -> Result<(), Error> {
        let index = self.scope().index(place)?;
        self.memory.set(&mut self.frame.locals, place.variable, index, value);
        Ok(())
    }

    fn time(&self, expression: &Expression) -> Result<Duration, Error> {
        Duration::try_from_secs_f32(self.scope().real(expression)?.max(0.0)).map_err(|_| Error::Argument)
    }
}

#[expect(clippy::cast_possible_truncation, reason = "a socket's number is small")]
fn number(real: f32) -> i32 {
    real as i32
}

#[expect(clippy::cast_precision_loss, reason = "a result is small")]
fn result_of(number: i32) -> f32 {
    number as f32
}

#[expect(clippy::cast_precision_loss, reason = "of strings, at most some")]
fn length(of: usize) -> f32 {
    of as f32
}
