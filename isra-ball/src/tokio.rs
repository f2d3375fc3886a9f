//! The computer that polls the ball, in a task of its own that reopens its port automatically: the latest values at any time.
//!
//! ```no_run
//! use isra_ball::HostConfig;
//! use isra_ball::robot_session::tokio::Tcp;
//!
//! # async fn run() -> Result<(), Box<dyn core::error::Error>> {
//! let (mut ball, task) = isra_ball::tokio::host(HostConfig::default(), Tcp::new("192.168.0.7:4001"))?;
//! tokio::spawn(task.run());
//! while let Ok(values) = ball.values.next().await {
//!     match values {
//!         Some(packet) => println!("{packet:?}"),
//!         None => println!("stop"),
//!     }
//! }
//! # Ok(()) }
//! ```

extern crate std;

use core::convert::Infallible;
use core::time::Duration;
use std::io;
use std::sync::Arc;

use robot_session::tokio::{
    self as session, Connector, Handle, Latest, LatestSender, Reports, Service, Task, latest,
};

use crate::error::ConfigError;
use crate::host::{Host, HostConfig, HostEvent};
use crate::message::Packet;

/// The handle of a polled ball. Cloning it is cheap.
#[derive(Debug, Clone)]
pub struct Ball {
    /// The values of the last new packet, until they are too old: the motion that they drive must stop then.
    pub values: Latest<Packet>,
    /// Every event, whether there is a connection, and the end.
    pub handle: Handle<PollService>,
}

/// Creates a ball, and the task that polls it.
///
/// # Errors
/// As [`Host::new`].
pub fn host<C: Connector>(
    config: HostConfig,
    connector: C,
) -> Result<(Ball, Task<PollService, C>), ConfigError> {
    let (source, values) = latest();
    let (handle, task) = session::spawn(Host::new(config)?, PollService { source }, connector);
    Ok((Ball { values, handle }, task))
}

/// The service of the task: turns packets into values.
#[derive(Debug)]
pub struct PollService {
    source: LatestSender<Packet>,
}

impl Service for PollService {
    type Session = Host;
    type Call = Infallible;
    type Event = HostEvent;

    fn call(&mut self, _session: &mut Host, _now: Duration, call: Infallible) {
        match call {}
    }

    fn event(&mut self, session: &mut Host, event: HostEvent, reports: &mut Reports<'_, HostEvent>) {
        match event {
            HostEvent::Packet(packet) => self.source.set(packet, session.live_until()),
            HostEvent::Stale => self.source.clear(),
            _ => {}
        }
        reports.event(event);
    }

    fn refuse(&mut self, call: Infallible, _why: &Arc<io::Error>) {
        match call {}
    }
}
