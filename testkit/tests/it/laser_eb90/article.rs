//! The article's own host against our controller: it repeats a frame for each error code, and frames have no number.
//! Nothing here is written or read with the crate's codec.

use core::time::Duration;
use std::collections::VecDeque;

use laser_eb90::{Controller, ControllerConfig, Instruction, Item, timing};
use robot_session::Session as _;
use robot_session::contract::Rng;
use robot_work_queue::Reader;

const MS: Duration = Duration::from_millis(1);
/// No frame takes longer.
const LIMIT: Duration = Duration::from_secs(20);
const CUT: u16 = 0x0101;
/// Instructions in a frame.
const BATCH: u32 = 7;

/// A fault of a transmission, with its position.
#[derive(Debug, Clone, Copy)]
enum Fault {
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
struct Article {
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
    executed: Vec<u32>,
    /// The number of transmissions of frames.
    transmissions: u32,
}

impl Article {
    /// A host and a controller on a line of this rate.
    fn new(baud: u32, late: Duration) -> Self {
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
        }
    }

    /// Sends seven cuts until they are confirmed; returns whether they were. Each transmission has the next faults, or
    /// no faults after the last.
    fn exchange(&mut self, first: u32, faults: &[&[Fault]]) -> bool {
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
    fn transmit(&mut self, bytes: &[u8], faults: &[Fault]) {
        self.transmissions += 1;
        let mut at = self.port_free_at.max(self.now);
        for (index, byte) in bytes.iter().enumerate() {
            let mut byte = *byte;
            for fault in faults {
                match *fault {
                    Fault::Pause(place, pause) if place == index => at += pause,
                    Fault::Flip(place, bits) if place == index => byte ^= bits,
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
    fn settle(&mut self) -> usize {
        let end = self.port_free_at.max(self.now) + 1000 * MS;
        while self.now < end {
            self.now += MS;
            self.control();
        }
        core::mem::take(&mut self.answers).len()
    }
}

/// The frame of these cuts.
fn frame(cuts: core::ops::Range<u32>) -> Vec<u8> {
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

/// The word of an answer: none of those that are used holds a 90h.
fn word(answer: &[u8]) -> u16 {
    let [0xEB, 0x90, 0x82, 0xF0, 0xF1, 1, low, high, 0x90, 0x82, _] = *answer else {
        panic!("{answer:02X?}")
    };
    u16::from_le_bytes([low, high])
}

/// Each of the cuts is executed once.
fn assert_once(article: &Article, cuts: u32, what: &str) {
    let mut times = vec![0; cuts as usize];
    article.executed.iter().for_each(|index| times[*index as usize] += 1);
    let wrong: Vec<_> = (0..cuts).zip(times).filter(|(_, times)| *times != 1).collect();
    assert!(wrong.is_empty(), "{what}: {} of {cuts} not once: {:?} …", wrong.len(), &wrong[..1]);
}

/// A pause before every byte of the frame but its first.
#[test]
fn a_frame_that_pauses_is_executed_once() {
    let mut frames = 0;
    for baud in [9600, 115_200] {
        for late in [0, 100, 200, 300] {
            let mut article = Article::new(baud, MS * late);
            let mut first = 0;
            for pause in [40, 51, 60, 80, 100, 150, 200, 250, 300, 350, 400] {
                for place in 1..frame(first..first + 7).len() {
                    assert!(article.exchange(first, &[&[Fault::Pause(place, MS * pause)]]));
                    first += 7;
                    frames += 1;
                }
            }
            assert_eq!(article.settle(), 0, "an unsolicited answer");
            assert_once(&article, first, &format!("{baud} baud, {late} ms late"));
        }
    }
    assert!(frames > 10_000, "{frames} frames");
}

/// The first transmission is corrupt in one byte, perhaps of its head, and all of them pause, perhaps twice. The others not
/// within the head: when it is cut there, and the rest of the frame before is in front of it, nothing shows that a frame has
/// begun.
#[test]
fn a_frame_that_is_corrupt_and_pauses_is_executed_once() {
    let (mut rng, mut transmissions) = (Rng::new(90), 0);
    for run in 0..500 {
        let baud = [9600, 115_200][run % 2];
        let mut article = Article::new(baud, MS * rng.below(300) as u32);
        for frame_index in 0..20 {
            let first = frame_index * 7;
            let length = frame(first..first + 7).len();
            let mut pauses = |from| {
                let mut pause = || Fault::Pause(from + rng.below(length - from), MS * rng.below(400) as u32);
                vec![pause(), pause()]
            };
            let (mut corrupt, again, last) = (pauses(1), pauses(3), pauses(3));
            let place = if rng.chance(0.5) { rng.below(4) } else { rng.below(length) };
            corrupt.push(Fault::Flip(place, 1 << rng.below(8)));
            assert!(article.exchange(first, &[&corrupt, &again, &last[..1]]));
        }
        assert_eq!(article.settle(), 0, "an unsolicited answer");
        assert_once(&article, 140, &format!("run {run}"));
        transmissions += article.transmissions;
    }
    assert!(transmissions > 25_000, "{transmissions} transmissions");
}
