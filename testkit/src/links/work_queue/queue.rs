//! What the two ends can do, a load or a store at a time.

use super::state::{IN_ORDER, Reading, Rule, Stamp, State, Writing};
use crate::model::{Edge, System};

/// A queue to explore. There is no end to its jobs, and still its states are finitely many.
#[derive(Debug, Clone, Copy)]
pub struct Queue {
    /// How many jobs it holds.
    pub capacity: u8,
    /// The highest job number.
    pub max: u8,
    /// How the reader looks for jobs.
    pub looks: Looks,
    /// Whether an operation is interrupted only where it calls its user: what a single thread can replay.
    pub single: bool,
    /// A rule that is taken out.
    pub without: Option<Rule>,
}

/// How a reader looks for jobs. It lists them, too.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Looks {
    /// The oldest one.
    Take,
    /// Any one, or the oldest.
    Find,
}

/// One load or store that the other end can see, or a decision of the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "most are operations of the queue")]
pub enum Act {
    /// The writer looks for space, if it knows of none.
    Claim,
    DropClaim,
    /// With the right number.
    Commit,
    /// With the number of the job queued last.
    CommitRepeated,
    /// With the number after the right one.
    CommitWrong,
    Clear,
    Reset,
    WriterLeaves,
    /// `take` loads the watermark.
    Take,
    /// `take_where` loads the watermark.
    Find,
    /// `iter` loads the watermark.
    List,
    /// One job before the watermark is discarded.
    Discard,
    /// `take` looks at the slot at the head, `take_where` at the watermark again.
    Look,
    /// `take_where` or a listing looks at the next slot.
    Search,
    Accept,
    Reject,
    Complete,
    GiveUp,
    /// The reader asks whether the writer is gone.
    AskGone,
    ReaderLeaves,
}

impl Act {
    /// Whether the writer does it.
    pub fn is_writers(self) -> bool {
        use Act::{Claim, Clear, Commit, CommitRepeated, CommitWrong, DropClaim, Reset, WriterLeaves};
        matches!(
            self,
            Claim | DropClaim | Commit | CommitRepeated | CommitWrong | Clear | Reset | WriterLeaves
        )
    }

    fn name(self) -> &'static str {
        match self {
            Self::Claim => "Claim",
            Self::DropClaim => "DropClaim",
            Self::Commit => "Commit",
            Self::CommitRepeated => "CommitRepeated",
            Self::CommitWrong => "CommitWrong",
            Self::Clear => "Clear",
            Self::Reset => "Reset",
            Self::WriterLeaves => "WriterLeaves",
            Self::Take => "Take",
            Self::Find => "Find",
            Self::List => "List",
            Self::Discard => "Discard",
            Self::Look => "Look",
            Self::Search => "Search",
            Self::Accept => "Accept",
            Self::Reject => "Reject",
            Self::Complete => "Complete",
            Self::GiveUp => "GiveUp",
            Self::AskGone => "AskGone",
            Self::ReaderLeaves => "ReaderLeaves",
        }
    }
}

impl Queue {
    /// A queue as it is: every interleaving, every rule.
    pub fn new(capacity: u8, looks: Looks) -> Self {
        Self { capacity, max: capacity + 1, looks, single: false, without: None }
    }

    fn keeps(&self, rule: Rule) -> bool {
        self.without != Some(rule)
    }

    /// Whether the other end can come in between.
    fn may_interrupt(&self, state: &State) -> bool {
        !self.single
            || match state.reader.phase {
                Reading::Obeying { discarded, .. } => discarded,
                Reading::Searching { list, .. } => list,
                Reading::Idle | Reading::Asking { .. } | Reading::Executing { .. } | Reading::Gone => true,
                Reading::Leaving { .. } => false,
            }
    }

    fn writer_acts(&self, state: &State, acts: &mut Vec<Act>) {
        match state.writer.phase {
            Writing::Ready => acts.extend([Act::Claim, Act::Clear, Act::Reset, Act::WriterLeaves]),
            Writing::Claimed => {
                acts.extend([Act::Commit, Act::DropClaim, Act::CommitWrong]);
                acts.extend(state.last_number(self.max).map(|_| Act::CommitRepeated));
            }
            Writing::Leaving { .. } => acts.push(Act::WriterLeaves),
            Writing::Gone => {}
        }
    }

    fn reader_acts(&self, state: &State, acts: &mut Vec<Act>) {
        match state.reader.phase {
            Reading::Idle => {
                acts.push(Act::Take);
                if self.looks == Looks::Find {
                    acts.push(Act::Find);
                }
                acts.extend([Act::List, Act::ReaderLeaves]);
                if !state.reader.knows_gone {
                    acts.push(Act::AskGone);
                }
            }
            Reading::Obeying { watermark, .. } => {
                let obeys = watermark > 0 || !self.keeps(Rule::DiscardEndsAtWatermark);
                let discards = obeys && matches!(state.slots[0].stamp, Stamp::Job(_));
                acts.push(if discards { Act::Discard } else { Act::Look });
            }
            Reading::Searching { .. } => acts.push(Act::Search),
            Reading::Asking { .. } => acts.extend([Act::Accept, Act::Reject]),
            Reading::Executing { .. } => acts.extend([Act::Complete, Act::GiveUp]),
            Reading::Leaving { .. } => acts.push(Act::ReaderLeaves),
            Reading::Gone => {}
        }
    }

    fn write(&self, state: &mut State, act: Act) -> &'static str {
        let (next, last) = (state.writer.next, state.last_number(self.max));
        match act {
            Act::Claim => {
                if state.writer.tail == state.writer.space {
                    state.writer.space = self.capacity + u8::from(!self.keeps(Rule::ClaimLooksForSpace));
                }
                if state.writer.tail == state.writer.space {
                    return "Full";
                }
                state.writer.phase = Writing::Claimed;
            }
            Act::DropClaim => state.writer.phase = Writing::Ready,
            Act::Commit | Act::CommitRepeated | Act::CommitWrong => {
                state.writer.phase = Writing::Ready;
                let number = match act {
                    Act::Commit => next,
                    Act::CommitRepeated => last.unwrap_or(0),
                    _ => next + 1,
                };
                if number != next && self.keeps(Rule::NumberIsChecked) {
                    return if Some(number) == last { "Repeated" } else { "Unexpected" };
                }
                state.publish(number, self.max);
            }
            Act::Clear => state.clear(self.without),
            Act::Reset => {
                state.clear(self.without);
                (state.writer.next, state.writer.wrapped) = (1, false);
            }
            _ => match state.writer.phase {
                Writing::Ready if !self.keeps(Rule::LeavingIsOneStep) => {
                    state.writer.phase = Writing::Leaving { is_second: state.abandoned };
                }
                phase => {
                    let is_second =
                        if let Writing::Leaving { is_second } = phase { is_second } else { state.abandoned };
                    state.writer.phase = Writing::Gone;
                    return Self::leave(state, is_second);
                }
            },
        }
        ""
    }

    fn leave(state: &mut State, is_second: bool) -> &'static str {
        state.abandoned = true;
        if is_second {
            state.drop_jobs();
            return "Drop";
        }
        ""
    }

    fn read(&self, state: &mut State, act: Act) -> &'static str {
        let obeyed = |rule| if self.keeps(rule) { state.watermark } else { 0 };
        match (act, state.reader.phase) {
            (Act::Take, _) => {
                let watermark = obeyed(Rule::TakeObeysWatermark);
                state.reader.phase = Reading::Obeying { find: false, watermark, discarded: false };
                state.reader.is_current = true;
            }
            (Act::Find, _) => {
                let watermark = obeyed(Rule::FindObeysWatermark);
                state.reader.phase = Reading::Obeying { find: true, watermark, discarded: false };
                state.reader.is_current = true;
            }
            (Act::List, _) => {
                let at = obeyed(Rule::WaitingBeginsAtWatermark);
                state.reader.phase = Reading::Searching { at, list: true };
                state.reader.is_current = true;
            }
            (Act::Discard, Reading::Obeying { find, watermark, .. }) => {
                state.reader.phase = Reading::Obeying { find, watermark, discarded: true };
                state.discard(self.without);
            }
            (Act::Look, Reading::Obeying { find: true, .. }) => {
                let at = obeyed(Rule::WaitingBeginsAtWatermark);
                state.reader.phase = Reading::Searching { at, list: false };
                state.reader.is_current = true;
            }
            (Act::Look, _) => {
                let second = state.slots.get(1).is_some_and(|slot| matches!(slot.stamp, Stamp::Job(_)));
                let at = u8::from(second && !self.keeps(Rule::TakeIsOldest));
                if at > 0 && matches!(state.slots[0].stamp, Stamp::Job(_)) {
                    state.found(IN_ORDER);
                }
                match state.slot(at).stamp {
                    Stamp::Job(_) => state.begin(at, self.without),
                    Stamp::Free | Stamp::Completed => {
                        state.find_nothing(self.without);
                        return "Nothing";
                    }
                }
            }
            (Act::Search, Reading::Searching { at, list }) => {
                // What was completed is the reader's: nobody sees it pass.
                let slots = (at..).zip(&state.slots[usize::from(at)..]);
                let next =
                    slots.map(|(at, slot)| (at, slot.stamp)).find(|(_, stamp)| *stamp != Stamp::Completed);
                let Some((at, Stamp::Job(_))) = next else {
                    state.reader.phase = Reading::Idle;
                    return "Nothing";
                };
                state.see(at);
                if list {
                    state.reader.phase = Reading::Searching { at: at + 1, list };
                    return "Job";
                }
                state.reader.phase = Reading::Asking { at };
            }
            (Act::Accept, Reading::Asking { at }) => state.begin(at, self.without),
            (Act::Reject, Reading::Asking { at }) => {
                state.reader.phase = Reading::Searching { at: at + 1, list: false };
            }
            (Act::Complete, Reading::Executing { at, is_oldest }) => {
                state.complete(at, is_oldest, self.without)
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
                return Self::leave(state, is_second);
            }
            (act, phase) => unreachable!("{act:?} while {phase:?}"),
        }
        ""
    }
}

impl System for Queue {
    type State = State;
    type Act = Act;

    fn init(&self) -> State {
        State::new(self.capacity)
    }

    fn acts(&self, state: &State, acts: &mut Vec<Act>) {
        self.reader_acts(state, acts);
        if self.may_interrupt(state) {
            self.writer_acts(state, acts);
        }
    }

    fn step(&self, state: &State, act: Act, edges: Option<&mut Vec<Edge>>) -> State {
        let mut next = state.clone();
        let action = if act.is_writers() { self.write(&mut next, act) } else { self.read(&mut next, act) };
        if let Some(edges) = edges {
            let (end, from, to) = if act.is_writers() {
                ("writer", state.writer.phase.name(), next.writer.phase.name())
            } else {
                ("reader", state.reader.phase.name(), next.reader.phase.name())
            };
            edges.push(Edge { end, from, input: act.name(), to, action: action.into() });
        }
        next
    }

    fn broken(&self, state: &State, broken: &mut Vec<&'static str>) {
        broken.extend(state.check(self.max, self.without));
    }

    /// The writer queues nothing more, and the reader goes on, always with the same operation.
    fn benign(&self, state: &State) -> Option<Act> {
        match (state.writer.phase, state.reader.phase) {
            (_, Reading::Idle) if state.writer.phase == Writing::Claimed => Some(Act::DropClaim),
            (_, Reading::Idle) if self.looks == Looks::Take => Some(Act::Take),
            (_, Reading::Idle) => Some(Act::Find),
            (_, Reading::Asking { .. }) => Some(Act::Accept),
            (_, Reading::Executing { .. }) => Some(Act::Complete),
            _ => {
                let mut acts = Vec::new();
                self.reader_acts(state, &mut acts);
                acts.first().copied()
            }
        }
    }

    /// Nothing is queued or being executed, and the last reset has taken effect; or nobody is there to execute.
    fn is_over(&self, state: &State) -> bool {
        let is_idle = state.reader.phase == Reading::Idle && state.writer.phase != Writing::Claimed;
        state.reader.phase == Reading::Gone || is_idle && state.writer.tail == 0 && state.watermark == 0
    }

    fn ticks(&self, _: Act) -> u32 {
        0
    }
}
