//! A controller of another maker and keeps the source's rules: LE-5, LE-25, LE-72, LE-102 and LE-103.
//!
//! It refuses any frame, keeps the first half of a frame or drops it and answers each half, executes for a while, and
//! sometimes does not answer.

use core::time::Duration;
use std::collections::VecDeque;

use laser_eb90::robot_session::{Decoder as _, Encode as _};
use laser_eb90::{Class, Decoder, Frame, Instruction, Instructions, Payload, Profile, Refusal, Words};

use super::Marked;
use crate::Carrier;
use crate::link::{Delivery, End};
use robot_session::contract::Rng;

/// The longest until corrupt bytes are judged, from a decision to its answer, and of an execution.
pub(super) const SILENCE: Duration = Duration::from_millis(80);
pub(super) const DELAY: Duration = Duration::from_millis(25);
pub(super) const EXECUTION: Duration = Duration::from_millis(300);

pub(super) struct AnyController {
    pub(super) drops: bool,
    silence: Duration,
    decoder: Decoder,
    /// The time at which it judges the bytes that have arrived.
    silent_at: Option<Duration>,
    fault: Option<Refusal>,
    answers: VecDeque<(Duration, Vec<u8>)>,
}

impl AnyController {
    pub(super) fn new(drops: bool, rng: &mut Rng) -> Self {
        let decoder = Decoder::new(&Profile::default());
        let silence = SILENCE.mul_f64(0.2 + 0.8 * rng.unit());
        Self { drops, silence, decoder, silent_at: None, fault: None, answers: VecDeque::new() }
    }

    pub(super) fn next(&self) -> Option<Duration> {
        self.answers.iter().map(|(at, _)| *at).chain(self.silent_at).min()
    }

    /// Runs the controller for a turn; returns the instructions that it executes.
    pub(super) fn turn(
        &mut self,
        line: &mut impl Carrier,
        now: Duration,
        is_calm: bool,
        rng: &mut Rng,
    ) -> Vec<Marked> {
        let mut taken = Vec::new();
        while let Some(delivery) = line.receive(End::B, now, usize::MAX) {
            let Delivery::Bytes(bytes) = delivery else { continue };
            let mut rest = bytes.as_slice();
            while !rest.is_empty() {
                rest = &rest[self.decoder.push(rest)..];
                self.read(now, is_calm, &mut taken, rng);
            }
            self.silent_at = Some(now + self.silence);
        }
        if self.silent_at.take_if(|at| *at <= now).is_some() {
            if !self.decoder.is_empty() {
                self.fault = Some(Refusal::BadFrame);
            }
            if self.drops {
                self.decoder.clear();
            }
            if let Some(fault) = self.fault.take() {
                self.answer(now, Err(fault), is_calm, rng);
            }
        }
        while self.answers.front().is_some_and(|(at, _)| *at <= now)
            && let Some((_, answer)) = self.answers.pop_front()
        {
            line.send(End::B, now, &answer);
        }
        taken
    }

    fn read(&mut self, now: Duration, is_calm: bool, taken: &mut Vec<Marked>, rng: &mut Rng) {
        loop {
            let mut marked = Vec::new();
            let verdict = match self.decoder.next_frame() {
                None => return,
                Some(Err(error)) => {
                    let is_sum = matches!(error, laser_eb90::DecodeError::Checksum { .. });
                    self.fault = Some(if is_sum { Refusal::BadChecksum } else { Refusal::BadFrame });
                    continue;
                }
                Some(Ok(frame)) => judge(&frame, &mut marked),
            };
            self.fault = None;
            let refusals = [
                Refusal::BadChecksum,
                Refusal::BadFrame,
                Refusal::QueueFull,
                Refusal::UnknownCommand,
                Refusal::BadParameters,
            ];
            let (Ok((class, word)), true) = (verdict, is_calm || rng.chance(0.8)) else {
                let refusal = verdict.err().unwrap_or(refusals[rng.below(5)]);
                self.answer(now, Err(refusal), is_calm, rng);
                continue;
            };
            taken.append(&mut marked);
            let is_executed = class != Class::Interpreted;
            let end = if is_executed { now + EXECUTION.mul_f64(rng.unit()) } else { now };
            let fails = !is_calm && class == Class::Immediate && rng.chance(0.1);
            let answer = if fails { Err(Refusal::BadParameters) } else { Ok((class, word)) };
            self.answer(end, answer, is_calm, rng);
        }
    }

    fn answer(
        &mut self,
        from: Duration,
        answer: Result<(Class, u16), Refusal>,
        is_calm: bool,
        rng: &mut Rng,
    ) {
        if !is_calm && rng.chance(0.05) {
            return;
        }
        let (profile, mut buffer, mut out) = (Profile::default(), [0; 64], [0; Frame::MAX_LEN]);
        let mut payload = Payload::new(&mut buffer, &profile);
        let word = answer.map_or_else(|refusal| Words::default().errors().code(refusal), |(_, word)| word);
        payload.word(word).unwrap();
        if let Ok((Class::Query, _)) = answer {
            payload.f32(&[0.5]).unwrap();
        }
        let n = payload.frame().unwrap().encode(&mut out).unwrap();
        let at = (from + DELAY.mul_f64(rng.unit())).max(self.answers.back().map_or(from, |(at, _)| *at));
        self.answers.push_back((at, out[..n].to_vec()));
    }
}

/// Returns the class and the word of a frame, and its instructions.
fn judge(frame: &Frame<'_>, marked: &mut Vec<Marked>) -> Result<(Class, u16), Refusal> {
    let items = frame.items();
    let first = Instruction::single(items).map_err(|_| Refusal::BadFrame)?;
    let class = Words::default().class(first.word).ok_or(Refusal::UnknownCommand)?;
    if class == Class::Interpreted {
        for instruction in Instructions::new(items) {
            let instruction = instruction.map_err(|_| Refusal::BadFrame)?;
            marked.push(Marked::try_from(instruction).map_err(|()| Refusal::BadParameters)?);
        }
    } else {
        marked.push(Marked::try_from(first).map_err(|()| Refusal::BadParameters)?);
    }
    Ok((class, first.word))
}
