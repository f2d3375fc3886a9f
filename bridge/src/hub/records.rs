//! The records of the hub: how they are made, written and shown.

use std::collections::HashMap;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use serde_json::{Value as Json, json};

use super::{Hub, power};
use crate::bucket::Rate;
use crate::cell::{Cell, in_order};
use crate::commands::Commands;
use crate::compact::{NameNumbers, Record};
use crate::health::{BrokerHealth, CellHealth, Figures};
use crate::metric::{self, NUMBER, NamedValue};
use crate::payload::{Metric, Quality, Value};
use crate::store::{Batch, KeptNames, Names, Store, WriteResult};
use crate::uplink;
use cellwire_io::interrupt;

/// The prefix in the store of the name of a cell: the value is the number of its last record.
const NUMBERS: &str = "number/";
/// The interval at which a failed write to the disk is retried.
const RETRY: Duration = Duration::from_secs(1);

impl Hub<'_> {
    pub(super) fn record(&mut self, place: usize, at: u64, named: Vec<NamedValue>, batch: &mut Batch) {
        self.record_with(place, at, named, None, batch);
    }

    /// Notes that a cell's values are implausible; the event has the reason.
    pub(super) fn implausible(&mut self, place: usize, named: &[NamedValue]) {
        let (Some(cell), Some((_, Value::String(event)))) = (self.cells.get_mut(place), named.first()) else {
            return;
        };
        let event: Json = serde_json::from_str(event).unwrap_or(Json::Null);
        let of = |name: &str| event.get(name).and_then(Json::as_str).unwrap_or_default();
        cell.why = format!("implausible telemetry: {} ({})", of("fault"), of("value"));
        (self.log)(json!({"cell": cell.name, "values": event}));
    }

    /// Gives a report its number, and puts it into the batch. With a quality the cell's own metrics are null.
    pub(super) fn record_with(
        &mut self,
        place: usize,
        at: u64,
        named: Vec<NamedValue>,
        quality: Option<Quality>,
        batch: &mut Batch,
    ) {
        let Some(cell) = self.cells.get_mut(place) else { return };
        let at = in_order(cell.last_at, at);
        cell.last_at = at;
        cell.number += 1;
        let number = uplink::number(cell.number);
        let named = [(NUMBER, number)].into_iter().chain(named);
        let mut metrics = Vec::new();
        for (name, value) in named {
            let Some(definition) = cell.definitions.iter().find(|definition| definition.name == name) else {
                continue;
            };
            if is_number(&value) {
                metrics.push(Metric::new(name, definition.kind, at, Some(value.clone())));
                cell.values.insert(definition.name, (at, value));
            } else {
                metrics.push(Metric::null(name, definition.kind, at, Quality::Bad));
                cell.values.remove(definition.name);
            }
        }
        metrics.extend(quality.into_iter().flat_map(|quality| cell.nulls(at, quality)));
        batch.append.push(self.words.pack(&cell.name, at, &metrics));
        self.figures.records += 1;
    }

    /// Writes the batch. If the disk is full, waits until it takes the batch, and the links wait with it.
    pub(super) fn write(&mut self, batch: &mut Batch) -> Result<()> {
        let is_due = self.store.due().is_some_and(|due| due <= Instant::now());
        if batch.append.is_empty() && batch.remove.is_empty() && batch.names.is_empty() && !is_due {
            return Ok(());
        }
        let mut logged = String::new();
        let WriteResult { dropped, kept } = loop {
            let opened = if logged.is_empty() { Ok(()) } else { self.store.reopen() };
            let numbers = |kept| numbers(&self.cells, kept);
            let error = match opened.and_then(|()| self.store.write(batch, &numbers)) {
                Ok(written) => break written,
                Err(error) if interrupt::requested() => return Err(error),
                Err(error) => format!("{error:#}"),
            };
            if error != logged {
                let advice = "nothing is accepted or published until this is fixed";
                (self.log)(json!({"store": "stuck", "why": error, "advice": advice}));
                logged = error;
            }
            self.figures.is_stuck = true;
            self.show();
            thread::sleep(RETRY);
        };
        for cell in &mut self.cells {
            match kept {
                Some(KeptNames::Now) => cell.kept = cell.number,
                Some(KeptNames::Before) => cell.kept = cell.written,
                None => {}
            }
            cell.written = cell.number;
        }
        if core::mem::take(&mut self.figures.is_stuck) {
            (self.log)(json!({"store": "written"}));
        }
        if dropped > 0 && self.figures.dropped_full == 0 {
            (self.log)(json!({"store": "full", "why": "the oldest records are dropped: see store.bytes"}));
        }
        if dropped > 0 {
            let oldest = self.store.records(0, 1)?.first().map_or(u64::MAX, |(key, _)| *key);
            self.uplink.made_room(oldest);
        }
        self.figures.dropped_full += dropped;
        Ok(())
    }

    pub(super) fn count(&mut self, outcome: &'static str) {
        *self.figures.commands.entry(outcome).or_default() += 1;
    }

    pub(super) fn show(&mut self) {
        self.notify.lives(Instant::now());
        let now = metric::now();
        let known = self.cells.iter().enumerate().filter(|(_, cell)| !cell.is_gone() && cell.is_here());
        let cells = known.map(|(place, cell)| CellHealth {
            commands_left: self.commands.left(&cell.name, now),
            refusals: self
                .refusals
                .range((place, "")..(place + 1, ""))
                .map(|((_, why), count)| (*why, *count))
                .collect(),
            name: cell.name.clone(),
            link: cell.link.clone(),
            is_connected: cell.is_connected,
            since: cell.since,
            why: cell.why.clone(),
            last_at: cell.last_at,
            number: cell.number,
            held: self.uplink.held(place),
            failures: cell.failures.load(Ordering::Relaxed),
        });
        self.figures.dropped_busy = self.busy.load(Ordering::Relaxed);
        let waits = self.uplink.waits_for().map(|host| format!("waits for the host application {host}"));
        let why = waits.unwrap_or_else(|| self.figures.broker.why.clone());
        self.health.set(Figures {
            cells: cells.collect(),
            broker: BrokerHealth { why, address: self.uplink.address(), ..self.figures.broker.clone() },
            latest: self.latest.list(),
            shared: self.shared(),
            is_online: self.uplink.is_online(),
            stored: self.store.len(),
            stored_bytes: self.store.bytes(),
            in_flight: self.uplink.in_flight(),
            uplink: self.uplink.counts,
            commands: self.figures.commands.clone(),
            ..self.figures
        });
    }
}

/// Reads everything in the store that a start would read.
///
/// # Errors
/// If the store cannot be read.
pub fn check(store: &mut Store, words: &NameNumbers) -> Result<()> {
    numbers_of(store, words)?;
    let rate = Rate { per_second: 1.0, burst: 1 };
    Commands::open(|prefix| store.names(prefix), Duration::ZERO, rate, &mut Batch::default())?;
    power::restarted_while_running(store, &mut Batch::default()).map(drop)
}

/// Returns the number of each cell's last record, from the kept numbers and the records that were written since.
pub(super) fn numbers_of(store: &mut Store, words: &NameNumbers) -> Result<HashMap<String, u64>> {
    let mut numbers = HashMap::new();
    for (name, number) in store.names(NUMBERS)? {
        let cell = name.strip_prefix(NUMBERS).unwrap_or_default();
        let number = number.parse().with_context(|| format!("{name} in the store is not a number"))?;
        numbers.insert(cell.to_owned(), number);
    }
    store.each(|bytes| {
        let Some(Record { cell, metrics }) = words.unpack(bytes) else { return };
        let number = metrics.iter().find(|metric| metric.name.as_deref() == Some(NUMBER));
        if let Some(Value::Long(number)) = number.and_then(|metric| metric.value.as_ref()) {
            let last: &mut u64 = numbers.entry(cell).or_default();
            *last = (*last).max(*number);
        }
    })?;
    Ok(numbers)
}

/// Returns the numbers of the cells that differ from the kept ones: those of before the batch that is being written, or those
/// with it.
fn numbers(cells: &[Cell], kept: KeptNames) -> Names {
    let number = |cell: &Cell| match kept {
        KeptNames::Before => cell.written,
        KeptNames::Now => cell.number,
    };
    let news = cells.iter().filter(|cell| cell.kept != number(cell));
    news.map(|cell| (format!("{NUMBERS}{}", cell.name), Some(number(cell).to_string()))).collect()
}

/// Returns whether the value is neither NaN nor infinite.
fn is_number(value: &Value) -> bool {
    match value {
        Value::Float(value) => value.is_finite(),
        Value::Double(value) => value.is_finite(),
        _ => true,
    }
}
