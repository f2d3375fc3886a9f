//! The PC of a Kawasaki robot: whichever robot connects gets an order.

use core::fmt::Debug;
use core::time::Duration;
use std::sync::Arc;

use kawasaki_msg::{JobSource, LargePc, PcConfig, PcEvent, Supply, Work};
use robot_session::end::End as _;

use crate::device::{Device, DeviceRecord, Error};
use crate::host::{HostedSession, Request};
use crate::settings::Settings;

/// The reason to close the connection to a robot.
const SILENT: &str = "the robot is silent";

/// A PC's settings, for jobs of the type `W`. What it "executes" are orders: [`PcEvent::OrderOver`] and
/// [`PcEvent::OutcomeUnknown`].
#[derive(Debug, Clone)]
pub struct KawasakiPc<W: Work> {
    /// The configuration of the session.
    pub config: PcConfig,
    /// The ranges of a job's fields.
    pub ranges: W::Ranges,
    /// The number of its first order; each order has the next one.
    pub order: u16,
    /// The jobs of an order.
    pub jobs: Jobs<W>,
    /// Whether the next order begins when one is over, not only when a robot connects while there is no order.
    pub repeat: bool,
}

impl<W: Work> Default for KawasakiPc<W> {
    /// Returns the settings over TCP, with order 50, which has no jobs.
    fn default() -> Self {
        let (config, ranges) = (PcConfig::tcp(), W::Ranges::default());
        Self { config, ranges, order: 50, jobs: Jobs(Arc::new([])), repeat: false }
    }
}

impl<W: Work + Debug + Send + Sync + 'static> Settings for KawasakiPc<W> {
    type Device = Pc<W>;

    fn device(&self) -> Result<Pc<W>, Error> {
        let session = LargePc::with_ranges(self.config, self.ranges.clone()).map_err(Error::settings)?;
        Ok(Pc { settings: self.clone(), session, next: self.order, was_connected: false, is_wanted: false })
    }
}

/// A PC whose orders are those of a program.
impl<S: JobSource> HostedSession for LargePc<S> {
    fn request(event: &PcEvent) -> Option<Request> {
        (*event == PcEvent::Disconnect).then_some(Request::Close(SILENT))
    }
}

/// The jobs of an order.
#[derive(Debug, Clone)]
pub struct Jobs<W>(pub Arc<[W]>);

impl<W> From<Vec<W>> for Jobs<W> {
    fn from(jobs: Vec<W>) -> Self {
        Self(jobs.into())
    }
}

impl<W: Work> JobSource for Jobs<W> {
    type Work = W;

    fn job(&mut self, index: u32) -> Supply<W> {
        JobSource::job(&mut &*self.0, index)
    }
}

/// A PC.
#[derive(Debug)]
pub struct Pc<W: Work> {
    settings: KawasakiPc<W>,
    session: LargePc<Jobs<W>>,
    /// The number of the next order.
    next: u16,
    was_connected: bool,
    is_wanted: bool,
}

impl<W: Work + Debug + Send + Sync + 'static> Device for Pc<W> {
    type Session = LargePc<Jobs<W>>;
    type Event = PcEvent;
    type Work = PcEvent;

    fn session(&self) -> &Self::Session {
        &self.session
    }

    fn session_mut(&mut self) -> &mut Self::Session {
        &mut self.session
    }

    fn take(&mut self, now: Duration, event: PcEvent, notes: &mut DeviceRecord<PcEvent, PcEvent>) {
        match event {
            PcEvent::Disconnect => notes.close(SILENT),
            PcEvent::OrderOver { .. } => {
                self.is_wanted |= self.settings.repeat;
                notes.executed(now, event);
            }
            PcEvent::OutcomeUnknown { .. } => {
                self.is_wanted = true;
                notes.executed(now, event);
            }
            PcEvent::OrderRefused { given_up, .. } => self.is_wanted |= given_up,
            _ => {}
        }
        notes.event(event);
    }

    fn advance(&mut self, _: Duration, _: &mut DeviceRecord<PcEvent, PcEvent>) {
        let is_connected = self.session.machine().is_connected();
        let was_connected = core::mem::replace(&mut self.was_connected, is_connected);
        let has_order = self.session.order().is_some();
        // An order continues on the next connection.
        self.is_wanted |= is_connected && !was_connected && !has_order;
        if self.is_wanted && !has_order {
            // With too many events it is tried again once they are taken.
            self.is_wanted = self.session.start(self.next, self.settings.jobs.clone()).is_err();
            if !self.is_wanted {
                self.next = self.next.checked_add(1).unwrap_or(1);
            }
        }
    }

    fn due(&self) -> Option<Duration> {
        None
    }

    /// Restarts the PC: it has no order, and the next one has the next number.
    fn restart(&mut self, _: Duration) {
        // The same settings have worked before.
        if let Ok(pc) = self.settings.device() {
            *self = Self { next: self.next, ..pc };
        }
    }

    /// Interrupts the order, as an operator does.
    fn forget(&mut self, _: Duration) {
        // Without an order there is nothing to interrupt.
        let _ = self.session.interrupt();
    }
}
