//! The edge node of Sparkplug B: topics, births, deaths and the numbers of messages. It sends nothing itself.

use prost::Message;

use super::metric::{self, Definition, text, whole};
use super::payload::{Kind, Metric, Payload, Value};

/// The first level of every topic of Sparkplug B.
const NAMESPACE: &str = "spBv1.0";
/// The longest message that is taken as a command, in bytes.
const MAX_COMMAND_LEN: usize = 256 * 1024;
/// The metric that requests all births again when written.
const REBIRTH: &str = "Node Control/Rebirth";
/// The metric that ties a death to its birth.
const BD_SEQ: &str = "bdSeq";

/// The edge node during one connection.
#[derive(Debug)]
pub struct Node {
    group: String,
    node: String,
    /// The number of the connection, 0 to 255.
    bd_seq: u8,
    /// The number of the next message.
    seq: u8,
}

/// A message to publish. Its number is used up by [`Node::published`].
#[derive(Debug, PartialEq)]
pub struct Publication {
    /// The topic of the message.
    pub topic: String,
    /// The payload of the message.
    pub payload: Vec<u8>,
}

/// The meaning of a message from the broker.
#[derive(Debug, PartialEq)]
pub enum NodeMessage {
    /// All births are requested again.
    Rebirth,
    /// Metrics of a device are to be written.
    Write {
        /// The device, which is the name of a cell.
        device: String,
        /// The metrics to write, as the message has them.
        payload: Payload,
        /// The reason to refuse the command; `None` if there is no such reason.
        unfit: Option<String>,
    },
    /// The state of a host application.
    State {
        /// The name of the host application.
        host: String,
        /// Whether the host application is online.
        online: bool,
        /// The time since which it is so, in milliseconds since 1970 UTC.
        timestamp: u64,
    },
    /// The node does not understand the message; the reason.
    Malformed(String),
    /// A retained message was cleared.
    Nothing,
}

impl Node {
    /// Makes a node at the beginning of the connection of this number.
    pub fn new(group: &str, node: &str, bd_seq: u8) -> Self {
        Self { group: group.into(), node: node.into(), bd_seq, seq: 0 }
    }

    fn topic(&self, kind: &str, device: Option<&str>) -> String {
        let Self { group, node, .. } = self;
        let device = device.map(|device| format!("/{device}")).unwrap_or_default();
        format!("{NAMESPACE}/{group}/{kind}/{node}{device}")
    }

    /// Returns the topics of commands to the node and its devices.
    pub fn subscriptions(&self) -> [String; 2] {
        [self.topic("NCMD", None), self.topic("DCMD", Some("+"))]
    }

    /// Returns the topic of a host application's state.
    pub fn state_of(host: &str) -> String {
        format!("{NAMESPACE}/STATE/{host}")
    }

    /// Returns the death of the node: the connection's will, also published at its intended end. It has no number.
    pub fn death(&self) -> Publication {
        let payload = Payload { timestamp: Some(metric::now()), metrics: vec![self.bd_seq()], seq: None };
        Publication { topic: self.topic("NDEATH", None), payload: payload.encode_to_vec() }
    }

    /// Returns the birth of the node. It restarts the message numbers.
    pub fn birth(&mut self, cells: usize) -> Publication {
        self.seq = 0;
        let now = metric::now();
        let cells = i64::try_from(cells).unwrap_or(i64::MAX);
        let metrics = vec![
            self.bd_seq(),
            Metric::new(REBIRTH, Kind::Boolean, now, Some(Value::Boolean(false))),
            Metric::new("Bridge/Version", Kind::String, now, Some(text(env!("CARGO_PKG_VERSION")))),
            Metric::new("Bridge/Cells", Kind::Int64, now, Some(whole(cells))),
        ];
        self.numbered("NBIRTH", None, metrics)
    }

    /// Returns the birth of a device: all its metrics, with their values now. A metric without a value is null.
    pub fn device_birth<'a>(
        &self,
        device: &str,
        definitions: &[Definition],
        value: impl Fn(&str) -> Option<(u64, &'a Value)>,
        alias: impl Fn(&str) -> Option<u64>,
    ) -> Publication {
        let now = metric::now();
        let metrics = definitions.iter().map(|Definition { name, kind }| {
            let (at, value) = value(name).map_or((now, None), |(at, value)| (at, Some(value.clone())));
            Metric { alias: alias(name), ..Metric::new(name, *kind, at, value) }
        });
        self.numbered("DBIRTH", Some(device), metrics.collect())
    }

    /// Returns the death of a device: the metrics that had values, and the reason why they have none now.
    pub fn device_death(&self, device: &str, metrics: Vec<Metric>) -> Publication {
        self.numbered("DDEATH", Some(device), metrics)
    }

    /// Returns a message with values of a device.
    pub fn data(&self, device: &str, metrics: Vec<Metric>) -> Publication {
        self.numbered("DDATA", Some(device), metrics)
    }

    /// Called when the message was published: the next one has the next number.
    pub fn published(&mut self) {
        self.seq = self.seq.wrapping_add(1);
    }

    fn numbered(&self, kind: &str, device: Option<&str>, metrics: Vec<Metric>) -> Publication {
        let payload = Payload { timestamp: Some(metric::now()), metrics, seq: Some(self.seq.into()) };
        Publication { topic: self.topic(kind, device), payload: payload.encode_to_vec() }
    }

    fn bd_seq(&self) -> Metric {
        Metric::new(BD_SEQ, Kind::Int64, metric::now(), Some(whole(self.bd_seq)))
    }

    /// Parses a message; `is_retained` is whether the broker was to store it.
    pub fn receive(&self, topic: &str, payload: &[u8], is_retained: bool) -> NodeMessage {
        if let Some(host) = topic.strip_prefix(NAMESPACE).and_then(|rest| rest.strip_prefix("/STATE/")) {
            return state(host, payload);
        }
        if payload.is_empty() {
            return NodeMessage::Nothing;
        }
        let strange = |why: &str| NodeMessage::Malformed(format!("{topic}: {why}"));
        let length = payload.len();
        let Ok(payload) = Payload::decode(payload) else {
            return strange(match payload.first() {
                Some(b'{') => "JSON is not a Sparkplug B payload: see Commands in docs/bridge.md",
                _ => "not a Sparkplug B payload",
            });
        };
        if topic == self.topic("NCMD", None) {
            let asks = |metric: &Metric| {
                metric.name.as_deref() == Some(REBIRTH) && metric.value == Some(Value::Boolean(true))
            };
            return match payload.metrics.iter().any(asks) {
                _ if is_retained => {
                    strange("a retained command is ignored: publish it without the retain flag")
                }
                true => NodeMessage::Rebirth,
                false => strange("the only command to the node is Node Control/Rebirth = true"),
            };
        }
        match topic.strip_prefix(&self.topic("DCMD", Some(""))) {
            Some(device) => {
                let unfit = if is_retained {
                    Some("the command is retained: publish it without the retain flag".into())
                } else if length > MAX_COMMAND_LEN {
                    Some(format!("the command has {length} bytes, the maximum is {MAX_COMMAND_LEN}"))
                } else {
                    None
                };
                NodeMessage::Write { device: device.into(), payload, unfit }
            }
            None => strange("not a topic of this node"),
        }
    }
}

fn state(host: &str, payload: &[u8]) -> NodeMessage {
    #[derive(serde::Deserialize)]
    struct State {
        online: bool,
        timestamp: u64,
    }
    match serde_json::from_slice(payload) {
        Ok(State { online, timestamp }) => NodeMessage::State { host: host.into(), online, timestamp },
        Err(error) => NodeMessage::Malformed(format!("the STATE of {host}: {error}")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::metric::define;
    use super::*;

    fn read(message: &Publication) -> Payload {
        Payload::decode(&message.payload[..]).unwrap()
    }

    #[test]
    fn numbers_begin_with_the_birth_and_go_from_255_to_0() {
        let mut node = Node::new("g", "n", 7);
        node.seq = 9;
        assert_eq!(node.birth(1).topic, "spBv1.0/g/NBIRTH/n");
        let seqs: Vec<Option<u64>> = (0..258)
            .map(|_| {
                let seq = read(&node.data("d", Vec::new())).seq;
                node.published();
                seq
            })
            .collect();
        let numbers = (0..=255).chain([0, 1]).map(Some);
        assert_eq!(seqs, numbers.collect::<Vec<_>>());
        assert_eq!(read(&node.birth(1)).seq, Some(0));
    }

    #[test]
    fn the_death_has_the_number_of_the_birth_and_no_other() {
        let mut node = Node::new("g", "n", 7);
        let (birth, death) = (read(&node.birth(1)), node.death());
        assert_eq!((death.topic.as_str(), read(&death).seq), ("spBv1.0/g/NDEATH/n", None));
        let number = |payload: &Payload| (payload.metrics[0].name.clone(), payload.metrics[0].value.clone());
        assert_eq!(number(&birth), (Some("bdSeq".into()), Some(Value::Long(7))));
        assert_eq!(number(&read(&death)), number(&birth));
    }

    #[test]
    fn a_device_is_born_with_every_metric() {
        let node = Node::new("g", "n", 0);
        let value = Value::Boolean(true);
        let definitions = [define("a", Kind::Boolean), define("b", Kind::String)];
        let birth =
            node.device_birth("d", &definitions, |name| (name == "a").then_some((5, &value)), |_| None);
        assert_eq!(birth.topic, "spBv1.0/g/DBIRTH/n/d");
        let [a, b] = &read(&birth).metrics[..] else { panic!("two metrics") };
        assert_eq!(a, &Metric::new("a", Kind::Boolean, 5, Some(Value::Boolean(true))));
        assert_eq!((b.is_null, b.value.clone(), b.datatype), (Some(true), None, Some(12)));
    }

    #[test]
    fn what_the_broker_sends_is_understood() {
        let node = Node::new("g", "n", 0);
        let rebirth = |value| {
            let metric = Metric::new("Node Control/Rebirth", Kind::Boolean, 1, Some(Value::Boolean(value)));
            Payload { timestamp: Some(1), metrics: vec![metric], seq: None }.encode_to_vec()
        };
        assert_eq!(node.receive("spBv1.0/g/NCMD/n", &rebirth(true), false), NodeMessage::Rebirth);
        let strange = |topic: &str, payload: &[u8], is_retained| {
            matches!(node.receive(topic, payload, is_retained), NodeMessage::Malformed(_))
        };
        assert!(strange("spBv1.0/g/NCMD/n", &rebirth(false), false));
        assert!(strange("spBv1.0/g/NCMD/n", &rebirth(true), true));
        assert!(strange("spBv1.0/g/NCMD/n", b"\xff", false));
        assert_eq!(node.receive("spBv1.0/g/NCMD/n", b"", true), NodeMessage::Nothing);
        assert!(strange("spBv1.0/x/DCMD/n/d", &rebirth(true), false));
        let write =
            |payload: &[u8], is_retained| match node.receive("spBv1.0/g/DCMD/n/d", payload, is_retained) {
                NodeMessage::Write { device, unfit, .. } => (device, unfit.unwrap_or_default()),
                other => panic!("{other:?}"),
            };
        let retained = "the command is retained: publish it without the retain flag";
        assert_eq!(write(&rebirth(true), false), ("d".into(), String::new()));
        assert_eq!(write(&rebirth(true), true), ("d".into(), retained.into()));
        let metric = |length| Metric::new("m", Kind::String, 1, Some(text("x".repeat(length))));
        let payload =
            |length| Payload { timestamp: None, metrics: vec![metric(length)], seq: None }.encode_to_vec();
        let around = payload(MAX_COMMAND_LEN).len() - MAX_COMMAND_LEN;
        assert_eq!(write(&payload(MAX_COMMAND_LEN - around), false).1, "");
        let long = "the command has 262145 bytes, the maximum is 262144";
        assert_eq!(write(&payload(MAX_COMMAND_LEN - around + 1), false).1, long);
        let state = NodeMessage::State { host: "h".into(), online: true, timestamp: 9 };
        assert_eq!(node.receive("spBv1.0/STATE/h", br#"{"online":true,"timestamp":9}"#, true), state);
        assert!(strange("spBv1.0/STATE/h", b"ONLINE", true));
        assert_eq!(node.subscriptions(), ["spBv1.0/g/NCMD/n", "spBv1.0/g/DCMD/n/+"]);
        assert_eq!(Node::state_of("h"), "spBv1.0/STATE/h");
    }
}
