//! Devices of all links, thousands in one thread, as the load with which a bridge is measured. For each link it listens once, and
//! serves each client that connects with the session of the device's end.
//!
//! `cargo run --release -p cellwire-bridge --example load` prints where, as one line of JSON, and serves until it is killed.

#![allow(clippy::print_stdout, reason = "an example")]
#![allow(clippy::std_instead_of_core, reason = "a program with std")]

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use cellwire_links::Link;
use cellwire_links::end::{End, EndRow};
use fanuc_hmi_modbus::{TelemetryBlock, WordOrder};
use mio::net::{TcpListener, TcpStream};
use mio::{Events, Interest, Poll, Token};
use serde_json::{Map, Value, json};
use slab::Slab;

/// The link, the device's end, and what it does by itself this often.
type Kind = (&'static str, &'static str, Option<(&'static str, Duration)>);

const KINDS: [Kind; 7] = [
    ("fanuc-hmi-modbus", "", None),
    ("kawasaki-msg", "robot", None),
    ("laser-eb90", "controller", None),
    ("mmacell-proto", "device", None),
    ("isra-ball", "ball", Some(("measure", Duration::from_millis(100)))),
    // The exchange continues by itself, in its cycles of 28 ms.
    ("val2-alter", "controller", Some(("start", Duration::from_secs(5)))),
    // Without an answer it asks again after a pause of 2 s.
    ("val2-viewer", "workstation", Some(("draw", Duration::from_secs(3)))),
];
/// The interval at which due work is looked for.
const TICK: Duration = Duration::from_millis(5);

struct Device {
    stream: TcpStream,
    kind: usize,
    /// Missing where a reply is all there is.
    end: Option<Box<dyn End>>,
    unsent: Vec<u8>,
    input: Vec<u8>,
    next: Duration,
    begun: Duration,
}

fn main() -> Result<()> {
    let (mut poll, mut events, start) = (Poll::new()?, Events::with_capacity(1024), Instant::now());
    let (mut listeners, mut places) = (Vec::new(), Map::new());
    for (kind, (link, ..)) in KINDS.iter().enumerate() {
        let any: SocketAddr = ([127, 0, 0, 1], 0).into();
        let mut listener = TcpListener::bind(any)?;
        poll.registry().register(&mut listener, Token(kind), Interest::READABLE)?;
        places.insert((*link).into(), listener.local_addr()?.to_string().into());
        listeners.push(listener);
    }
    println!("{}", Value::Object(places));
    let mut devices: Slab<Device> = Slab::new();
    let mut looked = Duration::ZERO;
    loop {
        poll.poll(&mut events, Some(TICK))?;
        let now = start.elapsed();
        for event in &events {
            match event.token().0.checked_sub(KINDS.len()) {
                None => accept(&poll, &listeners, event.token().0, now, &mut devices)?,
                Some(key) => {
                    if devices.get_mut(key).is_some_and(|device| !device.take(now)) {
                        devices.remove(key);
                    }
                }
            }
        }
        if now >= looked + TICK {
            looked = now;
            devices.retain(|_, device| device.look(now));
        }
    }
}

fn accept(
    poll: &Poll,
    listeners: &[TcpListener],
    kind: usize,
    now: Duration,
    devices: &mut Slab<Device>,
) -> Result<()> {
    let (listener, (link, name, _)) = listeners.get(kind).zip(KINDS.get(kind)).context("no such kind")?;
    while let Ok((mut stream, _)) = listener.accept() {
        let row: Option<&EndRow> = Link::by_name(link)?.ends.iter().find(|row| row.name == *name);
        let mut end = row.map(|row| (row.make)(&Map::new(), None)).transpose()?;
        if let Some(end) = &mut end {
            end.handle_connected(now);
        }
        let entry = devices.vacant_entry();
        let token = Token(KINDS.len() + entry.key());
        poll.registry().register(&mut stream, token, Interest::READABLE)?;
        stream.set_nodelay(true)?;
        // Not all at once.
        let next = now + Duration::from_micros(entry.key() as u64 * 997 % 500_000);
        entry.insert(Device { stream, kind, end, unsent: Vec::new(), input: Vec::new(), next, begun: now });
    }
    Ok(())
}

impl Device {
    /// Reads and answers. False when the connection has ended.
    fn take(&mut self, now: Duration) -> bool {
        let mut chunk = [0; 4096];
        loop {
            match self.stream.read(&mut chunk) {
                Ok(0) => return false,
                Ok(count) => {
                    let bytes = chunk.get(..count).unwrap_or_default();
                    match &mut self.end {
                        Some(end) => end.handle_input(now, bytes),
                        None => self.input.extend_from_slice(bytes),
                    }
                    self.answer(now);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return self.send(),
                Err(_) => return false,
            }
        }
    }

    /// Does the work that is due. Returns false if the connection has ended.
    fn look(&mut self, now: Duration) -> bool {
        let Some(end) = &mut self.end else { return self.send() };
        if end.poll_timeout().is_some_and(|at| at <= now) {
            end.handle_timeout(now);
        }
        if let Some((_, _, Some((call, every)))) = KINDS.get(self.kind)
            && now >= self.next
        {
            self.next = now + *every;
            let force = now.as_millis() / 100 % 100;
            let _ = end.call(now, call, &json!({"force": [force, 2, 3], "moment": [0, 0, 0], "keys": 0}));
        }
        self.answer(now);
        self.send()
    }

    fn answer(&mut self, now: Duration) {
        let Some(end) = &mut self.end else { return self.registers(now) };
        loop {
            while let Some(event) = end.poll_event() {
                if event.contains("\"event\":\"execute\"") {
                    let _ = end.call(now, "answer", &json!([{"i16": [1, 64, 0]}]));
                } else if event.contains("\"event\":\"asked\"") {
                    let _ = end.call(now, "accept", &Value::Null);
                }
            }
            let mut out = [0; 4096];
            let Some(count) = end.poll_transmit(now, &mut out) else { return };
            self.unsent.extend_from_slice(out.get(..count).unwrap_or_default());
            end.handle_transmitted(now);
        }
    }

    /// Replies of Modbus/TCP to any client that reads registers.
    fn registers(&mut self, now: Duration) {
        while let Some([t0, t1, _, _, _, _, unit, function, _, _, c0, c1]) =
            self.input.first_chunk::<12>().copied()
        {
            self.input.drain(..12);
            let ticks = u32::try_from((now - self.begun).as_millis() / 8).unwrap_or_default();
            let wave = f32::from(u16::try_from(ticks % 1000).unwrap_or_default());
            let block = TelemetryBlock {
                life_counter: ticks,
                override_percent: 100,
                position: [400.0 + wave / 10.0, 0.0, 365.0],
                quaternion: [0.0, 0.6, 0.0, 0.8],
                ..TelemetryBlock::default()
            };
            let count = u16::from_be_bytes([c0, c1]).min(125);
            let registers = block.to_registers(WordOrder::LowFirst).into_iter().chain(core::iter::repeat(0));
            let words: Vec<u8> = registers.take(count.into()).flat_map(u16::to_be_bytes).collect();
            let [high, low] = (3 + 2 * count).to_be_bytes();
            let bytes = u8::try_from(2 * count).unwrap_or(u8::MAX);
            self.unsent.extend([t0, t1, 0, 0, high, low, unit, function, bytes]);
            self.unsent.extend(words);
        }
    }

    fn send(&mut self) -> bool {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent) {
                Ok(count) => drop(self.unsent.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => return false,
            }
        }
        true
    }
}
