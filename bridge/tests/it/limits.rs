//! A broker that announces the longest packet that it takes.

use std::time::{SystemTime, UNIX_EPOCH};

use cellwire_bridge::payload::{Kind, Metric, Payload, Value};
use prost::Message as _;

use crate::broker::{Broker, Message, Peer};
use crate::{REFUSED, ball, bridge, figure};

/// The bytes of a message besides topic and payload, with QoS 0: the first byte, two of the length, two of the topic's, one for
/// no properties.
const AROUND: usize = 6;

/// Returns Maximum Packet Size for CONNACK.
fn takes(longest: u32) -> Vec<u8> {
    [&[0x27], &longest.to_be_bytes()[..]].concat()
}

/// Writes a metric of the node, or of its ball.
fn write(peer: &mut Peer, topic: &str, name: &str, value: Value) {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_millis();
    let metric = Metric::new(name, Kind::Boolean, u64::try_from(now).unwrap(), Some(value));
    let payload = Payload { timestamp: None, metrics: vec![metric], seq: None };
    peer.publish(topic, &payload.encode_to_vec());
}

fn until(peer: &mut Peer, topic: &str) -> Message {
    loop {
        let message = peer.any_message();
        if message.number.is_some() {
            peer.acknowledge(&message, 0);
        }
        if message.topic == topic {
            return message;
        }
    }
}

fn is_null(birth: &Message) -> Vec<String> {
    let nulls = birth.read().metrics.into_iter().filter(|metric| metric.is_null == Some(true));
    nulls.filter_map(|metric| metric.name).filter(|name| !name.starts_with("Command/")).collect()
}

#[test]
fn a_record_longer_than_the_broker_takes_is_dropped_and_a_birth_goes_without_its_event() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let mut bridge = bridge(folder.path(), &broker.address(), &ball);
    let mut peer = broker.accept(&takes(1500));
    let first = until(&mut peer, "spBv1.0/g/DDATA/n/ball").record();

    // The record of the refusal repeats the name.
    write(&mut peer, "spBv1.0/g/DCMD/n/ball", &"long".repeat(500), Value::Boolean(true));
    let line = bridge.line("\"record\":\"refused\"");
    assert!(line.contains("PacketTooLarge") && line.contains("check the broker's limits"), "{line}");
    let numbers: Vec<u64> = (0..20).map(|_| until(&mut peer, "spBv1.0/g/DDATA/n/ball").record()).collect();
    let missing: Vec<u64> = (first + 1..numbers[19]).filter(|number| !numbers.contains(number)).collect();
    assert_eq!((missing.len(), figure(&bridge, REFUSED)), (1, 1), "{numbers:?}");

    write(&mut peer, "spBv1.0/g/NCMD/n", "Node Control/Rebirth", Value::Boolean(true));
    until(&mut peer, "spBv1.0/g/NBIRTH/n");
    let birth = peer.any_message();
    assert_eq!((birth.topic.as_str(), birth.read().seq), ("spBv1.0/g/DBIRTH/n/ball", Some(1)));
    assert!(birth.topic.len() + birth.payload.len() + AROUND <= 1500);
    // On a stalled host the ball may have had another event since, which is short.
    match birth.text("Event") {
        None => assert_eq!(is_null(&birth), ["Event"]),
        Some(event) => assert!(is_null(&birth).is_empty() && !event.contains("long"), "{event}"),
    }
    let next = until(&mut peer, "spBv1.0/g/DDATA/n/ball");
    assert_eq!(next.read().seq, Some(2), "what was not sent has no number");
    assert_eq!(figure(&bridge, "connections_total"), 1);
}

#[test]
fn a_birth_longer_than_the_broker_takes_is_reported_and_nothing_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let mut bridge = bridge(folder.path(), &broker.address(), &ball);
    drop(broker.accept(&takes(300)));
    let mut peer = broker.accept(&takes(300));
    assert_eq!(peer.any_message().topic, "spBv1.0/g/NBIRTH/n");
    let line = bridge.line("a birth of");
    assert!(line.contains("bytes exceeds the broker's packet limit of 300"), "{line}");
    drop(peer);
    let mut peer = broker.accept(&takes(2000));
    let birth = until(&mut peer, "spBv1.0/g/DBIRTH/n/ball");
    let (length, named) = (birth.topic.len() + birth.payload.len() + AROUND, is_null(&birth));
    assert!(length > 300 && !named.contains(&"Event".to_owned()), "{length} {named:?}");
    assert_eq!(until(&mut peer, "spBv1.0/g/DDATA/n/ball").record(), 1);
    assert_eq!(figure(&bridge, REFUSED), 0);
}
