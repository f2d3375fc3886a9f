use core::time::Duration;

use super::Output;

/// What the task knows of one device.
#[derive(Debug, Clone, Copy)]
pub(super) struct Channel {
    pub(super) ready: bool,
    pub(super) orders: [Option<Output>; 2],
    pub(super) flight: Flight,
    pub(super) at_rest: bool,
    pub(super) poll_at: Duration,
}

/// What a device has not answered yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Flight {
    Nothing,
    /// An order of this step.
    Order,
    /// A question of this step.
    Poll,
    /// An order or a question of an earlier step, whose answer says nothing about this one.
    Stale,
}

impl Channel {
    pub(super) const IDLE: Self = Self {
        ready: false,
        orders: [None, None],
        flight: Flight::Nothing,
        at_rest: false,
        poll_at: Duration::ZERO,
    };

    pub(super) fn begin_step(&mut self, now: Duration) {
        self.orders = [None, None];
        self.at_rest = false;
        self.poll_at = now;
        if self.flight != Flight::Nothing {
            self.flight = Flight::Stale;
        }
    }

    pub(super) fn take_order(&mut self) -> Option<Output> {
        if self.flight != Flight::Nothing {
            return None;
        }
        let [first, second] = &mut self.orders;
        let order = core::mem::replace(first, second.take())?;
        self.flight = Flight::Order;
        Some(order)
    }

    pub(super) fn answered(&mut self) {
        self.flight = Flight::Nothing;
    }

    pub(super) fn is_free(&self) -> bool {
        self.flight == Flight::Nothing && self.orders[0].is_none()
    }
}
