//! Values that are nearly right.

use arbitrary::Arbitrary;
use serde_json::Value;

/// A change of a value in one place: a leaf becomes another of its kind, a list longer or shorter.
#[derive(Debug, Clone, Arbitrary)]
pub struct Change {
    /// The place among all values, counted on from the first again after the last.
    place: u16,
    /// The rule by which a number is replaced.
    how: u8,
    /// The number, the text, or the length of the list.
    bits: u64,
}

impl Change {
    /// Changes a value.
    pub fn apply(&self, value: &mut Value) {
        let place = usize::from(self.place) % places(value);
        visit(value, place, &mut |value| self.replace(value));
    }

    fn replace(&self, value: &mut Value) {
        let [first, second, third, text @ ..] = self.bits.to_le_bytes().map(usize::from);
        *value = match core::mem::take(value) {
            Value::Bool(value) => (!value).into(),
            Value::Number(number) if number.is_f64() => self.real(number.as_f64().unwrap_or_default()).into(),
            Value::Number(number) => self.whole(number.as_i64().unwrap_or_default()).into(),
            Value::Null => self.whole(0).into(),
            Value::String(old) => {
                let mut new: Vec<char> = old.chars().collect();
                let from = first % (new.len() + 1);
                let to = from + second % (new.len() - from + 1);
                new.splice(from..to, text.map(|byte| char::from(byte as u8)).into_iter().take(third % 6));
                String::from_iter(new).into()
            }
            Value::Array(values) => {
                let length = if values.is_empty() { 0 } else { first % (2 * values.len() + 2) };
                values.iter().cycle().take(length).cloned().collect()
            }
            object => object,
        };
    }

    fn whole(&self, number: i64) -> i64 {
        match self.how % 5 {
            0 => number.wrapping_add(i64::from(self.bits as i8)),
            1 => (self.bits as u8).into(),
            2 => (self.bits as u16).into(),
            3 => (self.bits as i32).into(),
            _ => self.bits.cast_signed(),
        }
    }

    /// Returns a number with so few digits that 32 bits can represent it.
    fn real(&self, number: f64) -> f64 {
        let number = match self.how % 3 {
            0 => number + f64::from(self.bits as i8) / 1000.0,
            1 => f64::from(self.bits as i32) / 1000.0,
            _ => f64::from(self.bits as i8) * 10f64.powi((self.bits >> 8) as i32 & 31),
        };
        serde_json::from_str(&serde_json::to_string(&(number as f32)).unwrap()).unwrap()
    }
}

/// Returns the number of values in a value, including itself.
fn places(value: &Value) -> usize {
    1 + match value {
        Value::Array(values) => values.iter().map(places).sum(),
        Value::Object(values) => values.values().map(places).sum::<usize>(),
        _ => 0,
    }
}

/// Calls `act` with the value at an index, or returns the index less the number of values that were passed.
fn visit(value: &mut Value, place: usize, act: &mut impl FnMut(&mut Value)) -> Option<usize> {
    let Some(left) = place.checked_sub(1) else {
        act(value);
        return None;
    };
    match value {
        Value::Array(values) => values.iter_mut().try_fold(left, |left, value| visit(value, left, act)),
        Value::Object(values) => values.values_mut().try_fold(left, |left, value| visit(value, left, act)),
        _ => Some(left),
    }
}
