//! The article's own host against our controller: it repeats a frame for each error code, and frames have no number. Nothing here is
//! written or read with the crate's codec.

use core::time::Duration;
use std::collections::VecDeque;

use laser_eb90::robot_session::Session as _;
use laser_eb90::{Controller, Profile, timing};
use robot_work_queue::Reader;
use testkit::rng::Rng;

use crate::cell::{CUT, Cut, MS, controller};

const HEAD: [u8; 3] = [0xEB, 0x90, 0x82];

/// Whatever happens, no frame takes longer.
const LIMIT: Duration = Duration::from_secs(20);

/// What happens to one transmission of a frame: a place, and what happens there.
#[derive(Debug, Clone, Copy)]
enum Fault {
    /// The port stops before this byte for so long.
    Pause(usize, Duration),
    /// The byte arrives with these bits inverted.
    Flip(usize, u8),
}

/// A host that keeps a backup until the echo has come (§3(4)), and the controller.
struct Article {
    now: Duration,
    byte_time: Duration,
    /// How long it takes to read an answer and to act on it.
    late: Duration,
    busy_until: Duration,
    port: VecDeque<(Duration, u8)>,
    port_free_at: Duration,
    answers: VecDeque<(Duration, Vec<u8>)>,
    answers_free_at: Duration,
    controller: Controller<'static, Cut>,
    reader: Reader<'static, Cut>,
    executed: Vec<u32>,
    transmissions: u32,
}

impl Article {
    fn new(baud: u32, late: Duration) -> Self {
        let (controller, reader) = controller(Profile::default());
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

    /// Sends seven cuts until they are confirmed; each transmission meets the next faults, and none when there are no more.
    fn exchange(&mut self, first: u32, faults: &[&[Fault]]) {
        let frame = frame(first);
        let limit = self.now + LIMIT;
        let mut faults = faults.iter().copied();
        self.transmit(&frame, faults.next().unwrap_or_default());
        loop {
            let arrival = self.answers.front().map(|(at, _)| self.busy_until.max(*at + self.late));
            let next = [self.port.front().map(|(at, _)| *at), self.controller.poll_timeout(), arrival];
            self.now = next.into_iter().flatten().min().expect("nothing can happen").max(self.now);
            assert!(self.now < limit, "it is not confirmed");
            self.control();
            if arrival.is_none_or(|at| at > self.now) {
                continue;
            }
            let (_, answer) = self.answers.pop_front().unwrap();
            self.busy_until = self.now;
            match word(&answer) {
                CUT => return,
                0xE001 | 0xE002 => self.transmit(&frame, faults.next().unwrap_or_default()),
                other => panic!("{other:04X}h"),
            }
        }
    }

    fn transmit(&mut self, frame: &[u8], faults: &[Fault]) {
        self.transmissions += 1;
        let mut at = self.port_free_at.max(self.now);
        for (index, byte) in frame.iter().enumerate() {
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

    /// What the controller does by now.
    fn control(&mut self) {
        while let Some((_, byte)) = self.port.pop_front_if(|(at, _)| *at <= self.now) {
            self.controller.handle_input(self.now, &[byte]);
        }
        self.controller.handle_timeout(self.now);
        let mut out = [0; 64];
        while let Some(length) = self.controller.poll_transmit(self.now, &mut out) {
            let length = u32::try_from(length).unwrap();
            self.answers_free_at = self.answers_free_at.max(self.now) + self.byte_time * length;
            self.answers.push_back((self.answers_free_at, out[..length as usize].to_vec()));
        }
        while self.controller.poll_event().is_some() {}
        while let Some(job) = self.reader.take() {
            self.executed.push(job.complete().index);
        }
    }

    /// Lets everything that is under way arrive.
    fn settle(&mut self) {
        for _ in 0..1000 {
            self.now += MS;
            self.control();
        }
        assert!(self.answers.is_empty(), "an answer that nobody asked for: {:02X?}", self.answers);
    }
}

/// Seven cuts from this one on.
fn frame(first: u32) -> Vec<u8> {
    let mut payload = Vec::new();
    for index in first..first + 7 {
        payload.extend([0xF1, 1]);
        payload.extend(CUT.to_le_bytes());
        payload.extend([0xF1, 2]);
        payload.extend(index.to_le_bytes());
        payload.extend([0xF0, 1]);
        payload.extend((index as f32 * 0.25).to_le_bytes());
    }
    let sum = payload.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte));
    let mut out = HEAD.to_vec();
    out.push(0xF0);
    for byte in payload {
        out.push(byte);
        out.extend((byte == 0x90).then_some(byte));
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
                for place in 1..frame(first).len() {
                    article.exchange(first, &[&[Fault::Pause(place, MS * pause)]]);
                    first += 7;
                    frames += 1;
                }
            }
            article.settle();
            assert_once(&article, first, &format!("{baud} baud, {late} ms late"));
        }
    }
    assert!(frames > 10_000, "{frames} frames");
}

/// The first transmission is corrupt in one byte, perhaps of its head, and all of them pause, perhaps twice. The others not within
/// the head: when it is cut there, and the rest of the frame before is in front of it, nothing shows that a frame has begun.
#[test]
fn a_frame_that_is_corrupt_and_pauses_is_executed_once() {
    let (mut rng, mut transmissions) = (Rng::new(90), 0);
    for run in 0..500 {
        let baud = [9600, 115_200][run % 2];
        let mut article = Article::new(baud, MS * rng.below(300) as u32);
        for frame_index in 0..20 {
            let first = frame_index * 7;
            let length = frame(first).len();
            let mut pauses = |from| {
                let mut pause = || Fault::Pause(from + rng.below(length - from), MS * rng.below(400) as u32);
                vec![pause(), pause()]
            };
            let (mut corrupt, again, last) = (pauses(1), pauses(3), pauses(3));
            let place = if rng.chance(0.5) { rng.below(4) } else { rng.below(length) };
            corrupt.push(Fault::Flip(place, 1 << rng.below(8)));
            article.exchange(first, &[&corrupt, &again, &last[..1]]);
        }
        article.settle();
        assert_once(&article, 140, &format!("run {run}"));
        transmissions += article.transmissions;
    }
    assert!(transmissions > 25_000, "{transmissions} transmissions");
}
