//! Instructions other than motions.

use fanuc_hmi_modbus::Signal;
use fanuc_ls::{Expression, Index, Item, Operation};
use serde_json::json;

use super::super::load::{LoadedProgram, Step};
use super::super::memory::{Fault, Value, signal};
use super::{Flow, INSTRUCTION, Machine, PERIOD, TIMEOUT, parsed};
use cellwire_sim::fanuc::Tables;

impl Machine {
    pub(super) fn operate(
        &mut self,
        operation: &Operation,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<Flow, Fault> {
        let at = self.stack.last().map_or(0, |frame| frame.next);
        Ok(match operation {
            Operation::Call { program, arguments } => {
                self.with(loaded, tables, |memory, tables, around| {
                    let values = arguments.iter().map(|argument| memory.value(argument, tables, around));
                    let name = match parsed(program) {
                        Some(item) => memory.read(&item, tables, around)?,
                        None => Value::Text(program.clone()),
                    };
                    let Value::Text(name) = name else { return Err(format!("{program} has no name")) };
                    Ok(Flow::Call(name, values.collect::<Result<_, _>>()?))
                })?
            }
            Operation::Jump(label) => self.jump(label, loaded, tables)?,
            Operation::Assign(item, value) => {
                self.with(loaded, tables, |memory, tables, around| {
                    let value = memory.value(value, tables, around)?;
                    memory.write(item, value, tables, around)
                })?;
                Flow::Next
            }
            Operation::AssignSystem(name, value) => {
                let value =
                    self.with(loaded, tables, |memory, tables, around| memory.number(value, tables, around))?;
                self.memory.system.insert(name.clone(), value);
                Flow::Next
            }
            Operation::UserFrame(value) => {
                self.frame = Some(self.selected(value, loaded, tables)?);
                Flow::Next
            }
            Operation::UserTool(value) => {
                self.tool = Some(self.selected(value, loaded, tables)?);
                Flow::Next
            }
            Operation::Override(value) => {
                let percent =
                    self.with(loaded, tables, |memory, tables, around| memory.number(value, tables, around))?;
                self.speed = (percent / 100.0).clamp(0.0001, 1.0);
                Flow::Next
            }
            Operation::Pulse(item, seconds) => {
                let signal = self.signal_of(item, loaded, tables)?;
                self.memory.set_signal(signal, 1, tables);
                self.memory.pulses.push((self.now + seconds.unwrap_or(0.1), signal));
                Flow::Next
            }
            Operation::Timer(item, action) => {
                let n = self.with(loaded, tables, |memory, tables, around| {
                    memory.index(&item.index, tables, around)
                })?;
                self.memory.time(n, *action, self.now);
                Flow::Next
            }
            Operation::Wait(seconds) => {
                let seconds = self
                    .with(loaded, tables, |memory, tables, around| memory.number(seconds, tables, around))?;
                Flow::Later(self.now + seconds.clamp(INSTRUCTION, 1e6))
            }
            Operation::WaitFor { condition, timeout } => {
                let since = *self.waits.get_or_insert(self.now);
                let is_true = self
                    .with(loaded, tables, |memory, tables, around| memory.bit(condition, tables, around))?;
                match timeout {
                    _ if is_true => Flow::Next,
                    Some(label) if self.now - since >= TIMEOUT => self.jump(label, loaded, tables)?,
                    _ => Flow::Again(self.now + PERIOD),
                }
            }
            Operation::If(condition, action) => {
                match self
                    .with(loaded, tables, |memory, tables, around| memory.bit(condition, tables, around))?
                {
                    true => self.operate(action, loaded, tables)?,
                    false => Flow::Next,
                }
            }
            Operation::IfThen(condition) => {
                match self
                    .with(loaded, tables, |memory, tables, around| memory.bit(condition, tables, around))?
                {
                    true => Flow::Next,
                    false => Flow::To(block(loaded, at, true).ok_or("IF without ENDIF")? + 1),
                }
            }
            Operation::Else => Flow::To(block(loaded, at, false).ok_or("ELSE without ENDIF")? + 1),
            Operation::Select(item, case, action) => self.select(item, case, action, loaded, tables)?,
            Operation::For { counter, from, to, down } => {
                let (from, to) = self.with(loaded, tables, |memory, tables, around| {
                    Ok((memory.number(from, tables, around)?, memory.number(to, tables, around)?))
                })?;
                self.with(loaded, tables, |memory, tables, around| {
                    memory.write(counter, Value::Number(from), tables, around)
                })?;
                match if *down { from >= to } else { from <= to } {
                    true => Flow::Next,
                    false => Flow::To(end_of_loop(loaded, at).ok_or("FOR without ENDFOR")? + 1),
                }
            }
            Operation::EndFor => self.turn(loaded, at, tables)?,
            Operation::Message(text) => {
                self.event("message", &json!({"text": text}));
                Flow::Next
            }
            Operation::UserAlarm(index) => {
                let n =
                    self.with(loaded, tables, |memory, tables, around| memory.index(index, tables, around))?;
                self.event("alarm", &json!({"why": format!("UALM[{n}]")}));
                Flow::Stop("alarm")
            }
            Operation::Command { name: "SKIP CONDITION", operands, .. } => {
                self.skip = operands.first().cloned();
                Flow::Next
            }
            Operation::Command { name: "OFFSET CONDITION", text, .. } => {
                // A user frame may follow.
                self.offset = Some(text.split_once(',').map_or(text.as_str(), |(register, _)| register))
                    .and_then(|register| parsed(register.trim()));
                Flow::Next
            }
            Operation::End => Flow::Return,
            Operation::Abort => Flow::Stop("ABORT"),
            Operation::Pause => Flow::Stop("PAUSE"),
            // An instruction that was reported at the start, the target of a jump, and a case whose SELECT has chosen another
            // one.
            _ => Flow::Next,
        })
    }

    fn selected(
        &mut self,
        value: &Expression,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<u32, Fault> {
        let number =
            self.with(loaded, tables, |memory, tables, around| memory.number(value, tables, around))?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in its range")]
        match number {
            0.0..=255.0 => Ok(number.round() as u32),
            _ => Err(format!("there is no frame {number}")),
        }
    }

    fn signal_of(
        &mut self,
        item: &Item,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<Signal, Fault> {
        let n =
            self.with(loaded, tables, |memory, tables, around| memory.index(&item.index, tables, around))?;
        signal(item.kind, n).ok_or_else(|| format!("{}[{n}] is not a signal", item.kind))
    }

    pub(super) fn jump(
        &mut self,
        label: &Item,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<Flow, Fault> {
        let n =
            self.with(loaded, tables, |memory, tables, around| memory.index(&label.index, tables, around))?;
        let is_label = |step: &Step| {
            matches!(step, Step::Operation(operation)
                if matches!(&**operation, Operation::Label(item) if item.index == Index::Number(n)))
        };
        let found = loaded.steps.iter().position(is_label);
        *self.jumps.entry(format!("LBL[{n}] of {}", loaded.program.name)).or_default() += 1;
        found.map(Flow::To).ok_or_else(|| format!("there is no LBL[{n}]"))
    }

    /// Executes the action of the first case that matches.
    fn select(
        &mut self,
        item: &Item,
        case: &Expression,
        action: &Operation,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<Flow, Fault> {
        let fits = |machine: &mut Self, tables: &mut Tables, case: &Expression| {
            machine.with(loaded, tables, |memory, tables, around| {
                Ok(memory.read(item, tables, around)? == memory.value(case, tables, around)?)
            })
        };
        if fits(self, tables, case)? {
            return self.operate(action, loaded, tables);
        }
        let at = self.stack.last().map_or(0, |frame| frame.next);
        for step in loaded.steps.iter().skip(at + 1) {
            match step {
                Step::Operation(other) => match &**other {
                    Operation::Case(case, action) => {
                        if fits(self, tables, case)? {
                            return self.operate(action, loaded, tables);
                        }
                    }
                    Operation::Otherwise(action) => return self.operate(action, loaded, tables),
                    _ => break,
                },
                Step::Pass => {}
                Step::Motion(_) => break,
            }
        }
        Ok(Flow::Next)
    }

    /// Executes the end of a loop: advances its counter, and repeats or ends the loop.
    fn turn(&mut self, loaded: &LoadedProgram, at: usize, tables: &mut Tables) -> Result<Flow, Fault> {
        let begin = begin_of_loop(loaded, at).ok_or("ENDFOR without FOR")?;
        let Some(Step::Operation(operation)) = loaded.steps.get(begin) else { return Ok(Flow::Next) };
        let Operation::For { counter, to, down, .. } = &**operation else { return Ok(Flow::Next) };
        let again = self.with(loaded, tables, |memory, tables, around| {
            let counted = memory.number(&Expression::Item(counter.clone()), tables, around)?;
            let to = memory.number(to, tables, around)?;
            let next = if *down { counted - 1.0 } else { counted + 1.0 };
            let again = if *down { next >= to } else { next <= to };
            if again {
                memory.write(counter, Value::Number(next), tables, around)?;
            }
            Ok(again)
        })?;
        Ok(Flow::To(if again { begin + 1 } else { at + 1 }))
    }
}

/// Returns the `ENDIF` of a block, or its `ELSE` with `or_else`.
fn block(loaded: &LoadedProgram, at: usize, or_else: bool) -> Option<usize> {
    let mut depth = 0;
    (at + 1..).zip(loaded.steps.iter().skip(at + 1)).find_map(|(index, step)| {
        let Step::Operation(operation) = step else { return None };
        match &**operation {
            Operation::IfThen(_) => depth += 1,
            Operation::EndIf if depth == 0 => return Some(index),
            Operation::Else if depth == 0 && or_else => return Some(index),
            Operation::EndIf => depth -= 1,
            _ => {}
        }
        None
    })
}

fn end_of_loop(loaded: &LoadedProgram, at: usize) -> Option<usize> {
    let mut depth = 0;
    (at + 1..)
        .zip(loaded.steps.iter().skip(at + 1))
        .find_map(|(index, step)| nested(step, &mut depth, index, false))
}

fn begin_of_loop(loaded: &LoadedProgram, at: usize) -> Option<usize> {
    let mut depth = 0;
    let before: Vec<(usize, &Step)> = loaded.steps.iter().enumerate().take(at).collect();
    before.into_iter().rev().find_map(|(index, step)| nested(step, &mut depth, index, true))
}

/// Returns the step, if it is the other end of a loop.
fn nested(step: &Step, depth: &mut u32, index: usize, backwards: bool) -> Option<usize> {
    let Step::Operation(operation) = step else { return None };
    let is_begin = matches!(&**operation, Operation::For { .. });
    if !is_begin && !matches!(&**operation, Operation::EndFor) {
        return None;
    }
    if is_begin != backwards {
        *depth += 1;
        return None;
    }
    if *depth == 0 {
        return Some(index);
    }
    *depth -= 1;
    None
}
