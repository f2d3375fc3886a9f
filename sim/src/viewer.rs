//! The graphics workstation: it draws the arm five times a second, each picture from one packet.

use core::time::Duration;

use robot_session::Session as _;
use robot_session::end::End as _;
use val2_viewer::workstation::machine::WorkstationMachine;
use val2_viewer::{PosePacket, Workstation, WorkstationConfig, WorkstationEvent, timing};

use crate::device::{Device, DeviceRecord, Error};
use crate::settings::Settings;

/// A workstation's settings.
#[derive(Debug, Clone, Copy)]
pub struct Viewer {
    /// The configuration of the session.
    pub config: WorkstationConfig,
    /// The rate of the line in baud, if one is simulated.
    pub baud: u32,
}

impl Default for Viewer {
    fn default() -> Self {
        Self { config: WorkstationConfig::default(), baud: timing::BAUD }
    }
}

impl Settings for Viewer {
    type Device = Screen;

    fn device(&self) -> Result<Screen, Error> {
        Screen::new(*self)
    }
}

#[cfg(feature = "spec")]
impl robot_session::spec::Configure for Viewer {
    fn configure(&mut self, fields: &mut impl robot_session::spec::FieldVisitor) {
        let Self { config, baud } = self;
        fields.baud(robot_session::spec::LINE, baud);
        config.configure(fields);
    }
}

/// The counts of a workstation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WorkstationCounts {
    /// The number of requests sent.
    pub asked: u64,
    /// The number of poses received.
    pub poses: u64,
    /// The number of poses that never came, by the gaps in their count.
    pub gaps: u64,
    /// The number of corrupt lines, or pieces of one.
    pub damaged: u64,
    /// The number of times that the picture was stale.
    pub stale: u64,
    /// Times that the operator paused a frozen picture, which makes it request again (§9.4).
    pub pauses: u64,
    /// The most poses that came between two pictures: more than one is a backlog.
    pub most_at_once: u64,
}

/// A workstation.
#[derive(Debug)]
pub struct Screen {
    settings: Viewer,
    workstation: Workstation,
    drawn: WorkstationCounts,
    last_count: Option<u16>,
    at_once: u64,
    connected: bool,
    /// The time at which the next picture is drawn.
    picture: Duration,
    /// The time at which the picture moved last.
    moved: Duration,
}

impl Screen {
    fn new(settings: Viewer) -> Result<Self, Error> {
        let workstation = Workstation::new(settings.config).map_err(Error::settings)?;
        Ok(Self {
            settings,
            workstation,
            drawn: WorkstationCounts::default(),
            last_count: None,
            at_once: 0,
            connected: false,
            picture: Duration::ZERO,
            moved: Duration::ZERO,
        })
    }

    /// Returns the counts so far.
    pub fn drawn(&self) -> WorkstationCounts {
        let seen = self.workstation.statistics();
        let poses = seen.poses + seen.unasked;
        WorkstationCounts {
            asked: seen.requests,
            poses,
            damaged: seen.corrupt,
            stale: seen.stale,
            ..self.drawn
        }
    }
}

impl Device for Screen {
    type Session = Workstation;
    type Event = WorkstationEvent;
    type Work = PosePacket;

    fn session(&self) -> &Workstation {
        &self.workstation
    }

    fn session_mut(&mut self) -> &mut Workstation {
        &mut self.workstation
    }

    fn take(
        &mut self,
        now: Duration,
        event: WorkstationEvent,
        notes: &mut DeviceRecord<WorkstationEvent, PosePacket>,
    ) {
        if let WorkstationEvent::Pose(packet) | WorkstationEvent::Unasked(packet) = event {
            // A repeated one is not a gap.
            let last = self.last_count.filter(|last| *last != packet.count);
            self.drawn.gaps += last.map_or(0, |last| u64::from(packet.lost_since(last)));
            (self.last_count, self.moved) = (Some(packet.count), now);
            self.at_once += 1;
            self.drawn.most_at_once = self.drawn.most_at_once.max(self.at_once);
            notes.executed(now, packet);
        }
        notes.event(event);
    }

    fn advance(&mut self, now: Duration, _: &mut DeviceRecord<WorkstationEvent, PosePacket>) {
        let connected = *self.workstation.machine() != WorkstationMachine::Disconnected;
        if core::mem::replace(&mut self.connected, connected) != connected {
            self.moved = now;
        }
        if now < self.picture {
            return;
        }
        self.workstation.draw(now);
        (self.picture, self.at_once) = (now.saturating_add(timing::CYCLE), 0);
        let config = &self.settings.config;
        if connected && now > self.moved.saturating_add(config.stale_after) {
            self.drawn.pauses += 1;
            self.picture = now.saturating_add(config.pause);
            self.moved = self.picture;
        }
    }

    fn due(&self) -> Option<Duration> {
        Some(self.picture)
    }

    fn restart(&mut self, _: Duration) {
        // The same settings have worked before.
        if let Ok(screen) = Self::new(self.settings) {
            *self = screen;
        }
    }

    /// Does nothing: the workstation has no unexecuted work.
    fn forget(&mut self, _: Duration) {}
}
