//! Both ends on a line with the transmission times of its baud rate, on a virtual clock.
#![allow(unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use robot_session::Session as _;
use robot_session::end::End as _;
use testkit::link::{End as Side, Faults, Link};
use testkit::turn;
use val2_alter::{
    Accumulation, Controller, ControllerConfig, ControllerEvent, ControllerState, Frame, Host, HostConfig,
    HostEvent, HostState, Limits, Motion, timing,
};

pub const MS: Duration = Duration::from_millis(1);
pub const CYCLE: Duration = timing::CYCLE;

/// A controller and a host on one line.
pub struct Cell {
    pub link: Link,
    pub now: Duration,
    pub host: Host,
    pub controller: Controller,
    pub host_is_alive: bool,
    pub host_events: Vec<HostEvent>,
    pub controller_events: Vec<ControllerEvent>,
    /// The values that moved the arm, a row a reply.
    pub applied: Vec<[i16; 6]>,
    /// The messages of the controller, with their times.
    pub sent: Vec<(Duration, Vec<u8>)>,
}

impl Cell {
    pub fn new(host: HostConfig, controller: ControllerConfig) -> Self {
        Self::with_faults(host, controller, 1, Faults { latency: Duration::ZERO, ..Faults::NONE })
    }

    pub fn with_faults(host: HostConfig, controller: ControllerConfig, seed: u64, faults: Faults) -> Self {
        Self {
            link: Link::new(seed, faults.at_baud(controller.baud)),
            now: Duration::ZERO,
            host: connected(HostConfig { mode: controller.mode, ..host }),
            controller: self::controller(controller),
            host_is_alive: true,
            host_events: Vec::new(),
            controller_events: Vec::new(),
            applied: Vec::new(),
            sent: Vec::new(),
        }
    }

    pub fn start(&mut self) {
        self.controller.start(self.now).unwrap();
    }

    /// Runs both ends until `until`, and `each` before every reply.
    pub fn run(&mut self, until: Duration) {
        loop {
            self.step();
            let host = if self.host_is_alive { self.host.poll_timeout() } else { None };
            let next = [self.link.next_delivery(), host, self.controller.poll_timeout()];
            match next.into_iter().flatten().min() {
                Some(next) if next <= until => self.now = self.now.max(next),
                _ => break self.now = until,
            }
        }
        self.step();
    }

    pub fn cycles(&mut self, count: u32) {
        self.run(self.now + CYCLE * count);
    }

    fn step(&mut self) {
        let Self { link, now, host, controller, .. } = self;
        let (applied, sent, events) = (&mut self.applied, &mut self.sent, &mut self.controller_events);
        let mut recorder = Recorder { link, sent };
        turn(&mut recorder, Side::A, controller, *now, |_, event| {
            if let ControllerEvent::Reply { values, .. } = event {
                applied.push(values);
            }
            events.push(event);
        });
        if self.host_is_alive {
            turn(link, Side::B, host, *now, |_, event| self.host_events.push(event));
        } else {
            while link.receive(Side::B, *now).is_some() {}
        }
    }

    /// Returns the arm's offset from the path: the sum of the values, or in non-cumulative ALTER the last values.
    pub fn offset(&self) -> [i32; 6] {
        let mut offset = [0; 6];
        for (axis, offset) in offset.iter_mut().enumerate() {
            let mut values = self.applied.iter().map(|values| i32::from(values[axis]));
            *offset = match self.controller.config().mode.accumulation() {
                Accumulation::Cumulative => values.sum(),
                Accumulation::NonCumulative => values.next_back().unwrap_or_default(),
            };
        }
        offset
    }

    pub fn last_motion(&self) -> Motion {
        let motion = |event: &HostEvent| match event {
            HostEvent::Motion(motion) => Some(*motion),
            _ => None,
        };
        self.host_events.iter().rev().find_map(motion).unwrap()
    }
}

pub fn running(host: HostConfig, controller: ControllerConfig) -> Cell {
    let mut cell = Cell::new(host, controller);
    cell.start();
    cell.cycles(2);
    assert_eq!((cell.host.state(), cell.controller.state()), (HostState::Running, ControllerState::Running));
    cell
}

pub fn plain() -> (HostConfig, ControllerConfig) {
    let host = HostConfig { limits: Limits::NONE, target_timeout: Duration::MAX, ..HostConfig::default() };
    (host, ControllerConfig::default())
}

/// Returns a host on an open port.
pub fn connected(config: HostConfig) -> Host {
    let mut host = Host::new(config).unwrap();
    host.handle_connected(Duration::ZERO);
    host
}

/// Returns a controller on an open port.
pub fn controller(config: ControllerConfig) -> Controller {
    let mut controller = Controller::new(config).unwrap();
    controller.handle_connected(Duration::ZERO);
    controller
}

pub fn x(value: i16) -> [i16; 6] {
    [value, 0, 0, 0, 0, 0]
}

/// Returns a controller in its first cycle, at 28 ms, whose message has just left.
pub fn in_first_cycle(config: ControllerConfig) -> Controller {
    let mut controller = self::controller(config);
    let mut out = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).unwrap();
    controller.poll_transmit(Duration::ZERO, &mut out).unwrap();
    controller.handle_input(5 * MS, b"\x10\x10\x02\x00\x10\x03\x00");
    assert_eq!(controller.poll_event(), Some(ControllerEvent::Started));
    controller.poll_transmit(CYCLE, &mut out).unwrap();
    controller
}

/// A link that records the controller's messages with their times.
struct Recorder<'a> {
    link: &'a mut Link,
    sent: &'a mut Vec<(Duration, Vec<u8>)>,
}

impl testkit::Carrier for Recorder<'_> {
    fn send(&mut self, from: Side, now: Duration, bytes: &[u8]) {
        self.sent.push((now, bytes.to_vec()));
        self.link.send(from, now, bytes);
    }

    fn receive(&mut self, at: Side, now: Duration, most: usize) -> Option<testkit::link::Delivery> {
        self.link.receive_part(at, now, most)
    }
}
