//! A host that is not ours and keeps the source's rules: AL-53, AL-54 and AL-67.
//!
//! It answers each message once at most, by its kind, with what it likes and when it likes, and sends no exception in an interruption. It
//! judges what became of its replies by the error code of the message that follows (AL-68).

use core::time::Duration;

use robot_session::Decoder as _;
use robot_session::end::End as _;
use val2_alter::timing;
use val2_alter::{
    Decoder, ErrorCode, Exception, Frame, Framing, HostMessage, Message as _, MotionPhase, Reply,
    RobotMessage, StartCode, Unselected,
};

use super::{Cell, MS, exception, values};
use crate::Carrier;
use crate::link::{Delivery, End};
use crate::soak::{Mark, Reported};
use robot_session::contract::Rng;

pub(super) struct AnyHost {
    decoder: Decoder<RobotMessage>,
    /// What it sends, and when.
    answer: Option<(Duration, HostMessage)>,
    /// The reply that was sent last has no effect.
    rests: bool,
    /// Until when a message is about the reply that was sent last.
    follows_until: Duration,
}

impl AnyHost {
    pub(super) fn new() -> Self {
        Self {
            decoder: Decoder::new(Framing::DEFAULT),
            answer: None,
            rests: false,
            follows_until: Duration::ZERO,
        }
    }

    pub(super) fn next(&self) -> Option<Duration> {
        self.answer.map(|(at, _)| at)
    }
}

impl Cell {
    /// The other host instead of the project's own.
    pub(super) fn answer(&mut self, host: &mut AnyHost, dead: Option<End>, is_calm: bool, rng: &mut Rng) {
        let mark = self.wire.mark();
        while let Some(delivery) = self.wire.receive(End::B, self.now) {
            let Delivery::Bytes(bytes) = delivery else { continue };
            let mut rest = bytes.as_slice();
            while !rest.is_empty() {
                rest = &rest[host.decoder.push(rest)..];
                while let Some(found) = host.decoder.next_frame() {
                    match found {
                        Ok(found) => self.decide(host, found.message, mark, is_calm, rng),
                        Err(_) => host.follows_until = Duration::ZERO,
                    }
                }
            }
        }
        let Some((_, message)) = host.answer.take_if(|(at, _)| *at <= self.now) else { return };
        host.follows_until = Duration::MAX;
        if let HostMessage::Reply(reply) = message {
            let words = reply.values.map(Option::unwrap_or_default);
            let job = (words != [0; 6] || reply.exception != Exception::None).then(|| self.send(words));
            if let Some(job) = job {
                self.log.line(self.now, format_args!("job {job}: {reply:?}"));
            }
            if reply.exception == Exception::None {
                self.reply = job;
            } else {
                self.exceptions.extend(job);
                self.exception = job;
            }
            host.follows_until = self.now + timing::CYCLE;
            self.cause = mark;
        }
        let mut out = [0; Frame::MAX_LEN];
        let len = message.encode(Framing::DEFAULT, &mut out).unwrap_or_default();
        if dead != Some(End::B) {
            Carrier::send(&mut self.wire, End::B, self.now, &out[..len]);
        }
    }

    /// A message has come: what it says of the reply before, and what it is answered.
    fn decide(
        &mut self,
        host: &mut AnyHost,
        message: RobotMessage,
        mark: Mark,
        is_calm: bool,
        rng: &mut Rng,
    ) {
        self.log.line(self.now, format_args!("  host: {message:?}"));
        let follows = self.in_time && self.now < host.follows_until;
        let rests = core::mem::take(&mut host.rests);
        let reported = match message {
            _ if rests && self.in_time => Reported::NotDone,
            RobotMessage::Motion(motion) if motion.error == ErrorCode::None => {
                self.done += usize::from(self.reply.is_some() || self.exception.is_some());
                if follows { Reported::Done } else { Reported::Unknown }
            }
            RobotMessage::Motion(_) if follows => Reported::NotDone,
            RobotMessage::Motion(_) | RobotMessage::Start(_) | RobotMessage::End(_) => Reported::Unknown,
        };
        for job in [self.reply.take(), self.exception.take()].into_iter().flatten() {
            self.ledger.report(job, reported, mark);
        }
        self.cause = if reported == Reported::Unknown { mark } else { self.cause };
        let message = match message {
            RobotMessage::Start(_) => {
                let codes = [StartCode::Accept, StartCode::Accept, StartCode::Repeat, StartCode::Refuse];
                HostMessage::StartReply(codes[if is_calm { 0 } else { rng.below(4) }])
            }
            RobotMessage::Motion(motion) => {
                host.rests = motion.phase == MotionPhase::Interrupted;
                HostMessage::Reply(self.choose(motion.phase, is_calm, rng))
            }
            RobotMessage::End(_) => {
                host.answer = None;
                return;
            }
        };
        let late = if self.in_time || is_calm { 3 } else { 27 };
        let at = self.now + MS.mul_f64(rng.unit()) * late;
        host.answer = Some((at, message)).filter(|_| is_calm || rng.chance(0.97));
    }

    fn choose(&self, phase: MotionPhase, is_calm: bool, rng: &mut Rng) -> Reply {
        // What a word that is left out means is not known.
        let config = self.controller.config();
        let rest = if config.unselected == Unselected::ByMode && rng.chance(0.5) {
            Reply::NOTHING
        } else {
            Reply::all([0; 6])
        };
        match rng.below(10) {
            // An exception is not sent in an interruption, and values have no effect.
            0 if phase == MotionPhase::Running => Reply { exception: exception(self.ledger.len()), ..rest },
            1 | 2 if !is_calm => rest,
            _ => Reply::all(values(self.ledger.len())),
        }
    }
}
