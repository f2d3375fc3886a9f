//! A host and a controller on a serial line. A job is an instruction: a cut, which is queued, or one that is executed at once.

use core::time::Duration;

use laser_eb90::{
    Class, Controller, ControllerConfig, ControllerEvent, DecodeError, EncodeError, Frame, Host, HostConfig,
    HostEvent, Instruction, Instructions, Item, Items, Payload, Profile, SessionError,
};
use robot_session::Session as _;
use robot_work_queue::Reader;

use super::{Check, Ledger, Log, Reported, Row, Tally, Unseen, Wire};
use crate::link::{Delivery, End, Faults};
use crate::rng::Rng;

pub(super) const SERIAL: Row =
    Row { link: "laser-eb90", transport: "serial", job: "instructions", one_in: Some(256), session };

const MS: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(3600);
/// An interpreted instruction, an immediate one and a query.
const CUT: u16 = 0x0101;
const SWITCH: u16 = 0x0201;
const ASK: u16 = 0x0301;

/// What an instruction carries: which job it is, twice.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Marked {
    word: u16,
    job: u32,
    /// The bits of a float: damage makes a NaN, too, which is to equal itself.
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
    wire: Wire,
    ledger: Ledger,
    /// Executed, and nobody sent it.
    aliens: Vec<Marked>,
    sent: Vec<Marked>,
    host: Host,
    /// Whether it sends again on silence.
    insists: bool,
    controller: Controller<'static, Marked>,
    reader: Reader<'static, Marked>,
    motion_at: Duration,
    pace: Duration,
}

fn session(seed: u64, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let bad = [0.2, 1.0, 4.0][rng.below(3)];
    let baud = [9600, 115_200][rng.below(2)];
    let faults = Faults {
        flip: 0.001 * bad,
        lose_byte: 0.0005 * bad,
        insert: 0.0005 * bad,
        lose: 0.02,
        // Below the controller's silence, which has to be "above the pauses that a PC makes within a frame".
        pause: [2 * MS, 45 * MS][rng.below(2)],
        ..Faults::SERIAL
    };
    let (writer, reader) = robot_work_queue::boxed(8, 9999).unwrap();
    let config = HostConfig {
        baud,
        batch: 1 + rng.below(7) as u8,
        resend_on_silence: rng.chance(0.1),
        execution_timeout: Duration::from_secs(1),
        full_timeout: Duration::from_secs(2),
        ..HostConfig::default()
    };
    let (mut host, mut controller) =
        (Host::new(config).unwrap(), Controller::new(ControllerConfig::default(), writer).unwrap());
    host.handle_connected(Duration::ZERO);
    controller.handle_connected(Duration::ZERO);
    let mut cell = Cell {
        now: Duration::ZERO,
        log,
        wire: Wire::new(seed, faults.at_baud(baud), ["host", "controller"], false, log),
        ledger: Ledger::default(),
        aliens: Vec::new(),
        sent: Vec::new(),
        host,
        insists: config.resend_on_silence,
        controller,
        reader,
        motion_at: Duration::ZERO,
        pace: [MS, 20 * MS, 700 * MS][rng.below(3)],
    };
    let jobs = 5 + rng.below(36);
    let mut next = word(&mut rng);
    while cell.now < LIMIT && (cell.sent.len() < jobs || !cell.host.is_idle()) {
        while cell.sent.len() < jobs && cell.submit(next) {
            next = word(&mut rng);
        }
        cell.step();
        // The user looks at an outcome that nobody knows, and goes on.
        if cell.host.is_held() {
            cell.host.resume();
        }
    }
    // What the controller still holds is executed.
    let end = cell.now + Duration::from_secs(8);
    while cell.now < end && (!cell.reader.is_empty() || cell.now + Duration::from_secs(7) < end) {
        cell.step();
    }
    cell.settle()
}

fn word(rng: &mut Rng) -> u16 {
    match rng.below(10) {
        0 => SWITCH,
        1 => ASK,
        _ => CUT,
    }
}

impl Cell {
    fn submit(&mut self, word: u16) -> bool {
        let marked = Marked::new(word, self.sent.len());
        match self.host.submit(word, |payload| marked.write(payload)) {
            Ok(_) => {
                self.sent.push(marked);
                self.ledger.send(self.wire.mark());
                true
            }
            Err(SessionError::Full) => false,
            Err(error) => panic!("{error}"),
        }
    }

    fn step(&mut self) {
        let mut out = [0; Frame::MAX_LEN];
        while let Some(Delivery::Bytes(bytes)) = self.wire.receive(End::A, self.now) {
            self.host.handle_input(self.now, &bytes);
        }
        while let Some(Delivery::Bytes(bytes)) = self.wire.receive(End::B, self.now) {
            self.controller.handle_input(self.now, &bytes);
        }
        self.host.handle_timeout(self.now);
        self.controller.handle_timeout(self.now);
        self.hear();
        self.obey();
        while self.motion_at <= self.now {
            let Some(job) = self.reader.take() else {
                self.motion_at = self.now + MS;
                break;
            };
            let marked = job.complete();
            self.motion_at += self.pace;
            self.execute(marked);
        }
        while let Some(n) = self.host.poll_transmit(self.now, &mut out) {
            self.wire.send(End::A, self.now, &out[..n]);
        }
        while let Some(n) = self.controller.poll_transmit(self.now, &mut out) {
            self.wire.send(End::B, self.now, &out[..n]);
        }
        let motion = (!self.reader.is_empty()).then_some(self.motion_at);
        let times = [self.host.poll_timeout(), self.controller.poll_timeout(), motion];
        self.now = self.wire.next(self.now, times);
    }

    fn hear(&mut self) {
        while let Some(event) = self.host.poll_event() {
            self.log.line(self.now, format_args!("  host: {event:?}"));
            let (first, count, reported) = match event {
                HostEvent::Done { first, count, unanswered: 0, .. } => (first, count, Reported::Done),
                HostEvent::Done { first, count, .. } => (first, count, Reported::AnyTimes(1)),
                // It may have been asked several times: then that is what the user wants.
                HostEvent::Answer { ticket, .. } if self.insists => (ticket, 1, Reported::AnyTimes(1)),
                HostEvent::Answer { ticket, .. } => (ticket, 1, Reported::Done),
                HostEvent::Refused { first, count, .. } => (first, count, Reported::NotDone),
                HostEvent::Unknown { first, count, .. } if self.insists => {
                    (first, count, Reported::AnyTimes(0))
                }
                HostEvent::Unknown { first, count, .. } => (first, count, Reported::Unknown),
                _ => continue,
            };
            for job in first..first + u64::from(count) {
                self.ledger.report(job as usize, reported, self.wire.mark());
            }
        }
    }

    fn obey(&mut self) {
        while let Some(event) = self.controller.poll_event() {
            self.log.line(self.now, format_args!("  controller: {event:?}"));
            let ControllerEvent::Execute { class, .. } = event else { continue };
            let Some(Ok(marked)) = self.controller.instruction().map(Marked::try_from) else {
                self.controller.refuse(self.now, laser_eb90::Refusal::BadParameters).unwrap();
                continue;
            };
            self.execute(marked);
            let values = |payload: &mut Payload<'_>| match class {
                Class::Query => payload.f32(&[1.5, -2.5]).map(drop),
                _ => Ok(()),
            };
            self.controller.answer(self.now, values).unwrap();
        }
    }

    fn execute(&mut self, marked: Marked) {
        self.log.line(self.now, format_args!("  executed: {marked:?}"));
        let sent = self.sent.get(marked.job as usize) == Some(&marked);
        if !sent || !self.ledger.execute(marked.job as usize) {
            self.aliens.push(marked);
        }
    }

    fn settle(self) -> Tally {
        let mut tally = Tally::default();
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
            if !unseen.iter().any(|unseen| holds(unseen, alien)) {
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

/// Whether an instruction is in a frame that damage has made.
fn holds(unseen: &Unseen, alien: &Marked) -> bool {
    let (profile, mut payload) = (Profile::default(), [0; laser_eb90::MAX_PAYLOAD]);
    let Ok(Some((frame, _))) = Frame::decode(&unseen.bytes, &mut payload, &profile) else { return false };
    let items: Items<'_> = frame.items();
    let mut all = Instructions::new(items).flatten().chain(Instruction::single(items).ok());
    all.any(|instruction| Marked::try_from(instruction) == Ok(*alien))
}
