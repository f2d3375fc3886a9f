//! Publishes on a connection: births, the records of the store in their sequence, and deaths.

use std::time::Instant;

use anyhow::Result;

use super::{CellIndices, InFlight, Phase, Uplink};
use crate::broker::Session;
use crate::cell::Cell;
use crate::compact::NameNumbers;
use crate::metric::{self, CONNECTED, DETAIL, Definition, EVENT};
use crate::node::{Node, Publication};
use crate::payload::{Metric, Quality};
use crate::plain;
use crate::refusals::DroppedRecord;
use crate::store::Store;

/// The number of records that are on their way at once.
const IN_FLIGHT: usize = 500;
/// The number of records that are read at once.
const CHUNK: usize = 100;

impl Uplink {
    /// Publishes births, records and deaths, as long as there is room.
    pub(super) fn publish(
        &mut self,
        (store, words): (&mut Store, &NameNumbers),
        cells: &mut [Cell],
        places: &CellIndices,
    ) -> Result<()> {
        let is_done = self.publish_births(store, cells)
            && self.publish_trials((store, words), cells)?
            && self.publish_records((store, words), cells, places)?;
        if is_done && self.next >= store.next() {
            self.publish_deaths(cells);
        }
        Ok(())
    }

    /// Publishes births. Returns false if there is no free space for more.
    fn publish_births(&mut self, store: &Store, cells: &mut [Cell]) -> bool {
        let Phase::Online { session } = &self.phase else { return false };
        if !self.is_born {
            if self.live == u64::MAX {
                self.live = store.next();
            }
            if !say(session, self.node.birth(cells.iter().filter(|cell| !cell.is_gone()).count())) {
                return false;
            }
            self.node.published();
            self.is_born = true;
            cells.iter_mut().for_each(|cell| cell.is_born = false);
        }
        cells
            .iter_mut()
            .enumerate()
            .filter(|(place, cell)| cell.is_connected && !cell.is_born && !self.holds.is_held(*place))
            .all(|(place, cell)| {
                let alias = self.aliases.then_some(place);
                bear(session, &mut self.node, (cell, alias), self.longest)
            })
    }

    /// Publishes one record of each cell that is held and due. Returns false if there is no free space for more.
    fn publish_trials(
        &mut self,
        (store, words): (&mut Store, &NameNumbers),
        cells: &mut [Cell],
    ) -> Result<bool> {
        while let Some((place, key)) = self.holds.due(Instant::now()) {
            let stored = store.records(key, 1)?.into_iter().find(|(found, _)| *found == key);
            let record = stored.and_then(|(_, bytes)| words.unpack(&bytes));
            let (Some(cell), Some(record)) = (cells.get_mut(place), record) else {
                self.holds.forget(place, key); // it has made room
                continue;
            };
            if !self.publish_record(cell, place, key, record.metrics, true) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Publishes the next records of the store, except those of held cells. Returns false if there is no free space for
    /// more.
    fn publish_records(
        &mut self,
        (store, words): (&mut Store, &NameNumbers),
        cells: &mut [Cell],
        places: &CellIndices,
    ) -> Result<bool> {
        while self.flight.len() < IN_FLIGHT {
            let records = store.records(self.next, CHUNK)?;
            if records.is_empty() {
                break;
            }
            for (key, bytes) in records {
                let record = words.unpack(&bytes);
                let place = record.as_ref().and_then(|record| places.get(&record.cell)).copied();
                if let (Some(record), Some(place)) = (record, place)
                    && let Some(cell) = cells.get_mut(place)
                {
                    // After the end of a hold, some of the held records are in flight already.
                    if !self.flight.contains_key(&key)
                        && !self.holds.keep(place, key)
                        && !self.publish_record(cell, place, key, record.metrics, key < self.live)
                    {
                        return Ok(false);
                    }
                } else {
                    self.orphans.push(key);
                }
                self.next = key + 1;
            }
        }
        Ok(true)
    }

    /// Publishes a record, after the birth of its cell. Returns false if there is no free space for it.
    fn publish_record(
        &mut self,
        cell: &mut Cell,
        place: usize,
        key: u64,
        mut metrics: Vec<Metric>,
        is_historical: bool,
    ) -> bool {
        let Phase::Online { session } = &self.phase else { return false };
        let alias = self.aliases.then_some(place);
        if !cell.is_born && !bear(session, &mut self.node, (cell, alias), self.longest) {
            return false;
        }
        // A record of before the cell was changed may have others.
        metrics.retain(|metric| cell.definitions.iter().any(|it| Some(it.name) == metric.name.as_deref()));
        if let Some(prefix) = &self.json {
            let (topic, message) =
                (format!("{prefix}/{}", cell.name), plain::message(&cell.name, &metrics, is_historical));
            // The broker has it before the record, which is published again if it has not that.
            if Session::packet_len(&topic, &message, self.acknowledged) <= self.longest
                && !session.publish(&topic, message, self.acknowledged, None)
            {
                return false;
            }
        }
        if is_historical {
            metrics.iter_mut().for_each(|metric| metric.is_historical = Some(true));
        }
        if self.aliases {
            for metric in &mut metrics {
                metric.alias = metric.name.as_deref().and_then(|name| cell.alias(place, name));
                metric.name.take_if(|_| metric.alias.is_some());
            }
        }
        let Publication { topic, payload } = self.node.data(&cell.name, metrics);
        let length = Session::packet_len(&topic, &payload, self.acknowledged);
        if length > self.longest {
            self.holds.forget(place, key);
            self.apart.push(DroppedRecord { key, place, why: "PacketTooLarge".into() });
            return true;
        }
        if !session.publish(&topic, payload, self.acknowledged, Some(key)) {
            return false;
        }
        self.node.published();
        self.counts.published += 1;
        self.flight.insert(key, InFlight { place, length });
        self.holds.tried(place, key);
        true
    }

    fn publish_deaths(&mut self, cells: &mut [Cell]) {
        let Phase::Online { session } = &self.phase else { return };
        for cell in cells.iter_mut().filter(|cell| cell.is_born && !cell.is_connected) {
            let words = last_words(cell);
            let mut death = self.node.device_death(&cell.name, words);
            if Session::packet_len(&death.topic, &death.payload, false) > self.longest {
                death = self.node.device_death(&cell.name, Vec::new());
            }
            if !say(session, death) {
                return;
            }
            self.node.published();
            cell.is_born = false;
        }
    }
}

/// Returns the metrics of a death: the link is not connected, the reason, and no values of the cell's own metrics.
fn last_words(cell: &mut Cell) -> Vec<Metric> {
    let mut words = cell.nulls(metric::now(), Quality::Stale);
    let said = cell.definitions.iter().filter(|it| [CONNECTED, EVENT].contains(&it.name));
    words.extend(said.filter_map(|Definition { name, kind }| {
        let (at, value) = cell.values.get(name)?;
        Some(Metric::new(name, *kind, *at, Some(value.clone())))
    }));
    words
}

/// Publishes as Sparkplug has births and deaths: with QoS 0.
fn say(session: &Session, Publication { topic, payload }: Publication) -> bool {
    session.publish(&topic, payload, false, None)
}

/// Publishes the birth of a cell. The last event is omitted if the broker does not take so long a packet; a birth that is too
/// long even so ends the connection, and nothing follows it. With the cell's place its metrics have aliases.
fn bear(
    session: &Session,
    node: &mut Node,
    (cell, place): (&mut Cell, Option<usize>),
    longest: usize,
) -> bool {
    let alias = |name: &str| cell.alias(place?, name);
    let fits = |birth: &Publication| Session::packet_len(&birth.topic, &birth.payload, false) <= longest;
    let value = |name: &str| cell.values.get(name).map(|(at, value)| (*at, value));
    let mut birth = node.device_birth(&cell.name, &cell.definitions, value, alias);
    if !fits(&birth) {
        let short = |name: &str| value(name).filter(|_| name != EVENT && name != DETAIL);
        birth = node.device_birth(&cell.name, &cell.definitions, short, alias);
    }
    let is_born = fits(&birth);
    if !say(session, birth) || !is_born {
        return false;
    }
    node.published();
    cell.is_born = true;
    true
}
