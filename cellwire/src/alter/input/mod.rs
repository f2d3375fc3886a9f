//! The inputs of the hand: a ball, a 3D mouse, a game pad, the keyboard, a recording.

mod ball;
mod device;
mod evdev;
mod hid;
mod keyboard;
mod mouse;
mod recording;
mod spacenav;

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

use anyhow::Result;

pub use self::recording::{RecordedEvent, read as read_recording};

use self::device::{Input, InputEvent};
use self::recording::Recorder;
use super::context::Context;
use super::messages::{Notification, Order};
use super::port::PortConfig;
pub use super::sample::{FULL, Jog, Sample};
use crate::io::priority::{self, ThreadRole};

/// Where the hand is.
#[derive(Debug, Clone, PartialEq)]
pub enum InputConfig {
    /// The ISRA ball at a port.
    Ball(PortConfig),
    /// The keys of the operator's terminal.
    Keyboard,
    /// A 3Dconnexion device, through the socket of spacenavd.
    Spacenav(PathBuf),
    /// A 3Dconnexion device by its own reports: the only one, or that whose name or path has this in it.
    Hid(String),
    /// A game pad, a joystick or a 3D mouse: a device of the Linux input system.
    Evdev(PathBuf),
    /// A recording of an earlier input, in this file.
    Play(PathBuf),
}

impl InputConfig {
    /// Returns the kind and the port or path of the input, for the operator.
    pub fn name(&self) -> String {
        match self {
            Self::Ball(port) => format!("ball: {} at {} baud", port.path, port.baud),
            Self::Keyboard => "input: the keyboard".into(),
            Self::Spacenav(path) => format!("input: spacenavd at {}", path.display()),
            Self::Hid(name) if name.is_empty() => "input: 3D mouse".into(),
            Self::Hid(name) => format!("input: 3D mouse {name}"),
            Self::Evdev(path) => format!("input: {}", path.display()),
            Self::Play(path) => format!("input: recording {}", path.display()),
        }
    }
}

/// An input that is driven by a thread.
pub(super) struct InputThread {
    input: Box<dyn Input>,
    context: Context,
    orders: Sender<Order>,
    recorder: Option<Recorder>,
    /// The sender of the operator's keys that move the arm.
    pub(super) jog: Option<Sender<Jog>>,
}

impl InputThread {
    /// Opens the input; `record` is the file that keeps its values.
    pub(super) fn open(
        config: &InputConfig,
        polls: isra_ball::HostConfig,
        record: Option<&PathBuf>,
        context: Context,
        orders: Sender<Order>,
        probe: Receiver<()>,
    ) -> Result<Self> {
        let mut jog = None;
        let input: Box<dyn Input> = match config {
            InputConfig::Ball(port) => Box::new(ball::Ball::open(port, polls, context.clone(), probe)?),
            InputConfig::Keyboard => {
                let (sender, keys) = channel();
                jog = Some(sender);
                Box::new(keyboard::Keyboard::new(context.clock, keys))
            }
            InputConfig::Spacenav(path) => Box::new(spacenav::Spacenav::open(path, context.clone())?),
            InputConfig::Hid(name) => Box::new(hid::Hid::open(name, context.clone())?),
            InputConfig::Evdev(path) => Box::new(evdev::Evdev::open(path, context.clone())?),
            InputConfig::Play(path) => Box::new(recording::Playback::open(path, context.clone())?),
        };
        let recorder = record.map(|path| Recorder::create(path, context.clock)).transpose()?;
        Ok(Self { input, context, orders, recorder, jog })
    }

    pub(super) fn run(mut self) {
        /// The stop is looked at this often.
        const IDLE: Duration = Duration::from_millis(20);
        priority::raise(ThreadRole::Poll);
        let mut events = Vec::new();
        while !self.context.is_stopped() {
            self.input.poll(IDLE, &mut events);
            for event in events.drain(..) {
                if let (Some(recorder), true) = (&mut self.recorder, self.context.runs()) {
                    recorder.add(event);
                }
                let order = match event {
                    InputEvent::Sample(sample) => {
                        self.context.notify(Notification::Hand(sample));
                        Order::Hand(sample)
                    }
                    InputEvent::Old => Order::HandOld,
                    InputEvent::Lost => Order::HandLost,
                };
                // A robot thread that is gone has reported why.
                let _ = self.orders.send(order);
            }
        }
        self.input.end();
        if let Some(Err(error)) = self.recorder.map(Recorder::finish) {
            self.context.notify(Notification::PortLost("recording", format!("{error:#}")));
        }
    }
}
