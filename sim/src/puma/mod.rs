//! The PUMA 562 on its MARK III controller: its program runs ALTER, its operator restarts the program, and its arm follows
//! the replies.

mod arm;
mod incident;
mod layout;
mod port;
mod pose;
#[cfg(feature = "spec")]
mod spec;

use core::time::Duration;

use val2_alter::{
    AXES, Controller, ControllerConfig, ControllerEvent, ControllerState, ErrorCode, Exception, Motion,
    SegmentStatus,
};

use self::arm::Arm;
pub use self::arm::ArmConfig;
pub use self::incident::Incident;
pub use self::layout::{Layout, Order};
pub use self::port::Port;
pub use self::pose::Pose;
use crate::device::{Device, DeviceRecord, Error};
use crate::settings::Settings;

/// The cycles of a motion segment of the program.
const SEGMENT: u64 = 36;
/// The time after the opening of its port at which the program starts.
const START_DELAY: Duration = Duration::from_millis(200);

/// A robot's settings.
#[derive(Debug, Clone)]
pub struct Puma {
    /// The ALTER instruction and the line.
    pub config: ControllerConfig,
    /// The arm that ALTER moves.
    pub arm: ArmConfig,
    /// The time after the program's end at which the operator restarts it.
    pub restart: Duration,
    /// The time that the subroutine takes which closes or opens the gripper.
    pub subroutine_time: Duration,
    /// The incidents, in the order of their times. The times begin with the first ALTER.
    pub incidents: Vec<(Duration, Incident)>,
    /// Whether a message is carried only when its last byte would have left the line. Not needed if its transport
    /// takes that time: a port, or [`Wire::baud`](crate::Wire::baud).
    pub is_paced: bool,
}

impl Default for Puma {
    /// Returns the settings of `ALTER(0, 23, clamp2, 127)`.
    fn default() -> Self {
        // Bytes that came together may be read apart on a busy machine: no gap ends a frame.
        let config = ControllerConfig { subroutine: true, gap: None, ..ControllerConfig::default() };
        Self {
            config,
            arm: ArmConfig::default(),
            restart: Duration::from_secs(1),
            subroutine_time: Duration::from_millis(120),
            incidents: Vec::new(),
            is_paced: true,
        }
    }
}

impl Settings for Puma {
    type Device = MarkIii;

    fn device(&self) -> Result<MarkIii, Error> {
        let controller = Controller::new(self.config).map_err(Error::settings)?;
        Ok(MarkIii {
            port: Port::new(controller, self.is_paced),
            arm: Arm::new(self.arm, self.config.mode),
            settings: self.clone(),
            now: Duration::ZERO,
            connected: false,
            start_at: None,
            resume_at: None,
            begun_at: None,
            happened: 0,
            path_cycles: 0,
            segment_status: SegmentStatus::Normal,
        })
    }
}

/// An event of a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum PumaEvent {
    /// ALTER runs, and the arm has this pose.
    Started(Pose),
    /// A reply was accepted, with its effect on the arm, in units of the words.
    Reply([i16; AXES]),
    /// The host has refused ALTER.
    Refused,
    /// No start message was accepted.
    GaveUp,
    /// A reply could not be read, or did not come.
    BadReply(ErrorCode),
    /// The gripper closes (true) or opens.
    Gripper(bool),
    /// An exception that the subroutine does not know, or that is not handled.
    Exception(Exception),
    /// ALTER is over, with this code, and the arm has this pose.
    Ended(ErrorCode, Pose),
    /// A scheduled incident has happened.
    Incident(Incident),
}

/// The effect of a reply: its values, and the arm's pose after it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReplyEffect {
    /// Increments, or how far the arm is held off its path.
    pub values: [i16; AXES],
    /// The pose of the arm.
    pub pose: Pose,
}

/// A controller with its program, its operator, its arm and its gripper.
#[derive(Debug)]
pub struct MarkIii {
    settings: Puma,
    port: Port,
    arm: Arm,
    now: Duration,
    connected: bool,
    /// The time at which the operator starts the program; `None` while it runs.
    start_at: Option<Duration>,
    resume_at: Option<Duration>,
    /// The time at which the first ALTER began.
    begun_at: Option<Duration>,
    /// The number of incidents that have happened.
    happened: usize,
    /// Cycles in which the program of this ALTER continued along its path.
    path_cycles: u64,
    segment_status: SegmentStatus,
}

impl MarkIii {
    /// Returns the pose of the arm.
    pub fn pose(&self) -> Pose {
        self.arm.pose()
    }

    /// Returns the session of its end of the link.
    pub fn controller(&self) -> &Controller {
        self.port.controller()
    }

    /// Lets an incident happen now, or as soon as ALTER runs.
    pub fn incident(&mut self, incident: Incident) {
        let elapsed = self.begun_at.map_or(Duration::ZERO, |begun| self.now.saturating_sub(begun));
        self.settings.incidents.insert(self.happened, (elapsed, incident));
    }

    /// Returns the next incident, and the time at which it is due.
    fn next_incident(&self) -> Option<(Duration, Incident)> {
        let (at, incident) = self.settings.incidents.get(self.happened).copied()?;
        Some((self.begun_at?.saturating_add(at), incident))
    }

    /// Returns whether the incident has happened; otherwise it waits.
    fn happens(&mut self, incident: Incident) -> bool {
        let on_the_line = matches!(incident, Incident::Misread(_) | Incident::Corrupt);
        match self.controller().state() {
            ControllerState::Running => {}
            ControllerState::Starting if on_the_line => {}
            _ => return false,
        }
        let now = self.now;
        match incident {
            Incident::Interrupt(time) => {
                if self.port.controller_mut().interrupt(now).is_err() {
                    // Between two cycles.
                    return false;
                }
                self.resume_at = Some(now.saturating_add(time));
            }
            Incident::Misread(error) => return self.port.misread(error),
            Incident::Corrupt => return self.port.corrupt(),
            Incident::Status(status) => self.segment_status = status,
            // It runs.
            Incident::Finish => _ = self.port.controller_mut().finish(now),
            Incident::Restart => {
                let controller = self.port.controller_mut();
                robot_session::Session::handle_disconnected(controller, now);
                robot_session::Session::handle_connected(controller, now);
                // It cannot have been started already.
                let _ = controller.start(now);
            }
        }
        true
    }

    /// Handles the end of the program; the operator starts it again after a while.
    fn off(&mut self, event: PumaEvent, notes: &mut DeviceRecord<PumaEvent, ReplyEffect>) {
        self.start_at = Some(self.now.saturating_add(self.settings.restart));
        self.resume_at = None;
        notes.event(event);
    }
}

impl Device for MarkIii {
    type Session = Port;
    type Event = PumaEvent;
    type Work = ReplyEffect;

    fn session(&self) -> &Port {
        &self.port
    }

    fn session_mut(&mut self) -> &mut Port {
        &mut self.port
    }

    fn take(
        &mut self,
        now: Duration,
        event: ControllerEvent,
        notes: &mut DeviceRecord<PumaEvent, ReplyEffect>,
    ) {
        match event {
            ControllerEvent::Started => {
                self.begun_at.get_or_insert(now);
                self.path_cycles = 0;
                self.arm.begin();
                notes.event(PumaEvent::Started(self.pose()));
            }
            ControllerEvent::Refused => self.off(PumaEvent::Refused, notes),
            ControllerEvent::GaveUp => self.off(PumaEvent::GaveUp, notes),
            ControllerEvent::Reply { values, .. } => {
                self.arm.take(values);
                // The subroutine has stopped the arm.
                if self.controller().state() != ControllerState::Interrupted {
                    self.path_cycles += 1;
                    notes.executed(now, ReplyEffect { values, pose: self.pose() });
                }
                notes.event(PumaEvent::Reply(values));
            }
            ControllerEvent::BadReply(code) => notes.event(PumaEvent::BadReply(code)),
            ControllerEvent::Exception(exception) => {
                self.resume_at = Some(now.saturating_add(self.settings.subroutine_time));
                notes.event(match exception {
                    Exception::CloseGripper => PumaEvent::Gripper(true),
                    Exception::OpenGripper => PumaEvent::Gripper(false),
                    other => PumaEvent::Exception(other),
                });
            }
            ControllerEvent::Aborted(exception) => notes.event(PumaEvent::Exception(exception)),
            ControllerEvent::Ended(error) => self.off(PumaEvent::Ended(error, self.pose()), notes),
            _ => {}
        }
    }

    fn advance(&mut self, now: Duration, notes: &mut DeviceRecord<PumaEvent, ReplyEffect>) {
        self.now = now;
        while let Some((_, incident)) = self.next_incident().filter(|(at, _)| *at <= now)
            && self.happens(incident)
        {
            self.happened += 1;
            notes.event(PumaEvent::Incident(incident));
        }
        if self.resume_at.take_if(|at| *at <= now).is_some() {
            // ALTER may have ended meanwhile.
            let _ = self.port.controller_mut().resume(now);
        }
        let connected = self.controller().state() != ControllerState::Disconnected;
        if core::mem::replace(&mut self.connected, connected) != connected {
            self.start_at = self.start_at.max(Some(now.saturating_add(START_DELAY)));
        }
        let (pose, controller) = (self.arm.transform(), self.port.controller_mut());
        match controller.state() {
            ControllerState::Disconnected => {}
            ControllerState::Off => {
                if self.start_at.take_if(|at| *at <= now).is_some() {
                    // It cannot have been started already: it is off.
                    let _ = controller.start(now);
                }
            }
            // When it is off again, the event of that is still to come.
            _ => self.start_at = None,
        }
        // "Beginnt mit 1" (§3.2.2), and stands while the path does.
        let number = 1 + self.path_cycles / SEGMENT % u64::from(u16::MAX);
        let done = self.path_cycles % SEGMENT * u64::from(Motion::DONE) / SEGMENT;
        let [number, done] = [number, done].map(|word| u16::try_from(word).unwrap_or_default());
        let status = if self.path_cycles == 0 { SegmentStatus::NoneYet } else { self.segment_status };
        controller.set_segment(status, number, done);
        controller.set_transform(pose);
    }

    fn due(&self) -> Option<Duration> {
        let start = self.start_at.filter(|_| self.controller().state() == ControllerState::Off);
        // An overdue incident waits for a message.
        let incident = self.next_incident().map(|(at, _)| at).filter(|at| *at > self.now);
        [self.resume_at, start, incident].into_iter().flatten().min()
    }

    /// Restarts the controller: the brakes hold the arm, and past incidents do not happen again.
    fn restart(&mut self, now: Duration) {
        // The same settings have worked before.
        if let Ok(robot) = self.settings.device() {
            let (arm, begun_at, happened) = (self.arm, self.begun_at, self.happened);
            *self = Self { arm, begun_at, happened, now, ..robot };
        }
    }

    /// Does nothing: the controller has no unexecuted work.
    fn forget(&mut self, _: Duration) {}
}
