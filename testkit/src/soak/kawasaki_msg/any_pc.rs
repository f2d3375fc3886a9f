//! A PC of another maker and keeps the source's rules: KM-3, KM-91, KM-95 and KM-96.
//!
//! It answers at any time, or not at all, with any number of jobs from the requested one on. It sends the end after
//! the last of them or when all are executed, and interrupts and ends the order at any time.

use core::time::Duration;

use super::text;
use super::{Cell, MS};
use crate::controller::Controller;
use crate::link::{Delivery, End};
use crate::soak::kawasaki_msg::picture::line;
use robot_session::contract::Rng;

pub(super) struct AnyPc {
    max_number: u16,
    /// Whether it sends the end when all jobs are sent; otherwise when all are executed.
    hurries: bool,
    held: Vec<u8>,
    is_connected: bool,
    /// The time at which it answers the bytes that have arrived.
    answer_at: Option<Duration>,
    stage: Stage,
    order: u16,
    /// The order that the robot is in, as it has reported on this connection.
    robot: Option<u16>,
    executed: u32,
    sent: u32,
    asked: Option<u32>,
    status: bool,
    /// The jobs from the one that was asked for last are sent.
    all_sent: bool,
    /// Somebody has ended the order before its last job.
    pub(super) is_short: bool,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Stage {
    Idle,
    Unsent,
    /// The start was sent on this connection, or on one before.
    Sent {
        here: bool,
    },
    Active,
    Ending,
    Interrupted,
}

impl AnyPc {
    pub(super) fn new(max_number: u16, rng: &mut Rng) -> Self {
        Self {
            max_number,
            hurries: rng.chance(0.5),
            held: Vec::new(),
            is_connected: false,
            answer_at: None,
            stage: Stage::Idle,
            order: 0,
            robot: None,
            executed: 0,
            sent: 0,
            asked: None,
            status: false,
            all_sent: false,
            is_short: false,
        }
    }

    pub(super) fn next(&self) -> Option<Duration> {
        self.answer_at
    }

    pub(super) fn start(&mut self, order: u16) {
        (self.order, self.stage) = (order, Stage::Unsent);
        (self.executed, self.sent, self.asked) = (0, 0, None);
        (self.all_sent, self.is_short) = (false, false);
    }

    /// Lets the user end the order, or interrupt it.
    pub(super) fn leave(&mut self, interrupts: bool) {
        if matches!(self.stage, Stage::Active | Stage::Ending) {
            self.stage = if interrupts { Stage::Interrupted } else { Stage::Ending };
            self.is_short = true;
        }
    }

    pub(super) fn connect(&mut self) {
        self.held.clear();
        (self.is_connected, self.answer_at, self.robot, self.asked) = (true, None, None, None);
        if let Stage::Sent { here } = &mut self.stage {
            *here = false;
        }
    }

    /// Reads a message; returns the number of jobs that are certainly executed, and of those that may be, when the
    /// order ends.
    fn read(&mut self, name: &str, fields: &[Option<i32>]) -> Option<(u32, u32)> {
        let field = |at: usize| fields.get(at).copied().flatten();
        let is_ours = field(0) == Some(self.order.into()) && self.stage != Stage::Idle;
        let runs = matches!(self.stage, Stage::Active | Stage::Ending | Stage::Interrupted);
        match name {
            "TilausKuittaus" if self.stage == (Stage::Sent { here: true }) => {
                self.stage = if is_ours { Stage::Active } else { Stage::Unsent };
            }
            "TyoKuittaus" if is_ours && runs => self.is_executed(field(1)),
            "TyoPyynto" if is_ours && self.stage == Stage::Active => {
                let before = field(1).map(|number| number - 1 + i32::from(self.max_number));
                let from = before.map(|number| text::count(self.executed, number, self.max_number));
                self.asked = from.filter(|from| *from <= self.sent);
            }
            // An answer that arrives when the order is active again is about an earlier order.
            "LoppuKuittaus" if is_ours && runs && field(1) != Some(self.order.into()) => {
                self.robot = field(1).map(|order| order as u16);
                self.is_executed(field(2));
                return Some((self.executed, self.executed));
            }
            "Tila" => {
                self.status = true;
                let robot = field(0).map_or(0, |order| order as u16);
                self.robot = Some(robot);
                match self.stage {
                    Stage::Sent { here: false } if is_ours && field(2).is_none() => {
                        self.stage = Stage::Active
                    }
                    Stage::Sent { here: false } => self.stage = Stage::Unsent,
                    _ if runs && is_ours => self.is_executed(field(3)),
                    _ if runs && robot == 0 && field(4) == Some(self.order.into()) => {
                        self.is_executed(field(3));
                        return Some((self.executed, self.executed));
                    }
                    _ if runs => return Some((self.executed, self.sent)),
                    _ => {}
                }
            }
            _ => {}
        }
        None
    }

    fn is_executed(&mut self, number: Option<i32>) {
        let Some(number) = number else { return };
        let count = text::count(self.executed, number, self.max_number);
        assert!(count <= self.sent, "job {number} was not sent");
        self.executed = count;
    }

    fn packet(&mut self, first: usize, jobs: u32, is_calm: bool, rng: &mut Rng) -> String {
        let (mut packet, ours) = (String::new(), Some(i32::from(self.order)));
        if core::mem::take(&mut self.status) {
            let (order, phase) = if self.stage == Stage::Idle { (Some(0), 0) } else { (ours, 2) };
            text::push(&mut packet, "Tila", &[order, Some(phase), None, None, None]);
        }
        let robot = self.robot.filter(|robot| *robot != 0);
        match (self.stage, robot) {
            (Stage::Unsent, Some(robot)) => {
                text::push(&mut packet, "TilausKeskeytyy", &[Some(robot.into())]);
            }
            (Stage::Unsent, None) if self.robot.is_some() => {
                self.stage = Stage::Sent { here: true };
                text::push(&mut packet, "TilausAlkaa", &[ours, Some(1)]);
            }
            (Stage::Interrupted, _) => text::push(&mut packet, "TilausKeskeytyy", &[ours]),
            (Stage::Ending, _) => text::push(&mut packet, "TilausLoppuu", &[ours]),
            _ => {}
        }
        if let (Stage::Active, Some(from)) = (self.stage, self.asked.take()) {
            let from = from.max(self.executed);
            let most = if is_calm { 20 } else { 1 + rng.below(20) as u32 };
            let window = self.executed + u32::from(self.max_number) - 1;
            let until = (from + most).min(jobs).min(window).max(from);
            for index in from..until {
                let (job, number) = (line(first + index as usize), text::number(index + 1, self.max_number));
                let [start, end] = [job.start, job.end].map(|point| [Some(point.x), Some(point.y)]);
                let fields = [ours, number, Some(job.kind as i32), start[0], start[1], end[0], end[1]];
                text::push(&mut packet, "Tyo", &fields);
            }
            (self.sent, self.all_sent) = (self.sent.max(until), until == jobs);
            self.stage = if self.executed == jobs { Stage::Ending } else { self.stage };
            if until == jobs && (self.hurries || self.executed == jobs) {
                text::push(&mut packet, "TilausLoppuu", &[ours]);
            }
        } else if self.stage == Stage::Active && self.hurries && self.all_sent {
            text::push(&mut packet, "TilausLoppuu", &[ours]);
        }
        if packet.is_empty() {
            text::push(&mut packet, "Huuhaa", &[]);
        }
        packet
    }
}

impl<C: Controller> Cell<C> {
    /// Runs the other PC in place of the project's own.
    pub(super) fn other_pc_pass(&mut self, other: &mut AnyPc, rng: &mut Rng) {
        while let Some(delivery) = self.receive(End::B) {
            match delivery {
                Delivery::Bytes(bytes) => other.held.extend(bytes),
                Delivery::Closed => other.is_connected = false,
            }
        }
        let mut outcome = None;
        while other.is_connected
            && let Some((name, fields)) = text::take(&mut other.held)
        {
            self.log.line(self.now, format_args!("  PC: {name} {fields:?}"));
            let late = if self.is_calm { 2 * MS } else { rng.log_uniform(MS / 10, 1500 * MS) };
            other.answer_at = other.answer_at.or(Some(self.now + late));
            outcome = other.read(&name, &fields);
            if let Some((executed, sent)) = outcome {
                let jobs = self.order.as_ref().map_or(0, |order| order.picture.jobs);
                if executed == sent && executed < jobs && !other.is_short {
                    self.log.line(self.now, format_args!("!!! the end was obeyed before the last job"));
                    self.invented += 1;
                }
                self.over(executed, sent);
                other.stage = Stage::Idle;
            }
        }
        if !other.held.is_empty() || outcome.is_some() || !other.is_connected {
            return;
        }
        if other.answer_at.take_if(|at| *at <= self.now).is_none() || !self.is_calm && rng.chance(0.02) {
            return;
        }
        let (first, jobs) =
            self.order.as_ref().map_or((0, 0), |order| (order.picture.first, order.picture.jobs));
        let packet = other.packet(first, jobs, self.is_calm, rng);
        self.send(End::B, packet.as_bytes());
    }
}
