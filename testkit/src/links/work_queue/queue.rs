//! The acts of the two ends, each a single load or store.

use super::rule::Rule;
use super::state::{Looks, Reading, State, Writing};
use crate::model::{Edge, System};

/// A queue to explore. It has endless jobs, but a finite number of states.
#[derive(Debug, Clone, Copy)]
pub struct Queue {
    /// The capacity of the queue, in jobs.
    pub capacity: u8,
    /// The highest job number.
    pub max: u8,
    /// The way in which the reader looks for jobs when it continues by itself.
    pub looks: Looks,
    /// Whether an operation is interrupted only at calls of its user, so that a single thread can replay it.
    pub single: bool,
    /// A rule that is taken out.
    pub without: Option<Rule>,
}

/// One load or store that the other end can see, or a decision of the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "most are operations of the queue")]
pub enum Act {
    /// The writer loads the head, if it knows of no space.
    Claim,
    DropClaim,
    /// With the right number: the tail is stored.
    Commit,
    /// With the number of the job queued last.
    CommitRepeated,
    /// With the number after the right one.
    CommitWrong,
    /// The writer loads the head, if it knows of less space.
    Batch(u8),
    /// A job of the batch is committed.
    Fill,
    /// The tail is stored.
    Publish,
    DropBatch,
    Clear,
    Reset,
    /// A mark of long ago is replaced: the head is loaded, then the mark is stored.
    Renew,
    WriterLeaves,
    /// `take`, `take_batch` or `take_where` begins.
    Look(Looks),
    /// `iter` loads the tail.
    List,
    /// The tail is loaded if no job is known, otherwise the mark.
    Load,
    /// One job before the mark is discarded, and the head is stored.
    Discard,
    /// One job before the mark was completed already: the head is stored.
    Pass,
    /// The mark is reached, and the head is stored.
    Number,
    /// `take_where` or a listing looks at the next slot.
    Search,
    Accept,
    Reject,
    /// The head is stored, but for a batch.
    Complete,
    /// A job of a completed batch is dropped.
    Drop,
    /// The head is stored for a batch.
    Free,
    GiveUp,
    /// The reader asks whether the writer is gone.
    AskGone,
    ReaderLeaves,
}

impl Act {
    /// Returns whether the act is the writer's.
    pub fn is_writers(self) -> bool {
        use Act::{Batch, Claim, Clear, Commit, CommitRepeated, CommitWrong, DropBatch, DropClaim, Fill};
        use Act::{Publish, Renew, Reset, WriterLeaves};
        let claim = matches!(self, Claim | DropClaim | Commit | CommitRepeated | CommitWrong);
        claim || matches!(self, Batch(_) | Fill | Publish | DropBatch | Clear | Reset | Renew | WriterLeaves)
    }

    fn name(self) -> &'static str {
        match self {
            Self::Claim => "Claim",
            Self::DropClaim => "DropClaim",
            Self::Commit => "Commit",
            Self::CommitRepeated => "CommitRepeated",
            Self::CommitWrong => "CommitWrong",
            Self::Batch(_) => "Batch",
            Self::Fill => "Fill",
            Self::Publish => "Publish",
            Self::DropBatch => "DropBatch",
            Self::Clear => "Clear",
            Self::Reset => "Reset",
            Self::Renew => "Renew",
            Self::WriterLeaves => "WriterLeaves",
            Self::Look(_) => "Look",
            Self::List => "List",
            Self::Load => "Load",
            Self::Discard => "Discard",
            Self::Pass => "Pass",
            Self::Number => "Number",
            Self::Search => "Search",
            Self::Accept => "Accept",
            Self::Reject => "Reject",
            Self::Complete => "Complete",
            Self::Drop => "Drop",
            Self::Free => "Free",
            Self::GiveUp => "GiveUp",
            Self::AskGone => "AskGone",
            Self::ReaderLeaves => "ReaderLeaves",
        }
    }
}

impl Queue {
    /// Creates a queue with every interleaving and every rule.
    pub fn new(capacity: u8, looks: Looks) -> Self {
        Self { capacity, max: capacity + 1, looks, single: false, without: None }
    }

    pub(super) fn keeps(&self, rule: Rule) -> bool {
        self.without != Some(rule)
    }

    /// Returns whether the other end can interrupt.
    fn may_interrupt(&self, state: &State) -> bool {
        !self.single
            || match state.reader.phase {
                Reading::Finding { discarded, .. } => discarded,
                Reading::Dropping { dropped, .. } => dropped > 0,
                Reading::Listing { .. } | Reading::Obeying { .. } | Reading::Searching { .. } => false,
                Reading::Leaving { .. } => false,
                _ => true,
            }
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

    /// Returns the faultless act: the writer ends its operation, and the reader continues, always with the same operation.
    fn fault_free_step(&self, state: &State) -> Option<Act> {
        let mut acts = Vec::new();
        match (state.reader.phase, state.writer.phase) {
            (Reading::Idle, Writing::Ready | Writing::Gone) => return Some(Act::Look(self.looks)),
            (Reading::Idle, Writing::Claimed) => return Some(Act::DropClaim),
            (Reading::Idle, Writing::Batch { .. }) => return Some(Act::DropBatch),
            (Reading::Idle, _) => self.writer_acts(state, &mut acts),
            _ => self.reader_acts(state, &mut acts),
        }
        acts.first().copied()
    }

    /// Returns whether no job is queued or being executed, and the last reset has taken effect; or there is no reader to
    /// execute jobs.
    fn is_over(&self, state: &State) -> bool {
        let is_idle = matches!(state.writer.phase, Writing::Ready | Writing::Gone)
            && state.reader.phase == Reading::Idle;
        state.reader.phase == Reading::Gone || is_idle && state.tail == 0 && state.mark.at <= 0
    }

    fn ticks(&self, _: Act) -> u32 {
        0
    }
}
