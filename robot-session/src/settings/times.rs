//! Times: as text with a unit, or as nanoseconds.

use core::ops::RangeInclusive;
use core::time::Duration;
use std::format;
use std::string::{String, ToString as _};

use serde_json::Value;

use super::Form;

pub(super) fn time(
    value: &Value,
    range: &RangeInclusive<Duration>,
    form: Form,
) -> Result<Duration, &'static str> {
    let time = match (form, value) {
        // Zero needs no unit.
        (Form::Text, value) if *value == 0 => Duration::ZERO,
        (Form::Text, value) => value
            .as_str()
            .and_then(|text| with_unit(text.trim()))
            .ok_or("not a time with its unit, such as 250ms or 1.5s")?,
        (Form::Nanoseconds, Value::Null) => Duration::MAX,
        (Form::Nanoseconds, value) => Duration::from_nanos(value.as_u64().ok_or("not in nanoseconds")?),
    };
    if range.contains(&time) { Ok(time) } else { Err("out of range") }
}

fn with_unit(text: &str) -> Option<Duration> {
    match text {
        "never" => Some(Duration::MAX),
        _ => humantime::parse_duration(text).ok(),
    }
}

/// Returns the text of the accepted times.
pub(super) fn times(range: &RangeInclusive<Duration>, form: Form) -> String {
    const INSTANT: Duration = Duration::from_nanos(1);
    let (least, most) = (*range.start(), *range.end());
    // The excluded time, if `least` is 1 ns more than a whole number of microseconds.
    let above = least.checked_sub(INSTANT).filter(|above| above.subsec_nanos() % 1000 == 0).map(zero_or);
    match (form, above) {
        _ if most < Duration::MAX => format!("{} to {}", show(least), show(most)),
        (Form::Text, _) if least.is_zero() => "a time, or never".into(),
        (Form::Text, Some(above)) => format!("a time above {above}, or never"),
        (Form::Text, None) => format!("a time from {}, or never", show(least)),
        (Form::Nanoseconds, Some(above)) => format!("above {above}"),
        (Form::Nanoseconds, None) => format!("from {}", zero_or(least)),
    }
}

/// Returns a time as text; zero without a unit.
fn zero_or(time: Duration) -> String {
    if time.is_zero() { "0".into() } else { show(time) }
}

pub(super) fn show(time: Duration) -> String {
    match time {
        Duration::MAX => "never".into(),
        time => humantime::format_duration(time).to_string().replace(' ', ""),
    }
}

/// Returns a time in nanoseconds; never is the largest number.
pub(super) fn nanoseconds(time: Duration) -> Value {
    u64::try_from(time.as_nanos()).unwrap_or(u64::MAX).into()
}
