//! A broker of MQTT 5 for one connection at a time: the test determines its answers.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use cellwire_bridge::payload::{Payload, Value};
use prost::Message as _;

use crate::tool::DEADLINE;

pub(crate) struct Broker(TcpListener);

/// A client that has connected and subscribed.
pub(crate) struct Peer(TcpStream);

/// A message.
pub(crate) struct Message {
    pub(crate) topic: String,
    /// With QoS 1.
    pub(crate) number: Option<[u8; 2]>,
    pub(crate) payload: Vec<u8>,
}

impl Broker {
    pub(crate) fn new() -> Self {
        Self(TcpListener::bind("127.0.0.1:0").unwrap())
    }

    pub(crate) fn address(&self) -> String {
        self.0.local_addr().unwrap().to_string()
    }

    /// Returns whether no client connects in this time.
    pub(crate) fn is_left_alone(&self, time: Duration) -> bool {
        self.0.set_nonblocking(true).unwrap();
        let end = Instant::now() + time;
        let mut left = true;
        while left && Instant::now() < end {
            left = self.0.accept().is_err();
            std::thread::sleep(Duration::from_millis(50));
        }
        self.0.set_nonblocking(false).unwrap();
        left
    }

    /// Accepts the next client; CONNACK has these properties.
    pub(crate) fn accept(&self, properties: &[u8]) -> Peer {
        let (stream, _) = self.0.accept().unwrap();
        stream.set_read_timeout(Some(DEADLINE)).unwrap();
        let mut peer = Peer(stream);
        assert_eq!(peer.packet().0, 0x10);
        let length = u8::try_from(properties.len()).unwrap();
        peer.send(&[&[0x20, length + 3, 0, 0, length], properties].concat());
        let (kind, body) = peer.packet();
        assert_eq!(kind, 0x82);
        // Of each filter its length, its topic and its options, after the packet's number and no properties.
        let (mut rest, mut codes) = (&body[3..], Vec::new());
        while let [high, low, ..] = rest {
            rest = &rest[2 + usize::from(u16::from_be_bytes([*high, *low])) + 1..];
            codes.push(1);
        }
        let length = u8::try_from(codes.len()).unwrap() + 3;
        peer.send(&[&[0x90, length, body[0], body[1], 0], &codes[..]].concat());
        peer
    }
}

impl Peer {
    pub(crate) fn send(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).unwrap();
    }

    /// Receives the next message with QoS 1.
    pub(crate) fn message(&mut self) -> Message {
        loop {
            let message = self.any_message();
            if message.number.is_some() {
                return message;
            }
        }
    }

    /// Receives the next message.
    pub(crate) fn any_message(&mut self) -> Message {
        loop {
            let (kind, body) = self.packet();
            if kind & 0xF0 == 0x30 {
                let (topic, rest) = body[2..].split_at(usize::from(u16::from_be_bytes([body[0], body[1]])));
                let topic = String::from_utf8(topic.to_vec()).unwrap();
                let (number, rest) = match kind & 6 {
                    0 => (None, rest),
                    _ => (Some([rest[0], rest[1]]), &rest[2..]),
                };
                return Message { topic, number, payload: rest[1..].to_vec() };
            }
        }
    }

    /// Sends a message to the client, with QoS 0.
    pub(crate) fn publish(&mut self, topic: &str, payload: &[u8]) {
        self.publish_as(0x30, topic, payload);
    }

    /// Sends a message to the client, with this first byte: 31h is retained.
    pub(crate) fn publish_as(&mut self, first: u8, topic: &str, payload: &[u8]) {
        let (mut length, mut head) = (2 + topic.len() + 1 + payload.len(), vec![first]);
        while length > 0x7F {
            head.push(u8::try_from(length & 0x7F).unwrap() | 0x80);
            length >>= 7;
        }
        head.push(u8::try_from(length).unwrap());
        let topic_length = u16::try_from(topic.len()).unwrap().to_be_bytes();
        self.send(&[&head, &topic_length[..], topic.as_bytes(), &[0], payload].concat());
    }

    /// Sends PUBACK with a reason code.
    pub(crate) fn acknowledge(&mut self, message: &Message, reason: u8) {
        let [high, low] = message.number.unwrap();
        self.send(&[0x40, 3, high, low, reason]);
    }

    /// Receives a packet: its first byte, and the bytes after its length.
    fn packet(&mut self) -> (u8, Vec<u8>) {
        let kind = self.byte();
        let (mut length, mut shift) = (0, 0);
        loop {
            let byte = self.byte();
            length |= usize::from(byte & 0x7F) << shift;
            shift += 7;
            if byte < 0x80 {
                break;
            }
        }
        let mut body = vec![0; length];
        self.0.read_exact(&mut body).unwrap();
        (kind, body)
    }

    fn byte(&mut self) -> u8 {
        let mut byte = [0];
        self.0.read_exact(&mut byte).unwrap();
        byte[0]
    }
}

impl Message {
    pub(crate) fn read(&self) -> Payload {
        Payload::decode(self.payload.as_slice()).unwrap()
    }

    /// Returns the number of the record.
    pub(crate) fn record(&self) -> u64 {
        let payload = self.read();
        let number = payload.metrics.iter().find(|metric| metric.name.as_deref() == Some("Record/Number"));
        match number.unwrap().value {
            Some(Value::Long(number)) => number,
            ref other => panic!("{other:?}"),
        }
    }

    /// Returns the text of a metric, if the message has it.
    pub(crate) fn text(&self, name: &str) -> Option<String> {
        let metric = self.read().metrics.into_iter().find(|metric| metric.name.as_deref() == Some(name));
        match metric?.value? {
            Value::String(text) => Some(text),
            other => panic!("{other:?}"),
        }
    }

    pub(crate) fn contains(&self, text: &str) -> bool {
        self.payload.windows(text.len()).any(|found| found == text.as_bytes())
    }
}
