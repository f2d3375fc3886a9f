//! The thread that polls the ball.

use std::sync::mpsc::{Receiver, Sender};
use std::time::Duration;

use anyhow::Result;
use isra_ball::{Config, Decoder, ENQ, Host, HostEvent, timing};

use super::port::Port;
use super::{Context, Order, TeleopConfig, Told};
use crate::priority::{self, Rank};

pub(super) struct Ball {
    context: Context,
    port: Port,
    host: Host,
    orders: Sender<Order>,
    probe: Receiver<()>,
    polls: Config,
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
        Ok(Self { context, port, host, orders, probe, polls, asked: Duration::ZERO })
    }

    pub(super) fn run(mut self) {
        priority::raise(Rank::Poll);
        while !self.context.is_stopped() {
            if self.probe.try_recv().is_ok() {
                self.probe();
            }
            self.poll();
            self.read();
            self.collect();
            self.port.trace(&self.context);
        }
        self.context.end_trace("the host ends");
    }

    fn poll(&mut self) {
        let mut out = [0; 4];
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
                    self.order(Order::Ball(packet));
                    self.context.tell(Told::Ball(packet, now - self.asked));
                }
                HostEvent::Stale => {
                    self.order(Order::BallStale);
                    self.context.tell(Told::BallStale);
                }
                HostEvent::Missed => self.context.tell(Told::BallMissed),
                HostEvent::Error(error) => self.context.tell(Told::BallDamaged(error)),
                // Older than what the next poll brings.
                HostEvent::Unasked(_) => self.context.tell(Told::BallLate),
                _ => {}
            }
        }
    }

    fn read(&mut self) {
        let due = self.host.poll_timeout().unwrap_or_default().saturating_sub(self.context.clock.now());
        let mut buffer = [0; 64];
        let (now, bytes) = self.port.read(&self.context, due, &mut buffer);
        self.host.handle_input(now, bytes);
    }

    /// Polls ten times at each rate. The robot thread comes to rest meanwhile: it gets no new values.
    fn probe(&mut self) {
        self.order(Order::BallStale);
        for baud in [4800, 9600, 19_200] {
            let period = self.polls.period.max(timing::min_period(baud));
            let (mut good, mut damaged) = (0, 0);
            for _ in 0..10 {
                let Some(heard) = self.port.listen(baud, &[ENQ], period) else { break };
                let mut decoder = Decoder::new();
                let mut rest = heard.as_slice();
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
