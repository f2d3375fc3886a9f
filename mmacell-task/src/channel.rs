use core::time::Duration;

use mmacell_proto::{Command, MissReason, Progress};

use crate::event::Failure;
use crate::output::Output;

/// The task's record of a device.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Channel {
    pub(crate) ready: bool,
    pub(crate) orders: [Option<Output>; 2],
    pub(crate) flight: Flight,
    pub(crate) at_rest: bool,
    pub(crate) poll_at: Duration,
    /// Whether a motion was ordered, and its arrival is not known.
    travels: bool,
}

/// The order or poll that a device has not answered yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Flight {
    Nothing,
    /// An order of this step.
    Order,
    /// A question of this step.
    Poll,
    /// An order or a poll of an earlier step, whose answer has no effect on this one.
    Stale,
}

impl Channel {
    pub(crate) const IDLE: Self = Self {
        ready: false,
        orders: [None, None],
        flight: Flight::Nothing,
        at_rest: false,
        poll_at: Duration::ZERO,
        travels: false,
    };

    pub(crate) fn begin_step(&mut self, now: Duration) {
        self.orders = [None, None];
        self.at_rest = false;
        self.poll_at = now;
        if self.flight != Flight::Nothing {
            self.flight = Flight::Stale;
        }
    }

    pub(crate) fn take_order(&mut self) -> Option<Output> {
        if self.flight != Flight::Nothing {
            return None;
        }
        let [first, second] = &mut self.orders;
        let order = core::mem::replace(first, second.take())?;
        self.flight = Flight::Order;
        match order {
            Output::Robot(Command::Move { .. }) | Output::Platform(Command::Move { .. }) => {
                self.travels = true
            }
            Output::Robot(Command::Stop | Command::Reset)
            | Output::Platform(Command::Stop | Command::Reset) => {
                self.travels = false;
            }
            _ => {}
        }
        Some(order)
    }

    pub(crate) fn answered(&mut self) {
        self.flight = Flight::Nothing;
    }

    /// Handles the answer to a request of this step.
    pub(crate) fn observe(&mut self, motion: Progress) -> Result<(), Failure> {
        match motion {
            Progress::Starting | Progress::Moving | Progress::Stopping => self.at_rest = false,
            Progress::Arrived => (self.at_rest, self.travels) = (true, false),
            // The device is at rest, and it is unknown whether it should be there.
            Progress::Still if self.travels => return Err(Failure::Missed(MissReason::Elsewhere)),
            Progress::Still => self.at_rest = true,
            Progress::Missed(miss) => {
                self.at_rest = true;
                return Err(Failure::Missed(miss));
            }
        }
        Ok(())
    }

    pub(crate) fn is_free(&self) -> bool {
        self.flight == Flight::Nothing && self.orders[0].is_none()
    }
}
