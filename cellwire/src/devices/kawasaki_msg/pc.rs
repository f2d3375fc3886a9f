//! A PC whose orders are those of a program.

use std::cell::Cell;

use super::endpoint::{self, Report};
use super::peer_endpoint::{PeerEndpoint, Side};
use anyhow::Result;
use cellwire_io::clock::Clock;
use cellwire_io::trace::Trace;
use kawasaki_msg::{JobSource, LargePc, PcEvent};

pub use super::endpoint::{Connection, Packets};

/// The program of a PC.
pub trait Program {
    /// The source of the jobs of an order.
    type Jobs: JobSource;

    /// Acts on the session once everything that has happened was reported; false ends the run.
    ///
    /// # Errors
    /// The failure that ends the run.
    fn step(&mut self, session: &mut LargePc<Self::Jobs>) -> Result<bool>;

    /// Stores the state that must survive the program, before the session's output is sent.
    ///
    /// # Errors
    /// If the state could not be stored: nothing is sent, and the run ends.
    fn keep(&mut self, _session: &mut LargePc<Self::Jobs>) -> Result<()> {
        Ok(())
    }

    /// Reports an event.
    ///
    /// # Errors
    /// The failure that ends the run.
    fn event(&mut self, event: PcEvent) -> Result<()>;

    /// Reports a change of the connection.
    ///
    /// # Errors
    /// The failure that ends the run.
    fn connection(&mut self, _connection: Connection<'_>) -> Result<()> {
        Ok(())
    }
}

/// Runs until the program ends it; returns the counts of the packets that were sent.
///
/// # Errors
/// The errors of the program, and an endpoint that fails.
pub fn run<P: Program>(
    meeting: &mut PeerEndpoint,
    mut session: LargePc<P::Jobs>,
    trace: &Trace,
    program: &mut P,
) -> Result<Packets> {
    let (is_over, clock) = (Cell::new(false), Clock::start());
    let goes_on = || !is_over.get();
    endpoint::run(Side::Pc, meeting, trace, clock, &mut session, goes_on, |session, report| match report {
        Report::Event(event) => program.event(event),
        Report::Sending => program.keep(session),
        Report::Settled => program.step(session).map(|goes_on| is_over.set(!goes_on)),
        Report::Connection(change) => program.connection(change),
        Report::Handled(_) => Ok(()),
    })
}
