//! Drafts of captures of plants that are drawn at random: entries without a `?` must be right.

use core::time::Duration;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use cellwire_links::kawasaki_msg::layout::{AnyWork, FieldType, Layout};
use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::link::Link;
use cellwire_links::settings;
use cellwire_sim::kawasaki::{Jobs, Kawasaki};
use cellwire_sim::{Bench, KawasakiRobot, Settings as _};
use kawasaki_msg::robot_session::Session;
use kawasaki_msg::{Charset, LargePc, PcConfig, PcEvent, RobotConfig, Takeover};
use serde_json::{Map, Value, json};

use super::super::draft;
use crate::combination::Combination;
use crate::evidence::Random;
use crate::{Finding, Sender, Stream};

const MS: Duration = Duration::from_millis(1);
/// The counted entries of drafts.
#[derive(Debug, Default)]
struct Count {
    drafts: usize,
    right: usize,
    wrong: Vec<String>,
    /// The drafts that a command refuses.
    refused: Vec<String>,
    asked: usize,
    /// The roles that are named without a question mark.
    sure: BTreeSet<String>,
}

/// Returns the drafts of captures that are drawn from these seeds, and have from `shortest` messages to twice as many more,
/// of orders of up to `longest` jobs.
fn count(seeds: core::ops::Range<u64>, shortest: usize, longest: usize) -> Count {
    let mut count = Count::default();
    for seed in seeds {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let plant = plant(&mut random);
        let talk = talk(&plant, longest, &mut random);
        let streams = capture(&talk, shortest, &mut random);
        let Ok(text) = draft(&found(&streams), &streams) else { continue };
        count.drafts += 1;
        let given = toml::from_str(&text).unwrap();
        let accepted = settings::read("plant", Plant::default(), &given).map_err(anyhow::Error::new);
        if let Err(refused) = accepted.and_then(|plant| plant.check()) {
            count.refused.push(format!("{seed}: {refused}"));
        }
        for (key, (value, is_sure)) in statements(&text) {
            match (is_sure, plant.says(&key, &value)) {
                (false, _) => count.asked += 1,
                (true, true) => {
                    count.right += 1;
                    count.sure.extend(key.strip_suffix(".name").map(str::to_owned));
                }
                (true, false) => count.wrong.push(format!("{seed}: {key} = {value}")),
            }
        }
    }
    let Count { drafts, right, wrong, asked, sure, .. } = &count;
    println!("{drafts} drafts: {right} right, {} wrong, {asked} with ?; {sure:?}", wrong.len());
    count
}

#[test]
fn what_a_draft_of_few_messages_says_without_a_question_mark_is_right() {
    let count = count(0..250, 20, 3000);
    assert_eq!((count.wrong.as_slice(), count.refused.as_slice()), ([].as_slice(), [].as_slice()));
    // Not by asking about everything.
    assert!(count.drafts > 200 && count.right > 2 * count.drafts, "{count:?}");
}

/// Many more: `DRAFT_SEEDS=20000 cargo test --release -p cellwire-identify drafts_of_many_captures -- --ignored --nocapture`.
#[test]
#[ignore = "minutes"]
fn drafts_of_many_captures_are_right_without_a_question_mark() {
    let seeds = std::env::var("DRAFT_SEEDS").map_or(2000, |seeds| seeds.parse().unwrap());
    let few = count(10_000..10_000 + seeds, 20, 3000);
    let fewer = count(200_000..200_000 + seeds, 8, 40);
    let more = count(400_000..400_000 + seeds / 10, 150, 300);
    assert_eq!([few.wrong, fewer.wrong, more.wrong].concat(), [""; 0]);
}

#[test]
fn a_draft_of_more_messages_is_sure_of_more_and_right() {
    let count = count(1000..1030, 600, 30);
    assert_eq!(count.wrong, [""; 0]);
    let roles = ["job", "job_ack", "job_request", "pause", "order_start", "order_ack", "end_ack"];
    let expected = roles.iter().chain(&["status", "filler"]).map(|role| format!("messages.{role}"));
    assert_eq!(count.sure, expected.collect());
    assert!(count.right > 10 * count.drafts, "{count:?}");
}

/// Returns the finding of identify, without its calculation of chance.
fn found(streams: &[Stream]) -> Finding {
    let link = Link::by_name("kawasaki-msg").unwrap();
    let read = |charset: &str| {
        let given = Map::from_iter([("charset".into(), json!(charset))]);
        let mut combination = Combination::new(link, given).unwrap();
        let reading = combination.read(streams, true).unwrap();
        (combination, reading)
    };
    let [latin1, ascii] = ["latin1", "ascii"].map(read);
    let (combination, reading) = if latin1.1.weight() > ascii.1.weight() { latin1 } else { ascii };
    let (settings, bytes) = (combination.settings, [reading.explained(), reading.bytes]);
    let messages = [reading.pieces.len(); 2];
    Finding {
        link,
        settings,
        options: vec![],
        messages,
        bytes,
        bits: 99.0,
        senders: reading.senders,
        read: vec![],
    }
}

/// A plant, and its file of settings.
struct Drawn {
    settings: Map<String, Value>,
    plant: Plant,
    layout: Layout,
}

const ROLES: [(&str, &[&str]); 11] = [
    ("job", &["order", "number", "work"]),
    ("job_ack", &["order", "number"]),
    ("job_request", &["order", "number"]),
    ("pause", &["order", "queued"]),
    ("order_start", &["order", "number"]),
    ("order_ack", &["order"]),
    ("order_end", &["order"]),
    ("order_interrupt", &["order"]),
    ("end_ack", &["ended", "order", "executed"]),
    ("status", &["order", "phase", "queued", "executed", "ended"]),
    ("filler", &[]),
];
/// The messages and fields that a plant may lack.
const LACKS: [(&str, &str); 10] = [
    ("job", "order"),
    ("job_ack", "order"),
    ("job_request", "order"),
    ("pause", "order"),
    ("order_end", "order"),
    ("order_interrupt", "order"),
    ("order_start", "number"),
    ("pause", "queued"),
    ("end_ack", "order"),
    ("status", "phase"),
];

fn chance(random: &mut Random, of: usize) -> bool {
    random.below(of) == 0
}

fn plant(random: &mut Random) -> Drawn {
    let latin1 = chance(random, 3);
    let mut text = format!("charset = \"{}\"\n", if latin1 { "latin1" } else { "ascii" });
    let acks = [1, 1, 2, 5][random.below(4)];
    writeln!(text, "acks = {acks}\nmax_number = {}", [9999, 500, 40][random.below(3)]).unwrap();
    for at in 0..1 + random.below(4) {
        writeln!(text, "[[job]]\nname = \"own_{at}\"").unwrap();
        match random.below(3) {
            0 => writeln!(text, "kind = \"whole\"\nrange = [0, {}]", [1, 3, 700][random.below(3)]).unwrap(),
            1 => writeln!(text, "kind = \"decimal\"\nplaces = 2\nrange = [-5.0, 90.0]").unwrap(),
            _ => writeln!(text, "kind = \"text\"\nlength = [0, 8]").unwrap(),
        }
    }
    // A station's number, or its name, in every header; or the same in every message.
    let station = ["=7", "=50", "=ST4"][random.below(3)];
    let (in_header, in_data) = (chance(random, 3), chance(random, 6));
    for (number, (role, fields)) in ROLES.iter().enumerate() {
        let sent = !(matches!(*role, "pause" | "order_interrupt") && chance(random, 5)
            || *role == "job_ack" && chance(random, 10));
        let letter = if latin1 && chance(random, 3) { "ö" } else { "" };
        let mut fields: Vec<String> = fields
            .iter()
            .filter(|field| !(LACKS.contains(&(*role, **field)) && chance(random, 8)))
            .map(|field| (*field).to_owned())
            .collect();
        for at in (1..fields.len()).rev() {
            fields.swap(at, random.below(at + 1));
        }
        let mut header = Vec::new();
        if in_header {
            header.push(station.to_owned());
        }
        // Some move the order to the header.
        if in_header
            && chance(random, 4)
            && let Some(at) = fields.iter().position(|it| it == "order")
        {
            header.push(fields.remove(at));
        }
        if in_data {
            fields.insert(random.below(fields.len() + 1), station.to_owned());
        }
        if chance(random, 8) {
            fields.insert(random.below(fields.len() + 1), ["unused", "=X1", "=END"][random.below(3)].into());
        }
        writeln!(text, "[messages.{role}]\nsent = {sent}\nname = \"N{}{letter}-{number}\"", random.below(90))
            .unwrap();
        writeln!(text, "header = {header:?}\nfields = {fields:?}").unwrap();
    }
    let settings: Map<String, Value> = toml::from_str(&text).unwrap();
    let plant = settings::read("plant", Plant::default(), &settings).unwrap();
    let layout = plant.layout().unwrap();
    Drawn { settings, plant, layout }
}

impl Drawn {
    /// Returns whether a statement of a draft is right.
    fn says(&self, key: &str, value: &str) -> bool {
        let value: Value =
            toml::from_str::<Map<String, Value>>(&format!("it = {value}")).unwrap()["it"].clone();
        let parts: Vec<&str> = key.split('.').collect();
        match *parts.as_slice() {
            ["messages", role, field] => {
                let message = &self.settings["messages"][role];
                // One field without characters, and none, are the same bytes.
                let is_same = field == "fields"
                    && (value == json!([]) || value == json!(["unused"]))
                    && (message[field] == json!([]) || message[field] == json!(["unused"]));
                message["sent"] == json!(true) && (message[field] == value || is_same)
            }
            ["job", at, field] => self.settings["job"][at.parse::<usize>().unwrap()][field] == value,
            [name] => self.settings[name] == value,
            _ => panic!("{key}"),
        }
    }

    fn jobs(&self, count: usize, random: &mut Random) -> Vec<AnyWork> {
        let charset = self.plant.charset;
        // Some fields never change.
        let changes: Vec<bool> = self.layout.fields().iter().map(|_| !chance(random, 3)).collect();
        let constant: Vec<usize> = changes.iter().map(|_| random.below(1000)).collect();
        let counts = chance(random, 6);
        let job = |number: usize, random: &mut Random| {
            let texts: Vec<String> = self
                .layout
                .fields()
                .iter()
                .zip(changes.iter().zip(&constant))
                .map(|(field, (changes, constant))| {
                    let value = match (changes, counts) {
                        (false, _) => *constant,
                        (true, true) => number,
                        (true, false) => random.below(1000),
                    };
                    match field.holds {
                        FieldType::Number { places: 0, max, .. } => {
                            (value % (usize::try_from(max).unwrap() + 1)).to_string()
                        }
                        FieldType::Number { .. } => format!("{}.{:02}", value % 90, value % 100),
                        FieldType::Text { .. } if charset == Charset::Latin1 && value % 7 == 0 => {
                            format!("ä{value}")
                        }
                        // A part's number is a text, too.
                        FieldType::Text { .. } => [format!("P{value}"), value.to_string()][value % 2].clone(),
                    }
                })
                .collect();
            self.layout.job(&texts.iter().map(String::as_str).collect::<Vec<_>>(), charset).unwrap()
        };
        (0..count).map(|number| job(number, random)).collect()
    }
}

/// A PC whose bytes, and those that it is sent, are kept.
struct Tapped {
    pc: LargePc<Jobs<AnyWork>>,
    talk: Vec<(Duration, bool, Vec<u8>)>,
}

impl Session for Tapped {
    type Event = PcEvent;
    type Statistics = <LargePc<Jobs<AnyWork>> as Session>::Statistics;
    const MAX_INPUT: usize = <LargePc<Jobs<AnyWork>> as Session>::MAX_INPUT;
    const MAX_TRANSMIT: usize = <LargePc<Jobs<AnyWork>> as Session>::MAX_TRANSMIT;

    fn handle_connected(&mut self, now: Duration) {
        self.pc.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.pc.handle_disconnected(now);
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.talk.push((now, false, bytes.to_vec()));
        self.pc.handle_input(now, bytes);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.pc.handle_timeout(now);
    }

    fn poll_event(&mut self) -> Option<PcEvent> {
        self.pc.poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        let length = self.pc.poll_transmit(now, out)?;
        self.talk.push((now, true, out[..length].to_vec()));
        Some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.pc.poll_timeout()
    }

    fn statistics(&self) -> Self::Statistics {
        self.pc.statistics()
    }
}

/// Returns the messages of both ends of a plant during some orders: each with its time, and whether it is the PC's.
fn talk(drawn: &Drawn, longest: usize, random: &mut Random) -> Vec<(Duration, bool, Vec<u8>)> {
    let lacks = |role: &str| drawn.settings["messages"][role]["sent"] == json!(false);
    let config = PcConfig {
        takeover: if lacks("order_interrupt") { Takeover::End } else { Takeover::Interrupt },
        end_when_done: !chance(random, 4),
        ..PcConfig::tcp()
    };
    let ends_itself = config.end_when_done;
    let pc = LargePc::with_ranges(drawn.plant.pc(config).unwrap(), drawn.layout.clone()).unwrap();
    let robot = KawasakiRobot {
        config: drawn.plant.robot(RobotConfig { patience: 60_000 * MS, ..RobotConfig::tcp() }).unwrap(),
        ranges: drawn.layout.clone(),
        queue: 1 + random.below(16),
        job_time: MS * u32::try_from(5 + random.below(200)).unwrap(),
        time_of: None,
    };
    let mut bench: Bench<Tapped, Kawasaki<AnyWork>> = robot.bench(Tapped { pc, talk: Vec::new() }).unwrap();
    let first = [1, 50, 101, 5000][random.below(4)];
    for order in first..first + 8 {
        let count = [1 + random.below(5), 5 + random.below(20), longest][random.below(3)];
        let jobs = drawn.jobs(count, random);
        bench.session_mut().pc.start(order, jobs.into()).unwrap();
        // So long that most short orders end by themselves.
        let time = MS * u32::try_from(300 + random.below(45_000 / longest.min(100) * 3)).unwrap();
        let is_over = |bench: &mut Bench<Tapped, Kawasaki<AnyWork>>| bench.session().pc.order().is_none();
        if bench.run_until(time, is_over) {
            continue;
        }
        let endless = chance(random, 4);
        let interrupts = !lacks("order_interrupt") && chance(random, 2);
        if endless {
            break;
        }
        // It may be ending by itself.
        let _ = if interrupts || count > 100 && lacks("order_interrupt") || !ends_itself && count > 100 {
            if interrupts { bench.session_mut().pc.interrupt() } else { bench.session_mut().pc.end() }
        } else if ends_itself {
            Ok(())
        } else {
            bench.session_mut().pc.end()
        };
        if !bench.run_until(20_000 * MS, is_over) {
            break;
        }
    }
    bench.session_mut().talk.split_off(0)
}

/// Returns some messages from the middle of a conversation, and sometimes the end of one before them.
fn capture(talk: &[(Duration, bool, Vec<u8>)], shortest: usize, random: &mut Random) -> [Stream; 2] {
    let messages: Vec<(Duration, bool, &[u8])> = talk
        .iter()
        .flat_map(|(at, of_pc, bytes)| {
            bytes.split_inclusive(|byte| *byte == b'>').map(|it| (*at, *of_pc, it))
        })
        .collect();
    let length = (shortest + random.below(2 * shortest + 1)).min(messages.len());
    let begin = random.below(messages.len() - length + 1);
    let mut streams =
        [(); 2].map(|()| Stream { sender: Sender::Unknown, parts: vec![Vec::new()], arrivals: Vec::new() });
    if begin > 0 && chance(random, 2) {
        let (at, of_pc, bytes) = messages[begin - 1];
        streams[usize::from(of_pc)].arrivals.push((0, at));
        streams[usize::from(of_pc)].parts[0].extend(&bytes[bytes.len() / 2..]);
    }
    for (turn, (at, of_pc, bytes)) in (0..).zip(&messages[begin..begin + length]) {
        let stream = &mut streams[usize::from(*of_pc)];
        stream.arrivals.push((stream.size(), *at + Duration::from_nanos(turn)));
        stream.parts[0].extend(*bytes);
    }
    // The ends may be unknown, known, or guessed from ports and wrong.
    match random.below(4) {
        0 => {
            for (stream, name) in streams.iter_mut().zip(["robot", "pc"]) {
                stream.sender = Sender::Named(name.into());
            }
        }
        1 => {
            for (stream, is_client) in streams.iter_mut().zip([false, true]) {
                stream.sender = Sender::Connected { is_client, port: 9999 };
            }
        }
        2 => {
            for (stream, is_client) in streams.iter_mut().zip([true, false]) {
                stream.sender = Sender::Connected { is_client, port: 9105 };
            }
        }
        _ => {}
    }
    streams
}

/// Returns each value of a draft, and whether it is without a question mark.
fn statements(text: &str) -> BTreeMap<String, (String, bool)> {
    let (mut found, mut table, mut jobs) = (BTreeMap::new(), String::new(), 0);
    for line in text.lines() {
        if line == "[[job]]" {
            table = format!("job.{jobs}.");
            jobs += 1;
        } else if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
            table = format!("{name}.");
        } else if let Some((key, rest)) = line.split_once(" = ").filter(|_| !line.starts_with('#')) {
            let (value, comment) = rest.split_once(" #").unwrap_or((rest, ""));
            found.insert(format!("{table}{key}"), (value.to_owned(), !comment.trim().starts_with('?')));
        }
    }
    found
}
