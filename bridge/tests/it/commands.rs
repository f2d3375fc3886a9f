//! Commands that are not executed.

use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use cellwire_bridge::payload::{Kind, Metric, Payload, Value};
use prost::Message as _;

use crate::broker::{Broker, Peer};
use crate::tool::Running;
use crate::{ball, bridge_command, edit, get, until};

const TOPIC: &str = "spBv1.0/g/DCMD/n/ball";

fn start(folder: &Path, broker: &Broker, ball: &Running, commands: &str) -> Running {
    let command = bridge_command(folder, &broker.address(), ball);
    edit(folder, "link = \"isra-ball\"", "link = \"isra-ball\"\ncommands = true");
    edit(folder, "[health]", &format!("[commands]\n{commands}\n[health]"));
    Running::start(command)
}

/// Returns a command of this many bytes or a little more, dated this far ahead.
fn write(id: &str, ahead: u64, length: usize) -> Vec<u8> {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap() + Duration::from_secs(ahead);
    let text = format!("{{\"id\":\"{id}\",\"order\":\"{}\"}}", "x".repeat(length));
    let at = u64::try_from(now.as_millis()).unwrap();
    let metric = Metric::new("Command/Request", Kind::String, at, Some(Value::String(text)));
    Payload { timestamp: None, metrics: vec![metric], seq: None }.encode_to_vec()
}

/// Receives the next outcome of a command: its id, outcome and detail.
fn outcome(peer: &mut Peer) -> (String, String, String) {
    loop {
        let message = peer.message();
        peer.acknowledge(&message, 0);
        if let Some(id) = message.text("Command/Id") {
            let of = |name: &str| message.text(name).unwrap_or_default();
            return (id, of("Command/Outcome"), of("Command/Detail"));
        }
    }
}

/// Waits until the device answers: no command is begun before.
fn alive(peer: &mut Peer) {
    loop {
        let message = peer.message();
        peer.acknowledge(&message, 0);
        if message.text("Event").is_some_and(|event| event.contains("\"connected\"")) {
            return;
        }
    }
}

#[test]
fn what_was_refused_is_never_executed() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let mut bridge = start(folder.path(), &broker, &ball, "max_age = \"2s\"");
    let mut peer = broker.accept(&[]);
    alive(&mut peer);
    // The ball takes no command: its link refuses each one that the bridge accepts.
    let accepted = |peer: &mut Peer, id: &str| {
        assert_eq!(outcome(peer), (id.into(), "accepted".into(), String::new()));
        assert_eq!(outcome(peer), (id.into(), "refused".into(), "a ball has no commands".into()));
    };
    peer.publish(TOPIC, &write("now", 0, 0));
    accepted(&mut peer, "now");

    let early = write("early", 4, 0);
    peer.publish(TOPIC, &early);
    let (_, first, why) = outcome(&mut peer);
    assert!(first == "refused" && why.contains("is more than 2 s ahead of"), "{why}");
    peer.publish_as(0x31, TOPIC, &write("kept", 0, 0));
    let (_, refused, kept) = outcome(&mut peer);
    assert!(
        refused == "refused" && kept == "the command is retained: publish it without the retain flag",
        "{kept}"
    );
    peer.publish(TOPIC, &write("long", 0, 256 * 1024));
    let (id, refused, long) = outcome(&mut peer);
    assert!(id == "long" && refused == "refused" && long.ends_with("the maximum is 262144"), "{long}");
    // Far longer than any broker's usual limit.
    peer.publish(TOPIC, &write("longer", 0, 10 << 20));
    assert_eq!(outcome(&mut peer).0, "longer");

    // The time of the command has come, even for the next process.
    std::thread::sleep(Duration::from_secs(4));
    peer.publish(TOPIC, &early);
    assert_eq!(outcome(&mut peer), ("early".into(), "refused".into(), why.clone()));
    assert_eq!(bridge.signal("-KILL"), None);
    drop((bridge, peer));
    let bridge = start(folder.path(), &broker, &ball, "max_age = \"8s\"");
    let mut peer = broker.accept(&[]);
    peer.publish(TOPIC, &early);
    assert_eq!(outcome(&mut peer), ("early".into(), "refused".into(), why));
    // The record that was not acknowledged to the previous process has come once more.
    peer.publish(TOPIC, &write("next", 0, 0));
    while outcome(&mut peer).0 == "early" {}
    assert_eq!(outcome(&mut peer).1, "refused");
    until("one command that was accepted", || {
        get(&bridge, "/metrics").contains("commands_total{outcome=\"accepted\"} 1\n")
    });
}

#[test]
fn a_flood_is_refused_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let bridge = start(folder.path(), &broker, &ball, "rate = 0.5\nburst = 3");
    let mut peer = broker.accept(&[]);
    for id in 0..100 {
        peer.publish(TOPIC, &write(&id.to_string(), 0, 0));
    }
    let (mut accepted, mut refused, mut last) = (0, 0, 0);
    while accepted + refused < 100 {
        let message = peer.message();
        peer.acknowledge(&message, 0);
        // In order, also while records of the bridge and of the cell come one after the other.
        let at = message.read().metrics[0].timestamp.unwrap();
        assert!(at >= last, "{at} after {last}");
        last = at;
        match (message.text("Command/Outcome").as_deref(), message.text("Command/Detail")) {
            (Some("accepted"), _) => accepted += 1,
            (Some("refused"), Some(why))
                if why.starts_with("this cell accepts 0.5 commands per second, 3 at once") =>
            {
                refused += 1;
            }
            _ => {}
        }
    }
    assert!((3..=6).contains(&accepted), "{accepted}");
    let line = format!("commands_refused_total{{cell=\"ball\",why=\"rate\"}} {refused}\n");
    until("refused commands in the metrics", || get(&bridge, "/metrics").contains(&line));
}
