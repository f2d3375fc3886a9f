//! The command line.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Result;
use clap::{CommandFactory as _, FromArgMatches as _, Parser};
use serde_json::json;

use crate::compact::NameNumbers;
use crate::site::StoreSettings;
use crate::store::{self, Busy, Store};
use crate::{Health, Hub, Site, http, hub, links, signals};
use cellwire_io::interrupt;
use cellwire_io::manual::{self, Shell};
use cellwire_io::output::{self, log, remark};
use cellwire_io::tcp;
use cellwire_links::settings::lines;

/// Connects the cells of a site to an MQTT broker as Sparkplug B, with a persistent store, and executes commands.
#[derive(Debug, Parser)]
#[command(name = "cellwire-bridge", version, long_about = include_str!("command.txt"), after_help = EXAMPLES)]
struct Args {
    /// The site file
    #[arg(long, value_name = "SITE.toml", required_unless_present_any = ["completions", "man"])]
    config: Option<PathBuf>,
    /// Check the file and the store without connecting: report errors with their lines, and records that a start would drop
    #[arg(long)]
    check: bool,
    /// Print a shell completion script
    #[arg(long, value_name = "SHELL", exclusive = true)]
    completions: Option<Shell>,
    /// Write the manual page into this folder
    #[arg(long, value_name = "FOLDER", exclusive = true)]
    man: Option<PathBuf>,
}

/// The links get five seconds, the broker two, and the rest is the disk's.
const SHUTDOWN_TIMEOUT: Duration = Duration::from_secs(10);

const EXAMPLES: &str = "\
Examples:
  cellwire-bridge --config site-3.toml --check
  cellwire-bridge --config site-3.toml
  curl http://127.0.0.1:9464/metrics
  mosquitto_sub -V 5 -t 'spBv1.0/#' -F '%t'   # check that messages arrive

docs/bridge.md has an example site, the metrics of every link, and the commands.";

/// Runs the bridge. Exit status: 0 success, 2 the command could not be run, 4 standard output was closed or could not be written.
pub fn main() -> ExitCode {
    let help = Args::command().get_after_help().map(ToString::to_string).unwrap_or_default();
    let command = Args::command().after_long_help(format!("{help}\n\n{}", settings()));
    let matches = command.clone().get_matches();
    let args = Args::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let outcome = match (args.config, args.completions, &args.man) {
        (Some(site), ..) => run(&site, args.check),
        (None, Some(shell), _) => manual::completions(shell, command),
        (None, None, folder) => folder.as_ref().map_or(Ok(()), |folder| manual::man(folder, command)),
    };
    let status = match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if output::is_closed(&error) => ExitCode::from(4),
        Err(error) => {
            remark(&format!("error: {error:#}"));
            ExitCode::from(if error.is::<output::OutputFailed>() { 4 } else { 2 })
        }
    };
    output::finish();
    status
}

/// Runs until interrupted.
fn run(file: &Path, check: bool) -> Result<()> {
    let site = Site::read(file)?;
    let clients = links::clients(&site)?;
    if check {
        let cells: Vec<&String> = site.cell.keys().collect();
        log(&json!({"site": file, "broker": site.broker.address.to_string(), "cells": cells}))?;
        return check_store(&site);
    }
    output::never_wait()?;
    interrupt::account(
        "commands without an outcome are reported as unknown at the next start; the store is kept".into(),
    );
    let reload = signals::handle(SHUTDOWN_TIMEOUT, "the bridge did not end within 10 s and was terminated")?;
    let health = Arc::new(Health::default());
    let place = match &site.health.listen {
        Some(address) => {
            let health = Arc::clone(&health);
            Some(http::serve(tcp::listen(address)?, move |path| health.reply(path))?.to_string())
        }
        None => None,
    };
    // A reader that stops reading does not stop the cells.
    let mut print = |line| drop(log(&line));
    let count = site.cell.len();
    let hub = Hub::start(site, clients, health, reload, &mut print)?;
    output::announce(&json!({"ready": "bridge", "cells": count, "health": place}))?;
    hub.run()
}

/// Reports the effect that a start would have on the store, if there is one; a damaged store is an error.
fn check_store(site: &Site) -> Result<()> {
    let StoreSettings { file, bytes: most } = &site.store;
    let records = store::beside(file);
    if !file.exists() && !records.exists() {
        return Ok(());
    }
    let mut store = match Store::open(file, *most) {
        Ok(store) => store,
        Err(error) if error.is::<Busy>() => {
            return log(
                &json!({"store": file, "why": "in use by a running bridge: its records were not looked at"}),
            );
        }
        Err(error) => return Err(error),
    };
    store.belong_to(&format!("{}/{}", site.broker.group, site.broker.node))?;
    let words = NameNumbers::open(&store)?;
    hub::check(&mut store, &words)?;
    let (mut orphans, count, mut next) = (BTreeMap::<String, u64>::new(), store.len(), 0);
    let mut see = |cell: String| {
        if !site.cell.contains_key(&cell) {
            *orphans.entry(cell).or_default() += 1;
        }
    };
    loop {
        let records = store.records(next, 1000)?;
        let Some((last, _)) = records.last() else { break };
        next = last + 1;
        records
            .iter()
            .for_each(|(_, bytes)| see(words.unpack(bytes).map(|record| record.cell).unwrap_or_default()));
    }
    let (used, _) = store.bytes();
    log(&json!({"store": file, "records": count, "bytes": used, "dropped_orphans": orphans}))
}

/// Returns the settings of the cells of each link, for the end of the long help.
fn settings() -> String {
    let link =
        |(name, settings): (&str, Vec<_>)| format!("Settings of a cell of {name}:\n\n{}\n", lines(&settings));
    links::settings().into_iter().map(link).collect()
}
