//! Both machines, the line between them, the queue with its motion task, and a user at either end.

use core::time::Duration;

use kawasaki_msg::pc::{self, Answer, JobSent, Outcome};
use kawasaki_msg::robot::{self, Cycle, Flow, Link, Order, RecoveryStep, Stage};
use kawasaki_msg::{FromPc, FromRobot, Phase};

use super::machines::{Pc, Robot};
use super::world::{Act, Faults, Flags, InFlight, Reported, Sent, Setup, Start, Tag, World};
use crate::model::{Edges, System, age, drive};

/// The time of a tick.
pub const TICK: Duration = Duration::from_millis(500);
/// How many ticks a datagram can be late.
const LATEST: u8 = 2;
const NOW: Duration = Duration::ZERO;

pub(super) const TWICE: &str = "no job is executed twice";
pub(super) const MIXED: &str = "no job joins an order that it does not belong to";
pub(super) const UNEXPECTED: &str = "nothing is unexpected";
pub(super) const EXECUTED: &str = "what is reported executed was";
pub(super) const NOT_EXECUTED: &str = "what is reported not executed was not";
pub(super) const COUNTED: &str = "what is counted executed is";
pub(super) const ONE_OUTCOME: &str = "a start has one outcome";
pub(super) const NO_ALARM: &str = "no alarm without a fault";

/// The answer of the PC as it is sent.
struct Packet<'a> {
    messages: &'a mut Vec<Sent>,
    jobs: u32,
    batch: u32,
    start: u8,
}

impl Packet<'_> {
    fn push(&mut self, message: FromPc, job: u32) -> bool {
        self.messages.push(Sent { message: Some(message), tag: Tag { start: self.start, job: job as u8 } });
        true
    }
}

impl Answer for Packet<'_> {
    fn send(&mut self, message: FromPc) -> bool {
        self.push(message, 0)
    }

    fn status(&mut self, order: u16, _: Phase, _: Option<u16>, _: Option<u16>) -> bool {
        self.push(FromPc::Status { order }, 0)
    }

    fn command(&mut self, _: u16) -> bool {
        self.push(FromPc::Filler, 0)
    }

    fn job(&mut self, order: u16, number: u16, index: u32) -> JobSent {
        if index >= self.jobs {
            return JobSent::End;
        }
        let job = |sent: &&Sent| matches!(sent.message, Some(FromPc::Job { .. }));
        if self.messages.iter().filter(job).count() as u32 >= self.batch {
            return JobSent::NoRoom;
        }
        self.push(FromPc::Job { order, number, good: true }, index);
        JobSent::Sent
    }

    fn is_end(&mut self, index: u32) -> bool {
        index >= self.jobs
    }
}

/// The first bits.
fn below(count: u32) -> u8 {
    ((1u16 << count) - 1) as u8
}

/// The jobs that the PC knows to be executed, one bit each.
fn executed(pc: &Pc, max: u16) -> u8 {
    let count = &pc.count;
    let ahead = (count.executed..count.sent)
        .filter(|index| count.ahead.contains((index % u32::from(max)) as u16 + 1))
        .fold(0, |bits, index| bits | 1 << index);
    below(count.executed) | ahead
}

impl World {
    fn report(&mut self, reported: Reported) {
        if let Some(start) = self.starts.last_mut()
            && start.reported == Reported::Nothing
        {
            start.reported = reported;
        }
    }

    fn lose(&mut self) {
        self.line = false;
        self.up.clear();
        self.down.clear();
    }

    fn occupied(&self) -> usize {
        self.queue.len() + usize::from(self.executing.is_some())
    }

    /// The motion task takes a job; in order it takes the next at once.
    fn take(&mut self, at: usize) {
        if self.executing.is_none() && at < self.queue.len() {
            let tag = self.queue.remove(at);
            let start = &mut self.starts[usize::from(tag.start)];
            self.flags.twice |= start.begun >> tag.job & 1 == 1;
            start.begun |= 1 << tag.job;
            self.executing = Some(tag);
        }
    }

    fn stage(&self) -> Option<Stage> {
        if let Order::Active { stage, .. } = self.robot.order { Some(stage) } else { None }
    }
}

impl Setup {
    fn datagrams(&self) -> bool {
        self.robot.datagrams
    }

    fn individual(&self) -> bool {
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
            robot::Action::Disconnect => {
                if !self.datagrams() {
                    w.lose();
                }
                self.robot(w, robot::Input::Disconnected, edges);
            }
            _ => {}
        }
        action
    }

    fn pc(&self, w: &mut World, input: pc::Input, edges: &mut Edges<'_>) {
        let number = w.pc.order.number();
        let Ok(action) = drive(&mut w.pc, input, &self.pc, edges) else {
            w.flags.unexpected = true;
            return;
        };
        match action {
            pc::Action::Disconnect => {
                if !self.datagrams() {
                    w.lose();
                }
                self.pc(w, pc::Input::Disconnected, edges);
                if self.datagrams() {
                    self.pc(w, pc::Input::Connected, edges);
                }
            }
            pc::Action::Outcome(outcome) => {
                w.before = if self.filters_acks { number } else { 0 };
                let executed = executed(&w.pc, self.pc.max_number);
                w.report(match outcome {
                    Outcome::Over { .. } => Reported::Over { executed },
                    Outcome::Unknown { sent, .. } => Reported::Unknown { executed, sent: sent as u8 },
                    Outcome::GivenUp { .. } => Reported::GivenUp,
                });
                // What is known of it decides nothing any more.
                w.pc.count = pc::Count::default();
            }
            _ => {}
        }
    }

    fn pc_reads(&self, w: &mut World, messages: Vec<Option<FromRobot>>, edges: &mut Edges<'_>) {
        if !w.pc.is_connected() {
            return;
        }
        for message in messages {
            let Some(message) = message else {
                self.pc(w, pc::Input::Corrupt, edges);
                continue;
            };
            self.pc(w, pc::Input::Received, edges);
            if self.filters_acks && matches!(message, FromRobot::JobAck { order, .. } if order == w.before) {
                continue;
            }
            self.pc(w, pc::Input::Message(message), edges);
        }
        self.pc(w, pc::Input::ReadEnd { whole: true }, edges);
    }

    fn robot_reads(&self, w: &mut World, messages: Vec<Sent>, edges: &mut Edges<'_>) {
        // Nobody listens for a datagram that comes late.
        if !w.robot.is_connected() {
            return;
        }
        for Sent { message, tag } in messages {
            let Some(message) = message else {
                self.robot(w, robot::Input::Corrupt, edges);
                continue;
            };
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
        self.robot(w, robot::Input::ReadEnd, edges);
    }

    fn robot_is_due(&self, w: &World) -> bool {
        let mut robot = w.robot.clone();
        robot.deadline() == Some(NOW)
            && (robot.on(NOW, robot::Input::Timeout, &self.robot) != Ok(robot::Action::Nothing)
                || robot != w.robot)
    }

    fn pc_is_due(&self, w: &World) -> bool {
        let mut pc = w.pc.clone();
        pc.deadline() == Some(NOW)
            && (pc.on(NOW, pc::Input::Timeout, &self.pc) != Ok(pc::Action::Nothing) || pc != w.pc)
    }

    fn overdue(&self, w: &World) -> bool {
        matches!(w.robot.link, Link::Connected { cycle: Cycle::Waiting { overdue_at: NOW, .. }, .. })
            && w.line
    }

    fn settled(&self, w: &World) -> bool {
        let looks = match w.stage() {
            Some(Stage::Clearing { reported_at, .. } | Stage::Interrupted { reported_at }) => {
                reported_at == Duration::MAX || reported_at == NOW
            }
            Some(Stage::Ending) => w.robot.executed == w.robot.queued,
            Some(Stage::Intake { .. } | Stage::Alarm) | None => false,
        };
        looks && w.occupied() == 0
    }

    fn drained(&self, w: &World) -> bool {
        matches!(w.stage(), Some(Stage::Intake { flow: Flow::Full, .. })) && w.occupied() <= self.low_water
    }
}

/// The ways to read one of the packets in flight: the packet, the messages, and whether it is a fault.
fn reads<M>(packets: &[InFlight<M>], datagrams: bool, faulty: bool, faults: Faults) -> Vec<(u8, u8)> {
    let mut reads = Vec::new();
    for (packet, in_flight) in packets.iter().enumerate() {
        let (packet, all) = (packet as u8, in_flight.messages.len() as u8);
        if packet > 0 && !(datagrams && faulty && faults.delay) {
            break;
        }
        reads.push((packet, all));
        if !datagrams && faulty && faults.split {
            reads.extend((1..all).rev().map(|count| (packet, count)));
        }
    }
    reads
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

impl System for Setup {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        World {
            robot: Robot::new(&self.robot),
            pc: Pc::new(),
            before: 0,
            line: false,
            up: Vec::new(),
            down: Vec::new(),
            queue: Vec::new(),
            executing: None,
            owner: 0,
            starts: Vec::new(),
            faults: self.faults.most,
            users: self.faults.users,
            flags: Flags::default(),
        }
    }

    fn acts(&self, w: &World, acts: &mut Vec<Act>) {
        let (faults, faulty, datagrams) = (self.faults, w.faults > 0, self.datagrams());
        let mut urgent = false;
        let mut now = |on: bool, act| {
            if on {
                acts.push(act);
                urgent = true;
            }
        };
        let timeout = self.robot_is_due(w);
        let ready = matches!(w.robot.link, Link::Connected { cycle: Cycle::Ready { at: NOW }, .. });
        let answers = matches!(w.pc.link, pc::Link::Connected { reply: pc::Reply::Due { at: NOW, .. }, .. });
        now(w.robot.link == Link::Connecting, Act::Connect);
        now(timeout, Act::RobotTimeout);
        now(!timeout && ready, Act::Transmit);
        now(self.pc_is_due(w), Act::PcTimeout);
        now(answers, Act::Answer);
        now(self.settled(w), Act::Settled);
        now(self.drained(w), Act::Drained);
        now(w.stage() == Some(Stage::Alarm), Act::ClearQueue);
        if w.pc.order == pc::Order::Idle && w.starts.len() < self.starts.len() {
            acts.push(Act::Start);
        }
        if w.executing.is_some() {
            acts.push(Act::Done);
        } else {
            acts.extend((0..w.queue.len()).map(|at| Act::Take(at as u8)));
        }
        let up = reads(&w.up, datagrams, faulty, faults);
        acts.extend(up.into_iter().map(|(packet, count)| Act::PcReads { packet, count }));
        let down = reads(&w.down, datagrams, faulty, faults);
        acts.extend(down.into_iter().map(|(packet, count)| Act::RobotReads { packet, count }));
        if let (Some(packet), true) = (w.up.first(), faulty && faults.corrupt_up && !datagrams) {
            acts.extend((1..=packet.messages.len()).map(|n| Act::PcReadsCorrupt(n as u8)));
        }
        if let (Some(packet), true) = (w.down.first(), faulty && faults.corrupt && !datagrams) {
            acts.extend((1..=packet.messages.len()).map(|n| Act::RobotReadsCorrupt(n as u8)));
        }
        if !w.line && w.robot.is_connected() {
            acts.push(Act::RobotNotices);
        }
        if !w.line && w.pc.is_connected() {
            acts.push(Act::PcNotices);
        }
        if w.users > 0 {
            match w.pc.order {
                pc::Order::Starting { cancelled: false, .. } => acts.push(Act::Interrupt),
                pc::Order::Running { stage: pc::Stage::Active, .. } => {
                    acts.extend([Act::Interrupt, Act::End]);
                }
                pc::Order::Starting { .. } | pc::Order::Running { .. } | pc::Order::Idle => {}
            }
            match w.stage() {
                Some(Stage::Intake { .. }) => acts.extend([Act::ClearQueue, Act::ResetOrder]),
                Some(Stage::Clearing { .. } | Stage::Ending | Stage::Alarm) => acts.push(Act::ResetOrder),
                Some(Stage::Interrupted { .. }) | None => {}
            }
        }
        let late = w.up.iter().any(|p| p.left == 0) || w.down.iter().any(|p| p.left == 0);
        let in_flight = !w.up.is_empty() || !w.down.is_empty();
        if faulty {
            let mut may = |on: bool, act| {
                if on {
                    acts.push(act);
                }
            };
            may(faults.lose && w.line && !datagrams, Act::Lose);
            for up in [true, false] {
                let count = if up { w.up.len() } else { w.down.len() };
                may(faults.lose && datagrams && count > 0, Act::LoseDatagram { up, packet: 0 });
                may(faults.repeat && datagrams && count > 0, Act::Repeat { up });
            }
            may(faults.restart_pc && !w.starts.is_empty(), Act::RestartPc);
            may(faults.restart_robot && w.robot.order != Order::Idle, Act::RestartRobot);
        }
        if !urgent && (!in_flight || faulty && faults.delay && !(datagrams && late)) {
            acts.push(Act::Tick);
        }
        if urgent && faulty && faults.late_poll && !(datagrams && late) {
            acts.push(Act::LateTick);
        }
    }

    fn step(&self, state: &World, act: Act, mut edges: Edges<'_>) -> World {
        let mut w = state.clone();
        let edges = &mut edges;
        match act {
            Act::Start => {
                let order = self.starts[w.starts.len()];
                w.starts.push(Start { begun: 0, done: 0, reported: Reported::Nothing });
                self.pc(&mut w, pc::Input::Start { order }, edges);
            }
            Act::Interrupt => {
                w.users -= 1;
                self.pc(&mut w, pc::Input::Interrupt, edges);
            }
            Act::End => {
                w.users -= 1;
                self.pc(&mut w, pc::Input::End, edges);
            }
            Act::ClearQueue => {
                w.users -= u8::from(w.stage() != Some(Stage::Alarm));
                self.robot(&mut w, robot::Input::ClearQueue, edges);
            }
            Act::ResetOrder => {
                w.users -= 1;
                self.robot(&mut w, robot::Input::ResetOrder, edges);
            }
            Act::Connect => {
                w.line = true;
                if !self.datagrams() || !w.pc.is_connected() {
                    self.pc(&mut w, pc::Input::Connected, edges);
                }
                self.robot(&mut w, robot::Input::Connected, edges);
            }
            Act::RobotTimeout => {
                w.faults = w.faults.saturating_sub(u8::from(self.overdue(&w) && !self.datagrams()));
                self.robot(&mut w, robot::Input::Timeout, edges);
            }
            Act::Transmit => {
                let mut messages = Vec::new();
                w.robot.transmit(NOW, &self.robot, |message| {
                    messages.push(message);
                    true
                });
                if w.line {
                    w.up.push(InFlight { messages, left: LATEST });
                }
            }
            Act::PcReads { packet, count } => {
                let (messages, fault) = read(&mut w.up, packet, count);
                w.faults -= u8::from(fault);
                self.pc_reads(&mut w, messages.into_iter().map(Some).collect(), edges);
            }
            Act::PcReadsCorrupt(count) => {
                w.faults -= 1;
                let messages = w.up.remove(0).messages.into_iter().enumerate();
                let messages = messages.map(|(i, message)| (i + 1 != usize::from(count)).then_some(message));
                self.pc_reads(&mut w, messages.collect(), edges);
            }
            Act::PcTimeout => self.pc(&mut w, pc::Input::Timeout, edges),
            Act::Answer => {
                let start = w.starts.len().saturating_sub(1) as u8;
                let mut messages = Vec::new();
                let mut packet =
                    Packet { messages: &mut messages, jobs: self.jobs, batch: self.batch, start };
                w.pc.transmit(NOW, &self.pc, &mut packet);
                if w.line {
                    w.down.push(InFlight { messages, left: LATEST });
                }
            }
            Act::RobotReads { packet, count } => {
                let (messages, fault) = read(&mut w.down, packet, count);
                w.faults -= u8::from(fault);
                self.robot_reads(&mut w, messages, edges);
            }
            Act::RobotReadsCorrupt(count) => {
                w.faults -= 1;
                let mut messages = w.down.remove(0).messages;
                messages[usize::from(count) - 1].message = None;
                self.robot_reads(&mut w, messages, edges);
            }
            Act::Take(at) => w.take(at.into()),
            Act::Done => {
                if let Some(tag) = w.executing.take() {
                    w.starts[usize::from(tag.start)].done |= 1 << tag.job;
                    let number = u16::from(tag.job) % self.robot.max_number + 1;
                    self.robot(&mut w, robot::Input::Executed { number }, edges);
                    if !self.individual() {
                        w.take(0);
                    }
                }
            }
            Act::Settled => {
                self.robot(&mut w, robot::Input::Settled, edges);
            }
            Act::Drained => {
                self.robot(&mut w, robot::Input::Drained, edges);
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
                self.robot(&mut w, robot::Input::Disconnected, edges);
            }
            Act::PcNotices => self.pc(&mut w, pc::Input::Disconnected, edges),
            Act::RestartPc => {
                w.faults -= 1;
                w.report(Reported::Abandoned);
                (w.pc, w.before) = (Pc::new(), 0);
                if self.datagrams() {
                    self.pc(&mut w, pc::Input::Connected, edges);
                } else {
                    w.lose();
                }
            }
            Act::RestartRobot => {
                w.faults -= 1;
                if !self.datagrams() {
                    w.lose();
                }
                w.robot = Robot::new(&self.robot);
                w.queue.clear();
                w.executing = None;
            }
            Act::Tick | Act::LateTick => {
                w.faults -= u8::from(act == Act::LateTick);
                age(&mut w.robot, TICK);
                age(&mut w.pc, TICK);
                if self.datagrams() {
                    w.up.iter_mut().for_each(|packet| packet.left -= 1);
                    w.down.iter_mut().for_each(|packet| packet.left -= 1);
                }
            }
        }
        w
    }

    fn broken(&self, w: &World, broken: &mut Vec<&'static str>) {
        let mut add = |is_broken: bool, name| {
            if is_broken {
                broken.push(name);
            }
        };
        add(w.flags.twice, TWICE);
        add(w.flags.mixed, MIXED);
        add(w.flags.unexpected, UNEXPECTED);
        for start in &w.starts {
            match start.reported {
                Reported::Over { executed } => {
                    add(start.done & executed != executed, EXECUTED);
                    add(start.begun & !executed != 0, NOT_EXECUTED);
                }
                Reported::Unknown { executed, sent } => {
                    add(start.done & executed != executed, EXECUTED);
                    add(start.begun & !below(sent.into()) != 0, NOT_EXECUTED);
                }
                Reported::GivenUp => add(start.begun != 0, NOT_EXECUTED),
                Reported::Nothing | Reported::Abandoned => {}
            }
        }
        if let (pc::Order::Running { .. }, Some(start)) = (w.pc.order, w.starts.last()) {
            let executed = executed(&w.pc, self.pc.max_number);
            add(start.done & executed != executed, COUNTED);
        }
        // Over datagrams it costs no fault to be late.
        let spared = w.faults == self.faults.most && !self.datagrams();
        add(w.stage() == Some(Stage::Alarm) && spared, NO_ALARM);
        let open = w.starts.last().is_some_and(|start| start.reported == Reported::Nothing);
        add(open == (w.pc.order == pc::Order::Idle), ONE_OUTCOME);
    }

    fn benign(&self, w: &World) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(w, &mut acts);
        let alarm = w.stage() == Some(Stage::Alarm);
        let rank = |act: &Act| match act {
            Act::Connect | Act::RobotTimeout | Act::PcTimeout | Act::Settled | Act::Drained | Act::Answer => {
                Some(0)
            }
            Act::ClearQueue if alarm => Some(0),
            Act::RobotNotices | Act::PcNotices => Some(1),
            Act::RobotReads { packet: 0, .. } | Act::PcReads { packet: 0, .. } => Some(2),
            Act::Transmit | Act::Take(_) | Act::Done => Some(3),
            Act::Start => Some(4),
            Act::Tick => Some(5),
            _ => None,
        };
        // Of those that are alike the first: a whole packet before a part of it.
        acts.into_iter()
            .filter_map(|act| Some((rank(&act)?, act)))
            .min_by_key(|(rank, _)| *rank)
            .map(|(_, act)| act)
    }

    fn is_over(&self, w: &World) -> bool {
        w.starts.len() == self.starts.len() && w.pc.order == pc::Order::Idle
    }

    fn ticks(&self, act: Act) -> u32 {
        u32::from(matches!(act, Act::Tick | Act::LateTick))
    }
}
