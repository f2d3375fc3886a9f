//! Cells that bridges share: the hub takes them, lets them go, and reports the outcomes of their commands.

use std::collections::BTreeMap;

use anyhow::Result;
use robot_session::now;
use serde_json::json;

use super::{Hub, Turn, text_of};
use crate::cell::{Cell, CellUpdate};
use crate::commands::CommandReport;
use crate::health::Shared;
use crate::links;
use crate::metric::{self, COMMAND, NamedValue};
use crate::report::{Command, Outcome};
use crate::share::ShareEvent;

/// A command of the cell of this place, to report to the other bridges before it is given, if it is to be given.
pub(super) type SharedCommand = (usize, String, Option<Command>);

impl Hub<'_> {
    /// Lets go cells that are another bridge's, and takes those that are this one's.
    pub(super) fn share_out(&mut self, turn: &mut Turn) -> Result<()> {
        let Some(share) = &mut self.share else { return Ok(()) };
        let now = now();
        let lapsed = share.lapsed(now);
        let is_lapsed = lapsed.is_some();
        let is_idle = |cell: &Cell| matches!(cell.next, CellUpdate::Away) && cell.task.is_none();
        let shared = self.cells.iter_mut().enumerate().filter(|(_, cell)| cell.is_shared);
        let mut takes = Vec::new();
        for (place, cell) in shared {
            if is_idle(cell) {
                takes.extend(share.may_take(&cell.name, now).map(|until| (place, until)));
            } else if cell.is_here() && (is_lapsed || share.must_give(&cell.name, now)) {
                cell.stop.send_replace(true);
                cell.next = CellUpdate::Away;
                let why = if is_lapsed { "no messages from the broker" } else { "another bridge takes it" };
                (self.log)(json!({"cell": cell.name, "share": "let go", "why": why}));
            }
        }
        self.not_given(lapsed.unwrap_or_default(), turn);
        for (place, until) in takes {
            let Some(name) = self.cells.get(place).map(|cell| cell.name.clone()) else { continue };
            let Some(settings) = self.site.cell.get(&name).cloned() else { continue };
            for report in self.commands.take(&name, until, &mut turn.batch) {
                self.is_unknown(place, report, turn);
            }
            let client = links::client(&settings)?;
            self.begin_with(&name, &settings, client, true)?;
            (self.log)(json!({"cell": name, "share": "taken"}));
        }
        Ok(())
    }

    /// Sends the messages that are due to the bridges that share cells. The commands that it reports are on the disk.
    pub(super) fn say(&mut self, news: Vec<SharedCommand>) {
        let Some(share) = &mut self.share else { return };
        for (place, id, command) in news {
            let Some(cell) = self.cells.get(place).filter(|cell| cell.is_shared) else { continue };
            if let Some(entry) = self.commands.entry(&cell.name, &id) {
                share.tell(&cell.name, &id, entry, command.map(|command| (place, command)));
            }
        }
        let shared = self.cells.iter().filter(|cell| cell.is_shared && !cell.is_gone());
        let cells: BTreeMap<_, _> =
            shared.map(|cell| (cell.name.clone(), cell.task.is_some() && !share.has_ended())).collect();
        share.say(now(), cells, &self.commands, |below, message| self.uplink.say(below, message));
    }

    /// Returns the numbers of shared cells by their bridge.
    pub(super) fn shared(&self) -> Option<Shared> {
        let (share, now, mut shared) = (self.share.as_ref()?, now(), Shared::default());
        for cell in self.cells.iter().filter(|cell| cell.is_shared && !cell.is_gone()) {
            match share.owner(&cell.name, now) {
                _ if cell.is_here() => shared.here += 1,
                Some(_) => shared.elsewhere += 1,
                None => shared.nobody += 1,
            }
        }
        Some(shared)
    }

    /// Handles a message of a bridge.
    pub(super) fn heard(&mut self, from: &str, payload: &[u8], is_retained: bool, turn: &mut Turn) {
        match self.share.as_mut().and_then(|share| share.receive(from, payload, is_retained, now())) {
            Some(ShareEvent::Back { give, lost }) => {
                self.not_given(lost, turn);
                for (place, command) in give {
                    match self.cells.get(place).is_some_and(Cell::is_here) {
                        true => turn.give.push((place, command)),
                        false => self.not_given(vec![(place, command)], turn),
                    }
                }
            }
            // Also those of cells that are not in the site file: a reload may add them.
            Some(ShareEvent::Commands(commands)) => {
                for CommandReport { cell, id, entry } in commands {
                    self.commands.merge_report(&cell, &id, entry, metric::now(), &mut turn.batch);
                }
            }
            Some(ShareEvent::Malformed(why)) => self.strange(why),
            None => {}
        }
    }

    /// Records that a command has no outcome, and will not get one.
    pub(super) fn is_unknown(&mut self, place: usize, report: Vec<NamedValue>, turn: &mut Turn) {
        self.count("unknown");
        turn.tell.extend(text_of(&report, COMMAND).map(|id| (place, id.to_owned(), None)));
        self.record(place, metric::now(), report, &mut turn.batch);
    }

    /// Refuses commands that the cells have not had.
    pub(super) fn not_given(&mut self, commands: Vec<(usize, Command)>, turn: &mut Turn) {
        for (place, Command { id, .. }) in commands {
            let Some(cell) = self.cells.get(place) else { continue };
            let (name, at) = (cell.name.clone(), metric::now());
            let why =
                "not executed: the broker or the cell was lost before the other bridges knew of the command";
            self.latest.note(&name, &id, at, Outcome::Refused, why);
            let named = self.commands.finish(&name, &id, Outcome::Refused, why.into(), &mut turn.batch);
            self.count(Outcome::Refused.name());
            turn.tell.push((place, id, None));
            self.record(place, at, named, &mut turn.batch);
        }
    }

    /// Returns the reason why a command for the cell cannot be executed here, if there is one.
    pub(super) fn is_elsewhere(&self, cell: &Cell) -> Option<String> {
        if matches!(cell.next, CellUpdate::Another(_)) {
            return Some("the cell is being reconfigured: send the command again".into());
        }
        if cell.is_here() {
            return None;
        }
        let owner = self.share.as_ref().and_then(|share| share.owner(&cell.name, now()));
        Some(match owner {
            Some(owner) => format!("{owner} has this cell: send the command there, with another id"),
            None => "no bridge has this cell now: send the command again after its birth".into(),
        })
    }
}
