//! The thread that polls the ball.

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, Sender};
use std::thread;
use std::time::Duration;

use anyhow::Result;
use isra_ball::{Config, Decoder, ENQ, Host, HostEvent, timing};
use serialport::SerialPort;

use super::{Context, Order, PortConfig, TeleopConfig, Told};
use crate::serial;
use crate::trace::Way;

/// A port that is gone is tried again this often; the session goes on meanwhile, and becomes stale.
const REOPEN: Duration = Duration::from_millis(200);

pub(super) struct Ball {
    context: Context,
    config: PortConfig,
    port: Option<Box<dyn SerialPort>>,
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
        let port = serial::open(&config.ball.path, config.ball.baud)?;
        context.tell(Told::PortOpen("ball", config.ball.path.clone()));
        let host = Host::new(config.polls)?;
        let (config, polls) = (config.ball.clone(), config.polls);
        Ok(Self { context, config, port: Some(port), host, orders, probe, polls, asked: Duration::ZERO })
    }

    pub(super) fn run(mut self) {
        while !self.context.is_stopped() {
            if self.probe.try_recv().is_ok() {
                self.probe();
            }
            self.poll();
            self.collect();
            self.read();
            self.host.handle_timeout(self.context.clock.now());
        }
        self.context.end_trace("the host ends");
    }

    fn poll(&mut self) {
        let mut out = [0; 4];
        while let Some(length) = self.host.poll_transmit(self.context.clock.now(), &mut out) {
            let Some(port) = &mut self.port else { continue };
            let bytes = out.get(..length).unwrap_or_default();
            if let Err(e) = port.write_all(bytes) {
                return self.lose_port(&e);
            }
            self.asked = self.context.clock.now();
            self.context.trace.add(self.asked, Way::Sent, bytes);
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
                // Late, hence older than what the next poll brings.
                _ => {}
            }
        }
    }

    fn read(&mut self) {
        let Some(port) = &mut self.port else { return self.reopen() };
        let due = self.host.poll_timeout().unwrap_or_default().saturating_sub(self.context.clock.now());
        let mut buffer = [0; 64];
        let outcome = port
            .set_timeout(due.max(Duration::from_micros(50)))
            .map_err(std::io::Error::from)
            .and_then(|()| port.read(&mut buffer));
        match outcome {
            Ok(n) => {
                let bytes = buffer.get(..n).unwrap_or_default();
                let now = self.context.clock.now();
                self.context.trace.add(now, Way::Received, bytes);
                self.host.handle_input(now, bytes);
            }
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
            Err(e) => self.lose_port(&e),
        }
    }

    /// Polls ten times at each rate. The robot thread comes to rest meanwhile: it gets no new values.
    fn probe(&mut self) {
        self.order(Order::BallStale);
        let Some(port) = &mut self.port else { return };
        for baud in [4800, 9600, 19_200] {
            let period = self.polls.period.max(timing::min_period(baud));
            let (mut good, mut damaged) = (0, 0);
            let mut decoder = Decoder::new();
            for _ in 0..10 {
                let asked = port.set_baud_rate(baud).is_ok() && port.write_all(&[ENQ]).is_ok();
                let heard = serial::listen(port.as_mut(), baud, period, &mut |bytes| {
                    decoder.push(bytes);
                });
                if !asked || heard.is_err() {
                    break;
                }
                decoder.finish();
                while let Some(outcome) = decoder.next_frame() {
                    *if outcome.is_ok() { &mut good } else { &mut damaged } += 1;
                }
            }
            self.context.tell(Told::Probed { port: "ball", baud, good, damaged });
        }
        if let Err(e) = port.set_baud_rate(self.config.baud) {
            self.lose_port(&e.into());
        }
    }

    fn order(&self, order: Order) {
        // A robot thread that is gone has told why.
        let _ = self.orders.send(order);
    }

    fn lose_port(&mut self, error: &std::io::Error) {
        self.port = None;
        self.context.tell(Told::PortLost("ball", error.to_string()));
    }

    fn reopen(&mut self) {
        thread::sleep(REOPEN);
        if let Ok(port) = serial::open(&self.config.path, self.config.baud) {
            self.port = Some(port);
            self.context.tell(Told::PortOpen("ball", self.config.path.clone()));
        }
    }
}
