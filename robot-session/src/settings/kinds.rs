//! The kinds of settings.

use core::fmt::Display;
use core::ops::RangeInclusive;
use core::time::Duration;

use std::string::{String, ToString as _};
use std::vec::Vec;
use std::{format, vec};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::times::{nanoseconds, show, time, times};
use super::{Form, Setting, Table, plain};
use crate::spec::{Configure, FieldVisitor, Str, WholeNumber};

/// The rates of a serial port, in baud.
pub const BAUD_RATES: RangeInclusive<u32> = 50..=4_000_000;

impl FieldVisitor for Table<'_> {
    fn source(&mut self, section: Str) -> &mut Self {
        self.source = section;
        self
    }

    fn whole<T: WholeNumber>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: Str,
        about: Str,
        field: &mut T,
    ) {
        let values = self.with_unit(within(&range), unit);
        self.visit(name, number_of(unit), (values, vec![]), shown(*field), about, &mut |value| {
            *field = number(value, &range)?;
            Ok(())
        });
    }

    fn whole_or<T: WholeNumber>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: Str,
        otherwise: Str,
        about: Str,
        field: &mut Option<T>,
    ) {
        let values = self.or(self.with_unit(within(&range), unit), otherwise);
        let default = field.map_or_else(|| self.none(otherwise), shown);
        self.visit(name, number_of(unit), (values, vec![]), default, about, &mut |value| {
            let is_none = value.is_null() || value == otherwise;
            *field = if is_none { None } else { Some(number(value, &range)?) };
            Ok(())
        });
    }

    fn wholes<T: WholeNumber>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: Str,
        about: Str,
        fields: &mut [T],
    ) {
        let values = format!("[{} numbers], each {}", fields.len(), self.with_unit(within(&range), unit));
        let default = fields.iter().copied().map(shown).collect();
        self.visit(name, number_of(unit), (values, vec![]), default, about, &mut |value| {
            let given = value.as_array().ok_or("no list in brackets")?;
            if given.len() != fields.len() {
                return Err("not as many numbers".into());
            }
            let numbers = given.iter().map(|value| number(value, &range)).collect::<Result<Vec<T>, _>>()?;
            fields.copy_from_slice(&numbers);
            Ok(())
        });
    }

    fn real(&mut self, name: &str, range: RangeInclusive<f64>, unit: Str, about: Str, field: &mut f64) {
        let values = self.with_unit(within(&range), unit);
        self.visit(name, number_of(unit), (values, vec![]), shown(*field), about, &mut |value| {
            let number = value.as_f64().ok_or("not a number")?;
            *field = if range.contains(&number) { number } else { return Err("out of range".into()) };
            Ok(())
        });
    }

    fn baud(&mut self, about: Str, field: &mut u32) {
        let range = match self.form {
            Form::Text => BAUD_RATES,
            Form::Nanoseconds => 1..=u32::MAX,
        };
        self.whole("baud", range, "baud", about, field);
    }

    fn flag(&mut self, name: &str, about: Str, field: &mut bool) {
        let values = ("true or false".into(), vec![true.into(), false.into()]);
        self.visit(name, "bool", values, (*field).into(), about, &mut |value| {
            *field = value.as_bool().ok_or("neither true nor false")?;
            Ok(())
        });
    }

    fn time(&mut self, name: &str, range: RangeInclusive<Duration>, about: Str, field: &mut Duration) {
        let form = self.form;
        let (mut values, mut default) = (times(&range, form), self.shown_time(*field));
        if form == Form::Nanoseconds && *range.end() == Duration::MAX {
            values = self.or(values, "never");
        }
        if form == Form::Nanoseconds && *field == Duration::MAX {
            default = Value::Null;
        }
        self.visit(name, "ns", (values, vec![]), default, about, &mut |value| {
            *field = time(value, &range, form)?;
            Ok(())
        });
    }

    fn time_or(
        &mut self,
        name: &str,
        range: RangeInclusive<Duration>,
        otherwise: Str,
        about: Str,
        field: &mut Option<Duration>,
    ) {
        let form = self.form;
        let values = self.or(times(&range, form), otherwise);
        let default = field.map_or_else(|| self.none(otherwise), |time| self.shown_time(time));
        self.visit(name, "ns", (values, vec![]), default, about, &mut |value| {
            *field = match value {
                Value::Null => None,
                value if value == otherwise => None,
                // `null` means no value, so never is the largest number.
                value if form == Form::Nanoseconds && *value == u64::MAX => Some(Duration::MAX),
                value => Some(time(value, &range, form)?),
            };
            Ok(())
        });
    }

    fn choice<T: PartialEq + Copy>(&mut self, name: &str, choices: &[(Str, T)], about: Str, field: &mut T) {
        let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
        let default = choices.iter().find(|(_, value)| value == field).map_or("", |(word, _)| word);
        let default = shown(default);
        let unit = if default.is_number() { "number" } else { "word" };
        let values = (words.join(", "), words.iter().map(shown).collect());
        self.visit(name, unit, values, default, about, &mut |value| {
            let chosen = choices.iter().find(|(word, _)| plain(value) == *word);
            *field = chosen.ok_or("not one of the choices")?.1;
            Ok(())
        });
    }

    fn text(&mut self, name: &str, shape: Str, otherwise: Str, about: Str, field: &mut Option<String>) {
        let (values, default) = (format!("{shape}; without it {otherwise}"), field.clone());
        self.visit(name, "text", (values, vec![]), default.unwrap_or_default().into(), about, &mut |value| {
            let given = matches!(value, Value::String(_) | Value::Number(_) | Value::Bool(_));
            *field = if given { Some(plain(value)) } else { return Err("not a text".into()) };
            Ok(())
        });
    }

    fn parsed<T: Serialize + DeserializeOwned>(&mut self, name: &str, shape: Str, about: Str, field: &mut T) {
        let default = serde_json::to_value(&*field).unwrap_or_default();
        let unit = match &default {
            Value::Array(_) => "list",
            _ => "object",
        };
        self.visit(name, unit, (shape.into(), vec![]), default, about, &mut |value| {
            *field = T::deserialize(value).map_err(|error| error.to_string())?;
            Ok(())
        });
    }

    fn code(&mut self, name: &str, shape: Str, default: Str, about: Str) {
        let source = self.take_source();
        if self.form == Form::Nanoseconds && self.given.is_none() && self.is_visited(name) {
            let (values, default) = (shape.into(), default.into());
            let (name, choices) = (name.into(), vec![]);
            self.visited.push(Setting { name, unit: "code", values, choices, default, about, source });
        }
    }

    fn part(&mut self, name: &str, of: Str, about: Str, part: &mut impl Configure) {
        let (source, first) = (self.take_source(), self.visited.len());
        if !self.is_visited(name) {
            return;
        }
        self.group(name, |fields| part.configure(fields));
        // A list in this form has the part as one field: its type has a list of its own.
        if self.form == Form::Nanoseconds && self.given.is_none() {
            let prefix = format!("{}{name}.", self.prefix);
            let inner = self.visited.split_off(first).into_iter();
            let inner = inner.map(|Setting { name, default, .. }| (name.replacen(&prefix, "", 1), default));
            let default = Value::Object(inner.collect());
            let (name, choices) = (prefix.trim_end_matches('.').into(), vec![]);
            let values = of.into();
            self.visited.push(Setting { name, unit: "object", values, choices, default, about, source });
        }
    }

    fn inline(&mut self, name: &str, of: Str, about: Str, part: &mut impl Configure) {
        if self.form == Form::Nanoseconds {
            return self.part(name, of, about, part);
        }
        let _ = self.take_source();
        if self.is_visited(name) {
            part.configure(self);
        }
    }

    fn group(&mut self, name: &str, visit: impl FnOnce(&mut Self)) {
        let (outer, omitted) = (self.prefix.len(), core::mem::take(&mut self.omitted));
        self.prefix.push_str(name);
        self.prefix.push('.');
        visit(self);
        self.prefix.truncate(outer);
        self.omitted = omitted;
    }

    fn without(&mut self, names: &[Str], visit: impl FnOnce(&mut Self)) {
        let outer = core::mem::replace(&mut self.omitted, names.to_vec());
        visit(self);
        let left = core::mem::replace(&mut self.omitted, outer);
        debug_assert!(left.is_empty(), "{left:?} are not fields of it");
    }
}

impl Table<'_> {
    /// Returns a range with its unit in [`Form::Text`], without it in [`Form::Nanoseconds`].
    fn with_unit(&self, range: String, unit: &str) -> String {
        match self.form {
            Form::Text => format!("{range} {unit}").trim_end().into(),
            Form::Nanoseconds => range,
        }
    }

    /// Returns a range, with the behaviour without a value.
    fn or(&self, range: String, otherwise: &str) -> String {
        match self.form {
            Form::Text => format!("{range}, or {otherwise}"),
            Form::Nanoseconds => format!("{range}; null: {otherwise}"),
        }
    }

    /// Returns a time in the table's form.
    fn shown_time(&self, time: Duration) -> Value {
        match self.form {
            Form::Text => show(time).into(),
            Form::Nanoseconds => nanoseconds(time),
        }
    }

    /// Returns the absence of a value in the table's form.
    fn none(&self, otherwise: &str) -> Value {
        match self.form {
            Form::Text => otherwise.into(),
            Form::Nanoseconds => Value::Null,
        }
    }
}

/// Returns a number as a number, any other value as text.
fn shown(value: impl Display) -> Value {
    let text = value.to_string();
    serde_json::from_str(&text).ok().filter(Value::is_number).unwrap_or(text.into())
}

fn number_of(unit: &'static str) -> &'static str {
    if unit.is_empty() { "number" } else { unit }
}

fn number<T: TryFrom<i64> + PartialOrd>(value: &Value, range: &RangeInclusive<T>) -> Result<T, &'static str> {
    if !value.is_number() || value.is_f64() {
        return Err("not a whole number");
    }
    let number = value.as_i64().and_then(|number| T::try_from(number).ok());
    number.filter(|number| range.contains(number)).ok_or("out of range")
}

fn within<T: Display>(range: &RangeInclusive<T>) -> String {
    let (least, most) = (range.start(), range.end().to_string());
    // A limit of this size is as good as none.
    let open = [u64::from(u32::MAX), u64::MAX].iter().any(|end| end.to_string() == most);
    if open { format!("from {least}") } else { format!("{least} to {most}") }
}
