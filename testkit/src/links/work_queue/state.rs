//! The state of both ends and the ring, and the effect of each load and store.

use super::rule::{
    DROPPED, EXECUTED_ONCE, FOUND, GAPLESS, NOT_BEGUN, NOT_LOST, NOT_PULLED_AWAY, NUMBERED, PUBLISHED,
    RESET_KEEPS, Rule, SETTLED, UNIQUE,
};

/// Positions are counted from the head, so that the states are finitely many though the jobs are not: slot 0 is the oldest that
/// is not free.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct State {
    /// The ring from the head on.
    pub slots: Vec<Slot>,
    /// The number of slots before the head on its lap.
    pub index: u8,
    /// The tail that was stored last.
    pub tail: u8,
    /// The mark that was stored last.
    pub mark: Mark,
    /// Whether an end has left.
    pub abandoned: bool,
    /// The communication task's end.
    pub writer: Writer,
    /// The motion task's end.
    pub reader: Reader,
    /// The first property that does not hold.
    pub broken: Option<&'static str>,
}

/// One slot: its real contents, and the reader's flag.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Slot {
    /// The content of the slot.
    pub content: Content,
    /// Whether it was completed before its turn.
    pub done: bool,
}

/// The content of a slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Content {
    /// No job since the slot was freed.
    Nothing,
    /// A job that was neither completed nor dropped.
    Job {
        /// The number of the job.
        number: u8,
        /// Whether a reset came after it.
        cleared: bool,
    },
    /// A job was, and was executed.
    Executed,
}

/// A position and the number of the job there: one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Mark {
    /// -1 if the head has passed it.
    pub at: i8,
    /// The number.
    pub number: u8,
}

/// The writer's own. It is at the tail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Writer {
    /// The step that the writer is at.
    pub phase: Writing,
    /// The position up to which the writer knows the slots to be free.
    pub end: u8,
    /// The number of the job at the tail.
    pub next: u8,
    /// Whether a job was before number 1.
    pub wrapped: bool,
}

/// The steps of the writer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "they name what the end does")]
pub enum Writing {
    Ready,
    Claimed,
    /// The number of slots in its batch, and how many of them hold a job.
    Batch {
        slots: u8,
        filled: u8,
    },
    /// The writer has looked at the head, and stores a mark in place of an old one.
    Renewing {
        mark: Mark,
        /// The number of slots and jobs in its batch, if it is within one.
        batch: Option<(u8, u8)>,
    },
    /// Only where the tail is stored before the job.
    Storing,
    /// Only where a mark is two words.
    Marking,
    /// Only where leaving takes two steps.
    Leaving {
        is_second: bool,
    },
    Gone,
}

/// The reader's own. It is at the head.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reader {
    /// The step that the reader is at.
    pub phase: Reading,
    /// The position up to which the reader knows the slots to be its own.
    pub end: u8,
    /// The number of the job at the head.
    pub number: u8,
    /// The last reset mark that the reader has applied.
    pub obeyed: Mark,
    /// The number of jobs after the head that were completed.
    pub ahead: u8,
    /// Whether no reset came since it has loaded the mark last.
    pub is_current: bool,
    /// Whether it has seen that the writer is gone.
    pub knows_gone: bool,
    /// Whether it has found nothing last. Only where it asks afterwards.
    pub found_nothing: bool,
}

/// The way in which a reader looks for jobs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Looks {
    /// The oldest one.
    Take,
    /// The two oldest ones.
    Batch,
    /// Any one.
    Find,
}

/// The steps of the reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "they name what the end does")]
pub enum Reading {
    Idle,
    /// The reader loads the tail, if it knows of no job, and then the mark.
    Finding {
        by: Looks,
        /// Whether it loads the tail though it knows of jobs.
        afresh: bool,
        /// Whether it has discarded a job just now: its drop may run anything.
        discarded: bool,
        /// Only where the mark is loaded first.
        early: Option<Mark>,
    },
    /// The reader has loaded this mark, and stores the head.
    Obeying {
        by: Looks,
        mark: Mark,
    },
    /// The reader has loaded the tail for a listing, or the mark where that is loaded first.
    Listing {
        tail: u8,
        early: Option<Mark>,
    },
    /// The reader lists, and looks at this slot next.
    Listed {
        at: u8,
        end: u8,
        number: u8,
    },
    /// The reader goes through the jobs, and looks at this slot next.
    Searching {
        at: u8,
    },
    /// The reader asks whether this job is the one.
    Asking {
        at: u8,
    },
    Executing {
        at: u8,
    },
    ExecutingBatch {
        row: u8,
    },
    /// The reader has dropped this many jobs of a completed batch.
    Dropping {
        row: u8,
        dropped: u8,
    },
    Leaving {
        is_second: bool,
    },
    Gone,
}

impl State {
    pub(super) fn new(capacity: u8) -> Self {
        let mark = Mark { at: 0, number: 1 };
        let writer = Writer { phase: Writing::Ready, end: capacity, next: 1, wrapped: false };
        let reader = Reader {
            phase: Reading::Idle,
            end: 0,
            number: 1,
            obeyed: mark,
            ahead: 0,
            is_current: true,
            knows_gone: false,
            found_nothing: false,
        };
        Self {
            slots: vec![Slot { content: Content::Nothing, done: false }; capacity.into()],
            index: 0,
            tail: 0,
            mark,
            abandoned: false,
            writer,
            reader,
            broken: None,
        }
    }

    pub(super) fn capacity(&self) -> u8 {
        self.slots.len() as u8
    }

    pub(super) fn slot(&mut self, at: u8) -> &mut Slot {
        let capacity = self.slots.len();
        &mut self.slots[usize::from(at) % capacity]
    }

    /// Returns the number of the job queued last.
    pub fn last_number(&self, max: u8) -> Option<u8> {
        match (self.writer.next, self.writer.wrapped) {
            (1, true) => Some(max),
            (1, false) => None,
            (next, _) => Some(next - 1),
        }
    }

    /// Returns the positions of the jobs that a reader sees now, and their numbers, oldest first.
    pub fn waiting(&self) -> impl Iterator<Item = (u8, u8)> {
        let slots = (0..self.tail).zip(&self.slots);
        slots.filter_map(|(at, slot)| match slot.content {
            Content::Job { number, cleared: false } => Some((at, number)),
            _ => None,
        })
    }

    /// Returns the number of the job in a slot.
    pub fn number_at(&self, at: u8) -> Option<u8> {
        match self.slots.get(usize::from(at))?.content {
            Content::Job { number, .. } => Some(number),
            _ => None,
        }
    }

    /// Returns whether the last reset has taken effect, as the writer observes it.
    pub fn is_settled(&self, without: Option<Rule>) -> bool {
        self.mark.at <= 0 || without == Some(Rule::SettledIsTheHead)
    }

    pub(super) fn found(&mut self, property: &'static str) {
        self.broken.get_or_insert(property);
    }

    /// Stores a job in a free slot.
    pub(super) fn fill(&mut self, at: u8, number: u8) {
        let at = at % self.capacity();
        let is_executing = match self.reader.phase {
            Reading::Executing { at: executing } => executing == at,
            Reading::ExecutingBatch { row } => at < row,
            _ => false,
        };
        if is_executing {
            self.found(NOT_PULLED_AWAY);
        } else if self.number_at(at).is_some() {
            self.found(NOT_LOST);
        }
        self.slot(at).content = Content::Job { number, cleared: false };
    }

    /// Stores the tail.
    pub(super) fn publish(&mut self, jobs: u8, max: u8) {
        self.tail += jobs;
        for _ in 0..jobs {
            self.writer.wrapped |= self.writer.next == max;
            self.writer.next = after(self.writer.next, 1, max);
        }
    }

    /// Marks every job that is queued now as to be discarded.
    pub(super) fn clear(&mut self, without: Option<Rule>) {
        for slot in &mut self.slots {
            if let Content::Job { cleared, .. } = &mut slot.content {
                *cleared = true;
            }
        }
        self.reader.is_current = false;
        if without == Some(Rule::ClearedIsNotFree) {
            self.writer.end = self.tail + self.capacity();
        }
    }

    /// Stores the head: the oldest slots are free, and those after them that were completed.
    pub(super) fn free(&mut self, slots: u8, max: u8, without: Option<Rule>) {
        for _ in 0..slots {
            self.free_oldest(max, without);
        }
        let passes = |state: &Self| state.reader.ahead > 0 && state.slots[0].done;
        while passes(self) && without != Some(Rule::HeadPassesCompleted) {
            self.reader.ahead -= 1;
            self.free_oldest(max, without);
        }
    }

    fn free_oldest(&mut self, max: u8, without: Option<Rule>) {
        let Slot { mut content, .. } = self.slots.remove(0);
        match content {
            Content::Job { .. } if without == Some(Rule::CompletingFrees) => {}
            Content::Job { .. } => self.found(NOT_LOST),
            _ => content = Content::Nothing,
        }
        self.slots.push(Slot { content, done: false });
        let Some(tail) = self.tail.checked_sub(1) else { return self.found(PUBLISHED) };
        self.tail = tail;
        self.index = (self.index + 1) % self.capacity();
        self.writer.end = self.writer.end.saturating_sub(1);
        self.reader.end = self.reader.end.saturating_sub(1);
        self.reader.number = after(self.reader.number, 1, max);
        let (mark, obeyed) = (&mut self.mark, &mut self.reader.obeyed);
        for mark in [mark, obeyed] {
            mark.at = (mark.at - 1).max(-1);
        }
        if let Writing::Renewing { mark, .. } = &mut self.writer.phase {
            mark.at = -1;
        }
    }

    /// Moves the oldest job out and drops it.
    pub(super) fn discard(&mut self, max: u8, without: Option<Rule>) {
        match core::mem::replace(&mut self.slot(0).content, Content::Nothing) {
            Content::Job { cleared: true, .. } => {}
            Content::Job { cleared: false, .. } => self.found(RESET_KEEPS),
            Content::Executed => self.found(EXECUTED_ONCE),
            Content::Nothing => self.found(PUBLISHED),
        }
        self.free_oldest(max, without);
    }

    /// Called when the reader finds a job.
    pub(super) fn see(&mut self, at: u8, expected: u8) {
        let is_current = self.reader.is_current;
        let content = if at < self.tail { self.slot(at).content } else { Content::Nothing };
        match content {
            Content::Nothing => self.found(PUBLISHED),
            Content::Executed => self.found(EXECUTED_ONCE),
            Content::Job { cleared: true, .. } if is_current => self.found(NOT_BEGUN),
            Content::Job { number, .. } if number != expected => self.found(NUMBERED),
            Content::Job { .. } => {}
        }
    }

    /// Called when a job was executed.
    pub(super) fn executed(&mut self, at: u8) {
        if !matches!(core::mem::replace(&mut self.slot(at).content, Content::Executed), Content::Job { .. }) {
            self.found(EXECUTED_ONCE);
        }
    }

    /// Called when the reader concludes that no more jobs will come.
    pub(super) fn expect_nothing(&mut self) {
        if self.slots.iter().any(|slot| matches!(slot.content, Content::Job { cleared: false, .. })) {
            self.found(FOUND);
        }
    }

    /// Drops the jobs of a batch that is not published.
    pub(super) fn empty(&mut self, at: u8, slots: u8) {
        for at in at..at + slots {
            self.slot(at).content = Content::Nothing;
        }
    }

    /// Lets an end leave; the second one drops the remaining jobs.
    pub(super) fn leave(&mut self, is_second: bool) -> &'static str {
        self.abandoned = true;
        if !is_second {
            return "";
        }
        for at in 0..self.tail {
            match (self.slot(at).content, self.slot(at).done) {
                (Content::Job { .. }, false) => self.slot(at).content = Content::Nothing,
                (_, true) => {}
                (_, false) => self.found(DROPPED),
            }
        }
        "Drop"
    }

    /// Returns the first property that does not hold; called between any two steps.
    pub(super) fn check(&self, max: u8, without: Option<Rule>) -> Option<&'static str> {
        let is_gone = (self.writer.phase, self.reader.phase) == (Writing::Gone, Reading::Gone);
        let is_left = |slot: &Slot| matches!(slot.content, Content::Job { .. });
        let is_cleared = |slot: &Slot| matches!(slot.content, Content::Job { cleared: true, .. });
        let kept = self.slots.iter().map(|slot| match slot.content {
            Content::Job { number, cleared: false } => Some(number),
            _ => None,
        });
        let kept: Vec<Option<u8>> = kept.collect();
        let numbers: Vec<u8> = kept.iter().flatten().copied().collect();
        let is_queued_twice = numbers.iter().enumerate().any(|(at, number)| numbers[..at].contains(number));
        let follows = |pair: &[Option<u8>]| match pair {
            [Some(first), Some(second)] => *second == after(*first, 1, max),
            _ => true,
        };
        if let Some(property) = self.broken {
            Some(property)
        } else if is_gone && self.slots.iter().any(is_left) {
            Some(DROPPED)
        } else if self.is_settled(without) && self.slots.iter().any(is_cleared) {
            Some(SETTLED)
        } else if is_queued_twice {
            Some(UNIQUE)
        } else if !kept.windows(2).all(follows) {
            Some(GAPLESS)
        } else {
            None
        }
    }
}

/// Returns the number this many jobs later.
pub(super) fn after(number: u8, jobs: u8, max: u8) -> u8 {
    (number - 1 + jobs) % max + 1
}

impl Writing {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ready => "Ready",
            Self::Claimed => "Claimed",
            Self::Batch { .. } => "Batch",
            Self::Renewing { .. } => "Renewing",
            Self::Storing => "Storing",
            Self::Marking => "Marking",
            Self::Leaving { .. } => "Leaving",
            Self::Gone => "Gone",
        }
    }
}

impl Reading {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Idle => "Idle",
            Self::Finding { .. } => "Finding",
            Self::Obeying { .. } => "Obeying",
            Self::Listing { .. } | Self::Listed { .. } => "Listing",
            Self::Searching { .. } => "Searching",
            Self::Asking { .. } => "Asking",
            Self::Executing { .. } => "Executing",
            Self::ExecutingBatch { .. } => "ExecutingBatch",
            Self::Dropping { .. } => "Dropping",
            Self::Leaving { .. } => "Leaving",
            Self::Gone => "Gone",
        }
    }
}
