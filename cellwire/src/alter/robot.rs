//! The thread that answers the robot controller.

use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender};
use std::thread;
use std::time::Duration;

use anyhow::Result;
use cellwire_motion::latch::{Latch, LatchAction, LatchConfig, LatchInput};
use robot_session::end::{End as _, Machine as _};
use robot_session::{Decoder as _, Driver, EchoError, Session as _};
use val2_alter::{AXES, Decoder, Host, HostEvent, HostState, MotionPhase, RobotMessage, Transform};

use super::config::TeleopConfig;
use super::context::Context;
use super::gripper::GripperKeys;
use super::messages::{Notification, Order, lost_text};
use super::port::Port;
use super::profile::Profile;
use super::sample::Sample;
use crate::io::priority::{self, ThreadRole};
use cellwire_io::latency::Deadline;

/// Orders are looked at this often while the robot is silent.
const IDLE: Duration = Duration::from_millis(20);
/// The time for which the port test listens at each rate.
const LISTEN: Duration = Duration::from_millis(1200);

pub(super) struct Robot {
    context: Context,
    driver: Driver<Port>,
    host: Host,
    profile: Profile,
    gripper: GripperKeys,
    latch: Latch,
    latch_config: LatchConfig,
    /// The latest values of the hand: used while the latch lets them through.
    hand: Option<Sample>,
    orders: Receiver<Order>,
    poses: Sender<Transform>,
    /// To be reported after the reply has left.
    later: Vec<Notification>,
    state: HostState,
    /// Whether it was reported that the line returns the replies.
    has_told_echo: bool,
}

impl Robot {
    pub(super) fn open(
        config: &TeleopConfig,
        context: Context,
        orders: Receiver<Order>,
        poses: Sender<Transform>,
    ) -> Result<Self> {
        Ok(Self {
            driver: Driver::new(Port::open(
                "robot",
                &config.robot,
                Some(Deadline::of_alter(&config.alter)),
                &context,
            )?),
            context,
            host: Host::new(config.alter)?,
            profile: config.profile,
            gripper: GripperKeys::default(),
            latch: Latch::NEW,
            latch_config: config.latch,
            hand: None,
            orders,
            poses,
            later: Vec::with_capacity(32),
            state: HostState::Disconnected,
            has_told_echo: false,
        })
    }

    pub(super) fn run(mut self) {
        self.context.notify(Notification::Priority(priority::raise(ThreadRole::Reply)));
        while !self.context.is_stopped() && self.latch != Latch::Ended {
            self.obey();
            self.follow_port();
            self.reply();
            self.driver.transport_mut().trace();
            self.notify_later();
        }
        self.context.notify(Notification::Ended);
        self.driver.transport_mut().trace_all();
        self.context.end_trace("the host ends");
    }

    /// Connects or disconnects the session as the port is.
    fn follow_port(&mut self) {
        let now = self.context.clock.now();
        match (self.driver.transport_mut().is_open(), self.host.state()) {
            (true, HostState::Disconnected) => self.host.handle_connected(now),
            (false, HostState::Disconnected) => {}
            (true, _) => {}
            (false, _) => {
                self.host.handle_disconnected(now);
                self.latch_on(LatchInput::Disconnected);
            }
        }
    }

    fn obey(&mut self) {
        while let Ok(order) = self.orders.try_recv() {
            let now = self.context.clock.now();
            match order {
                Order::Hand(sample) => self.take(now, sample),
                Order::HandOld => self.latch_on(LatchInput::OldValues),
                Order::HandLost => self.latch_on(LatchInput::InputLost),
                Order::Confirm => self.latch_on(LatchInput::Confirm),
                Order::Profile(profile) => {
                    self.profile = *profile;
                    self.latch_on(LatchInput::Profile);
                }
                Order::Policy(policy) => self.host.set_policy(now, policy),
                Order::Stop => self.latch_on(LatchInput::Stop),
                Order::End => self.latch_on(LatchInput::End),
                Order::GripperKeys(on) => {
                    self.gripper.set_enabled(on);
                    self.host.set_subroutine(now, on);
                }
                Order::Probe => self.probe(),
                Order::Stall(time) => thread::sleep(time),
            }
        }
        if self.latch.expires(self.context.clock.now()) {
            self.latch_on(LatchInput::Timeout);
        }
    }

    fn take(&mut self, now: Duration, sample: Sample) {
        if let Some(exception) = self.gripper.keys(sample.buttons) {
            let outcome = self.host.exception(now, exception);
            self.later.push(Notification::Gripper(exception, outcome));
        }
        self.hand = Some(sample);
        self.latch_on(LatchInput::Hand {
            rests: self.profile.rests(&sample),
            holds: self.profile.holds(&sample),
            fresh_until: sample.fresh_until,
        });
    }

    fn latch_on(&mut self, input: LatchInput) {
        let now = self.context.clock.now();
        let action = self.latch.on(now, input, &self.latch_config);
        self.context.runs.store(self.latch.is_on(), Ordering::Relaxed);
        match action {
            LatchAction::Nothing => return,
            LatchAction::Report => {}
            LatchAction::Stop => self.host.stop(now),
        }
        self.later.push(Notification::Latch(self.latch));
    }

    /// Replies if the session is to, and then waits for the next message.
    fn reply(&mut self) {
        let mode = self.host.config().mode;
        let now = self.context.clock.now();
        let hand = self.latch.transmit(now, &self.latch_config).and(self.hand);
        let demand = hand.map(|hand| self.profile.target(&hand, mode));
        // Without a hand the arm comes to rest.
        match demand {
            Some(demand) => self.host.set_target(now, demand),
            None => self.host.clear_target(now),
        }
        let (read_at, before) = (self.driver.transport_mut().read_at, self.host.statistics());
        self.turn(Duration::ZERO);
        let after = self.host.statistics();
        if after.replies > before.replies {
            let thinking = self.driver.transport_mut().written_at.saturating_sub(read_at);
            let (demand, values) = (demand.unwrap_or([0; AXES]), self.host.values());
            let held = after.held > before.held;
            self.later.push(Notification::Reply { demand, values, thinking, held });
            self.notify_later();
        }
        if self.driver.transport_mut().read_at == read_at {
            let deadline = self.latch.deadline().map_or(IDLE, |at| at.saturating_sub(now));
            self.turn(IDLE.min(deadline));
        }
    }

    /// Runs one turn; its events are reported when the reply has left.
    fn turn(&mut self, wait: Duration) {
        let Self { driver, host, later, .. } = self;
        // Four inputs at most: one turn has a message, and the end of an earlier state.
        let mut inputs = Vec::with_capacity(4);
        let turn = driver.turn(host, Some(wait), |host, event| {
            later.push(match event {
                HostEvent::Start(start) => {
                    inputs.push(LatchInput::Connected);
                    Notification::Start(start)
                }
                HostEvent::Motion(motion) => {
                    let is_stopped = motion.segment_status.is_stop();
                    inputs.extend(match (host.state(), motion.phase) {
                        (HostState::Running, MotionPhase::Running) if is_stopped => Some(LatchInput::Halted),
                        (HostState::Running, MotionPhase::Running) => Some(LatchInput::Running),
                        (HostState::Interrupted, _) => Some(LatchInput::Interrupted),
                        _ => None,
                    });
                    Notification::Motion(motion)
                }
                HostEvent::End(end) => {
                    inputs.push(LatchInput::Disconnected);
                    Notification::End(end)
                }
                HostEvent::Corrupt(error) => Notification::Corrupt(error),
                HostEvent::Delayed => Notification::Delayed,
                HostEvent::Missed => Notification::Missed,
                HostEvent::Rejected(code) => Notification::Rejected(code),
                HostEvent::Stopped => {
                    inputs.push(LatchInput::Silent);
                    Notification::Stopped
                }
                HostEvent::Exception { exception, outcome } => {
                    Notification::GripperOutcome(exception, outcome)
                }
                HostEvent::Lost(reason) => {
                    inputs.push(LatchInput::Disconnected);
                    Notification::Lost(reason)
                }
                _ => return ControlFlow::<()>::Continue(()),
            });
            ControlFlow::Continue(())
        });
        debug_assert!(turn.is_ok(), "a port has no errors: it is opened again");
        if self.driver.transport_mut().returns() && !core::mem::replace(&mut self.has_told_echo, true) {
            self.later.push(Notification::Echo("robot", EchoError::NotSet { length: 1 }));
        }
        inputs.into_iter().for_each(|input| self.latch_on(input));
    }

    fn notify_later(&mut self) {
        let mut ended = None;
        for notification in self.later.drain(..) {
            match &notification {
                Notification::Motion(motion) => {
                    if let Some(transform) = motion.transform {
                        let _ = self.poses.send(transform);
                    }
                }
                Notification::End(end) => {
                    ended = Some(format!("ALTER ended with error {}", u8::from(end.error)))
                }
                Notification::Lost(reason) => ended = Some(lost_text(*reason).into()),
                _ => {}
            }
            self.context.notify(notification);
        }
        if self.state != self.host.state() {
            self.state = self.host.state();
            self.context.notify(Notification::State(self.state));
        }
        if let Some(why) = ended {
            self.context.end_trace_aside(&why);
        }
    }

    /// Listens for the controller's messages at each rate. It starts its program about once a second.
    fn probe(&mut self) {
        if self.host.state() != HostState::Idle {
            return self.later.push(Notification::ProbeRefused);
        }
        for baud in [9600, 19_200, 38_400] {
            let Some(received) = self.driver.transport_mut().listen(baud, &[], LISTEN) else { continue };
            let mut decoder = Decoder::<RobotMessage>::new(self.host.config().framing);
            let (mut good, mut corrupt) = (0, 0);
            let mut rest = received.as_slice();
            while !rest.is_empty() {
                let taken = decoder.push(rest);
                rest = rest.get(taken..).unwrap_or_default();
                while let Some(outcome) = decoder.next_frame() {
                    *if outcome.is_ok() { &mut good } else { &mut corrupt } += 1;
                }
            }
            self.later.push(Notification::Probed { port: "robot", baud, good, corrupt });
        }
        self.driver.transport_mut().end_listening();
    }
}
