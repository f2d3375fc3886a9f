//! A robot of another maker and keeps the source's rules: KM-3, KM-51, KM-52, KM-56 to KM-61, KM-64, KM-65, KM-67 and KM-71.
//!
//! It requests jobs, acknowledges and reports its status at any time, refuses starts, pauses, accepts fewer jobs than it is
//! sent, and gives up a connection at any time.

use core::time::Duration;
use std::collections::VecDeque;

use kawasaki_msg::robot_session::Session;
use kawasaki_msg::{
    Bounds, Job, JobKind, Line, Phase, Point, RobotConfig, RobotEvent, RobotStatistics, SessionError,
};

use super::{MS, text};
use crate::controller::Controller;
use robot_session::contract::Rng;

pub(super) struct AnyRobot {
    rng: Rng,
    max_number: u16,
    capacity: usize,
    events: VecDeque<RobotEvent>,
    /// `None`: connected.
    connects_at: Option<Duration>,
    held: Vec<u8>,
    /// The time at which its next packet is due, and whether it was answered since the last one.
    packet_at: Duration,
    answered: bool,
    /// Packets since it was.
    unanswered: u32,
    order: Option<u16>,
    /// No job follows.
    ending: bool,
    queue: VecDeque<Job<Line>>,
    queued: u32,
    executed: u32,
    acknowledged: u32,
    /// Jobs are missing: none is taken before the next request is sent.
    gap: bool,
    /// Jobs are not asked for before.
    paused_until: Duration,
    ended: Option<(u16, u32)>,
    start: Option<u16>,
    ack_end: bool,
    status: bool,
}

impl Controller for AnyRobot {
    const WHOLE: bool = false;

    fn within(_: Bounds, config: RobotConfig, capacity: usize, seed: u64) -> Self {
        Self {
            rng: Rng::new(seed ^ 0x616E_7972),
            max_number: config.max_number,
            capacity,
            events: VecDeque::new(),
            connects_at: Some(Duration::ZERO),
            held: Vec::new(),
            packet_at: Duration::ZERO,
            answered: false,
            unanswered: 0,
            order: None,
            ending: false,
            queue: VecDeque::new(),
            queued: 0,
            executed: 0,
            acknowledged: 0,
            gap: false,
            paused_until: Duration::ZERO,
            ended: None,
            start: None,
            ack_end: false,
            status: true,
        }
    }

    fn execute(&mut self, _: Duration, _: bool) -> Option<Job<Line>> {
        let job = self.queue.pop_front()?;
        self.executed += 1;
        Some(job)
    }

    fn report(&mut self, _: Duration) {}

    fn has_jobs(&self) -> bool {
        !self.queue.is_empty()
    }

    fn clear_queue(&mut self) -> Result<(), SessionError> {
        if self.order.is_some() && !self.ending {
            self.queue.clear();
            (self.queued, self.gap) = (self.executed, true);
        }
        Ok(())
    }

    fn reset_order(&mut self) -> Result<(), SessionError> {
        self.over();
        Ok(())
    }

    fn phase(&self) -> Phase {
        if self.order.is_some() { Phase::Active } else { Phase::Idle }
    }

    fn queued(&self) -> u32 {
        self.queued
    }

    fn executed(&self) -> u32 {
        self.executed
    }

    fn order(&self) -> Option<u16> {
        self.order
    }
}

impl AnyRobot {
    fn over(&mut self) {
        let Some(order) = self.order.take() else { return };
        self.queue.clear();
        (self.ended, self.queued, self.ending) = (Some((order, self.executed)), self.executed, false);
        (self.ack_end, self.status) = (true, true);
    }

    fn begin(&mut self, order: u16) {
        self.status = true;
        let is_again = self.order == Some(order) && self.queued == 0 && !self.ending;
        if self.order.is_some() && !is_again {
            self.start = Some(self.order.filter(|active| *active != order).unwrap_or(0));
        } else if is_again || self.rng.chance(0.9) {
            (self.order, self.start) = (Some(order), Some(order));
            (self.queued, self.executed, self.acknowledged, self.gap) = (0, 0, 0, false);
        } else {
            self.start = Some(0);
        }
    }

    fn end(&mut self, order: Option<u16>) -> bool {
        let is_ours = order.is_some() && order == self.order;
        if !is_ours {
            let is_over = self.ended.is_some_and(|(ended, _)| Some(ended) == order);
            (self.ack_end, self.status) = (self.ack_end || is_over, self.status || !is_over);
        }
        is_ours
    }

    fn obey(&mut self, name: &str, fields: &[Option<i32>]) {
        let order = fields.first().copied().flatten().and_then(|order| u16::try_from(order).ok());
        match (name, order) {
            ("TilausAlkaa", Some(order)) => self.begin(order),
            ("TilausLoppuu", _) if self.end(order) && !self.gap => self.ending = true,
            ("TilausKeskeytyy", _) if self.end(order) => self.over(),
            ("Tyo", _) => self.queue(order, fields),
            _ => {}
        }
    }

    fn queue(&mut self, order: Option<u16>, fields: &[Option<i32>]) {
        let [_, Some(number), Some(kind), Some(x1), Some(y1), Some(x2), Some(y2)] = *fields else {
            panic!("{fields:?}");
        };
        let is_next = text::number(self.queued + 1, self.max_number) == Some(number);
        if self.gap || self.ending || order != self.order || !is_next {
            return;
        }
        if self.queue.len() >= self.capacity || self.rng.chance(0.02) {
            self.gap = true;
            return;
        }
        let kind = if kind == 2 { JobKind::Move } else { JobKind::Draw };
        let work = Line { kind, start: Point::new(x1, y1), end: Point::new(x2, y2) };
        self.queue.push_back(Job { order: order.unwrap_or(0), number: number as u16, work });
        self.queued += 1;
    }

    fn packet(&mut self, now: Duration) -> String {
        let (mut packet, rng) = (String::new(), &mut self.rng);
        let number = |count| text::number(count, self.max_number);
        let order = |order: Option<u16>| Some(order.unwrap_or(0).into());
        if self.order.is_some() && self.executed > self.acknowledged && rng.chance(0.6) {
            let from = self.acknowledged + 1 + rng.below((self.executed - self.acknowledged) as usize) as u32;
            for count in from..=self.executed {
                text::push(&mut packet, "TyoKuittaus", &[order(self.order), number(count)]);
            }
            self.acknowledged = self.executed;
        }
        if let Some(start) = self.start.take() {
            text::push(&mut packet, "TilausKuittaus", &[Some(start.into())]);
        }
        let ended = self.ended.map(|(ended, _)| i32::from(ended));
        if let Some((_, executed)) = self.ended.filter(|_| core::mem::take(&mut self.ack_end)) {
            text::push(&mut packet, "LoppuKuittaus", &[ended, order(self.order), number(executed)]);
        }
        if core::mem::take(&mut self.status) || rng.chance(0.1) {
            let phase = if self.order.is_none() {
                0
            } else if self.ending {
                3
            } else {
                2
            };
            let counts = [number(self.queued), number(self.executed)];
            // It acknowledges its own report.
            self.acknowledged = self.executed;
            text::push(&mut packet, "Tila", &[order(self.order), Some(phase), counts[0], counts[1], ended]);
        }
        if self.order.is_some() && !self.ending {
            if self.queue.len() >= self.capacity || rng.chance(0.02) {
                self.paused_until = now + MS * rng.below(300) as u32;
                text::push(&mut packet, "TyoTauko", &[order(self.order), number(self.queued)]);
            } else if now >= self.paused_until && rng.chance(0.8) {
                text::push(&mut packet, "TyoPyynto", &[order(self.order), number(self.queued + 1)]);
                self.gap = false;
            }
        }
        if packet.is_empty() {
            text::push(&mut packet, "Huuhaa", &[]);
        }
        packet
    }
}

impl Session for AnyRobot {
    type Event = RobotEvent;
    type Statistics = RobotStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = 4096;

    fn handle_connected(&mut self, now: Duration) {
        self.held.clear();
        (self.connects_at, self.packet_at, self.answered, self.unanswered) = (None, now, false, 0);
        (self.start, self.status, self.gap) = (None, true, true);
    }

    fn handle_disconnected(&mut self, now: Duration) {
        self.connects_at = Some(now + self.rng.log_uniform(MS, 1500 * MS));
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        if self.connects_at.is_some() {
            // They are of the connection before.
            return;
        }
        self.held.extend(bytes);
        while let Some((name, fields)) = text::take(&mut self.held) {
            self.answered = true;
            self.obey(&name, &fields);
        }
        if self.answered && self.held.is_empty() {
            (self.answered, self.unanswered) = (false, 0);
            self.packet_at = now + self.rng.log_uniform(MS, 200 * MS);
        }
    }

    fn handle_timeout(&mut self, now: Duration) {
        if self.ending && self.queue.is_empty() {
            self.over();
        }
        if self.connects_at.is_some_and(|at| at <= now) {
            self.connects_at = Some(now + Duration::from_secs(5));
            self.events.push_back(RobotEvent::Connect);
        }
        if self.connects_at.is_none() && (self.unanswered > 5 || self.rng.chance(0.001)) {
            self.events.push_back(RobotEvent::Disconnect);
        }
    }

    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.events.pop_front()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        if self.connects_at.is_some() || self.packet_at > now {
            return None;
        }
        // Without an answer, the next one.
        self.packet_at = now + self.rng.log_uniform(500 * MS, 2000 * MS);
        self.unanswered += 1;
        let packet = self.packet(now);
        out.get_mut(..packet.len())?.copy_from_slice(packet.as_bytes());
        Some(packet.len())
    }

    fn poll_timeout(&self) -> Option<Duration> {
        Some(self.connects_at.unwrap_or(self.packet_at))
    }

    fn statistics(&self) -> RobotStatistics {
        RobotStatistics::default()
    }
}
