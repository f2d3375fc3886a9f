//! The PC and its user against robots of other makers.

mod bytes;

use core::time::Duration;

use kawasaki_msg::pc::machine::{
    Action, Answer, Count, Input, Link, Machine, Order, Outcome, Reaction, Reply, Report, SentAnswer, Stage,
    Start, UnsentJobs,
};
use kawasaki_msg::{FromPc, FromRobot, PcConfig, Phase, Status};
use robot_session::end::Machine as _;

use super::pair::{NO_SPIN, ONE_OUTCOME};
use super::text::Held;
use super::world::TICK;
use crate::model::{Actor, Cause, CauseOf, EndWithPeer, Peer};

pub(super) use bytes::with_command;

const NOW: Duration = Duration::ZERO;
const OURS: u16 = 1;
const OTHER: u16 = 2;

pub(super) const AGAIN: &str = "no job that is known to be executed is sent";
pub(super) const COUNTS: &str =
    "executed, queued, sent and all jobs follow one another, and executed never falls";
pub(super) const REPORTED: &str = "progress is reported where there is some";
pub(super) const NUMBERS: &str = "no number is in flight twice";
pub(super) const SPOKEN: &str = "each answer follows a message";
pub(super) const REQUESTED: &str = "jobs are sent from a requested one on, in one answer";
pub(super) const ENDED: &str = "an order ends when all its jobs are executed, or its user ends it";
pub(super) const SILENCE: &str = "a robot that is silent, or does not answer a start, is given up in time";

/// A robot of which only this is known: it sends anything.
#[derive(Debug, Clone)]
pub struct AnyRobot {
    /// The PC's configuration.
    pub pc: PcConfig,
    /// The number of orders that are started, all with the same order number.
    pub starts: u8,
    /// The number of jobs of each order.
    pub jobs: u32,
    /// The number of times that the user interrupts, ends or commands.
    pub users: u8,
}

/// The model's knowledge of the robot and the orders.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Knowledge {
    started: u8,
    users: u8,
    /// A message has come since the last answer.
    spoken: bool,
    /// The job that was requested last since the last answer, counted from 0.
    requested: Option<u32>,
    /// The user has ended the order.
    ended: bool,
    /// Ticks since the last message, and since the start was sent.
    silent: u8,
    unanswered: u8,
    pub(super) held: Held,
    /// The session has asked for the connection to be closed.
    closes: bool,
    /// Further inputs of the same read, the last one first.
    inputs: Vec<Input>,
    is_reported: bool,
    /// Progress that is not reported yet.
    news: bool,
    before: PcState,
    wrong: Option<&'static str>,
}

/// The state of the PC after the last input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
struct PcState {
    executed: u32,
    queued: u32,
    has_order: bool,
    is_connected: bool,
    is_start_sent: bool,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The user begins an order.
    Start,
    /// Interrupts it.
    Interrupt,
    /// Ends it.
    End,
    /// Sends a command.
    Command,
    /// The user closes the connection, because the PC asks for that.
    Close,
    /// The robot connects again after that.
    Connect,
    /// The PC reads this.
    Say(FromRobot),
    /// The PC reads a corrupt message.
    Corrupt,
    /// The PC reads half a message.
    Half {
        /// In the same read as the filler before it.
        after_filler: bool,
    },
    /// The PC reads the other half.
    Rest,
}

impl PcState {
    fn of(pc: &Machine) -> Self {
        let has_order = pc.order != Order::Idle;
        let Count { executed, queued, .. } = pc.count;
        let (executed, queued) = if has_order { (executed, queued) } else { (0, 0) };
        let is_start_sent = is_start_sent(pc);
        Self { executed, queued, has_order, is_connected: pc.is_connected(), is_start_sent }
    }
}

fn is_start_sent(pc: &Machine) -> bool {
    matches!(pc.order, Order::Starting { start: Start::Sent { .. }, .. })
}

impl AnyRobot {
    /// Returns the PC with this robot.
    pub fn system(self) -> EndWithPeer<Self> {
        EndWithPeer { peer: self, late: false, breaks: true }
    }

    /// Returns the answer that is written, and its contents: all jobs are computed, and fit.
    pub(super) fn written(&self, answer: &Answer) -> (Answer, SentAnswer) {
        let is_done = answer.last.is_some_and(|index| index >= self.jobs);
        let answer = if is_done { answer.at_end() } else { *answer };
        let (from, until) = answer.jobs.unwrap_or_default();
        let is_end = is_done || until > self.jobs.max(from);
        let sent = SentAnswer {
            request: answer.request.is_some(),
            commands: answer.commands,
            jobs: until.min(self.jobs).saturating_sub(from),
            rest: if is_end { UnsentJobs::End } else { UnsentJobs::Later },
        };
        (answer, sent)
    }

    /// Returns the number of a job, counted from 0.
    fn number(&self, index: u32) -> u16 {
        (index % u32::from(self.pc.max_number)) as u16 + 1
    }

    /// Returns the requested job, counted from 0: of the jobs with this number the first that is not known to be executed.
    fn requested(&self, end: &Machine, number: u16) -> Option<u32> {
        let is_active = matches!(end.order, Order::Running { stage: Stage::Active, .. });
        (end.count.executed..=end.count.sent).find(|index| is_active && self.number(*index) == number)
    }

    /// Returns all messages of a robot that have an effect.
    fn reports(&self) -> Vec<FromRobot> {
        let numbers = || (1..=self.pc.max_number).map(Some);
        let status = |order, phase, queued, executed, ended| {
            FromRobot::Status(Status { order, phase, queued, executed, ended })
        };
        let mut reports = vec![FromRobot::Filler, FromRobot::Unusable];
        reports.extend([0, OURS, OTHER].map(|active| FromRobot::OrderAck { active }));
        for number in numbers().flatten() {
            reports.push(FromRobot::JobAck { order: OURS, number });
            reports.push(FromRobot::Request { order: OURS, number });
        }
        for number in numbers().chain([None]) {
            reports.push(FromRobot::Pause { order: OURS, queued: number });
            reports.push(status(OURS, Phase::Active, None, number, 0));
            reports.push(status(OURS, Phase::Active, number, None, 0));
            reports.push(status(0, Phase::Idle, None, number, OURS));
            for active in [0, OTHER] {
                reports.push(FromRobot::EndAck { ended: OURS, active, executed: number });
            }
        }
        reports.push(status(OURS, Phase::Ending, None, None, 0));
        reports.extend([0, OTHER].map(|order| status(order, Phase::Idle, None, None, 0)));
        reports
    }
}

impl Peer for AnyRobot {
    type End = Machine;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &PcConfig {
        &self.pc
    }

    fn end(&self) -> Machine {
        Machine::default()
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            started: 0,
            users: self.users,
            spoken: false,
            requested: None,
            ended: false,
            silent: 0,
            unanswered: 0,
            held: Held::Nothing,
            closes: false,
            inputs: Vec::new(),
            is_reported: false,
            news: false,
            before: PcState::default(),
            wrong: None,
        }
    }

    fn steps(&self, end: &Machine, known: &Knowledge, steps: &mut Vec<Step>) {
        if end.order == Order::Idle && known.started < self.starts {
            steps.push(Step::Start);
        }
        if known.users > 0 {
            match end.order {
                Order::Starting { cancelled: false, .. } => steps.extend([Step::Interrupt, Step::Command]),
                Order::Running { stage: Stage::Active, .. } => steps.extend([Step::Interrupt, Step::End]),
                Order::Starting { .. } | Order::Running { .. } | Order::Idle => {}
            }
        }
        if known.closes {
            steps.push(Step::Close);
        }
        if !end.is_connected() {
            steps.push(Step::Connect);
        } else {
            steps.extend(self.reports().into_iter().map(Step::Say));
            steps.push(Step::Corrupt);
            match known.held {
                Held::Half => steps.push(Step::Rest),
                _ => steps.extend([false, true].map(|after_filler| Step::Half { after_filler })),
            }
        }
    }

    fn by(&self, step: Step) -> Actor {
        match step {
            Step::Start | Step::Interrupt | Step::End | Step::Command | Step::Close | Step::Connect => {
                Actor::User
            }
            Step::Say(_) | Step::Corrupt | Step::Half { .. } | Step::Rest => Actor::Line,
        }
    }

    fn apply(&self, end: &Machine, known: &mut Knowledge, step: Step) -> Option<Input> {
        let (message, held) = match step {
            Step::Start => {
                known.started += 1;
                (known.before, known.ended) = (PcState::default(), false);
                return Some(Input::Start { order: OURS });
            }
            Step::Interrupt | Step::End | Step::Command => {
                known.users -= 1;
                known.ended |= step == Step::End;
                return Some(match step {
                    Step::Interrupt => Input::Interrupt,
                    Step::End => Input::End,
                    _ => Input::Command,
                });
            }
            Step::Close => {
                known.lose();
                return Some(Input::Disconnected);
            }
            Step::Connect => {
                known.lose();
                return Some(Input::Connected);
            }
            Step::Say(report) => (Some(report), Held::Nothing),
            Step::Corrupt => (None, Held::Corrupt),
            Step::Half { after_filler } => (after_filler.then_some(FromRobot::Filler), Held::Half),
            Step::Rest => {
                known.held = Held::Nothing;
                (Some(FromRobot::Filler), Held::Nothing)
            }
        };
        let before = core::mem::replace(&mut known.held, held);
        if self.pc.datagrams {
            known.held = Held::Nothing;
        }
        // The bytes that are held are corrupt when a message begins, or the datagram ends.
        let is_corrupt = [before != Held::Nothing, known.held != held];
        let [begins, ends] = is_corrupt.map(|is_corrupt| is_corrupt.then_some(Input::Corrupt));
        let read = Input::ReadEnd { whole: known.held != Held::Half };
        if message.is_some() {
            (known.spoken, known.silent) = (true, 0);
        }
        if let Some(FromRobot::Request { number, .. }) = message {
            known.requested = self.requested(end, number).or(known.requested);
        }
        known.inputs =
            [Some(read), ends, message.map(Input::Message), begins].into_iter().flatten().collect();
        self.next(end, known)
    }

    fn next(&self, end: &Machine, known: &mut Knowledge) -> Option<Input> {
        known.inputs.pop().or_else(|| {
            let report = end.report()?;
            known.closes |= report == Report::Disconnect;
            known.news &= report != Report::Progress;
            known.is_reported = true;
            Some(Input::Reported)
        })
    }

    fn sent(&self, answer: &Answer) -> Input {
        Input::Sent(self.written(answer).1)
    }

    fn acted(&self, end: &Machine, known: &mut Knowledge, cause: CauseOf<Self>, reaction: Reaction) {
        if core::mem::take(&mut known.is_reported) {
            return;
        }
        let before = core::mem::replace(&mut known.before, PcState::of(end));
        let mut wrong = |is_wrong: bool, property| {
            if is_wrong {
                known.wrong = Some(property);
            }
        };
        let outcome =
            if let Action::Outcome { outcome, .. } = reaction.action { Some(outcome) } else { None };
        wrong(outcome.is_some() != (before.has_order && end.order == Order::Idle), ONE_OUTCOME);
        if let Some(Outcome::Over { executed, complete: true }) = outcome {
            wrong(executed != self.jobs, ONE_OUTCOME);
        }
        if outcome.is_some() || end.order != Order::Idle {
            let Count { executed, queued, sent, is_news, .. } = end.count;
            wrong(executed < before.executed, COUNTS);
            wrong(executed > queued || queued > sent || sent > self.jobs, COUNTS);
            known.news |= (executed, queued) != (before.executed, before.queued);
            wrong(is_news != known.news, REPORTED);
        }
        match cause {
            Cause::Connected | Cause::Disconnected => known.lose(),
            Cause::Sent(answer) => {
                let (written, contents) = self.written(&answer);
                let requested = known.requested.take();
                if let Some((from, _)) = answer.jobs.filter(|_| contents.jobs > 0) {
                    let executed = end.count.executed;
                    wrong(from < executed, AGAIN);
                    wrong(requested.map(|index| index.max(executed)) != Some(from), REQUESTED);
                }
                let ends = matches!(written.request, Some(FromPc::End { .. }));
                wrong(ends && !known.ended && end.count.executed != self.jobs, ENDED);
                wrong(!core::mem::take(&mut known.spoken), SPOKEN);
            }
            Cause::Due | Cause::Step(_) => {}
        }
        if !is_start_sent(end) {
            known.unanswered = 0;
        }
    }

    fn tick(&self, known: &mut Knowledge) {
        known.silent += u8::from(known.before.is_connected);
        // Over datagrams the start is sent again and again.
        let awaits = known.before.is_start_sent && !self.pc.datagrams;
        known.unanswered += u8::from(known.before.is_connected && awaits);
    }

    fn restarted(&self, known: &mut Knowledge) {
        let Knowledge { started, users, wrong, .. } = *known;
        *known = Knowledge { started, users, wrong, ..self.known() };
    }

    /// Clears the status in the answer, and the count of an order that is over: they have no effect.
    fn forget(&self, end: &mut Machine) {
        if let Link::Connected {
            reply: Reply::Receiving { contents } | Reply::Due { contents, .. }, ..
        } = &mut end.link
        {
            contents.status = false;
        }
        if end.order == Order::Idle {
            end.count = Count::default();
        }
    }

    fn broken(&self, end: &Machine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        let mut add = |is_broken: bool, name| {
            if is_broken {
                broken.push(name);
            }
        };
        add(end.count.sent - end.count.executed >= self.pc.max_number.into(), NUMBERS);
        let silence = (self.pc.silence.as_millis() / TICK.as_millis()) as u8;
        add(known.silent > silence || known.unanswered > silence, SILENCE);
        let is_ready = end.transmit(NOW, &self.pc).is_some();
        add(end.deadline() == Some(NOW) && !is_ready && !end.expires(NOW), NO_SPIN);
        broken.extend(known.wrong);
    }

    fn is_urgent(&self, _: &Machine, known: &Knowledge) -> bool {
        known.closes
    }

    /// Returns the faultless step with a robot that was restarted, and accepts the order if it is started.
    fn fault_free_step(&self, end: &Machine, known: &Knowledge) -> Option<Step> {
        let idle = Status { order: 0, phase: Phase::Idle, queued: None, executed: None, ended: 0 };
        let Link::Connected { reply, .. } = end.link else {
            let starts = end.order == Order::Idle && known.started < self.starts;
            return Some(if starts { Step::Start } else { Step::Connect });
        };
        match (reply, end.order) {
            _ if known.closes => Some(Step::Close),
            _ if known.held == Held::Half => Some(Step::Rest),
            (Reply::Receiving { .. } | Reply::Due { .. }, _) => None,
            (Reply::Nothing, Order::Idle) => (known.started < self.starts).then_some(Step::Start),
            (Reply::Nothing, Order::Starting { start: Start::Sent { .. }, .. }) => {
                Some(Step::Say(FromRobot::OrderAck { active: OURS }))
            }
            (Reply::Nothing, Order::Running { left_at, .. })
                if left_at != NOW && left_at != Duration::MAX =>
            {
                None
            }
            (Reply::Nothing, Order::Starting { .. } | Order::Running { .. }) => {
                Some(Step::Say(FromRobot::Status(idle)))
            }
        }
    }

    fn is_over(&self, end: &Machine, known: &Knowledge) -> bool {
        end.order == Order::Idle && known.started == self.starts
    }
}

impl Knowledge {
    /// Ends the connection: its bytes are lost.
    fn lose(&mut self) {
        (self.spoken, self.requested, self.silent) = (false, None, 0);
        (self.held, self.closes) = (Held::Nothing, false);
    }
}
