//! The thread that answers the robot controller.

use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, Sender};
use std::thread;
use std::time::Duration;

use anyhow::Result;
use isra_ball::Packet;
use robot_session::{Decoder as _, Driver, Session as _};
use val2_alter::{AXES, Decoder, Framing, Host, HostEvent, HostState, RobotMessage, Transform};

use super::gripper::GripperKeys;
use super::port::Port;
use super::{Context, Mapping, Notification, Order, TeleopConfig};
use crate::io::priority::{self, Rank};

/// Orders are looked at this often while the robot is silent.
const IDLE: Duration = Duration::from_millis(20);
/// The port test listens so long at each rate.
const LISTEN: Duration = Duration::from_millis(1200);

pub(super) struct Robot {
    context: Context,
    driver: Driver<Port>,
    host: Host,
    mapping: Mapping,
    gripper: GripperKeys,
    packet: Option<Packet>,
    /// Until when the packet's values may be used: the ball's thread may be late itself.
    packet_until: Duration,
    orders: Receiver<Order>,
    poses: Sender<Transform>,
    /// To be reported after the reply has left.
    later: Vec<Notification>,
    state: HostState,
}

impl Robot {
    pub(super) fn open(
        config: &TeleopConfig,
        context: Context,
        orders: Receiver<Order>,
        poses: Sender<Transform>,
    ) -> Result<Self> {
        Ok(Self {
            driver: Driver::new(Port::open("robot", &config.robot, &context)?),
            context,
            host: Host::new(config.alter)?,
            mapping: config.mapping,
            gripper: GripperKeys::default(),
            packet: None,
            packet_until: Duration::ZERO,
            orders,
            poses,
            later: Vec::with_capacity(32),
            state: HostState::Idle,
        })
    }

    pub(super) fn run(mut self) {
        self.context.notify(Notification::Priority(priority::raise(Rank::Reply)));
        while !self.context.is_stopped() {
            self.obey();
            self.follow_port();
            self.reply();
            self.driver.transport().trace();
            self.notify_later();
        }
        self.context.end_trace("the host ends");
    }

    /// The connection of the session is that of the port.
    fn follow_port(&mut self) {
        let now = self.context.clock.now();
        match (self.driver.transport().is_open(), self.host.state()) {
            (true, HostState::Disconnected) => self.host.handle_connected(now),
            (false, HostState::Disconnected) => {}
            (true, _) => {}
            (false, _) => self.host.handle_disconnected(now),
        }
    }

    fn obey(&mut self) {
        let now = self.context.clock.now();
        while let Ok(order) = self.orders.try_recv() {
            match order {
                Order::Ball(packet, until) => {
                    if let Some(exception) = self.gripper.keys(packet.keys.0) {
                        let outcome = self.host.exception(now, exception);
                        self.later.push(Notification::Gripper(exception, outcome));
                    }
                    (self.packet, self.packet_until) = (Some(packet), until);
                }
                Order::BallStale => self.packet = None,
                Order::Policy(policy) => self.host.set_policy(now, policy),
                Order::Stop => self.host.stop(now),
                Order::GripperKeys(on) => {
                    self.gripper.set_enabled(on);
                    self.host.set_subroutine(now, on);
                }
                Order::Probe => self.probe(),
                Order::Stall(time) => thread::sleep(time),
            }
        }
        self.packet = self.packet.filter(|_| self.context.clock.now() < self.packet_until);
    }

    /// Replies if the session is to, and then waits for the next message.
    fn reply(&mut self) {
        let mode = self.host.config().mode;
        let now = self.context.clock.now();
        // Without new values from the ball the arm comes to rest.
        let demand = self.packet.map(|packet| self.mapping.target(&packet, mode));
        match demand {
            Some(demand) => self.host.set_target(now, demand),
            None => self.host.clear_target(now),
        }
        let (read_at, replies) = (self.driver.transport().read_at, self.host.statistics().replies);
        self.turn(Duration::ZERO);
        if self.host.statistics().replies > replies {
            let thinking = self.driver.transport().written_at.saturating_sub(read_at);
            let (demand, values) = (demand.unwrap_or([0; AXES]), self.host.values());
            self.later.push(Notification::Reply { demand, values, thinking });
            self.notify_later();
        }
        if self.driver.transport().read_at == read_at {
            self.turn(IDLE);
        }
    }

    /// One turn; its events are reported when the reply has left.
    fn turn(&mut self, wait: Duration) {
        let Self { driver, host, later, .. } = self;
        let turn = driver.turn(host, Some(wait), |_, event| {
            later.push(match event {
                HostEvent::Start(start) => Notification::Start(start),
                HostEvent::Motion(motion) => Notification::Motion(motion),
                HostEvent::End(end) => Notification::End(end),
                HostEvent::Corrupt(error) => Notification::Corrupt(error),
                HostEvent::Missed => Notification::Missed,
                HostEvent::Rejected(code) => Notification::Rejected(code),
                HostEvent::Stopped => Notification::Stopped,
                HostEvent::Exception(exception, outcome) => Notification::GripperOutcome(exception, outcome),
                HostEvent::Lost(reason) => Notification::Lost(reason),
                _ => return ControlFlow::<()>::Continue(()),
            });
            ControlFlow::Continue(())
        });
        debug_assert!(turn.is_ok(), "a port has no errors: it is opened again");
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
                Notification::Lost(reason) => ended = Some(super::lost_text(*reason).into()),
                _ => {}
            }
            self.context.notify(notification);
        }
        if self.state != self.host.state() {
            self.state = self.host.state();
            self.context.notify(Notification::State(self.state));
        }
        if let Some(why) = ended {
            self.context.end_trace_aside(why);
        }
    }

    /// Listens for the controller's messages at each rate. It starts its program about once a second.
    fn probe(&mut self) {
        if self.host.state() != HostState::Idle {
            return self.later.push(Notification::ProbeRefused);
        }
        for baud in [9600, 19_200, 38_400] {
            let Some(received) = self.driver.transport().listen(baud, &[], LISTEN) else { continue };
            let mut decoder = Decoder::<RobotMessage>::new(Framing::DEFAULT);
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
        self.driver.transport().end_listening();
    }
}
