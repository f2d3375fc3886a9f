//! Values that are nearly right.

use serde_json::Value;

use robot_session::contract::Rng;

/// Changes a value in one place: a leaf becomes another of its kind, a list longer or shorter.
pub fn change(value: &mut Value, rng: &mut Rng) {
    let place = rng.below(places(value));
    visit(value, place, &mut |value| replace(value, rng));
}

/// The values in a value, itself among them.
fn places(value: &Value) -> usize {
    1 + match value {
        Value::Array(values) => values.iter().map(places).sum(),
        Value::Object(values) => values.values().map(places).sum::<usize>(),
        _ => 0,
    }
}

/// Calls `act` with the value of a place, or says how many places fewer are left.
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

fn replace(value: &mut Value, rng: &mut Rng) {
    *value = match core::mem::take(value) {
        Value::Bool(value) => (!value).into(),
        Value::Number(number) if number.is_f64() => real(number.as_f64().unwrap_or_default(), rng).into(),
        Value::Number(number) => whole(number.as_i64().unwrap_or_default(), rng).into(),
        Value::Null => whole(0, rng).into(),
        Value::String(text) => {
            let mut text: Vec<char> = text.chars().collect();
            let from = rng.below(text.len() + 1);
            let to = from + rng.below(text.len() - from + 1);
            text.splice(from..to, (0..rng.below(8)).map(|_| char::from(rng.below(256) as u8)));
            String::from_iter(text).into()
        }
        Value::Array(values) => {
            let length = rng.below(2 * values.len() + 2);
            values.iter().cycle().take(if values.is_empty() { 0 } else { length }).cloned().collect()
        }
        object => object,
    };
}

fn whole(number: i64, rng: &mut Rng) -> i64 {
    let bits = rng.next_u64();
    match rng.below(5) {
        0 => number.wrapping_add(i64::from(bits as i8)),
        1 => (bits as u8).into(),
        2 => (bits as u16).into(),
        3 => (bits as i32).into(),
        _ => bits.cast_signed(),
    }
}

/// A number that has so few digits that 32 bits hold it.
fn real(number: f64, rng: &mut Rng) -> f64 {
    let bits = rng.next_u64();
    let number = match rng.below(3) {
        0 => number + f64::from(bits as i8) / 1000.0,
        1 => f64::from(bits as i32) / 1000.0,
        _ => f64::from(bits as i8) * 10f64.powi((bits >> 8) as i32 & 31),
    };
    serde_json::from_str(&serde_json::to_string(&(number as f32)).unwrap()).unwrap()
}
