//! Both ends on a line with the transmission times of its baud rate, on a virtual clock.
#![allow(dead_code, unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use testkit::link::{Delivery, End as Side, Faults, Link};
use val2_alter::{
    Controller, ControllerConfig, ControllerEvent, ControllerState, Frame, Host, HostConfig, HostEvent,
    HostState, Limits, Motion, timing,
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
    /// When the controller sent each of its messages.
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
            host: Host::new(host),
            controller: Controller::new(controller),
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
        let mut out = [0; Frame::MAX_LEN];
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(Side::A, self.now) {
            self.controller.handle_input(self.now, &bytes);
        }
        self.controller.handle_timeout(self.now);
        while let Some(event) = self.controller.poll_event() {
            if let ControllerEvent::Reply(_) = event {
                self.applied.push(self.controller.values());
            }
            self.controller_events.push(event);
        }
        while let Some(len) = self.controller.poll_transmit(self.now, &mut out) {
            self.sent.push((self.now, out[..len].to_vec()));
            self.link.send(Side::A, self.now, &out[..len]);
        }
        while let Some(event) = self.controller.poll_event() {
            self.controller_events.push(event);
        }
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(Side::B, self.now) {
            if self.host_is_alive {
                self.host.handle_input(self.now, &bytes);
            }
        }
        if self.host_is_alive {
            self.host.handle_timeout(self.now);
            while let Some(event) = self.host.poll_event() {
                self.host_events.push(event);
            }
            while let Some(len) = self.host.poll_transmit(self.now, &mut out) {
                self.link.send(Side::B, self.now, &out[..len]);
            }
            while let Some(event) = self.host.poll_event() {
                self.host_events.push(event);
            }
        }
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
    (HostConfig { limits: Limits::NONE, ..HostConfig::default() }, ControllerConfig::default())
}

pub fn x(value: i16) -> [i16; 6] {
    [value, 0, 0, 0, 0, 0]
}

/// A controller in its first cycle, at 28 ms, whose message has just left.
pub fn in_first_cycle(config: ControllerConfig) -> Controller {
    let mut controller = Controller::new(config);
    let mut out = [0; Frame::MAX_LEN];
    controller.start(Duration::ZERO).unwrap();
    controller.poll_transmit(Duration::ZERO, &mut out).unwrap();
    controller.handle_input(5 * MS, b"\x10\x10\x02\x00\x10\x03\x00");
    assert_eq!(controller.poll_event(), Some(ControllerEvent::Started));
    controller.poll_transmit(CYCLE, &mut out).unwrap();
    controller
}
