//! Ends that keep no rule: a random walk over the protocol's messages.

use core::time::Duration;

use fanuc_hmi_modbus::{Frame, Reply, Request};
use robot_session::{Encode as _, Session as _};

use super::{Cell, MS, UNIT, Way};
use crate::link::{Delivery, End};
use crate::turn;
use robot_session::contract::Rng;

impl Cell {
    /// Runs, before the project's client, one that follows no rule: it requests anything, does not wait, reuses
    /// transactions, and sends bytes that clients never send.
    pub(super) fn pester(&mut self, rng: &mut Rng) {
        let end = self.now + Duration::from_secs(20);
        // The server decodes its last bytes when the line is silent.
        let holds = |cell: &Self| cell.wire.next_delivery().is_some() || cell.server.poll_timeout().is_some();
        while self.now < end || holds(self) {
            if self.now < end && rng.chance(0.5) {
                self.wire.send(End::A, self.now, &any_request(self.way, rng));
            }
            let times = [self.server.poll_timeout(), Some(self.now + 50 * MS)];
            self.now = self.wire.next(self.now, times);
            while self.wire.receive(End::A, self.now).is_some() {}
            turn(&mut self.wire, End::B, &mut self.server, self.now, |_, _| ());
            self.server.registers_mut().writes.clear();
        }
        // Ours has a connection of its own, or opens the port after it.
        self.begin_again(0);
    }

    /// Sends as a server that follows no rule, and messages that servers do not send.
    pub(super) fn harass(&mut self, rng: &mut Rng) {
        while let Some(delivery) = self.wire.receive(End::B, self.now) {
            let Delivery::Bytes(_) = delivery else {
                self.lost[1] = true;
                continue;
            };
            for _ in 0..rng.below(3) {
                let words = [7u16; 3];
                let pdu = match rng.below(5) {
                    0 => Reply::Exception {
                        function: 1 + rng.below(16) as u8,
                        exception: (rng.below(256) as u8).into(),
                    },
                    1 => Reply::HoldingRegisters((&words[..1 + rng.below(3)]).into()),
                    2 => Reply::WriteRegister { address: 1000, value: rng.below(9) as u16 },
                    3 => Reply::WriteRegisters { address: 1000, quantity: 3 },
                    _ => Reply::Other { function: 65, data: &[1, 2] },
                };
                let transaction = (self.way == Way::Tcp).then(|| rng.below(12) as u16);
                let mut out = [0; Frame::MAX_LEN];
                let unit = [UNIT, UNIT, 9][rng.below(3)];
                if let Ok(length) = (Frame { transaction, unit, pdu }).encode(&mut out) {
                    let length = if rng.chance(0.1) { rng.below(length + 1) } else { length };
                    self.wire.send(End::B, self.now, &out[..length]);
                }
            }
        }
        self.lost[1] |= !self.wire.is_connected() && self.wire.next_delivery().is_none();
    }
}

fn any_request(way: Way, rng: &mut Rng) -> Vec<u8> {
    let words = [rng.below(9) as u16; 3];
    let (address, quantity) = (rng.below(2000) as u16, rng.below(200) as u16);
    let pdu = match rng.below(6) {
        0 => Request::ReadHoldingRegisters { address, quantity },
        1 => Request::ReadCoils { address, quantity },
        2 => Request::WriteRegister { address, value: quantity },
        3 => Request::WriteRegisters { address, values: (&words).into() },
        4 => Request::MaskWriteRegister { address, and: 7, or: quantity },
        _ => Request::Other { function: 65, data: &[1, 2] },
    };
    let transaction = (way == Way::Tcp).then(|| rng.below(3) as u16);
    let (mut out, unit) = ([0; Frame::MAX_LEN], [0, UNIT, UNIT, 9][rng.below(4)]);
    let length = Frame { transaction, unit, pdu }.encode(&mut out).unwrap_or(0);
    match rng.below(10) {
        0 => vec![0xFF, 0, 3],
        1 | 2 => out[..rng.below(length + 1)].to_vec(),
        _ => out[..length].to_vec(),
    }
}
