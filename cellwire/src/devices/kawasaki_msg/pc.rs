//! A PC whose orders are those of a program.

use std::cell::Cell;

use super::peer_endpoint::PeerEndpoint;
use anyhow::Result;
use cellwire_io::trace::Trace;
use cellwire_sim::host::{ConnectionEnd, Notice, attend};
use kawasaki_msg::{JobSource, LargePc, PcEvent};

pub use super::endpoint::{Connection, Packets};
use super::endpoint::{Connections, POLL_INTERVAL, Reports, Side};

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

/// Runs until the program ends it. One robot at a time: over TCP a new connection takes the place of the previous one, over UDP
/// another robot is answered when the previous one is silent.
///
/// # Errors
/// The errors of the program, and an endpoint that fails.
pub fn run<P: Program>(
    meeting: &mut PeerEndpoint,
    mut session: LargePc<P::Jobs>,
    trace: &Trace,
    program: &mut P,
) -> Result<Packets> {
    let connections = Connections::new(Side::Pc, meeting, trace);
    let (packets, mut reports) = (connections.packets(), Reports::new(Side::Pc));
    let is_over = Cell::new(false);
    let outcome = attend(
        &mut session,
        connections,
        POLL_INTERVAL,
        || !is_over.get(),
        |session, notice| match notice {
            Notice::Event(_, event) => program.event(event),
            Notice::Sending => program.keep(session),
            Notice::Settled => program.step(session).map(|goes_on| is_over.set(!goes_on)),
            notice => reports.pass(&notice, trace, |change| program.connection(change)),
        },
    );
    let ended: Notice<'_, ()> = Notice::Disconnected("", &ConnectionEnd::Stopped);
    reports.pass(&ended, trace, |change| program.connection(change))?;
    outcome.map(|()| packets.get())
}
