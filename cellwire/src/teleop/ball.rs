//! The thread that polls the ball.

use std::sync::mpsc::{Receiver, Sender};
use std::time::Duration;

use anyhow::Result;
use isra_ball::robot_session::{Decoder as _, Session as _};
use isra_ball::{Decoder, ENQ, Host, HostConfig, HostEvent, timing};

use super::port::Port;
use super::{Context, Order, TeleopConfig, Told};
use crate::priority::{self, Rank};

/// A port that is gone is looked at this often.
const IDLE: Duration = Duration::from_millis(20);

pub(super) struct Ball {
    context: Context,
    port: Port,
    host: Host,
    orders: Sender<Order>,
    probe: Receiver<()>,
    polls: HostConfig,
    is_connected: bool,
    asked: Duration,
}

impl Ball {
    pub(super) fn open(
        config: &TeleopConfig,
        context: Context,
        orders: Sender<Order>,
        probe: Receiver<()>,
    ) -> Result<Self> {
        let port = Port::open("ball", &config.ball, &context)?;
        let (host, polls) = (Host::new(config.polls)?, config.polls);
        Ok(Self { context, port, host, orders, probe, polls, is_connected: false, asked: Duration::ZERO })
    }

    pub(super) fn run(mut self) {
        priority::raise(Rank::Poll);
        while !self.context.is_stopped() {
            if self.probe.try_recv().is_ok() {
                self.probe();
            }
            self.follow_port();
            self.poll();
            self.read();
            self.collect();
            self.port.trace(&self.context);
        }
        self.context.end_trace("the host ends");
    }

    fn follow_port(&mut self) {
        if self.port.is_open() == self.is_connected {
            return;
        }
        self.is_connected = self.port.is_open();
        let now = self.context.clock.now();
        if self.is_connected { self.host.handle_connected(now) } else { self.host.handle_disconnected(now) }
    }

    fn poll(&mut self) {
        let mut out = [0; Host::MAX_TRANSMIT];
        loop {
            let now = self.context.clock.now();
            let Some(length) = self.host.poll_transmit(now, &mut out) else { return };
            if self.port.write(&self.context, out.get(..length).unwrap_or_default()).is_some() {
                self.asked = now;
            }
        }
    }

    fn collect(&mut self) {
        while let Some(event) = self.host.poll_event() {
            let now = self.context.clock.now();
            match event {
                HostEvent::Packet(packet) => {
                    self.order(Order::Ball(packet, self.host.live_until().unwrap_or(now)));
                    self.context.tell(Told::Ball(packet, now - self.asked));
                }
                HostEvent::Old(packet) => self.context.tell(Told::BallOld(packet, now - self.asked)),
                HostEvent::Stale => {
                    self.order(Order::BallStale);
                    self.context.tell(Told::BallStale);
                }
                HostEvent::Missed => self.context.tell(Told::BallMissed),
                HostEvent::Corrupt(error) => self.context.tell(Told::BallDamaged(error)),
                HostEvent::Unasked(_) => self.context.tell(Told::BallLate),
                _ => {}
            }
        }
    }

    fn read(&mut self) {
        let due = self.host.poll_timeout().map_or(IDLE, |due| due.saturating_sub(self.context.clock.now()));
        let mut buffer = [0; 64];
        let (now, bytes) = self.port.read(&self.context, due, &mut buffer);
        self.host.handle_input(now, bytes);
    }

    /// Polls ten times at each rate. The robot thread comes to rest meanwhile: the connection is as good as lost.
    fn probe(&mut self) {
        self.is_connected = false;
        self.host.handle_disconnected(self.context.clock.now());
        self.collect();
        for baud in [4800, 9600, 19_200] {
            let period = self.polls.period.max(timing::min_period(baud));
            let (mut good, mut damaged) = (0, 0);
            for _ in 0..10 {
                let Some(received) = self.port.listen(baud, &[ENQ], period) else { break };
                let mut decoder = Decoder::new();
                let mut rest = received.as_slice();
                while !rest.is_empty() {
                    let taken = decoder.push(rest);
                    rest = rest.get(taken..).unwrap_or_default();
                    if rest.is_empty() {
                        decoder.finish();
                    }
                    while let Some(outcome) = decoder.next_frame() {
                        *if outcome.is_ok() { &mut good } else { &mut damaged } += 1;
                    }
                }
            }
            self.context.tell(Told::Probed { port: "ball", baud, good, damaged });
        }
        self.port.end_listening(&self.context);
    }

    fn order(&self, order: Order) {
        // A robot thread that is gone has told why.
        let _ = self.orders.send(order);
    }
}
