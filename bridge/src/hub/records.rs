//! The records of the hub: how they are made, written and shown.

use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::Result;
use serde_json::json;

use super::{Hub, number_of};
use crate::cell::in_order;
use crate::health::{CellHealth, Figures};
use crate::metric::{self, NUMBER, Named};
use crate::payload::{Metric, Payload, Quality, Value};
use crate::store::Batch;
use crate::uplink;
use cellwire::io::interrupt;

/// A disk that takes nothing is tried again so often.
const RETRY: Duration = Duration::from_secs(1);

impl Hub<'_> {
    pub(super) fn record(&mut self, place: usize, at: u64, named: Vec<Named>, batch: &mut Batch) {
        self.record_with(place, at, named, None, batch);
    }

    /// Gives a report its number, and puts it into the batch. With a quality the cell's own metrics are null.
    pub(super) fn record_with(
        &mut self,
        place: usize,
        at: u64,
        named: Vec<Named>,
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
        batch.append.push(uplink::record(&cell.name, Payload { timestamp: None, metrics, seq: None }));
        self.figures.records += 1;
    }

    /// Writes it. What a full disk does not take waits until it does, and the links wait with it.
    pub(super) fn write(&mut self, batch: &mut Batch) -> Result<()> {
        let news = self.cells.iter_mut().filter(|cell| cell.number != cell.kept);
        batch.names.extend(news.map(|cell| {
            cell.kept = cell.number;
            (number_of(&cell.name), Some(cell.number.to_string()))
        }));
        if batch.append.is_empty() && batch.remove.is_empty() && batch.names.is_empty() {
            return Ok(());
        }
        let mut logged = String::new();
        let dropped = loop {
            let opened = if logged.is_empty() { Ok(()) } else { self.store.reopen() };
            let error = match opened.and_then(|()| self.store.write(batch)) {
                Ok(dropped) => break dropped,
                Err(error) if interrupt::requested() => return Err(error),
                Err(error) => format!("{error:#}"),
            };
            if error != logged {
                let advice = "nothing is taken or published until this is mended";
                (self.log)(json!({"store": "stuck", "why": error, "advice": advice}));
                logged = error;
            }
            self.figures.is_stuck = true;
            self.show();
            thread::sleep(RETRY);
        };
        if core::mem::take(&mut self.figures.is_stuck) {
            (self.log)(json!({"store": "written"}));
        }
        if dropped > 0 && self.figures.dropped_full == 0 {
            (self.log)(json!({"store": "full", "why": "the oldest records make room: see store.records"}));
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
        let cells = self.cells.iter().enumerate().map(|(place, cell)| CellHealth {
            commands_left: self.commands.left(&cell.name, now),
            refusals: self
                .refusals
                .range((place, "")..(place + 1, ""))
                .map(|((_, why), count)| (*why, *count))
                .collect(),
            name: cell.name.clone(),
            is_connected: cell.is_connected,
            number: cell.number,
            held: self.uplink.held(place),
        });
        self.figures.dropped_busy = self.busy.load(Ordering::Relaxed);
        self.health.set(Figures {
            cells: cells.collect(),
            is_online: self.uplink.is_online(),
            stored: self.store.len(),
            in_flight: self.uplink.in_flight(),
            uplink: self.uplink.counts,
            commands: self.figures.commands.clone(),
            ..self.figures
        });
    }
}

/// Whether it is none of those that are no number, or infinite.
fn is_number(value: &Value) -> bool {
    match value {
        Value::Float(value) => value.is_finite(),
        Value::Double(value) => value.is_finite(),
        _ => true,
    }
}
