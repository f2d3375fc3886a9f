//! Variables, signals and timers.

use core::time::Duration;

use crate::error::Error;
use crate::names::Variable;
use crate::value::{HIGHEST_INDEX, MAX_TEXT_LEN, Value, VariableContents, whole};

/// A variable: its value, and those of the array of the same name.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cell {
    pub(crate) single: Option<VariableContents>,
    pub(crate) items: Vec<Option<VariableContents>>,
}

impl Cell {
    pub(crate) fn get(&self, index: Option<usize>) -> Result<Value<'_>, Error> {
        let stored = match index {
            None => self.single.as_ref(),
            Some(index) => self.items.get(index).and_then(Option::as_ref),
        };
        stored.map(VariableContents::value).ok_or(Error::Undefined)
    }

    fn place(&mut self, index: Option<usize>) -> Option<&mut Option<VariableContents>> {
        match index {
            None => Some(&mut self.single),
            Some(index) => {
                if self.items.len() <= index {
                    self.items.resize(index + 1, None);
                }
                self.items.get_mut(index)
            }
        }
    }
}

/// The memory that all tasks share.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    pub(crate) globals: Vec<Cell>,
    pub(crate) signals: Vec<bool>,
    /// For each timer the time at which it was 0, in seconds: it may be before the controller was switched on.
    pub(crate) timers: Vec<f64>,
    /// The number of strings that were truncated after 255 bytes.
    pub(crate) truncations: u64,
}

impl Memory {
    pub(crate) const TIMERS: f32 = 10.0;
    pub(crate) const SIGNALS: f32 = 2960.0;

    pub(crate) fn new(globals: usize) -> Self {
        Self { globals: vec![Cell::default(); globals], ..Self::default() }
    }

    pub(crate) fn set_signal(&mut self, number: usize, on: bool) {
        if self.signals.len() <= number {
            self.signals.resize(number + 1, false);
        }
        if let Some(signal) = self.signals.get_mut(number) {
            *signal = on;
        }
    }

    pub(crate) fn set_timer(&mut self, timer: usize, now: Duration, to: f32) {
        if self.timers.len() <= timer {
            self.timers.resize(timer + 1, 0.0);
        }
        if let Some(timer) = self.timers.get_mut(timer) {
            *timer = now.as_secs_f64() - f64::from(to);
        }
    }

    /// Sets a variable; a string keeps its first 255 bytes.
    pub(crate) fn set(
        &mut self,
        locals: &mut [Cell],
        variable: Variable,
        index: Option<usize>,
        mut value: VariableContents,
    ) {
        if let VariableContents::Text(text) = &mut value
            && text.len() > MAX_TEXT_LEN
        {
            text.truncate(MAX_TEXT_LEN);
            self.truncations += 1;
        }
        let cell = match variable {
            Variable::Global(at) => self.globals.get_mut(at),
            Variable::Local(at) => locals.get_mut(at),
        };
        if let Some(place) = cell.and_then(|cell| cell.place(index)) {
            *place = Some(value);
        }
    }
}

/// Converts a value to an index.
pub(crate) fn index(value: &Value<'_>) -> Result<usize, Error> {
    whole(value.real()?, HIGHEST_INDEX).ok_or(Error::Index)
}
