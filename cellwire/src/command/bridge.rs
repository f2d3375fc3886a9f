//! `cellwire bridge`: many cells to one MQTT broker.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use serde_json::json;

use super::settings::lines;
use crate::cell::bridge::{Hall, Health, Hub, links};
use crate::io::output::log;
use crate::io::{http, interrupt, output, tcp};

/// Connects the cells of a hall to an MQTT 5 broker: Sparkplug B, through a store, commands back.
///
/// HALL.toml has the broker, a store, and a table for each cell:
///
///   [broker]
///   address = "broker.example:8883"
///   group = "hall-3"                   # Sparkplug's group, and this bridge in it
///   node = "bridge-1"
///   user = "bridge"
///   password_file = "bridge.password"  # its first line; files are beside HALL.toml
///   tls = { ca = "ca.pem" }            # without it the connection is open; and certificate, key
///   primary_host = "scada"             # send only while this host application is online
///   [store]
///   file = "hall-3.redb"               # what the broker has not acknowledged
///   records = 1000000                  # then the oldest make room
///   [health]
///   listen = "127.0.0.1:9464"          # /metrics in Prometheus' format, and /health
///   [cell.welder]                      # Sparkplug's device
///   link = "fanuc-hmi-modbus"
///   address = "192.168.0.10:502"
///   commands = true                    # obey the broker; by default a cell only reports
///   settings = { poll = "500ms" }      # as --set takes them, see below
///
/// Every report is a record with a number, on the disk before it is published with QoS 1, and
/// removed when the broker has acknowledged it. While there is no broker, records are kept; then
/// they are sent in their order, marked as historical. A record may be published twice after a
/// lost connection or a crash: a consumer drops every record whose Record/Number is not higher
/// than the last of the same cell and Record/Store.
///
/// A command is a write of the metric Command/Request: an object of JSON with an id that is used
/// once, and the order, such as {"id":"7f3a","write_register":{"address":40,"value":1}}. The
/// outcome (accepted; then done, refused, partial or unknown) is reported as Command/Id and
/// Command/Outcome. The same id again is not executed again; what had no outcome when the bridge
/// ended is reported as unknown, and not repeated.
///
/// Prints one line of JSON for what happens to the broker, the links and the commands.
///
/// Exit status: 0 ended by an interrupt, or --check found nothing; 2 the file is wrong, or the
/// store cannot be opened or written.
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment, after_help = EXAMPLES)]
pub struct Args {
    /// The hall
    hall: PathBuf,
    /// Connect to nobody: check the file, with the line of what is wrong
    #[arg(long)]
    check: bool,
}

const EXAMPLES: &str = "\
Examples:
  cellwire bridge hall-3.toml --check
  cellwire bridge hall-3.toml
  curl http://127.0.0.1:9464/metrics
  mosquitto_sub -V 5 -t 'spBv1.0/#' -F '%t'   # see that something comes

docs/bridge.md has a whole hall, the metrics of every link, and the commands.";

/// Runs until interrupted.
pub fn run(args: &Args) -> Result<bool> {
    let hall = Hall::read(&args.hall)?;
    let clients = links::clients(&hall)?;
    if args.check {
        let cells: Vec<&String> = hall.cell.keys().collect();
        log(&json!({"hall": args.hall, "broker": hall.broker.address, "cells": cells}))?;
        return Ok(true);
    }
    output::never_wait()?;
    interrupt::note()?;
    let health = Arc::new(Health::default());
    let place = match &hall.health.listen {
        Some(address) => {
            let health = Arc::clone(&health);
            Some(http::serve(tcp::listen(address)?, move |path| health.reply(path))?.to_string())
        }
        None => None,
    };
    // The cells are not stopped by whoever has read the lines and reads no more.
    let mut print = |line| drop(log(&line));
    let hub = Hub::start(&hall, clients, health, &mut print)?;
    log(&json!({"ready": "bridge", "cells": hall.cell.len(), "health": place}))?;
    hub.run()?;
    Ok(true)
}

/// What can be set of the cells of each link, for the end of the long help.
pub fn help() -> String {
    let link =
        |(name, settings): (&str, Vec<_>)| format!("Settings of a cell of {name}:\n\n{}\n", lines(&settings));
    links::settings().into_iter().map(link).collect()
}
