//! A host and the workstation that draws its arm, on a serial line. A job is a request: it ends in one pose, or in the report that none
//! came.
//!
//! ALTER ends and begins, and some hosts do not read their port meanwhile. The operator pauses a display that is stale. Every pose is
//! followed from the arm to the line: none is sent that is older than the host's greatest age, and no two packets within its interval.
//! Ends that are not ours are those of the model.

use core::time::Duration;

use val2_viewer::robot_session::Session as _;
use val2_viewer::robot_session::end::{End as _, Machine as _};
use val2_viewer::{
    DecodeError, Host, HostConfig, HostEvent, PosePacket, Workstation, WorkstationConfig, WorkstationEvent,
    XOFF, XON,
};

use super::wire::Cable;
use super::{Check, Ledger, Log, Reported, Row, Tally, Wire};
use crate::link::{End, Faults};
use crate::links::val2_viewer::{any_host, any_workstation};
use crate::model::walk;
use crate::turn;
use robot_session::contract::Rng;

pub(super) const SERIAL: Row =
    Row { link: "val2-viewer", transport: "serial", job: "requests", one_in: Some(256), session };

pub(super) const ANY_WORKSTATION: Row = Row {
    transport: "serial, any workstation",
    one_in: None,
    session: |seed, log| walk(&any_workstation(true), seed, log),
    ..SERIAL
};
pub(super) const ANY_HOST: Row =
    Row { transport: "serial, any host", session: |seed, log| walk(&any_host(true), seed, log), ..SERIAL };
pub(super) const HOSTILE_WORKSTATION: Row = Row {
    transport: "serial, hostile workstation",
    session: |seed, log| walk(&any_workstation(false), seed, log),
    ..ANY_WORKSTATION
};
pub(super) const HOSTILE_HOST: Row = Row {
    transport: "serial, hostile host",
    session: |seed, log| walk(&any_host(false), seed, log),
    ..SERIAL
};

const MS: Duration = Duration::from_millis(1);
/// ALTER's cycle, and the display's.
const ALTER: Duration = Duration::from_millis(28);
const DISPLAY: Duration = Duration::from_millis(200);
/// No session of faults is longer.
const LONGEST: Duration = Duration::from_secs(600);
/// The fault-free time at the end, and the poses that must come in it.
const HEALED: Duration = Duration::from_secs(60);
const WORK: u32 = 20;

/// A packet that was sent.
struct Made {
    packet: PosePacket,
    received: bool,
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = [0.2, 1.0, 3.0][rng.below(3)];
    let faults = Faults {
        flip: 0.001 * bad,
        lose_byte: 0.0005 * bad,
        insert: 0.0005 * bad,
        lose: 0.03,
        pause: 20 * MS,
        stall: 0.03,
        ..Faults::SERIAL
    };
    let mut wire = Wire::new(seed, faults.at_baud(19_200), ["workstation", "host"], true, log);
    wire.poll_late(0.01);
    let mut cell = Cell::new(log);
    let mut workstation = Workstation::new(WorkstationConfig::default()).unwrap();
    let (mut ledger, mut now) = (Ledger::default(), Duration::ZERO);
    let mut asked_at = Duration::ZERO;
    let (mut requests, mut open) = (5 + rng.below(40), None);
    let (mut made, mut aliens, mut invented) = (Vec::<Made>::new(), Vec::new(), 0);
    let (mut shown, mut draw_at, mut plug_at) = (None, Duration::ZERO, Duration::ZERO);
    let (mut healed, mut work): (Option<Duration>, u32) = (None, 0);
    cell.host.handle_connected(now);
    workstation.handle_connected(now);
    loop {
        if healed.is_none() {
            cell.misfortune(now, &mut rng);
            if rng.chance(0.002) {
                log.line(now, format_args!("the line is unplugged"));
                plug_at = now + rng.log_uniform(10 * MS, 10_000 * MS);
            }
            if rng.chance(0.002) {
                log.line(now, format_args!("the workstation's port is closed and opened again"));
                workstation.handle_disconnected(now);
                workstation.handle_connected(now);
            }
            if rng.chance(0.002) {
                log.line(now, format_args!("the workstation is restarted"));
                workstation = Workstation::new(WorkstationConfig::default()).unwrap();
                // A new workstation knows nothing of the request of the one before.
                if let Some(request) = open.take() {
                    ledger.report(request, Reported::Unknown, wire.mark());
                }
                shown = None;
                workstation.handle_connected(now);
            }
        }
        let is_cut = now < plug_at;
        let asked = workstation.statistics().requests;
        let mut events = Vec::new();
        for draws in [false, true] {
            if draws && now < draw_at {
                break;
            }
            if draws {
                workstation.draw(now);
                let waits = matches!(workstation.machine().name(), "WaitingStale" | "Overdue");
                draw_at = now + operator(now, log, waits, healed.is_none(), &mut rng);
            }
            let mut line = Cable { wire: &mut wire, is_cut };
            turn(&mut line, End::A, &mut workstation, now, |_, event| events.push(event));
        }
        for event in events {
            log.line(now, format_args!("  workstation: {event:?}"));
            let outcome = match event {
                WorkstationEvent::Pose(packet) | WorkstationEvent::Unasked(packet) => {
                    let was_sent = made.iter().any(|made| made.packet == packet);
                    match made.iter_mut().find(|made| made.packet == packet && !made.received) {
                        Some(made) => made.received = true,
                        None if was_sent => {
                            log.line(now, format_args!("!!! it was received before"));
                            invented += 1;
                        }
                        None => aliens.push(packet),
                    }
                    let is_answer = matches!(event, WorkstationEvent::Pose(_));
                    work += u32::from(is_answer);
                    shown = if is_answer { Some(now) } else { shown };
                    is_answer.then_some(Reported::Done)
                }
                WorkstationEvent::Missed => Some(Reported::NotDone),
                WorkstationEvent::Stale => {
                    if shown.take().is_none() {
                        log.line(now, format_args!("!!! it was stale before"));
                        invented += 1;
                    }
                    None
                }
                WorkstationEvent::Unexpected(_) => {
                    log.line(now, format_args!("!!! the caller keeps the contract"));
                    invented += 1;
                    None
                }
                _ => None,
            };
            let Some(outcome) = outcome else { continue };
            match open.take() {
                Some(request) => {
                    // A pose is the execution of a request.
                    if outcome == Reported::Done {
                        ledger.execute(request);
                    }
                    ledger.report(request, outcome, wire.mark());
                }
                None if requests == 0 => {}
                None => {
                    log.line(now, format_args!("!!! no request was open"));
                    invented += 1;
                }
            }
        }
        if shown.is_some_and(|at| now >= at + WorkstationConfig::default().stale_after) {
            log.line(now, format_args!("!!! the picture is stale, and nobody has said so"));
            (invented, shown) = (invented + 1, None);
        }
        if open.is_some() && now >= asked_at + WorkstationConfig::default().stale_after {
            log.line(now, format_args!("!!! nobody has said that the request is missed"));
            invented += 1;
        }
        if healed.is_none() && (requests == 0 && open.is_none() || now > LONGEST) {
            healed = Some(now + HEALED);
            wire.heal(now);
            cell.heal(now);
            (requests, work, plug_at) = (0, 0, now);
        }
        if workstation.statistics().requests > asked && requests > 0 {
            (requests, asked_at) = (requests - 1, now);
            open = Some(ledger.send(wire.mark()));
        }
        let mut line = Cable { wire: &mut wire, is_cut };
        cell.turn(&mut line, now, &mut made);
        if healed.is_some_and(|until| now >= until || work >= WORK) {
            break;
        }
        now = wire.next(
            now,
            [
                workstation.poll_timeout(),
                cell.host.poll_timeout().filter(|_| cell.reads),
                Some(draw_at),
                cell.alter.then_some(cell.pose_at),
                Some(now + DISPLAY),
            ],
        );
    }
    if let Some(request) = open {
        ledger.report(request, Reported::Unknown, wire.mark());
    }
    let invented = invented + cell.invented;
    let mut tally = Tally { invented, stuck: u64::from(work < WORK), ..Tally::default() };
    let unseen = wire.settle(now, &mut tally, PosePacket::MAX_LEN, |from, bytes| match from {
        // A request of one byte has no check: one out of noise is answered with a pose.
        End::A => Check::Nothing,
        End::B => match read(bytes) {
            // What the handshake has only interrupted is as it was sent.
            Ok(Some((packet, _))) if made.iter().any(|made| made.packet == packet) => Check::Nothing,
            Ok(Some((_, len))) => Check::Good(len),
            Err(DecodeError::Checksum { .. }) => Check::Refused,
            Ok(None) | Err(_) => Check::Nothing,
        },
    });
    for alien in aliens {
        let made = |bytes: &[u8]| matches!(read(bytes), Ok(Some((packet, _))) if packet == alien);
        if !unseen.iter().any(|unseen| made(&unseen.bytes)) {
            log.line(now, format_args!("!!! nobody sent {alien:?}"));
            tally.invented += 1;
        }
    }
    ledger.settle(now, log, &mut tally, |_| false);
    tally
}

/// The packet that some bytes begin with, and its length: what is held or let go on within a line is no part of it.
fn read(bytes: &[u8]) -> Result<Option<(PosePacket, usize)>, DecodeError> {
    let is_text = |byte: &u8| !matches!(*byte, XON | XOFF);
    let text: Vec<u8> = bytes.iter().copied().filter(is_text).take(PosePacket::MAX_LEN).collect();
    let Some((packet, len)) = PosePacket::decode(&text)? else { return Ok(None) };
    let end =
        bytes.iter().enumerate().filter(|(_, byte)| is_text(byte)).nth(len - 1).map_or(0, |(at, _)| at + 1);
    Ok(Some((packet, end)))
}

/// Until the next display cycle: the operator pauses a picture that is stale, and now and then another one.
fn operator(now: Duration, log: Log, waits: bool, is_careless: bool, rng: &mut Rng) -> Duration {
    let pause = if waits && rng.chance(0.3) {
        2100 * MS
    } else if is_careless && rng.chance(0.03) {
        rng.log_uniform(DISPLAY, 10_000 * MS)
    } else {
        return DISPLAY;
    };
    log.line(now, format_args!("the display is paused for {pause:?}"));
    pause
}

/// The host, and ALTER, which gives it poses.
struct Cell {
    host: Host,
    log: Log,
    alter: bool,
    /// The host reads its port.
    reads: bool,
    /// When the next pose comes.
    pose_at: Duration,
    /// The number of the newest pose, and when it came.
    newest: (u32, Duration),
    /// When the last packet was sent.
    sent_at: Option<Duration>,
    invented: u64,
}

impl Cell {
    fn new(log: Log) -> Self {
        Self {
            host: Host::new(HostConfig::default()).unwrap(),
            log,
            alter: true,
            reads: true,
            pose_at: Duration::ZERO,
            newest: (0, Duration::ZERO),
            sent_at: None,
            invented: 0,
        }
    }

    fn misfortune(&mut self, now: Duration, rng: &mut Rng) {
        if rng.chance(0.01) {
            self.alter = !self.alter;
            self.log.line(now, format_args!("ALTER {}", if self.alter { "begins" } else { "ends" }));
            if !self.alter {
                self.reads = rng.chance(0.5);
            } else if !self.reads {
                self.reads = true;
                self.connect(now);
            }
        }
        if rng.chance(0.002) {
            self.log.line(now, format_args!("the host's port is closed and opened again"));
            self.host.handle_disconnected(now);
            self.connect(now);
        }
        if rng.chance(0.002) {
            self.log.line(now, format_args!("the host is restarted"));
            self.restart(now);
        }
    }

    fn restart(&mut self, now: Duration) {
        self.host = Host::new(HostConfig::default()).unwrap();
        self.connect(now);
    }

    fn connect(&mut self, now: Duration) {
        self.host.handle_connected(now);
    }

    fn heal(&mut self, now: Duration) {
        self.alter = true;
        if !self.reads {
            self.reads = true;
            self.connect(now);
        }
    }

    fn turn(&mut self, line: &mut Cable<'_>, now: Duration, made: &mut Vec<Made>) {
        if !self.reads {
            return;
        }
        if self.alter && now >= self.pose_at {
            self.pose_at = now + ALTER;
            self.newest = (self.newest.0 + 1, now);
            self.host.set_pose(now, pose(self.newest.0));
        }
        let mut events = Vec::new();
        turn(line, End::B, &mut self.host, now, |_, event| events.push(event));
        let config = HostConfig::default();
        for event in events {
            self.log.line(now, format_args!("  host: {event:?}"));
            let wrong = match event {
                HostEvent::Sent(packet) => {
                    let before = self.sent_at.replace(now);
                    made.push(Made { packet, received: false });
                    if packet.pose != pose(self.newest.0) || now - self.newest.1 >= config.max_age {
                        "it is not the newest pose, or too old"
                    } else if before.is_some_and(|before| now < before + config.interval) {
                        "it is too soon after the packet before"
                    } else {
                        continue;
                    }
                }
                HostEvent::Unexpected(_) => "the caller keeps the contract",
                _ => continue,
            };
            self.log.line(now, format_args!("!!! {wrong}"));
            self.invented += 1;
        }
    }
}

/// The pose of a number: no two are alike.
fn pose(number: u32) -> [i16; 12] {
    let (low, high) = (number as i16, (number >> 16) as i16);
    core::array::from_fn(|i| if i == 0 { high } else { low.wrapping_mul(2 * i as i16 + 1) ^ 0x1234 })
}
