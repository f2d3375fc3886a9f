//! Both machines, the line between them, the queue with its motion task, and a user at either end.

use core::time::Duration;

use robot_session::end::Machine as _;

use kawasaki_msg::pc::machine as pc;
use kawasaki_msg::robot::machine::{Cycle, Link, Order, Stage};

use super::machines::{Pc, Robot};
use super::step::executed;
use super::world::{Act, Faults, Flags, InFlight, ReportedStart, Setup, World};
use crate::model::{Edges, System};

const NOW: Duration = Duration::ZERO;

pub(super) const TWICE: &str = "no job is executed twice";
pub(super) const MIXED: &str = "no job joins an order that it does not belong to";
pub(super) const UNEXPECTED: &str = "nothing is unexpected";
pub(super) const EXECUTED: &str = "what is reported executed was";
pub(super) const NOT_EXECUTED: &str = "what is reported not executed was not";
pub(super) const COUNTED: &str = "what is counted executed is";
pub(super) const ONE_OUTCOME: &str = "a start has one outcome";
pub(super) const WHOLE: &str = "an order that nobody breaks off is executed whole";
pub(super) const NO_SPIN: &str = "what is due is done, and the next deadline is later";
pub(super) const NO_ALARM: &str = "no alarm without a fault";

/// Returns the ways to read one of the packets in flight: the packet, the messages, and whether that is a fault.
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

impl System for Setup {
    type State = World;
    type Act = Act;

    fn init(&self) -> World {
        World {
            robot: Robot::new(&self.robot),
            pc: Pc::default(),
            before: 0,
            line: false,
            up: Vec::new(),
            down: Vec::new(),
            robot_tail: false,
            pc_tail: false,
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
        let ready = matches!(w.robot.link, Link::Connected { cycle: Cycle::Ready { at: NOW, .. }, .. });
        let answers = matches!(w.pc.link, pc::Link::Connected { reply: pc::Reply::Due { at: NOW, .. }, .. });
        now(matches!(w.robot.link, Link::Connecting { .. }), Act::Connect);
        now(timeout, Act::RobotTimeout);
        now(!timeout && ready, Act::Transmit);
        now(w.pc.expires(NOW), Act::PcTimeout);
        now(answers, Act::Answer);
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
        // Arrived messages wait to be read.
        if urgent && faulty && faults.late_poll {
            acts.push(Act::LateTick);
        }
    }

    fn step(&self, state: &World, act: Act, mut edges: Edges<'_>) -> World {
        let mut w = state.clone();
        self.happens(&mut w, act, &mut edges);
        w.forget();
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
        add(w.flags.broken_off, WHOLE);
        let ready = matches!(w.robot.link, Link::Connected { cycle: Cycle::Ready { at: NOW, .. }, .. });
        let answers = matches!(w.pc.link, pc::Link::Connected { reply: pc::Reply::Due { at: NOW, .. }, .. });
        add(w.robot.deadline() == Some(NOW) && !ready && !self.robot_is_due(w), NO_SPIN);
        add(w.pc.deadline() == Some(NOW) && !answers && !w.pc.expires(NOW), NO_SPIN);
        add(w.starts.iter().any(|start| !start.executed_is_true()), EXECUTED);
        add(w.starts.iter().any(|start| !start.not_executed_is_true()), NOT_EXECUTED);
        if let (pc::Order::Running { .. }, Some(start)) = (w.pc.order, w.starts.last()) {
            let executed = executed(&w.pc);
            add(start.done & executed != executed, COUNTED);
        }
        // Over datagrams it costs no fault to be late.
        let spared = w.faults == self.faults.most && !self.datagrams();
        add(w.stage() == Some(Stage::Alarm) && spared, NO_ALARM);
        let open = w.starts.last().is_some_and(|start| start.reported == ReportedStart::Nothing);
        add(open == (w.pc.order == pc::Order::Idle), ONE_OUTCOME);
    }

    fn fault_free_step(&self, w: &World) -> Option<Act> {
        let mut acts = Vec::new();
        self.acts(w, &mut acts);
        let alarm = w.stage() == Some(Stage::Alarm);
        let rank = |act: &Act| match act {
            Act::Connect | Act::RobotTimeout | Act::PcTimeout | Act::Answer => Some(0),
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
