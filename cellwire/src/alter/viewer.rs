//! The thread that shows the graphics workstation where the arm is.

use std::ops::ControlFlow;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use anyhow::Result;
use robot_session::{Driver, Session as _};
use val2_alter::Transform;
use val2_viewer::{ENQ, Host, HostConfig, HostEvent};

use super::context::Context;
use super::handshake::Handshake;
use super::messages::Notification;
use super::port::{Port, PortConfig};

/// New poses are looked at this often.
const IDLE: Duration = Duration::from_millis(20);
/// The time for which the port test listens at each rate.
const LISTEN: Duration = Duration::from_secs(1);

pub(super) struct Feed {
    context: Context,
    driver: Driver<Handshake>,
    host: Host,
    poses: Receiver<Transform>,
    probe: Receiver<()>,
    is_connected: bool,
    /// The last reported state of the handshake: true if XOFF holds the line.
    is_held: bool,
}

impl Feed {
    pub(super) fn open(
        port: &PortConfig,
        config: HostConfig,
        context: Context,
        poses: Receiver<Transform>,
        probe: Receiver<()>,
    ) -> Result<Self> {
        let line = Handshake::new(Port::open("viewer", port, None, &context)?, port.baud, config.max_hold);
        let (driver, host) = (Driver::new(line), Host::new(config)?);
        Ok(Self { context, driver, host, poses, probe, is_connected: false, is_held: false })
    }

    pub(super) fn run(mut self) {
        while !self.context.is_stopped() {
            if self.probe.try_recv().is_ok() {
                self.probe();
            }
            let was_connected = self.is_connected;
            self.driver.transport_mut().port().follow(&mut self.host, &mut self.is_connected);
            if self.is_connected != was_connected {
                self.driver.transport_mut().clear();
            }
            if let Some(pose) = self.poses.try_iter().last() {
                self.host.set_pose(self.context.clock.now(), pose.0);
            }
            self.turn();
            self.driver.transport_mut().port().trace();
        }
        self.context.end_trace("the host ends");
    }

    fn turn(&mut self) {
        let line = self.driver.transport_mut();
        if line.is_held() != self.is_held {
            self.is_held = line.is_held();
            self.context.notify(Notification::ViewerHolds(self.is_held));
        }
        if !line.is_free() {
            return line.wait(IDLE);
        }
        let context = &self.context;
        let turn = self.driver.turn(&mut self.host, Some(IDLE), |_, event| {
            match event {
                HostEvent::Asked | HostEvent::Ignored => context.notify(Notification::PoseAsked),
                HostEvent::Sent(_) => context.notify(Notification::Pose),
                HostEvent::Echo(error) => context.notify(Notification::Echo("viewer", error)),
                _ => {}
            }
            ControlFlow::<()>::Continue(())
        });
        debug_assert!(turn.is_ok(), "a port has no errors: it is opened again");
    }

    /// Listens for requests at each rate. The connection is as good as lost meanwhile.
    fn probe(&mut self) {
        self.is_connected = false;
        self.driver.transport_mut().clear();
        self.host.handle_disconnected(self.context.clock.now());
        for baud in [9600, 19_200, 38_400] {
            let Some(received) = self.driver.transport_mut().port().listen(baud, &[], LISTEN) else {
                continue;
            };
            let good = received.iter().filter(|byte| **byte == ENQ).count();
            let corrupt = received.len() - good;
            self.context.notify(Notification::Probed { port: "viewer", baud, good, corrupt });
        }
        self.driver.transport_mut().port().end_listening();
    }
}
