//! Serial lines as a UART with a FIFO, a USB adapter and a serial device server deliver them: in pieces, and late. The table
//! of answered messages: `cargo test -p testkit --test it adapters -- --nocapture`.

use core::time::Duration;
use std::collections::VecDeque;
use std::fmt::Write as _;

use cellwire_links::Link;
use cellwire_links::end::End;
use serde_json::{Map, Value, json};

const MS: Duration = Duration::from_millis(1);
const SECOND: Duration = Duration::from_secs(1);
const EXCHANGES: u32 = 100;

/// Between the line and a program.
#[derive(Debug, Clone, Copy)]
struct Adapter {
    name: &'static str,
    /// The number of buffered bytes at which it delivers.
    most: usize,
    /// The time without a byte after which it delivers, in characters.
    idle: u32,
    /// The longest time that the first byte waits before it delivers.
    latency: Duration,
}

const ADAPTERS: [Adapter; 9] = [
    Adapter { name: "16550A, trigger 1", most: 1, idle: 4, latency: Duration::MAX },
    Adapter { name: "16550A, trigger 4", most: 4, idle: 4, latency: Duration::MAX },
    Adapter { name: "16550A, trigger 8", most: 8, idle: 4, latency: Duration::MAX },
    Adapter { name: "16550A, trigger 14", most: 14, idle: 4, latency: Duration::MAX },
    Adapter { name: "FTDI, 1 ms", most: 62, idle: u32::MAX, latency: MS },
    Adapter { name: "FTDI, 16 ms", most: 62, idle: u32::MAX, latency: Duration::from_millis(16) },
    Adapter { name: "CH340", most: 32, idle: u32::MAX, latency: Duration::from_millis(8) },
    Adapter { name: "CP210x", most: 64, idle: u32::MAX, latency: Duration::from_millis(5) },
    Adapter {
        name: "device server that packs",
        most: 1460,
        idle: u32::MAX,
        latency: Duration::from_millis(20),
    },
];

impl Adapter {
    /// Returns the times at which the bytes of a transmission are delivered, the first of which is on the line from
    /// `start` on.
    fn deliver(&self, start: Duration, character: Duration, bytes: &[u8]) -> Vec<(Duration, Vec<u8>)> {
        let (mut delivered, mut first, mut held) = (Vec::new(), Duration::ZERO, Vec::new());
        let mut at = start;
        for (index, byte) in bytes.iter().enumerate() {
            let before = at;
            at += character;
            // The bytes before this one have waited for long enough.
            let waited_until = first.saturating_add(self.latency);
            if !held.is_empty() && waited_until <= at {
                delivered.push((waited_until.max(before), core::mem::take(&mut held)));
            }
            if held.is_empty() {
                first = at;
            }
            held.push(*byte);
            if held.len() >= self.most {
                delivered.push((at, core::mem::take(&mut held)));
            } else if index + 1 == bytes.len() {
                let idle = character.saturating_mul(self.idle);
                delivered.push((
                    at.saturating_add(idle).min(first.saturating_add(self.latency)),
                    core::mem::take(&mut held),
                ));
            }
        }
        delivered
    }
}

/// One end, the bytes on their way to it, and the time at which its sending line is free.
struct Side {
    end: Box<dyn End>,
    adapter: Option<Adapter>,
    coming: VecDeque<(Duration, Vec<u8>)>,
    free_at: Duration,
}

/// Both ends of a link, on a virtual clock.
struct Pair {
    now: Duration,
    character: Duration,
    sides: [Side; 2],
}

/// An event of the first or the second end.
type Event = (usize, Value);

impl Pair {
    fn new(
        link: &str,
        ends: [(&str, Value); 2],
        adapters: [Option<Adapter>; 2],
        character: Duration,
    ) -> Option<Self> {
        let mut adapters = adapters.into_iter();
        let mut sides = Vec::new();
        for (name, config) in ends {
            let config: Map<String, Value> = config.as_object().cloned().unwrap_or_default();
            let end = (Link::by_name(link).unwrap().end(name).unwrap().make)(&config, None).ok()?;
            sides.push(Side {
                end,
                adapter: adapters.next().flatten(),
                coming: VecDeque::new(),
                free_at: Duration::ZERO,
            });
        }
        let sides = sides.try_into().ok()?;
        let mut pair = Self { now: Duration::ZERO, character, sides };
        for side in &mut pair.sides {
            side.end.handle_connected(Duration::ZERO);
        }
        Some(pair)
    }

    fn call(&mut self, side: usize, name: &str, argument: &Value) {
        let refused = self.sides[side].end.call(self.now, name, argument).unwrap();
        assert_eq!(refused, Ok(()), "{name} {argument}");
    }

    /// Goes on to the next time at which something happens; the events of that.
    fn step(&mut self, until: Duration) -> Vec<Event> {
        let next = self.sides.iter().filter_map(|side| {
            let coming = side.coming.front().map(|(at, _)| *at);
            coming.into_iter().chain(side.end.poll_timeout()).min()
        });
        self.now = next.min().unwrap_or(until).min(until).max(self.now);
        let mut events = Vec::new();
        for at in 0..2 {
            let (first, second) = self.sides.split_at_mut(1);
            let (side, other) =
                if at == 0 { (&mut first[0], &mut second[0]) } else { (&mut second[0], &mut first[0]) };
            while side.coming.front().is_some_and(|(due, _)| *due <= self.now) {
                let (_, bytes) = side.coming.pop_front().unwrap();
                side.end.handle_input(self.now, &bytes);
            }
            side.end.handle_timeout(self.now);
            let mut buffer = vec![0; side.end.max_transmit()];
            loop {
                let mut idle = true;
                while let Some(event) = side.end.poll_event() {
                    events.push((at, serde_json::from_str(&event).unwrap()));
                    idle = false;
                }
                if let Some(length) = side.end.poll_transmit(self.now, &mut buffer) {
                    let (start, bytes) = (side.free_at.max(self.now), &buffer[..length]);
                    side.free_at = start + self.character * u32::try_from(length).unwrap();
                    match other.adapter {
                        Some(adapter) => other.coming.extend(adapter.deliver(start, self.character, bytes)),
                        None => {
                            let each = (1u32..).zip(bytes);
                            other
                                .coming
                                .extend(each.map(|(n, byte)| (start + self.character * n, vec![*byte])));
                        }
                    }
                    idle = false;
                }
                if idle {
                    break;
                }
            }
        }
        events
    }
}

/// A link on a serial line: its ends, and the number of exchanges that succeed.
struct Row {
    link: &'static str,
    ends: [&'static str; 2],
    bits: u32,
    answered: fn(&mut Pair) -> u32,
}

const ROWS: [Row; 5] = [
    Row { link: "fanuc-hmi-modbus", ends: ["client", "server"], bits: 11, answered: modbus },
    Row { link: "laser-eb90", ends: ["host", "controller"], bits: 10, answered: laser },
    Row { link: "isra-ball", ends: ["host", "ball"], bits: 10, answered: ball },
    Row { link: "val2-alter", ends: ["host", "controller"], bits: 10, answered: alter },
    Row { link: "val2-viewer", ends: ["host", "workstation"], bits: 10, answered: viewer },
];

fn is(event: &Event, side: usize, names: &[&str]) -> bool {
    event.0 == side && names.iter().any(|name| event.1["event"] == **name)
}

/// Makes one call after the other, each until one of these events.
fn one_by_one(pair: &mut Pair, call: &str, argument: &Value, good: &str, bad: &[&str]) -> u32 {
    let mut answered = 0;
    for _ in 0..EXCHANGES {
        pair.call(0, call, argument);
        let until = pair.now + 20 * SECOND;
        'exchange: while pair.now < until {
            for event in pair.step(until) {
                if is(&event, 1, &["queued"]) {
                    pair.call(1, "take", &event.1["count"]);
                }
                if is(&event, 0, &[good]) {
                    answered += 1;
                    break 'exchange;
                }
                if is(&event, 0, bad) {
                    break 'exchange;
                }
            }
        }
    }
    answered
}

fn modbus(pair: &mut Pair) -> u32 {
    let request = json!({"unit": 1, "function": 3, "address": 0, "quantity": 37});
    one_by_one(pair, "request", &request, "replied", &["failed"])
}

fn laser(pair: &mut Pair) -> u32 {
    let move_to = json!({"word": 257, "parameters": [{"f32": [100.0, -50.5, 250.0, 0.0, 90.0, -45.25]}]});
    one_by_one(pair, "submit", &move_to, "done", &["refused", "unknown"])
}

/// Runs a host that polls once in 28 ms, or as often as the line permits.
fn ball(pair: &mut Pair) -> u32 {
    let (mut polls, mut answered) = (0, 0);
    while polls < EXCHANGES {
        for event in pair.step(Duration::from_secs(60)) {
            polls += u32::from(is(&event, 1, &["reply"]));
            answered += u32::from(is(&event, 0, &["new", "old"]));
        }
    }
    answered
}

/// Runs ALTER: a message each 28 ms, whose reply has 15 ms.
fn alter(pair: &mut Pair) -> u32 {
    pair.call(1, "start", &Value::Null);
    let (mut answered, until) = (0, 28 * MS * EXCHANGES);
    while pair.now < until {
        let events = pair.step(until);
        answered += events.iter().filter(|event| is(event, 1, &["reply"])).count() as u32;
    }
    answered
}

/// Runs a display that requests a pose each second, from a host whose poses are set each 50 ms.
fn viewer(pair: &mut Pair) -> u32 {
    let pose = json!([16384, 0, 0, 0, 16384, 0, 0, 0, 16384, 320, 0, 0]);
    let mut answered = 0;
    for tick in 0..EXCHANGES * 20 {
        pair.call(0, "set_pose", &pose);
        if tick % 20 == 0 {
            pair.call(1, "draw", &Value::Null);
        }
        let until = 50 * MS * (tick + 1);
        while pair.now < until {
            answered += pair.step(until).iter().filter(|event| is(event, 1, &["pose"])).count() as u32;
        }
    }
    answered
}

/// Returns the configuration of an end at a rate.
fn config(link: &str, end: &str, baud: u32) -> Value {
    match (link, end) {
        ("fanuc-hmi-modbus", _) => json!({"framing": "rtu", "baud": baud}),
        ("val2-viewer", _) | (_, "ball") | ("laser-eb90", "controller") => json!({}),
        _ => json!({"baud": baud}),
    }
}

/// Returns whether an adapter delivers too late for a link: the ball's reply and ALTER's have 14 and 15 ms. ALTER's host
/// takes a pause of 4 ms for the end of a message, see `gap`.
fn is_too_late(link: &str, side: usize, adapter: Adapter, character: Duration) -> bool {
    let pause = adapter.latency.min(character * u32::try_from(adapter.most).unwrap());
    let is_later_than = |ms| adapter.latency >= ms && adapter.latency < Duration::MAX;
    match (link, side) {
        ("val2-alter", 0) => pause > 4 * MS || is_later_than(8 * MS),
        ("isra-ball" | "val2-alter", _) => is_later_than(16 * MS),
        _ => false,
    }
}

#[test]
fn every_adapter_delivers_what_a_link_can_read() {
    let (mut table, mut wrong) = (String::new(), String::new());
    for Row { link, ends, bits, answered } in ROWS {
        for side in 0..2 {
            writeln!(table, "{link} {}:", ends[side]).unwrap();
            for adapter in ADAPTERS {
                write!(table, "  {:<26}", adapter.name).unwrap();
                for baud in [9600u32, 19_200, 115_200] {
                    let configs = ends.map(|end| (end, config(link, end, baud)));
                    let mut adapters = [None, None];
                    adapters[side] = Some(adapter);
                    let character = SECOND * bits / baud;
                    let Some(mut pair) = Pair::new(link, configs, adapters, character) else {
                        write!(table, "    –").unwrap();
                        continue;
                    };
                    let count = answered(&mut pair);
                    write!(table, " {count:>4}").unwrap();
                    // The last exchange may be in progress.
                    if count + 1 < EXCHANGES && !is_too_late(link, side, adapter, character) {
                        writeln!(wrong, "{link} {} {} {baud}: {count}", ends[side], adapter.name).unwrap();
                    }
                }
                writeln!(table).unwrap();
            }
        }
    }
    println!("{table}");
    assert_eq!(wrong, "");
}
