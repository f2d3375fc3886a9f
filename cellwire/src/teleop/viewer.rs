//! The thread that shows the graphics workstation where the arm is.

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::Duration;

use anyhow::Result;
use serialport::SerialPort;
use val2_alter::viewer::{ENQ, PoseFeed, PosePacket};

use super::robot::Pose;
use super::{Context, PortConfig, Told};
use crate::serial;
use crate::trace::Way;

/// New poses are looked at this often.
const IDLE: Duration = Duration::from_millis(20);
/// The port test listens so long at each rate.
const LISTEN: Duration = Duration::from_secs(1);
/// A port that is gone is tried again this often.
const REOPEN: Duration = Duration::from_millis(500);

pub(super) struct Feed {
    context: Context,
    config: PortConfig,
    port: Option<Box<dyn SerialPort>>,
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
        let port = serial::open(&config.path, config.baud)?;
        context.tell(Told::PortOpen("viewer", config.path.clone()));
        Ok(Self {
            context,
            config: config.clone(),
            port: Some(port),
            feed: PoseFeed::default(),
            poses,
            probe,
        })
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
        }
        self.context.end_trace("the host ends");
    }

    fn read(&mut self) {
        let Some(port) = &mut self.port else { return self.reopen() };
        let mut buffer = [0; 64];
        let outcome =
            port.set_timeout(IDLE).map_err(std::io::Error::from).and_then(|()| port.read(&mut buffer));
        match outcome {
            Ok(n) => {
                let bytes = buffer.get(..n).unwrap_or_default();
                self.context.trace.add(self.context.clock.now(), Way::Received, bytes);
                self.feed.handle_input(bytes);
                if bytes.contains(&ENQ) {
                    self.context.tell(Told::PoseAsked);
                }
            }
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(e) => self.lose_port(&e),
        }
    }

    fn answer(&mut self) {
        let mut out = [0; PosePacket::MAX_LEN];
        let now = self.context.clock.now();
        let Some(length) = self.feed.poll_transmit(now, &mut out) else { return };
        let Some(port) = &mut self.port else { return };
        let bytes = out.get(..length).unwrap_or_default();
        if let Err(e) = port.write_all(bytes) {
            return self.lose_port(&e);
        }
        self.context.trace.add(now, Way::Sent, bytes);
        self.context.tell(Told::Pose);
    }

    /// Listens for requests at each rate.
    fn probe(&mut self) {
        let Some(port) = &mut self.port else { return };
        for baud in [9600, 19_200, 38_400] {
            let (mut good, mut damaged) = (0, 0);
            let heard = serial::listen(port.as_mut(), baud, LISTEN, &mut |bytes| {
                for byte in bytes {
                    *if *byte == ENQ { &mut good } else { &mut damaged } += 1;
                }
            });
            if heard.is_ok() {
                self.context.tell(Told::Probed { port: "viewer", baud, good, damaged });
            }
        }
        if let Err(e) = port.set_baud_rate(self.config.baud) {
            self.lose_port(&e.into());
        }
    }

    fn lose_port(&mut self, error: &std::io::Error) {
        self.port = None;
        self.context.tell(Told::PortLost("viewer", error.to_string()));
    }

    fn reopen(&mut self) {
        thread::sleep(REOPEN);
        if let Ok(port) = serial::open(&self.config.path, self.config.baud) {
            self.port = Some(port);
            self.context.tell(Told::PortOpen("viewer", self.config.path.clone()));
        }
    }
}
