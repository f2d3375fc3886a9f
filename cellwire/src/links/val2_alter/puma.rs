//! The simulated PUMA 562 on its MARK III controller.

use core::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use robot_session::{Driver, Session as _};
use serde_json::{Value, json};
use val2_alter::timing::{self, Budget};
use val2_alter::{
    AXES, Controller, ControllerConfig, ControllerEvent, ControllerState, ErrorCode, Exception, Motion,
    SegmentStatus,
};

use super::arm::{Arm, ArmConfig};
use super::judge::{Judge, Taken};
use super::pose::Pose;
use super::robot_line::{Request, RobotLine};
use super::script::{Incident, Script};
use crate::io::line::Line;
use crate::io::output::log;
use crate::io::priority::{self, Rank};
use crate::io::samples::Samples;
use crate::links::device::SimulateOptions;
use crate::links::device::serve;
use cellwire_links::settings;

/// The stop is looked at this often.
const IDLE: Duration = Duration::from_millis(20);
/// The cycles of a motion segment of the program.
const SEGMENT: u64 = 36;
/// The position is told after so many cycles: twice a second.
const TOLD: u64 = 18;

/// How the simulated robot behaves.
#[derive(Debug, Clone)]
pub struct PumaConfig {
    /// The ALTER instruction and the line.
    pub controller: ControllerConfig,
    /// The arm.
    pub arm: ArmConfig,
    /// The operator starts the program again so long after it ended.
    pub restart: Duration,
    /// The subroutine that closes or opens the gripper takes this long.
    pub subroutine_time: Duration,
    /// What happens besides.
    pub script: Script,
    /// Whether the record keeps each end, each cycle without a reply and each move of the gripper.
    pub keeps_all: bool,
}

impl Default for PumaConfig {
    /// `ALTER(0, 23, clamp2, 127)`.
    fn default() -> Self {
        // Bytes that came together may be read apart on a busy machine: no gap ends a frame.
        let controller = ControllerConfig { subroutine: true, gap: None, ..ControllerConfig::default() };
        Self {
            controller,
            arm: ArmConfig::default(),
            restart: Duration::from_secs(1),
            subroutine_time: Duration::from_millis(120),
            script: Script::default(),
            keeps_all: true,
        }
    }
}

/// What the simulated robot tells while it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PumaEvent {
    /// ALTER runs.
    Started(Pose),
    /// The arm is there.
    Moves(Pose),
    /// The host refused it.
    Refused,
    /// Nobody answered.
    GaveUp,
    /// A reply could not be read, or did not come.
    BadReply(ErrorCode),
    /// The gripper closes (true) or opens.
    Gripper(bool),
    /// An exception that the subroutine does not know, or that nobody handles.
    Exception(u8),
    /// What was measured since ALTER began.
    Measured(Measured),
    /// ALTER is over; the arm stands there.
    Ended(ErrorCode, Pose),
    /// A client has the port open, or none has.
    Connected(bool),
    /// What the script says has happened.
    Incident(Incident),
}

/// How the replies of an ALTER came.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Measured {
    /// How many came in time.
    pub replies: u64,
    /// From the last byte of a request to the last byte of its reply: half of them at most, 99 % at most, the longest.
    pub turn_around: [Duration; 3],
    /// The shortest window.
    pub window: Duration,
}

/// What the simulated robot measured and counted.
#[derive(Debug, Clone, Default)]
pub struct PumaRecord {
    /// From the last byte of a request to the last byte of its reply.
    pub turn_around: Samples,
    /// When there was a cycle without a good reply.
    pub without: Vec<Duration>,
    /// The part of it that the host took, until it wrote the reply.
    pub thinking: Samples,
    /// What was left of the window.
    pub margin: Samples,
    /// The shortest window.
    pub window: Option<Duration>,
    /// The speeds of the replies that were taken.
    pub judge: Judge,
    /// Standard messages sent.
    pub cycles: u64,
    /// Cycles without a reply.
    pub missed: u64,
    /// Replies that could not be read.
    pub bad_replies: u64,
    /// Times that ALTER began.
    pub starts: u64,
    /// The ends of ALTER, and why.
    pub ends: Vec<(Duration, ErrorCode)>,
    /// The gripper's moves: true closes.
    pub gripper: Vec<bool>,
    /// Replies that came too late for their window.
    pub strays: u64,
    /// How long the simulator itself was late.
    pub stood: Duration,
    /// How far the arm was from its place at the end of ALTER when ALTER began again, in mm: it stands still in between.
    pub drift: f64,
}

/// `cellwire simulate puma`.
///
/// # Errors
/// When the endpoint cannot be opened, or a setting is none of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let config = PumaConfig { keeps_all: false, ..PumaConfig::default() };
    let config = settings::read("puma", config, &options.settings)?;
    serve("puma", "robot", options, config.controller.baud, |line, _| {
        run(line, config, &AtomicBool::new(false), |at, event| log(&to_json(at, event)))?;
        Ok(())
    })
}

/// Runs the robot's program until told to stop, or until the connection is gone.
///
/// # Errors
/// When an event cannot be reported.
pub fn run(
    line: &mut Line,
    config: PumaConfig,
    stop: &AtomicBool,
    mut notify: impl FnMut(Duration, PumaEvent) -> Result<()>,
) -> Result<PumaRecord> {
    priority::raise(Rank::Hardware);
    let mut controller = Controller::new(config.controller)?;
    let framing = config.controller.framing;
    let mut puma = Puma::new(config);
    let mut driver = Driver::new(RobotLine::new(line, framing));
    while !stop.load(Ordering::Relaxed) {
        puma.happen(&mut controller, driver.transport_mut());
        let (now, connected) = (driver.transport_mut().now, driver.transport_mut().line.is_connected());
        puma.operate(&mut controller, now, connected);
        let mut events = Vec::new();
        let wait = puma.wait(&controller, now);
        let turn = driver.turn(&mut controller, Some(wait), |_, event| {
            events.push(event);
            ControlFlow::<()>::Continue(())
        })?;
        let robot = driver.transport_mut();
        puma.collect(events, &controller, robot);
        for event in puma.events.drain(..) {
            notify(robot.now, event)?;
            if let PumaEvent::Ended(error, _) = event {
                robot.line.end_session(&format!("ALTER ended, {}", error_text(error)));
            }
        }
        if turn.is_break() {
            break;
        }
    }
    Ok(puma.record)
}

/// The robot's operator, its program, its arm and its gripper.
struct Puma {
    arm: Arm,
    config: PumaConfig,
    record: PumaRecord,
    events: Vec<PumaEvent>,
    connected: bool,
    start_at: Duration,
    resume_at: Option<Duration>,
    stands_at: Option<Pose>,
    /// When the first ALTER began.
    begun_at: Option<Duration>,
    /// The turn-arounds of this ALTER.
    turn_around: Samples,
    /// Cycles in which the program of this ALTER went on along its path.
    path_cycles: u64,
    segment_status: SegmentStatus,
}

impl Puma {
    fn new(config: PumaConfig) -> Self {
        Self {
            arm: Arm::new(config.arm, config.controller.mode),
            config,
            record: PumaRecord::default(),
            events: Vec::new(),
            connected: false,
            start_at: Duration::ZERO,
            resume_at: None,
            stands_at: None,
            begun_at: None,
            turn_around: Samples::default(),
            path_cycles: 0,
            segment_status: SegmentStatus::Normal,
        }
    }

    /// What the script says.
    fn happen(&mut self, controller: &mut Controller, robot: &mut RobotLine<'_>) {
        let now = robot.now;
        let time = self.begun_at.map_or(Duration::ZERO, |begin| now.saturating_sub(begin));
        while let Some(incident) = self.config.script.due(time) {
            let on_the_line = matches!(incident, Incident::Misread(_) | Incident::Corrupt);
            match controller.state() {
                ControllerState::Running => {}
                ControllerState::Starting if on_the_line => {}
                _ => return,
            }
            match incident {
                Incident::Interrupt(time) => {
                    if controller.interrupt(now).is_err() {
                        // Between two cycles.
                        return;
                    }
                    self.resume_at = Some(now.saturating_add(time));
                }
                // One at a time.
                Incident::Misread(_) if robot.misread.is_some() => return,
                Incident::Misread(error) => robot.misread = Some(error),
                Incident::Corrupt if robot.corrupt => return,
                Incident::Corrupt => robot.corrupt = true,
                Incident::Status(status) => self.segment_status = status,
                // It runs.
                Incident::Finish => _ = controller.finish(now),
                Incident::Restart => {
                    controller.handle_disconnected(now);
                    controller.handle_connected(now);
                    let _ = controller.start(now);
                }
            }
            self.config.script.advance();
            self.events.push(PumaEvent::Incident(incident));
        }
    }

    /// How long there is nothing to do here.
    fn wait(&self, controller: &Controller, now: Duration) -> Duration {
        let start = (controller.state() == ControllerState::Off).then_some(self.start_at);
        let next = [self.resume_at, start].into_iter().flatten().min();
        next.map_or(IDLE, |at| at.saturating_sub(now).min(IDLE))
    }

    /// What the robot's program and its operator do: the subroutine returns, the program starts, its segments go by.
    fn operate(&mut self, controller: &mut Controller, now: Duration, connected: bool) {
        if self.resume_at.is_some_and(|at| at <= now) {
            self.resume_at = None;
            // ALTER may have ended meanwhile.
            let _ = controller.resume(now);
        }
        if connected != self.connected {
            self.connected = connected;
            if connected {
                controller.handle_connected(now);
            } else {
                controller.handle_disconnected(now);
            }
            self.start_at = self.start_at.max(now + Duration::from_millis(200));
            self.events.push(PumaEvent::Connected(connected));
        }
        if controller.state() == ControllerState::Off && now >= self.start_at {
            // It cannot have been started already: it is off.
            let _ = controller.start(now);
        }
        // "Beginnt mit 1" (§3.2.2), and stands while the path does.
        let number = 1 + self.path_cycles / SEGMENT % u64::from(u16::MAX);
        let done = self.path_cycles % SEGMENT * u64::from(Motion::DONE) / SEGMENT;
        let [number, done] = [number, done].map(|word| u16::try_from(word).unwrap_or_default());
        let status = if self.path_cycles == 0 { SegmentStatus::NoneYet } else { self.segment_status };
        controller.set_segment(status, number, done);
        controller.set_transform(self.arm.transform());
    }

    fn collect(&mut self, events: Vec<ControllerEvent>, controller: &Controller, robot: &mut RobotLine<'_>) {
        let arrived = robot.request.as_ref().map_or(Duration::ZERO, |request| request.arrived);
        for event in events {
            match event {
                ControllerEvent::Started => {
                    self.begun_at.get_or_insert(robot.now);
                    (self.path_cycles, self.turn_around) = (0, Samples::default());
                    self.arm.begin();
                    let pose = self.arm.pose();
                    if let Some(stood) = self.stands_at.take() {
                        self.record.drift = self.record.drift.max(distance(&stood, &pose));
                    }
                    self.events.push(PumaEvent::Started(pose));
                }
                ControllerEvent::Refused => self.off(arrived, PumaEvent::Refused),
                ControllerEvent::GaveUp => self.off(arrived, PumaEvent::GaveUp),
                ControllerEvent::Reply { values, .. } => {
                    self.measure(values, controller, robot.request.take())
                }
                ControllerEvent::BadReply(code) => {
                    let runs =
                        !matches!(controller.state(), ControllerState::Starting | ControllerState::Off);
                    if runs && self.config.keeps_all {
                        self.record.without.push(robot.now + robot.stood);
                    }
                    self.events.push(PumaEvent::BadReply(code));
                }
                ControllerEvent::Exception(exception) => {
                    self.resume_at = Some(
                        robot
                            .request
                            .as_ref()
                            .map_or(robot.now, |request| request.last_byte)
                            .saturating_add(self.config.subroutine_time),
                    );
                    match exception {
                        Exception::CloseGripper => self.grip(true),
                        Exception::OpenGripper => self.grip(false),
                        other => self.events.push(PumaEvent::Exception(other.into())),
                    }
                }
                ControllerEvent::Aborted(exception) => {
                    self.events.push(PumaEvent::Exception(exception.into()))
                }
                ControllerEvent::Ended(error) => {
                    let pose = self.arm.pose();
                    self.stands_at = Some(pose);
                    if self.config.keeps_all {
                        self.record.ends.push((robot.now + robot.stood, error));
                    }
                    self.events.extend(self.measured().map(PumaEvent::Measured));
                    self.off(arrived, PumaEvent::Ended(error, pose));
                }
                _ => {}
            }
        }
        self.record.stood = robot.stood;
        let stats = controller.statistics();
        let record = &mut self.record;
        (record.cycles, record.missed, record.bad_replies) =
            (stats.cycles, stats.timeouts, stats.bad_replies);
        (record.starts, record.strays) = (stats.starts, stats.strays);
    }

    /// A reply was taken, and this is what it does to the arm.
    fn measure(&mut self, values: [i16; AXES], controller: &Controller, request: Option<Request>) {
        self.arm.take(values);
        let Some(Request { arrived, length, first_byte: Some(first), last_byte, .. }) = request else {
            return;
        };
        let config = &self.config.controller;
        let window = Budget::new(config.mode.accumulation(), config.baud, length, 0).window;
        let turn_around = last_byte.saturating_sub(arrived);
        let byte_time = timing::transmission_time(1, config.baud);
        let record = &mut self.record;
        self.turn_around.add(turn_around);
        record.turn_around.add(turn_around);
        record.thinking.add(first.saturating_sub(byte_time).saturating_sub(arrived));
        record.margin.add(window.saturating_sub(turn_around));
        record.window = Some(record.window.map_or(window, |least| least.min(window)));
        // The subroutine has stopped the arm: what comes after it begins from rest.
        if controller.state() == ControllerState::Interrupted {
            return;
        }
        self.path_cycles += 1;
        if self.path_cycles.is_multiple_of(TOLD) {
            self.events.push(PumaEvent::Moves(self.arm.pose()));
        }
        let stats = controller.statistics();
        let taken = Taken { session: stats.starts, cycle: stats.cycles, values };
        record.judge.add(taken, config.mode.accumulation());
    }

    /// What was measured since ALTER began.
    fn measured(&self) -> Option<Measured> {
        let times = &self.turn_around;
        let turn_around = [times.at(0.5), times.at(0.99), times.max()];
        self.record.window.map(|window| Measured { replies: times.count(), turn_around, window })
    }

    fn grip(&mut self, closes: bool) {
        if self.config.keeps_all {
            self.record.gripper.push(closes);
        }
        self.events.push(PumaEvent::Gripper(closes));
    }

    /// The program has ended; the operator starts it again after a while.
    fn off(&mut self, asked: Duration, event: PumaEvent) {
        self.start_at = asked.saturating_add(self.config.restart);
        self.resume_at = None;
        self.events.push(event);
    }
}

fn distance(a: &Pose, b: &Pose) -> f64 {
    a.p.iter().zip(b.p).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn to_json(at: Duration, event: PumaEvent) -> Value {
    let ms = u64::try_from(at.as_millis()).unwrap_or(u64::MAX);
    match event {
        PumaEvent::Started(pose) => json!({"ms": ms, "event": "started", "position_mm": position(&pose)}),
        PumaEvent::Moves(pose) => json!({"ms": ms, "event": "moves", "position_mm": position(&pose)}),
        PumaEvent::Refused => json!({"ms": ms, "event": "refused"}),
        PumaEvent::GaveUp => json!({"ms": ms, "event": "gave_up"}),
        PumaEvent::BadReply(code) => {
            json!({"ms": ms, "event": "bad_reply", "error": u8::from(code), "why": error_text(code)})
        }
        PumaEvent::Gripper(closes) => {
            json!({"ms": ms, "event": "gripper", "state": if closes { "closed" } else { "open" }})
        }
        PumaEvent::Exception(code) => json!({"ms": ms, "event": "exception", "code": code}),
        PumaEvent::Measured(Measured { replies, turn_around, window }) => {
            let tenths = |time: Duration| (time.as_secs_f64() * 1e4).round() / 10.0;
            let [half, most, longest] = turn_around.map(tenths);
            json!({
                "ms": ms, "event": "measured", "replies": replies, "window_ms": tenths(window),
                "turn_around_ms": {"p50": half, "p99": most, "longest": longest}
            })
        }
        PumaEvent::Ended(error, pose) => json!({
            "ms": ms, "event": "ended", "error": u8::from(error), "why": error_text(error), "position_mm": position(&pose)
        }),
        PumaEvent::Incident(incident) => {
            json!({"ms": ms, "event": "script", "what": incident.to_string()})
        }
        PumaEvent::Connected(connected) => {
            json!({"ms": ms, "event": if connected { "connected" } else { "disconnected" }})
        }
    }
}

fn position(pose: &Pose) -> [f64; 3] {
    pose.p.map(|mm| (mm * 1000.0).round() / 1000.0)
}

/// An error code in words (§3.2.2).
pub fn error_text(code: ErrorCode) -> &'static str {
    match code {
        ErrorCode::None => "no error",
        ErrorCode::Checksum => "checksum error",
        ErrorCode::Format => "format error",
        ErrorCode::Overflow => "buffer overflow",
        ErrorCode::Incomplete => "incomplete message",
        ErrorCode::Mark => "start or end mark",
        ErrorCode::Timeout => "timeout",
        ErrorCode::Other(_) => "unknown error",
    }
}
