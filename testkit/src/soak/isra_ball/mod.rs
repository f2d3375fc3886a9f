//! A host and a ball on a serial line. A job is a poll: it ends in one packet, or in the report that none came.
//!
//! Values are followed from the sensor to their use: none is used that is older than the host's greatest age. The line of one half
//! of the sessions keeps the host's assumption about delays, that of the other half does not; then values may be older by the
//! longest delay that there was. Ends that are not ours are those of the model.

use core::time::Duration;

use isra_ball::robot_session::Session as _;
use isra_ball::{Ball, BallConfig, BallEvent, DecodeError, Frame, Host, HostConfig, HostEvent, Keys, Packet};

use super::{Check, Ledger, Log, Reported, Row, Tally, Wire};
use crate::link::{End, Faults};
use crate::links::isra_ball::{any_ball, any_host};
use crate::model::walk;
use crate::turn;
use robot_session::contract::Rng;

pub(super) const SERIAL: Row =
    Row { link: "isra-ball", transport: "serial", job: "polls", one_in: Some(256), session };

pub(super) const ANY_BALL: Row =
    Row { transport: "serial, any ball", session: |seed, log| walk(&any_ball(true), seed, log), ..SERIAL };
pub(super) const HOSTILE_BALL: Row = Row {
    transport: "serial, hostile ball",
    session: |seed, log| walk(&any_ball(false), seed, log),
    ..SERIAL
};
pub(super) const ANY_HOST: Row = Row {
    transport: "serial, any host",
    one_in: None,
    session: |seed, log| walk(&any_host(true), seed, log),
    ..SERIAL
};
pub(super) const HOSTILE_HOST: Row = Row {
    transport: "serial, hostile host",
    session: |seed, log| walk(&any_host(false), seed, log),
    ..ANY_HOST
};

const MS: Duration = Duration::from_millis(1);
/// The fault-free time at the end, and the replies with new values that must come in it.
const HEALED: Duration = Duration::from_secs(60);
const WORK: u32 = 20;

/// A packet that the ball has sent.
struct Made {
    packet: Packet,
    /// When its values were measured; `None` if they never were.
    measured: Option<Duration>,
    at: Duration,
    received: bool,
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = [0.3, 1.0, 4.0][rng.below(3)];
    let is_kept = rng.chance(0.5);
    let config = HostConfig::default();
    let faults = Faults {
        flip: 0.004 * bad,
        lose_byte: 0.002 * bad,
        insert: 0.002 * bad,
        lose: 0.02,
        pause: 2 * MS,
        stall: if is_kept { 0.0 } else { 0.02 },
        max_delay: if is_kept { 8 * MS } else { 30 * MS },
        ..Faults::SERIAL
    };
    // The greatest age. A poll that noise has made is answered too, and its packet may be taken for a reply.
    let mut most = config.max_age + config.max_delay;
    let mut wire = Wire::new(seed, faults.at_baud(9600), ["host", "ball"], false, log);
    wire.poll_late(0.01);
    let mut hand = Hand::new(rng.chance(0.5));
    let (mut host, mut ball) = (Host::new(config).unwrap(), new_ball());
    let (mut ledger, mut now) = (Ledger::default(), Duration::ZERO);
    let mut made: Vec<Made> = Vec::new();
    let mut aliens: Vec<Packet> = Vec::new();
    let (mut polls, mut open, mut invented) = (5 + rng.below(60), None, 0);
    let (mut using, mut healed, mut work): (Option<Duration>, Option<Duration>, u32) = (None, None, 0);
    host.handle_connected(now);
    ball.handle_connected(now);
    loop {
        hand.measure(now, &mut ball, &mut rng);
        if healed.is_none() {
            if rng.chance(0.002) {
                log.line(now, format_args!("the ball is restarted"));
                ball = new_ball();
                ball.handle_connected(now);
                hand.measured = None;
            }
            if rng.chance(0.002) {
                log.line(now, format_args!("the port is closed and opened again"));
                host.handle_disconnected(now);
                host.handle_connected(now);
            }
            if rng.chance(0.002) {
                log.line(now, format_args!("the host is restarted"));
                host = Host::new(config).unwrap();
                // A new host knows nothing of the poll of the one before.
                if let Some(poll) = open.take() {
                    ledger.report(poll, Reported::Unknown, wire.mark());
                }
                using = None;
                host.handle_connected(now);
            }
        }
        let polled = host.statistics().polls;
        let mut events = Vec::new();
        turn(&mut wire, End::A, &mut host, now, |_, event| events.push(event));
        for event in events {
            log.line(now, format_args!("  host: {event:?}"));
            let outcome = match event {
                HostEvent::Packet(packet) | HostEvent::Old(packet) | HostEvent::Unasked(packet) => {
                    let is_new = matches!(event, HostEvent::Packet(_));
                    let sent = made.iter().any(|made| made.packet == packet);
                    match made.iter_mut().find(|made| made.packet == packet && !made.received) {
                        Some(made) => {
                            made.received = true;
                            if !is_kept {
                                most =
                                    most.max(config.max_age + config.max_delay + now.saturating_sub(made.at));
                            }
                            if is_new {
                                work += 1;
                                using = made.measured;
                                if using.is_none() {
                                    log.line(now, format_args!("!!! these values were never measured"));
                                    invented += 1;
                                }
                            }
                        }
                        None if sent => {
                            log.line(now, format_args!("!!! it was received before"));
                            invented += 1;
                        }
                        None => {
                            aliens.push(packet);
                            // Nobody has measured these.
                            using = using.filter(|_| !is_new);
                        }
                    }
                    (!matches!(event, HostEvent::Unasked(_))).then_some(Reported::Done)
                }
                HostEvent::Missed => Some(Reported::NotDone),
                HostEvent::Stale => {
                    using = None;
                    None
                }
                HostEvent::Unexpected(_) => {
                    log.line(now, format_args!("!!! the caller keeps the contract"));
                    invented += 1;
                    None
                }
                _ => None,
            };
            if let Some(outcome) = outcome {
                match open.take() {
                    Some(poll) => {
                        // A packet is the execution of a poll.
                        if outcome == Reported::Done {
                            ledger.execute(poll);
                        }
                        ledger.report(poll, outcome, wire.mark());
                    }
                    None if polls == 0 => {}
                    None => {
                        log.line(now, format_args!("!!! no poll was open"));
                        invented += 1;
                    }
                }
            }
        }
        if let Some(measured) = using.filter(|measured| now.saturating_sub(*measured) > most) {
            log.line(now, format_args!("!!! values of {measured:?} are used"));
            invented += 1;
            using = None;
        }
        if polls == 0 && open.is_none() && healed.is_none() {
            healed = Some(now + HEALED);
            wire.heal(now);
            hand.is_stuck_until = now;
            work = 0;
        }
        if host.statistics().polls > polled && polls > 0 {
            polls -= 1;
            open = Some(ledger.send(wire.mark()));
        }
        let mut events = Vec::new();
        turn(&mut wire, End::B, &mut ball, now, |_, event| events.push(event));
        for event in events {
            log.line(now, format_args!("  ball: {event:?}"));
            if let BallEvent::Reply(packet) = event {
                made.push(Made { packet, measured: hand.measured, at: now, received: false });
            }
        }
        if healed.is_some_and(|until| now >= until || work >= WORK) {
            break;
        }
        now = wire.next(now, [host.poll_timeout(), Some(now + 10 * MS)]);
    }
    let mut tally = Tally { invented, stuck: u64::from(work < WORK), ..Tally::default() };
    let unseen = wire.settle(now, &mut tally, Frame::MAX_LEN, |from, bytes| match from {
        // A poll of one byte has no check: an ENQ out of noise is answered, and the packet reported as unasked.
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
            log.line(now, format_args!("!!! nobody measured {alien:?}"));
            tally.invented += 1;
        }
    }
    ledger.settle(now, log, &mut tally, |_| false);
    tally
}

/// The hand on the ball: it never holds still, but the sensor may stop to measure.
struct Hand {
    count: u32,
    may_be_stuck: bool,
    is_stuck_until: Duration,
    /// When the ball's values were measured.
    measured: Option<Duration>,
}

impl Hand {
    fn new(may_be_stuck: bool) -> Self {
        Self { count: 0, may_be_stuck, is_stuck_until: Duration::ZERO, measured: None }
    }

    fn values(&self) -> ([i8; 3], [i8; 3], u8) {
        let [low, high, ..] = self.count.to_le_bytes().map(u8::cast_signed);
        ([low, high, !low], [low ^ 0x55, high ^ 0x11, 3], low.cast_unsigned())
    }

    fn measure(&mut self, now: Duration, ball: &mut Ball, rng: &mut Rng) {
        if now < self.is_stuck_until {
            return;
        }
        self.count += 1;
        let (force, moment, keys) = self.values();
        ball.measure(force, moment, Keys(keys));
        self.measured = Some(now);
        if self.may_be_stuck && rng.chance(0.01) {
            self.is_stuck_until = now + rng.log_uniform(10 * MS, 3000 * MS);
        }
    }
}

fn new_ball() -> Ball {
    Ball::new(BallConfig { sensor_type: 3, sensor: 4, ..BallConfig::default() }).unwrap()
}
