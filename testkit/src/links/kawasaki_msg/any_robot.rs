//! The PC and its user against robots of other makers.

use core::time::Duration;

use kawasaki_msg::pc::machine::{
    Action, Count, Input, Link, Order, Outcome, Reaction, Reply, Report, SentAnswer, Stage, Start, UnsentJobs,
};
use kawasaki_msg::{FromRobot, PcConfig, Phase, Status};
use robot_session::end::Machine as _;

use super::machines::Pc;
use super::pair::{NO_SPIN, ONE_OUTCOME, UNEXPECTED};
use super::world::TICK;
use crate::model::{Edge, Edges, System, age, drive};

const NOW: Duration = Duration::ZERO;
const OURS: u16 = 1;
const OTHER: u16 = 2;

pub(super) const AGAIN: &str = "no job that is known to be executed is sent";
pub(super) const COUNTS: &str =
    "executed, queued, sent and all jobs follow one another, and executed never falls";
pub(super) const REPORTED: &str = "progress is reported where there is some";
pub(super) const NUMBERS: &str = "no number is in flight twice";
pub(super) const SPOKEN: &str = "each answer follows a message";
pub(super) const SILENCE: &str = "a robot that is silent, or does not answer a start, is given up in time";

/// A PC and any robot.
#[derive(Debug, Clone)]
pub struct AnyRobot {
    /// The PC's configuration.
    pub pc: PcConfig,
    /// The number of orders that are started, all with the same order number.
    pub starts: u8,
    /// The number of jobs of each order.
    pub jobs: u32,
    /// The number of jobs in one answer.
    pub batch: u32,
    /// The number of times that the user interrupts, ends or commands.
    pub users: u8,
}

/// The PC, and the known state of its orders.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct World {
    pc: Pc,
    started: u8,
    users: u8,
    /// A message has come since the last answer.
    spoken: bool,
    /// Ticks since the last message, and since the start was sent.
    silent: u8,
    unanswered: u8,
    flags: Flags,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
struct Flags {
    unexpected: bool,
    again: bool,
    counts: bool,
    reported: bool,
    outcome: bool,
    unspoken: bool,
}

/// A step of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Act {
    /// The user begins an order.
    Start,
    /// Interrupts it.
    Interrupt,
    /// Ends it.
    End,
    /// Sends a command.
    Command,
    /// The robot connects.
    Connect,
    /// The connection is lost.
    Break,
    /// The PC reads this.
    Receive(FromRobot),
    /// The PC reads corrupt bytes.
    Corrupt,
    /// Nothing more comes for now.
    ReadEnd,
    /// `handle_timeout`.
    Timeout,
    /// The PC answers.
    Answer,
    /// Time passes.
    Tick,
}

impl AnyRobot {
    fn drive(&self, w: &mut World, input: Input, edges: &mut Edges<'_>) -> Action {
        let (before, order) = ((w.pc.count.executed, w.pc.count.queued), w.pc.order);
        let Ok(Reaction { action, .. }) = drive(&mut w.pc, input, &self.pc, edges) else {
            w.flags.unexpected = true;
            return Action::Nothing;
        };
        let count = &w.pc.count;
        let started = matches!(input, Input::Start { .. });
        let changed = !started && (count.executed, count.queued) != before;
        w.flags.counts |= !started && count.executed < before.0;
        w.flags.counts |=
            count.executed > count.queued || count.queued > count.sent || count.sent > self.jobs;
        w.flags.outcome |=
            matches!(action, Action::Outcome { .. }) != (order != Order::Idle && w.pc.order == Order::Idle);
        if let Action::Outcome { outcome: Outcome::Over { executed, complete: true }, .. } = action {
            w.flags.outcome |= executed != self.jobs;
        }
        let mut reports = core::iter::from_fn(|| {
            let report = w.pc.report()?;
            w.pc.on(NOW, Input::Reported, &self.pc).ok().map(|_| report)
        })
        .peekable();
        let is_given_up = reports.next_if_eq(&Report::Disconnect).is_some();
        w.flags.reported |= reports.ne(changed.then_some(Report::Progress));
        if let Action::Outcome { .. } = action {
            w.pc.count = Count::default();
        }
        if is_given_up {
            self.drive(w, Input::Disconnected, edges);
        }
        action
    }

    fn answers(w: &World) -> bool {
        matches!(w.pc.link, Link::Connected { reply: Reply::Due { at: NOW, .. }, .. })
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

impl System for AnyRobot {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        World {
            pc: Pc::default(),
            started: 0,
            users: self.users,
            spoken: false,
            silent: 0,
            unanswered: 0,
            flags: Flags::default(),
        }
    }

    fn acts(&self, w: &World, acts: &mut Vec<Act>) {
        if w.pc.order == Order::Idle && w.started < self.starts {
            acts.push(Act::Start);
        }
        if w.users > 0 {
            match w.pc.order {
                Order::Starting { cancelled: false, .. } => acts.extend([Act::Interrupt, Act::Command]),
                Order::Running { stage: Stage::Active, .. } => acts.extend([Act::Interrupt, Act::End]),
                Order::Starting { .. } | Order::Running { .. } | Order::Idle => {}
            }
        }
        let Link::Connected { reply, .. } = w.pc.link else {
            acts.extend([Act::Connect, Act::Tick]);
            return;
        };
        let due = w.pc.expires(NOW);
        if due {
            acts.push(Act::Timeout);
        }
        if Self::answers(w) {
            acts.push(Act::Answer);
        }
        acts.extend(self.reports().into_iter().map(Act::Receive));
        acts.extend([Act::Corrupt, Act::Break]);
        if matches!(reply, Reply::Receiving { .. }) {
            acts.push(Act::ReadEnd);
        }
        if !due && !Self::answers(w) {
            acts.push(Act::Tick);
        }
    }

    fn step(&self, state: &World, act: Act, mut edges: Option<&mut Vec<Edge>>) -> World {
        let mut w = state.clone();
        let edges = &mut edges;
        let mut on = |w: &mut World, input| self.drive(w, input, edges);
        match act {
            Act::Start => {
                w.started += 1;
                on(&mut w, Input::Start { order: OURS });
            }
            Act::Interrupt | Act::End | Act::Command => {
                w.users -= 1;
                let input = match act {
                    Act::Interrupt => Input::Interrupt,
                    Act::End => Input::End,
                    _ => Input::Command,
                };
                on(&mut w, input);
            }
            Act::Connect => {
                on(&mut w, Input::Connected);
                (w.spoken, w.silent) = (false, 0);
            }
            Act::Break => {
                on(&mut w, Input::Disconnected);
            }
            Act::Receive(report) => {
                (w.spoken, w.silent) = (true, 0);
                on(&mut w, Input::Message(report));
            }
            Act::Corrupt => {
                on(&mut w, Input::Corrupt);
            }
            Act::ReadEnd => {
                on(&mut w, Input::ReadEnd { whole: true });
            }
            Act::Timeout => {
                on(&mut w, Input::Timeout);
            }
            Act::Answer => {
                let executed = w.pc.count.executed;
                let mut answer = w.pc.transmit(NOW, &self.pc).expect("an answer is due");
                let is_done = answer.last.is_some_and(|index| index >= self.jobs);
                if is_done {
                    answer = answer.at_end();
                }
                let (from, until) = answer.jobs.unwrap_or_default();
                let jobs = until.saturating_sub(from).min(self.batch).min(self.jobs.saturating_sub(from));
                let is_end = is_done || (self.jobs..until).contains(&(from + jobs));
                w.flags.again |= jobs > 0 && from < executed;
                on(
                    &mut w,
                    Input::Sent(SentAnswer {
                        request: answer.request.is_some(),
                        commands: answer.commands,
                        jobs,
                        rest: if is_end { UnsentJobs::End } else { UnsentJobs::Later },
                    }),
                );
                w.flags.unspoken |= !w.spoken;
                w.spoken = false;
            }
            Act::Tick => {
                let connected = w.pc.is_connected();
                w.silent += u8::from(connected);
                let sent = matches!(w.pc.order, Order::Starting { start: Start::Sent { .. }, .. });
                w.unanswered += u8::from(connected && sent);
                age(&mut w.pc, TICK);
            }
        }
        if !matches!(w.pc.order, Order::Starting { start: Start::Sent { .. }, .. }) {
            w.unanswered = 0;
        }
        if !w.pc.is_connected() {
            (w.spoken, w.silent) = (false, 0);
        }
        // Whether the status is in the answer has no effect.
        if let Link::Connected {
            reply: Reply::Receiving { contents } | Reply::Due { contents, .. }, ..
        } = &mut w.pc.link
        {
            contents.status = false;
        }
        w
    }

    fn broken(&self, w: &World, broken: &mut Vec<&'static str>) {
        let mut add = |is_broken: bool, name| {
            if is_broken {
                broken.push(name);
            }
        };
        add(w.flags.unexpected, UNEXPECTED);
        add(w.flags.again, AGAIN);
        add(w.flags.counts, COUNTS);
        add(w.flags.reported, REPORTED);
        add(w.flags.outcome, ONE_OUTCOME);
        add(w.flags.unspoken, SPOKEN);
        let count = &w.pc.count;
        add(count.sent - count.executed >= self.pc.max_number.into(), NUMBERS);
        let silence = (self.pc.silence.as_millis() / TICK.as_millis()) as u8;
        add(w.silent > silence || w.unanswered > silence && !self.pc.datagrams, SILENCE);
        add(w.pc.deadline() == Some(NOW) && !Self::answers(w) && !w.pc.expires(NOW), NO_SPIN);
    }

    /// Returns the faultless act with a robot that was restarted, and accepts the order if it is started.
    fn fault_free_step(&self, w: &World) -> Option<Act> {
        let Link::Connected { reply, .. } = w.pc.link else {
            let idle = w.pc.order == Order::Idle;
            return Some(if idle && w.started < self.starts { Act::Start } else { Act::Connect });
        };
        if w.pc.expires(NOW) {
            return Some(Act::Timeout);
        }
        let idle = FromRobot::Status(Status {
            order: 0,
            phase: Phase::Idle,
            queued: None,
            executed: None,
            ended: 0,
        });
        Some(match (reply, w.pc.order) {
            (Reply::Due { at: NOW, .. }, _) => Act::Answer,
            (Reply::Receiving { .. }, _) => Act::ReadEnd,
            (Reply::Due { .. }, _) => Act::Tick,
            (Reply::Nothing, Order::Idle) if w.started < self.starts => Act::Start,
            (Reply::Nothing, Order::Idle) => return None,
            (Reply::Nothing, Order::Starting { start: Start::Sent { .. }, .. }) => {
                Act::Receive(FromRobot::OrderAck { active: OURS })
            }
            (Reply::Nothing, Order::Running { left_at, .. })
                if left_at != NOW && left_at != Duration::MAX =>
            {
                Act::Tick
            }
            (Reply::Nothing, Order::Starting { .. } | Order::Running { .. }) => Act::Receive(idle),
        })
    }

    fn is_over(&self, w: &World) -> bool {
        w.pc.order == Order::Idle && w.started == self.starts
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(act == Act::Tick)
    }
}
