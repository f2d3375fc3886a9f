//! `cellwire bridge`: many cells to one MQTT broker.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Result;
use serde_json::json;

use super::settings::lines;
use crate::cell::bridge::{Hall, Health, Hub, links};
use crate::io::output::log;
use crate::io::{http, interrupt, output, tcp};

/// Connects the cells of a hall to an MQTT 5 broker: Sparkplug B, through a store, commands back.
#[derive(Debug, clap::Args)]
#[command(long_about = include_str!("bridge.txt"), after_help = EXAMPLES)]
pub struct Args {
    /// The hall
    hall: PathBuf,
    /// Connect to nobody: check the file, with the line of what is wrong
    #[arg(long)]
    check: bool,
}

/// Links and broker get two seconds each, and the rest is the disk's.
const LONGEST_END: Duration = Duration::from_secs(10);

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
    interrupt::note_within(
        LONGEST_END,
        "the bridge has not ended in 10 s, and is ended: what is in the store is kept",
    )?;
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
