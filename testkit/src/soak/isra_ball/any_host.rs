//! Hosts that are not ours: one polls when the reply to its last poll has come or can come no more (IB-9, IB-25), the other one sends
//! anything.
//!
//! Each poll that arrives is answered once, or reported as ignored because one before it is not answered. New values are those that
//! were measured since the reply before.

use core::time::Duration;

use isra_ball::robot_session::Session as _;
use isra_ball::{BallEvent, ENQ, Frame, HostConfig, Status};

use super::{Hand, MS, SERIAL, WORK, misfortune_of_ball, new_ball};
use crate::link::{Delivery, End, Faults};
use crate::soak::{Check, Ledger, Log, Reported, Row, Tally, Wire};
use crate::{Carrier, turn};
use robot_session::contract::Rng;

pub(crate) const ANY_HOST: Row = Row {
    transport: "serial, any host",
    one_in: None,
    session: |seed, log| session(seed, false, log),
    ..SERIAL
};

pub(crate) const HOSTILE_HOST: Row =
    Row { transport: "serial, hostile host", session: |seed, log| session(seed, true, log), ..ANY_HOST };

/// The ball's end of the line, on which polls are counted as they arrive.
struct Counted<'a> {
    wire: &'a mut Wire,
    arrived: &'a mut Vec<usize>,
    ledger: &'a mut Ledger,
}

impl Carrier for Counted<'_> {
    fn send(&mut self, from: End, now: Duration, bytes: &[u8]) {
        self.wire.send(from, now, bytes);
    }

    fn receive(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery> {
        let delivery = self.wire.receive_part(at, now, most)?;
        if let Delivery::Bytes(bytes) = &delivery {
            for _ in bytes.iter().filter(|byte| **byte == ENQ) {
                self.arrived.push(self.ledger.send(self.wire.mark()));
            }
        }
        Some(delivery)
    }
}

fn session(seed: u64, is_hostile: bool, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let faults = Faults {
        flip: 0.003,
        lose_byte: 0.003,
        lose: 0.02,
        pause: 2 * MS,
        stall: if is_hostile { 0.02 } else { 0.0 },
        max_delay: 8 * MS,
        ..Faults::SERIAL
    };
    let mut wire = Wire::new(seed, faults.at_baud(9600), ["host", "ball"], false, log);
    let (mut hand, mut ball, mut ledger) = (Hand::new(rng.chance(0.5)), new_ball(), Ledger::default());
    // The polls that have arrived and have no outcome, the oldest first.
    let (mut now, mut arrived, mut tally) = (Duration::ZERO, Vec::new(), Tally::default());
    let (mut poll_at, mut is_open, mut held, mut sent) = (Duration::ZERO, false, Vec::new(), None);
    let (mut polls, mut healed, mut work) = (5 + rng.below(60), None, 0);
    ball.handle_connected(now);
    loop {
        hand.measure(now, &mut ball, &mut rng);
        if healed.is_none() && misfortune_of_ball(now, log, &mut rng, &mut ball, &mut hand) {
            sent = None;
        }
        while let Some(Delivery::Bytes(bytes)) = wire.receive(End::A, now) {
            held.extend(bytes);
            let Some(Ok(Some((frame, _)))) =
                (0..held.len()).map(|at| Frame::decode(&held[at..])).find(Result::is_ok)
            else {
                continue;
            };
            work += u32::from(frame.packet().is_ok_and(|packet| packet.status == Status::Fresh));
            held.clear();
            (is_open, poll_at) = (false, now.max(poll_at));
        }
        if now >= poll_at {
            let is_anything = is_hostile && healed.is_none();
            let bytes: Vec<u8> = match rng.below(3) {
                0 if is_anything => (0..rng.below(30)).map(|_| rng.next_u64() as u8 & 0x0F).collect(),
                1 if is_anything => vec![ENQ; 1 + rng.below(9)],
                _ => vec![ENQ],
            };
            wire.send(End::A, now, &bytes);
            polls = polls.saturating_sub(1);
            held.clear();
            is_open = true;
            let window = HostConfig::default().reply_window();
            let pause = if is_anything { rng.log_uniform(MS, window * 2) } else { window };
            poll_at = now + pause + rng.log_uniform(MS, 100 * MS);
        }
        let (mut events, ignored) = (Vec::new(), ball.statistics().ignored);
        let mut line = Counted { wire: &mut wire, arrived: &mut arrived, ledger: &mut ledger };
        turn(&mut line, End::B, &mut ball, now, |_, event| events.push(event));
        // A notice may be dropped, and is counted.
        let ignored = ball.statistics().ignored - ignored;
        events.retain(|event| *event != BallEvent::Ignored);
        events.extend((0..ignored).map(|_| BallEvent::Ignored));
        for event in events {
            log.line(now, format_args!("  ball: {event:?}"));
            let (outcome, job) = match event {
                BallEvent::Reply(packet) => {
                    let is_new = hand.measured.is_some() && hand.measured != sent;
                    let (force, moment, _) = hand.values();
                    let is_true = hand.measured.is_none() || (packet.force, packet.moment) == (force, moment);
                    if (packet.status == Status::Fresh) != is_new || !is_true {
                        log.line(
                            now,
                            format_args!(
                                "!!! the values are not those, or not as new as they are said to be"
                            ),
                        );
                        tally.invented += 1;
                    }
                    sent = hand.measured;
                    let job = if arrived.is_empty() { None } else { Some(arrived.remove(0)) };
                    job.inspect(|job| _ = ledger.execute(*job));
                    (Reported::Done, job)
                }
                BallEvent::Ignored => (Reported::NotDone, arrived.pop()),
                BallEvent::Unexpected(_) => (Reported::Done, None),
                _ => continue,
            };
            match job {
                Some(job) => _ = ledger.report(job, outcome, wire.mark()),
                None => {
                    log.line(now, format_args!("!!! unsolicited"));
                    tally.invented += 1;
                }
            }
        }
        if polls == 0 && healed.is_none() {
            healed = Some(now + super::HEALED);
            wire.heal(now);
            (hand.is_stuck_until, work) = (now, 0);
        }
        if healed.is_some_and(|until| now >= until || work >= WORK) {
            break;
        }
        let next = if is_open { poll_at } else { poll_at.min(now + 10 * MS) };
        now = wire.next(now, [Some(next), Some(now + 10 * MS)]);
    }
    tally.stuck = u64::from(work < WORK);
    wire.settle(now, &mut tally, 0, |_, _| Check::Nothing);
    ledger.settle(now, log, &mut tally, |_| false);
    tally
}
