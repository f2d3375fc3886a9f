//! A controller and a host on a serial line. A job is a reply that moves the arm, or an exception for the gripper.

mod any_controller;
mod any_host;
mod hostile;

use core::time::Duration;

use robot_session::Session as _;
use robot_session::end::End as _;
use val2_alter::{
    Accumulation, Controller, ControllerConfig, ControllerEvent, ControllerState, DecodeError, ErrorCode,
    Exception, ExceptionOutcome, Frame, Framing, Host, HostConfig, HostEvent, HostMessage, HostState, Limits,
    Message, Mode, Reply, RobotMessage, Unselected, timing,
};

use self::any_controller::AnyController;
use self::any_host::AnyHost;
use super::{Check, Ledger, Log, Mark, Peer, Reported, Row, Tally, Wire};
use crate::link::{Delivery, End, Faults};
use crate::{Carrier, turn};
use robot_session::contract::Rng;

pub(super) const SERIAL: Row = Row {
    link: "val2-alter",
    transport: "serial",
    job: "replies",
    one_in: Some(256),
    session: |seed, log| session(seed, Peer::Ours, log),
};

pub(super) const ANY_CONTROLLER: Row = Row {
    transport: "serial, any controller",
    session: |seed, log| session(seed, Peer::Any(End::A), log),
    ..SERIAL
};

pub(super) const ANY_HOST: Row = Row {
    transport: "serial, any host",
    session: |seed, log| session(seed, Peer::Any(End::B), log),
    ..SERIAL
};

/// Each end against one that sends anything.
pub(super) const HOSTILE: Row = Row {
    transport: "serial, hostile ends",
    job: "exceptions and starts",
    one_in: None,
    session: |seed, log| hostile::session(seed, log),
    ..SERIAL
};

const MS: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(300);
/// How many jobs must be done in the fault-free minute at the end.
const AT_THE_END: usize = 5;

type Values = [i16; 6];

/// What the host is to send as a job: its first value says which one it is. Some values stay as they were, or are zero.
fn values(job: usize) -> Values {
    let n = job as i16 + 1;
    [n, n / 2, (n / 4).wrapping_mul(31), (n & 1) * 0x1010, 0x0210, -n]
}

struct Cell {
    now: Duration,
    log: Log,
    wire: Wire,
    ledger: Ledger,
    /// The values of each job, as they were sent; zeros for an exception.
    sent: Vec<Values>,
    /// Taken by the controller, and nobody sent it.
    aliens: Vec<HostMessage>,
    controller: Controller,
    host: Host,
    /// Instead of the project's own.
    other_controller: Option<AnyController>,
    other_host: Option<AnyHost>,
    /// Whether values are offsets from the path, which ones hold, and whether those are an alien's.
    holds: bool,
    applied: Values,
    astray: bool,
    /// Whether the robot's exception subroutine runs.
    interrupted: bool,
    /// What one end sends is lost until then.
    dead: Option<(End, Duration)>,
    /// When the robot's program executes ALTER again.
    again_at: Option<Duration>,
    /// Before the message that the host answers next: its content may be wrong too.
    cause: Mark,
    /// Whether the line keeps the assumption of `HostConfig::max_delay`: else a rejection may be about another reply.
    in_time: bool,
    /// The reply, and the exception, whose fate is not known yet.
    reply: Option<usize>,
    exception: Option<usize>,
    /// When the last reply was sent, if nothing corrupt has come since.
    replied_at: Option<Duration>,
    /// The jobs that are exceptions: each has a code of its own.
    exceptions: Vec<usize>,
    done: usize,
}

fn session(seed: u64, peer: Peer, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = [0.1, 0.5, 2.0][rng.below(3)];
    // A pause of more than 4 ms ends a frame. All delays of a cycle together stay below 10 ms: a reply that comes when the
    // next message has left would pass for the reply to that, since it has no number. Or they do not, and the host knows it.
    let in_time = rng.chance(0.6);
    let (pause, max_delay) = [(MS, 3 * MS), (5 * MS, MS / 2)][rng.below(2)];
    let faults = Faults {
        latency: MS / 2,
        flip: 0.002 * bad,
        lose_byte: 0.001 * bad,
        insert: 0.001 * bad,
        lose: 0.02 * bad,
        pause,
        max_delay,
        stall: if in_time { 0.0 } else { 0.01 * bad },
        ..Faults::SERIAL
    };
    // At the lower rate not all words of a reply fit its window, and only ours knows which do.
    let baud = [38_400, 19_200][rng.below(if peer == Peer::Any(End::B) { 1 } else { 2 })];
    let config = ControllerConfig {
        baud,
        mode: [Mode::CUMULATIVE_23, Mode::NON_CUMULATIVE_22, Mode(19), Mode(18)][rng.below(4)],
        subroutine: true,
        unselected: [Unselected::ByMode, Unselected::Hold, Unselected::Zero][rng.below(3)],
        ..ControllerConfig::default()
    };
    let host = HostConfig {
        baud,
        mode: config.mode,
        limits: Limits::NONE,
        subroutine: true,
        max_delay: if in_time { HostConfig::default().max_delay } else { Duration::MAX },
        ..HostConfig::default()
    };
    let mut cell = Cell {
        now: Duration::ZERO,
        log,
        wire: Wire::new(seed, faults.at_baud(config.baud), ["controller", "host"], false, log),
        ledger: Ledger::default(),
        sent: Vec::new(),
        aliens: Vec::new(),
        controller: Controller::new(config).expect("it can work"),
        host: Host::new(host).expect("it can work"),
        other_controller: (peer == Peer::Any(End::A)).then(|| AnyController::new(config, Duration::ZERO)),
        other_host: (peer == Peer::Any(End::B)).then(AnyHost::new),
        holds: config.mode.accumulation() == Accumulation::NonCumulative,
        applied: [0; 6],
        astray: false,
        interrupted: false,
        dead: None,
        again_at: (peer != Peer::Any(End::A)).then_some(Duration::ZERO),
        cause: Mark::default(),
        in_time,
        reply: None,
        exception: None,
        replied_at: None,
        exceptions: Vec::new(),
        done: 0,
    };
    cell.controller.handle_connected(cell.now);
    cell.host.handle_connected(cell.now);
    if !in_time {
        cell.wire.poll_late(0.003 * bad);
    }
    let jobs = 5 + rng.below(60);
    while cell.ledger.len() < jobs && cell.now < LIMIT {
        cell.users(&mut rng, true);
        cell.step(false, &mut rng);
    }
    // A minute without faults, in which work is asked for.
    cell.wire.heal(cell.now);
    let (end, enough) = (cell.now + Duration::from_secs(60), cell.done + AT_THE_END);
    while cell.now < end && cell.done < enough {
        cell.users(&mut rng, false);
        cell.step(true, &mut rng);
    }
    let stuck = cell.done < enough;
    log.line(cell.now, format_args!("the host stops"));
    cell.host.stop(cell.now);
    let end = cell.now + Duration::from_secs(1);
    while cell.now < end && (cell.host.state() != HostState::Idle || cell.open()) {
        cell.step(true, &mut rng);
    }
    let unexpected = cell.host.statistics().unexpected + cell.controller.statistics().unexpected;
    assert_eq!(unexpected, 0, "the contract is kept");
    let mut tally = cell.settle();
    tally.stuck = stuck.into();
    tally
}

impl Cell {
    fn open(&self) -> bool {
        self.reply.is_some() || self.exception.is_some()
    }

    /// What the robot's program and the operator do, and what goes wrong with their machines.
    fn users(&mut self, rng: &mut Rng, faults: bool) {
        if self.controller.state() == ControllerState::Off && self.other_controller.is_none() {
            let again_at = *self.again_at.get_or_insert_with(|| self.now + MS * rng.below(100) as u32);
            if again_at <= self.now {
                self.log.line(self.now, format_args!("the robot's program executes ALTER"));
                self.controller.start(self.now).expect("it is off");
                self.again_at = None;
                self.begin();
            }
        }
        if self.interrupted && rng.chance(0.1) {
            self.log.line(self.now, format_args!("the exception subroutine returns"));
            let _ = self.controller.resume(self.now);
            self.interrupted = false;
        }
        if faults && rng.chance(0.003) {
            self.log.line(self.now, format_args!("the robot's program ends ALTER"));
            let _ = self.controller.finish(self.now);
        }
        if faults && rng.chance(0.001) {
            self.restart_host();
        }
        if faults && rng.chance(0.001) && self.other_controller.is_none() {
            self.log.line(self.now, format_args!("the controller loses its memory"));
            self.controller = Controller::new(*self.controller.config()).expect("it worked before");
            self.controller.handle_connected(self.now);
            self.again_at = None;
            self.begin();
        }
        if faults && rng.chance(0.001) {
            let end = [End::A, End::B][rng.below(2)];
            let until = self.now + rng.log_uniform(MS, Duration::from_secs(5));
            self.log.line(self.now, format_args!("what {end:?} sends is lost until {until:?}"));
            self.dead = Some((end, until));
        }
        if self.exception.is_none() && self.other_host.is_none() && rng.chance(0.03) {
            let exception = exception(self.ledger.len());
            if self.host.exception(self.now, exception).is_ok() {
                let job = self.send([0; 6]);
                self.log.line(self.now, format_args!("job {job}: {exception:?}"));
                self.exceptions.push(job);
                self.exception = Some(job);
            }
        }
    }

    /// A new ALTER: all words of the controller are zero.
    fn begin(&mut self) {
        (self.interrupted, self.applied, self.astray) = (false, [0; 6], false);
    }

    /// The host's process dies: nobody learns what became of its last reply.
    fn restart_host(&mut self) {
        self.log.line(self.now, format_args!("the host loses its memory"));
        self.hear();
        let mark = self.wire.mark();
        for job in [self.reply.take(), self.exception.take()].into_iter().flatten() {
            self.ledger.report(job, Reported::Unknown, mark);
        }
        self.host = Host::new(*self.host.config()).expect("it worked before");
        self.host.handle_connected(self.now);
        self.other_host = self.other_host.take().map(|_| AnyHost::new());
    }

    fn send(&mut self, values: Values) -> usize {
        self.sent.push(values);
        self.ledger.send(self.cause)
    }

    fn step(&mut self, is_calm: bool, rng: &mut Rng) {
        let (now, mut reported) = (self.now, Vec::new());
        let dead = self.dead.filter(|(_, until)| now < *until).map(|(end, _)| end);
        let mut line = HalfOpen { wire: &mut self.wire, dead };
        match &mut self.other_controller {
            Some(other) => reported = other.turn(&mut line, now, is_calm, rng),
            None => turn(&mut line, End::A, &mut self.controller, now, |_, event| reported.push(event)),
        }
        self.obey(reported);
        if let Some(mut other) = self.other_host.take() {
            self.answer(&mut other, dead, is_calm, rng);
            self.other_host = Some(other);
        } else {
            self.step_host(dead);
        }
        let others = [
            self.other_controller.as_ref().map(AnyController::next),
            self.other_host.as_ref().and_then(AnyHost::next),
        ];
        let times = [self.host.poll_timeout(), self.controller.poll_timeout(), self.again_at];
        self.now = self.wire.next(self.now, times.into_iter().chain(others));
    }

    fn step_host(&mut self, dead: Option<End>) {
        let now = self.now;
        self.host.set_target(now, values_of(&self.ledger));
        let before = self.host.statistics().replies;
        let mark = self.wire.mark();
        let mut events = Vec::new();
        let mut line = HalfOpen { wire: &mut self.wire, dead };
        turn(&mut line, End::B, &mut self.host, now, |_, event| events.push(event));
        self.note(events, mark);
        let runs = self.host.state() == HostState::Running;
        if self.host.statistics().replies > before {
            let values = self.host.values();
            if runs && values != [0; 6] {
                let job = self.send(values);
                self.log.line(now, format_args!("job {job}: {values:?}"));
                self.reply = Some(job);
            }
            (self.cause, self.replied_at) = (mark, Some(now));
        }
    }

    fn obey(&mut self, events: Vec<ControllerEvent>) {
        for event in events {
            self.log.line(self.now, format_args!("  controller: {event:?}"));
            match event {
                ControllerEvent::Reply { reply, values } => {
                    let job = self.sent.iter().rposition(|sent| *sent == values);
                    // An offset that stays is no job.
                    let stays = self.holds && values == self.applied;
                    match job {
                        _ if stays => {}
                        _ if values == [0; 6] => self.astray = false,
                        Some(job) => {
                            self.astray = false;
                            self.ledger.execute(job);
                        }
                        // Words that the next replies leave out stay as an alien has made them.
                        None if self.astray => {}
                        None => {
                            self.astray = true;
                            self.aliens.push(HostMessage::Reply(reply));
                        }
                    }
                    self.applied = values;
                }
                ControllerEvent::Exception(found) => {
                    self.interrupted = true;
                    let job = self.exceptions.iter().rfind(|job| exception(**job) == found);
                    match job {
                        Some(job) if !self.ledger.is_executed(*job) => _ = self.ledger.execute(*job),
                        // Nobody sent it, or it comes again: only corruption explains that.
                        _ => {
                            let reply = Reply { exception: found, ..Reply::NOTHING };
                            self.aliens.push(HostMessage::Reply(reply));
                        }
                    }
                }
                _ => {}
            }
        }
    }

    /// Whether an error code is about the last reply. A controller that is not ours goes on without one, and then it may be about a message
    /// that was lost.
    fn follows(&self) -> bool {
        let until = self.replied_at.map(|at| at + timing::CYCLE * 3 / 2);
        self.other_controller.is_none() || until.is_some_and(|until| self.now < until)
    }

    fn hear(&mut self) {
        let events: Vec<_> = core::iter::from_fn(|| self.host.poll_event()).collect();
        let mark = self.wire.mark();
        self.note(events, mark);
    }

    fn note(&mut self, events: Vec<HostEvent>, mark: Mark) {
        for event in events {
            self.log.line(self.now, format_args!("  host: {event:?}"));
            if let HostEvent::Exception { outcome, .. } = event
                && let Some(job) = self.exception.take()
            {
                let reported = match outcome {
                    ExceptionOutcome::Done => Reported::Done,
                    ExceptionOutcome::NotDone => Reported::NotDone,
                    ExceptionOutcome::Unknown(_) => Reported::Unknown,
                };
                self.done += usize::from(reported == Reported::Done);
                self.ledger.report(job, reported, mark);
            }
            let reported = match event {
                // Where replies may be late, a message may be about an older one.
                HostEvent::Motion(motion) if motion.error == ErrorCode::None => {
                    self.done += usize::from(!self.in_time && self.reply.is_some());
                    Some(if self.in_time { Reported::Done } else { Reported::Unknown })
                }
                HostEvent::Rejected(_) if self.in_time && self.follows() => Some(Reported::NotDone),
                HostEvent::Rejected(_) => Some(Reported::Unknown),
                HostEvent::Corrupt(_) => {
                    self.replied_at = None;
                    None
                }
                HostEvent::Start(_) | HostEvent::End(_) | HostEvent::Lost(_) => {
                    self.cause = mark;
                    Some(Reported::Unknown)
                }
                _ => None,
            };
            if let (Some(reported), Some(job)) = (reported, self.reply) {
                self.reply = None;
                self.done += usize::from(reported == Reported::Done);
                self.ledger.report(job, reported, mark);
            }
        }
    }

    fn settle(self) -> Tally {
        let mut tally = Tally::default();
        let unseen = self.wire.settle(self.now, &mut tally, Frame::MAX_LEN, |from, bytes| {
            let (frame, len) = match Frame::decode(bytes, Framing::DEFAULT) {
                Ok(Some(found)) => found,
                Err(DecodeError::Checksum { .. }) => return Check::Refused,
                Ok(None) | Err(_) => return Check::Nothing,
            };
            let reads = match from {
                End::A => RobotMessage::decode(frame.data(), Framing::DEFAULT).is_ok(),
                End::B => HostMessage::decode(frame.data(), Framing::DEFAULT).is_ok(),
            };
            if reads { Check::Good(len) } else { Check::Nothing }
        });
        for alien in self.aliens {
            if !unseen.iter().any(|unseen| unseen.from == End::B && says(&unseen.bytes, alien)) {
                self.log.line(self.now, format_args!("!!! nobody sent {alien:?}"));
                tally.invented += 1;
            }
        }
        self.ledger.settle(self.now, self.log, &mut tally, |job| {
            unseen.iter().any(|unseen| unseen.is_between(job.from, job.to))
        });
        tally
    }
}

/// What a job that is an exception sends: another code than the 200 before it.
fn exception(job: usize) -> Exception {
    Exception::from(1 + (job % 200) as u8)
}

/// A line on which one end's bytes are lost.
struct HalfOpen<'a> {
    wire: &'a mut Wire,
    dead: Option<End>,
}

impl Carrier for HalfOpen<'_> {
    fn send(&mut self, from: End, now: Duration, bytes: &[u8]) {
        if self.dead != Some(from) {
            self.wire.send(from, now, bytes);
        }
    }

    fn receive(&mut self, at: End, now: Duration, most: usize) -> Option<Delivery> {
        self.wire.receive_part(at, now, most)
    }
}

/// What the next job is to be.
fn values_of(ledger: &Ledger) -> Values {
    values(ledger.len())
}

/// Whether a frame that damage has made says this: its values, or for an exception, that.
fn says(bytes: &[u8], alien: HostMessage) -> bool {
    let Ok(Some((frame, _))) = Frame::decode(bytes, Framing::DEFAULT) else { return false };
    match (HostMessage::decode(frame.data(), Framing::DEFAULT), alien) {
        (Ok(HostMessage::Reply(found)), HostMessage::Reply(alien)) => {
            found == alien || alien.exception != Exception::None && found.exception == alien.exception
        }
        _ => false,
    }
}
