//! A host against balls of other makers.

use core::time::Duration;

use isra_ball::host::machine::{Action, Enquiry, HostMachine, Input, Poll};
use isra_ball::{ENQ, Host, HostConfig, HostEvent, Keys, Packet as Message, Status};

use super::world::{AGE, CLAIMED, Config, FOUND_OUT, LINE, ONE_OUTCOME, PAIRED, STALE, TICK};
use crate::faults::Faults;
use crate::model::{
    Actor, Cause, CauseOf, EXPECTED, InputOf, Peer, PeerAssumptions, SceneOf, WRITTEN, Wired,
};

/// Ticks after which every time of a poll or a connection has passed.
const LONG: u8 = 6;

pub(super) const ANSWERED: &str = "a reply that comes in time is the outcome of its poll";
pub(super) const WINDOW: &str = "a packet that can be the reply is its poll's outcome, and no other is";
pub(super) const DRAINED: &str = "the first poll is sent when no reply to an earlier one can come";
pub(super) const APART: &str = "a poll is a period after the last one, or later if that was missed";
pub(super) const PROVED: &str = "values live from the poll of the reply before theirs, for max_age";
pub(super) const MARKED: &str = "values that the ball marks as old are not new";

pub(super) const RULES: PeerAssumptions = PeerAssumptions {
    keeps: "IB-3, IB-33, IB-34, IB-35, replies no later than max_delay",
    free: "when it measures and answers, what is lost or corrupt, another ball with each connection",
    shows: &[("IB-9", WRITTEN), ("IB-25", PAIRED)],
    properties: &[AGE, STALE, ONE_OUTCOME, PAIRED, ANSWERED, EXPECTED],
};
pub(super) const PROMPT: PeerAssumptions = PeerAssumptions {
    keeps: "IB-3, IB-33, IB-34, IB-35, replies no later than max_delay, new values for each poll, no faults",
    free: "by how much a packet is late",
    shows: &[],
    properties: &[CLAIMED, AGE, STALE, ONE_OUTCOME, PAIRED, ANSWERED, EXPECTED],
};
pub(super) const LATE: PeerAssumptions = PeerAssumptions {
    keeps: "IB-3, IB-33, IB-34, IB-35, new values for each poll, all packets equally late",
    free: "what else goes wrong",
    shows: &[],
    properties: &[AGE, FOUND_OUT, STALE, ONE_OUTCOME, EXPECTED],
};
pub(super) const ANYTHING: PeerAssumptions = PeerAssumptions {
    keeps: "",
    free: "packets at any time",
    shows: &[("IB-9", WRITTEN), ("IB-25", APART)],
    properties: &[STALE, ONE_OUTCOME, WINDOW, DRAINED, APART, PROVED, MARKED, EXPECTED],
};

/// A ball of which only this is known.
#[derive(Debug, Clone, Copy)]
pub struct AnyBall {
    /// The host's configuration.
    pub config: Config,
    /// It sends nothing unasked (IB-3), one packet to all polls of a connection (IB-34, IB-35), and marks sent values
    /// as old (IB-33). No packet is later than `max_delay`. The times of its measurements, and whether it answers,
    /// are left open.
    pub keeps_rules: bool,
    /// The ticks by which ball and line are late at most, which is in time.
    pub(super) delay: u8,
    /// The ticks by which each packet is later.
    pub(super) lag: u8,
    /// If it answers each poll with new values: the number of polls and packets that are lost nevertheless.
    pub(super) prompt: Option<u8>,
}

/// The model's knowledge of the ball, the line and the values.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    /// Ticks since the ball has a poll that it may answer.
    asked: Option<u8>,
    /// Ticks since the ball has sent a packet: unsent values are not older.
    unsent: u8,
    /// On the line and in the host's input, oldest first.
    up: Vec<Packet>,
    /// The packet that is being read.
    read: Option<Packet>,
    /// The last poll has no outcome, or was missed.
    open: bool,
    missed: bool,
    /// Ticks since it, since the connection, and since the poll that the last reply of this connection has answered.
    since_poll: u8,
    since_connected: u8,
    proof: Option<u8>,
    /// The greatest age of the values in use.
    using: Option<u8>,
    /// With a late ball: the other faults, whether a packet was reported as not a reply, and the number of ticks for which
    /// values that are too old are used.
    faults: u8,
    said: bool,
    too_old: u8,
    wrong: Option<&'static str>,
}

/// A packet between the ball and the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Packet {
    /// Ticks until it arrives; 0 in the host's input.
    ticks: u8,
    fresh: bool,
    /// The greatest age of its values.
    age: u8,
    /// Whether it answers the last poll.
    reply: bool,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The ball sends a packet.
    Answer {
        /// As values that were not sent before.
        fresh: bool,
        /// The ticks by which it is late.
        late: u8,
    },
    /// The poll is lost, or the ball drops it.
    LosePoll,
    /// The oldest packet is lost or corrupt.
    Lose,
    /// The host reads the oldest packet.
    Read,
    /// The host reads a packet that was sent at an unknown time.
    Packet {
        /// As values that were not sent before.
        fresh: bool,
    },
}

impl AnyBall {
    pub(super) const fn new(config: Config, keeps_rules: bool) -> Self {
        Self { config, keeps_rules, delay: 1, lag: 0, prompt: None }
    }

    fn may_lose(&self, known: &Knowledge) -> bool {
        self.prompt.is_none_or(|most| known.faults < most)
    }

    fn lose(&self, known: &mut Knowledge) {
        known.faults += u8::from(self.prompt.is_some());
    }

    /// Returns the age from which on values are equally old.
    fn oldest(&self) -> u8 {
        self.config.max_age() + if self.lag > 0 { LINE + 3 } else { 1 }
    }

    /// Checks the properties that hold with a ball that keeps the rules.
    fn judge(&self, known: &mut Knowledge, read: Packet, action: Action) {
        if self.lag > 0 {
            known.said |= action == Action::Unasked;
            return;
        }
        let is_outcome = matches!(action, Action::New | Action::Old);
        if is_outcome && !read.reply {
            known.wrong = Some(PAIRED);
        }
        if !is_outcome && read.reply && known.since_poll <= LINE + self.delay {
            known.wrong = Some(ANSWERED);
        }
    }

    /// Checks the properties that hold with any ball.
    fn judge_clauses(&self, end: &HostMachine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        let config = &self.config.0;
        let since_poll = u32::from(known.since_poll) * TICK;
        let is_over = since_poll >= config.reply_window();
        let can_come = known.since_poll >= LINE && !is_over;
        let mut must = |holds: bool, what| {
            if !holds {
                known.wrong = Some(what);
            }
        };
        match action {
            Action::New | Action::Old => must(can_come, WINDOW),
            Action::Unasked => must(!(known.open && can_come), WINDOW),
            Action::Missed => must(is_over, WINDOW),
            Action::Nothing | Action::Sent | Action::Stale | Action::Closed { .. } => {}
        }
        if action == Action::New {
            must(cause != Cause::Step(Step::Packet { fresh: false }), MARKED);
            let age = known.proof.map_or(Duration::MAX, |ticks| u32::from(ticks) * TICK);
            let until = end.live_until().unwrap_or(Duration::MAX);
            must(age.saturating_add(until) <= config.max_age, PROVED);
        }
        if matches!(cause, Cause::Sent(_)) {
            must(u32::from(known.since_connected) * TICK >= config.quiet(), DRAINED);
            must(since_poll >= if known.missed { config.quiet() } else { config.period }, APART);
        }
    }
}

impl Peer for AnyBall {
    type End = HostMachine;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &HostConfig {
        &self.config.0
    }

    fn end(&self) -> HostMachine {
        HostMachine::Disconnected
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            asked: None,
            unsent: self.oldest(),
            up: Vec::new(),
            read: None,
            open: false,
            missed: false,
            since_poll: LONG,
            since_connected: 0,
            proof: None,
            using: None,
            faults: 0,
            said: false,
            too_old: 0,
            wrong: None,
        }
    }

    fn steps(&self, end: &HostMachine, known: &Knowledge, steps: &mut Vec<Step>) {
        let is_connected = *end != HostMachine::Disconnected;
        if !self.keeps_rules {
            if is_connected {
                steps.extend([true, false].map(|fresh| Step::Packet { fresh }));
            }
            return;
        }
        if let Some(waits) = known.asked {
            for late in 0..=self.delay - waits {
                steps.push(Step::Answer { fresh: true, late });
                if self.prompt.is_none() {
                    steps.push(Step::Answer { fresh: false, late });
                }
            }
            if self.may_lose(known) {
                steps.push(Step::LosePoll);
            }
        }
        if let Some(packet) = known.up.first() {
            if self.may_lose(known) {
                steps.push(Step::Lose);
            }
            if is_connected && packet.ticks == 0 {
                steps.push(Step::Read);
            }
        }
    }

    fn by(&self, step: Step) -> Actor {
        match step {
            Step::Read | Step::Packet { .. } => Actor::Line,
            Step::Answer { .. } | Step::LosePoll | Step::Lose => Actor::Others,
        }
    }

    fn apply(&self, _: &HostMachine, known: &mut Knowledge, step: Step) -> Option<InputOf<Self>> {
        match step {
            Step::Answer { fresh, late } => {
                // A stream keeps its order.
                let last = known.up.last().map_or(0, |packet| packet.ticks);
                let age = match (fresh, self.prompt) {
                    (true, Some(_)) => 0,
                    (true, None) => known.unsent,
                    (false, _) => self.oldest(),
                };
                let ticks = (LINE + late + self.lag).max(last);
                known.up.push(Packet { ticks, fresh, age, reply: known.open });
                (known.asked, known.unsent) = (None, 0);
                None
            }
            Step::LosePoll => {
                self.lose(known);
                known.asked = None;
                None
            }
            Step::Lose => {
                self.lose(known);
                known.up.remove(0);
                None
            }
            Step::Read => {
                let packet = known.up.remove(0);
                known.read = Some(packet);
                Some(Input::Packet { fresh: packet.fresh })
            }
            Step::Packet { fresh } => Some(Input::Packet { fresh }),
        }
    }

    fn sent(&self, _: &Enquiry) -> InputOf<Self> {
        Input::Sent
    }

    fn acted(&self, end: &HostMachine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        let read = known.read.take();
        if !self.keeps_rules {
            self.judge_clauses(end, known, cause, action);
        }
        if let Some(read) = read {
            self.judge(known, read, action);
        }
        let is_claimed = self.prompt.is_some() && self.lag == 0;
        if is_claimed && matches!(action, Action::Missed | Action::Stale | Action::Unasked) {
            known.wrong = Some(CLAIMED);
        }
        match action {
            Action::New | Action::Old => {
                known.end();
                known.missed = false;
                known.proof = Some(known.since_poll).filter(|_| !self.keeps_rules);
                if action == Action::New {
                    known.using = Some(read.map_or(0, |packet| packet.age));
                }
            }
            Action::Missed => {
                known.end();
                known.missed = true;
            }
            Action::Stale => known.using = None,
            Action::Closed { missed, stale } => {
                if missed {
                    known.end();
                }
                known.using = known.using.filter(|_| !stale);
            }
            Action::Nothing | Action::Sent | Action::Unasked => {}
        }
        match cause {
            Cause::Connected | Cause::Disconnected => {
                // The next ball may have values of long ago.
                (known.unsent, known.proof, known.since_connected) = (self.oldest(), None, 0);
                known.missed = false;
                known.up.iter_mut().for_each(|packet| packet.reply = false);
            }
            Cause::Sent(Enquiry) => {
                // A packet that has arrived before is read before, and is not a reply.
                known.up.retain(|packet| packet.ticks > 0 || self.lag > 0);
                known.up.iter_mut().for_each(|packet| packet.reply = false);
                (known.open, known.since_poll) = (true, 0);
                if self.keeps_rules {
                    known.asked = known.asked.or(Some(0));
                }
            }
            Cause::Due | Cause::Step(_) => {}
        }
    }

    fn tick(&self, known: &mut Knowledge) {
        let older = |ticks: &mut u8, most: u8| *ticks = (*ticks + 1).min(most);
        let oldest = self.oldest();
        older(&mut known.since_poll, LONG);
        if !self.keeps_rules {
            older(&mut known.since_connected, LONG);
            known.proof.iter_mut().for_each(|ticks| older(ticks, oldest));
            return;
        }
        older(&mut known.unsent, oldest);
        known.asked = known.asked.map(|waits| waits + 1).filter(|waits| *waits <= self.delay);
        known.using.iter_mut().for_each(|age| older(age, oldest));
        for packet in &mut known.up {
            packet.ticks = packet.ticks.saturating_sub(1);
            older(&mut packet.age, oldest);
        }
        let is_too_old = self.lag > 0 && known.using.is_some_and(|age| age > self.config.max_age());
        known.too_old = if is_too_old { (known.too_old + 1).min(oldest) } else { 0 };
    }

    fn restarted(&self, known: &mut Knowledge) {
        let up = known.up.iter().map(|packet| Packet { reply: false, ..*packet }).collect();
        let (faults, said) = (known.faults, known.said);
        *known = Knowledge { asked: known.asked, up, faults, said, wrong: known.wrong, ..self.known() };
    }

    fn broken(&self, end: &HostMachine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        broken.extend(known.wrong);
        if is_waiting(end) != known.open {
            broken.push(ONE_OUTCOME);
        }
        let live = end.live_until();
        if live.is_some() != known.using.is_some() {
            broken.push(STALE);
        }
        let (Some(age), Some(until)) = (known.using, live) else { return };
        if known.too_old > self.config.max_age() {
            broken.push(FOUND_OUT);
        }
        let is_alone = self.lag == 0 || self.prompt == Some(0);
        if self.keeps_rules
            && is_alone
            && !until.is_zero()
            && u32::from(age) * TICK + until > self.config.0.max_age
        {
            broken.push(AGE);
        }
    }

    /// Returns whether each poll has its outcome; if the ball measures, answers and follows the rules, also whether there
    /// are usable values.
    fn is_over(&self, end: &HostMachine, known: &Knowledge) -> bool {
        match self.keeps_rules {
            true if self.lag > 0 => known.said,
            true => known.using.is_some(),
            false => !is_waiting(end),
        }
    }

    fn is_urgent(&self, end: &HostMachine, known: &Knowledge) -> bool {
        let comes =
            *end != HostMachine::Disconnected && known.up.first().is_some_and(|packet| packet.ticks == 0);
        self.prompt.is_some() && (comes || known.asked.is_some_and(|waits| waits >= self.delay))
    }

    fn fault_free_step(&self, _: &HostMachine, known: &Knowledge) -> Option<Step> {
        match known.up.first() {
            Some(packet) if packet.ticks == 0 => Some(Step::Read),
            _ => known.asked.map(|_| Step::Answer { fresh: true, late: 0 }),
        }
    }
}

impl Wired for AnyBall {
    type Session = Host;

    const FAULTS: Faults = Faults::BAD_LINE;

    fn session(&self) -> Host {
        Host::new(self.config.0).expect("a configuration that works")
    }

    /// Returns whether a packet may pause: the host does not accept a packet that began before its poll as a reply. A ball
    /// that follows the rules does not send such a packet.
    fn may_pause(&self, _: Step) -> bool {
        self.keeps_rules
    }

    fn speak(&self, known: &Knowledge, step: Step, _: &mut Host, now: Duration) -> Vec<u8> {
        let fresh = match step {
            Step::Read => known.up.first().is_some_and(|packet| packet.fresh),
            Step::Packet { fresh } => fresh,
            Step::Answer { .. } | Step::LosePoll | Step::Lose => return Vec::new(),
        };
        let [a, b, c, ..] = now.as_micros().to_le_bytes().map(u8::cast_signed);
        let status = if fresh { Status::Fresh } else { Status::Old };
        let packet =
            Message { sensor_type: 3, sensor: 4, status, force: [a, b, c], moment: [a; 3], keys: Keys::NONE };
        packet.to_bytes().expect("it is a packet").to_vec()
    }

    fn is_written(&self, _: &SceneOf<Self>, _: &Enquiry, bytes: &[u8]) -> bool {
        bytes == [ENQ]
    }

    fn reports(&self, action: &Action, reports: &mut Vec<String>) {
        let names: &[&str] = match action {
            Action::New => &["new"],
            Action::Old => &["old"],
            Action::Unasked => &["unasked"],
            Action::Missed | Action::Closed { missed: true, stale: false } => &["missed"],
            Action::Stale | Action::Closed { missed: false, stale: true } => &["stale"],
            Action::Closed { missed: true, stale: true } => &["missed", "stale"],
            Action::Closed { missed: false, stale: false } | Action::Nothing | Action::Sent => &[],
        };
        reports.extend(names.iter().map(ToString::to_string));
    }

    fn reported(&self, event: &HostEvent) -> Option<String> {
        Some(match event {
            HostEvent::Packet(packet) if packet.status == Status::Fresh => "new".into(),
            HostEvent::Old(_) => "old".into(),
            HostEvent::Missed => "missed".into(),
            HostEvent::Stale => "stale".into(),
            HostEvent::Unasked(_) => "unasked".into(),
            HostEvent::Corrupt(_) => return None,
            other => format!("{other:?}"),
        })
    }

    fn lost(&self, _: &Knowledge, step: Step) -> Vec<Vec<Step>> {
        vec![if step == Step::Read { vec![Step::Lose] } else { vec![] }]
    }
}

impl Knowledge {
    /// Called when the poll has an outcome.
    fn end(&mut self) {
        if !core::mem::take(&mut self.open) {
            self.wrong = Some(ONE_OUTCOME);
        }
    }
}

fn is_waiting(end: &HostMachine) -> bool {
    matches!(end, HostMachine::Connected(polling) if matches!(polling.poll, Poll::Waiting { .. }))
}
