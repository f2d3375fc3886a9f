//! The client's machine: the request in flight, its deadline, and the request that a reply belongs to. No bytes.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Expiry, Machine, is_due};

use super::config::{ClientConfig, Rule};
pub use super::input::{Action, DueRequest, Input, ReplyMatch};
use super::request_state::free_transaction;
pub use super::request_state::{RequestState, Stage};
pub use super::slot_set::SlotSet;
pub use crate::line::Line;

/// The state of a client with `N` request slots.
///
#[doc = include_str!("../../diagrams/client.md")]
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct ClientMachine<const N: usize> {
    /// The connection, and the conditions before the next request is sent.
    pub link: ClientLink,
    /// The requests, oldest first; the last are `None`.
    requests: [Option<RequestState>; N],
    /// The transaction of the next request, if it is free.
    transaction: u16,
}

/// The connection, and the conditions before the next request is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ClientLink {
    /// There is no connection: requests wait for it.
    Down,
    /// There is a connection, on which requests are sent.
    Up {
        /// The line's activity: whether bytes are arriving.
        line: Line,
        /// Whether earlier requests allow that something is sent.
        quiet: QuietTime,
        /// Whether a reply has come that the line cannot have returned, so that a device answers on it. Over TCP always true.
        proven: bool,
    },
}

/// The time in which nothing is sent, because of an earlier request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QuietTime {
    /// The time is over, and the bytes that had arrived until then were read.
    Over,
    /// A late reply may come, or a broadcast is being executed.
    Until {
        /// The time ends with the first [`Input::Timeout`] from then on: a driver gives that after it has read the bytes that
        /// have arrived, however late it runs.
        end: Duration,
    },
}

impl<const N: usize> Machine for ClientMachine<N> {
    const END: &'static str = "client";
    /// A reply that a late caller reads after the deadline still counts.
    const EXPIRY: Expiry = Expiry::Last;
    type Input = Input;
    type Action = Action;
    type Transmit = DueRequest;
    type Config = ClientConfig;

    /// # Errors
    /// Bytes without a connection, a request without a free slot, an outcome that was not reported, a request sent that was
    /// not due.
    #[inline(always)] // where the input is known, little of it is left
    fn on(&mut self, now: Duration, input: Input, config: &ClientConfig) -> Result<Action, Unexpected> {
        let action = match input {
            Input::Connected => Some(self.connected(now, config)),
            Input::Disconnected => Some(self.disconnected(config)),
            Input::Timeout => Some(self.timeout(now, config)),
            Input::Request { broadcast, mirrored } => self.request(broadcast, mirrored, config),
            Input::Taken { slot } => self.taken(slot),
            Input::Received => match &mut self.link {
                ClientLink::Down => None,
                ClientLink::Up { line, .. } => {
                    // Bytes that come after a silence do not continue the bytes before it.
                    let cuts = line.was_silent(now) && config.keeps(Rule::CutAtSilence);
                    line.receive(now, config.framing);
                    Some(if cuts { Action::Cut } else { Action::Nothing })
                }
            },
            Input::Partial => self.partial(config),
            Input::Reply { transaction, fit } => match self.link {
                ClientLink::Down => None,
                ClientLink::Up { .. } => Some(self.reply(now, transaction, fit, config)),
            },
            Input::Corrupt => match self.link {
                ClientLink::Down => None,
                ClientLink::Up { .. } => Some(self.corrupt(config)),
            },
            Input::Sent(due) => self.sent(now, due, config),
        };
        action.ok_or_else(|| self.unexpected(&input))
    }

    #[inline(always)]
    fn transmit(&self, now: Duration, config: &ClientConfig) -> Option<DueRequest> {
        if !self.may_send(now, config) {
            return None;
        }
        // The requests in flight were made before those that wait.
        let mut in_flight = 0;
        let queued = self.held().find(|held| {
            in_flight += usize::from(held.is_in_flight());
            held.is_queued()
        });
        let RequestState { slot, stage } = *queued?;
        let transaction = if config.framing.has_transactions() && stage != Stage::QueuedBroadcast {
            free_transaction(&self.requests, self.transaction, config)
        } else {
            0
        };
        let probe = self.needs_probe(stage, config);
        (in_flight < config.most_in_flight()).then_some(DueRequest { slot, transaction, probe })
    }

    fn deadline(&self) -> Option<Duration> {
        let ClientLink::Up { line, quiet, .. } = self.link else { return None };
        let end = match quiet {
            QuietTime::Over => None,
            QuietTime::Until { end } => Some(end),
        };
        let deadlines = self.held().filter_map(RequestState::deadline).chain(line.ends_at()).chain(end);
        deadlines.min().filter(|at| *at < Duration::MAX)
    }

    fn expires(&self, now: Duration) -> bool {
        self.deadline().is_some_and(|at| at <= now)
    }

    fn each_time(&mut self, mut f: impl FnMut(&mut Duration)) {
        if let ClientLink::Up { line, quiet, .. } = &mut self.link {
            line.ends_at_mut().into_iter().for_each(&mut f);
            if let QuietTime::Until { end } = quiet {
                f(end);
            }
        }
        for held in self.requests.iter_mut().flatten() {
            if let Stage::Probing { deadline, .. } | Stage::InFlight { deadline, .. } = &mut held.stage {
                f(deadline);
            }
        }
    }

    fn name(&self) -> &'static str {
        let ClientLink::Up { line, quiet, .. } = self.link else { return "Disconnected" };
        match (self.in_flight(), quiet, line) {
            (1.., _, _) => "Waiting",
            (0, QuietTime::Until { .. }, _) => "Quiet",
            (0, QuietTime::Over, Line::Busy { .. } | Line::Partial { .. }) => "Receiving",
            (0, QuietTime::Over, Line::Silent) if self.held().any(RequestState::is_queued) => "Ready",
            (0, QuietTime::Over, Line::Silent) => "Idle",
        }
    }
}

impl<const N: usize> ClientMachine<N> {
    /// A client without a connection and without requests.
    pub const NEW: Self = Self { link: ClientLink::Down, requests: [None; N], transaction: 1 };

    /// Returns the number of requests in flight, or whose read before is.
    pub fn in_flight(&self) -> usize {
        self.held().filter(|held| held.is_in_flight()).count()
    }

    /// Returns the requests, oldest first.
    pub fn held(&self) -> impl Iterator<Item = &RequestState> {
        self.requests.iter().map_while(Option::as_ref)
    }

    /// Returns the slot for the next request: a free one, or that of the request that expired longest ago.
    #[inline(always)] // twice for a request: before it is written, and when it is kept
    pub fn free_slot(&self) -> Option<u8> {
        let mut taken = SlotSet::default();
        self.held().for_each(|held| taken.insert(held.slot));
        match taken.first_outside() {
            slot if usize::from(slot) < N => Some(slot),
            _ => self.held().find(|held| matches!(held.stage, Stage::Expired { .. })).map(|held| held.slot),
        }
    }

    /// Returns the request in flight, or whose read before is, that a frame with this transaction belongs to.
    pub fn expects(&self, transaction: u16, config: &ClientConfig) -> Option<&RequestState> {
        self.held().find(|held| held.waits(transaction, config))
    }

    /// Returns the transaction of the oldest request in flight.
    pub fn awaited(&self) -> Option<u16> {
        self.held().find_map(|held| match held.stage {
            Stage::InFlight { transaction, .. } => Some(transaction),
            _ => None,
        })
    }

    /// Begins a connection. Except on TCP, nothing is sent at first: a client that ran here before may have sent a request.
    fn connected(&mut self, now: Duration, config: &ClientConfig) -> Action {
        let reset = self.disconnected(config);
        let drain = config.timeout.saturating_add(config.settle);
        let quiet = if config.framing.is_serial() && config.keeps(Rule::DrainFirst) {
            QuietTime::Until { end: now.saturating_add(drain) }
        } else {
            QuietTime::Over
        };
        self.link = ClientLink::Up { line: Line::Silent, quiet, proven: config.framing.has_transactions() };
        reset
    }

    /// Ends a connection. Waiting requests are not sent on the next one unless the caller makes them again.
    fn disconnected(&mut self, config: &ClientConfig) -> Action {
        let (mut lost, mut not_sent) = (SlotSet::default(), SlotSet::default());
        if self.link != ClientLink::Down {
            for held in self.requests.iter_mut().map_while(Option::as_mut) {
                match held.stage {
                    Stage::Queued { .. } | Stage::QueuedBroadcast if !config.keeps(Rule::DropQueued) => {}
                    Stage::Queued { .. } | Stage::QueuedBroadcast | Stage::Probing { .. } => {
                        not_sent.insert(held.slot);
                        held.stage = Stage::Ended;
                    }
                    Stage::InFlight { .. } if !config.keeps(Rule::EndAtDisconnect) => {}
                    Stage::InFlight { .. } => {
                        lost.insert(held.slot);
                        held.stage = Stage::Ended;
                    }
                    Stage::TimedOut { .. } => held.stage = Stage::Ended,
                    Stage::Ended | Stage::Expired { .. } => {}
                }
            }
            let is_expired = |held: &RequestState| matches!(held.stage, Stage::Expired { .. });
            while let Some(index) = self.requests.iter().flatten().position(is_expired) {
                self.remove(index);
            }
            self.link = ClientLink::Down;
        }
        Action::Reset { lost, not_sent }
    }

    fn request(&mut self, broadcast: bool, mirrored: bool, config: &ClientConfig) -> Option<Action> {
        let slot = self.free_slot()?;
        let expired = self.held().position(|held| held.slot == slot);
        if let Some(expired) = expired {
            self.remove(expired);
        }
        let is_open = match self.link {
            ClientLink::Down => !config.framing.has_transactions(),
            ClientLink::Up { proven, .. } => !proven,
        };
        let mirrored = mirrored && is_open;
        let stage = if broadcast { Stage::QueuedBroadcast } else { Stage::Queued { mirrored } };
        let free = self.requests.iter_mut().find(|held| held.is_none())?;
        *free = Some(RequestState { slot, stage });
        Some(Action::Keep { slot })
    }

    fn taken(&mut self, slot: u8) -> Option<Action> {
        let index = self.held().position(|held| held.slot == slot)?;
        let held = self.requests.get_mut(index)?.as_mut()?;
        match held.stage {
            Stage::Ended => drop(self.remove(index)),
            Stage::TimedOut { transaction } => held.stage = Stage::Expired { transaction },
            Stage::Queued { .. }
            | Stage::QueuedBroadcast
            | Stage::Probing { .. }
            | Stage::InFlight { .. }
            | Stage::Expired { .. } => return None,
        }
        Some(Action::Nothing)
    }

    /// Returns whether the line and earlier requests allow that something is sent.
    fn may_send(&self, now: Duration, config: &ClientConfig) -> bool {
        let ClientLink::Up { line, quiet, .. } = self.link else { return false };
        let is_quiet = match quiet {
            QuietTime::Over => false,
            // Without the rule a late driver sends before it has read the late reply.
            QuietTime::Until { end } => config.keeps(Rule::ReadBeforeSend) || now < end,
        };
        // The rest of a reply is awaited from its first bytes on, not from a silence on. If a line returns the bytes sent,
        // the first bytes must be these.
        let is_silent = !config.echo || line == Line::Silent;
        let may_send = line.may_send(config.framing) && !matches!(line, Line::Partial { .. }) && is_silent;
        let is_busy = !may_send && config.keeps(Rule::WaitForSilence);
        !is_quiet && !is_busy
    }

    /// Returns whether a reply to another request must show, before this request, that a device answers on the line.
    fn needs_probe(&self, stage: Stage, config: &ClientConfig) -> bool {
        let is_proven = matches!(self.link, ClientLink::Up { proven: true, .. });
        stage == Stage::Queued { mirrored: true } && !is_proven && config.keeps(Rule::ProveEcho)
    }

    #[inline(always)]
    fn sent(&mut self, now: Duration, due: DueRequest, config: &ClientConfig) -> Option<Action> {
        let DueRequest { slot, transaction, probe } = due;
        if !self.may_send(now, config) {
            return None;
        }
        let stage = self.held().find(|held| held.slot == slot)?.stage;
        if probe != self.needs_probe(stage, config) {
            return None;
        }
        let ClientLink::Up { quiet, .. } = &mut self.link else { return None };
        let mut requests = self.requests.iter_mut().map_while(Option::as_mut);
        let held = requests.find(|held| held.slot == slot)?;
        match stage {
            Stage::Queued { .. } if probe => {
                held.stage = Stage::Probing { deadline: now.saturating_add(config.timeout), doubtful: false };
                *quiet = QuietTime::Over;
                Some(Action::Sent)
            }
            Stage::Queued { .. } => {
                let deadline = now.saturating_add(config.timeout);
                held.stage = Stage::InFlight { transaction, deadline, doubtful: false, returned: false };
                *quiet = QuietTime::Over;
                if config.framing.has_transactions() {
                    self.transaction = config.after(transaction);
                }
                Some(Action::Sent)
            }
            Stage::QueuedBroadcast => {
                held.stage = Stage::Ended;
                *quiet = QuietTime::Until { end: now.saturating_add(config.turnaround) };
                Some(Action::Announced { slot })
            }
            Stage::Probing { .. }
            | Stage::InFlight { .. }
            | Stage::Ended
            | Stage::TimedOut { .. }
            | Stage::Expired { .. } => None,
        }
    }

    #[inline(always)]
    fn reply(&mut self, now: Duration, transaction: u16, fit: ReplyMatch, config: &ClientConfig) -> Action {
        let mut requests = self.requests.iter_mut().map_while(Option::as_mut);
        let Some(held) = requests.find(|held| held.waits(transaction, config)) else {
            return self.late_reply(transaction);
        };
        let mut is_proof = true;
        let fits = match fit {
            ReplyMatch::Full => true,
            ReplyMatch::Equal => {
                let is_proven = matches!(self.link, ClientLink::Up { proven: true, .. });
                // A true reply may follow: an exception, or the reply to the request after the bytes that the line has
                // returned.
                if let (Stage::InFlight { returned, .. }, false, true) =
                    (&mut held.stage, is_proven, config.keeps(Rule::ProveReply))
                {
                    *returned = true;
                    return Action::Nothing;
                }
                is_proof = false;
                true
            }
            ReplyMatch::Exception | ReplyMatch::OpenException => {
                let is_doubtful = matches!(
                    held.stage,
                    Stage::Probing { doubtful: true, .. } | Stage::InFlight { doubtful: true, .. }
                ) && config.keeps(Rule::DoubtException);
                if is_doubtful && fit == ReplyMatch::OpenException {
                    return Action::Hold;
                }
                !is_doubtful
            }
            ReplyMatch::Mismatch => !config.keeps(Rule::CheckReply),
        };
        let is_probe = matches!(held.stage, Stage::Probing { .. });
        // Without a transaction the frame may be a late reply to an earlier request: the right one may still come.
        if !fits && !config.framing.has_transactions() {
            return Action::Stray { late: None };
        }
        held.stage = if is_probe { Stage::Queued { mirrored: false } } else { Stage::Ended };
        let slot = held.slot;
        if let ClientLink::Up { quiet, proven, .. } = &mut self.link {
            *proven |= is_proof;
            if !config.pause.is_zero() {
                *quiet = QuietTime::Until { end: now.saturating_add(config.pause) };
            }
        }
        match fits {
            _ if is_probe => Action::Nothing,
            true => Action::Replied { slot },
            false => Action::Refused { slot },
        }
    }

    /// Waits for the rest of the reply as long as for the reply itself.
    fn partial(&mut self, config: &ClientConfig) -> Option<Action> {
        let until = self.held().find_map(RequestState::deadline)?;
        let ClientLink::Up { line: line @ Line::Busy { .. }, .. } = &mut self.link else { return None };
        if config.keeps(Rule::AwaitRest) {
            line.wait_for_rest(until);
        }
        Some(Action::Nothing)
    }

    /// Handles corrupt bytes. With transactions a reply is identified by more than its shape.
    #[cold]
    fn corrupt(&mut self, config: &ClientConfig) -> Action {
        if !config.framing.has_transactions() {
            for held in self.requests.iter_mut().map_while(Option::as_mut) {
                if let Stage::Probing { doubtful, .. } | Stage::InFlight { doubtful, .. } = &mut held.stage {
                    *doubtful = true;
                }
            }
        }
        Action::Nothing
    }

    #[cold]
    fn late_reply(&mut self, transaction: u16) -> Action {
        let is_late = |held: &RequestState| match held.stage {
            Stage::TimedOut { transaction: found } | Stage::Expired { transaction: found } => {
                found == transaction
            }
            _ => false,
        };
        // The newest: off TCP the best guess.
        let Some(index) = self.requests.iter().rposition(|held| held.as_ref().is_some_and(is_late)) else {
            return Action::Stray { late: None };
        };
        let late = self.requests.get_mut(index).and_then(Option::as_mut).map(|held| {
            let stage = core::mem::replace(&mut held.stage, Stage::Ended);
            (held.slot, matches!(stage, Stage::Expired { .. }))
        });
        if let Some((_, true)) = late {
            self.remove(index);
        }
        Action::Stray { late: late.map(|(slot, _)| slot) }
    }

    /// Handles one due deadline: the end of a frame may bring the reply to a request that would time out.
    fn timeout(&mut self, now: Duration, config: &ClientConfig) -> Action {
        let ClientLink::Up { line, quiet, .. } = &mut self.link else { return Action::Nothing };
        if line.is_due(now) {
            *line = Line::Silent;
            return if config.keeps(Rule::CutAtSilence) { Action::Cut } else { Action::Nothing };
        }
        if matches!(quiet, QuietTime::Until { end } if is_due(*end, now)) {
            *quiet = QuietTime::Over;
            return Action::Nothing;
        }
        let (mut silent, mut equal, mut has_ended) = (SlotSet::default(), SlotSet::default(), false);
        for held in self.requests.iter_mut().map_while(Option::as_mut) {
            if !held.deadline().is_some_and(|at| is_due(at, now)) {
                continue;
            }
            if let Stage::InFlight { transaction, returned, .. } = held.stage {
                held.stage = Stage::TimedOut { transaction };
                if returned { equal.insert(held.slot) } else { silent.insert(held.slot) }
            } else {
                // A missing reply proves nothing: the line may have returned the bytes damaged, or may not have returned them
                // this time.
                held.stage = Stage::Queued { mirrored: false };
            }
            has_ended = true;
        }
        if !has_ended {
            return Action::Nothing;
        }
        let wait =
            if config.framing.has_transactions() { config.pause } else { config.settle.max(config.pause) };
        if !wait.is_zero() {
            *quiet = QuietTime::Until { end: now.saturating_add(wait) };
        }
        let is_probe = silent == SlotSet::default() && equal == SlotSet::default();
        if is_probe { Action::Nothing } else { Action::TimedOut { silent, returned: equal } }
    }

    fn remove(&mut self, index: usize) -> Option<RequestState> {
        let mut rest = self.requests.get_mut(index..)?;
        let held = rest.first_mut()?.take()?;
        // Only as far as there are requests, which are few.
        while let [free, next, ..] = rest
            && next.is_some()
        {
            core::mem::swap(free, next);
            rest = rest.get_mut(1..)?;
        }
        Some(held)
    }
}
