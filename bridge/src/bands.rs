//! Report by exception: a metric is reported when it has changed by more than its dead band.

use std::collections::{BTreeMap, HashMap};

use anyhow::{Result, ensure};

use crate::metric::{COMMON, Definition, NamedValue};
use crate::payload::{Kind, Value};

/// The dead bands of a cell's metrics.
#[derive(Debug, Clone, PartialEq)]
pub struct Bands(HashMap<&'static str, f64>);

impl Bands {
    /// Makes the dead bands from the site file, by metric or folder of metrics. The longest name that fits counts; a metric
    /// without a dead band is reported whenever it changes.
    ///
    /// # Errors
    /// If a name is neither a metric nor a folder, or a metric without a dead band.
    pub fn of(given: &BTreeMap<String, f64>, definitions: &[Definition]) -> Result<Self> {
        let own = || definitions.iter().filter(|definition| !COMMON.contains(definition));
        for (name, band) in given {
            let mut found = own().filter(|definition| fits(name, definition.name)).peekable();
            ensure!(
                found.peek().is_some(),
                "{name} is neither a metric of this link nor a folder of metrics"
            );
            ensure!(
                found.any(|definition| !matches!(definition.kind, Kind::String | Kind::Boolean)),
                "{name} is not a number: every change is reported"
            );
            ensure!(band.is_finite() && *band >= 0.0, "the dead band of {name} is {band}: give 0 or more");
        }
        let band = |definition: &Definition| {
            let fitting = given.iter().filter(|(name, _)| fits(name, definition.name));
            (definition.name, fitting.max_by_key(|(name, _)| name.len()).map_or(0.0, |(_, band)| *band))
        };
        Ok(Self(own().map(band).collect()))
    }

    /// Removes the metrics that are not to be reported: `last` returns the value of a metric that was reported last.
    pub fn filter<'a>(&self, named: &mut Vec<NamedValue>, last: impl Fn(&str) -> Option<&'a Value>) {
        named.retain(|(name, value)| match (self.0.get(name), last(name)) {
            (Some(band), Some(last)) => is_exception(last, value, *band),
            // For a metric without a value, a value that is not finite is not news.
            (Some(_), None) => !matches!(value, Value::Float(value) if !value.is_finite()),
            (None, _) => true,
        });
    }
}

fn fits(name: &str, metric: &str) -> bool {
    metric.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

#[expect(clippy::cast_precision_loss, reason = "a band is a double")]
fn is_exception(last: &Value, value: &Value, band: f64) -> bool {
    let number = |value: &Value| match value {
        Value::Int(value) => Some(f64::from(*value)),
        Value::Long(value) => Some(value.cast_signed() as f64),
        Value::Float(value) => Some(f64::from(*value)),
        Value::Double(value) => Some(*value),
        Value::Boolean(_) | Value::String(_) => None,
    };
    match (number(last), number(value)) {
        // A change that is not a number is an exception, too.
        (Some(last), Some(value)) => {
            let change = (value - last).abs();
            change.is_nan() || change > band
        }
        _ => last != value,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::{NUMBER, define, text, whole};

    const OWN: [Definition; 4] = [
        define("P/X", Kind::Float),
        define("P/Y", Kind::Float),
        define("Life", Kind::Int64),
        define("Phase", Kind::String),
    ];

    #[test]
    fn what_has_changed_by_more_than_its_band_is_left() {
        let given = [("P".to_owned(), 0.5), ("P/Y".to_owned(), 2.0)].into();
        let bands = Bands::of(&given, &OWN).unwrap();
        let last = [
            ("P/X", Value::Float(1.0)),
            ("P/Y", Value::Float(1.0)),
            ("Life", whole(7)),
            ("Phase", text("run")),
            (NUMBER, whole(1)),
        ];
        let left = |mut named: Vec<NamedValue>| {
            bands.filter(&mut named, |name| last.iter().find(|(it, _)| *it == name).map(|(_, value)| value));
            named.into_iter().map(|(name, _)| name).collect::<Vec<_>>()
        };
        let same = vec![("P/X", Value::Float(1.5)), ("P/Y", Value::Float(-1.0)), ("Life", whole(7))];
        assert_eq!(left([same, vec![("Phase", text("run"))]].concat()), Vec::<&str>::new());
        let other = vec![("P/X", Value::Float(0.4)), ("P/Y", Value::Float(3.1)), ("Life", whole(8))];
        assert_eq!(left(other), ["P/X", "P/Y", "Life"]);
        assert_eq!(
            left(vec![("Phase", text("stop")), (NUMBER, whole(1)), ("P/X", Value::Float(f32::NAN))]).len(),
            3
        );
        let mut named = vec![("P/X", Value::Float(f32::NAN)), ("P/Y", Value::Float(0.0))];
        bands.filter(&mut named, |_| None);
        assert_eq!(named, [("P/Y", Value::Float(0.0))]);
    }

    #[test]
    fn a_name_that_is_none_is_said() {
        let why =
            |name: &str, band| Bands::of(&[(name.to_owned(), band)].into(), &OWN).unwrap_err().to_string();
        assert_eq!(why("P/Z", 1.0), "P/Z is neither a metric of this link nor a folder of metrics");
        assert_eq!(why("Event", 1.0), "Event is neither a metric of this link nor a folder of metrics");
        assert_eq!(why("Phase", 1.0), "Phase is not a number: every change is reported");
        assert_eq!(why("P", -1.0), "the dead band of P is -1: give 0 or more");
    }
}
