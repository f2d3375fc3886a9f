//! What became of every job, and how far the order in flight is.

use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::jobs::Jobs;
use crate::io::journal;

/// What is known of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// Never sent, or not executed and never to be.
    NotSent,
    /// Executed.
    Done,
    /// Nobody knows.
    Unknown,
}

/// An order that has no outcome yet. Its jobs are counted from 0 in the order, not in the file.
#[derive(Debug, Clone)]
pub struct Flight {
    /// Its number.
    pub order: u16,
    /// The highest job number that was agreed on.
    pub max_number: u16,
    /// Its jobs, by their places in the file.
    pub places: Vec<usize>,
    /// So many are known to be executed, from the first on.
    pub executed: u32,
    /// From this one on none was sent.
    pub sent: u32,
    /// Those that were executed ahead of others.
    pub ahead: Vec<u32>,
}

/// Of which jobs the journal is.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    jobs: String,
    count: usize,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum Entry {
    /// An order of all jobs that are not sent.
    Order { order: u16, max_number: u16 },
    /// How far it is.
    Progress { executed: u32, sent: u32 },
    /// A job that was executed ahead of others.
    Ahead { ahead: u32 },
    /// Its end: so many jobs were executed; of those from there to `unknown` nobody knows.
    End { end: u32, unknown: u32 },
    /// What the operator says.
    Answer { outcome: Outcome, first: usize, count: usize },
}

/// The journal of a file of jobs.
#[derive(Debug)]
pub struct Journal {
    file: journal::Journal,
    state: State,
}

#[derive(Debug)]
struct State {
    outcomes: Vec<Outcome>,
    flight: Option<Flight>,
    /// The numbers of all orders.
    orders: Vec<u16>,
}

impl Journal {
    /// Opens the journal of a file of jobs, or begins it. With `again`, what it says of an earlier run is forgotten.
    ///
    /// # Errors
    /// When another process runs the file, or the journal is that of other jobs, or none.
    pub fn open(path: &Path, jobs: &Jobs, again: bool) -> Result<Self> {
        let head = Head { jobs: jobs.fingerprint(), count: jobs.work.len() };
        let outcomes = vec![Outcome::NotSent; head.count];
        let mut state = State { outcomes, flight: None, orders: Vec::new() };
        let file = journal::Journal::open(path, "file of jobs", &head, again, |entry| state.take(&entry))?;
        Ok(Self { file, state })
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// The order in flight.
    pub fn flight(&self) -> Option<&Flight> {
        self.state.flight.as_ref()
    }

    /// The numbers of all orders.
    pub fn orders(&self) -> &[u16] {
        &self.state.orders
    }

    /// What is known of each job; those in flight are unknown until they are reported.
    pub fn outcomes(&self) -> Vec<Outcome> {
        let mut outcomes = self.state.outcomes.clone();
        if let Some(flight) = &self.state.flight {
            flight.settle(&mut outcomes, flight.executed, flight.sent);
        }
        outcomes
    }

    /// How many jobs have this outcome.
    pub fn count(&self, outcome: Outcome) -> usize {
        self.outcomes().iter().filter(|known| **known == outcome).count()
    }

    /// The first jobs of an order that is over whose outcome is unknown, and how many in a row.
    pub fn unknown(&self) -> Option<(usize, usize)> {
        let outcomes = &self.state.outcomes;
        let first = outcomes.iter().position(|known| *known == Outcome::Unknown)?;
        let rest = outcomes.get(first..).unwrap_or_default();
        Some((first, rest.iter().take_while(|known| **known == Outcome::Unknown).count()))
    }

    /// Begins an order of all jobs that are not sent; their places.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn begin(&mut self, order: u16, max_number: u16) -> Result<Vec<usize>> {
        self.note(&Entry::Order { order, max_number })?;
        Ok(self.state.flight.as_ref().map(|flight| flight.places.clone()).unwrap_or_default())
    }

    /// How far the order is, if that is news. It has to be noted before the packet is sent.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn progress(&mut self, executed: u32, sent: u32) -> Result<()> {
        match &self.state.flight {
            Some(flight) if (flight.executed, flight.sent) != (executed, sent) => {
                self.note(&Entry::Progress { executed, sent })
            }
            _ => Ok(()),
        }
    }

    /// A job of the order was executed ahead of others.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn ahead(&mut self, index: u32) -> Result<()> {
        self.note(&Entry::Ahead { ahead: index })
    }

    /// The order is over: so many jobs were executed, and those that were ahead; of those from there to `unknown` nobody knows.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn end(&mut self, executed: u32, unknown: u32) -> Result<()> {
        self.note(&Entry::End { end: executed, unknown })
    }

    /// What the operator knows of jobs.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn answer(&mut self, outcome: Outcome, first: usize, count: usize) -> Result<()> {
        self.note(&Entry::Answer { outcome, first, count })
    }

    fn note(&mut self, entry: &Entry) -> Result<()> {
        self.file.append(entry)?;
        self.state.take(entry);
        Ok(())
    }
}

impl State {
    fn take(&mut self, entry: &Entry) {
        match *entry {
            Entry::Order { order, max_number } => {
                let open = |(place, known): (usize, &Outcome)| (*known == Outcome::NotSent).then_some(place);
                let places = self.outcomes.iter().enumerate().filter_map(open).collect();
                self.flight =
                    Some(Flight { order, max_number, places, executed: 0, sent: 0, ahead: Vec::new() });
                self.orders.push(order);
            }
            Entry::Progress { executed, sent } => {
                if let Some(flight) = &mut self.flight {
                    (flight.executed, flight.sent) = (executed, sent.max(flight.sent));
                    flight.ahead.retain(|index| *index >= executed);
                }
            }
            Entry::Ahead { ahead } => {
                if let Some(flight) = &mut self.flight {
                    flight.ahead.push(ahead);
                }
            }
            Entry::End { end, unknown } => {
                if let Some(flight) = self.flight.take() {
                    flight.settle(&mut self.outcomes, end, unknown);
                }
            }
            Entry::Answer { outcome, first, count } => {
                for known in self.outcomes.iter_mut().skip(first).take(count) {
                    *known = outcome;
                }
            }
        }
    }
}

impl Flight {
    /// Enters the outcomes of its jobs.
    fn settle(&self, outcomes: &mut [Outcome], executed: u32, unknown: u32) {
        for (index, place) in (0..).zip(&self.places) {
            if let Some(known) = outcomes.get_mut(*place) {
                *known = match index {
                    _ if index < executed || self.ahead.contains(&index) => Outcome::Done,
                    _ if index < unknown => Outcome::Unknown,
                    _ => Outcome::NotSent,
                };
            }
        }
    }
}
