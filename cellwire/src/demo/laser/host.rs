//! The host of the demo: cuts a path, requests the robot's status if the outcome is unknown, and records the state of each
//! instruction.

use core::ops::Range;
use std::cell::Cell;
use std::collections::VecDeque;
use std::io;
use std::rc::Rc;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use laser_eb90::{Host, HostConfig, HostEvent, Item, SessionError};
use robot_session::end::End as _;
use robot_session::{Driver, ReceiveOutcome, SendOutcome, Session as _, Transport, Wait, now};

use super::path::Cut;
use crate::io::samples::Samples;
use cellwire_io::drive::turn;
use cellwire_io::port::AnyPort;
use cellwire_io::serial;
use cellwire_sim::laser::STATUS;
use cellwire_sim::ledger::ReportedOutcome;

/// The time for which questions continue when a run is over.
const GIVE_UP: Duration = Duration::from_secs(60);

/// A robot that has restarted answers like one that has not: only its status shows it. It is asked at least this often.
const ASK_AGAIN: Duration = Duration::from_secs(3);

/// A host on a port, with the path that it cuts.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub struct Cutter<'a> {
    driver: Driver<Port>,
    host: Host,
    /// The path to cut, and the known outcomes.
    pub plan: Plan<'a>,
}

/// The path, and the host's knowledge of each instruction.
#[derive(Debug)]
pub struct Plan<'a> {
    path: &'a [Cut],
    /// The maximum number of instructions of a frame.
    batch: u8,
    /// The instruction of the path that each ticket of the host belongs to; `None` for a question.
    tickets: Vec<Option<usize>>,
    /// The instructions to send, in sequence.
    todo: VecDeque<usize>,
    /// Whether to request the robot's status before the run continues, and the time of the last known status.
    ask: bool,
    asked: Duration,
    /// The number of times that the robot had started when it was asked last.
    boot: Option<i16>,
    /// The number of queued instructions that the robot had certainly executed when it was asked last.
    executed_before: usize,
    /// The instructions that the robot has queued, in sequence.
    queued: Vec<usize>,
    /// When the last frame was sent.
    sent: Rc<Cell<Duration>>,
    /// The outcome of each instruction; `None` if it is not known.
    pub known: Vec<Option<ReportedOutcome>>,
    /// The instructions that the robot confirmed, and may have forgotten when it restarted.
    pub doubted: Vec<usize>,
    /// The counts of the run.
    pub counts: HostCounts,
}

/// A port that notes when a frame was sent.
struct Port(AnyPort, Rc<Cell<Duration>>);

impl Transport for Port {
    fn receive(&mut self, buffer: &mut [u8], wait: Wait<'_>) -> io::Result<ReceiveOutcome> {
        self.0.receive(buffer, wait)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<SendOutcome> {
        self.1.set(now());
        self.0.send(bytes)
    }

    fn discard_after(&mut self, after: Duration) -> io::Result<()> {
        self.0.discard_after(after)
    }
}

/// The counts of a host.
#[derive(Debug, Clone, Default)]
pub struct HostCounts {
    /// Instructions that the robot has queued.
    pub queued: u64,
    /// Frames sent again after an error code.
    pub resent: u64,
    /// Frames refused to the end; their instructions were sent in a later frame.
    pub refused: u64,
    /// Questions asked after an unknown outcome.
    pub asked: u64,
    /// Restarts of the robot that were noticed.
    pub restarts: u64,
    /// The times from handing a frame over to its answer.
    pub exchange: Samples,
}

impl<'a> Cutter<'a> {
    /// Creates a host at the beginning of the path.
    ///
    /// # Errors
    /// A configuration that cannot work.
    pub fn new(port: AnyPort, path: &'a [Cut], config: HostConfig) -> Result<Self> {
        let sent = Rc::new(Cell::new(now()));
        let mut host = Host::new(config)?;
        host.handle_connected(now());
        let plan = Plan {
            path,
            batch: 1,
            tickets: Vec::new(),
            todo: (0..path.len()).collect(),
            ask: true,
            asked: now(),
            boot: None,
            executed_before: 0,
            queued: Vec::new(),
            sent: Rc::clone(&sent),
            known: vec![None; path.len()],
            doubted: Vec::new(),
            counts: HostCounts::default(),
        };
        Ok(Self { driver: Driver::new(Port(port, sent)), host, plan })
    }

    /// Cuts for `time` or to the end of the path, `batch` instructions in a frame, and lets the last frame find its outcome, if
    /// need be by asking; asks once more, so that a restart does not go unnoticed. Returns how many instructions were queued.
    ///
    /// # Errors
    /// If the port fails.
    pub fn cut(&mut self, time: Duration, batch: u8, mut progress: impl FnMut(u64)) -> Result<u64> {
        let Self { driver, host, plan } = self;
        let (before, end) = (plan.counts.queued, now() + time);
        plan.batch = batch;
        let mut asked_last = false;
        loop {
            ensure!(now() < end + GIVE_UP, "the robot does not answer: please report this as a bug");
            plan.ask |= now() >= plan.asked + ASK_AGAIN;
            plan.ask(host)?;
            if now() < end {
                plan.fill(host)?;
            }
            if host.is_idle() {
                if asked_last {
                    break;
                }
                (plan.ask, asked_last) = (true, true);
                continue;
            }
            let handler = |host: &mut Host, event| plan.take(host, event);
            let goes_on =
                turn(driver, host, Some(serial::READ_TIMEOUT), handler).context("the robot's port")?;
            ensure!(goes_on, "the robot's port is gone");
            progress((plan.path.len() - plan.todo.len()) as u64);
        }
        Ok(plan.counts.queued - before)
    }
}

impl Plan<'_> {
    /// Submits the question that is open.
    fn ask(&mut self, host: &mut Host) -> Result<()> {
        if self.ask {
            match host.submit(STATUS, |_| Ok(())) {
                Ok(_) => {
                    self.tickets.push(None);
                    (self.ask, self.asked) = (false, now());
                }
                Err(SessionError::Full) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Submits the instructions that fit into the next frame.
    fn fill(&mut self, host: &mut Host) -> Result<()> {
        while !self.ask
            && host.machine().next.is_none_or(|next| next.count < self.batch)
            && let Some(&index) = self.todo.front()
            && let Some(cut) = self.path.get(index)
        {
            match host.submit(cut.word, |parameters| cut.write(parameters)) {
                Ok(_) => {
                    self.tickets.push(Some(index));
                    self.todo.pop_front();
                }
                Err(SessionError::Full) => break,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    fn take(&mut self, host: &mut Host, event: HostEvent) -> Result<()> {
        let (first, count, fate) = match event {
            HostEvent::Done { first, count, resends, .. } => {
                self.counts.resent += u64::from(resends);
                if resends == 0 {
                    self.counts.exchange.add(now().saturating_sub(self.sent.get()));
                }
                (first, count, InstructionOutcome::Queued)
            }
            HostEvent::Answer { .. } => {
                let Some(Ok(Item::I16(values))) = host.answer().next() else {
                    anyhow::bail!("no status: {:?}", host.answer())
                };
                let [boot, _, held] = values.array().context("a status has three shorts")?;
                self.take_status(boot, usize::try_from(held)?);
                return Ok(());
            }
            HostEvent::Refused { first, count, .. } => (first, count, InstructionOutcome::Refused),
            HostEvent::Unknown { first, count, .. } => (first, count, InstructionOutcome::Unknown),
            _ => return Ok(()),
        };
        // Instructions that were submitted meanwhile wait until the robot's status is known. Their tickets are never used again.
        if fate != InstructionOutcome::Queued {
            let back = self.tickets.len() - usize::from(host.take_back());
            self.again(back..self.tickets.len());
            host.resume();
        }
        let first = usize::try_from(first)?;
        let tickets = first..first + usize::from(count);
        match fate {
            InstructionOutcome::Refused => {
                self.note(tickets.clone(), ReportedOutcome::NotDone);
                self.again(tickets);
            }
            InstructionOutcome::Queued => self.note(tickets, ReportedOutcome::Done),
            InstructionOutcome::Unknown => self.note(tickets, ReportedOutcome::Unknown),
        }
        match fate {
            InstructionOutcome::Queued => {}
            InstructionOutcome::Refused => self.counts.refused += 1,
            InstructionOutcome::Unknown => {
                self.counts.asked += 1;
                self.ask = true;
            }
        }
        Ok(())
    }

    /// Puts back instructions that were not accepted: they come first.
    fn again(&mut self, tickets: Range<usize>) {
        for ticket in self.tickets.get(tickets).unwrap_or_default().iter().rev() {
            match ticket {
                Some(index) => self.todo.push_front(*index),
                None => self.ask = true,
            }
        }
    }

    fn note(&mut self, tickets: Range<usize>, known: ReportedOutcome) {
        for ticket in self.tickets.get(tickets).unwrap_or_default() {
            let Some(index) = *ticket else { continue };
            if let Some(slot) = self.known.get_mut(index) {
                *slot = Some(known);
            }
            if known == ReportedOutcome::Done {
                self.queued.push(index);
                self.counts.queued += 1;
            }
        }
    }

    /// Handles a status. A robot that has restarted has lost the instructions in its queue: of those that were queued before
    /// the last request, at most as many as its queue had at that time; any of those that were queued since.
    fn take_status(&mut self, boot: i16, held: usize) {
        if self.boot.is_some_and(|before| before != boot) {
            self.counts.restarts += 1;
            let doubted = self.queued.split_off(self.executed_before);
            for index in &doubted {
                if let Some(slot) = self.known.get_mut(*index) {
                    *slot = Some(ReportedOutcome::Unknown);
                }
            }
            self.doubted.extend(doubted);
        }
        (self.boot, self.executed_before) = (Some(boot), self.queued.len().saturating_sub(held));
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum InstructionOutcome {
    Queued,
    Refused,
    Unknown,
}
