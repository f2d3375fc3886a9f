//! The outcomes of all jobs, and the progress of the order in flight.

use std::borrow::Cow;
use std::fmt;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use crate::io::journal::{self, Outcome, Record, Span};

/// The journal of a file of jobs.
pub type Journal = journal::Journal<Orders>;

/// An order that has no outcome yet. Its jobs are counted from 0 in the order, not in the file.
#[derive(Debug, Clone)]
pub struct Flight {
    /// The number of the order.
    pub order: u16,
    /// The highest job number that was agreed on.
    pub max_number: u16,
    /// The jobs of the order, by their places in the file.
    pub places: Vec<usize>,
    /// The number of jobs that are known to be executed, from the first on.
    pub executed: u32,
    /// The index of the first job that was not sent.
    pub sent: u32,
    /// The jobs that were executed ahead of others.
    pub ahead: Vec<u32>,
    /// Whether a run has commanded the robot to interrupt or end the order.
    pub is_broken_off: bool,
}

/// An entry of the journal.
#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub enum Entry {
    /// An order of all jobs that are not sent.
    Order {
        /// The number of the order.
        order: u16,
        /// The highest job number that was agreed on.
        max_number: u16,
    },
    /// The progress of the order.
    Progress {
        /// The number of jobs that are executed.
        executed: u32,
        /// The number of jobs that are sent, or about to be.
        sent: u32,
    },
    /// A job of the order was executed ahead of others.
    Ahead {
        /// The index of the job in the order, from 0.
        ahead: u32,
    },
    /// The robot receives a command to interrupt or end the order.
    BreakOff {
        /// The number of the order.
        break_off: u16,
    },
    /// The order is over, with its outcome.
    End {
        /// The number of jobs that were executed, and those that were ahead.
        end: u32,
        /// The jobs from `end` to this one are unknown.
        unknown: u32,
    },
    /// The operator's answer about jobs that were unknown.
    Answer(Span),
}

/// The jobs are counted from 1, in the order.
impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Order { order, .. } => write!(f, "order {order}, of which nothing was sent"),
            Self::Progress { executed, sent } => {
                write!(f, "{executed} jobs of the order executed, and {sent} about to be sent")
            }
            Self::Ahead { ahead } => write!(f, "job {} of the order executed", ahead + 1),
            Self::BreakOff { break_off } => write!(f, "order {break_off} broken off"),
            Self::End { end, unknown } => {
                write!(f, "the order over with {end} jobs executed, {} unknown", unknown - end)
            }
            Self::Answer(span) => span.fmt(f),
        }
    }
}

/// The outcomes of the jobs, and the orders in which they were sent.
#[derive(Debug)]
pub struct Orders {
    outcomes: Vec<Outcome>,
    /// The order in flight; `None` without one.
    pub flight: Option<Flight>,
    /// The numbers of all orders of the journal.
    pub numbers: Vec<u16>,
}

impl Journal {
    /// Begins an order of all jobs that are not sent; their places.
    ///
    /// # Errors
    /// If the disk does not take it.
    pub fn begin(&mut self, order: u16, max_number: u16) -> Result<Vec<usize>> {
        self.note(&Entry::Order { order, max_number })?;
        Ok(self.record().flight.as_ref().map(|flight| flight.places.clone()).unwrap_or_default())
    }

    /// Writes that the order is broken off, before the robot receives the command.
    ///
    /// # Errors
    /// If the disk does not take it.
    pub fn break_off(&mut self) -> Result<()> {
        match &self.record().flight {
            Some(flight) if !flight.is_broken_off => {
                let break_off = flight.order;
                self.note(&Entry::BreakOff { break_off })
            }
            _ => Ok(()),
        }
    }

    /// Notes how far the order is, before the packet is sent; returns whether that is news.
    ///
    /// # Errors
    /// If the disk does not take it.
    pub fn progress(&mut self, executed: u32, sent: u32) -> Result<bool> {
        let flight = self.record().flight.as_ref();
        let is_news = flight.is_some_and(|flight| (flight.executed, flight.sent) != (executed, sent));
        if is_news {
            self.note(&Entry::Progress { executed, sent })?;
        }
        Ok(is_news)
    }
}

impl Record for Orders {
    type Entry = Entry;

    fn new(jobs: usize) -> Self {
        Self { outcomes: Record::new(jobs), flight: None, numbers: Vec::new() }
    }

    fn take(&mut self, entry: &Entry) -> Option<()> {
        match (entry, &mut self.flight) {
            (Entry::Order { order, max_number }, None) => {
                let open = |(place, known): (usize, &Outcome)| (*known == Outcome::NotSent).then_some(place);
                let places: Vec<usize> = self.outcomes.iter().enumerate().filter_map(open).collect();
                let (order, max_number) = (*order, *max_number);
                let (executed, sent, ahead, is_broken_off) = (0, 0, Vec::new(), false);
                self.flight =
                    Some(Flight { order, max_number, places, executed, sent, ahead, is_broken_off });
                self.numbers.push(order);
            }
            (Entry::Progress { executed, sent }, Some(flight)) => {
                (executed <= sent && flight.fits(*sent)).then_some(())?;
                (flight.executed, flight.sent) = (*executed, (*sent).max(flight.sent));
                flight.ahead.retain(|index| index >= executed);
            }
            (Entry::Ahead { ahead }, Some(flight)) => {
                (*ahead < flight.sent).then_some(())?;
                flight.ahead.push(*ahead);
            }
            (Entry::BreakOff { break_off }, Some(flight)) => {
                (*break_off == flight.order).then_some(())?;
                flight.is_broken_off = true;
            }
            (Entry::End { end, unknown }, Some(flight)) => {
                (end <= unknown && flight.fits(*unknown)).then_some(())?;
                let flight = self.flight.take()?;
                flight.settle(&mut self.outcomes, *end, *unknown);
            }
            (Entry::Answer(span), None) => self.outcomes.take(span)?,
            _ => return None,
        }
        Some(())
    }

    fn queued(&self) -> usize {
        let flight = self.flight.as_ref();
        flight
            .map_or(0, |flight| ((flight.sent - flight.executed) as usize).saturating_sub(flight.ahead.len()))
    }

    fn settled(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// Jobs in flight are unknown until they are reported.
    fn outcomes(&self) -> Cow<'_, [Outcome]> {
        let mut outcomes = Cow::from(&self.outcomes);
        if let Some(flight) = &self.flight {
            flight.settle(outcomes.to_mut(), flight.executed, flight.sent);
        }
        outcomes
    }
}

impl Flight {
    /// Returns whether the order has this many jobs.
    fn fits(&self, jobs: u32) -> bool {
        jobs as usize <= self.places.len()
    }

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
