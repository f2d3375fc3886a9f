//! Both ends on a simulated line, and the motion task at the other end of the queue, on a virtual clock.

use core::time::Duration;

use laser_eb90::{
    Class, Controller, ControllerConfig, ControllerEvent, Host, HostConfig, HostEvent, Item, Profile,
    SessionError,
};
use robot_session::Session as _;
use robot_work_queue::Reader;
use testkit::link::{Delivery, End, Faults, Link};

pub use crate::laser_eb90::common::{CUT, Cut, MS, STOP, WHERE, cut, write_cut};

/// A hundred cycles of the controller.
pub const START: Duration = Duration::from_millis(1600);

/// Returns a controller that was connected at 0.
pub fn controller(profile: Profile) -> (Controller<'static, Cut>, Reader<'static, Cut>) {
    let (writer, reader) = robot_work_queue::boxed(21, 9999).unwrap();
    let config = ControllerConfig { profile, ..ControllerConfig::default() };
    let mut controller = Controller::new(config, writer).unwrap();
    controller.handle_connected(Duration::ZERO);
    (controller, reader)
}

/// Our controller drops the beginning of a frame when it answers an error code, and nobody has used the line before: a
/// connection may be used at once.
pub const KNOWN: fn() -> HostConfig = || HostConfig {
    controller_drops_partial: true,
    longest_frame: 0,
    max_pause: Duration::ZERO,
    ..HostConfig::default()
};

/// The two ends on a line, the motion task after the controller, and the executed instructions.
pub struct Cell {
    pub now: Duration,
    pub link: Link,
    pub host: Host,
    pub controller: Controller<'static, Cut>,
    pub reader: Reader<'static, Cut>,
    /// The motion task executes nothing while it is set.
    pub halted: bool,
    pub executed: Vec<Cut>,
    /// Outcomes.
    pub events: Vec<HostEvent>,
    /// The answer to the last query.
    pub answer: Vec<f32>,
    pub frames_sent: usize,
}

impl Cell {
    /// Ends that were connected at 0.
    pub fn new(seed: u64, faults: Faults, config: HostConfig) -> Self {
        let (controller, reader) = controller(config.profile);
        let mut host = Host::new(config).unwrap();
        host.handle_connected(Duration::ZERO);
        Self {
            now: Duration::ZERO,
            link: Link::new(seed, faults),
            host,
            controller,
            reader,
            halted: false,
            executed: Vec::new(),
            events: Vec::new(),
            answer: Vec::new(),
            frames_sent: 0,
        }
    }

    /// Creates a clean line. The host may send at [`START`].
    pub fn clean() -> Self {
        Self::configured(KNOWN())
    }

    pub fn configured(config: HostConfig) -> Self {
        let faults = Faults { latency: Duration::ZERO, ..Faults::NONE }.at_baud(9600);
        let mut cell = Self::new(1, faults, config);
        cell.run_until(START);
        cell
    }

    pub fn submit(&mut self, index: u32) -> Result<u64, SessionError> {
        self.host.submit(CUT, |payload| write_cut(payload, cut(index)))
    }

    /// Does once everything that can happen now.
    pub fn step(&mut self) {
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(End::A, self.now) {
            self.host.handle_input(self.now, &bytes);
        }
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(End::B, self.now) {
            self.controller.handle_input(self.now, &bytes);
        }
        self.host.handle_timeout(self.now);
        self.controller.handle_timeout(self.now);
        while let Some(event) = self.host.poll_event() {
            match event {
                HostEvent::Corrupt(_) | HostEvent::Unasked { .. } => continue,
                HostEvent::Answer { .. } => {
                    let floats = self.host.answer().flat_map(|item| match item.unwrap() {
                        Item::F32(values) => values.iter().collect::<Vec<_>>(),
                        other => panic!("{other:?}"),
                    });
                    self.answer = floats.collect();
                }
                _ => {}
            }
            self.events.push(event);
        }
        while let Some(event) = self.controller.poll_event() {
            if let ControllerEvent::Execute { class, .. } = event {
                let found = self.controller.instruction().unwrap().parameters.check();
                assert_eq!(found, Ok(()));
                self.controller
                    .answer(self.now, |payload| match class {
                        Class::Query => payload.f32(&[1.5, -2.5]).map(drop),
                        _ => Ok(()),
                    })
                    .unwrap();
            }
        }
        while !self.halted
            && let Some(job) = self.reader.take()
        {
            self.executed.push(job.complete());
        }
        let mut out = [0; Host::MAX_TRANSMIT];
        while let Some(n) = self.host.poll_transmit(self.now, &mut out) {
            self.frames_sent += 1;
            self.link.send(End::A, self.now, &out[..n]);
        }
        while let Some(n) = self.controller.poll_transmit(self.now, &mut out) {
            self.link.send(End::B, self.now, &out[..n]);
        }
    }

    pub fn run_until(&mut self, end: Duration) {
        loop {
            self.step();
            let next = [self.host.poll_timeout(), self.controller.poll_timeout(), self.link.next_delivery()];
            let next = next.into_iter().flatten().min().unwrap_or(end);
            if next >= end {
                self.now = end;
                return self.step();
            }
            self.now = next.max(self.now + Duration::from_micros(100));
        }
    }

    pub fn run_for(&mut self, time: Duration) {
        self.run_until(self.now + time);
    }
}
