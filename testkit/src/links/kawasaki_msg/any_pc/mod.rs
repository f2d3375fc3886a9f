//! The robot, its queue and its motion task against PCs of other makers.

mod bytes;
mod says;
mod world;

use core::time::Duration;

use kawasaki_msg::robot::machine::{
    Action, DuePacket, Input, Link, Machine, Order, RecoveryStep, Replies, Report, Stage,
};
use kawasaki_msg::{FromPc, RobotConfig, timing};
use robot_session::end::Machine as _;

use super::machines::{packet, sent};
use super::pair::{NO_ALARM, NO_SPIN, TWICE};
use super::text::Held;
use super::world::TICK;
use crate::model::{Actor, Call, Cause, CauseOf, EndWithPeer, Peer};

use Letter::Nothing as N;
use world::{Asked, Pending, QueueCheck, stage};
pub use world::{Knowledge, Letter, SentMessage, Step};

const NOW: Duration = Duration::ZERO;
const OURS: u16 = 1;
const OTHER: u16 = 2;
/// The ticks by which a datagram can be late.
const LATEST: u8 = (timing::LATEST_DATAGRAM.as_millis() / TICK.as_millis()) as u8;

pub(super) const SKIPPED: &str = "no job is left out";
pub(super) const EARLY_END: &str = "no end is obeyed while jobs before it are missing";
pub(super) const WRONG_COUNT: &str = "what an order's end counts was executed, and all of it";
pub(super) const HEALTHY: &str = "no queue is cleared and no alarm raised while jobs are left to execute";
pub(super) const OLD_START: &str = "over datagrams no order begins that is over, or of an earlier run";
pub(super) const BOUND: &str = "the alarm comes within its bound";

/// The behaviour of the PC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Behaviour {
    /// It keeps the source's rules: the jobs from the requested one on, the order's end after the last of them in the same
    /// packet. The line corrupts, splits, delays and breaks. `insists`: once all is sent, every answer without jobs is the end.
    Lossy {
        /// Whether it does.
        insists: bool,
        /// Whether answers are late or missing, and the line has no other fault.
        only_late: bool,
    },
    /// Anything at any time, chosen when the robot reads it: no line is needed between the two.
    Any,
    /// The same, but for the job that is asked for, an end and an interruption.
    Withholds,
}

/// A PC of which only this is known.
#[derive(Debug, Clone)]
pub struct AnyPc {
    /// The robot's configuration.
    pub robot: RobotConfig,
    /// The behaviour of the PC.
    pub behaviour: Behaviour,
    /// The jobs of the order.
    pub jobs: u8,
    /// The capacity of the queue, in jobs.
    pub capacity: usize,
    /// Corrupt messages, split packets and lost connections of a [`Behaviour::Lossy`].
    pub faults: u8,
    /// The robot is polled late.
    pub late: bool,
}

impl AnyPc {
    /// Returns the robot with this PC.
    pub fn system(self) -> EndWithPeer<Self> {
        let (late, breaks) = (self.late, self.is_free());
        EndWithPeer { peer: self, late, breaks }
    }

    fn is_free(&self) -> bool {
        !matches!(self.behaviour, Behaviour::Lossy { .. })
    }

    /// Returns whether the line may still corrupt, split and break.
    fn is_faulty(&self, known: &Knowledge) -> bool {
        known.faults > 0 && !matches!(self.behaviour, Behaviour::Lossy { only_late: true, .. })
    }

    /// Returns the number of a job, counted from 0.
    fn number(&self, job: u8) -> u16 {
        u16::from(job) % self.robot.max_number + 1
    }

    /// Returns what a check of the queue finds.
    fn found(&self, end: &Machine, known: &Knowledge) -> impl Iterator<Item = Pending> + use<> {
        let cleared = matches!(stage(end), Some(Stage::Clearing { .. } | Stage::Interrupted { .. }));
        let settled = !cleared || known.queue.is_empty();
        let drained = known.queue.len() <= self.capacity / 2;
        settled.then_some(Pending::Settled).into_iter().chain(drained.then_some(Pending::Drained))
    }

    /// Returns whether a check of the queue has an effect.
    fn is_check_due(&self, end: &Machine, known: &Knowledge) -> bool {
        if end.expires(NOW) || !may_check(end, known) {
            return false;
        }
        let mut after = end.clone();
        for found in self.found(end, known) {
            let input = if found == Pending::Settled { Input::Settled } else { Input::Drained };
            let _action = after.on(NOW, input, &self.robot);
        }
        after != *end
    }

    /// Returns the longest time of a stall. A look at a settled queue takes 2 ms, and a tick here.
    fn bound(&self) -> u32 {
        let ticks = self.robot.alarm_bound().as_millis() / TICK.as_millis();
        ticks as u32 + u32::from(self.robot.recovery.clears)
    }

    /// Records whether the order stalls.
    fn settle(&self, end: &Machine, known: &mut Knowledge) {
        let intake = matches!(stage(end), Some(Stage::Intake { .. } | Stage::Clearing { .. }));
        let stands = !self.late && intake && known.queue.is_empty() && known.unreported == 0;
        known.stands = stands.then(|| end.is_connected());
        known.next = if stage(end).is_some() { end.queued as u8 } else { 0 };
        if !stands {
            known.stood = 0;
        }
    }
}

/// Returns whether the queue may be checked: all reports are handed over before every check except the first of two.
fn may_check(end: &Machine, known: &Knowledge) -> bool {
    match stage(end) {
        Some(Stage::Clearing { reported_at, .. } | Stage::Interrupted { reported_at }) => {
            known.unreported == 0 || reported_at != NOW
        }
        _ => known.unreported == 0,
    }
}

impl Peer for AnyPc {
    type End = Machine;
    type Knowledge = Knowledge;
    type Step = Step;

    const TICK: Duration = TICK;

    fn config(&self) -> &RobotConfig {
        &self.robot
    }

    fn end(&self) -> Machine {
        Machine::new(&self.robot)
    }

    fn known(&self) -> Knowledge {
        Knowledge {
            asked: None,
            down: Vec::new(),
            held: Held::Nothing,
            queue: Vec::new(),
            next: 0,
            unreported: 0,
            done: 0,
            sent_all: false,
            over: false,
            ended: [false; 2],
            strange_for: (!self.robot.datagrams).then_some(0),
            has_begun: false,
            closes: false,
            faults: self.faults,
            stands: None,
            stood: 0,
            inputs: Default::default(),
            check: QueueCheck::Idle,
            read: 0,
            wrong: None,
        }
    }

    fn steps(&self, end: &Machine, known: &Knowledge, steps: &mut Vec<Step>) {
        let connected = end.is_connected();
        if known.has_begun && matches!(end.link, Link::Connecting { .. }) {
            steps.push(Step::Connect);
        }
        if connected && (known.closes || !self.is_free() && self.is_faulty(known)) {
            steps.push(Step::Break);
        }
        if !self.is_free()
            && known.over
            && known.is_quiet()
            && matches!(end.link, Link::Connected { silent: 0, .. })
        {
            steps.push(Step::Again);
        }
        if let Some(asked) = known.asked {
            self.answers(known, asked, steps);
        }
        if !known.queue.is_empty() {
            steps.push(Step::Execute);
        }
        if known.unreported > 0 {
            steps.push(Step::Report);
        }
        if self.is_check_due(end, known) {
            steps.push(Step::Check);
        }
        if let Some(packet) = known.down.first() {
            steps.push(Step::Read(packet.len() as u8));
            if self.is_faulty(known) {
                steps.extend((1..packet.len()).map(|count| Step::Read(count as u8)));
            }
        }
        if connected && self.is_free() {
            steps.extend(self.letters(end, known).into_iter().map(Step::Say));
            match known.held {
                Held::Half => steps.push(Step::Rest),
                _ => steps.extend([false, true].map(|after_filler| Step::Half { after_filler })),
            }
        }
        if stage(end) == Some(Stage::Alarm) {
            steps.push(Step::ClearQueue);
        }
    }

    fn by(&self, step: Step) -> Actor {
        match step {
            Step::Read(_) | Step::Say(_) | Step::Half { .. } | Step::Rest => Actor::Line,
            Step::Report | Step::Check | Step::ClearQueue | Step::Connect | Step::Break => Actor::User,
            Step::Again | Step::Answer(_) | Step::Execute => Actor::Others,
        }
    }

    fn apply(&self, end: &Machine, known: &mut Knowledge, step: Step) -> Option<Input> {
        let datagrams = self.robot.datagrams;
        match step {
            Step::Again => {
                (known.over, known.done, known.sent_all, known.faults) = (false, 0, false, self.faults);
                return None;
            }
            Step::Answer(letters) => {
                known.faults -= u8::from(letters.contains(&Letter::Corrupt));
                let asked = known.asked.take().and_then(|asked| asked.from);
                let from = asked.unwrap_or(known.done);
                let packet: Vec<_> =
                    letters.iter().filter(|l| **l != N).map(|l| self.sent(*l, from)).collect();
                if !packet.is_empty() {
                    if let Some(from) = asked {
                        // It begins again where it is asked to.
                        known.sent_all = from + packet.len() as u8 >= self.jobs;
                    }
                    known.down.push(packet);
                }
                return None;
            }
            Step::Read(count) => {
                let mut packet = known.down.remove(0);
                let rest = packet.split_off(count.into());
                if !rest.is_empty() {
                    known.faults -= 1;
                    known.down.insert(0, rest);
                }
                known.hear(packet, datagrams);
            }
            Step::Say(letter) => known.hear([self.sent(letter, known.next)], datagrams),
            Step::Half { after_filler } => {
                known.begin_message();
                if after_filler {
                    known.inputs.push_back(Pending::Message(self.sent(Letter::Filler, 0)));
                }
                known.held = Held::Half;
                known.end_read(datagrams);
            }
            Step::Rest => {
                known.held = Held::Nothing;
                known.hear([self.sent(Letter::Filler, 0)], datagrams);
            }
            Step::Execute => {
                known.wrong = known.execute().or(known.wrong);
                self.settle(end, known);
                return None;
            }
            Step::Report => {
                known.unreported -= 1;
                return Some(Input::Executed { number: self.number(end.executed as u8) });
            }
            Step::Check => {
                known.check = QueueCheck::Done;
                known.inputs.extend(self.found(end, known));
            }
            Step::ClearQueue => return Some(Input::ClearQueue),
            Step::Connect => {
                known.lose();
                return Some(Input::Connected);
            }
            Step::Break => {
                known.faults -= u8::from(!self.is_free() && !known.closes);
                known.lose();
                return Some(Input::Disconnected);
            }
        }
        self.next(end, known)
    }

    /// A driver handles what is due before it sends.
    fn may_call(&self, end: &Machine, known: &Knowledge, call: Call) -> bool {
        match call {
            Call::HandleTimeout => may_check(end, known),
            Call::PollTransmit => {
                let expires = end.expires(NOW) && may_check(end, known);
                !expires && !self.is_check_due(end, known)
            }
        }
    }

    fn next(&self, end: &Machine, known: &mut Knowledge) -> Option<Input> {
        if known.check == QueueCheck::Due {
            if end.expires(NOW) {
                return None;
            }
            known.check = QueueCheck::Done;
            known.inputs.extend(self.found(end, known));
        }
        Some(match known.inputs.pop_front() {
            Some(Pending::Message(SentMessage { message: Some(message), job })) => {
                known.read = job;
                let room = !matches!(message, FromPc::Job { .. }) || known.queue.len() < self.capacity;
                Input::Message { message, room }
            }
            Some(Pending::Message(_) | Pending::Corrupt) => Input::Corrupt,
            Some(Pending::ReadEnd { whole }) => Input::ReadEnd { whole },
            Some(Pending::Settled) => Input::Settled,
            Some(Pending::Drained) => Input::Drained,
            None => {
                let Some(report) = end.report() else {
                    (known.check, known.read) = (QueueCheck::Idle, 0);
                    return None;
                };
                known.closes = report == Report::Disconnect;
                Input::Reported
            }
        })
    }

    fn sent(&self, due: &DuePacket) -> Input {
        Input::Sent(sent(due, 0))
    }

    fn answer(&self, end: &Machine, _: &mut Knowledge, _: &DuePacket) -> Input {
        Input::Sent(packet(end, &self.robot).1)
    }

    fn acted(&self, end: &Machine, known: &mut Knowledge, cause: CauseOf<Self>, action: Action) {
        match cause {
            Cause::Due if known.check == QueueCheck::Idle => known.check = QueueCheck::Due,
            Cause::Connected => {
                known.lose();
                known.has_begun = true;
                known.strange_for.get_or_insert(LATEST);
            }
            Cause::Disconnected => known.lose(),
            Cause::Sent(due) if !self.is_free() => {
                let from = due.request.map(|_| end.queued as u8);
                known.asked = Some(Asked { accepted: end.order.number() == OURS || known.over, from });
            }
            _ => {}
        }
        match action {
            Action::Queue => known.queue.push(known.read),
            Action::Clear | Action::Interrupt => known.queue.clear(),
            Action::Step(step @ (RecoveryStep::Clear | RecoveryStep::Alarm)) => {
                if !known.queue.is_empty() {
                    known.wrong = Some(HEALTHY);
                }
                if step == RecoveryStep::Clear {
                    known.queue.clear();
                }
            }
            Action::Over => {
                if end.executed != u32::from(known.done) {
                    known.wrong = Some(WRONG_COUNT);
                }
                known.over = true;
                known.ended[usize::from(end.ended.is_some_and(|ended| ended.order == OTHER))] |=
                    self.robot.datagrams;
            }
            Action::Started => {
                (known.done, known.over) = (0, false);
                let is_old = known.ended[usize::from(end.order.number() == OTHER)];
                if self.robot.datagrams && (is_old || known.strange_for != Some(0)) {
                    known.wrong = Some(OLD_START);
                }
            }
            Action::Ending if end.queued < known.read.into() => known.wrong = Some(EARLY_END),
            Action::NoReply => known.faults = known.faults.saturating_sub(1),
            _ => {}
        }
        self.settle(end, known);
    }

    fn tick(&self, known: &mut Knowledge) {
        known.stood += u8::from(known.stands == Some(true));
        known.strange_for = known.strange_for.map(|ticks| ticks.saturating_sub(1));
    }

    fn restarted(&self, known: &mut Knowledge) {
        *known = Knowledge { wrong: known.wrong, ..self.known() };
    }

    /// A PC that does anything does not read the replies, which have no other effect.
    fn forget(&self, end: &mut Machine) {
        if !self.is_free() {
            return;
        }
        (end.replies, end.ended) = (Replies::default(), None);
        end.acked = end.executed;
        if let Link::Connected { status_at, .. } = &mut end.link {
            *status_at = Duration::MAX;
        }
        if end.order == Order::Idle {
            (end.queued, end.executed, end.acked) = (0, 0, 0);
        }
    }

    fn broken(&self, end: &Machine, known: &Knowledge, broken: &mut Vec<&'static str>) {
        let mut add = |is_broken: bool, name| {
            if is_broken {
                broken.push(name);
            }
        };
        let stage = stage(end);
        let counted = end.executed + u32::from(known.unreported);
        add(stage.is_some() && counted != u32::from(known.done), WRONG_COUNT);
        add(u32::from(known.stood) > self.bound(), BOUND);
        add(stage == Some(Stage::Alarm) && !self.is_free() && self.faults < 4, NO_ALARM);
        add(!self.is_free() && known.over && known.done < self.jobs, EARLY_END);
        let is_ready = end.transmit(NOW, &self.robot).is_some();
        add(end.deadline() == Some(NOW) && !is_ready && !end.expires(NOW), NO_SPIN);
        broken.extend(known.wrong);
    }

    fn is_over(&self, end: &Machine, known: &Knowledge) -> bool {
        known.over || self.behaviour == Behaviour::Withholds && stage(end) == Some(Stage::Alarm)
    }

    fn is_urgent(&self, end: &Machine, known: &Knowledge) -> bool {
        let is_called = known.unreported > 0 || self.is_check_due(end, known);
        let arrives = !self.is_free() && known.faults == 0 && !known.down.is_empty();
        known.closes || known.asked.is_some() || arrives || !self.late && is_called
    }

    fn fault_free_step(&self, end: &Machine, known: &Knowledge) -> Option<Step> {
        let mut steps = Vec::new();
        self.steps(end, known, &mut steps);
        let first = |f: &dyn Fn(Step) -> bool| steps.iter().copied().find(|step| f(*step));
        let whole = known.down.first().map(|packet| packet.len() as u8);
        let called = [Step::Report, Step::Connect, Step::Check, Step::ClearQueue];
        let called = called.into_iter().find(|step| steps.contains(step));
        called
            .or_else(|| known.closes.then_some(Step::Break))
            .or_else(|| first(&|step| matches!(step, Step::Read(count) if Some(count) == whole)))
            .or_else(|| first(&|step| self.is_obliging(end, known, step)))
            .or_else(|| first(&|step| step == Step::Execute))
    }
}
