//! The effects of an act.

use core::time::Duration;

use kawasaki_msg::pc::machine::{self as pc, Outcome, UnsentJobs};
use kawasaki_msg::robot::machine::{self as robot, Cycle, Link, Order, RecoveryStep, Stage};
use kawasaki_msg::{FromPc, FromRobot, Takeover};
use robot_session::end::Machine as _;

use super::machines::{Pc, Robot, packet};
use super::world::{Act, InFlight, ReportedStart, SentMessage, Setup, Start, TICK, Tag, World};
use crate::model::{Edges, age, drive};

/// The ticks by which a datagram can be late.
const LATEST: u8 = 2;
const NOW: Duration = Duration::ZERO;

/// Returns a mask of the lowest `count` bits.
fn below(count: u32) -> u8 {
    ((1u16 << count) - 1) as u8
}

/// Returns the jobs that the PC knows to be executed, one bit each.
pub(super) fn executed(pc: &Pc) -> u8 {
    let count = &pc.count;
    let ahead = (count.executed..count.sent)
        .filter(|index| count.ahead.contains(index - count.executed))
        .fold(0, |bits, index| bits | 1 << index);
    below(count.executed) | ahead
}

impl Start {
    /// Returns whether all jobs that the PC has reported as executed were executed.
    pub(super) fn executed_is_true(&self) -> bool {
        match self.reported {
            ReportedStart::Over { executed } | ReportedStart::Unknown { executed, .. } => {
                self.done & executed == executed
            }
            ReportedStart::Nothing | ReportedStart::GivenUp | ReportedStart::Abandoned => true,
        }
    }

    /// Returns whether no job that the PC has reported as not executed was begun.
    pub(super) fn not_executed_is_true(&self) -> bool {
        match self.reported {
            ReportedStart::Over { executed } => self.begun & !executed == 0,
            ReportedStart::Unknown { sent, .. } => self.begun & !below(sent.into()) == 0,
            ReportedStart::GivenUp => self.begun == 0,
            ReportedStart::Nothing | ReportedStart::Abandoned => true,
        }
    }
}

impl World {
    fn report(&mut self, reported: ReportedStart) {
        if let Some(start) = self.open_start() {
            start.reported = reported;
            start.disturbed = false;
        }
    }

    /// Returns the start without an outcome yet.
    fn open_start(&mut self) -> Option<&mut Start> {
        self.starts.last_mut().filter(|start| start.reported == ReportedStart::Nothing)
    }

    /// Called when a user or a restart breaks the order off.
    fn disturb(&mut self) {
        if let Some(start) = self.open_start() {
            start.disturbed = true;
        }
    }

    /// Forgets earlier starts without remaining jobs, which can cause no more errors: states that differ only in their
    /// outcomes become one.
    pub(super) fn forget(&mut self) {
        let Some((_, earlier)) = self.starts.split_last_mut() else { return };
        for (at, start) in earlier.iter_mut().enumerate() {
            let is_of = |tag: &Tag| usize::from(tag.start) == at;
            let is_left = self.queue.iter().chain(&self.executing).any(is_of)
                || self.down.iter().flat_map(|packet| &packet.messages).any(|sent| is_of(&sent.tag));
            if !is_left && start.executed_is_true() && start.not_executed_is_true() {
                *start = Start { reported: ReportedStart::Abandoned, ..Start::default() };
            }
        }
        if self.robot.queued == 0 {
            self.owner = 0;
        }
    }

    pub(super) fn lose(&mut self) {
        self.line = false;
        // Nothing follows on this connection.
        (self.robot_tail, self.pc_tail) = (false, false);
        self.up.clear();
        self.down.clear();
    }

    pub(super) fn occupied(&self) -> usize {
        self.queue.len() + usize::from(self.executing.is_some())
    }

    /// Lets the motion task take a job; in sequence, it takes the next one at once.
    fn take(&mut self, at: usize) {
        if self.executing.is_none() && at < self.queue.len() {
            let tag = self.queue.remove(at);
            let start = &mut self.starts[usize::from(tag.start)];
            self.flags.twice |= start.begun >> tag.job & 1 == 1;
            start.begun |= 1 << tag.job;
            self.executing = Some(tag);
        }
    }

    pub(super) fn stage(&self) -> Option<Stage> {
        if let Order::Active { stage, .. } = self.robot.order { Some(stage) } else { None }
    }
}

impl Setup {
    pub(super) fn datagrams(&self) -> bool {
        self.robot.datagrams
    }

    pub(super) fn individual(&self) -> bool {
        !self.pc.cumulative_acks
    }

    fn robot(&self, w: &mut World, input: robot::Input, edges: &mut Edges<'_>) -> robot::Action {
        let Ok(action) = drive(&mut w.robot, input, &self.robot, edges) else {
            w.flags.unexpected = true;
            return robot::Action::Nothing;
        };
        match action {
            robot::Action::Clear | robot::Action::Interrupt | robot::Action::Step(RecoveryStep::Clear) => {
                w.queue.clear();
            }
            _ => {}
        }
        action
    }

    fn pc(&self, w: &mut World, input: pc::Input, edges: &mut Edges<'_>) -> pc::Action {
        let number = w.pc.order.number();
        let Ok(pc::Reaction { action, .. }) = drive(&mut w.pc, input, &self.pc, edges) else {
            w.flags.unexpected = true;
            return pc::Action::Nothing;
        };
        if let pc::Action::Outcome { outcome, .. } = action {
            w.before = if self.filters_acks { number } else { 0 };
            let executed = executed(&w.pc);
            let whole = match outcome {
                Outcome::Over { .. } => executed == below(self.jobs),
                Outcome::Unknown { .. } => false,
                Outcome::GivenUp { .. } => self.pc.takeover == Takeover::Never,
            };
            w.flags.broken_off |= !whole && w.open_start().is_some_and(|start| !start.disturbed);
            w.report(match outcome {
                Outcome::Over { .. } => ReportedStart::Over { executed },
                Outcome::Unknown { sent, .. } => ReportedStart::Unknown { executed, sent: sent as u8 },
                Outcome::GivenUp { .. } => ReportedStart::GivenUp,
            });
            // The PC's count no longer has an effect.
            w.pc.count = pc::Count::default();
        }
        while let Some(report) = w.pc.report() {
            let _reported = w.pc.on(NOW, pc::Input::Reported, &self.pc);
            if report == pc::Report::Disconnect {
                self.pc_closes(w, edges);
            }
        }
        action
    }

    /// Returns the answer that the PC sends.
    fn pc_answers(&self, w: &mut World, edges: &mut Edges<'_>) -> Vec<SentMessage> {
        let config = self.pc;
        let mut answer = w.pc.transmit(NOW, &config).expect("an answer is due");
        let is_done = answer.last.is_some_and(|index| index >= self.jobs);
        if is_done {
            answer = answer.at_end();
        }
        let pc::Answer { order, status, request, commands, jobs, .. } = answer;
        let start = w.starts.len().saturating_sub(1) as u8;
        let push = |message, job| SentMessage { message: Some(message), tag: Tag { start, job } };
        let mut messages: Vec<_> =
            status.map(|_| FromPc::Status { order }).into_iter().chain(request).collect();
        messages.resize(messages.len() + usize::from(commands), FromPc::Filler);
        let mut messages: Vec<_> = messages.into_iter().map(|message| push(message, 0)).collect();
        let rest = if is_done { UnsentJobs::End } else { UnsentJobs::Later };
        let mut sent =
            pc::SentAnswer { request: request.is_some(), commands, rest, ..pc::SentAnswer::default() };
        let (from, until) = jobs.unwrap_or_default();
        for index in from..until {
            if index >= self.jobs {
                sent.rest = UnsentJobs::End;
            }
            if index >= self.jobs || sent.jobs == self.batch {
                break;
            }
            let number = (index % u32::from(self.pc.max_number)) as u16 + 1;
            messages.push(push(FromPc::Job { order, number, good: true }, index as u8));
            sent.jobs += 1;
        }
        if messages.is_empty() {
            messages.push(push(FromPc::Filler, 0));
        }
        self.pc(w, pc::Input::Sent(sent), edges);
        messages
    }

    fn pc_closes(&self, w: &mut World, edges: &mut Edges<'_>) {
        if self.datagrams() {
            self.pc(w, pc::Input::Disconnected, edges);
            self.pc(w, pc::Input::Connected, edges);
        } else {
            w.lose();
            self.pc(w, pc::Input::Disconnected, edges);
        }
    }

    /// Calls the robot's `handle_timeout`, which also checks the queue.
    fn robot_pass(&self, w: &mut World, edges: &mut Edges<'_>) {
        while w.robot.expires(NOW) {
            self.robot(w, robot::Input::Timeout, edges);
        }
        let report = w.robot.report();
        if report.is_some() {
            let _reported = w.robot.on(NOW, robot::Input::Reported, &self.robot);
        }
        let cleared = matches!(w.stage(), Some(Stage::Clearing { .. } | Stage::Interrupted { .. }));
        if !cleared || w.occupied() == 0 {
            self.robot(w, robot::Input::Settled, edges);
        }
        if w.occupied() <= self.low_water {
            self.robot(w, robot::Input::Drained, edges);
        }
        if report == Some(robot::Report::Disconnect) {
            if !self.datagrams() {
                w.lose();
            }
            self.robot(w, robot::Input::Disconnected, edges);
        }
    }

    fn pc_reads(&self, w: &mut World, messages: Vec<Option<FromRobot>>, edges: &mut Edges<'_>) {
        if !w.pc.is_connected() {
            return;
        }
        for message in messages {
            if core::mem::replace(&mut w.pc_tail, message.is_none()) {
                self.pc(w, pc::Input::Corrupt, edges);
            }
            let Some(message) = message else { continue };
            // A filtered message still shows that the robot is there.
            let filtered =
                self.filters_acks && matches!(message, FromRobot::JobAck { order, .. } if order == w.before);
            self.pc(w, pc::Input::Message(if filtered { FromRobot::Filler } else { message }), edges);
        }
        self.pc(w, pc::Input::ReadEnd { whole: true }, edges);
    }

    fn robot_reads(&self, w: &mut World, messages: Vec<SentMessage>, edges: &mut Edges<'_>) {
        // Nobody listens for a datagram that comes late.
        if !w.robot.is_connected() {
            return;
        }
        for SentMessage { message, tag } in messages {
            if core::mem::replace(&mut w.robot_tail, message.is_none()) {
                self.robot(w, robot::Input::Corrupt, edges);
            }
            let Some(message) = message else { continue };
            let job = matches!(message, FromPc::Job { .. });
            let room = !job || w.occupied() < self.capacity;
            let first = w.robot.queued == 0;
            if self.robot(w, robot::Input::Message { message, room }, edges) == robot::Action::Queue {
                w.owner = if first { tag.start } else { w.owner };
                w.flags.mixed |= w.owner != tag.start;
                w.queue.push(tag);
                if !self.individual() {
                    w.take(0);
                }
            }
        }
        self.robot(w, robot::Input::ReadEnd { whole: true }, edges);
    }

    /// Returns whether a call of the robot's `handle_timeout` has an effect.
    pub(super) fn robot_is_due(&self, w: &World) -> bool {
        let mut after = w.clone();
        self.robot_pass(&mut after, &mut None);
        after != *w
    }

    pub(super) fn overdue(&self, w: &World) -> bool {
        matches!(w.robot.link, Link::Connected { cycle: Cycle::Waiting { overdue_at: NOW, .. }, .. })
            && w.line
    }
}

/// Takes messages of a packet in flight; whether that was a fault.
fn read<M: Clone>(packets: &mut Vec<InFlight<M>>, packet: u8, count: u8) -> (Vec<M>, bool) {
    let at = usize::from(packet);
    let mut messages = packets[at].messages.clone();
    let rest = messages.split_off(count.into());
    let split = !rest.is_empty();
    if split {
        packets[at].messages = rest;
    } else {
        packets.remove(at);
    }
    (messages, split || packet > 0)
}

impl Setup {
    pub(super) fn happens(&self, w: &mut World, act: Act, edges: &mut Edges<'_>) {
        match act {
            Act::Start => {
                let order = self.starts[w.starts.len()];
                w.starts.push(Start::default());
                self.pc(w, pc::Input::Start { order }, edges);
            }
            Act::Interrupt => {
                w.disturb();
                w.users -= 1;
                self.pc(w, pc::Input::Interrupt, edges);
            }
            Act::End => {
                w.disturb();
                w.users -= 1;
                self.pc(w, pc::Input::End, edges);
            }
            Act::ClearQueue => {
                w.users -= u8::from(w.stage() != Some(Stage::Alarm));
                self.robot(w, robot::Input::ClearQueue, edges);
            }
            Act::ResetOrder => {
                w.disturb();
                w.users -= 1;
                self.robot(w, robot::Input::ResetOrder, edges);
            }
            Act::Connect => {
                w.line = true;
                (w.robot_tail, w.pc_tail) = (false, false);
                if !self.datagrams() || !w.pc.is_connected() {
                    self.pc(w, pc::Input::Connected, edges);
                }
                self.robot(w, robot::Input::Connected, edges);
            }
            Act::RobotTimeout => {
                w.faults = w.faults.saturating_sub(u8::from(self.overdue(w) && !self.datagrams()));
                self.robot_pass(w, edges);
            }
            Act::Transmit => {
                let (messages, sent) = packet(&w.robot, &self.robot);
                self.robot(w, robot::Input::Sent(sent), edges);
                if w.line {
                    w.up.push(InFlight { messages, left: LATEST });
                }
            }
            Act::PcReads { packet, count } => {
                let (messages, fault) = read(&mut w.up, packet, count);
                w.faults -= u8::from(fault);
                self.pc_reads(w, messages.into_iter().map(Some).collect(), edges);
            }
            Act::PcReadsCorrupt(count) => {
                w.faults -= 1;
                let messages = w.up.remove(0).messages.into_iter().enumerate();
                let messages = messages.map(|(i, message)| (i + 1 != usize::from(count)).then_some(message));
                self.pc_reads(w, messages.collect(), edges);
            }
            Act::PcTimeout => {
                self.pc(w, pc::Input::Timeout, edges);
            }
            Act::Answer => {
                let messages = self.pc_answers(w, edges);
                if w.line {
                    w.down.push(InFlight { messages, left: LATEST });
                }
            }
            Act::RobotReads { packet, count } => {
                let (messages, fault) = read(&mut w.down, packet, count);
                w.faults -= u8::from(fault);
                self.robot_reads(w, messages, edges);
            }
            Act::RobotReadsCorrupt(count) => {
                w.faults -= 1;
                let mut messages = w.down.remove(0).messages;
                messages[usize::from(count) - 1].message = None;
                self.robot_reads(w, messages, edges);
            }
            Act::Take(at) => w.take(at.into()),
            Act::Done => {
                if let Some(tag) = w.executing.take() {
                    w.starts[usize::from(tag.start)].done |= 1 << tag.job;
                    let number = u16::from(tag.job) % self.robot.max_number + 1;
                    self.robot(w, robot::Input::Executed { number }, edges);
                    if !self.individual() {
                        w.take(0);
                    }
                }
            }
            Act::Lose => {
                w.faults -= 1;
                w.lose();
            }
            Act::LoseDatagram { up, packet } => {
                w.faults -= 1;
                if up {
                    w.up.remove(packet.into());
                } else {
                    w.down.remove(packet.into());
                }
            }
            Act::Repeat { up } => {
                w.faults -= 1;
                if up {
                    let again = w.up[0].clone();
                    w.up.insert(0, again);
                } else {
                    let again = w.down[0].clone();
                    w.down.insert(0, again);
                }
            }
            Act::RobotNotices => {
                self.robot(w, robot::Input::Disconnected, edges);
            }
            Act::PcNotices => {
                self.pc(w, pc::Input::Disconnected, edges);
            }
            Act::RestartPc => {
                w.faults -= 1;
                w.report(ReportedStart::Abandoned);
                (w.pc, w.before) = (Pc::default(), 0);
                if self.datagrams() {
                    self.pc(w, pc::Input::Connected, edges);
                } else {
                    w.lose();
                }
            }
            Act::RestartRobot => {
                w.faults -= 1;
                if !self.datagrams() {
                    w.lose();
                }
                w.disturb();
                w.robot = Robot::new(&self.robot);
                w.queue.clear();
                w.executing = None;
            }
            Act::Tick | Act::LateTick => {
                w.faults -= u8::from(act == Act::LateTick);
                age(&mut w.robot, TICK);
                age(&mut w.pc, TICK);
                if self.datagrams() {
                    w.up.iter_mut().for_each(|packet| packet.left = packet.left.saturating_sub(1));
                    w.down.iter_mut().for_each(|packet| packet.left = packet.left.saturating_sub(1));
                }
            }
        }
    }
}
