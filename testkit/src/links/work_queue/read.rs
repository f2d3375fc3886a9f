//! The acts of the reader, each a single load or store.

use super::queue::{Act, Queue};
use super::rule::{IN_ORDER, Rule};
use super::state::{Content, Looks, Reading, State, after};

impl Queue {
    pub(super) fn reader_acts(&self, state: &State, acts: &mut Vec<Act>) {
        let reader = &state.reader;
        match reader.phase {
            Reading::Idle => {
                acts.extend([Looks::Take, Looks::Batch, Looks::Find].map(Act::Look));
                acts.extend([Act::List, Act::ReaderLeaves]);
                if !reader.knows_gone {
                    acts.push(Act::AskGone);
                }
            }
            Reading::Finding { .. } | Reading::Listing { .. } => acts.push(Act::Load),
            Reading::Obeying { mark, .. } => {
                let goes_on = !self.keeps(Rule::DiscardEndsAtMark) && reader.end > 0;
                acts.push(match mark.at > 0 || goes_on {
                    true if reader.ahead > 0 && state.slots[0].done => Act::Pass,
                    true => Act::Discard,
                    false => Act::Number,
                });
            }
            Reading::Listed { .. } | Reading::Searching { .. } => acts.push(Act::Search),
            Reading::Asking { .. } => acts.extend([Act::Accept, Act::Reject]),
            Reading::Executing { .. } | Reading::ExecutingBatch { .. } => {
                acts.extend([Act::Complete, Act::GiveUp]);
            }
            Reading::Dropping { row, dropped } => {
                acts.push(if dropped < row { Act::Drop } else { Act::Free });
            }
            Reading::Leaving { .. } => acts.push(Act::ReaderLeaves),
            Reading::Gone => {}
        }
    }

    pub(super) fn read(&self, state: &mut State, act: Act) -> &'static str {
        match (act, state.reader.phase) {
            (Act::Look(by), _) => {
                // If a job is known, the tail is not loaded.
                let is_early = !self.keeps(Rule::TailBeforeMark) && state.reader.end == 0;
                let early = is_early.then_some(state.mark);
                let afresh = by == Looks::Find;
                state.reader.is_current = true;
                state.reader.phase = Reading::Finding { by, afresh, discarded: false, early };
            }
            (Act::Load, Reading::Finding { by, afresh, early, .. }) => {
                if afresh || state.reader.end == 0 {
                    state.reader.end = state.tail;
                    if state.tail == 0 {
                        return self.find_nothing(state);
                    }
                    state.reader.phase = Reading::Finding { by, afresh: false, discarded: false, early };
                    return "";
                }
                state.reader.is_current |= early.is_none();
                let mark = early.unwrap_or(state.mark);
                let obeys = self.keeps(match by {
                    Looks::Take => Rule::TakeObeysMark,
                    Looks::Batch => Rule::BatchObeysMark,
                    Looks::Find => Rule::FindObeysMark,
                });
                if obeys && mark != state.reader.obeyed {
                    state.reader.phase = Reading::Obeying { by, mark };
                } else {
                    self.find(state, by);
                }
            }
            (Act::Discard | Act::Pass | Act::Number, Reading::Obeying { by, mark }) => {
                match act {
                    Act::Discard => state.discard(self.max, self.without),
                    Act::Pass => {
                        state.reader.ahead -= 1;
                        state.free(1, self.max, self.without);
                    }
                    _ => {
                        let numbers = mark.at == 0 || !self.keeps(Rule::PassedMarkIsOnlyNoted);
                        if numbers && self.keeps(Rule::MarkIsRenumbered) {
                            state.reader.number = mark.number;
                        }
                        state.reader.obeyed = mark;
                        state.free(0, self.max, self.without);
                    }
                }
                let discarded = act == Act::Discard;
                state.reader.phase = Reading::Finding { by, afresh: false, discarded, early: None };
            }
            (Act::List, _) => {
                let early = (!self.keeps(Rule::ListTailBeforeMark)).then_some(state.mark);
                state.reader.is_current |= early.is_some();
                state.reader.phase = Reading::Listing { tail: state.tail, early };
            }
            (Act::Load, Reading::Listing { tail, early }) => {
                let tail = if early.is_some() { state.tail } else { tail };
                state.reader.is_current |= early.is_none();
                let mark = early.unwrap_or(state.mark);
                let begins =
                    mark != state.reader.obeyed && mark.at >= 0 && self.keeps(Rule::ListBeginsAtMark);
                let (at, number) =
                    if begins { (mark.at.cast_unsigned(), mark.number) } else { (0, state.reader.number) };
                let end = if self.keeps(Rule::ListEndsAtTail) { tail.max(at) } else { tail };
                state.reader.phase = Reading::Listed { at, end, number };
            }
            (Act::Search, Reading::Listed { at, end, number }) => {
                let Some((at, number)) = self.next(state, at, end, number) else {
                    state.reader.phase = Reading::Idle;
                    return "Nothing";
                };
                state.see(at, number);
                state.reader.phase = Reading::Listed { at: at + 1, end, number: after(number, 1, self.max) };
                return "Job";
            }
            (Act::Search, Reading::Searching { at }) => {
                let number = after(state.reader.number, at, self.max);
                let Some((at, number)) = self.next(state, at, state.reader.end, number) else {
                    state.reader.phase = Reading::Idle;
                    return "Nothing";
                };
                state.see(at, number);
                state.reader.phase = Reading::Asking { at };
            }
            (Act::Accept, Reading::Asking { at }) => self.begin(state, at),
            (Act::Reject, Reading::Asking { at }) => {
                state.reader.phase = Reading::Searching { at: at + 1 };
            }
            (Act::Complete, Reading::Executing { at }) => self.complete(state, at),
            (Act::Complete, Reading::ExecutingBatch { row }) => {
                state.reader.phase = Reading::Dropping { row, dropped: 0 };
                if !self.keeps(Rule::BatchIsFreedAtItsEnd) {
                    state.free(row, self.max, self.without);
                }
            }
            (Act::Drop, Reading::Dropping { row, dropped }) => {
                state.executed(dropped);
                state.reader.phase = Reading::Dropping { row, dropped: dropped + 1 };
            }
            (Act::Free, Reading::Dropping { row, .. }) => {
                state.reader.phase = Reading::Idle;
                state.free(row, self.max, self.without);
            }
            (Act::GiveUp, _) => state.reader.phase = Reading::Idle,
            (Act::AskGone, _) => {
                state.reader.knows_gone = state.abandoned;
                if state.reader.knows_gone && state.reader.found_nothing {
                    state.expect_nothing();
                }
                return if state.abandoned { "Gone" } else { "" };
            }
            (Act::ReaderLeaves, Reading::Idle) if !self.keeps(Rule::LeavingIsOneStep) => {
                state.reader.phase = Reading::Leaving { is_second: state.abandoned };
            }
            (Act::ReaderLeaves, phase) => {
                let is_second =
                    if let Reading::Leaving { is_second } = phase { is_second } else { state.abandoned };
                state.reader.phase = Reading::Gone;
                return state.leave(is_second);
            }
            (act, phase) => unreachable!("{act:?} while {phase:?}"),
        }
        ""
    }

    /// Ends a look without a job.
    fn find_nothing(&self, state: &mut State) -> &'static str {
        state.reader.phase = Reading::Idle;
        if !self.keeps(Rule::GoneBeforeNothing) {
            state.reader.found_nothing = true;
        } else if state.reader.knows_gone {
            state.expect_nothing();
        }
        "Nothing"
    }

    /// Ends a look at the job at the head.
    fn find(&self, state: &mut State, by: Looks) {
        match by {
            Looks::Find => state.reader.phase = Reading::Searching { at: 0 },
            Looks::Take => {
                let second = state.slots.get(1).is_some_and(|slot| !slot.done) && state.reader.end > 1;
                let at = u8::from(second && !self.keeps(Rule::TakeIsOldest));
                if at > 0 {
                    state.found(IN_ORDER);
                }
                self.begin(state, at);
            }
            Looks::Batch => {
                let row = self.row(state).min(2);
                for at in 0..row {
                    // No slot follows the last one of the lap, and no number follows the highest one.
                    let is_past = state.index + at >= self.capacity;
                    state.see(if is_past { self.capacity } else { at }, state.reader.number + at);
                }
                state.reader.found_nothing = false;
                state.reader.phase = Reading::ExecutingBatch { row };
            }
        }
    }

    /// Returns the number of jobs in a row.
    fn row(&self, state: &State) -> u8 {
        let lap = self.capacity - state.index;
        let numbers = self.max + 1 - state.reader.number;
        let mut row = state.reader.end;
        if self.keeps(Rule::RowEndsWithLap) {
            row = row.min(lap);
        }
        if self.keeps(Rule::RowEndsWithNumbers) {
            row = row.min(numbers);
        }
        if self.keeps(Rule::RowEndsAtCompleted) && state.reader.ahead > 0 {
            row = row.min(1);
        }
        row
    }

    /// Returns the next slot whose job was not completed, and its number.
    fn next(&self, state: &State, mut at: u8, end: u8, mut number: u8) -> Option<(u8, u8)> {
        while at != end && state.slots.get(usize::from(at)).is_some_and(|slot| slot.done) {
            at += 1;
            number = after(number, 1, self.max);
        }
        (at != end).then_some((at, number))
    }

    /// Begins the execution of a job.
    fn begin(&self, state: &mut State, at: u8) {
        state.see(at, after(state.reader.number, at, self.max));
        state.reader.found_nothing = false;
        state.reader.phase = Reading::Executing { at };
        if !self.keeps(Rule::CompletingFrees) && at == 0 {
            state.free(1, self.max, self.without);
            state.reader.phase = Reading::Executing { at: self.capacity - 1 };
        }
    }

    fn complete(&self, state: &mut State, at: u8) {
        state.reader.phase = Reading::Idle;
        if !self.keeps(Rule::CompletingFrees) {
            state.slot(at).content = Content::Nothing; // its slot was given back when the job began
            return;
        }
        state.executed(at);
        if at == 0 || !self.keeps(Rule::HeadWaitsForOldest) {
            state.free(1, self.max, self.without);
        } else if self.keeps(Rule::CompletedIsMarked) {
            state.slot(at).done = true;
            state.reader.ahead += 1;
        }
    }
}
