//! Messages without a plant's own contents.

use std::collections::BTreeMap;

use serde_json::{Number, Value};

use super::message::Message;
use crate::command::codec::LinkArgs;
use cellwire_io::output::{counted, remark};

/// Fields whose numbers are positions, or measured.
const MEASURED: [&str; 8] = ["f32", "registers", "values", "transform", "pose", "axes", "force", "moment"];
/// Fields whose texts may name something.
const TEXTS: [&str; 3] = ["char", "header", "fields"];
/// Texts of so few digits are kinds and counts.
const MAX_KIND_LEN: usize = 2;

/// Replaces values, and counts them.
pub(super) struct Anonymous<'a> {
    of: &'a LinkArgs,
    replaced: BTreeMap<String, usize>,
    left_out: usize,
}

impl<'a> Anonymous<'a> {
    pub(super) fn new(of: &'a LinkArgs) -> Self {
        Self { of, replaced: BTreeMap::new(), left_out: 0 }
    }

    /// Makes a message anonymous; returns whether the message can be shown.
    pub(super) fn replace(&mut self, message: &mut Message) -> bool {
        let Some(side) = message.side else { return true };
        if let Ok(content) = &mut message.content {
            let mut changed = content.clone();
            self.values("", &mut changed);
            if let Ok(codec) = self.of.codec_of(side)
                && let Ok(bytes) = codec.encode(changed.clone())
            {
                (*content, message.bytes) = (changed, bytes);
                return true;
            }
        }
        self.left_out += 1;
        false
    }

    /// Numbers become the place that they have in their message.
    fn values(&mut self, name: &str, value: &mut Value) {
        match value {
            Value::Object(fields) => fields.iter_mut().for_each(|(name, value)| self.values(name, value)),
            Value::Array(values) => {
                for (place, value) in values.iter_mut().enumerate() {
                    match value {
                        Value::Number(number) if MEASURED.contains(&name) => {
                            *number = like(number, place);
                            self.count(name);
                        }
                        Value::String(text) if TEXTS.contains(&name) => self.text(name, text),
                        _ => self.values(name, value),
                    }
                }
            }
            Value::String(text) if TEXTS.contains(&name) => self.text(name, text),
            _ => {}
        }
    }

    /// Replaces a text by one of the same length.
    fn text(&mut self, name: &str, text: &mut String) {
        let is_number = text.parse::<f64>().is_ok();
        if text.is_empty() || is_number && text.len() <= MAX_KIND_LEN {
            return;
        }
        let replaced: String = text
            .chars()
            .map(|letter| match letter {
                '0'..='9' => '1',
                letter if letter.is_alphabetic() && !is_number => 'a',
                letter => letter,
            })
            .collect();
        if replaced != *text {
            *text = replaced;
            self.count(name);
        }
    }

    fn count(&mut self, name: &str) {
        *self.replaced.entry(name.to_owned()).or_default() += 1;
    }

    /// Prints the replaced and the unchanged parts.
    pub(super) fn report(&self) {
        let what: Vec<String> =
            self.replaced.iter().map(|(name, count)| format!("{count} in `{name}`")).collect();
        let what = if what.is_empty() { "nothing".to_owned() } else { what.join(", ") };
        remark(&format!(
            "replaced: {what}; not replaced: message names, addresses, words, codes, booleans and times; check the file before you share it"
        ));
        if self.left_out > 0 {
            remark(&format!(
                "left out: {}, not a message or not to be encoded",
                counted(self.left_out, "piece")
            ));
        }
    }
}

/// Returns a number of the same kind.
fn like(number: &Number, place: usize) -> Number {
    if number.is_f64() {
        #[expect(clippy::cast_precision_loss, reason = "a message has few values")]
        return Number::from_f64(place as f64).unwrap_or_else(|| number.clone());
    }
    Number::from(place)
}
