//! Hosts and workstations that are not ours, and what our ends must do to any of them. One that keeps the source's rules follows VV-1, VV-8, VV-25 and
//! VV-27 as a workstation, VV-1 and VV-3 as a host.

use core::time::Duration;

use val2_viewer::robot_session::Encode as _;
use val2_viewer::{ENQ, HostConfig, PosePacket, XOFF, XON};

use super::{DISPLAY, MS, Made, anything};
use crate::Carrier;
use crate::link::{Delivery, End};
use crate::soak::wire::Cable;
use robot_session::contract::Rng;

/// A peer that chooses among what the source permits, or sends anything, in place of one of our ends.
pub(super) struct Stranger {
    pub(super) end: End,
    keeps_rules: bool,
    /// A host: the requests that it has not answered. A workstation: whether it may ask.
    requests: usize,
    /// When it answers or asks, and when it says XON.
    next: Duration,
    xon_at: Option<Duration>,
    count: u16,
}

impl Stranger {
    pub(super) fn new(end: End, keeps_rules: bool) -> Self {
        let requests = usize::from(end == End::A);
        Self { end, keeps_rules, requests, next: Duration::ZERO, xon_at: None, count: 0 }
    }

    pub(super) fn turn(&mut self, line: &mut Cable<'_>, now: Duration, made: &mut Vec<Made>, rng: &mut Rng) {
        while let Some(delivery) = line.receive(self.end, now, usize::MAX) {
            let Delivery::Bytes(bytes) = delivery else { continue };
            match self.end {
                End::A if bytes.contains(&b'\n') => self.requests = 1,
                End::A => {}
                End::B => self.requests += bytes.iter().filter(|byte| **byte == ENQ).count(),
            }
        }
        if self.xon_at.take_if(|at| now >= *at).is_some() {
            line.send(self.end, now, &[XON]);
        }
        if rng.chance(0.03) {
            line.send(self.end, now, &[XOFF]);
            self.xon_at = Some(now + rng.log_uniform(MS, 3000 * MS));
        }
        if !self.keeps_rules && rng.chance(0.2) {
            return self.say_anything(line, now, made, rng);
        }
        if now < self.next {
            return;
        }
        match self.end {
            // An answer that is awaited for long is asked for again.
            End::A if self.requests > 0 || rng.chance(0.05) => {
                line.send(End::A, now, &[ENQ]);
                (self.requests, self.next) = (0, now + rng.log_uniform(DISPLAY, 3000 * MS));
            }
            End::B if self.requests > 0 => {
                let packet = PosePacket { count: self.count, pose: anything(rng) };
                send(packet, line, now, made);
                self.count = self.count.wrapping_add(1);
                self.requests = if rng.chance(0.5) { 0 } else { self.requests - 1 };
                self.next = now + rng.log_uniform(MS, 4000 * MS);
            }
            End::A | End::B => {}
        }
    }

    fn say_anything(&mut self, line: &mut Cable<'_>, now: Duration, made: &mut Vec<Made>, rng: &mut Rng) {
        let packet = PosePacket { count: rng.next_u64() as u16, pose: anything(rng) };
        match (self.end, rng.below(3)) {
            (End::A, 0) => line.send(End::A, now, &[ENQ; 5][..1 + rng.below(5)]),
            (End::B, 0) => send(packet, line, now, made),
            (End::B, 1) => {
                let mut out = [0; PosePacket::MAX_LEN];
                let n = packet.encode(&mut out).unwrap();
                // Without its sum, which noise may not complete.
                let (from, to) = (rng.below(n), rng.below(n - 3));
                line.send(End::B, now, out.get(from..to).unwrap_or_default());
            }
            (end, _) => {
                let bytes: Vec<u8> = (0..rng.below(20)).map(|_| rng.next_u64() as u8 & 0x1F).collect();
                line.send(end, now, &bytes);
            }
        }
    }
}

fn send(packet: PosePacket, line: &mut Cable<'_>, now: Duration, made: &mut Vec<Made>) {
    let mut out = [0; PosePacket::MAX_LEN];
    let n = packet.encode(&mut out).unwrap();
    made.push(Made { packet, received: false });
    line.send(End::B, now, &out[..n]);
}

/// What one of our ends has read: it sends nothing after XOFF, and nothing without ENQ if it is the host.
#[derive(Default)]
pub(super) struct Seen {
    xoff: Option<Duration>,
    asked: bool,
}

/// The line of one of our ends.
pub(super) struct Watched<'a, 'b> {
    pub(super) line: &'a mut Cable<'b>,
    pub(super) seen: &'a mut Seen,
    pub(super) wrong: &'a mut u64,
}

impl Carrier for Watched<'_, '_> {
    fn send(&mut self, from: End, now: Duration, bytes: &[u8]) {
        let is_held = self.seen.xoff.is_some_and(|at| now < at + HostConfig::default().max_hold);
        let is_asked = core::mem::take(&mut self.seen.asked) || from == End::A;
        if is_held || !is_asked {
            let what = if is_held { "after XOFF" } else { "unasked" };
            self.line.wire.log(now, format_args!("!!! it sends {what}"));
            *self.wrong += 1;
        }
        self.line.send(from, now, bytes);
    }

    fn receive(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery> {
        let delivery = self.line.receive(at, now, most)?;
        if let Delivery::Bytes(bytes) = &delivery {
            for byte in bytes {
                match *byte {
                    XOFF => self.seen.xoff = Some(now),
                    XON => self.seen.xoff = None,
                    ENQ => self.seen.asked = true,
                    _ => {}
                }
            }
        }
        Some(delivery)
    }
}
