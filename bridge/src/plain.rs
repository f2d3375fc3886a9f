//! Records as plain JSON, for subscribers that do not decode Sparkplug.

use serde_json::{Map, Value as Json, json};

use crate::metric::NUMBER;
use crate::payload::{Metric, Value};

/// Returns the message of a record of a cell.
pub fn message(cell: &str, metrics: &[Metric], is_historical: bool) -> Vec<u8> {
    let mut values = Map::new();
    let (mut number, mut time) = (Json::Null, None);
    for metric in metrics {
        let (Some(name), value) = (&metric.name, json(metric.value.as_ref())) else { continue };
        time = time.max(metric.timestamp);
        if name == NUMBER {
            number = value;
        } else {
            values.insert(name.clone(), value);
        }
    }
    let record =
        json!({"cell": cell, "number": number, "time": time, "historical": is_historical, "metrics": values});
    record.to_string().into_bytes()
}

fn json(value: Option<&Value>) -> Json {
    match value {
        None => Json::Null,
        Some(Value::Int(value)) => (*value).into(),
        Some(Value::Long(value)) => value.cast_signed().into(),
        // The shortest number that is the same in single precision.
        Some(Value::Float(value)) => value.to_string().parse::<f64>().map_or(Json::Null, Json::from),
        Some(Value::Double(value)) => (*value).into(),
        Some(Value::Boolean(value)) => (*value).into(),
        Some(Value::String(value)) => value.as_str().into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::{text, whole};
    use crate::payload::{Kind, Quality};

    #[test]
    fn a_record_is_an_object() {
        let metrics = [
            Metric::new(NUMBER, Kind::Int64, 7, Some(whole(12))),
            Metric::new("P/X", Kind::Float, 7, Some(Value::Float(0.1))),
            Metric::new("N", Kind::Int64, 7, Some(whole(-3))),
            Metric::new("Phase", Kind::String, 7, Some(text("a \"b\""))),
            Metric::null("P/Y", Kind::Float, 7, Quality::Stale),
        ];
        let text = String::from_utf8(message("c", &metrics, true)).unwrap();
        let values = r#"{"P/X":0.1,"N":-3,"Phase":"a \"b\"","P/Y":null}"#;
        let wanted = format!(r#"{{"cell":"c","number":12,"time":7,"historical":true,"metrics":{values}}}"#);
        assert_eq!(text, wanted);
    }
}
