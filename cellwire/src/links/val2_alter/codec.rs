use std::collections::VecDeque;

use anyhow::{Result, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use val2_alter::{Decoder, Frame, Framing, HostMessage, Message, RobotMessage};

use crate::codec::Codec;
use crate::links::CodecOptions;

/// What the `robot` or the `host` sends. The settings are the fields of [`Framing`].
///
/// # Errors
/// When a setting is unknown or has no such value.
pub fn codec(side: &str, options: &CodecOptions) -> Result<Box<dyn Codec>> {
    let framing = serde_json::from_value(Value::Object(options.settings.clone()))?;
    match side {
        "robot" => Ok(Box::new(Side::<RobotMessage>::new(framing))),
        "host" => Ok(Box::new(Side::<HostMessage>::new(framing))),
        _ => bail!("val2-alter has no side `{side}`"),
    }
}

/// The decoder names an error when it meets it; how far the damage reaches shows when the next message begins.
struct Side<M> {
    decoder: Decoder<M>,
    framing: Framing,
    taken: u64,
    finished: bool,
    damage: Option<Value>,
    items: VecDeque<(Result<Value, Value>, u64)>,
    told: u64,
    position: u64,
}

impl<M: Message + Serialize> Side<M> {
    fn new(framing: Framing) -> Self {
        Self {
            decoder: Decoder::new(framing),
            framing,
            taken: 0,
            finished: false,
            damage: None,
            items: VecDeque::new(),
            told: 0,
            position: 0,
        }
    }

    fn read(&mut self) {
        while let Some(outcome) = self.decoder.next_frame() {
            match outcome {
                Ok(received) => {
                    self.damage_until(received.offset as u64);
                    let message = serde_json::to_value(received.message).unwrap_or_default();
                    self.tell(Ok(message), (received.offset + received.length) as u64);
                }
                Err(error) => {
                    self.damage_until(error.offset() as u64);
                    self.damage.get_or_insert_with(|| serde_json::to_value(error).unwrap_or_default());
                }
            }
        }
        if self.finished {
            self.damage_until(self.taken);
        }
    }

    fn damage_until(&mut self, end: u64) {
        if end > self.told {
            let noise = json!({"kind": "start_mark", "offset": self.told, "length": end - self.told});
            let damage = self.damage.take().unwrap_or(noise);
            self.tell(Err(damage), end);
        }
    }

    fn tell(&mut self, item: Result<Value, Value>, end: u64) {
        self.items.push_back((item, end));
        self.told = end;
    }
}

impl<M: Message + Serialize + DeserializeOwned> Codec for Side<M> {
    fn push(&mut self, bytes: &[u8]) -> usize {
        let taken = self.decoder.push(bytes);
        self.taken += taken as u64;
        taken
    }

    fn next(&mut self) -> Option<Result<Value, Value>> {
        if self.items.is_empty() {
            self.read();
        }
        let (item, end) = self.items.pop_front()?;
        self.position = end;
        Some(item)
    }

    fn finish(&mut self) {
        self.decoder.finish();
        self.finished = true;
    }

    fn position(&self) -> u64 {
        self.position
    }

    fn encode(&self, message: Value) -> Result<Vec<u8>> {
        let message: M = serde_json::from_value(message)?;
        let mut frame = [0; Frame::MAX_LEN];
        let length = message.encode(self.framing, &mut frame)?;
        Ok(frame.get(..length).unwrap_or_default().to_vec())
    }
}
