//! Numbers that the other end chooses, and this end repeats: an order, a transaction.

use std::collections::HashMap;

use cellwire_links::codec::Codec;
use serde_json::Value;

/// The values that the other end has chosen in place of the captured ones, by the name of the field.
#[allow(missing_debug_implementations, reason = "a codec has none")]
#[derive(Default)]
pub(in crate::command) struct Follow {
    chosen: HashMap<(String, String), Value>,
    /// The codec, which names values that a message has in several places; none of an end that polls.
    codec: Option<Box<dyn Codec>>,
    /// Whether a value of this name is a command of the other end; `None`: no value is.
    is_command: Option<IsCommand>,
}

/// Whether a value of this name is a command.
pub(in crate::command) type IsCommand = fn(&str) -> bool;

/// The value names of a message, by JSON pointer.
type Names = HashMap<String, &'static str>;

impl Follow {
    pub(in crate::command) fn new(codec: Option<Box<dyn Codec>>) -> Self {
        Self { chosen: HashMap::new(), codec, is_command: None }
    }

    /// Returns the same for an end whose values with these names are commands.
    pub(in crate::command) fn of_commands(self, is_command: Option<IsCommand>) -> Self {
        Self { is_command, ..self }
    }

    /// Returns whether a message has no content.
    pub(super) fn is_filler(&self, message: &Value) -> bool {
        self.codec.as_ref().is_some_and(|codec| codec.is_filler(message))
    }

    fn commands(&self, name: &str) -> bool {
        self.is_command.is_some_and(|is_command| is_command(name))
    }

    /// Returns whether two messages that are alike differ in a command.
    pub(super) fn differs_in_command(&self, then: &Value, now: &Value) -> bool {
        self.differs(&self.names(then), "", "", then, now)
    }

    fn differs(&self, names: &Names, pointer: &str, key: &str, then: &Value, now: &Value) -> bool {
        match (then, now) {
            (Value::Object(then), Value::Object(now)) => then.iter().any(|(key, then)| {
                now.get(key)
                    .is_some_and(|now| self.differs(names, &format!("{pointer}/{key}"), key, then, now))
            }),
            (Value::Array(then), Value::Array(now)) => {
                let mut pairs = then.iter().zip(now).enumerate();
                pairs.any(|(at, (then, now))| self.differs(names, &format!("{pointer}/{at}"), key, then, now))
            }
            _ => then != now && self.commands(names.get(pointer).copied().unwrap_or(key)),
        }
    }

    fn names(&self, message: &Value) -> Names {
        self.codec.iter().flat_map(|codec| codec.names(message)).collect()
    }

    /// Learns the values in which a message differs from the captured one.
    pub(super) fn learn(&mut self, then: &Value, now: &Value) {
        self.each(&self.names(then), "", "", then, now);
    }

    fn each(&mut self, names: &Names, pointer: &str, key: &str, then: &Value, now: &Value) {
        match (then, now) {
            (Value::Object(then), Value::Object(now)) => {
                for (key, then) in then {
                    if let Some(now) = now.get(key) {
                        self.each(names, &format!("{pointer}/{key}"), key, then, now);
                    }
                }
            }
            (Value::Array(then), Value::Array(now)) => {
                for (at, (then, now)) in then.iter().zip(now).enumerate() {
                    self.each(names, &format!("{pointer}/{at}"), key, then, now);
                }
            }
            // A measured value is not repeated.
            (Value::Number(number), _) if !number.is_u64() => {}
            (Value::Number(_) | Value::String(_), _) if then != now => {
                let name = names.get(pointer).copied().unwrap_or(key);
                if !self.commands(name) {
                    self.chosen.insert((name.into(), then.to_string()), now.clone());
                }
            }
            _ => {}
        }
    }

    /// Returns whether a message is the captured one, as it is or with the values that the other end has chosen.
    pub(super) fn is_same(&self, then: &Value, now: &Value) -> bool {
        then == now || self.followed(then).as_ref() == Some(now)
    }

    /// Returns a captured message with the values that the other end has chosen, if it has chosen any of them.
    pub(in crate::command) fn followed(&self, message: &Value) -> Option<Value> {
        if self.chosen.is_empty() {
            return None;
        }
        let mut followed = message.clone();
        self.put(&self.names(message), "", "", &mut followed).then_some(followed)
    }

    fn put(&self, names: &Names, pointer: &str, key: &str, value: &mut Value) -> bool {
        let mut any = false;
        match value {
            Value::Object(fields) => {
                for (key, value) in fields {
                    any |= self.put(names, &format!("{pointer}/{key}"), key, value);
                }
            }
            Value::Array(values) => {
                for (at, value) in values.iter_mut().enumerate() {
                    any |= self.put(names, &format!("{pointer}/{at}"), key, value);
                }
            }
            _ => {
                let name = names.get(pointer).copied().unwrap_or(key);
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
    use cellwire_links::Link;
    use serde_json::json;

    use super::*;

    #[test]
    fn a_number_is_repeated_as_it_is_chosen_now() {
        let mut follow = Follow::default();
        let reply = json!({"transaction": 1, "unit": 1, "registers": [1, 2]});
        assert_eq!(follow.followed(&reply), None);
        follow.learn(&json!({"transaction": 1, "unit": 1}), &json!({"transaction": 7, "unit": 1}));
        let expected = json!({"transaction": 7, "unit": 1, "registers": [1, 2]});
        assert_eq!(follow.followed(&reply), Some(expected));
        follow.learn(&json!({"fields": ["36047", "4"]}), &json!({"fields": ["100", "4"]}));
        let message = json!({"name": "done", "fields": ["36047", "4", "3604"]});
        assert_eq!(follow.followed(&message), Some(json!({"name": "done", "fields": ["100", "4", "3604"]})));
    }

    #[test]
    fn a_command_is_not_a_number_that_is_chosen() {
        let mut follow = Follow::default().of_commands(Some(|name| name != "transaction"));
        let [then, now] = [(1, 20), (7, 21)].map(|(id, value)| json!({"transaction": id, "values": [value]}));
        let other = json!({"transaction": 7, "values": [20]});
        assert!(follow.differs_in_command(&then, &now) && !follow.differs_in_command(&then, &other));
        follow.learn(&then, &now);
        assert!(!follow.is_same(&then, &now) && follow.is_same(&then, &other));
    }

    /// A plant may have the order number in the header of one message and in a field of another one.
    #[test]
    fn an_order_number_is_the_same_in_headers_and_fields() {
        let link = Link::by_name("kawasaki").unwrap();
        let job = json!({"header": ["order"], "fields": ["number", "work"]});
        let start = json!({"header": ["order"], "fields": ["number"]});
        for roles in [false, true] {
            let given = json!({"roles": roles, "messages": {"job": job, "order_start": start}});
            let codec = (link.codec)("pc", given.as_object().unwrap()).unwrap();
            let mut follow = Follow::new(Some(codec));
            let [then, now] = ["4", "7"].map(|order| match roles {
                false => json!({"name": "TilausAlkaa", "header": [order], "fields": ["1"]}),
                true => {
                    let order: u64 = order.parse().unwrap();
                    json!({"role": "order_start", "values": {"order": order, "number": 1}})
                }
            });
            follow.learn(&then, &now);
            let [ack, expected] = ["4", "7"].map(|order| match roles {
                false => json!({"name": "LoppuKuittaus", "fields": [order, "0", "4"]}),
                true => {
                    let order: u64 = order.parse().unwrap();
                    json!({"role": "end_ack", "values": {"ended": order, "order": 0, "executed": 4}})
                }
            });
            assert_eq!(follow.followed(&ack), Some(expected));
            // A coordinate of a job is not an order.
            let own = match roles {
                false => json!({"name": "Tyo", "header": ["9"], "fields": ["1", "2", "4", "4", "4", "4"]}),
                true => json!({"role": "job", "values": {"number": 1}, "work": ["2", "4", "4", "4", "4"]}),
            };
            assert_eq!(follow.followed(&own), None);
        }
    }
}
