//! The host in a task of its own: poses for a workstation's screen.

extern crate std;

use core::time::Duration;
use std::io;
use std::sync::Arc;

use robot_session::end::End as _;
use robot_session::now;
use robot_session::tokio::{self as session, Closed, Connector, Handle, Reply, Reports, Service, Task};

use crate::error::ConfigError;
use crate::host::{Host, HostConfig, HostEvent};
use crate::message::PosePacket;

/// The screen of a workstation that requests poses. Cloning it is cheap.
#[derive(Debug, Clone)]
pub struct Screen {
    handle: Handle<Poses>,
}

/// Creates a screen, and the task that answers its workstation.
///
/// # Errors
/// As [`Host::new`].
pub fn host<C: Connector>(config: HostConfig, connector: C) -> Result<(Screen, Task<Poses, C>), ConfigError> {
    let (handle, task) = session::spawn(Host::new(config)?, Poses { shown: None }, connector);
    Ok((Screen { handle }, task))
}

/// The reason that a pose was not shown.
#[derive(Debug, Clone, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The workstation has not requested a pose within [`HostConfig::max_age`], or its packet could not be sent.
    #[error("the workstation did not request a pose before it was too old")]
    Stale,
    /// Another pose has replaced it before a packet with it was sent. A packet that waits for room on the line is still sent.
    #[error("another pose has replaced it")]
    Replaced,
    /// There is no connection; nothing was sent.
    #[error("not connected: {0}")]
    NotConnected(Arc<io::Error>),
    /// The task has ended. Whether the pose was shown is unknown.
    #[error(transparent)]
    Closed(#[from] Closed),
}

impl Screen {
    /// Sets the pose that requests are answered with from now on, and waits for the first packet with it. It outlasts its
    /// connection, for up to [`HostConfig::max_age`].
    ///
    /// # Errors
    /// See [`Error`].
    pub async fn show(&self, pose: [i16; 12]) -> Result<PosePacket, Error> {
        self.handle.call(|reply| ShowRequest { pose, reply }).await?
    }

    /// Returns all events, the state of the connection, and the end of the task.
    pub const fn handle(&self) -> &Handle<Poses> {
        &self.handle
    }
}

/// A pose to show, and the receiver of the outcome.
#[derive(Debug)]
pub struct ShowRequest {
    pose: [i16; 12],
    reply: Reply<Result<PosePacket, Error>>,
}

/// The service of a [`Screen`]: sets poses, and reports the packets that were sent.
#[derive(Debug)]
pub struct Poses {
    /// The last pose and the time until which it may be sent, until the pose has an outcome. Events of earlier poses may follow.
    shown: Option<(ShowRequest, Duration)>,
}

impl Poses {
    fn end(&mut self, outcome: Result<PosePacket, Error>) {
        if let Some((ShowRequest { reply, .. }, _)) = self.shown.take() {
            let _ = reply.send(outcome);
        }
    }
}

impl Service for Poses {
    type Session = Host;
    type Call = ShowRequest;
    type Event = HostEvent;

    fn call(&mut self, session: &mut Host, now: Duration, call: ShowRequest) {
        if call.reply.is_abandoned() {
            return;
        }
        self.end(Err(Error::Replaced));
        session.set_pose(now, call.pose);
        let until = now.saturating_add(session.config().max_age);
        self.shown = Some((call, until));
    }

    fn event(&mut self, _session: &mut Host, event: HostEvent, reports: &mut Reports<'_, HostEvent>) {
        match (event, &self.shown) {
            (HostEvent::Sent(packet), Some((show, _))) if packet.pose == show.pose => self.end(Ok(packet)),
            (HostEvent::Stale, Some((_, until))) if *until <= now() => self.end(Err(Error::Stale)),
            _ => {}
        }
        reports.event(event);
    }

    fn refuse(&mut self, ShowRequest { reply, .. }: ShowRequest, why: &Arc<io::Error>) {
        let _ = reply.send(Err(Error::NotConnected(Arc::clone(why))));
    }
}
