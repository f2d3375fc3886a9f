//! The messages that a PC may send.

use kawasaki_msg::FromPc;
use kawasaki_msg::robot::machine::{Cycle, Link, Machine, Order};

use super::super::text::Held;
use super::world::{Asked, Knowledge, Letter, SentMessage, Step};
use super::{AnyPc, Behaviour, OTHER, OURS};

use Letter::Nothing as N;

impl AnyPc {
    /// Returns a message; `from`: the requested job.
    pub(super) fn sent(&self, letter: Letter, from: u8) -> SentMessage {
        let job = |order, offset: i8, good| {
            let index = from.wrapping_add_signed(offset);
            SentMessage { message: Some(FromPc::Job { order, number: self.number(index), good }), job: index }
        };
        let plain = |message| SentMessage { message: Some(message), job: 0 };
        match letter {
            N | Letter::Filler => plain(FromPc::Filler),
            Letter::Start => plain(FromPc::Start { order: OURS, first: 1 }),
            Letter::OtherStart => plain(FromPc::Start { order: OTHER, first: 1 }),
            Letter::End => {
                let job = if self.is_free() { 0 } else { self.jobs };
                SentMessage { job, ..plain(FromPc::End { order: OURS }) }
            }
            Letter::Interrupt => plain(FromPc::Interrupt { order: OURS }),
            Letter::Job(offset) => job(OURS, offset, true),
            Letter::OtherOrder => job(OTHER, 0, true),
            Letter::BadJob => job(OURS, 0, false),
            Letter::OtherStatus => plain(FromPc::Status { order: OTHER }),
            Letter::Corrupt => SentMessage { message: None, job: 0 },
        }
    }

    /// Appends the answers of a PC that follows the rules.
    pub(super) fn answers(&self, known: &Knowledge, asked: Asked, steps: &mut Vec<Step>) {
        let Behaviour::Lossy { insists, only_late } = self.behaviour else { return };
        if known.faults > 0 {
            steps.push(Step::Answer([N; 3]));
        }
        let Some(from) = asked.from else {
            let letter = match (asked.accepted, insists && known.sent_all) {
                (true, true) => Letter::End,
                (true, false) => Letter::Filler,
                (false, _) => Letter::Start,
            };
            steps.push(Step::Answer([letter, N, N]));
            return;
        };
        let one = [Letter::Job(0), N, N];
        let packets = match self.jobs - from {
            0 => vec![[Letter::End, N, N]],
            1 => vec![[Letter::Job(0), Letter::End, N], one],
            2 => vec![[Letter::Job(0), Letter::Job(1), Letter::End], one],
            _ => vec![[Letter::Job(0), Letter::Job(1), Letter::Job(2)], one],
        };
        for packet in packets {
            steps.push(Step::Answer(packet));
            for at in (0..3).filter(|at| known.faults > 0 && !only_late && packet[*at] != N) {
                let mut bad = packet;
                bad[at] = Letter::Corrupt;
                steps.push(Step::Answer(bad));
            }
        }
    }

    /// Returns the messages of a PC with any behaviour.
    pub(super) fn letters(&self, end: &Machine, known: &Knowledge) -> Vec<Letter> {
        let (next, any) = (known.next, self.behaviour == Behaviour::Any);
        let mut letters =
            vec![Letter::Filler, Letter::Corrupt, Letter::OtherOrder, Letter::Start, Letter::OtherStatus];
        let mut may = |may: bool, letter| {
            if may {
                letters.push(letter);
            }
        };
        may(end.order != Order::Idle, Letter::OtherStart);
        may(next > 0, Letter::Job(-1));
        may(next + 1 < self.jobs, Letter::Job(1));
        may(next < self.jobs, Letter::BadJob);
        may(next < self.jobs && any, Letter::Job(0));
        may(any, Letter::End);
        may(any, Letter::Interrupt);
        letters
    }

    /// Returns whether the PC takes this step if it keeps the rules and the line has no faults.
    pub(super) fn is_obliging(&self, end: &Machine, known: &Knowledge, step: Step) -> bool {
        let next = |asked: u8| if asked < self.jobs { Letter::Job(0) } else { Letter::End };
        match (step, known.asked) {
            (Step::Answer(letters), Some(Asked { accepted, from })) => {
                let letter = from.map_or(if accepted { Letter::Filler } else { Letter::Start }, next);
                letters[0] == letter || accepted && letters == [Letter::End, N, N]
            }
            (Step::Again | Step::Rest, _) => true,
            (Step::Say(letter), _) => {
                let expected = match end.order {
                    Order::Idle => Letter::Start,
                    Order::Active { number: OURS, .. } => next(known.next),
                    Order::Active { .. } => Letter::End,
                };
                let withheld = expected == Letter::Job(0) && self.behaviour == Behaviour::Withholds;
                let is_awaited =
                    matches!(end.link, Link::Connected { cycle: Cycle::Waiting { answered: false, .. }, .. });
                is_awaited
                    && known.held != Held::Half
                    && letter == if withheld { Letter::Filler } else { expected }
            }
            _ => false,
        }
    }
}
