//! What both ends and the ring hold, and what each load and store does to it.

pub(super) const EXECUTED_ONCE: &str = "nothing is executed twice";
pub(super) const NOT_LOST: &str = "nothing is lost that was not cleared";
pub(super) const NOT_PULLED_AWAY: &str = "a job being executed is not pulled away";
pub(super) const KEPT: &str = "jobs queued after a reset are kept";
pub(super) const NOT_BEGUN: &str = "no look that begins after a reset finds what it discards";
pub(super) const SETTLED: &str = "a reset that has settled has taken effect";
pub(super) const IN_ORDER: &str = "take takes the oldest job";
pub(super) const UNIQUE: &str = "no number is queued twice";
pub(super) const GAPLESS: &str = "each job has the number after that of the job before it";
pub(super) const DROPPED: &str = "jobs that are left when both ends are gone are dropped once";
pub(super) const FOUND: &str = "who finds nothing after the writer is gone has found everything";

/// What the queue's proof rests on, one by one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "the table of what must fail has them in words")]
pub enum Rule {
    TakeObeysWatermark,
    FindObeysWatermark,
    WaitingBeginsAtWatermark,
    DiscardEndsAtWatermark,
    SettledIsTheHead,
    CompletingFrees,
    ClearedIsNotFree,
    ClaimLooksForSpace,
    CompletedIsMarked,
    HeadWaitsForOldest,
    HeadPassesCompleted,
    TakeIsOldest,
    NumberIsChecked,
    LeavingIsOneStep,
    GoneBeforeNothing,
}

impl Rule {
    pub(super) const ALL: [Self; 15] = [
        Self::TakeObeysWatermark,
        Self::FindObeysWatermark,
        Self::WaitingBeginsAtWatermark,
        Self::DiscardEndsAtWatermark,
        Self::SettledIsTheHead,
        Self::CompletingFrees,
        Self::ClearedIsNotFree,
        Self::ClaimLooksForSpace,
        Self::CompletedIsMarked,
        Self::HeadWaitsForOldest,
        Self::HeadPassesCompleted,
        Self::TakeIsOldest,
        Self::NumberIsChecked,
        Self::LeavingIsOneStep,
        Self::GoneBeforeNothing,
    ];
}

/// Positions are counted from the head, so that the states are finitely many though the jobs are not: slot 0 is the oldest that
/// is not free. A watermark that the head has passed is 0.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct State {
    /// The ring from the head on.
    pub slots: Vec<Slot>,
    /// What was stored last.
    pub watermark: u8,
    /// Whether an end has left.
    pub abandoned: bool,
    /// The communication task's end.
    pub writer: Writer,
    /// The motion task's end.
    pub reader: Reader,
    /// The first property that does not hold.
    pub broken: Option<&'static str>,
}

/// One slot: what its stamp says on this lap, and what is really in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Slot {
    /// The stamp.
    pub stamp: Stamp,
    /// The job, if there is one.
    pub job: Option<Job>,
}

/// What a slot's stamp says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stamp {
    /// Nothing yet.
    Free,
    /// The job with this number.
    Job(u8),
    /// Completed before the jobs in front of it.
    Completed,
}

/// A job that was neither completed nor dropped.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Job {
    /// Whether a reset came after it.
    pub cleared: bool,
}

/// The writer's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Writer {
    /// What it is doing.
    pub phase: Writing,
    /// The next slot to fill.
    pub tail: u8,
    /// Up to where it knows the slots to be free.
    pub space: u8,
    /// The next job's number.
    pub next: u8,
    /// Whether a job was before number 1.
    pub wrapped: bool,
}

/// What the writer is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "they name what the end does")]
pub enum Writing {
    Ready,
    Claimed,
    /// Only where leaving takes two steps.
    Leaving {
        is_second: bool,
    },
    Gone,
}

/// The reader's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Reader {
    /// What it is doing.
    pub phase: Reading,
    /// How many slots after the head were completed.
    pub ahead: u8,
    /// Whether no reset came since it has loaded the watermark last.
    pub is_current: bool,
    /// Whether it has seen that the writer is gone.
    pub knows_gone: bool,
    /// Whether it has found nothing last. Only where it asks afterwards.
    pub found_nothing: bool,
}

/// What the reader is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs, reason = "they name what the end does")]
pub enum Reading {
    Idle,
    /// It has loaded the watermark, and discards what is before it.
    Obeying {
        find: bool,
        watermark: u8,
        /// Whether it has discarded a job since: its drop may run anything.
        discarded: bool,
    },
    /// It goes through the jobs, and looks at this slot next.
    Searching {
        at: u8,
        list: bool,
    },
    /// It asks whether this job is the one.
    Asking {
        at: u8,
    },
    Executing {
        at: u8,
        is_oldest: bool,
    },
    Leaving {
        is_second: bool,
    },
    Gone,
}

impl State {
    pub(super) fn new(capacity: u8) -> Self {
        let writer = Writer { phase: Writing::Ready, tail: 0, space: capacity, next: 1, wrapped: false };
        let reader = Reader {
            phase: Reading::Idle,
            ahead: 0,
            is_current: true,
            knows_gone: false,
            found_nothing: false,
        };
        Self {
            slots: vec![Slot { stamp: Stamp::Free, job: None }; capacity.into()],
            watermark: 0,
            abandoned: false,
            writer,
            reader,
            broken: None,
        }
    }

    pub(super) fn slot(&mut self, at: u8) -> &mut Slot {
        &mut self.slots[usize::from(at)]
    }

    /// The number of the job queued last.
    pub fn last_number(&self, max: u8) -> Option<u8> {
        match (self.writer.next, self.writer.wrapped) {
            (1, true) => Some(max),
            (1, false) => None,
            (next, _) => Some(next - 1),
        }
    }

    /// The jobs that a reader sees now, oldest first.
    pub fn waiting(&self) -> impl Iterator<Item = (u8, u8)> {
        let slots = (0u8..).zip(&self.slots).skip(self.watermark.into());
        let slots = slots.take_while(|(_, slot)| slot.stamp != Stamp::Free);
        slots.filter_map(|(at, _)| Some((at, self.waiting_at(at)?)))
    }

    /// The number of the job in a slot.
    pub fn waiting_at(&self, at: u8) -> Option<u8> {
        if let Stamp::Job(number) = self.slots.get(usize::from(at))?.stamp { Some(number) } else { None }
    }

    /// Whether the last reset has taken effect, as the writer sees it.
    pub fn is_settled(&self, without: Option<Rule>) -> bool {
        self.watermark == 0 || without == Some(Rule::SettledIsTheHead)
    }

    pub(super) fn found(&mut self, property: &'static str) {
        self.broken.get_or_insert(property);
    }

    /// Stores a job in the slot at the tail, then its stamp.
    pub(super) fn publish(&mut self, number: u8, max: u8) {
        let at = self.writer.tail % self.slots.len() as u8;
        if matches!(self.reader.phase, Reading::Executing { at: executing, .. } if executing == at) {
            self.found(NOT_PULLED_AWAY);
        } else if self.slot(at).job.is_some() {
            self.found(NOT_LOST);
        }
        *self.slot(at) = Slot { stamp: Stamp::Job(number), job: Some(Job { cleared: false }) };
        self.writer.tail += 1;
        (self.writer.next, self.writer.wrapped) =
            if number < max { (number + 1, self.writer.wrapped) } else { (1, true) };
    }

    /// Stores the watermark.
    pub(super) fn clear(&mut self, without: Option<Rule>) {
        let tail = self.writer.tail;
        for job in self.slots.iter_mut().filter_map(|slot| slot.job.as_mut()) {
            job.cleared = true;
        }
        self.watermark = tail;
        self.reader.is_current = false;
        if without == Some(Rule::ClearedIsNotFree) {
            self.writer.space = tail + self.slots.len() as u8;
        }
    }

    /// Stores the head: the oldest slot is free, and those after it that were completed.
    pub(super) fn move_head(&mut self, without: Option<Rule>) {
        loop {
            let oldest = self.slots.remove(0);
            if oldest.job.is_some() && without != Some(Rule::CompletingFrees) {
                self.found(NOT_LOST);
            }
            self.slots.push(Slot { stamp: Stamp::Free, job: oldest.job });
            let Some(tail) = self.writer.tail.checked_sub(1) else { return self.found(EXECUTED_ONCE) };
            self.writer.tail = tail;
            self.writer.space -= 1;
            self.watermark = self.watermark.saturating_sub(1);
            if let Reading::Obeying { watermark, .. } = &mut self.reader.phase {
                *watermark = watermark.saturating_sub(1);
            }
            let passes = self.reader.ahead > 0 && self.slots[0].stamp == Stamp::Completed;
            if !passes || without == Some(Rule::HeadPassesCompleted) {
                break;
            }
            self.reader.ahead -= 1;
        }
    }

    /// Moves the oldest job out and drops it.
    pub(super) fn discard(&mut self, without: Option<Rule>) {
        match self.slot(0).job.take() {
            Some(Job { cleared: true }) => {}
            Some(Job { cleared: false }) => self.found(KEPT),
            None => self.found(EXECUTED_ONCE),
        }
        self.move_head(without);
    }

    /// A look has ended at a job.
    pub(super) fn begin(&mut self, at: u8, without: Option<Rule>) {
        self.see(at);
        self.reader.found_nothing = false;
        self.reader.phase = Reading::Executing { at, is_oldest: at == 0 };
        if without == Some(Rule::CompletingFrees) && at == 0 {
            self.move_head(without);
            self.reader.phase = Reading::Executing { at: self.slots.len() as u8 - 1, is_oldest: false };
        }
    }

    /// The reader sees a job.
    pub(super) fn see(&mut self, at: u8) {
        let job = self.slot(at).job;
        match job {
            None => self.found(EXECUTED_ONCE),
            Some(Job { cleared: true }) if self.reader.is_current => self.found(NOT_BEGUN),
            Some(_) => {}
        }
    }

    /// Take has ended without one.
    pub(super) fn find_nothing(&mut self, without: Option<Rule>) {
        self.reader.phase = Reading::Idle;
        if without == Some(Rule::GoneBeforeNothing) {
            self.reader.found_nothing = true;
        } else if self.reader.knows_gone {
            self.expect_nothing();
        }
    }

    /// The reader concludes that nothing will ever come.
    pub(super) fn expect_nothing(&mut self) {
        if self.slots.iter().any(|slot| slot.job.is_some_and(|job| !job.cleared)) {
            self.found(FOUND);
        }
    }

    pub(super) fn complete(&mut self, at: u8, is_oldest: bool, without: Option<Rule>) {
        if self.slot(at).job.take().is_none() {
            self.found(EXECUTED_ONCE);
        }
        self.reader.phase = Reading::Idle;
        if without == Some(Rule::CompletingFrees) {
            // The slot was given back when the job began.
        } else if is_oldest || without == Some(Rule::HeadWaitsForOldest) {
            self.move_head(without);
        } else if without != Some(Rule::CompletedIsMarked) {
            self.slot(at).stamp = Stamp::Completed;
            self.reader.ahead += 1;
        }
    }

    /// The end that leaves second drops what is left.
    pub(super) fn drop_jobs(&mut self) {
        for at in 0..self.slots.len() {
            let slot = &mut self.slots[at];
            match slot.stamp {
                Stamp::Job(_) => {
                    if slot.job.take().is_none() {
                        return self.found(DROPPED);
                    }
                }
                Stamp::Completed => {}
                Stamp::Free => return,
            }
        }
    }

    /// What holds between any two steps.
    pub(super) fn check(&self, max: u8, without: Option<Rule>) -> Option<&'static str> {
        let is_gone = (self.writer.phase, self.reader.phase) == (Writing::Gone, Reading::Gone);
        let kept = self.slots.iter().map(|slot| match (slot.stamp, slot.job) {
            (Stamp::Job(number), Some(Job { cleared: false })) => Some(number),
            _ => None,
        });
        let kept: Vec<Option<u8>> = kept.collect();
        let numbers: Vec<u8> = kept.iter().flatten().copied().collect();
        let is_queued_twice = numbers.iter().enumerate().any(|(at, number)| numbers[..at].contains(number));
        let follows = |pair: &[Option<u8>]| match pair {
            [Some(first), Some(second)] => *second == if *first < max { first + 1 } else { 1 },
            _ => true,
        };
        let is_cleared = |slot: &Slot| slot.job.is_some_and(|job| job.cleared);
        if let Some(property) = self.broken {
            Some(property)
        } else if is_gone && self.slots.iter().any(|slot| slot.job.is_some()) {
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

impl Writing {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ready => "Ready",
            Self::Claimed => "Claimed",
            Self::Leaving { .. } => "Leaving",
            Self::Gone => "Gone",
        }
    }
}

impl Reading {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Idle => "Idle",
            Self::Obeying { .. } => "Obeying",
            Self::Searching { list: true, .. } => "Listing",
            Self::Searching { list: false, .. } => "Searching",
            Self::Asking { .. } => "Asking",
            Self::Executing { .. } => "Executing",
            Self::Leaving { .. } => "Leaving",
            Self::Gone => "Gone",
        }
    }
}
