//! A host and a ball on a serial line. A job is a poll: it ends in one packet, or in the report that none came.

use core::time::Duration;

use isra_ball::{Ball, BallEvent, Config, DecodeError, Frame, Host, HostEvent, Keys, Packet};

use super::{Check, Ledger, Log, Row, Tally, Told, Wire};
use crate::link::{Delivery, End, Faults};
use crate::rng::Rng;

pub(super) const SERIAL: Row =
    Row { link: "isra-ball", transport: "serial", job: "polls", one_in: Some(256), session };

const MS: Duration = Duration::from_millis(1);

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = [0.3, 1.0, 4.0][rng.below(3)];
    let faults = Faults {
        flip: 0.004 * bad,
        lose_byte: 0.002 * bad,
        insert: 0.002 * bad,
        lose: 0.02,
        pause: [2 * MS, 8 * MS][rng.below(2)],
        // Some packets are later than the next poll.
        max_delay: [5 * MS, 30 * MS][rng.below(2)],
        ..Faults::SERIAL
    };
    let mut wire = Wire::new(seed, faults.at_baud(9600), ["host", "ball"], false, log);
    let (mut host, mut ball) = (Host::new(Config::default()).unwrap(), Ball::new(3, 4).unwrap());
    let (mut ledger, mut now, mut buffer) = (Ledger::default(), Duration::ZERO, [0; 64]);
    // The packets that the ball has made, and whether the host has had them.
    let mut made: Vec<(Packet, bool)> = Vec::new();
    let mut aliens: Vec<Packet> = Vec::new();
    let (mut polls, mut open, mut invented) = (5 + rng.below(60), None, 0);
    let mut measured = 0u32;
    while polls > 0 || open.is_some() {
        // A hand that never holds still: each measurement is another one.
        measured += 1;
        let [low, high, ..] = measured.to_le_bytes().map(u8::cast_signed);
        ball.measure([low, high, !low], [low ^ 0x55, high ^ 0x11, 3], Keys(low.cast_unsigned()));
        host.handle_timeout(now);
        while let Some(Delivery::Bytes(bytes)) = wire.receive(End::A, now) {
            host.handle_input(now, &bytes);
        }
        while let Some(Delivery::Bytes(bytes)) = wire.receive(End::B, now) {
            ball.handle_input(now, &bytes);
        }
        while let Some(event) = host.poll_event() {
            log.say(now, format_args!("  host: {event:?}"));
            let told = match event {
                HostEvent::Packet(packet) | HostEvent::Unasked(packet) => {
                    match made.iter_mut().find(|(made, _)| *made == packet) {
                        Some((_, had)) if *had => {
                            log.say(now, format_args!("!!! it had come before"));
                            invented += 1;
                        }
                        Some((_, had)) => *had = true,
                        None => aliens.push(packet),
                    }
                    matches!(event, HostEvent::Packet(_)).then_some(Told::Done)
                }
                HostEvent::Missed => Some(Told::NotDone),
                _ => None,
            };
            if let Some(told) = told {
                match open.take() {
                    Some(poll) => {
                        // A packet is the execution of a poll.
                        if told == Told::Done {
                            ledger.execute(poll);
                        }
                        ledger.tell(poll, told, wire.mark());
                    }
                    None => {
                        log.say(now, format_args!("!!! no poll was open"));
                        invented += 1;
                    }
                }
            }
        }
        while let Some(n) = host.poll_transmit(now, &mut buffer) {
            if polls > 0 {
                polls -= 1;
                open = Some(ledger.send(wire.mark()));
            }
            wire.send(End::A, now, &buffer[..n]);
        }
        while let Some(n) = ball.poll_transmit(now, &mut buffer) {
            wire.send(End::B, now, &buffer[..n]);
        }
        while let Some(event) = ball.poll_event() {
            log.say(now, format_args!("  ball: {event:?}"));
            if let BallEvent::Reply(packet) = event {
                made.push((packet, false));
            }
        }
        now = wire.next(now, [host.poll_timeout()]);
    }
    let mut tally = Tally { invented, ..Tally::default() };
    let unseen = wire.settle(now, &mut tally, Frame::MAX_LEN, |from, bytes| match from {
        // A poll of one byte has no check: an ENQ out of noise is answered, and the answer is told as unasked.
        End::A => Check::Nothing,
        End::B => match Frame::decode(bytes) {
            Ok(Some((_, len))) => Check::Good(len),
            Err(DecodeError::Checksum { .. }) => Check::Refused,
            Ok(None) | Err(_) => Check::Nothing,
        },
    });
    for alien in aliens {
        let made = |bytes: &[u8]| matches!(Frame::decode(bytes), Ok(Some((frame, _))) if frame.packet() == Ok(alien));
        if !unseen.iter().any(|unseen| made(&unseen.bytes)) {
            log.say(now, format_args!("!!! nobody measured {alien:?}"));
            tally.invented += 1;
        }
    }
    ledger.settle(now, log, &mut tally, |_| false);
    tally
}
