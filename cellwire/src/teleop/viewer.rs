//! The thread that shows the graphics workstation where the arm is.

use std::sync::mpsc::Receiver;
use std::time::Duration;

use anyhow::Result;
use val2_alter::viewer::{ENQ, PoseFeed, PosePacket};

use super::port::Port;
use super::robot::Pose;
use super::{Context, PortConfig, Told};

/// New poses are looked at this often.
const IDLE: Duration = Duration::from_millis(20);
/// The port test listens so long at each rate.
const LISTEN: Duration = Duration::from_secs(1);

pub(super) struct Feed {
    context: Context,
    port: Port,
    feed: PoseFeed,
    poses: Receiver<Pose>,
    probe: Receiver<()>,
}

impl Feed {
    pub(super) fn open(
        config: &PortConfig,
        context: Context,
        poses: Receiver<Pose>,
        probe: Receiver<()>,
    ) -> Result<Self> {
        let port = Port::open("viewer", config, &context)?;
        Ok(Self { context, port, feed: PoseFeed::default(), poses, probe })
    }

    pub(super) fn run(mut self) {
        while !self.context.is_stopped() {
            if self.probe.try_recv().is_ok() {
                self.probe();
            }
            self.read();
            while let Ok(pose) = self.poses.try_recv() {
                match pose {
                    Pose::Restart => self.feed.restart(self.context.clock.now()),
                    Pose::At(transform) => self.feed.set_pose(transform),
                }
            }
            self.answer();
            self.port.trace();
        }
        self.context.end_trace("the host ends");
    }

    fn read(&mut self) {
        let mut buffer = [0; 64];
        let length = self.port.read(IDLE, &mut buffer);
        let bytes = buffer.get(..length).unwrap_or_default();
        self.feed.handle_input(bytes);
        if bytes.contains(&ENQ) {
            self.context.tell(Told::PoseAsked);
        }
    }

    fn answer(&mut self) {
        let mut out = [0; PosePacket::MAX_LEN];
        let Some(length) = self.feed.poll_transmit(self.context.clock.now(), &mut out) else { return };
        if self.port.write(out.get(..length).unwrap_or_default()) {
            self.context.tell(Told::Pose);
        }
    }

    /// Listens for requests at each rate.
    fn probe(&mut self) {
        for baud in [9600, 19_200, 38_400] {
            let Some(received) = self.port.listen(baud, &[], LISTEN) else { continue };
            let good = received.iter().filter(|byte| **byte == ENQ).count();
            let damaged = received.len() - good;
            self.context.tell(Told::Probed { port: "viewer", baud, good, damaged });
        }
        self.port.end_listening();
    }
}
