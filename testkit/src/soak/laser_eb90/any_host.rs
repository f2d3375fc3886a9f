//! laser-eb90: a controller against hosts of other makers, over bytes. Nothing here is written or read with the crate's codec.
//!
//! A host as the article has it keeps a frame until its echo has come, and sends it again for each error code (§3(4), §3(5);
//! LE-45, LE-67); its port pauses and the line corrupts. Another one sends anything, and then works as the first.

use core::time::Duration;
use std::collections::VecDeque;

use laser_eb90::{Controller, ControllerConfig, Instruction, Item, timing};
use robot_session::Session as _;
use robot_work_queue::Reader;

use super::super::{Ledger, Log, Mark, Reported, Row, Tally};
use crate::link::FaultCounts;
use robot_session::contract::Rng;

/// The article's host.
pub(crate) const ANY_HOST: Row = Row {
    link: "laser-eb90",
    transport: "serial, any host",
    job: "instructions",
    one_in: None,
    session: |seed, log| session(seed, false, log),
};

/// Before it comes one that sends anything.
pub(crate) const HOSTILE_HOST: Row =
    Row { transport: "serial, hostile host", session: |seed, log| session(seed, true, log), ..ANY_HOST };

const MS: Duration = Duration::from_millis(1);
/// No frame takes longer.
const LIMIT: Duration = Duration::from_secs(20);
const CUT: u16 = 0x0101;
/// Instructions in a frame.
const BATCH: u32 = 7;
/// The instructions from here on are not commanded: they are in the middle of other frames.
const INNER: u32 = 1 << 24;

/// A fault of a transmission, with its position.
#[derive(Debug, Clone, Copy)]
pub enum Fault {
    /// The port stops before this byte for this long.
    Pause(usize, Duration),
    /// These bits of the byte are inverted.
    Flip(usize, u8),
}

/// The index of a host's instruction.
#[derive(Debug)]
struct Cut(u32);

impl TryFrom<Instruction<'_>> for Cut {
    type Error = ();

    fn try_from(mut instruction: Instruction<'_>) -> Result<Self, ()> {
        let Some(Ok(Item::I16(index))) = instruction.parameters.next() else { return Err(()) };
        let [low, high] = index.array().ok_or(())?.map(i16::cast_unsigned);
        Ok(Self(u32::from(high) << 16 | u32::from(low)))
    }
}

/// The article's host, its port, and the controller.
#[derive(Debug)]
pub struct Article {
    now: Duration,
    byte_time: Duration,
    /// The time in which an answer is read and acted on.
    late: Duration,
    busy_until: Duration,
    port: VecDeque<(Duration, u8)>,
    port_free_at: Duration,
    answers: VecDeque<(Duration, Vec<u8>)>,
    answers_free_at: Duration,
    controller: Controller<'static, Cut>,
    reader: Reader<'static, Cut>,
    /// The instructions that were executed.
    pub executed: Vec<u32>,
    /// The number of transmissions of frames.
    pub transmissions: u32,
    /// Flips and pauses.
    pub faults: FaultCounts,
}

impl Article {
    /// Creates a host and a controller on a line of this rate.
    pub fn new(baud: u32, late: Duration) -> Self {
        let (writer, reader) = robot_work_queue::boxed(21, 9999).unwrap();
        let mut controller = Controller::new(ControllerConfig::default(), writer).unwrap();
        controller.handle_connected(Duration::ZERO);
        Self {
            now: Duration::ZERO,
            byte_time: timing::transmission_time(1, baud),
            late,
            busy_until: Duration::ZERO,
            port: VecDeque::new(),
            port_free_at: Duration::ZERO,
            answers: VecDeque::new(),
            answers_free_at: Duration::ZERO,
            controller,
            reader,
            executed: Vec::new(),
            transmissions: 0,
            faults: FaultCounts::default(),
        }
    }

    /// Sends seven cuts until they are confirmed; each transmission meets the next faults, until there are no more. Returns
    /// whether they were confirmed.
    pub fn exchange(&mut self, first: u32, faults: &[&[Fault]]) -> bool {
        let frame = frame(first..first + BATCH);
        let limit = self.now + LIMIT;
        let mut faults = faults.iter().copied();
        self.transmit(&frame, faults.next().unwrap_or_default());
        loop {
            let arrival = self.answers.front().map(|(at, _)| self.busy_until.max(*at + self.late));
            let next = [self.port.front().map(|(at, _)| *at), self.controller.poll_timeout(), arrival];
            let Some(next) = next.into_iter().flatten().min().filter(|next| *next < limit) else {
                return false;
            };
            self.now = next.max(self.now);
            self.control();
            if arrival.is_none_or(|at| at > self.now) {
                continue;
            }
            let Some((_, answer)) = self.answers.pop_front() else { return false };
            self.busy_until = self.now;
            if word(&answer) == CUT {
                return true;
            }
            self.transmit(&frame, faults.next().unwrap_or_default());
        }
    }

    /// Puts bytes on the line.
    pub fn transmit(&mut self, bytes: &[u8], faults: &[Fault]) {
        self.transmissions += 1;
        let mut at = self.port_free_at.max(self.now);
        for (index, byte) in bytes.iter().enumerate() {
            let mut byte = *byte;
            for fault in faults {
                match *fault {
                    Fault::Pause(place, pause) if place == index => {
                        self.faults.stalls += 1;
                        at += pause;
                    }
                    Fault::Flip(place, bits) if place == index => {
                        self.faults.flips += 1;
                        byte ^= bits;
                    }
                    Fault::Pause(..) | Fault::Flip(..) => {}
                }
            }
            at += self.byte_time;
            self.port.push_back((at, byte));
        }
        self.port_free_at = at;
    }

    /// Runs the controller until now.
    fn control(&mut self) {
        while let Some((at, byte)) = self.port.front().copied()
            && at <= self.now
        {
            self.port.pop_front();
            self.controller.handle_input(self.now, &[byte]);
        }
        self.controller.handle_timeout(self.now);
        let mut out = [0; 64];
        while let Some(length) = self.controller.poll_transmit(self.now, &mut out) {
            self.answers_free_at = self.answers_free_at.max(self.now) + self.byte_time * length as u32;
            self.answers.push_back((self.answers_free_at, out[..length].to_vec()));
        }
        while self.controller.poll_event().is_some() {}
        while let Some(job) = self.reader.take() {
            self.executed.push(job.complete().0);
        }
    }

    /// Lets everything that is under way arrive; returns the number of answers that were not read.
    pub fn settle(&mut self) -> usize {
        let end = self.port_free_at.max(self.now) + 1000 * MS;
        while self.now < end {
            self.now += MS;
            self.control();
        }
        core::mem::take(&mut self.answers).len()
    }
}

/// Returns the frame of these cuts.
pub fn frame(cuts: core::ops::Range<u32>) -> Vec<u8> {
    let mut payload = Vec::new();
    for index in cuts {
        payload.extend([0xF1, 1]);
        payload.extend(CUT.to_le_bytes());
        payload.extend([0xF1, 2]);
        payload.extend(index.to_le_bytes());
        payload.extend([0xF0, 1]);
        payload.extend((index as f32 * 0.25).to_le_bytes());
    }
    envelope(&payload)
}

fn envelope(payload: &[u8]) -> Vec<u8> {
    let sum = payload.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    let mut out = vec![0xEB, 0x90, 0x82, 0xF0];
    for byte in payload {
        out.push(*byte);
        out.extend((*byte == 0x90).then_some(*byte));
    }
    out.extend([0x90, 0x82, sum]);
    out
}

/// Returns the word of an answer: words in use do not contain 90h.
fn word(answer: &[u8]) -> u16 {
    let [0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, low, high, 0x90, 0x82, _] = *answer else {
        panic!("{answer:02X?}")
    };
    u16::from_le_bytes([low, high])
}

/// Returns a frame with another one among its parameters, and a byte of its middle lost: the other is found.
fn nested(rng: &mut Rng) -> Vec<u8> {
    let inner = frame(INNER..INNER + 1);
    // Without its tail and check: those of the outer frame are taken for them.
    let hidden = &inner[..inner.len() - 3];
    let mut payload = vec![0xF1, 1, 1, 2, 0xF2, hidden.len() as u8];
    payload.extend(hidden);
    let mut outer = envelope(&payload);
    let head = outer.windows(2).position(|pair| pair == [0x90, 0x90]).unwrap_or_default();
    outer.remove(head);
    let (last, from) = (outer.len() - 1, inner[inner.len() - 1]);
    outer[last] = from;
    if rng.chance(0.3) {
        outer[rng.below(4)] ^= 1 << rng.below(8);
    }
    outer
}

/// Returns random bytes: good frames, and bytes that are not frames.
fn anything(rng: &mut Rng, next: u32) -> Vec<u8> {
    let mut bytes = frame(next..next + 1 + rng.below(7) as u32);
    match rng.below(6) {
        0 => {}
        1 => bytes.truncate(rng.below(bytes.len())),
        2 => drop(bytes.drain(..rng.below(bytes.len()))),
        3 => bytes = (0..rng.below(300)).map(|_| rng.next_u64() as u8).collect(),
        4 => bytes = nested(rng),
        _ => {
            let at = rng.below(bytes.len());
            bytes[at] ^= 1 << rng.below(8);
        }
    }
    bytes
}

fn session(seed: u64, is_hostile: bool, log: Log) -> Tally {
    let mut rng = Rng::new(!seed);
    let mut article = Article::new([9600, 115_200][rng.below(2)], MS * rng.below(300) as u32);
    let (mut ledger, mut tally, mut base) = (Ledger::default(), Tally::default(), 0);
    if is_hostile {
        // Its frames are not counted: it has asked for them as often as they were executed.
        for index in 0..20 + rng.below(60) as u32 {
            let bytes = anything(&mut rng, index * BATCH);
            base = (index + 1) * BATCH;
            article.transmit(&bytes, &[]);
            article.now = article.port_free_at + [Duration::ZERO, MS * 20, MS * 80][rng.below(3)];
            article.control();
        }
        article.settle();
        let invented = article.executed.iter().filter(|cut| **cut >= base).count();
        tally.invented += invented as u64;
        article.executed.clear();
        // A frame without its head is not answered after an error code: one that is taken comes first.
        article.busy_until = article.now;
        tally.stuck = u64::from(!article.exchange(base, &[]));
        article.executed.clear();
        base += BATCH;
    }
    for first in (base..base + 20 * BATCH).step_by(BATCH as usize) {
        for _ in 0..BATCH {
            ledger.send(Mark::default());
        }
        let length = frame(first..first + BATCH).len();
        let mut transmission = |from| {
            let mut pause = || Fault::Pause(from + rng.below(length - from), MS * rng.below(400) as u32);
            vec![pause(), pause()]
        };
        // A truncated head after the rest of another frame is not seen to begin a frame.
        let (mut corrupt, again) = (transmission(1), transmission(3));
        if rng.chance(0.5) {
            let place = if rng.chance(0.5) { rng.below(4) } else { rng.below(length) };
            corrupt.push(Fault::Flip(place, 1 << rng.below(8)));
        }
        if tally.stuck > 0 || !article.exchange(first, &[&corrupt, &again]) {
            log.line(article.now, format_args!("!!! the cuts from {first} on are not confirmed"));
            tally.stuck = 1;
            break;
        }
        for cut in first..first + BATCH {
            ledger.report((cut - base) as usize, Reported::Done, Mark::default());
        }
    }
    article.settle();
    for cut in &article.executed {
        log.line(article.now, format_args!("  executed: {cut}"));
        if cut.checked_sub(base).is_none_or(|cut| !ledger.execute(cut as usize)) {
            tally.invented += 1;
        }
    }
    ledger.settle(article.now, log, &mut tally, |_| false);
    tally.faults = article.faults;
    tally
}
