//! The state of the bridge, in the text format of Prometheus, and for a page.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use serde_json::json;

use super::metric;
use super::recent::RecentCommand;
use super::uplink::Counts;
use crate::http::Reply;

/// The state of the bridge, shared with the server.
#[derive(Debug, Default)]
pub struct Health(Mutex<Figures>);

/// The state of the bridge.
#[derive(Debug, Clone, Default)]
pub struct Figures {
    /// The state of the connection to the broker.
    pub broker: BrokerHealth,
    /// Whether records are published now.
    pub is_online: bool,
    /// The number of records in the store.
    pub stored: u64,
    /// The number of bytes of the records in the store, and its maximum.
    pub stored_bytes: (u64, u64),
    /// The number of records that were sent to the broker and are not acknowledged.
    pub in_flight: usize,
    /// The number of records made.
    pub records: u64,
    /// The number of records that were dropped because the store was full.
    pub dropped_full: u64,
    /// The number of reports that were dropped because the disk was too slow.
    pub dropped_busy: u64,
    /// The number of records that were dropped because their cells are not in the site file any more.
    pub dropped_orphans: u64,
    /// The number of ignored or malformed messages of the broker.
    pub strange: u64,
    /// Whether the disk does not take the data that is to be written.
    pub is_stuck: bool,
    /// The counts of the connection to the broker.
    pub uplink: Counts,
    /// The numbers of commands by outcome.
    pub commands: BTreeMap<&'static str, u64>,
    /// The latest commands, the latest first.
    pub latest: Vec<RecentCommand>,
    /// The state of each cell.
    pub cells: Vec<CellHealth>,
    /// The numbers of shared cells; `None` if this bridge does not share cells.
    pub shared: Option<Shared>,
}

/// The numbers of shared cells by their bridge, as far as this bridge knows.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Shared {
    /// The number of cells that this bridge has.
    pub here: u64,
    /// The number of cells that another bridge has.
    pub elsewhere: u64,
    /// The number of cells that no bridge has.
    pub nobody: u64,
}

/// The broker.
#[derive(Debug, Clone, Default)]
pub struct BrokerHealth {
    /// The address of the broker.
    pub address: String,
    /// The name of Sparkplug's group.
    pub group: String,
    /// The name of Sparkplug's edge node: this bridge.
    pub node: String,
    /// The reason why nothing is published; empty if records are published.
    pub why: String,
}

/// The state of a cell.
#[derive(Debug, Clone)]
pub struct CellHealth {
    /// The name of the cell.
    pub name: String,
    /// The link of the cell.
    pub link: String,
    /// The link of the cell is connected.
    pub is_connected: bool,
    /// The time since which `is_connected` has this value, in milliseconds since 1970 UTC.
    pub since: u64,
    /// The reason why the link is not connected.
    pub why: String,
    /// The time of the cell's last record; 0: no record since the bridge was started.
    pub last_at: u64,
    /// The number of the cell's last record.
    pub number: u64,
    /// The number of commands that the cell takes now.
    pub commands_left: f64,
    /// The commands of the cell that were refused at once, by reason.
    pub refusals: Vec<(&'static str, u64)>,
    /// The number of the cell's records that wait because the broker refuses its topic.
    pub held: usize,
    /// The number of failures while the cell's device did not answer.
    pub failures: u64,
}

impl Health {
    /// Replaces the state.
    pub fn set(&self, figures: Figures) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = figures;
    }

    /// Returns the answer to a request for a path.
    pub fn reply(&self, path: &str) -> Reply {
        let figures = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        match path {
            "/metrics" => Reply::new(200, "text/plain; version=0.0.4; charset=utf-8", figures.text()),
            "/" => Reply::new(200, "text/html; charset=utf-8", include_str!("page/index.html")),
            "/page.css" => Reply::new(200, "text/css; charset=utf-8", include_str!("page/page.css")),
            "/page.js" => Reply::new(200, "text/javascript; charset=utf-8", include_str!("page/page.js")),
            "/events" => Reply { is_live: true, ..Reply::new(200, "text/event-stream", figures.event()) },
            "/health" => {
                let (status, body) = if figures.is_stuck {
                    (503, "the store cannot be written\n".into())
                } else if figures.is_online {
                    (200, "online\n".into())
                } else {
                    (503, format!("nothing is published: {}\n", figures.broker.why))
                };
                Reply::new(status, "text/plain; charset=utf-8", body)
            }
            _ => {
                Reply::new(404, "text/plain; charset=utf-8", "not found: there are /, /metrics and /health\n")
            }
        }
    }
}

impl Figures {
    /// Returns the contents of the page as an event: one line.
    fn event(&self) -> String {
        let cell = |cell: &CellHealth| {
            json!({
                "name": cell.name, "link": cell.link, "alive": cell.is_connected, "since": cell.since, "why": cell.why,
                "last": cell.last_at, "number": cell.number, "held": cell.held,
            })
        };
        let BrokerHealth { address, group, node, why } = &self.broker;
        let dropped = self.dropped_full + self.dropped_busy + self.dropped_orphans + self.uplink.refused;
        let (used, limit) = self.stored_bytes;
        let view = json!({
            "now": metric::now(),
            "broker": {"address": address, "group": group, "node": node, "online": self.is_online, "why": why},
            "store": {
                "records": self.stored, "bytes": used, "limit": limit, "stuck": self.is_stuck, "dropped": dropped,
            },
            "records": self.records,
            "shared": self.shared,
            "counts": self.commands,
            "commands": self.latest,
            "cells": self.cells.iter().map(cell).collect::<Vec<_>>(),
        });
        format!("data: {view}\n\n")
    }

    fn text(&self) -> String {
        let mut text = String::new();
        let mut family = |name: &str, kind: &str, help: &str, samples: &[(String, f64)]| {
            let _ =
                writeln!(text, "# HELP cellwire_bridge_{name} {help}\n# TYPE cellwire_bridge_{name} {kind}");
            for (labels, value) in samples {
                let _ = writeln!(text, "cellwire_bridge_{name}{labels} {value}");
            }
        };
        let one = |value: u64| vec![(String::new(), number(value))];
        let Counts { connections, published, acknowledged, rejected, refused, ahead } = self.uplink;
        family("online", "gauge", "1 while records are published.", &one(self.is_online.into()));
        family("store_stuck", "gauge", "1 while the store cannot be written.", &one(self.is_stuck.into()));
        family("store_records", "gauge", "Records that the broker has not acknowledged.", &one(self.stored));
        let (used, most) = self.stored_bytes;
        family("store_bytes", "gauge", "Bytes of the records in the store.", &one(used));
        family(
            "store_limit_bytes",
            "gauge",
            "The limit of the store, at which the oldest records are dropped.",
            &one(most),
        );
        family(
            "in_flight_records",
            "gauge",
            "Records published and not acknowledged.",
            &one(self.in_flight as u64),
        );
        family("records_total", "counter", "Records made.", &one(self.records));
        family(
            "published_total",
            "counter",
            "Records published, again or for the first time.",
            &one(published),
        );
        family(
            "acknowledged_total",
            "counter",
            "Records that the broker has acknowledged.",
            &one(acknowledged),
        );
        family("rejected_total", "counter", "Refusals of records by the broker.", &one(rejected));
        family("connections_total", "counter", "Accepted connections to the broker.", &one(connections));
        family(
            "states_ahead_total",
            "counter",
            "Ignored messages of the host application, dated too far ahead.",
            &one(ahead),
        );
        family(
            "strange_total",
            "counter",
            "Ignored or malformed messages of the broker.",
            &one(self.strange),
        );
        let dropped = [
            ("full", self.dropped_full),
            ("busy", self.dropped_busy),
            ("orphan", self.dropped_orphans),
            ("refused", refused),
        ];
        let dropped = dropped.map(|(why, count)| (format!("{{why=\"{why}\"}}"), number(count)));
        family(
            "dropped_total",
            "counter",
            "Lost records: the store was full, the disk too slow, the cell was removed from the site file, or the broker refused it.",
            &dropped,
        );
        let commands = self
            .commands
            .iter()
            .map(|(outcome, count)| (format!("{{outcome=\"{outcome}\"}}"), number(*count)));
        family("commands_total", "counter", "Commands by outcome.", &commands.collect::<Vec<_>>());
        let label = |cell: &CellHealth| {
            let name = cell.name.replace('\\', "\\\\").replace('"', "\\\"");
            format!("{{cell=\"{name}\"}}")
        };
        let left = self.cells.iter().map(|cell| (label(cell), cell.commands_left));
        family(
            "commands_left",
            "gauge",
            "Commands that the cell would accept now.",
            &left.collect::<Vec<_>>(),
        );
        let refusals = self.cells.iter().flat_map(|cell| {
            let of = |(why, count): &(&str, u64)| {
                let label = label(cell);
                (format!("{},why=\"{why}\"}}", label.trim_end_matches('}')), number(*count))
            };
            cell.refusals.iter().map(of)
        });
        family(
            "commands_refused_total",
            "counter",
            "Commands refused before they reached the cell, by reason.",
            &refusals.collect::<Vec<_>>(),
        );
        let links = self.cells.iter().map(|cell| (label(cell), number(cell.is_connected.into())));
        family(
            "link_connected",
            "gauge",
            "1 while the cell's link is connected.",
            &links.collect::<Vec<_>>(),
        );
        let failures = self.cells.iter().map(|cell| (label(cell), number(cell.failures)));
        family(
            "link_failures_total",
            "counter",
            "Failures while the cell's device did not answer.",
            &failures.collect::<Vec<_>>(),
        );
        let numbers = self.cells.iter().map(|cell| (label(cell), number(cell.number)));
        family(
            "record_number",
            "counter",
            "The number of the cell's last record.",
            &numbers.collect::<Vec<_>>(),
        );
        let shared = self.shared.iter().flat_map(|Shared { here, elsewhere, nobody }| {
            let of = |(place, count): (_, &u64)| (format!("{{where=\"{place}\"}}"), number(*count));
            [("here", here), ("elsewhere", elsewhere), ("nobody", nobody)].map(of)
        });
        family("shared_cells", "gauge", "Shared cells by owner.", &shared.collect::<Vec<_>>());
        let held = self.cells.iter().map(|cell| (label(cell), number(cell.held as u64)));
        family(
            "held_records",
            "gauge",
            "Records held because the broker refuses the cell's topic.",
            &held.collect::<Vec<_>>(),
        );
        text
    }
}

#[expect(clippy::cast_precision_loss, reason = "Prometheus has doubles")]
fn number(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_of_prometheus() {
        let health = Health::default();
        assert_eq!((health.reply("/health").status, health.reply("/x").status), (503, 404));
        let cells = vec![CellHealth {
            name: "a \"b\\".into(),
            link: "isra-ball".into(),
            is_connected: true,
            since: 0,
            why: "<b>\n".into(),
            last_at: 0,
            number: 7,
            commands_left: 2.5,
            refusals: vec![("rate", 4)],
            held: 2,
            failures: 3,
        }];
        let shared = Some(Shared { here: 5, elsewhere: 6, nobody: 7 });
        health.set(Figures { is_online: true, stored: 3, cells, shared, ..Figures::default() });
        assert_eq!(health.reply("/health").status, 200);
        let event = health.reply("/events").body;
        assert!(
            event.starts_with("data: {") && event.ends_with("}\n\n") && event.lines().count() == 2,
            "{event}"
        );
        assert!(event.contains(r#""why":"<b>\n""#), "{event}");
        let text = health.reply("/metrics").body;
        for line in [
            "# TYPE cellwire_bridge_online gauge",
            "cellwire_bridge_online 1",
            "cellwire_bridge_store_records 3",
            "cellwire_bridge_dropped_total{why=\"full\"} 0",
            "cellwire_bridge_dropped_total{why=\"refused\"} 0",
            "cellwire_bridge_record_number{cell=\"a \\\"b\\\\\"} 7",
            "cellwire_bridge_commands_left{cell=\"a \\\"b\\\\\"} 2.5",
            "cellwire_bridge_commands_refused_total{cell=\"a \\\"b\\\\\",why=\"rate\"} 4",
            "cellwire_bridge_shared_cells{where=\"nobody\"} 7",
            "cellwire_bridge_link_failures_total{cell=\"a \\\"b\\\\\"} 3",
            "cellwire_bridge_held_records{cell=\"a \\\"b\\\\\"} 2",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} in\n{text}");
        }
    }
}
