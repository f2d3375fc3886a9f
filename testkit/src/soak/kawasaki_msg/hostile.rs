//! Ends of other makers: a random walk over the protocol's messages.

use core::fmt::Write as _;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::robot_session::end::End as _;

use super::picture::Picture;
use super::{Cell, LIMIT, MS, Mishap};
use crate::controller::Controller;
use crate::link::End;
use robot_session::contract::Rng;

/// Jobs of a hostile PC begin at this place, outside of the project's pictures.
pub(super) const FAR: i32 = 9_000_000;

/// One end is replaced until all is healed.
#[derive(Debug)]
pub(super) struct Hostile {
    pub(super) end: End,
    rng: Rng,
    max_number: u16,
    orders: [u16; 4],
    /// The next job that the motion task may take.
    pub(super) next: u16,
}

impl Hostile {
    /// Creates a hostile end. Over datagrams its orders have numbers of their own, because a late datagram may name them
    /// after the project's orders have begun.
    pub(super) fn new(end: End, seed: u64, max_number: u16, datagrams: bool) -> Self {
        let orders = if datagrams && end == End::B { [0, 601, 602, 603] } else { [0, 1, 2, 3] };
        Self { end, rng: Rng::new(seed ^ 0x686F_7374), max_number, orders, next: 1 }
    }

    /// Returns the bytes to send now, if any: some messages, a few of them corrupt.
    pub(super) fn send(&mut self) -> Option<Vec<u8>> {
        let rng = &mut self.rng;
        if !rng.chance(0.5) {
            return None;
        }
        let mut packet = String::new();
        for _ in 0..1 + rng.below(4) {
            let order = self.orders[rng.below(4)];
            // Often the next one, so that orders get on.
            let number =
                if rng.chance(0.7) { self.next } else { rng.below(self.max_number.into()) as u16 + 2 };
            let other = 1 + rng.below(self.max_number.into());
            let (name, data) = match (self.end, rng.below(8)) {
                (End::B, 0) => ("TilausAlkaa", format!("{order}$1")),
                (End::B, 1) => ("TilausLoppuu", format!("{order}")),
                (End::B, 2) => ("TilausKeskeytyy", format!("{order}")),
                (End::B, 3) => ("Tila", format!("{order}$2$$$")),
                (End::B, _) => ("Tyo", format!("{order}${number}$1${FAR}$0$1$1")),
                (End::A, 0) => ("TilausKuittaus", format!("{order}")),
                (End::A, 1) => ("LoppuKuittaus", format!("{order}$0${other}")),
                (End::A, 2) => ("Tila", format!("{order}$2${other}$$1")),
                (End::A, 3) => ("Tila", format!("{order}$2${other}${other}$")),
                (End::A, 4) => ("TyoKuittaus", format!("{order}${other}")),
                (End::A, 5) => ("TyoTauko", format!("{order}${other}")),
                (End::A, _) => ("TyoPyynto", format!("{order}${other}")),
            };
            let length = data.len() + usize::from(rng.chance(0.05));
            let _ = write!(packet, "<{name}${length}#{data}#>");
        }
        if rng.chance(0.05) {
            packet.truncate(rng.below(packet.len()));
        }
        Some(packet.into_bytes())
    }
}

impl<C: Controller> Cell<C> {
    /// Runs some seconds with any behaviour of one end, which the project's end then replaces.
    pub(super) fn is_harassed(&mut self, end: End, seed: u64, rng: &mut Rng) {
        self.log.line(self.now, format_args!("{end:?} is hostile"));
        self.hostile = Some(Hostile::new(end, seed, self.config.0.max_number, self.config.0.datagrams));
        let until = self.now + rng.log_uniform(100 * MS, 8000 * MS);
        while self.now < until {
            if end == End::A && self.pc.order().is_none() {
                let picture = Picture { first: 0, jobs: 5, later: 0.1, rng: Rng::new(seed) };
                self.pc.start(1 + rng.below(3) as u16, picture).unwrap();
            }
            self.step();
        }
        self.hostile = None;
        self.meet(if end == End::A { Mishap::RobotRestarts } else { Mishap::PcRestarts });
        if end == End::A {
            // The robot's reports of its orders were not true, so restart the PC.
            self.meet(Mishap::PcRestarts);
        } else {
            // No end has a record of the queued jobs, so reset the order.
            _ = self.robot.reset_order();
            let end = self.now + LIMIT;
            while self.robot.order().is_some() && self.now < end {
                self.step();
            }
        }
    }

    /// Runs a hostile end, which drops the bytes that it receives, and sends any bytes.
    pub(super) fn harass(&mut self, end: End) -> bool {
        let Some(hostile) = self.hostile.as_mut().filter(|hostile| hostile.end == end) else { return false };
        while self.wire.receive(end, self.now).is_some() {}
        if let Some(packet) = hostile.send() {
            self.wire.send(end, self.now, &packet);
        }
        if end == End::A && !self.pc.machine().is_connected() {
            if !self.config.0.datagrams {
                self.wire.reconnect(self.now);
            }
            self.pc.handle_connected(self.now);
        }
        true
    }

    /// Checks that even a hostile PC's jobs are executed one after the other, and at most once.
    pub(super) fn check_hostile(&mut self, number: u16) {
        let Some(hostile) = &mut self.hostile else { return };
        if !self.overtakes && number != hostile.next {
            self.log
                .line(self.now, format_args!("!!! job {number} is executed in place of {}", hostile.next));
            self.invented += 1;
        }
        hostile.next = number % self.config.0.max_number + 1;
    }
}
