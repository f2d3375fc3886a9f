//! The simulated PUMA 562 on its MARK III controller, and the measurements of its host.

use std::cell::RefCell;
use std::time::Duration;

use anyhow::Result;
use cellwire_sim::host::Notice;
use cellwire_sim::puma::{MarkIii, Pose, Puma, PumaEvent};
use cellwire_sim::{Settings as _, Simulator, SimulatorReport};
use robot_session::end::End as _;
use robot_session::{Session as _, Transport as _};
use serde_json::{Value, json};
use val2_alter::timing::{self, Budget};
use val2_alter::{AXES, ControllerState, ErrorCode};

use super::control::{self, position};
use super::judge::{Judge, ReceivedReply};
use super::robot_line::{Request, RobotLine, Times};
use super::script::{self, Script};
use crate::devices::device::SimulateOptions;
use crate::devices::on_line::{Presence, on_line};
use crate::io::line::Line;
use crate::io::samples::Samples;
use cellwire_io::output::{log, notice};
use cellwire_links::settings;

/// The number of cycles between notifications of the position: twice a second.
const NOTIFY_CYCLES: u64 = 18;

/// The behaviour of the simulated robot.
#[derive(Debug, Clone)]
pub struct PumaConfig {
    /// The settings of the robot.
    pub puma: Puma,
    /// The events that the host does not cause.
    pub script: Script,
}

impl Default for PumaConfig {
    /// Returns the options of `ALTER(0, 23, clamp2, 127)`, on a line with real delays.
    fn default() -> Self {
        Self { puma: Puma { is_paced: false, ..Puma::default() }, script: Script::default() }
    }
}

impl PumaConfig {
    /// Creates the simulated robot.
    ///
    /// # Errors
    /// Settings that cannot work.
    pub fn simulator(&self) -> Result<Simulator<MarkIii>> {
        let Self { puma, script: Script(incidents) } = self;
        Ok(Puma { incidents: incidents.clone(), ..puma.clone() }.simulator()?.keeping_nothing())
    }
}

/// A notification of the simulated robot while it runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Notification {
    /// An event of the robot.
    Robot(PumaEvent),
    /// The arm has this pose: reported twice a second while replies come.
    Moves(Pose),
    /// The measurements since ALTER began.
    Measured(AlterStatistics),
    /// Whether a client has the port open.
    Connected(bool),
}

/// The statistics of the replies of an ALTER.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AlterStatistics {
    /// The number of replies that came in time.
    pub replies: u64,
    /// The times from the last byte of a request to the last byte of its reply: half of them at most, 99 % at most, the longest.
    pub turn_around: [Duration; 3],
    /// The shortest window for a reply, which the requests left of a cycle.
    pub window: Duration,
}

/// The measurements and counts of the simulated robot.
#[derive(Debug, Clone, Default)]
pub struct PumaRecord {
    /// The times from the last byte of a request to the last byte of its reply.
    pub turn_around: Samples,
    /// The times at which there was a cycle without a good reply.
    pub without: Vec<Duration>,
    /// The part of the turn-around that the host took, until it wrote the reply.
    pub thinking: Samples,
    /// The unused time of the window.
    pub margin: Samples,
    /// The shortest window for a reply, which the requests left of a cycle; `None` before the first reply.
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
    /// The ends of ALTER, each with its time and code.
    pub ends: Vec<(Duration, ErrorCode)>,
    /// The gripper's moves: true closes.
    pub gripper: Vec<bool>,
    /// Replies that came too late for their window.
    pub strays: u64,
    /// The time by which the simulator itself was late.
    pub stood: Duration,
    /// The distance of the arm from its place at the end of ALTER when ALTER began again, in mm: it is at rest in between.
    pub drift: f64,
}

/// Runs `cellwire simulate puma`.
///
/// # Errors
/// If the endpoint cannot be opened, or a setting is not one of this device's.
pub fn simulate(options: &SimulateOptions) -> Result<()> {
    let config = settings::read("puma", PumaConfig::default(), &options.settings)?;
    let (robot, baud) = (config.simulator()?, config.puma.config.baud);
    options.serve(["puma", "robot"], baud, robot, control::own(), |line, robot| {
        let notify = |at, told| match told {
            Notification::Robot(PumaEvent::BadReply(_)) => notice(&to_json(at, told)),
            told => log(&to_json(at, told)),
        };
        run(line, robot, false, || true, notify).map(drop)
    })
}

/// Runs the robot's program while `goes_on`, or until the connection is gone. With `keeps_all` the record has each end, each
/// cycle without a reply and each move of the gripper.
///
/// # Errors
/// If an event cannot be reported.
pub fn run(
    line: &mut Line,
    mut robot: Simulator<MarkIii>,
    keeps_all: bool,
    goes_on: impl FnMut() -> bool,
    mut notify: impl FnMut(Duration, Notification) -> Result<()>,
) -> Result<PumaRecord> {
    let mut record = Recording::new(keeps_all);
    let (trace, times) = (line.trace(), RefCell::new(Times { now: line.now(), ..Times::default() }));
    let line = RobotLine { line, times: &times };
    on_line(&mut robot, line, Presence::OfClient, goes_on, |robot, notice| {
        let mut times = times.borrow_mut();
        match notice {
            Notice::Connected(_) => notify(times.now, Notification::Connected(true)),
            Notice::Disconnected(..) => notify(times.now, Notification::Connected(false)),
            Notice::Event(_, SimulatorReport::Device(event)) => {
                for told in record.take(event, robot, &mut times) {
                    notify(times.now, told)?;
                }
                if let PumaEvent::Ended(error, _) = event {
                    trace.end_session(&format!("ALTER ended, {}", error_text(error)));
                }
                Ok(())
            }
            _ => Ok(()),
        }
    })?;
    record.count(&robot, &times.borrow());
    Ok(record.record)
}

/// The measurements of a robot's host.
struct Recording {
    record: PumaRecord,
    keeps_all: bool,
    stands_at: Option<Pose>,
    /// The turn-arounds of this ALTER.
    turn_around: Samples,
    /// The cycles of this ALTER with a reply that moved the arm.
    cycles: u64,
}

impl Recording {
    fn new(keeps_all: bool) -> Self {
        let (record, turn_around) = (PumaRecord::default(), Samples::default());
        Self { record, keeps_all, stands_at: None, turn_around, cycles: 0 }
    }

    /// Records an event; returns its notifications.
    fn take(
        &mut self,
        event: PumaEvent,
        robot: &Simulator<MarkIii>,
        times: &mut Times,
    ) -> impl Iterator<Item = Notification> + use<> {
        let at = times.now + times.stood;
        let mut before = None;
        let mut told = Some(Notification::Robot(event));
        match event {
            PumaEvent::Started(pose) => {
                (self.turn_around, self.cycles) = (Samples::default(), 0);
                if let Some(stood) = self.stands_at.take() {
                    self.record.drift = self.record.drift.max(distance(&stood, &pose));
                }
            }
            PumaEvent::Reply(values) => {
                told = self.measure(values, robot, times.request.take()).map(Notification::Moves);
            }
            PumaEvent::BadReply(_) => {
                let state = robot.device().controller().state();
                if self.keeps_all && !matches!(state, ControllerState::Starting | ControllerState::Off) {
                    self.record.without.push(at);
                }
            }
            PumaEvent::Gripper(closes) if self.keeps_all => self.record.gripper.push(closes),
            PumaEvent::Ended(error, pose) => {
                self.stands_at = Some(pose);
                if self.keeps_all {
                    self.record.ends.push((at, error));
                }
                before = self.measured().map(Notification::Measured);
            }
            _ => {}
        }
        self.count(robot, times);
        before.into_iter().chain(told)
    }

    fn count(&mut self, robot: &Simulator<MarkIii>, times: &Times) {
        let (record, seen) = (&mut self.record, robot.statistics());
        record.stood = times.stood;
        (record.cycles, record.missed, record.bad_replies) = (seen.cycles, seen.timeouts, seen.bad_replies);
        (record.starts, record.strays) = (seen.starts, seen.strays);
    }

    /// Called when a reply was accepted; returns the position of the arm, if it is to be reported.
    fn measure(
        &mut self,
        values: [i16; AXES],
        robot: &Simulator<MarkIii>,
        request: Option<Request>,
    ) -> Option<Pose> {
        let Request { arrived, length, first_byte, last_byte } = request?;
        let (device, stats) = (robot.device(), robot.statistics());
        let config = device.controller().config();
        let window = Budget::new(config.mode.accumulation(), config.baud, length, 0).window;
        let turn_around = last_byte.saturating_sub(arrived);
        let byte_time = timing::transmission_time(1, config.baud);
        let record = &mut self.record;
        record.thinking.add(first_byte?.saturating_sub(byte_time).saturating_sub(arrived));
        self.turn_around.add(turn_around);
        record.turn_around.add(turn_around);
        record.margin.add(window.saturating_sub(turn_around));
        record.window = Some(record.window.map_or(window, |least| least.min(window)));
        // The subroutine has stopped the arm: later replies begin from rest.
        if device.controller().state() == ControllerState::Interrupted {
            return None;
        }
        let taken = ReceivedReply { session: stats.starts, cycle: stats.cycles, values };
        record.judge.add(taken, config.mode.accumulation());
        self.cycles += 1;
        self.cycles.is_multiple_of(NOTIFY_CYCLES).then(|| device.pose())
    }

    /// Returns the measurements since ALTER began.
    fn measured(&self) -> Option<AlterStatistics> {
        let times = &self.turn_around;
        let turn_around = [times.at(0.5), times.at(0.99), times.max()];
        self.record.window.map(|window| AlterStatistics { replies: times.count(), turn_around, window })
    }
}

fn distance(a: &Pose, b: &Pose) -> f64 {
    a.p.iter().zip(b.p).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

fn to_json(at: Duration, told: Notification) -> Value {
    let ms = u64::try_from(at.as_millis()).unwrap_or(u64::MAX);
    let event = match told {
        Notification::Robot(event) => event,
        Notification::Moves(pose) => {
            return json!({"ms": ms, "event": "moves", "position_mm": position(&pose)});
        }
        Notification::Measured(AlterStatistics { replies, turn_around, window }) => {
            let tenths = |time: Duration| (time.as_secs_f64() * 1e4).round() / 10.0;
            let [half, most, longest] = turn_around.map(tenths);
            return json!({
                "ms": ms, "event": "measured", "replies": replies, "window_ms": tenths(window),
                "turn_around_ms": {"p50": half, "p99": most, "longest": longest}
            });
        }
        Notification::Connected(connected) => {
            return json!({"ms": ms, "event": if connected { "connected" } else { "disconnected" }});
        }
    };
    match event {
        PumaEvent::Started(pose) => json!({"ms": ms, "event": "started", "position_mm": position(&pose)}),
        PumaEvent::Refused => json!({"ms": ms, "event": "refused"}),
        PumaEvent::GaveUp => json!({"ms": ms, "event": "gave_up"}),
        PumaEvent::BadReply(code) => {
            json!({"ms": ms, "event": "bad_reply", "error": u8::from(code), "why": error_text(code)})
        }
        PumaEvent::Gripper(closes) => {
            json!({"ms": ms, "event": "gripper", "state": if closes { "closed" } else { "open" }})
        }
        PumaEvent::Exception(exception) => {
            json!({"ms": ms, "event": "exception", "code": u8::from(exception)})
        }
        PumaEvent::Ended(error, pose) => json!({
            "ms": ms, "event": "ended", "error": u8::from(error), "why": error_text(error), "position_mm": position(&pose)
        }),
        PumaEvent::Incident(incident) => {
            json!({"ms": ms, "event": "script", "what": script::text(incident)})
        }
        // The position of the arm is reported instead of a reply.
        _ => Value::Null,
    }
}

/// Returns an error code in words (§3.2.2).
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
