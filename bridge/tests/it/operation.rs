//! Reloading of the site file, report by exception, aliases, JSON, and several brokers.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use cellwire_bridge::payload::{Kind, Metric, Payload, Value};
use cellwire_bridge::store::{Batch, Store};
use prost::Message as _;

use crate::broker::{Broker, Message, Peer};
use crate::tool::Running;
use crate::{ball, bridge_command, edit, figure, figure_in, get, place, site_command, until};

fn hang_up(bridge: &Running) {
    let status = Command::new("kill").args(["-HUP", &bridge.id().to_string()]).status();
    assert!(status.unwrap().success());
}

/// Receives the next message, and acknowledges it.
fn next(peer: &mut Peer) -> Message {
    let message = peer.any_message();
    if message.number.is_some() {
        peer.acknowledge(&message, 0);
    }
    message
}

/// Receives all messages up to one of this topic.
fn up_to(peer: &mut Peer, topic: &str) -> Vec<Message> {
    let mut seen = vec![next(peer)];
    while seen.last().unwrap().topic != topic {
        seen.push(next(peer));
    }
    seen
}

fn table(name: &str, ball: &Running, more: &str) -> String {
    let address = place(ball);
    format!(
        "[cell.{name}]\nlink = \"isra-ball\"\naddress = \"{address}\"\nsettings = {{ report = \"0s\" }}\n{more}"
    )
}

fn write(folder: &Path, text: &str) {
    std::fs::write(folder.join("site.toml"), text).unwrap();
}

#[test]
fn cells_come_and_go_without_touching_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let (stays, goes, comes) = (ball(), ball(), ball());
    let broker = Broker::new();
    let cells = [("stays", &stays), ("goes", &goes)];
    let mut bridge = Running::start(site_command(folder.path(), &broker.address(), "", &cells));
    let head = std::fs::read_to_string(folder.path().join("site.toml")).unwrap();
    let head = head.split("[cell.").next().unwrap().to_owned();
    let mut peer = broker.accept(&[]);
    let mut seen = up_to(&mut peer, "spBv1.0/g/DDATA/n/stays");
    seen.extend(up_to(&mut peer, "spBv1.0/g/DDATA/n/goes"));

    // A file that is wrong in one place has no effect.
    let both = format!("{}{}", table("stays", &stays, ""), table("comes", &comes, ""));
    write(folder.path(), &format!("{head}{both}[cell.wrong]\nlink = \"nothing\"\naddress = \"x:1\"\n"));
    hang_up(&bridge);
    let line = bridge.line("\"site\":\"refused\"");
    assert!(line.contains("site.toml, line ") && line.contains("nothing was changed"), "{line}");
    write(folder.path(), &format!("{}{both}", head.replace("node = \"n\"", "node = \"other\"")));
    hang_up(&bridge);
    let line = bridge.line("\"site\":\"refused\"");
    assert!(line.contains("[broker] differs: it is only read at the start"), "{line}");
    // Neither does one that cannot be read at once, or never ends.
    let file = folder.path().join("site.toml");
    write(folder.path(), &format!("{head}{both}{}", "#".repeat(1 << 20)));
    hang_up(&bridge);
    let line = bridge.line("\"site\":\"refused\"");
    assert!(line.contains(" bytes, the maximum is 1048576"), "{line}");
    std::fs::remove_file(&file).unwrap();
    assert!(Command::new("mkfifo").arg(&file).status().unwrap().success());
    hang_up(&bridge);
    let line = bridge.line("\"site\":\"refused\"");
    assert!(line.contains("site.toml is not a regular file"), "{line}");
    std::fs::remove_file(&file).unwrap();
    until("the same cells", || figure(&bridge, "link_connected{cell=\"goes\"}") == 1);

    write(folder.path(), &format!("{head}{both}"));
    hang_up(&bridge);
    let line = bridge.line("\"site\":\"read\"");
    assert!(line.contains(r#""added":["comes"],"changed":[],"removed":["goes"]"#), "{line}");
    seen.extend(up_to(&mut peer, "spBv1.0/g/DDEATH/n/goes"));
    seen.extend(up_to(&mut peer, "spBv1.0/g/DDATA/n/comes"));
    let of = |seen: &[Message], kind: &str, cell: &str| {
        let topic = format!("spBv1.0/g/{kind}/n/{cell}");
        seen.iter().filter(|message| message.topic == topic).map(Message::read).collect::<Vec<_>>()
    };
    for (cell, births) in [("stays", 1), ("goes", 1), ("comes", 1)] {
        assert_eq!(of(&seen, "DBIRTH", cell).len(), births, "{cell}");
    }
    assert_eq!(
        (of(&seen, "DDEATH", "stays").len(), seen.iter().filter(|it| it.topic.contains("NBIRTH")).count()),
        (0, 1)
    );
    let gone = of(&seen, "DDATA", "goes").len() as u64;
    until("the metrics", || {
        let text = get(&bridge, "/metrics");
        !text.contains("cell=\"goes\"") && text.contains("link_connected{cell=\"comes\"} 1")
    });

    // It comes again, and another one has other settings: their numbers continue.
    let changed = format!("{}{}", table("stays", &stays, "commands = true\n"), table("goes", &goes, ""));
    write(folder.path(), &format!("{head}{changed}{}", table("comes", &comes, "")));
    hang_up(&bridge);
    let line = bridge.line("\"site\":\"read\"");
    assert!(line.contains(r#""added":["goes"],"changed":["stays"],"removed":[]"#), "{line}");
    let mut later = up_to(&mut peer, "spBv1.0/g/DDATA/n/goes");
    assert_eq!(later.last().unwrap().record(), gone + 1);
    while of(&later, "DBIRTH", "stays").is_empty() {
        later.push(next(&mut peer));
    }
    later.extend(up_to(&mut peer, "spBv1.0/g/DDATA/n/stays"));
    let all: Vec<Message> = seen.into_iter().chain(later).collect();
    let numbers: Vec<u64> =
        all.iter().filter(|it| it.topic == "spBv1.0/g/DDATA/n/stays").map(Message::record).collect();
    assert!(numbers.iter().copied().eq(1..=numbers.len() as u64), "{numbers:?}");
    assert_eq!(bridge.signal("-TERM"), Some(0));
}

#[test]
fn the_birth_of_the_node_says_how_many_cells_there_are_now() {
    let (folder, ball, broker) = (tempfile::tempdir().unwrap(), ball(), Broker::new());
    let mut bridge = crate::bridge(folder.path(), &broker.address(), &ball);
    let mut peer = broker.accept(&[]);
    let mut cells = || {
        let birth = up_to(&mut peer, "spBv1.0/g/NBIRTH/n").pop().unwrap().read();
        let found = birth.metrics.iter().find(|metric| metric.name.as_deref() == Some("Bridge/Cells"));
        found.unwrap().value.clone()
    };
    assert_eq!(cells(), Some(Value::Long(1)));
    let text = std::fs::read_to_string(folder.path().join("site.toml")).unwrap();
    write(folder.path(), &format!("{text}{}", table("another", &ball, "")));
    hang_up(&bridge);
    assert_eq!(cells(), Some(Value::Long(2)));
    bridge.line("\"site\":\"read\"");
}

#[test]
fn after_a_loss_of_power_the_numbers_leave_out_a_thousand() {
    let (folder, ball) = (tempfile::tempdir().unwrap(), ball());
    let nobody = "127.0.0.1:1";
    let mut bridge = crate::bridge(folder.path(), nobody, &ball);
    let ahead = |bridge: &Running| {
        until("figures", || get(bridge, "/metrics").contains("record_number{"));
        let text = get(bridge, "/metrics");
        figure_in(&text, "record_number{cell=\"ball\"}") - figure_in(&text, "store_records")
    };
    until("records", || figure(&bridge, "store_records") > 3);
    assert_eq!((ahead(&bridge), bridge.signal("-KILL")), (0, None));
    drop(bridge);
    // Killed in this start of the machine: nothing is left out.
    let mut bridge = crate::bridge(folder.path(), nobody, &ball);
    assert_eq!((ahead(&bridge), bridge.signal("-KILL")), (0, None));
    drop(bridge);
    // And in an earlier one.
    let mut store = Store::open(&folder.path().join("s.redb"), 256 << 20).unwrap();
    let names = vec![("boot".into(), Some("an earlier one".into()))];
    store.write(&Batch { names, ..Batch::default() }, &|_| Vec::new()).unwrap();
    drop(store);
    let mut bridge = crate::bridge(folder.path(), nobody, &ball);
    bridge.line("\"store\":\"power\"");
    assert_eq!((ahead(&bridge), bridge.signal("-TERM")), (1000, Some(0)));
    drop(bridge);
    // Once.
    let bridge = crate::bridge(folder.path(), nobody, &ball);
    assert_eq!(ahead(&bridge), 1000);
}

#[test]
fn by_exception_only_what_has_changed_is_a_record() {
    let folder = tempfile::tempdir().unwrap();
    let (quiet, loud) = (ball(), ball());
    let broker = Broker::new();
    let command = site_command(folder.path(), &broker.address(), "", &[("quiet", &quiet), ("loud", &loud)]);
    let file = folder.path().join("site.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    let (before, after) = text.split_once("[cell.loud]").unwrap();
    let bands = "dead_band = { Force = 300, Moment = 300.0, \"Force/X\" = 255 }\n";
    write(folder.path(), &format!("{before}{bands}[cell.loud]{after}"));
    let bridge = Running::start(command);
    let mut peer = broker.accept(&[]);
    let end = Instant::now() + Duration::from_secs(4);
    let (mut records, mut first) = (0, None);
    while Instant::now() < end {
        let message = next(&mut peer);
        if message.topic == "spBv1.0/g/DDATA/n/quiet" {
            records += 1;
            let forces =
                message.read().metrics.iter().filter(|it| it.name.as_deref() == Some("Force/X")).count();
            match first {
                None if forces > 0 => first = Some(records),
                _ => assert_eq!(forces, 0, "once"),
            }
        }
    }
    let loud = figure(&bridge, "record_number{cell=\"loud\"}");
    assert!(first.is_some() && records < 10 && loud > 30, "{records} {loud}");
    assert_eq!(figure(&bridge, "record_number{cell=\"quiet\"}"), records);
}

#[test]
fn with_aliases_only_births_have_names() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let command = bridge_command(folder.path(), &broker.address(), &ball);
    edit(folder.path(), "node = \"n\"", "node = \"n\"\naliases = true");
    let _bridge = Running::start(command);
    let mut peer = broker.accept(&[]);
    let seen = up_to(&mut peer, "spBv1.0/g/DDATA/n/ball");
    let birth = seen.iter().find(|it| it.topic == "spBv1.0/g/DBIRTH/n/ball").unwrap().read();
    let mut aliases: Vec<u64> = birth.metrics.iter().map(|metric| metric.alias.unwrap()).collect();
    aliases.sort_unstable();
    aliases.dedup();
    assert!(aliases.len() == birth.metrics.len() && birth.metrics.iter().all(|it| it.name.is_some()));
    let data = seen.last().unwrap().read();
    assert!(
        data.metrics.iter().all(|it| it.name.is_none() && aliases.contains(&it.alias.unwrap())),
        "{data:?}"
    );
    // A command is written by its alias, too.
    let request = birth.metrics.iter().find(|it| it.name.as_deref() == Some("Command/Request")).unwrap();
    let now = u64::try_from(SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_millis()).unwrap();
    let text = Value::String("{\"id\":\"by alias\",\"order\":1}".into());
    let metric =
        Metric { name: None, alias: request.alias, ..Metric::new("", Kind::String, now, Some(text)) };
    let payload = Payload { timestamp: None, metrics: vec![metric], seq: None };
    peer.publish("spBv1.0/g/DCMD/n/ball", &payload.encode_to_vec());
    let is_reported =
        |message: &Message| message.contains("by alias") && message.contains("does not allow commands");
    while !is_reported(&next(&mut peer)) {}
}

#[test]
fn each_record_is_json_too_before_the_broker_has_the_record() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let broker = Broker::new();
    let command = bridge_command(folder.path(), &broker.address(), &ball);
    edit(folder.path(), "node = \"n\"", "node = \"n\"\njson = \"plain/site\"");
    let mut bridge = Running::start(command);
    let mut peer = broker.accept(&[]);
    let mut last = None;
    for _ in 0..30 {
        let message = next(&mut peer);
        if message.topic == "plain/site/ball" {
            let record: serde_json::Value = serde_json::from_slice(&message.payload).unwrap();
            assert!(record["cell"] == "ball" && record["metrics"].is_object(), "{record}");
            last = record["number"].as_u64();
        } else if message.topic == "spBv1.0/g/DDATA/n/ball" {
            assert_eq!(Some(message.record()), last);
        }
    }
    assert!(last > Some(5));
    // The refusal of a message that is not a record is logged, and the records continue.
    loop {
        let message = peer.message();
        let is_json = message.topic == "plain/site/ball";
        peer.acknowledge(&message, if is_json { 0x87 } else { 0 });
        if is_json {
            break;
        }
    }
    let line = bridge.line("\"strange\"");
    assert!(line.contains("the broker refuses a message that is not a record: NotAuthorized"), "{line}");
    assert_eq!(figure(&bridge, "held_records{cell=\"ball\"}"), 0);
}

#[test]
fn of_several_brokers_one_that_answers_and_has_the_host_application_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let ball = ball();
    let nobody = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let (first, second) = (Broker::new(), Broker::new());
    let command = bridge_command(folder.path(), "HERE", &ball);
    let addresses = format!("[\"{nobody}\", \"{}\", \"{}\"]", first.address(), second.address());
    edit(folder.path(), "\"HERE\"", &addresses);
    edit(folder.path(), "node = \"n\"", "node = \"n\"\nprimary_host = \"h\"");
    let mut bridge = Running::start(command);
    // The host application is absent, and its message at the other broker has an earlier time.
    let waiting = first.accept(&[]);
    let line = bridge.line("is not online at");
    assert!(line.contains(&format!("the host application h is not online at {}", first.address())), "{line}");
    drop(waiting);
    let mut peer = second.accept(&[]);
    peer.publish("spBv1.0/STATE/h", b"{\"online\":true,\"timestamp\":7}");
    assert_eq!(next(&mut peer).topic, "spBv1.0/g/NBIRTH/n");
    drop(peer);
    let line = bridge.line("\"connected\",\"address\"");
    assert!(line.contains(&second.address()) || line.contains(&first.address()), "{line}");
}
