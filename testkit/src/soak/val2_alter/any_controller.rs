//! A controller that is not ours and keeps the source's rules: AL-71 to AL-73, AL-75 to AL-79 and AL-90.
//!
//! It finds faults that are none, goes on without a reply or ends, interrupts and ends ALTER when it likes, and is restarted.

use core::time::Duration;

use robot_session::Decoder as _;
use val2_alter::timing::{self, Budget};
use val2_alter::{
    ControllerConfig, ControllerEvent, Decoder, End as EndMessage, ErrorCode, Exception, Frame, Framing,
    HostMessage, List, Message as _, Mode, Motion, MotionPhase, Reply, RobotMessage, SegmentStatus, Start,
    StartCode, Transform,
};

use super::{MS, Values};
use crate::Carrier;
use crate::link::{Delivery, End};
use robot_session::contract::Rng;

pub(super) struct AnyController {
    config: ControllerConfig,
    decoder: Decoder<HostMessage>,
    robot: Robot,
    /// When its next message is due, and the one after it.
    slot: Duration,
    following: Duration,
    /// The window of its last message, until a good answer has come.
    window: Option<(Duration, Duration)>,
    fault: Option<ErrorCode>,
    /// What its next message says of the window.
    error: ErrorCode,
    words: Values,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Robot {
    Off,
    Starting { attempts: u8 },
    Running,
    Interrupted { reported: bool },
    Ending,
}

impl AnyController {
    pub(super) fn new(config: ControllerConfig, begins_at: Duration) -> Self {
        Self {
            config,
            decoder: Decoder::new(Framing::DEFAULT),
            robot: Robot::Off,
            slot: begins_at,
            following: begins_at,
            window: None,
            fault: None,
            error: ErrorCode::None,
            words: [0; 6],
        }
    }

    pub(super) fn next(&self) -> Duration {
        self.window.map_or(self.slot, |(_, closes)| closes)
    }

    /// What it does with the arm.
    pub(super) fn turn(
        &mut self,
        line: &mut impl Carrier,
        now: Duration,
        is_calm: bool,
        rng: &mut Rng,
    ) -> Vec<ControllerEvent> {
        let mut events = Vec::new();
        while let Some(delivery) = line.receive(End::A, now, usize::MAX) {
            let Delivery::Bytes(bytes) = delivery else { continue };
            let mut rest = bytes.as_slice();
            while !rest.is_empty() {
                rest = &rest[self.decoder.push(rest)..];
                self.read(now, is_calm, &mut events, rng);
            }
        }
        if self.window.is_some_and(|(_, closes)| now >= closes) {
            self.decoder.finish();
            self.read(now, is_calm, &mut events, rng);
            self.close(now, is_calm, rng);
        }
        if !is_calm && rng.chance(0.001) {
            *self = Self::new(self.config, now + rng.log_uniform(MS, Duration::from_secs(2)));
        }
        if self.window.is_none() {
            match self.robot {
                Robot::Running if !is_calm && rng.chance(0.003) => self.robot = Robot::Ending,
                Robot::Running if !is_calm && rng.chance(0.01) => {
                    self.robot = Robot::Interrupted { reported: false }
                }
                Robot::Interrupted { reported: true } if rng.chance(0.2) => self.robot = Robot::Running,
                _ => {}
            }
            if now >= self.slot {
                self.send(line, now, is_calm, rng);
            }
        }
        events
    }

    fn read(&mut self, now: Duration, is_calm: bool, events: &mut Vec<ControllerEvent>, rng: &mut Rng) {
        while let Some(found) = self.decoder.next_frame() {
            // After the window, and while the message is still on the line, nothing is looked at.
            let Some(_) = self.window.filter(|(opens, closes)| (*opens..=*closes).contains(&now)) else {
                continue;
            };
            let is_misread = !is_calm && rng.chance(0.02);
            match (self.robot, found.map(|found| found.message)) {
                (_, Err(_)) => _ = self.fault.get_or_insert(ErrorCode::Format),
                _ if is_misread => _ = self.fault.get_or_insert(ErrorCode::Checksum),
                (Robot::Starting { .. }, Ok(HostMessage::StartReply(code))) => self.start(now, code, rng),
                (Robot::Running | Robot::Interrupted { .. }, Ok(HostMessage::Reply(reply))) => {
                    self.obey(reply, events);
                }
                _ => _ = self.fault.get_or_insert(ErrorCode::Overflow),
            }
        }
    }

    fn start(&mut self, now: Duration, code: StartCode, rng: &mut Rng) {
        (self.window, self.error) = (None, ErrorCode::None);
        match code {
            StartCode::Accept => (self.robot, self.words) = (Robot::Running, [0; 6]),
            StartCode::Repeat => {}
            StartCode::Refuse => self.end(now, rng),
        }
    }

    fn obey(&mut self, reply: Reply, events: &mut Vec<ControllerEvent>) {
        (self.window, self.error) = (None, ErrorCode::None);
        if self.robot != Robot::Running {
            return;
        }
        let holds = self.config.unselected.holds(self.config.mode.accumulation());
        for (word, value) in self.words.iter_mut().zip(reply.values) {
            *word = value.unwrap_or(if holds { *word } else { 0 });
        }
        events.push(ControllerEvent::Reply { reply, values: self.words });
        if reply.exception != Exception::None {
            self.robot = Robot::Interrupted { reported: false };
            events.push(ControllerEvent::Exception(reply.exception));
        }
    }

    /// No good answer came.
    fn close(&mut self, now: Duration, is_calm: bool, rng: &mut Rng) {
        if self.window.take().is_none() {
            return;
        }
        let fault = self.fault.take();
        self.error = fault.unwrap_or(ErrorCode::Timeout);
        match self.robot {
            Robot::Starting { attempts } if attempts >= self.config.attempts => self.end(now, rng),
            Robot::Running | Robot::Interrupted { .. } if fault.is_none() && (is_calm || rng.chance(0.5)) => {
                self.robot = Robot::Ending;
            }
            _ => {}
        }
    }

    /// ALTER is over; the program executes it again some time.
    fn end(&mut self, now: Duration, rng: &mut Rng) {
        *self = Self::new(self.config, now.max(self.slot) + MS * rng.below(100) as u32);
    }

    fn send(&mut self, line: &mut impl Carrier, now: Duration, is_calm: bool, rng: &mut Rng) {
        let mut motion = |phase, error| {
            RobotMessage::Motion(Motion {
                phase,
                error,
                segment_status: SegmentStatus::from(1 + rng.below(13) as u8),
                segment: 1,
                percent: rng.below(1 << 14) as u16,
                transform: self.config.mode.has_transform().then_some(Transform([0; 12])),
            })
        };
        let message = match &mut self.robot {
            Robot::Off | Robot::Starting { .. } => {
                let is_expected = is_calm || rng.chance(0.95);
                let mode = if is_expected { self.config.mode } else { Mode(self.config.mode.0 ^ 2) };
                let attempts = if let Robot::Starting { attempts } = self.robot { attempts } else { 0 };
                self.robot = Robot::Starting { attempts: attempts + 1 };
                RobotMessage::Start(Start { error: self.error, ..Start::new(mode, List::EMPTY) })
            }
            Robot::Running => motion(MotionPhase::Running, self.error),
            Robot::Interrupted { reported } => {
                *reported = true;
                motion(MotionPhase::Interrupted, self.error)
            }
            Robot::Ending => RobotMessage::End(EndMessage { error: self.error }),
        };
        let mut out = [0; Frame::MAX_LEN];
        let len = message.encode(Framing::DEFAULT, &mut out).unwrap_or_default();
        line.send(End::A, now, &out[..len]);
        if self.robot == Robot::Ending {
            self.slot = now + timing::CYCLE;
            return self.end(now, rng);
        }
        let budget = Budget::new(self.config.mode.accumulation(), self.config.baud, len, 0);
        let opens = now + budget.request;
        let closes = opens + budget.window;
        self.decoder.clear();
        (self.window, self.fault) = (Some((opens, closes)), None);
        self.slot = closes.max(self.following.max(now + timing::CYCLE / 2));
        self.following = self.slot + timing::CYCLE;
    }
}
