//! Numbers that the other end chooses, and this end repeats: an order, a transaction.

use std::collections::HashMap;

use serde_json::Value;

/// What the other end has chosen in the place of what it chose then, by the name of the field.
#[derive(Debug, Default)]
pub(in crate::command) struct Follow {
    chosen: HashMap<(String, String), Value>,
}

impl Follow {
    /// A message of then has come with other values.
    pub(super) fn learn(&mut self, then: &Value, now: &Value) {
        self.each(String::new(), then, now);
    }

    fn each(&mut self, name: String, then: &Value, now: &Value) {
        match (then, now) {
            (Value::Object(then), Value::Object(now)) => {
                for (name, then) in then {
                    if let Some(now) = now.get(name) {
                        self.each(name.clone(), then, now);
                    }
                }
            }
            (Value::Array(then), Value::Array(now)) => {
                then.iter().zip(now).for_each(|(then, now)| self.each(name.clone(), then, now));
            }
            // What was measured is no number that is repeated.
            (Value::Number(number), _) if !number.is_u64() => {}
            (Value::Number(_) | Value::String(_), _) if then != now => {
                self.chosen.insert((name, then.to_string()), now.clone());
            }
            _ => {}
        }
    }

    /// Puts what the other end has chosen into a message of this end; whether there was any.
    pub(in crate::command) fn apply(&self, message: &mut Value) -> bool {
        !self.chosen.is_empty() && self.put("", message)
    }

    fn put(&self, name: &str, value: &mut Value) -> bool {
        let mut any = false;
        match value {
            Value::Object(fields) => fields.iter_mut().for_each(|(name, value)| any |= self.put(name, value)),
            Value::Array(values) => values.iter_mut().for_each(|value| any |= self.put(name, value)),
            _ => {
                if let Some(chosen) = self.chosen.get(&(name.to_owned(), value.to_string())) {
                    *value = chosen.clone();
                    any = true;
                }
            }
        }
        any
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_number_is_repeated_as_it_is_chosen_now() {
        let mut follow = Follow::default();
        let mut reply = json!({"transaction": 1, "unit": 1, "registers": [1, 2]});
        assert!(!follow.apply(&mut reply));
        follow.learn(&json!({"transaction": 1, "unit": 1}), &json!({"transaction": 7, "unit": 1}));
        assert!(follow.apply(&mut reply));
        assert_eq!(reply, json!({"transaction": 7, "unit": 1, "registers": [1, 2]}));
        follow.learn(&json!({"fields": ["36047", "4"]}), &json!({"fields": ["100", "4"]}));
        let mut message = json!({"name": "done", "fields": ["36047", "4", "3604"]});
        assert!(follow.apply(&mut message));
        assert_eq!(message, json!({"name": "done", "fields": ["100", "4", "3604"]}));
    }
}
