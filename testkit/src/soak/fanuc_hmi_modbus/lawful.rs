//! Ends of another maker that follow the protocol's rules: a server that decides the open points, and other units of a line.

use core::time::Duration;

use fanuc_hmi_modbus::{Exception, Frame, Reply, Request, Side};
use robot_session::Encode as _;
use robot_session::end::End as _;

use super::bank::Bank;
use super::{Cell, MS, UNIT, Way};
use crate::link::{Delivery, End};
use robot_session::contract::Rng;

/// A value that is never requested: the data of other units would write it.
pub(super) const PLANTED: u16 = 0x0BAD;

/// A server that answers late, in any order where that is open, or not at all, and that is busy now and then.
#[derive(Debug, Default)]
pub(super) struct Lawful {
    held: Vec<u8>,
    /// The time at which it received the bytes that it holds.
    heard: Duration,
    replies: Vec<(Duration, Vec<u8>)>,
    bank: Bank,
}

impl Lawful {
    /// Returns the time at which it has something to do, besides bytes that arrive.
    pub(super) fn next(&self, cell: &Cell) -> Option<Duration> {
        let silence = cell.server.config().framing.silence().filter(|_| !self.held.is_empty());
        let judged = silence.map(|silence| self.heard + silence);
        self.replies.iter().map(|(due, _)| *due).chain(judged).min()
    }

    /// Removes and returns the next frame in the buffer. On a serial line the bytes before a silence are one frame, or none.
    fn take(&mut self, now: Duration, cell: &Cell) -> Option<Vec<u8>> {
        let length = match cell.way {
            Way::Tcp => Frame::decode_tcp(&self.held).ok()??.1,
            Way::Rtu | Way::RtuOverTcp => {
                if now >= self.heard + cell.server.config().framing.silence()? {
                    let message = core::mem::take(&mut self.held);
                    return Frame::decode_rtu_whole(&message).is_ok().then_some(message);
                }
                let is_whole = cell.way == Way::RtuOverTcp;
                Frame::decode_rtu(&self.held, Side::Client).ok().flatten().filter(|_| is_whole)?.1
            }
        };
        Some(self.held.drain(..length).collect())
    }
}

impl Cell {
    /// Runs the lawful server in place of the project's own.
    pub(super) fn answer(&mut self, lawful: &mut Lawful, rng: &mut Rng) {
        while let Some(delivery) = self.wire.receive(End::B, self.now) {
            match delivery {
                Delivery::Bytes(bytes) => {
                    lawful.held.extend(bytes);
                    lawful.heard = self.now;
                }
                Delivery::Closed => {
                    *lawful = Lawful::default();
                    self.lost[1] = true;
                }
            }
        }
        while let Some(bytes) = lawful.take(self.now, self) {
            self.decide(lawful, &bytes, rng);
        }
        lawful.replies.sort_by_key(|(due, _)| *due);
        while let Some((due, _)) = lawful.replies.first()
            && *due <= self.now
        {
            let (_, reply) = lawful.replies.remove(0);
            self.wire.send(End::B, self.now, &reply);
        }
        self.lost[1] |= !self.wire.is_connected() && self.wire.next_delivery().is_none();
    }

    fn decide(&mut self, lawful: &mut Lawful, bytes: &[u8], rng: &mut Rng) {
        let frame = match self.way {
            Way::Tcp => Frame::decode_tcp(bytes).ok().flatten().map(|(frame, _)| frame),
            Way::Rtu | Way::RtuOverTcp => Frame::decode_rtu_whole(bytes).ok(),
        };
        let Some(frame) = frame.filter(|frame| [UNIT, 0].contains(&frame.unit)) else { return };
        let is_calm = self.is_calm;
        let mut out = [0; Frame::MAX_LEN];
        let length = if !is_calm && frame.unit != 0 && rng.chance(0.1) {
            let (function, exception) = (frame.pdu[0], Exception::ServerDeviceBusy);
            let pdu = Reply::Exception { function, exception };
            Frame { transaction: frame.transaction, unit: frame.unit, pdu }.encode(&mut out).unwrap_or(0)
        } else if !is_calm && rng.chance(0.05) {
            return;
        } else {
            frame.serve(&mut lawful.bank, &mut out).unwrap_or(0)
        };
        for write in core::mem::take(&mut lawful.bank.writes) {
            // A write that it has found in data is not checked here.
            if write.1 != [PLANTED] {
                self.execute(write, rng);
            }
        }
        if frame.unit == 0 || !is_calm && rng.chance(0.05) {
            return;
        }
        if self.way != Way::Tcp {
            // The previous reply is no longer expected.
            lawful.replies.clear();
        }
        let delay = if is_calm { 5 * MS } else { rng.log_uniform(MS, Duration::from_secs(3)) };
        lawful.replies.push((self.now + delay, out[..length].to_vec()));
    }

    /// Lets the client of the line send a request to another unit, which replies: both of the project's ends receive both.
    /// Registers may contain bytes that look like a request to the project's server, or like a refusal of a request to it.
    pub(super) fn neighbour(&mut self, rng: &mut Rng) {
        let framed = |unit, pdu: Request<'_>| {
            let (mut out, frame) = ([0; Frame::MAX_LEN], Frame { transaction: None, unit, pdu });
            let length = frame.encode(&mut out).unwrap_or(0);
            out[..length].to_vec()
        };
        let planted = planted(rng);
        let asked =
            Request::ReadHoldingRegisters { address: rng.below(9) as u16, quantity: planted.len() as u16 };
        let mut out = [0; Frame::MAX_LEN];
        let pdu = Reply::HoldingRegisters((&planted[..]).into());
        let length = Frame { transaction: None, unit: 2, pdu }.encode(&mut out).unwrap_or(0);
        let written = Request::WriteRegisters { address: 7, values: (&planted[..]).into() };
        let (asked, replied) = match rng.below(3) {
            0 => (framed(2, written), framed(2, Request::WriteRegister { address: 7, value: 9 })),
            1 => (framed(2, asked), Vec::new()),
            _ => (framed(2, asked), out[..length].to_vec()),
        };
        self.wire.send(End::A, self.now, &asked);
        if !replied.is_empty() {
            self.wire.send(End::A, self.now, &replied);
            self.wire.send(End::B, self.now, &replied);
        }
    }
}

/// Registers that look like requests, from an even or an odd byte on.
pub(super) fn planted(rng: &mut Rng) -> Vec<u16> {
    let mut bytes = vec![7; 1 + rng.below(4)];
    for _ in 0..1 + rng.below(3) {
        let mut out = [0; Frame::MAX_LEN];
        let unit = [UNIT, UNIT, 0][rng.below(3)];
        let length = match rng.below(4) {
            0 => {
                let pdu = Reply::Exception { function: [3, 6, 16, 23][rng.below(4)], exception: 2.into() };
                Frame { transaction: None, unit: UNIT, pdu }.encode(&mut out)
            }
            1 => {
                let values = [PLANTED];
                let pdu = Request::WriteRegisters { address: 500, values: (&values).into() };
                Frame { transaction: None, unit, pdu }.encode(&mut out)
            }
            _ => {
                let pdu = Request::WriteRegister { address: 500, value: PLANTED };
                Frame { transaction: None, unit, pdu }.encode(&mut out)
            }
        };
        bytes.extend(&out[..length.unwrap_or(0)]);
    }
    bytes.extend([7; 3]);
    bytes.chunks(2).map(|pair| u16::from_be_bytes([pair[0], *pair.get(1).unwrap_or(&7)])).collect()
}

/// Returns whether a message is one of those.
pub(super) fn is_planted(pdu: &[u8]) -> bool {
    matches!(pdu, [0x80..=0xFF, ..] | [6 | 16, 1, 0xF4, ..])
}
