//! A host and a controller on a serial line. A job is an instruction: a cut, which is queued, or one that is executed at once.
//!
//! The host's assumptions are met: if the line pauses longer, or the ends are called later, the assumptions are set above
//! that. With a hostile end, which answers or sends anything at any time, the executed work proves nothing; each job still
//! has one outcome.

mod any_controller;
mod any_host;

use core::time::Duration;

use laser_eb90::{
    Class, Controller, ControllerConfig, ControllerEvent, DecodeError, EncodeError, Frame, Host, HostConfig,
    HostEvent, Instruction, Instructions, Item, Items, Payload, Profile, SessionError, timing,
};
use robot_session::{Encode as _, Session as _};
use robot_work_queue::Reader;

use self::any_controller::AnyController;
pub(super) use self::any_host::{ANY_HOST, HOSTILE_HOST};
pub use self::any_host::{Article, Fault, frame};
use super::wire::Cable;
use super::{Check, Ledger, Log, Peer, Reported, Row, Tally, Unseen, Wire};
use crate::link::{End, Faults};
use crate::turn;
use robot_session::contract::Rng;

pub(super) const SERIAL: Row = Row {
    link: "laser-eb90",
    transport: "serial",
    job: "instructions",
    one_in: Some(256),
    session: |seed, log| session(seed, Peer::Ours, log),
};

pub(super) const ANY_CONTROLLER: Row = Row {
    transport: "serial, any controller",
    session: |seed, log| session(seed, Peer::Any(End::B), log),
    ..SERIAL
};

pub(super) const HOSTILE_CONTROLLER: Row = Row {
    transport: "serial, hostile controller",
    session: |seed, log| session(seed, Peer::Hostile(End::B), log),
    ..SERIAL
};

const MS: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(3600);
/// The fault-free time at the end, and the instructions that must be done in it.
const HEALED: Duration = Duration::from_secs(60);
const WORK: usize = 10;
/// An interpreted instruction, an immediate one and a query.
const CUT: u16 = 0x0101;
const SWITCH: u16 = 0x0201;
const ASK: u16 = 0x0301;
/// The longest answer in bytes.
const ANSWER: usize = 24;

/// The payload of an instruction: the index of its job, twice.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Marked {
    word: u16,
    job: u32,
    /// The bits of a float: corruption makes a NaN, too, which is to equal itself.
    x: u32,
}

impl Marked {
    fn new(word: u16, job: usize) -> Self {
        Self { word, job: job as u32, x: (job as f32 * 0.25).to_bits() }
    }

    fn write(self, payload: &mut Payload<'_>) -> Result<(), EncodeError> {
        let job = [(self.job & 0xFFFF) as i16, (self.job >> 16) as i16];
        payload.i16(&job)?.f32(&[f32::from_bits(self.x)]).map(drop)
    }
}

impl TryFrom<Instruction<'_>> for Marked {
    type Error = ();

    fn try_from(instruction: Instruction<'_>) -> Result<Self, ()> {
        let mut items = instruction.parameters;
        match (items.next(), items.next(), items.next()) {
            (Some(Ok(Item::I16(job))), Some(Ok(Item::F32(x))), None) => {
                let [low, high] = job.array().ok_or(())?.map(i16::cast_unsigned);
                let [x] = x.array().ok_or(())?;
                Ok(Self {
                    word: instruction.word,
                    job: u32::from(high) << 16 | u32::from(low),
                    x: x.to_bits(),
                })
            }
            _ => Err(()),
        }
    }
}

struct Cell {
    now: Duration,
    log: Log,
    rng: Rng,
    wire: Wire,
    /// Nothing arrives before.
    plug_at: Duration,
    peer: Peer,
    /// Another controller, in place of the project's own.
    other: Option<AnyController>,
    healed: bool,
    ledger: Ledger,
    /// Executed, but never sent.
    aliens: Vec<Marked>,
    sent: Vec<Marked>,
    config: HostConfig,
    host: Host,
    /// The job of the host's first ticket.
    base: usize,
    controller: Controller<'static, Marked>,
    reader: Reader<'static, Marked>,
    motion_at: Duration,
    pace: Duration,
    unexpected: u64,
}

fn session(seed: u64, peer: Peer, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = [0.2, 1.0, 4.0][rng.below(3)];
    let baud = [9600, 115_200][rng.below(2)];
    let is_slow = rng.chance(0.5);
    let faults = Faults {
        flip: 0.001 * bad,
        lose_byte: 0.0005 * bad,
        insert: 0.0005 * bad,
        lose: 0.02,
        pause: [2 * MS, 45 * MS][rng.below(2)],
        stall: if is_slow { 0.05 } else { 0.0 },
        ..Faults::SERIAL
    };
    let defaults = HostConfig {
        baud,
        batch: 1 + rng.below(7) as u8,
        resend_on_silence: rng.chance(0.1),
        execution_timeout: Duration::from_secs(1),
        full_timeout: Duration::from_secs(2),
        ..HostConfig::default()
    };
    // Pauses of up to 10 s in a frame and in its answer, and a controller that is called up to 5 s late twice between them.
    let config = HostConfig {
        max_pause: Duration::from_secs(11),
        reply_time: Duration::from_secs(16),
        settle: Duration::from_secs(22),
        earlier_execution: Duration::from_secs(6),
        ..defaults
    };
    let config = if is_slow { config } else { defaults };
    let other = (peer == Peer::Any(End::B)).then(|| AnyController::new(rng.chance(0.5), &mut rng));
    let config = other.as_ref().map_or(config, |other| assuming(other, config));
    let mut wire = Wire::new(seed, faults.at_baud(baud), ["host", "controller"], false, log);
    wire.poll_late(if is_slow { 0.005 } else { 0.0 });
    let (controller, reader) = new_controller();
    let mut cell = Cell {
        now: Duration::ZERO,
        log,
        wire,
        plug_at: Duration::ZERO,
        peer,
        other,
        healed: false,
        ledger: Ledger::default(),
        aliens: Vec::new(),
        sent: Vec::new(),
        config,
        host: new_host(config, Duration::ZERO),
        base: 0,
        controller,
        reader,
        motion_at: Duration::ZERO,
        pace: [MS, 20 * MS, 700 * MS][rng.below(3)],
        unexpected: 0,
        rng,
    };
    cell.controller.handle_connected(Duration::ZERO);
    let jobs = 5 + cell.rng.below(36);
    while cell.now < LIMIT && (cell.sent.len() < jobs || !cell.host.is_idle()) {
        cell.misfortune();
        cell.submit_until(jobs);
        cell.step();
    }
    let stuck = !cell.heal();
    // Let the controller execute the instructions that it has buffered.
    let end = cell.now + Duration::from_secs(8);
    while cell.now < end && (!cell.reader.is_empty() || cell.now + Duration::from_secs(7) < end) {
        cell.step();
    }
    cell.settle(stuck)
}

/// Returns the host's configuration with the assumptions that the other controller meets.
fn assuming(other: &AnyController, config: HostConfig) -> HostConfig {
    // An answer, pauses and delays on the line.
    let line = timing::transmission_time(2 * ANSWER, config.baud) + 70 * MS;
    let reply_time = config.reply_time.max(any_controller::DELAY + line);
    let settle = config.settle.max(any_controller::SILENCE + reply_time);
    HostConfig {
        controller_drops_partial: other.drops,
        reply_time,
        settle,
        earlier_execution: config.earlier_execution.max(any_controller::EXECUTION),
        ..config
    }
}

fn new_host(config: HostConfig, now: Duration) -> Host {
    let mut host = Host::new(config).unwrap();
    host.handle_connected(now);
    host
}

fn new_controller() -> (Controller<'static, Marked>, Reader<'static, Marked>) {
    let (writer, reader) = robot_work_queue::boxed(8, 9999).unwrap();
    (Controller::new(ControllerConfig::default(), writer).unwrap(), reader)
}

impl Cell {
    fn submit_until(&mut self, jobs: usize) {
        while self.sent.len() < jobs {
            let word = match self.rng.below(10) {
                0 => SWITCH,
                1 => ASK,
                _ => CUT,
            };
            let marked = Marked::new(word, self.sent.len());
            match self.host.submit(word, |payload| marked.write(payload)) {
                Ok(_) => {
                    self.sent.push(marked);
                    self.ledger.send(self.wire.mark());
                }
                Err(SessionError::Full) => return,
                Err(error) => panic!("{error}"),
            }
        }
    }

    /// Injects the faults of both ends and of the line.
    fn misfortune(&mut self) {
        if self.rng.chance(0.001) {
            self.log.line(self.now, format_args!("the line is unplugged"));
            self.plug_at = self.now + self.rng.log_uniform(10 * MS, 10_000 * MS);
        }
        if self.rng.chance(0.001) {
            self.log.line(self.now, format_args!("the host's port is closed and opened again"));
            self.host.handle_disconnected(self.now);
            self.host.handle_connected(self.now);
        }
        if self.rng.chance(0.001) {
            self.log.line(self.now, format_args!("the host is restarted"));
            self.host = new_host(self.config, self.now);
            // A new host has no record of the previous host's instructions.
            for job in self.base..self.sent.len() {
                if !self.ledger.is_reported(job) {
                    let unknown = if self.is_certain() { Reported::Unknown } else { Reported::AnyTimes(0) };
                    self.ledger.report(job, unknown, self.wire.mark());
                }
            }
            self.base = self.sent.len();
        }
        if self.rng.chance(0.001) {
            self.log.line(self.now, format_args!("the controller is restarted, its motion task is not"));
            while let Some(job) = self.reader.take() {
                let marked = job.complete();
                self.execute(marked);
            }
            (self.controller, self.reader) = new_controller();
            self.controller.handle_connected(self.now);
            self.other = self.other.take().map(|other| AnyController::new(other.drops, &mut self.rng));
        }
    }

    /// Returns whether the executed work follows from the reports: without a hostile end, and without a caller that sends a
    /// frame several times.
    fn is_certain(&self) -> bool {
        !matches!(self.peer, Peer::Hostile(_)) && !self.config.resend_on_silence
    }

    /// Runs a minute without faults, in which work is requested; returns whether it was done.
    fn heal(&mut self) -> bool {
        self.wire.heal(self.now);
        (self.healed, self.plug_at) = (true, self.now);
        let end = self.now + HEALED;
        let (begin, jobs) = (self.sent.len(), self.sent.len() + WORK);
        let is_done =
            |cell: &Self| cell.sent.len() == jobs && (begin..jobs).all(|job| cell.ledger.is_reported(job));
        while self.now < end && !is_done(self) {
            self.submit_until(jobs);
            self.step();
        }
        is_done(self)
    }

    fn step(&mut self) {
        let is_cut = self.now < self.plug_at;
        let (now, mut events) = (self.now, Vec::new());
        // The user checks an unknown outcome, and continues.
        if self.host.is_held() {
            self.host.resume();
        }
        turn(&mut Cable { wire: &mut self.wire, is_cut }, End::A, &mut self.host, now, |_, event| {
            events.push(event);
        });
        events.into_iter().for_each(|event| self.report(event));
        let (log, mut executed, mut unexpected) = (self.log, Vec::new(), 0);
        if let Some(other) = &mut self.other {
            let mut line = Cable { wire: &mut self.wire, is_cut };
            executed = other.turn(&mut line, now, self.healed, &mut self.rng);
        }
        turn(
            &mut Cable { wire: &mut self.wire, is_cut },
            End::B,
            &mut self.controller,
            now,
            |controller, event| {
                log.line(now, format_args!("  controller: {event:?}"));
                match event {
                    ControllerEvent::Execute { class, .. } => executed.extend(obey(controller, now, class)),
                    ControllerEvent::Unexpected(_) => unexpected += 1,
                    _ => {}
                }
            },
        );
        self.unexpected += unexpected;
        executed.into_iter().for_each(|marked| self.execute(marked));
        while self.motion_at <= self.now {
            let Some(job) = self.reader.take() else {
                self.motion_at = self.now + MS;
                break;
            };
            let marked = job.complete();
            self.motion_at += self.pace;
            self.execute(marked);
        }
        self.provoke();
        let motion = (!self.reader.is_empty()).then_some(self.motion_at);
        let plug = is_cut.then_some(self.plug_at);
        let other = self.other.as_ref().and_then(AnyController::next);
        let times = [self.host.poll_timeout(), self.controller.poll_timeout(), motion, plug, other];
        // The next submission may be all that is left to happen.
        self.now = self.wire.next(self.now, times);
    }

    /// Makes a random walk over the messages of one end.
    fn provoke(&mut self) {
        let Peer::Hostile(from) = self.peer else { return };
        if self.healed || !self.rng.chance(0.05) {
            return;
        }
        let (profile, mut buffer, mut out) = (Profile::default(), [0; 64], [0; Frame::MAX_LEN]);
        let mut payload = Payload::new(&mut buffer, &profile);
        let words = [CUT, SWITCH, ASK, 0xE001, 0xE002, 0xE003, 0xE004, 0xE005, 0xE006, 0x7777];
        payload.word(words[self.rng.below(words.len())]).unwrap();
        if self.rng.chance(0.5) {
            Marked::new(CUT, 1_000_000 + self.rng.below(1000)).write(&mut payload).unwrap();
        }
        let n = payload.frame().unwrap().encode(&mut out).unwrap();
        let n = if self.rng.chance(0.7) { n } else { self.rng.below(n) };
        self.wire.send(from, self.now, &out[..n]);
    }

    fn report(&mut self, event: HostEvent) {
        self.log.line(self.now, format_args!("  host: {event:?}"));
        let insists = self.config.resend_on_silence;
        let (first, count, reported) = match event {
            HostEvent::Done { first, count, unanswered: 0, .. } => (first, count, Reported::Done),
            HostEvent::Done { first, count, .. } => (first, count, Reported::AnyTimes(1)),
            // It may have been executed several times, if the user wants that.
            HostEvent::Answer { ticket, .. } if insists => (ticket, 1, Reported::AnyTimes(1)),
            HostEvent::Answer { ticket, .. } => (ticket, 1, Reported::Done),
            HostEvent::Refused { first, count, .. } => (first, count, Reported::NotDone),
            HostEvent::Unknown { first, count, .. } if insists => (first, count, Reported::AnyTimes(0)),
            HostEvent::Unknown { first, count, .. } => (first, count, Reported::Unknown),
            HostEvent::Unexpected(_) => {
                self.unexpected += 1;
                return;
            }
            _ => return,
        };
        let is_hostile = matches!(self.peer, Peer::Hostile(_));
        let reported = if is_hostile { Reported::AnyTimes(0) } else { reported };
        for ticket in first..first + u64::from(count) {
            self.ledger.report(self.base + ticket as usize, reported, self.wire.mark());
        }
    }

    fn execute(&mut self, marked: Marked) {
        self.log.line(self.now, format_args!("  executed: {marked:?}"));
        let sent = self.sent.get(marked.job as usize) == Some(&marked);
        if !sent || !self.ledger.execute(marked.job as usize) {
            self.aliens.push(marked);
        }
    }

    fn settle(self, stuck: bool) -> Tally {
        let mut tally = Tally { stuck: stuck.into(), invented: self.unexpected, ..Tally::default() };
        let profile = Profile::default();
        let unseen = self.wire.settle(self.now, &mut tally, Frame::MAX_LEN, |_, bytes| {
            let mut payload = [0; laser_eb90::MAX_PAYLOAD];
            match Frame::decode(bytes, &mut payload, &profile) {
                Ok(Some((frame, used))) if frame.items().check().is_ok() => Check::Good(used),
                Err(DecodeError::Checksum { .. }) => Check::Refused,
                Ok(_) | Err(_) => Check::Nothing,
            }
        });
        for alien in &self.aliens {
            if !matches!(self.peer, Peer::Hostile(_)) && !unseen.iter().any(|unseen| holds(unseen, alien)) {
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

/// Executes an immediate instruction or a query, and answers it.
fn obey(controller: &mut Controller<'static, Marked>, now: Duration, class: Class) -> Option<Marked> {
    let Some(Ok(marked)) = controller.instruction().map(Marked::try_from) else {
        controller.refuse(now, laser_eb90::Refusal::BadParameters).unwrap();
        return None;
    };
    let values = |payload: &mut Payload<'_>| match class {
        Class::Query => payload.f32(&[1.5, -2.5]).map(drop),
        _ => Ok(()),
    };
    controller.answer(now, values).unwrap();
    Some(marked)
}

/// Returns whether an instruction is in a frame that is the result of corruption.
fn holds(unseen: &Unseen, alien: &Marked) -> bool {
    let (profile, mut payload) = (Profile::default(), [0; laser_eb90::MAX_PAYLOAD]);
    let Ok(Some((frame, _))) = Frame::decode(&unseen.bytes, &mut payload, &profile) else { return false };
    let items: Items<'_> = frame.items();
    let mut all = Instructions::new(items).flatten().chain(Instruction::single(items).ok());
    all.any(|instruction| Marked::try_from(instruction) == Ok(*alien))
}
