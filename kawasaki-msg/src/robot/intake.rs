//! The jobs of the active order on their way from the packet to the motion task: which is next, which are executed.

use robot_work_queue::Writer;

use crate::decoder::Decoder;
use crate::error::{MessageError, SessionError};
use crate::job::Job;
use crate::numbering::{NumberSet, Numbering};
use crate::plain::{Next, PlainJobs};

/// The queue's writer and the numbers around it.
///
/// The queue numbers its slots by itself. The numbers here are those on the wire: they go back when the queue is cleared, since
/// what was in it has to come again.
#[derive(Debug)]
pub(crate) struct Intake<'q> {
    writer: Writer<'q, Job>,
    numbering: Numbering,
    /// How many jobs of the order were queued.
    queued: u32,
    /// The number that the next one must have.
    expected: u16,
    /// Up to which count all are executed.
    executed: u32,
    /// Executed ahead of those before them.
    done: NumberSet,
    pending: Option<Pending>,
}

/// A reset that has not taken effect yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Pending {
    reset: Reset,
    /// The queue had settled when this was looked at last: what was executed meanwhile has been said now.
    seen: bool,
}

/// The two resets of the source (thesis, section 11.1.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reset {
    /// The list is cleared; what was in it comes again.
    List,
    /// The list is cleared, and the order is forgotten.
    Order,
}

impl<'q> Intake<'q> {
    pub(crate) fn new(writer: Writer<'q, Job>) -> Self {
        let numbering = Numbering::new(writer.max_number());
        let done = NumberSet::new();
        Self { writer, numbering, queued: 0, expected: 1, executed: 0, done, pending: None }
    }

    /// A new order: counts from 1.
    pub(crate) fn begin(&mut self) {
        (self.queued, self.expected, self.executed) = (0, 1, 0);
        self.done.clear();
    }

    /// Queues a job if it is the next one.
    pub(crate) fn offer(&mut self, job: Job) -> Result<(), MessageError> {
        if job.number != self.expected {
            return Err(self.misplaced(job.number));
        }
        if self.done.contains(job.number) {
            // Executed ahead of the others before the list was cleared.
            self.count_queued();
            return Ok(());
        }
        if self.pending.is_some() {
            return Err(MessageError::QueueFull { number: job.number });
        }
        let claim = self.writer.claim().map_err(|_| MessageError::QueueFull { number: job.number })?;
        claim.push(job);
        self.count_queued();
        Ok(())
    }

    /// Queues the plain jobs that come next in the stream, as far as there is room; how many there were.
    #[inline(never)] // by itself it fits the registers
    pub(crate) fn offer_plain(&mut self, decoder: &mut Decoder, plain: &PlainJobs) -> u32 {
        if self.pending.is_some() || !self.done.is_empty() {
            return 0;
        }
        let (mut next, mut queued) = (Next::new(self.expected, self.numbering.max()), 0);
        decoder.plain_jobs(plain, &mut next, |job| {
            let Ok(claim) = self.writer.claim() else { return false };
            claim.push(job);
            queued += 1;
            true
        });
        self.queued += queued;
        self.expected = next.number();
        queued
    }

    fn count_queued(&mut self) {
        self.queued += 1;
        self.expected = if self.expected >= self.numbering.max() { 1 } else { self.expected + 1 };
    }

    #[cold]
    fn misplaced(&self, found: u16) -> MessageError {
        let expected = self.expected;
        let ahead = self.numbering.ahead(self.queued, found);
        if found == 0 || found > self.numbering.max() {
            let max = i32::from(self.numbering.max());
            MessageError::OutOfRange { field: 1, found: i32::from(found), min: 1, max }
        } else if (2..=u32::from(self.numbering.max()) / 2).contains(&ahead) {
            MessageError::OutOfOrder { expected, found }
        } else {
            MessageError::Repeated { expected, found }
        }
    }

    /// The motion task has executed a job.
    pub(crate) fn done(&mut self, number: u16) -> Result<(), SessionError> {
        let ahead = self.numbering.ahead(self.executed, number);
        let window = self.queued - self.executed;
        if number == 0
            || number > self.numbering.max()
            || !(1..=window).contains(&ahead)
            || !self.done.insert(number)
        {
            return Err(SessionError::NotQueued { number });
        }
        self.settle_executed();
        Ok(())
    }

    /// Moves the frontier over what was executed ahead of it, also past what was queued again after the list was cleared.
    fn settle_executed(&mut self) {
        while self.done.remove(self.numbering.next(self.executed)) {
            self.executed += 1;
        }
        if self.queued < self.executed {
            self.queued = self.executed;
            self.expected = self.numbering.next(self.queued);
        }
    }

    /// Begins a reset. A reset of the order takes in one of the list.
    pub(crate) fn reset(&mut self, reset: Reset) {
        match reset {
            Reset::List => self.writer.clear(),
            Reset::Order => self.writer.reset(),
        }
        let order = self.pending.is_some_and(|pending| pending.reset == Reset::Order);
        let reset = if order { Reset::Order } else { reset };
        self.pending = Some(Pending { reset, seen: false });
    }

    /// The reset that has just taken effect. The motion task says that a job is done before it completes it, so that a settled
    /// queue and one more round of reports are the whole truth.
    pub(crate) fn poll_reset(&mut self) -> Option<Reset> {
        let pending = self.pending.as_mut()?;
        if !pending.seen {
            pending.seen = self.writer.is_settled() || self.writer.is_abandoned();
            return None;
        }
        let reset = pending.reset;
        self.pending = None;
        self.queued = self.executed;
        self.expected = self.numbering.next(self.queued);
        Some(reset)
    }

    pub(crate) fn is_resetting(&self) -> bool {
        self.pending.is_some()
    }

    /// Whether at most `low_water` jobs are left in the queue.
    pub(crate) fn drained(&self, low_water: usize) -> bool {
        self.writer.drained(low_water)
    }

    pub(crate) fn capacity(&self) -> usize {
        self.writer.capacity()
    }

    pub(crate) fn is_abandoned(&self) -> bool {
        self.writer.is_abandoned()
    }

    pub(crate) fn numbering(&self) -> Numbering {
        self.numbering
    }

    pub(crate) fn expected(&self) -> u16 {
        self.expected
    }

    pub(crate) fn queued(&self) -> u32 {
        self.queued
    }

    pub(crate) fn executed(&self) -> u32 {
        self.executed
    }

    /// The jobs that were executed ahead of others.
    pub(crate) fn done_ahead(&self) -> &NumberSet {
        &self.done
    }
}
