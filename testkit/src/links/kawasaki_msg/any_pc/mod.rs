//! The robot, its queue and its motion task against PCs of other makers.

mod world;

use core::time::Duration;

use kawasaki_msg::robot::machine::{Action, Cycle, Input, Link, Order, RecoveryStep, Report, Stage, Starts};
use kawasaki_msg::{FromPc, RobotConfig};
use robot_session::end::Machine as _;

use super::machines::{Robot, packet};
use super::pair::{NO_ALARM, NO_SPIN, TWICE, UNEXPECTED};
use super::world::TICK;
use crate::model::{Edge, Edges, System, age, drive};

use Letter::Nothing as N;
use world::Flags;
pub use world::{Act, Letter, SentMessage, World};

const NOW: Duration = Duration::ZERO;
const OURS: u16 = 1;
const OTHER: u16 = 2;

pub(super) const SKIPPED: &str = "no job is left out";
pub(super) const EARLY_END: &str = "no end is obeyed while jobs before it are missing";
pub(super) const WRONG_COUNT: &str = "what an order's end counts was executed, and all of it";
pub(super) const HEALTHY: &str = "no queue is cleared and no alarm raised while jobs are left to execute";
pub(super) const BOUND: &str = "the alarm comes within its bound";

/// The behaviour of the PC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Peer {
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

/// A robot and its peer.
#[derive(Debug, Clone)]
pub struct AnyPc {
    /// The robot's configuration.
    pub robot: RobotConfig,
    /// The behaviour of the PC.
    pub peer: Peer,
    /// The jobs of the order.
    pub jobs: u8,
    /// The capacity of the queue, in jobs.
    pub capacity: usize,
    /// The jobs in the queue when it counts as drained.
    pub low_water: usize,
    /// Corrupt messages, split packets and lost connections of a [`Peer::Lossy`].
    pub faults: u8,
    /// The robot is polled late.
    pub late: bool,
}

impl AnyPc {
    fn report(&self, w: &mut World, edges: &mut Edges<'_>) {
        w.unreported -= 1;
        let number = self.number(w.robot.executed as u8);
        self.drive(w, Input::Executed { number }, edges);
    }

    fn is_free(&self) -> bool {
        !matches!(self.peer, Peer::Lossy { .. })
    }

    /// Returns whether the line may still corrupt, split and break.
    fn is_faulty(&self, w: &World) -> bool {
        w.faults > 0 && !matches!(self.peer, Peer::Lossy { only_late: true, .. })
    }

    /// Returns the number of a job, counted from 0.
    fn number(&self, job: u8) -> u16 {
        u16::from(job) % self.robot.max_number + 1
    }

    fn drive(&self, w: &mut World, input: Input, edges: &mut Edges<'_>) -> Action {
        let nothing_left = w.is_empty();
        let Ok(action) = drive(&mut w.robot, input, &self.robot, edges) else {
            w.flags.unexpected = true;
            return Action::Nothing;
        };
        match action {
            Action::Step(step @ (RecoveryStep::Clear | RecoveryStep::Alarm)) => {
                w.flags.healthy |= !nothing_left;
                if step == RecoveryStep::Clear {
                    w.queue.clear();
                }
            }
            Action::Clear | Action::Interrupt => w.queue.clear(),
            Action::Over => {
                let executed = w.robot.executed as u8;
                w.flags.wrong_count |= executed != w.done || executed != w.begun;
                w.over = true;
            }
            Action::Started => (w.begun, w.done, w.over) = (0, 0, false),
            _ => {}
        }
        action
    }

    fn pass(&self, w: &mut World, edges: &mut Edges<'_>) {
        while w.robot.expires(NOW) {
            self.drive(w, Input::Timeout, edges);
        }
        let report = w.robot.report();
        if report.is_some() {
            let _reported = w.robot.on(NOW, Input::Reported, &self.robot);
        }
        let cleared = matches!(w.stage(), Some(Stage::Clearing { .. } | Stage::Interrupted { .. }));
        if !cleared || w.is_empty() {
            self.drive(w, Input::Settled, edges);
        }
        if w.occupied() <= self.low_water {
            self.drive(w, Input::Drained, edges);
        }
        if report == Some(Report::Disconnect) {
            self.lose(w, edges);
        }
    }

    fn lose(&self, w: &mut World, edges: &mut Edges<'_>) {
        w.down.clear();
        w.tail = false;
        self.drive(w, Input::Disconnected, edges);
    }

    fn deliver(&self, w: &mut World, SentMessage { message, job }: SentMessage, edges: &mut Edges<'_>) {
        if core::mem::replace(&mut w.tail, message.is_none()) {
            self.drive(w, Input::Corrupt, edges);
        }
        let Some(message) = message else { return };
        let free = self.capacity - w.occupied();
        let room = !matches!(message, FromPc::Job { .. }) || free > 0;
        match self.drive(w, Input::Message { message, room }, edges) {
            Action::Queue => {
                w.queue.push(job);
                w.take();
            }
            Action::Ending => w.flags.early_end |= w.robot.queued < job.into(),
            _ => {}
        }
    }

    /// Sends the robot's packet: returns whether the PC's order was accepted, and the requested job.
    fn transmit(&self, w: &mut World, edges: &mut Edges<'_>) -> (bool, Option<u8>) {
        let accepted = w.robot.order.number() == OURS || w.over;
        let queued = w.robot.queued as u8;
        let (_, sent) = packet(&w.robot, &self.robot);
        let asked = sent.request.then_some(queued);
        self.drive(w, Input::Sent(sent), edges);
        (accepted, asked)
    }

    fn sent(&self, letter: Letter, from: u8) -> SentMessage {
        let job = |order, offset: i8, good| {
            let index = from.wrapping_add_signed(offset);
            SentMessage { message: Some(FromPc::Job { order, number: self.number(index), good }), job: index }
        };
        let plain = |message| SentMessage { message: Some(message), job: 0 };
        match letter {
            N | Letter::Filler => plain(FromPc::Filler),
            Letter::Start => plain(FromPc::Start { order: OURS, first: 1 }),
            Letter::OtherStart => plain(FromPc::Start { order: OTHER, first: 1 }),
            Letter::End => {
                let job = if self.is_free() { 0 } else { self.jobs };
                SentMessage { job, ..plain(FromPc::End { order: OURS }) }
            }
            Letter::Interrupt => plain(FromPc::Interrupt { order: OURS }),
            Letter::Job(offset) => job(OURS, offset, true),
            Letter::OtherOrder => job(OTHER, 0, true),
            Letter::BadJob => job(OURS, 0, false),
            Letter::OtherStatus => plain(FromPc::Status { order: OTHER }),
            Letter::Corrupt => SentMessage { message: None, job: 0 },
        }
    }

    /// Appends the answers of a PC that follows the rules.
    fn answers(&self, w: &World, acts: &mut Vec<Act>) {
        let Peer::Lossy { insists, only_late } = self.peer else { return };
        if w.faults > 0 {
            acts.push(Act::Transmit([N; 3]));
        }
        let (accepted, asked) = self.transmit(&mut w.clone(), &mut None);
        let Some(from) = asked else {
            let letter = match (accepted, insists && w.sent_all) {
                (true, true) => Letter::End,
                (true, false) => Letter::Filler,
                (false, _) => Letter::Start,
            };
            acts.push(Act::Transmit([letter, N, N]));
            return;
        };
        let one = [Letter::Job(0), N, N];
        let packets = match self.jobs - from {
            0 => vec![[Letter::End, N, N]],
            1 => vec![[Letter::Job(0), Letter::End, N], one],
            2 => vec![[Letter::Job(0), Letter::Job(1), Letter::End], one],
            _ => vec![[Letter::Job(0), Letter::Job(1), Letter::Job(2)], one],
        };
        for packet in packets {
            acts.push(Act::Transmit(packet));
            for at in (0..3).filter(|at| w.faults > 0 && !only_late && packet[*at] != N) {
                let mut bad = packet;
                bad[at] = Letter::Corrupt;
                acts.push(Act::Transmit(bad));
            }
        }
    }

    /// Returns the messages of a PC with any behaviour.
    fn letters(&self, w: &World) -> Vec<Letter> {
        let (next, any) = (w.next(), self.peer == Peer::Any);
        let mut letters =
            vec![Letter::Filler, Letter::Corrupt, Letter::OtherOrder, Letter::Start, Letter::OtherStatus];
        let mut may = |may: bool, letter| {
            if may {
                letters.push(letter);
            }
        };
        may(w.robot.order != Order::Idle, Letter::OtherStart);
        may(next > 0, Letter::Job(-1));
        may(next + 1 < self.jobs, Letter::Job(1));
        may(next < self.jobs, Letter::BadJob);
        may(next < self.jobs && any, Letter::Job(0));
        may(any, Letter::End);
        may(any, Letter::Interrupt);
        letters
    }

    fn is_ready(w: &World) -> bool {
        matches!(w.robot.link, Link::Connected { cycle: Cycle::Ready { at: NOW, .. }, .. })
    }

    /// Returns whether the queue may be checked: all reports are handed over before every check except the first.
    fn may_look(w: &World) -> bool {
        let second = matches!(
            w.stage(),
            Some(Stage::Clearing { reported_at: NOW, .. } | Stage::Interrupted { reported_at: NOW })
        );
        w.unreported == 0
            || !second && matches!(w.stage(), Some(Stage::Clearing { .. } | Stage::Interrupted { .. }))
    }

    fn is_due(&self, w: &World) -> bool {
        let mut after = w.clone();
        self.pass(&mut after, &mut None);
        after != *w
    }

    /// Returns the longest time of a stall. A look at a settled queue takes 2 ms, and a tick here.
    fn bound(&self) -> u32 {
        let ticks = self.robot.alarm_bound().as_millis() / TICK.as_millis();
        ticks as u32 + u32::from(self.robot.recovery.clears)
    }
}

impl System for AnyPc {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        let mut robot = Robot::new(&self.robot);
        if let Starts::New { ignored_until, .. } = &mut robot.starts {
            *ignored_until = NOW;
        }
        World {
            robot,
            down: Vec::new(),
            tail: false,
            queue: Vec::new(),
            executing: None,
            unreported: 0,
            begun: 0,
            done: 0,
            sent_all: false,
            over: false,
            faults: self.faults,
            stood: 0,
            flags: Flags::default(),
        }
    }

    fn acts(&self, w: &World, acts: &mut Vec<Act>) {
        if matches!(w.robot.link, Link::Connecting { .. }) {
            acts.push(Act::Connect);
            return;
        }
        let (connected, free) = (w.robot.is_connected(), self.is_free());
        let due = Self::may_look(w) && self.is_due(w);
        let ready = Self::is_ready(w);
        if due {
            acts.push(Act::Timeout);
        }
        if ready && !due {
            if free {
                acts.push(Act::Transmit([N; 3]));
            }
            self.answers(w, acts);
        }
        if w.executing.is_some() {
            acts.push(Act::Done);
        }
        if w.unreported > 0 {
            acts.push(Act::Report);
        }
        if let Some(packet) = w.down.first() {
            acts.push(Act::Read(packet.len() as u8));
            if self.is_faulty(w) {
                acts.extend((1..packet.len()).map(|count| Act::Read(count as u8)));
            }
        }
        if connected && free {
            acts.extend(self.letters(w).into_iter().map(Act::Receive));
            if matches!(w.robot.link, Link::Connected { cycle: Cycle::Waiting { answered: true, .. }, .. }) {
                acts.push(Act::ReadEnd);
            }
            if matches!(w.robot.link, Link::Connected { cycle: Cycle::Ready { .. }, .. }) {
                acts.extend([Act::ReadEnd, Act::ReadHalf]);
            }
        }
        if connected && (free || self.is_faulty(w)) {
            acts.push(Act::Break);
        }
        let alarm = w.stage() == Some(Stage::Alarm);
        if alarm {
            acts.push(Act::ClearQueue);
        }
        let urgent = due || ready || w.unreported > 0;
        if (!urgent || self.late) && (free || w.down.is_empty() || w.faults > 0) {
            acts.push(Act::Tick);
        }
    }

    fn step(&self, state: &World, act: Act, mut edges: Option<&mut Vec<Edge>>) -> World {
        let mut w = state.clone();
        let edges = &mut edges;
        match act {
            Act::Connect => {
                self.drive(&mut w, Input::Connected, edges);
            }
            Act::Break => {
                w.faults -= u8::from(!self.is_free());
                self.lose(&mut w, edges);
            }
            Act::Timeout => {
                let late = matches!(
                    w.robot.link,
                    Link::Connected { cycle: Cycle::Waiting { overdue_at: NOW, .. }, .. }
                );
                w.faults = w.faults.saturating_sub(u8::from(late));
                self.pass(&mut w, edges);
            }
            Act::Transmit(letters) => {
                let (_, asked) = self.transmit(&mut w, edges);
                w.faults -= u8::from(letters.contains(&Letter::Corrupt));
                let from = asked.unwrap_or(w.done);
                let packet: Vec<_> =
                    letters.iter().filter(|l| **l != N).map(|l| self.sent(*l, from)).collect();
                if !packet.is_empty() {
                    if let Some(from) = asked {
                        // It begins again where it is asked to.
                        w.sent_all = from + packet.len() as u8 >= self.jobs;
                    }
                    w.down.push(packet);
                }
            }
            Act::Read(count) => {
                let mut packet = w.down.remove(0);
                let rest = packet.split_off(count.into());
                for sent in packet {
                    self.deliver(&mut w, sent, edges);
                }
                self.drive(&mut w, Input::ReadEnd { whole: true }, edges);
                if !rest.is_empty() {
                    w.faults -= 1;
                    w.down.insert(0, rest);
                }
            }
            Act::Receive(letter) => {
                let sent = self.sent(letter, w.next());
                self.deliver(&mut w, sent, edges);
            }
            Act::ReadEnd => {
                self.drive(&mut w, Input::ReadEnd { whole: true }, edges);
            }
            Act::ReadHalf => {
                self.drive(&mut w, Input::ReadEnd { whole: false }, edges);
            }
            Act::Done => {
                if let Some(job) = w.executing.take() {
                    w.done = w.done.max(job + 1);
                    w.unreported += 1;
                }
                w.take();
            }
            Act::Report => self.report(&mut w, edges),
            Act::ClearQueue => {
                self.drive(&mut w, Input::ClearQueue, edges);
            }
            Act::Tick => {
                w.stood += u8::from(self.stands(&w) && w.robot.is_connected());
                age(&mut w.robot, TICK);
            }
        }
        if !self.stands(&w) {
            w.stood = 0;
        }
        if self.is_free() {
            w.project();
        }
        w
    }

    fn broken(&self, w: &World, broken: &mut Vec<&'static str>) {
        let flags = w.flags;
        let mut add = |is_broken: bool, name| {
            if is_broken {
                broken.push(name);
            }
        };
        add(flags.twice, TWICE);
        add(flags.skipped, SKIPPED);
        add(flags.early_end, EARLY_END);
        add(flags.wrong_count, WRONG_COUNT);
        add(flags.unexpected, UNEXPECTED);
        add(flags.healthy, HEALTHY);
        add(u32::from(w.stood) > self.bound(), BOUND);
        let counted = w.robot.executed + u32::from(w.unreported);
        add(w.stage().is_some() && counted != u32::from(w.done), WRONG_COUNT);
        let alarm = w.stage() == Some(Stage::Alarm);
        add(alarm && !self.is_free() && self.faults < 4, NO_ALARM);
        add(!self.is_free() && w.over && w.done < self.jobs, EARLY_END);
        let idles = w.robot.deadline() == Some(NOW) && Self::may_look(w) && !Self::is_ready(w);
        add(idles && !self.is_due(w), NO_SPIN);
    }

    fn fault_free_step(&self, w: &World) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(w, &mut acts);
        let first = |f: &dyn Fn(&Act) -> bool| acts.iter().copied().find(|act| f(act));
        let whole = w.down.first().map(|packet| packet.len() as u8);
        first(&|act| matches!(act, Act::Report))
            .or_else(|| first(&|act| matches!(act, Act::Connect | Act::Timeout | Act::ClearQueue)))
            .or_else(|| first(&|act| matches!(act, Act::Read(count) if Some(*count) == whole)))
            .or_else(|| {
                let Link::Connected { cycle: Cycle::Waiting { answered, .. }, .. } = w.robot.link else {
                    return None;
                };
                let letter = match w.robot.order {
                    Order::Idle => Letter::Start,
                    Order::Active { number: OURS, .. } if w.next() < self.jobs => Letter::Job(0),
                    Order::Active { .. } => Letter::End,
                };
                let withheld = letter == Letter::Job(0) && self.peer == Peer::Withholds;
                let letter = if withheld { Letter::Filler } else { letter };
                first(&|act| match act {
                    Act::ReadEnd => answered,
                    Act::Receive(received) => !answered && *received == letter,
                    _ => false,
                })
            })
            .or_else(|| first(&|act| *act == Act::Transmit([N; 3]) && self.is_free()))
            .or_else(|| {
                if !Self::is_ready(w) {
                    return None;
                }
                let (accepted, asked) = self.transmit(&mut w.clone(), &mut None);
                let letter = match (accepted, asked) {
                    (_, Some(from)) if from < self.jobs => Letter::Job(0),
                    (_, Some(_)) => Letter::End,
                    (false, None) => Letter::Start,
                    (true, None) => Letter::Filler,
                };
                let end = [Letter::End, N, N];
                let good = |letters: &[Letter; 3]| letters[0] == letter || accepted && *letters == end;
                first(&|act| matches!(act, Act::Transmit(letters) if good(letters)))
            })
            .or_else(|| first(&|act| matches!(act, Act::Done)))
            .or_else(|| first(&|act| matches!(act, Act::Tick)))
    }

    fn is_over(&self, w: &World) -> bool {
        w.over || self.peer == Peer::Withholds && w.stage() == Some(Stage::Alarm)
    }

    fn stands(&self, w: &World) -> bool {
        let intake = matches!(w.stage(), Some(Stage::Intake { .. } | Stage::Clearing { .. }));
        !self.late && intake && w.is_empty() && w.unreported == 0
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(act == Act::Tick)
    }
}
