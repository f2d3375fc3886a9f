//! Devices that do not answer, or report what cannot be.

use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use cellwire_bridge::payload::{Metric, Payload};
use fanuc_hmi_modbus::{TelemetryBlock, WordOrder};

use crate::broker::{Broker, Message, Peer};
use crate::tool::Running;
use crate::{ball, bridge, figure, simulated, until};

/// Receives the next message of a kind, such as DBIRTH.
fn next(peer: &mut Peer, kind: &str) -> Message {
    loop {
        let message = peer.any_message();
        if message.number.is_some() {
            peer.acknowledge(&message, 0);
        }
        if message.topic.contains(kind) {
            return message;
        }
    }
}

/// Starts a bridge whose one cell is the FANUC controller at `place`, with more settings of the cell.
fn robot(folder: &Path, broker: &Broker, place: &str, more: &str) -> Running {
    let site = format!(
        "[broker]\naddress = \"{}\"\ngroup = \"g\"\nnode = \"n\"\n[store]\nfile = \"s.redb\"\n\
         [health]\nlisten = \"127.0.0.1:0\"\n\
         [cell.robot]\nlink = \"fanuc-hmi-modbus\"\naddress = \"{place}\"\n{more}settings = {{ poll = \"50ms\" }}\n",
        broker.address()
    );
    let file = folder.join("site.toml");
    std::fs::write(&file, site).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire-bridge"));
    command.args(["--config"]).arg(file).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    Running::start(command)
}

fn metric(payload: &Payload, name: &str) -> Metric {
    let found = payload.metrics.iter().find(|metric| metric.name.as_deref() == Some(name));
    found.unwrap_or_else(|| panic!("{name} in {payload:?}")).clone()
}

/// Returns the quality of a metric without a value.
fn quality(payload: &Payload, name: &str) -> Option<u32> {
    let metric = metric(payload, name);
    assert_eq!((metric.is_null, &metric.value), (Some(true), &None), "{name}");
    metric.properties.unwrap().values[0].value
}

fn signal(process: &Running, signal: &str) {
    assert!(Command::new("kill").args([signal, &process.id().to_string()]).status().unwrap().success());
}

fn dies_and_is_born(folder: &Path, ball: &Running) {
    let broker = Broker::new();
    let mut bridge = bridge(folder, &broker.address(), ball);
    let mut peer = broker.accept(&[]);
    next(&mut peer, "/DBIRTH/");
    signal(ball, "-STOP");
    let why = "the device has not answered for 2s";
    let event = format!("{{\"event\":\"disconnected\",\"why\":\"{why}\"}}");
    let last = loop {
        let message = next(&mut peer, "/DDATA/");
        if message.text("Event").is_some_and(|found| found == event) {
            break message;
        }
    };
    let death = next(&mut peer, "/DDEATH/");
    assert_eq!(death.text("Event"), Some(event));
    for name in ["Force/X", "Keys", "Stale"] {
        assert_eq!(
            (quality(&last.read(), name), quality(&death.read(), name)),
            (Some(500), Some(500)),
            "{name}"
        );
    }
    let line = bridge.line("\"disconnected\"");
    assert!(line.contains(why), "{line}");
    signal(ball, "-CONT");
    let birth = next(&mut peer, "/DBIRTH/");
    assert_eq!(metric(&birth.read(), "Force/X").is_null, Some(true), "what it was before is not what it is");
    let data = next(&mut peer, "/DDATA/");
    assert!(data.text("Event").is_some_and(|event| event.contains("\"connected\"")));
    assert_eq!(bridge.signal("-TERM"), Some(0));
    assert!(
        !bridge.rest().iter().any(|line| line.contains("\"disconnected\"") && line.contains(why)),
        "once"
    );
}

#[test]
fn a_device_that_does_not_answer_is_dead_and_born_again_when_it_does() {
    let folder = tempfile::tempdir().unwrap();
    dies_and_is_born(folder.path(), &ball());
}

#[test]
fn a_device_on_a_serial_port_too() {
    let folder = tempfile::tempdir().unwrap();
    let line = folder.path().join("line");
    let ball = simulated(&["ball", "--pty", line.to_str().unwrap()]);
    dies_and_is_born(folder.path(), &ball);
}

/// The kinds of reports of a controller.
const GOOD: u8 = 0;
const ONES: u8 = 1;
const ZEROS: u8 = 2;

/// Starts a controller that answers every request with its block, whose reals have their high word first.
fn controller(reports: Arc<AtomicU8>) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let place = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        let mut life = 0;
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut request = [0; 12];
            while stream.read_exact(&mut request).is_ok() {
                life += 12;
                let block = TelemetryBlock {
                    life_counter: life,
                    position: [465.0, 0.0, 365.0],
                    quaternion: [0.0, 0.6, 0.0, 0.8],
                    ..TelemetryBlock::default()
                };
                let words = match reports.load(Ordering::Relaxed) {
                    GOOD => block.to_registers(WordOrder::HighFirst),
                    ONES => [u16::MAX; 37],
                    _ => [0; 37],
                };
                let mut reply = request[..4].to_vec();
                reply.extend([0, 77, request[6], 3, 74]);
                reply.extend(words.iter().flat_map(|word| word.to_be_bytes()));
                if stream.write_all(&reply).is_err() {
                    break;
                }
            }
        }
    });
    place
}

#[test]
fn telemetry_that_cannot_be_is_null_with_a_quality_and_an_event() {
    let folder = tempfile::tempdir().unwrap();
    let broker = Broker::new();
    let reports = Arc::new(AtomicU8::new(GOOD));
    let place = controller(Arc::clone(&reports));
    let mut bridge = robot(folder.path(), &broker, &place, "");
    let mut peer = broker.accept(&[]);
    let x = "Telemetry/Position/X";
    let good = |peer: &mut Peer| loop {
        let message = next(peer, "/DDATA/").read();
        if message.metrics.iter().any(|metric| metric.name.as_deref() == Some(x)) {
            // The word order is found.
            assert_eq!(metric(&message, x).value, Some(cellwire_bridge::payload::Value::Float(465.0)));
            return;
        }
    };
    good(&mut peer);
    for (what, fault, value) in [(ONES, "nan", "POS_X"), (ZEROS, "quaternion", "Q_1")] {
        reports.store(what, Ordering::Relaxed);
        let message = loop {
            let message = next(&mut peer, "/DDATA/");
            if message.text("Event").is_some() {
                break message;
            }
        };
        let event = format!("{{\"event\":\"implausible\",\"fault\":\"{fault}\",\"value\":\"{value}\"}}");
        assert_eq!(message.text("Event"), Some(event.clone()));
        for name in [x, "Telemetry/Life Counter", "Telemetry/Quaternion Rate/Z"] {
            assert_eq!(quality(&message.read(), name), Some(0), "{name}");
        }
        let line = bridge.line("implausible");
        assert!(line.contains(&event), "{line}");
        reports.store(GOOD, Ordering::Relaxed);
        good(&mut peer);
    }
}

#[test]
fn a_device_that_closes_each_connection_is_tried_less_and_less_often_and_dies_once() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let place = listener.local_addr().unwrap();
    let connections = Arc::new(AtomicU8::new(0));
    let counted = Arc::clone(&connections);
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            drop(stream);
            counted.fetch_add(1, Ordering::Relaxed);
        }
    });
    let (folder, broker) = (tempfile::tempdir().unwrap(), Broker::new());
    let begun = Instant::now();
    let mut bridge = robot(folder.path(), &broker, &place.to_string(), "");
    let mut peer = broker.accept(&[]);
    until("five connections", || connections.load(Ordering::Relaxed) >= 5);
    // Half of each pause is random.
    assert!(begun.elapsed() >= Duration::from_millis((250 + 500 + 1000 + 2000) / 2), "{:?}", begun.elapsed());
    until("their failures", || figure(&bridge, "link_failures_total{cell=\"robot\"}") >= 5);
    // The first reason of the event.
    let records = figure(&bridge, "record_number{cell=\"robot\"}");
    assert_eq!(records, 1);
    next(&mut peer, "/DDEATH/");
    assert_eq!(bridge.signal("-TERM"), Some(0));
}

/// A server that loses everything in the first 200 ms of each connection: without the pause the cell is never alive.
#[test]
fn a_cell_sends_its_first_byte_after_the_pause_of_a_connection() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let place = listener.local_addr().unwrap().to_string();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            std::thread::sleep(Duration::from_millis(200));
            stream.set_nonblocking(true).unwrap();
            let mut request = [0; 12];
            let mut is_lost = false;
            while let Ok(1..) = stream.read(&mut request) {
                is_lost = true;
            }
            stream.set_nonblocking(false).unwrap();
            // Bytes that are lost, as after a device's start, end its connection for good.
            while !is_lost && stream.read_exact(&mut request).is_ok() {
                let mut reply = request[..4].to_vec();
                reply.extend([0, 77, request[6], 3, 74]);
                reply.extend([0; 74]);
                if stream.write_all(&reply).is_err() {
                    break;
                }
            }
        }
    });
    for (pause, is_alive) in [("400ms", true), ("0s", false)] {
        let folder = tempfile::tempdir().unwrap();
        let broker = Broker::new();
        let pause = format!("connect_pause = \"{pause}\"\n");
        let mut bridge = robot(folder.path(), &broker, &place, &pause);
        let _peer = broker.accept(&[]);
        if is_alive {
            // A reply of zeros was read.
            assert!(bridge.line("implausible").contains("quaternion"));
        } else {
            assert!(bridge.line("\"disconnected\"").contains("the peer has closed the connection"));
        }
        bridge.signal("-TERM");
    }
}
