//! The PC's session, which notes what it is about to send.

use std::time::Duration;

use kawasaki_msg::{JobSource, LargePc, PcEvent, PcStatistics, Supply};
use robot_session::Session;

use super::journal::Journal;
use cellwire_links::kawasaki_msg::layout::AnyWork;

/// A PC whose journal has every packet before the robot has it.
#[derive(Debug)]
pub struct Journaled<'a> {
    /// The session.
    pub pc: LargePc<'static, Order<'a>>,
    /// The journal.
    pub journal: &'a mut Journal,
    /// Why nothing is sent any more.
    pub failed: Option<anyhow::Error>,
}

/// The jobs of an order.
#[derive(Debug)]
pub struct Order<'a> {
    /// The jobs of the file.
    pub jobs: &'a [AnyWork],
    /// Those of the order.
    pub places: Vec<usize>,
}

impl JobSource for Order<'_> {
    type Work = AnyWork;

    fn job(&mut self, index: u32) -> Supply<AnyWork> {
        let place = usize::try_from(index).ok().and_then(|index| self.places.get(index));
        place.and_then(|place| self.jobs.get(*place)).map_or(Supply::End, |work| Supply::Job(*work))
    }
}

impl Session for Journaled<'_> {
    type Event = PcEvent;
    type Statistics = PcStatistics;
    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = LargePc::<Order<'_>>::MAX_TRANSMIT;

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        self.pc.handle_input(now, bytes);
    }

    fn handle_connected(&mut self, now: Duration) {
        self.pc.handle_connected(now);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.pc.handle_disconnected(now);
    }

    fn handle_timeout(&mut self, now: Duration) {
        self.pc.handle_timeout(now);
    }

    fn poll_event(&mut self) -> Option<PcEvent> {
        self.pc.poll_event()
    }

    /// Nothing is sent that the journal does not have.
    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        if self.failed.is_some() {
            return None;
        }
        let length = self.pc.poll_transmit(now, out)?;
        if self.pc.order().is_some()
            && let Err(error) = self.journal.progress(self.pc.executed(), self.pc.sent())
        {
            self.failed = Some(error);
            return None;
        }
        Some(length)
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.pc.poll_timeout()
    }

    fn statistics(&self) -> PcStatistics {
        self.pc.statistics()
    }
}
