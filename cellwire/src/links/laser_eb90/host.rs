//! The host of the demo: cuts a path, asks the robot when it does not know, and notes what it knows of each instruction.

use core::ops::Range;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use laser_eb90::{Frame, Host, HostConfig, HostEvent, Item, SessionError};
use serialport::SerialPort;

use super::controller::STATUS;
use super::path::Cut;
use super::tally::Known;
use crate::line::Clock;
use crate::report::Samples;

/// How long questions go on when a run is over.
const GIVE_UP: Duration = Duration::from_secs(60);

/// A host on a port, with the path that it cuts.
#[allow(missing_debug_implementations, reason = "it holds a port")]
pub struct Cutter<'a> {
    port: Box<dyn SerialPort>,
    clock: Clock,
    path: &'a [Cut],
    host: Host,
    /// What each ticket of this host was: an instruction of the path, or a question.
    tickets: Vec<Option<usize>>,
    /// What is to be sent, in this order.
    todo: VecDeque<usize>,
    /// Whether to ask for the robot's status before going on.
    ask: bool,
    /// How often the robot had started when it was asked last, and what its queue holds.
    boot: Option<i16>,
    queue: usize,
    /// What the robot has queued, in this order.
    queued: Vec<usize>,
    /// What is known of each instruction.
    pub known: Vec<Option<Known>>,
    /// What was counted.
    pub counts: HostCounts,
}

/// What a host has seen.
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
    /// From handing a frame over to its answer.
    pub exchange: Samples,
}

impl<'a> Cutter<'a> {
    /// A host at the beginning of the path.
    pub fn new(port: Box<dyn SerialPort>, clock: Clock, path: &'a [Cut], config: HostConfig) -> Self {
        Self {
            port,
            clock,
            path,
            host: Host::new(config),
            tickets: Vec::new(),
            todo: (0..path.len()).collect(),
            ask: true,
            boot: None,
            queue: 0,
            queued: Vec::new(),
            known: vec![None; path.len()],
            counts: HostCounts::default(),
        }
    }

    /// Goes on with other settings. Only between frames.
    pub fn set(&mut self, config: HostConfig) {
        self.host = Host::new(config);
        self.tickets.clear();
    }

    /// Cuts until `end` or the end of the path, and lets the last frame find its outcome, if need be by asking. Returns how many instructions were
    /// queued.
    ///
    /// # Errors
    /// When the port fails.
    pub fn cut(&mut self, end: Duration, mut progress: impl FnMut(u64)) -> Result<u64> {
        let before = self.counts.queued;
        let (mut sent_at, mut buffer) = (self.clock.now(), [0; Frame::MAX_LEN]);
        loop {
            let now = self.clock.now();
            ensure!(now < end + GIVE_UP, "the robot answers no question: please report this as a bug");
            self.ask()?;
            if now < end {
                self.fill()?;
            }
            if self.host.is_idle() {
                break;
            }
            if let Some(n) = self.host.poll_transmit(now, &mut buffer) {
                sent_at = now;
                self.port.write_all(buffer.get(..n).unwrap_or_default())?;
            }
            let wake = self.host.poll_timeout().unwrap_or(now).saturating_sub(now);
            self.port.set_timeout(wake.clamp(Duration::from_micros(100), Duration::from_millis(50)))?;
            match self.port.read(&mut buffer) {
                Ok(n) => self.host.handle_input(self.clock.now(), buffer.get(..n).unwrap_or_default()),
                Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(e) => return Err(e).context("the robot's port"),
            }
            self.host.handle_timeout(self.clock.now());
            self.take_events(sent_at)?;
            progress((self.path.len() - self.todo.len()) as u64);
        }
        Ok(self.counts.queued - before)
    }

    /// Submits the question that is open.
    fn ask(&mut self) -> Result<()> {
        if self.ask {
            match self.host.submit(STATUS, |_| Ok(())) {
                Ok(_) => {
                    self.tickets.push(None);
                    self.ask = false;
                }
                Err(SessionError::Full) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// Submits what fits into the next frame.
    fn fill(&mut self) -> Result<()> {
        if self.ask {
            return Ok(());
        }
        while let Some(&index) = self.todo.front() {
            let Some(cut) = self.path.get(index) else { break };
            match self.host.submit(cut.word, |parameters| cut.write(parameters)) {
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

    fn take_events(&mut self, sent_at: Duration) -> Result<()> {
        let (first, count, fate) = match self.host.poll_event() {
            None => return Ok(()),
            Some(HostEvent::Done { first, count, resends, .. }) => {
                self.counts.resent += u64::from(resends);
                if resends == 0 {
                    self.counts.exchange.add(self.clock.now().saturating_sub(sent_at));
                }
                (first, count, Fate::Queued)
            }
            Some(HostEvent::Answer { mut values, .. }) => {
                let Some(Ok(Item::I16(values))) = values.next() else {
                    anyhow::bail!("no status: {values:?}")
                };
                let [boot, queue, _] = values.array().context("a status has three shorts")?;
                self.take_status(boot, usize::try_from(queue)?);
                return Ok(());
            }
            Some(HostEvent::Refused { first, count, .. }) => (first, count, Fate::Refused),
            Some(HostEvent::Unknown { first, count, .. }) => (first, count, Fate::Unknown),
        };
        // What has been submitted meanwhile waits until the robot has been asked. Its tickets are never used again.
        if fate != Fate::Queued {
            let back = self.tickets.len() - usize::from(self.host.take_back());
            self.again(back..self.tickets.len());
            self.host.resume();
        }
        let first = usize::try_from(first)?;
        let tickets = first..first + usize::from(count);
        match fate {
            Fate::Refused => self.again(tickets),
            Fate::Queued => self.note(tickets, Known::Queued),
            Fate::Unknown => self.note(tickets, Known::Unknown),
        }
        match fate {
            Fate::Queued => {}
            Fate::Refused => self.counts.refused += 1,
            Fate::Unknown => {
                self.counts.asked += 1;
                self.ask = true;
            }
        }
        Ok(())
    }

    /// These were not taken: they come first.
    fn again(&mut self, tickets: Range<usize>) {
        for ticket in self.tickets.get(tickets).unwrap_or_default().iter().rev() {
            match ticket {
                Some(index) => self.todo.push_front(*index),
                None => self.ask = true,
            }
        }
    }

    fn note(&mut self, tickets: Range<usize>, known: Known) {
        for ticket in self.tickets.get(tickets).unwrap_or_default() {
            let Some(index) = *ticket else { continue };
            if let Some(slot) = self.known.get_mut(index) {
                *slot = Some(known);
            }
            if known == Known::Queued {
                self.queued.push(index);
                self.counts.queued += 1;
            }
        }
    }

    /// A robot that has restarted has forgotten what was queued: at most as much as its queue holds.
    fn take_status(&mut self, boot: i16, queue: usize) {
        if self.boot.is_some_and(|before| before != boot) {
            self.counts.restarts += 1;
            let forgotten = self.queued.len().saturating_sub(self.queue);
            for index in self.queued.split_off(forgotten) {
                if let Some(slot) = self.known.get_mut(index) {
                    *slot = Some(Known::Unknown);
                }
            }
        }
        (self.boot, self.queue) = (Some(boot), queue);
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fate {
    Queued,
    Refused,
    Unknown,
}
