//! The kinds of settings.

use core::fmt::Display;
use core::ops::RangeInclusive;
use std::time::Duration;

use anyhow::Result;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::{Table, plain};

/// The rates of a serial line, in baud.
pub const BAUD_RATES: RangeInclusive<u32> = 50..=4_000_000;

/// Any time, also none and for ever.
pub const ANY_TIME: RangeInclusive<Duration> = Duration::ZERO..=Duration::MAX;

/// A time above zero, also for ever.
pub const SOME_TIME: RangeInclusive<Duration> = Duration::from_nanos(1)..=Duration::MAX;

impl Table<'_> {
    /// A whole number within a range.
    pub fn whole<T>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: &str,
        about: &'static str,
        field: &mut T,
    ) where
        T: TryFrom<i64> + PartialOrd + Display,
    {
        let values = within(range.start(), range.end(), unit);
        self.visit(name, about, values, field.to_string(), |value| {
            *field = number(value, &range)?;
            Ok(())
        });
    }

    /// A whole number within a range, or what happens by default, which `otherwise` names.
    pub fn whole_or<T>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        otherwise: &'static str,
        about: &'static str,
        field: &mut Option<T>,
    ) where
        T: TryFrom<i64> + PartialOrd + Display,
    {
        let values = format!("{}, or {otherwise}", within(range.start(), range.end(), ""));
        let default = field.as_ref().map_or_else(|| otherwise.into(), ToString::to_string);
        self.visit(name, about, values, default, |value| {
            *field = if value == otherwise { None } else { Some(number(value, &range)?) };
            Ok(())
        });
    }

    /// Whole numbers within a range, as many as there are fields.
    pub fn wholes<T>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: &str,
        about: &'static str,
        fields: &mut [T],
    ) where
        T: TryFrom<i64> + PartialOrd + Display + Copy,
    {
        let each = within(range.start(), range.end(), unit);
        let default = fields.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
        let values = format!("[{} numbers], each {each}", fields.len());
        self.visit(name, about, values, format!("[{default}]"), |value| {
            let given = value.as_array().filter(|given| given.len() == fields.len());
            let given = given.ok_or("not as many numbers")?;
            let numbers = given.iter().map(|value| number(value, &range)).collect::<Result<Vec<T>, _>>()?;
            fields.copy_from_slice(&numbers);
            Ok(())
        });
    }

    /// A number within a range.
    pub fn real(
        &mut self,
        name: &str,
        range: RangeInclusive<f64>,
        unit: &str,
        about: &'static str,
        field: &mut f64,
    ) {
        let values = within(range.start(), range.end(), unit);
        self.visit(name, about, values, field.to_string(), |value| {
            let number = value.as_f64().ok_or("not a number")?;
            *field = if range.contains(&number) { number } else { return Err("out of range".into()) };
            Ok(())
        });
    }

    /// A baud rate.
    pub fn baud(&mut self, field: &mut u32) {
        self.whole("baud", BAUD_RATES, "baud", "the rate of the serial line, 10 bits a byte", field);
    }

    /// `true` or `false`.
    pub fn flag(&mut self, name: &str, about: &'static str, field: &mut bool) {
        self.visit(name, about, "true or false".into(), field.to_string(), |value| {
            *field = value.as_bool().ok_or("neither true nor false")?;
            Ok(())
        });
    }

    /// A time with its unit.
    pub fn time(
        &mut self,
        name: &str,
        range: RangeInclusive<Duration>,
        about: &'static str,
        field: &mut Duration,
    ) {
        self.visit(name, about, times(&range), show(*field), |value| {
            *field = time(value, &range)?;
            Ok(())
        });
    }

    /// A time with its unit, or what happens without one, which `otherwise` names.
    pub fn time_or(
        &mut self,
        name: &str,
        range: RangeInclusive<Duration>,
        otherwise: &'static str,
        about: &'static str,
        field: &mut Option<Duration>,
    ) {
        let default = field.map_or_else(|| otherwise.into(), show);
        self.visit(name, about, format!("{}, or {otherwise}", times(&range)), default, |value| {
            *field = if value == otherwise { None } else { Some(time(value, &range)?) };
            Ok(())
        });
    }

    /// One of a few words, or of a few numbers.
    pub fn choice<T: PartialEq + Copy>(
        &mut self,
        name: &str,
        choices: &[(&str, T)],
        about: &'static str,
        field: &mut T,
    ) {
        let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
        let default = choices.iter().find(|(_, value)| value == field).map_or("", |(word, _)| word);
        self.visit(name, about, words.join(", "), default.into(), |value| {
            let chosen = choices.iter().find(|(word, _)| plain(value) == *word);
            *field = chosen.ok_or("not one of the choices")?.1;
            Ok(())
        });
    }

    /// A text such as the name of a file; without one happens what `otherwise` says.
    pub fn text(
        &mut self,
        name: &str,
        shape: &'static str,
        otherwise: &'static str,
        about: &'static str,
        field: &mut Option<String>,
    ) {
        let (values, default) = (format!("{shape}; without it {otherwise}"), field.clone());
        self.visit(name, about, values, default.unwrap_or_default(), |value| {
            let given = matches!(value, Value::String(_) | Value::Number(_) | Value::Bool(_));
            *field = if given { Some(plain(value)) } else { return Err("not a text".into()) };
            Ok(())
        });
    }

    /// A value with parts, in the shape that its `serde` form has; `default` says what it is where none is given.
    pub fn parsed<T: DeserializeOwned>(
        &mut self,
        name: &str,
        shape: &'static str,
        default: impl Into<String>,
        about: &'static str,
        field: &mut T,
    ) {
        self.visit(name, about, shape.into(), default.into(), |value| {
            *field = T::deserialize(value).map_err(|error| error.to_string())?;
            Ok(())
        });
    }

    /// A table of the plant's own, as it is in the file.
    pub fn table(
        &mut self,
        name: &str,
        shape: &'static str,
        about: &'static str,
        field: &mut Option<Map<String, Value>>,
    ) {
        self.visit(name, about, shape.into(), "built in".into(), |value| {
            *field = Some(value.as_object().cloned().ok_or("not a table")?);
            Ok(())
        });
    }
}

/// A value of numbers and names, as JSON.
pub fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

fn number<T: TryFrom<i64> + PartialOrd>(value: &Value, range: &RangeInclusive<T>) -> Result<T, &'static str> {
    if !value.is_number() || value.is_f64() {
        return Err("not a whole number");
    }
    let number = value.as_i64().and_then(|number| T::try_from(number).ok());
    number.filter(|number| range.contains(number)).ok_or("out of range")
}

fn within(least: &impl Display, most: &impl Display, unit: &str) -> String {
    let most = most.to_string();
    // As good as no end.
    let open = [u64::from(u32::MAX), u64::MAX].iter().any(|end| end.to_string() == most);
    let range = if open { format!("from {least}") } else { format!("{least} to {most}") };
    format!("{range} {unit}").trim_end().into()
}

fn time(value: &Value, range: &RangeInclusive<Duration>) -> Result<Duration, &'static str> {
    const NO_TIME: &str = "not a time with its unit, such as 250ms or 1.5s";
    // Nothing is nothing in every unit.
    let text = if *value == 0 { "0s" } else { value.as_str().ok_or(NO_TIME)?.trim() };
    let time = match text {
        "never" => Duration::MAX,
        _ => fraction(text).or_else(|| humantime::parse_duration(text).ok()).ok_or(NO_TIME)?,
    };
    if range.contains(&time) { Ok(time) } else { Err("out of range") }
}

/// A number with one unit, such as `1.5s`.
fn fraction(text: &str) -> Option<Duration> {
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let (number, unit) = text.split_at_checked(digits)?;
    let unit = unit.trim();
    if !unit.chars().all(char::is_alphabetic) {
        return None;
    }
    let unit = humantime::parse_duration(&format!("1{unit}")).ok()?;
    Duration::try_from_secs_f64(number.parse::<f64>().ok()? * unit.as_secs_f64()).ok()
}

fn times(range: &RangeInclusive<Duration>) -> String {
    match (*range.start(), *range.end()) {
        (Duration::ZERO, Duration::MAX) => "a time, or never".into(),
        (least, Duration::MAX) if least <= Duration::from_nanos(1) => "a time above 0, or never".into(),
        (least, Duration::MAX) => format!("a time from {}, or never", show(least)),
        (least, most) => format!("{} to {}", show(least), show(most)),
    }
}

fn show(time: Duration) -> String {
    match time {
        Duration::MAX => "never".into(),
        time => humantime::format_duration(time).to_string().replace(' ', ""),
    }
}
