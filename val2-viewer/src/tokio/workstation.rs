//! The workstation in a task of its own: the latest pose at any time.

extern crate std;

use core::time::Duration;
use std::io;
use std::sync::Arc;

use robot_session::now;
use robot_session::tokio::{
    self as session, Connector, Handle, Latest, LatestSender, Reports, Service, Task, latest,
};

use crate::error::ConfigError;
use crate::message::PosePacket;
use crate::workstation::{Workstation, WorkstationConfig, WorkstationEvent};

/// A display cycle: about five times a second (§5).
const CYCLE: Duration = Duration::from_millis(200);

/// The handle of a display that draws the arm. Cloning it is cheap.
#[derive(Debug, Clone)]
pub struct Arm {
    /// The last requested pose; without a value while the picture is stale.
    pub pose: Latest<PosePacket>,
    /// Every event, whether there is a connection, and the end.
    pub handle: Handle<Display>,
}

/// Creates an arm, and the task that requests its pose in every display cycle, 200 ms.
///
/// # Errors
/// As [`Workstation::new`].
pub fn workstation<C: Connector>(
    config: WorkstationConfig,
    connector: C,
) -> Result<(Arm, Task<Display, C>), ConfigError> {
    let (source, pose) = latest();
    let display = Display { source, cycle: Some(Duration::ZERO) };
    let (handle, task) = session::spawn(Workstation::new(config)?, display, connector);
    Ok((Arm { pose, handle }, task))
}

impl Arm {
    /// Pauses the display, or continues it. If the queue of calls is full, in a task without a connection, the call is not
    /// made: returns whether it is made.
    ///
    /// After a host that was off, the display must be paused for [`WorkstationConfig::pause`] before it sends a request
    /// again.
    pub fn pause(&self, is_paused: bool) -> bool {
        self.handle.try_call(PauseRequest(is_paused))
    }
}

/// Whether the display is to pause.
#[derive(Debug, Clone, Copy)]
pub struct PauseRequest(bool);

/// The service of the task: turns display cycles into requests, and answers into poses.
#[derive(Debug)]
pub struct Display {
    source: LatestSender<PosePacket>,
    /// The time of the next display cycle; `None` while the display is paused.
    cycle: Option<Duration>,
}

impl Display {
    fn pause(&mut self, is_paused: bool, now: Duration) {
        self.cycle = if is_paused { None } else { self.cycle.or(Some(now)) };
    }
}

impl Service for Display {
    type Session = Workstation;
    type Call = PauseRequest;
    type Event = WorkstationEvent;

    fn call(&mut self, _session: &mut Workstation, now: Duration, PauseRequest(is_paused): PauseRequest) {
        self.pause(is_paused, now);
    }

    fn event(
        &mut self,
        session: &mut Workstation,
        event: WorkstationEvent,
        reports: &mut Reports<'_, WorkstationEvent>,
    ) {
        match event {
            WorkstationEvent::Pose(pose) => self.source.set(pose, session.live_until()),
            WorkstationEvent::Stale => self.source.clear(),
            _ => {}
        }
        reports.event(event);
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.cycle
    }

    fn handle_timeout(&mut self, session: &mut Workstation, now: Duration) {
        if self.cycle.is_some_and(|cycle| cycle <= now) {
            session.draw(now);
            self.cycle = Some(now.saturating_add(CYCLE));
        }
    }

    fn refuse(&mut self, PauseRequest(is_paused): PauseRequest, _why: &Arc<io::Error>) {
        self.pause(is_paused, now());
    }
}
