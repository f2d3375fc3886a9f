//! Start and end of cells: at the start, and when the site file is reloaded.

use std::future::pending;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, ensure};
use serde_json::json;
use tokio::runtime;
use tokio::sync::{mpsc, watch};

use super::{Hub, Turn};
use crate::cell::{Cell, CellUpdate};
use crate::end::{End, Inbox, Stop};
use crate::links::{self, Client};
use crate::metric::{self, CONNECTED, NUMBER, STORE};
use crate::payload::Value;
use crate::share::Share;
use crate::site::{self, Site};
use crate::uplink;

/// The maximum length of a site file in bytes.
const MAX_FILE_LEN: u64 = 1 << 20;
/// The time within which a site file is read.
const READ_TIMEOUT: Duration = Duration::from_secs(10);

/// The maximum number of cells with threads of their own.
const CELLS: usize = 10_000;

/// A site file that is read by a thread of its own: a network folder may never answer.
#[derive(Debug)]
pub(super) struct Reading {
    since: Instant,
    site: Receiver<Result<(Site, Vec<Client>)>>,
}

impl Reading {
    fn begin(path: &Path) -> Self {
        let ((sender, site), path) = (channel(), path.to_owned());
        let read = move || {
            // A bridge that has ended, or waits no longer, takes nothing.
            let _ = sender.send(read(&path));
        };
        // Without a thread the channel is closed.
        let _ = thread::Builder::new().name("site".into()).spawn(read);
        Self { since: Instant::now(), site }
    }

    fn result(&self) -> Option<Result<(Site, Vec<Client>)>> {
        match self.site.try_recv() {
            Ok(read) => Some(read),
            Err(TryRecvError::Disconnected) => Some(Err(anyhow!("the system has no thread to read it"))),
            Err(TryRecvError::Empty) if self.since.elapsed() >= READ_TIMEOUT => {
                Some(Err(anyhow!("the site file could not be read within {} s", READ_TIMEOUT.as_secs())))
            }
            Err(TryRecvError::Empty) => None,
        }
    }
}

fn read(path: &Path) -> Result<(Site, Vec<Client>)> {
    let found = path.metadata().with_context(|| path.display().to_string())?;
    ensure!(found.is_file(), "{} is not a regular file", path.display());
    let length = found.len();
    ensure!(length <= MAX_FILE_LEN, "{} has {length} bytes, the maximum is {MAX_FILE_LEN}", path.display());
    let site = Site::read(path)?;
    let clients = links::clients(&site)?;
    Ok((site, clients))
}

impl Hub<'_> {
    /// Begins a cell: in its place, if it had one before. One that bridges share is not begun before it is this one's.
    pub(super) fn begin(&mut self, name: &str, settings: &site::Cell, client: Client) -> Result<()> {
        self.begin_with(name, settings, client, !settings.shared)
    }

    /// Begins a cell, or gives it a place.
    pub(super) fn begin_with(
        &mut self,
        name: &str,
        settings: &site::Cell,
        client: Client,
        is_here: bool,
    ) -> Result<()> {
        let place = self.places.get(name).copied().unwrap_or(self.cells.len());
        let before = self.cells.get(place);
        let kept = self.numbers.get(name).copied().unwrap_or_default();
        let number = before.map_or(kept, |cell| cell.number);
        let now = metric::now();
        let values = [
            (STORE, metric::text(&*self.identity)),
            (NUMBER, uplink::number(number)),
            (CONNECTED, Value::Boolean(false)),
        ];
        let (commands, inbox) = mpsc::unbounded_channel();
        let (stop, told) = watch::channel(false);
        let lease = self.share.as_ref().filter(|_| settings.shared).map(Share::lease);
        let until = Stop::new(told, lease);
        let failures = before.map_or_else(Arc::default, |cell| Arc::clone(&cell.failures));
        let (busy, counted) = (Arc::clone(&self.busy), Arc::clone(&failures));
        let address = settings.address.clone().unwrap_or_default();
        let end = End::new(place, address, self.sender.clone(), until, busy, counted);
        let mut cell = Cell {
            name: name.to_owned(),
            link: settings.link.clone(),
            definitions: client.definitions().collect(),
            values: values.into_iter().map(|(name, value)| (name, (now, value))).collect(),
            is_connected: false,
            since: now,
            why: String::new(),
            is_born: false,
            number,
            written: before.map_or(number, |cell| cell.written),
            kept: before.map_or(0, |cell| cell.kept),
            last_at: before.map_or(0, |cell| cell.last_at),
            failures,
            takes_commands: settings.commands,
            is_shared: settings.shared,
            bands: client.bands.clone(),
            commands,
            stop,
            task: None,
            next: if is_here { CellUpdate::Same } else { CellUpdate::Away },
        };
        if is_here {
            cell.task = Some(self.runtime.spawn(client.run(end, Inbox(inbox))));
        }
        match self.cells.get_mut(place) {
            Some(before) => *before = cell,
            None => self.cells.push(cell),
        }
        self.places.insert(name.to_owned(), place);
        Ok(())
    }

    /// Returns the places of cells whose tasks were to end, and have.
    pub(super) fn over(&self) -> Vec<usize> {
        let over = self.cells.iter().enumerate().filter(|(_, cell)| cell.is_over());
        over.map(|(place, _)| place).collect()
    }

    /// Reloads the site file if requested, and starts cells in places that are [over](Self::over): everything that their
    /// tasks have reported was taken.
    pub(super) fn renew(&mut self, over: Vec<usize>, turn: &mut Turn) -> Result<()> {
        if self.reading.is_none() && self.reload.swap(false, Ordering::Relaxed) {
            self.reading = Some(Reading::begin(self.site.path()));
        }
        if let Some(read) = self.reading.as_ref().and_then(Reading::result) {
            self.reading = None;
            if let Err(error) = read.and_then(|(site, clients)| self.reload(site, clients, turn)) {
                (self.log)(
                    json!({"site": "refused", "why": format!("{error:#}"), "advice": "nothing was changed"}),
                );
            }
        }
        for place in over {
            let Some(cell) = self.cells.get_mut(place) else { continue };
            cell.task = None;
            let rest = if matches!(cell.next, CellUpdate::Gone) || !cell.is_shared {
                CellUpdate::Gone
            } else {
                CellUpdate::Away
            };
            let (name, next) = (cell.name.clone(), core::mem::replace(&mut cell.next, rest));
            for report in self.commands.interrupt(
                &name,
                "the cell was reconfigured before the outcome",
                &mut turn.batch,
            ) {
                self.is_unknown(place, report, turn);
            }
            if let CellUpdate::Another(next) = next {
                let (settings, client) = *next;
                self.begin(&name, &settings, client)?;
            }
        }
        Ok(())
    }

    /// Applies a site file: begins and ends the cells that differ, and the other cells do not notice. A file with an error has no
    /// effect.
    fn reload(&mut self, site: Site, clients: Vec<Client>, turn: &mut Turn) -> Result<()> {
        if let Some(table) = self.site.differs(&site) {
            return Err(site.located(table, anyhow!("[{table}] differs: it is only read at the start")));
        }
        let (mut added, mut changed, mut removed) = (Vec::new(), Vec::new(), Vec::new());
        for ((name, cell), client) in site.cell.iter().zip(clients) {
            if self.site.cell.get(name) == Some(cell) {
                continue;
            }
            self.words.learn(name, &client.definitions().collect::<Vec<_>>(), &mut turn.batch);
            match self.site.cell.contains_key(name) {
                true => changed.push(name.clone()),
                false => added.push(name.clone()),
            }
            match self.places.get(name).and_then(|place| self.cells.get_mut(*place)) {
                Some(before) => {
                    before.stop.send_replace(true);
                    before.next = CellUpdate::Another(Box::new((cell.clone(), client)));
                }
                None => self.begin(name, cell, client)?,
            }
        }
        for name in self.site.cell.keys().filter(|name| !site.cell.contains_key(*name)) {
            if let Some(cell) = self.places.get(name).and_then(|place| self.cells.get_mut(*place)) {
                cell.stop.send_replace(true);
                cell.next = CellUpdate::Gone;
                removed.push(name.clone());
            }
        }
        // The node's birth contains the number of cells.
        if site.cell.len() != self.site.cell.len() {
            self.uplink.bear_again();
        }
        (self.log)(json!({"site": "read", "added": added, "changed": changed, "removed": removed}));
        self.site = site;
        Ok(())
    }
}

/// Starts the thread that runs the cells. Cells whose calls block have threads of their own besides.
pub(super) fn cells() -> Result<runtime::Handle> {
    let runtime = runtime::Builder::new_current_thread().enable_all().max_blocking_threads(CELLS).build()?;
    let handle = runtime.handle().clone();
    let thread = thread::Builder::new().name("cells".into());
    thread.spawn(move || runtime.block_on(pending::<()>())).context("cannot start a thread for the cells")?;
    Ok(handle)
}
