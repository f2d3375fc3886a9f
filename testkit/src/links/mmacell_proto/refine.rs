//! The sessions over bytes do what the machines do: every path of the model is walked by both.

use core::time::Duration;

use mmacell_proto::central::machine::CentralLink;
use mmacell_proto::{
    Central, CentralEvent, Command, Device, DeviceEvent, ErrorCode, Mode, Order, Reply, Unfinished,
};
use robot_session::Session as _;
use robot_session::end::{End as _, Machine as _};

use super::world::{Act, BETWEEN, HOME, Outcome, Pose, Setup, TICK, World, target};
use crate::model::{self, Refined, age};

/// Walks every state and every transition of a system with real sessions.
///
/// # Panics
/// Where a session differs from its machine.
pub(super) fn refine(setup: &Setup) -> Refined {
    model::refine(setup, || Sessions::new(setup), Sessions::walk, Sessions::compare)
}

struct Sessions<'a> {
    setup: &'a Setup,
    now: Duration,
    central: Central<Pose>,
    device: Device<Pose>,
    /// The bytes on their way.
    down: Vec<u8>,
    up: Vec<u8>,
    /// The orders that the device has reported and that are not answered.
    asked: Vec<Order<Pose>>,
    /// What was reported of each job.
    outcomes: [Option<Outcome>; 2],
    /// The job that was requested last.
    job: u8,
}

impl<'a> Sessions<'a> {
    fn new(setup: &'a Setup) -> Self {
        Self {
            setup,
            now: Duration::from_secs(1),
            central: central(setup),
            device: device(setup, HOME),
            down: Vec::new(),
            up: Vec::new(),
            asked: Vec::new(),
            outcomes: [None; 2],
            job: 0,
        }
    }

    fn walk(&mut self, act: Act, before: &World, after: &World, walk: &[Act]) {
        let now = self.now;
        match act {
            Act::Connect => {
                self.device.handle_connected(now);
                self.central.handle_connected(now);
            }
            Act::Move => {
                self.job = before.next;
                let command = Command::Move { mode: Mode::Absolute, pose: target(before.next) };
                assert_eq!(self.central.request(command), Ok(()), "{walk:?}");
            }
            Act::Request(command) => assert_eq!(self.central.request(command), Ok(()), "{walk:?}"),
            Act::Abort => self.central.abort(now),
            Act::Transmit => self.transmit(before, walk),
            Act::Deliver => {
                // However the bytes are cut, and with the next command not there yet.
                let bytes = core::mem::take(&mut self.down);
                let (head, tail) = bytes.split_at(walk.len() % bytes.len());
                self.device.handle_input(now, head);
                self.device.handle_input(now, tail);
            }
            Act::Accept => self.accept(before),
            Act::Reply | Act::LateReply | Act::ServoOffReply | Act::RepeatReply => {
                self.reply(before, after, walk);
            }
            Act::Return => {
                let bytes = core::mem::take(&mut self.up);
                let (head, tail) = bytes.split_at(walk.len() % bytes.len());
                self.central.handle_input(now, head);
                self.central.handle_input(now, tail);
            }
            Act::Due => self.central.handle_timeout(now),
            Act::Tick => self.now += TICK,
            Act::Arrive => self.rest(before.going.expect("the axes are going somewhere")),
            Act::Stall => self.rest(BETWEEN),
            Act::Refuse(error) => {
                let order = self.asked.remove(0);
                let expected = after.device != before.device;
                assert_eq!(self.device.refuse(order, error).is_ok(), expected, "{walk:?}");
            }
            Act::Fail => self.device.fail(ErrorCode::Servo1),
            Act::Garble => {
                self.hang_up();
                self.central.handle_input(now, b"Ok\r\n");
            }
            Act::Misread => {
                self.down.clear();
                self.device.handle_input(now, b"XYZ\r\n");
            }
            Act::Usurp => {
                self.hang_up();
                self.device.handle_connected(now);
            }
            Act::Cut => self.hang_up(),
            Act::Break => {
                self.hang_up();
                self.device.handle_disconnected(now);
                self.central.handle_disconnected(now);
            }
            Act::RestartDevice => {
                self.hang_up();
                self.asked.clear();
                self.device = device(self.setup, before.at);
            }
            Act::RestartCentral => {
                self.hang_up();
                self.central = central(self.setup);
                if before.pending.is_some() {
                    self.outcomes[usize::from(self.job)] = Some(Outcome::Unknown);
                }
            }
        }
        if act == Act::Connect {
            self.hang_up();
        }
        self.drain(walk);
    }

    fn hang_up(&mut self) {
        self.down.clear();
        self.up.clear();
    }

    fn transmit(&mut self, before: &World, walk: &[Act]) {
        let CentralLink::Sending { command } = before.central.link else { panic!("{walk:?}") };
        let mut out = [0; 64];
        let length = self.central.poll_transmit(self.now, &mut out).expect("a command is to be sent");
        assert_eq!(out[..length], bytes(&command), "{walk:?}");
        self.down = if before.cut { Vec::new() } else { out[..length].to_vec() };
    }

    fn reply(&mut self, before: &World, after: &World, walk: &[Act]) {
        let reply: Reply<Pose> = before.pending_reply().expect("a reply is to be sent");
        let mut out = [0; 64];
        let length = self.device.poll_transmit(self.now, &mut out).expect("a reply is to be sent");
        assert_eq!(out[..length], bytes(&reply), "{walk:?}");
        // What a device sends that is not ours may differ.
        self.up = after.up.iter().chain(&after.again).flat_map(bytes).collect();
    }

    fn accept(&mut self, before: &World) {
        let order = self.asked.remove(0);
        if self.device.accept(order).is_err() {
            return;
        }
        if matches!(order, Order::Stop | Order::Servo { on: false }) && before.going.is_some() {
            self.rest(BETWEEN);
        }
    }

    fn rest(&mut self, at: Pose) {
        self.device.set_pose(at);
        self.device.arrived();
    }

    fn drain(&mut self, walk: &[Act]) {
        while let Some(event) = self.device.poll_event() {
            match event {
                DeviceEvent::Asked { order } => self.asked.push(order),
                DeviceEvent::Unexpected(unexpected) => panic!("{unexpected}: {walk:?}"),
                _ => {}
            }
        }
        while let Some(event) = self.central.poll_event() {
            let outcome = match event {
                CentralEvent::Done { command: Command::Move { .. } } => Outcome::Done,
                CentralEvent::Refused { command: Command::Move { .. }, .. }
                | CentralEvent::Aborted { command: Command::Move { .. } }
                | CentralEvent::Closed { unfinished: Unfinished::NotSent(Command::Move { .. }), .. } => {
                    Outcome::NotDone
                }
                CentralEvent::Closed { unfinished: Unfinished::Unknown(Command::Move { .. }), .. } => {
                    Outcome::Unknown
                }
                CentralEvent::Unexpected(unexpected) => panic!("{unexpected}: {walk:?}"),
                _ => continue,
            };
            let before = self.outcomes[usize::from(self.job)].replace(outcome);
            assert_eq!(before, None, "one outcome for each job: {walk:?}");
        }
    }

    /// The sessions' machines are the model's, and what is reported and sent is what the model has.
    fn compare(&mut self, world: &World, walk: &[Act]) {
        let (now, mut central) = (self.now, *self.central.machine());
        age(&mut central, now);
        assert_eq!(central, world.central, "{walk:?}");
        assert_eq!(*self.device.machine(), world.device, "{walk:?}");
        assert_eq!(self.central.is_idle(), world.central.link == CentralLink::Idle, "{walk:?}");
        assert!(self.asked.iter().eq(world.owner.iter().flatten()), "{:?}: {walk:?}", self.asked);
        assert_eq!(self.outcomes, world.jobs.map(|job| job.outcome), "{walk:?}");
        assert_eq!((self.down.is_empty(), self.up.is_empty()), (world.down.is_none(), world.up.is_none()));
        let due = self.central.poll_timeout().map(|at| at.saturating_sub(now));
        assert_eq!(due, world.central.deadline(), "{walk:?}");
        if !matches!(world.central.link, CentralLink::Sending { .. }) {
            assert_eq!(self.central.poll_transmit(now, &mut [0; 64]), None, "{walk:?}");
        }
        if world.pending_reply().is_none() {
            assert_eq!(self.device.poll_transmit(now, &mut [0; 64]), None, "{walk:?}");
        }
        assert_eq!((self.central.statistics().unexpected, self.device.statistics().unexpected), (0, 0));
    }
}

fn central(setup: &Setup) -> Central<Pose> {
    Central::new(setup.central).expect("a configuration that works")
}

fn device(setup: &Setup, at: Pose) -> Device<Pose> {
    let mut device = Device::new(setup.device).expect("a configuration that works");
    device.set_pose(at);
    device
}

fn bytes<M: robot_session::Encode>(message: &M) -> Vec<u8> {
    let mut out = vec![0; message.encoded_len()];
    let Ok(length) = message.encode(&mut out) else { panic!("every message of the model has a form") };
    out.truncate(length);
    out
}
