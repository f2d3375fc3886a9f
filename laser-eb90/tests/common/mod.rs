//! Both ends on a simulated line, and the motion task behind the controller, on a virtual clock.
#![allow(dead_code, unreachable_pub, missing_debug_implementations, reason = "a helper of several tests")]

use core::time::Duration;

use laser_eb90::{
    Class, Controller, ControllerConfig, ControllerEvent, Doubt, EncodeError, Frame, Host, HostConfig,
    HostEvent, Instruction, Item, Payload, Profile, Refusal, SessionError,
};
use robot_work_queue::Reader;
use testkit::link::{Delivery, End, Faults, Link};

pub const MS: Duration = Duration::from_millis(1);
/// An interpreted, an immediate and a query instruction of the default words.
pub const CUT: u16 = 0x0101;
pub const STOP: u16 = 0x0201;
pub const WHERE: u16 = 0x0301;

/// A cut that knows which one it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    pub index: u32,
    pub x: f32,
}

impl TryFrom<Instruction<'_>> for Cut {
    type Error = ();

    fn try_from(instruction: Instruction<'_>) -> Result<Self, ()> {
        let mut items = instruction.parameters;
        match (instruction.word, items.next(), items.next(), items.next()) {
            (CUT, Some(Ok(Item::I16(index))), Some(Ok(Item::F32(x))), None) => {
                let [low, high] = index.array().ok_or(())?.map(i16::cast_unsigned);
                let [x] = x.array().ok_or(())?;
                Ok(Self { index: u32::from(high) << 16 | u32::from(low), x })
            }
            _ => Err(()),
        }
    }
}

pub fn cut(index: u32) -> Cut {
    Cut { index, x: index as f32 * 0.25 }
}

pub fn write_cut(payload: &mut Payload<'_>, cut: Cut) -> Result<(), EncodeError> {
    let index = [(cut.index & 0xFFFF) as i16, (cut.index >> 16) as i16];
    payload.i16(&index)?.f32(&[cut.x]).map(drop)
}

pub fn controller(
    config: ControllerConfig,
    capacity: usize,
) -> (Controller<'static, Cut>, Reader<'static, Cut>) {
    let (writer, reader) = robot_work_queue::boxed(capacity, 9999).unwrap();
    (Controller::new(config, writer), reader)
}

/// The two ends on a line, the motion task behind the controller, and what it has executed.
pub struct Cell {
    pub now: Duration,
    pub link: Link,
    pub host: Host,
    pub controller: Controller<'static, Cut>,
    pub reader: Reader<'static, Cut>,
    /// The motion task executes nothing while it is set.
    pub halted: bool,
    pub executed: Vec<Cut>,
    pub events: Vec<Event>,
    pub frames_sent: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    Done { first: u64, count: u8, resends: u8, unanswered: u8 },
    Answer { ticket: u64, values: Vec<f32> },
    Refused { first: u64, count: u8, refusal: Refusal },
    Unknown { first: u64, count: u8, cause: Doubt },
}

impl From<HostEvent<'_>> for Event {
    fn from(event: HostEvent<'_>) -> Self {
        match event {
            HostEvent::Done { first, count, resends, unanswered } => {
                Event::Done { first, count, resends, unanswered }
            }
            HostEvent::Answer { ticket, values } => {
                let values = values.flat_map(|item| match item.unwrap() {
                    Item::F32(values) => values.iter().collect::<Vec<_>>(),
                    other => panic!("{other:?}"),
                });
                Event::Answer { ticket, values: values.collect() }
            }
            HostEvent::Refused { first, count, refusal } => Event::Refused { first, count, refusal },
            HostEvent::Unknown { first, count, cause } => Event::Unknown { first, count, cause },
        }
    }
}

impl Cell {
    pub fn new(seed: u64, faults: Faults, host: HostConfig, config: ControllerConfig) -> Self {
        let (controller, reader) = controller(config, 21);
        Self {
            now: Duration::ZERO,
            link: Link::new(seed, faults),
            host: Host::new(host),
            controller,
            reader,
            halted: false,
            executed: Vec::new(),
            events: Vec::new(),
            frames_sent: 0,
        }
    }

    pub fn clean() -> Self {
        let faults = Faults { latency: Duration::ZERO, ..Faults::NONE }.at_baud(9600);
        Self::new(1, faults, HostConfig::default(), ControllerConfig::default())
    }

    pub fn submit(&mut self, index: u32) -> Result<u64, SessionError> {
        self.host.submit(CUT, |payload| write_cut(payload, cut(index)))
    }

    /// Everything that can happen now, once.
    pub fn step(&mut self) {
        let mut out = [0; Frame::MAX_LEN];
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(End::A, self.now) {
            self.host.handle_input(self.now, &bytes);
        }
        while let Some(Delivery::Bytes(bytes)) = self.link.receive(End::B, self.now) {
            self.controller.handle_input(self.now, &bytes);
        }
        self.host.handle_timeout(self.now);
        self.controller.handle_timeout(self.now);
        while let Some(event) = self.host.poll_event() {
            self.events.push(event.into());
        }
        while let Some(event) = self.controller.poll_event() {
            if let ControllerEvent::Execute { class, instruction } = event {
                let found = instruction.parameters.check();
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

/// A frame with one word.
pub fn echo(word: u16) -> Vec<u8> {
    let mut buffer = [0; 16];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    payload.word(word).unwrap();
    let mut out = Vec::new();
    payload.frame().unwrap().append_to(&mut out);
    out
}

/// A frame of cuts, and what else it is to hold.
pub fn frame(indices: &[u32], extra: impl FnOnce(&mut Payload<'_>)) -> Vec<u8> {
    let mut buffer = [0; 512];
    let mut payload = Payload::new(&mut buffer, &Profile::default());
    for index in indices {
        payload.word(CUT).unwrap();
        write_cut(&mut payload, cut(*index)).unwrap();
    }
    extra(&mut payload);
    let mut out = Vec::new();
    payload.frame().unwrap().append_to(&mut out);
    out
}
