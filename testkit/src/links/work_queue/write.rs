//! The acts of the writer, each a single load or store.

use super::queue::{Act, Queue};
use super::rule::Rule;
use super::state::{Mark, State, Writing, after};

impl Queue {
    pub(super) fn writer_acts(&self, state: &State, acts: &mut Vec<Act>) {
        match state.writer.phase {
            Writing::Ready => {
                acts.push(Act::Claim);
                acts.extend((1..=self.capacity.max(2)).map(Act::Batch));
                acts.extend([Act::Clear, Act::Reset, Act::WriterLeaves]);
                if !self.single && state.mark.at < 0 {
                    acts.push(Act::Renew);
                }
            }
            Writing::Claimed => {
                acts.extend([Act::Commit, Act::DropClaim, Act::CommitWrong]);
                acts.extend(state.last_number(self.max).map(|_| Act::CommitRepeated));
            }
            Writing::Batch { slots, filled } => {
                let more = u8::from(!self.keeps(Rule::BatchLooksForSpace));
                if filled < slots + more {
                    acts.push(Act::Fill);
                }
                acts.extend([Act::Publish, Act::DropBatch]);
                if !self.single && state.mark.at < 0 {
                    acts.push(Act::Renew);
                }
            }
            Writing::Renewing { .. } => acts.push(Act::Renew),
            Writing::Storing => acts.push(Act::Commit),
            Writing::Marking => acts.push(Act::Clear),
            Writing::Leaving { .. } => acts.push(Act::WriterLeaves),
            Writing::Gone => {}
        }
    }

    pub(super) fn write(&self, state: &mut State, act: Act) -> &'static str {
        let (tail, next, last) = (state.tail, state.writer.next, state.last_number(self.max));
        match (act, state.writer.phase) {
            (Act::Claim, _) => {
                if tail == state.writer.end {
                    state.writer.end = self.capacity + u8::from(!self.keeps(Rule::ClaimLooksForSpace));
                }
                if tail == state.writer.end {
                    return "Full";
                }
                state.writer.phase = Writing::Claimed;
            }
            (Act::DropClaim, _) => state.writer.phase = Writing::Ready,
            (Act::Batch(slots), _) => {
                if state.writer.end - tail < slots {
                    state.writer.end = self.capacity;
                }
                if state.writer.end - tail < slots {
                    return "Full";
                }
                state.writer.phase = Writing::Batch { slots, filled: 0 };
            }
            (Act::Fill, Writing::Batch { slots, filled }) => {
                state.fill(tail + filled, after(next, filled, self.max));
                state.writer.phase = Writing::Batch { slots, filled: filled + 1 };
            }
            (Act::Publish, Writing::Batch { filled, .. }) => {
                state.publish(filled, self.max);
                state.writer.phase = Writing::Ready;
            }
            (Act::DropBatch, Writing::Batch { filled, .. }) => {
                if self.keeps(Rule::DroppedBatchIsEmptied) {
                    state.empty(tail, filled);
                }
                state.writer.phase = Writing::Ready;
            }
            (Act::Commit, Writing::Storing) => {
                state.tail -= 1;
                state.fill(tail - 1, next);
                state.publish(1, self.max);
                state.writer.phase = Writing::Ready;
            }
            (Act::Commit, _) if !self.keeps(Rule::TailAfterJob) => {
                state.tail += 1;
                state.writer.phase = Writing::Storing;
            }
            (Act::Commit | Act::CommitRepeated | Act::CommitWrong, _) => {
                state.writer.phase = Writing::Ready;
                let number = match act {
                    Act::Commit => next,
                    Act::CommitRepeated => last.unwrap_or(0),
                    _ => next + 1,
                };
                if number != next && self.keeps(Rule::NumberIsChecked) {
                    return if Some(number) == last { "Repeated" } else { "Unexpected" };
                }
                state.fill(tail, number);
                state.publish(1, self.max);
            }
            (Act::Renew, Writing::Renewing { mark, batch }) => {
                state.mark = mark;
                state.writer.phase =
                    batch.map_or(Writing::Ready, |(slots, filled)| Writing::Batch { slots, filled });
            }
            (Act::Renew, phase) => {
                // As many numbers before the next one as jobs are queued, none of which a reset came after.
                let queued = if self.keeps(Rule::RenewedMarkNumbersHead) { tail } else { 0 };
                let number = after(next, self.max * self.capacity - queued, self.max);
                let batch =
                    if let Writing::Batch { slots, filled } = phase { Some((slots, filled)) } else { None };
                state.writer.phase = Writing::Renewing { mark: Mark { at: 0, number }, batch };
            }
            (Act::Clear | Act::Reset, phase) => {
                if act == Act::Reset {
                    (state.writer.next, state.writer.wrapped) = (1, false);
                }
                state.mark.number = state.writer.next;
                if phase == Writing::Ready && !self.keeps(Rule::MarkIsOneWord) {
                    state.writer.phase = Writing::Marking;
                    return "";
                }
                state.mark.at = tail.cast_signed();
                state.clear(self.without);
                state.writer.phase = Writing::Ready;
            }
            (Act::WriterLeaves, Writing::Ready) if !self.keeps(Rule::LeavingIsOneStep) => {
                state.writer.phase = Writing::Leaving { is_second: state.abandoned };
            }
            (Act::WriterLeaves, phase) => {
                let is_second =
                    if let Writing::Leaving { is_second } = phase { is_second } else { state.abandoned };
                state.writer.phase = Writing::Gone;
                return state.leave(is_second);
            }
            (act, phase) => unreachable!("{act:?} while {phase:?}"),
        }
        ""
    }
}
