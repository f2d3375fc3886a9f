//! The host of a laser robot's controller: it sends a list of instructions, each once.

use core::time::Duration;
use std::sync::Arc;

use laser_eb90::{Host, HostConfig, HostEvent, SessionError};
use robot_session::Session as _;

use crate::device::{Device, DeviceRecord, Error};
use crate::settings::Settings;

/// A host's settings. The work that it "executes" are the outcomes of its instructions: [`HostEvent::Done`],
/// `Answer`, `Refused` and `Unknown`.
#[derive(Debug, Clone)]
pub struct LaserHost {
    /// The configuration of the session.
    pub config: HostConfig,
    /// The instructions to send: command words, each with its floats.
    pub instructions: Arc<[(u16, Vec<f32>)]>,
    /// The pause before it sends refused instructions again. Default: 100 ms.
    pub pause: Duration,
}

impl Default for LaserHost {
    fn default() -> Self {
        let pause = Duration::from_millis(100);
        Self { config: HostConfig::default(), instructions: Arc::new([]), pause }
    }
}

impl Settings for LaserHost {
    type Device = Computer;

    fn device(&self) -> Result<Computer, Error> {
        let host = Host::new(self.config).map_err(Error::settings)?;
        Ok(Computer { settings: self.clone(), host, next: 0, resumes_at: None })
    }
}

/// A host.
#[derive(Debug)]
pub struct Computer {
    settings: LaserHost,
    host: Host,
    /// The instruction that is submitted next.
    next: usize,
    resumes_at: Option<Duration>,
}

impl Device for Computer {
    type Session = Host;
    type Event = HostEvent;
    type Work = HostEvent;

    fn session(&self) -> &Host {
        &self.host
    }

    fn session_mut(&mut self) -> &mut Host {
        &mut self.host
    }

    fn take(&mut self, now: Duration, event: HostEvent, notes: &mut DeviceRecord<HostEvent, HostEvent>) {
        match event {
            HostEvent::Done { .. } | HostEvent::Answer { .. } => notes.executed(now, event),
            HostEvent::Refused { count, .. } => {
                notes.executed(now, event);
                // The whole frame was refused; submit it and the pending instructions again.
                self.next -= usize::from(count) + usize::from(self.host.take_back());
                self.resumes_at = Some(now.saturating_add(self.settings.pause));
            }
            HostEvent::Unknown { .. } => {
                notes.executed(now, event);
                self.resumes_at = Some(now);
            }
            _ => {}
        }
        notes.event(event);
    }

    fn advance(&mut self, now: Duration, _: &mut DeviceRecord<HostEvent, HostEvent>) {
        if self.resumes_at.take_if(|at| *at <= now).is_some() {
            self.host.resume();
        }
        while self.resumes_at.is_none()
            && let Some((word, floats)) = self.settings.instructions.get(self.next)
        {
            match self.host.submit(*word, |values| values.f32(floats).map(drop)) {
                Err(SessionError::Full) => return,
                // Skip an instruction that can never be sent.
                _ => self.next += 1,
            }
        }
    }

    fn due(&self) -> Option<Duration> {
        self.resumes_at
    }

    /// Starts with the list again.
    fn restart(&mut self, now: Duration) {
        // The same settings have worked before.
        if let Ok(computer) = self.settings.device() {
            *self = computer;
            self.host.handle_timeout(now);
        }
    }

    /// Drops the instructions that it has not sent yet.
    fn forget(&mut self, _: Duration) {
        self.host.take_back();
        self.next = self.settings.instructions.len();
    }
}
