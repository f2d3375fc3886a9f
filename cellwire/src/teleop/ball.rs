//! The thread that polls the ball.

use std::io::{ErrorKind, Read, Write};
use std::sync::mpsc::Sender;
use std::thread;
use std::time::Duration;

use anyhow::Result;
use isra_ball::{Host, HostEvent};
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
    asked: Duration,
}

impl Ball {
    pub(super) fn open(config: &TeleopConfig, context: Context, orders: Sender<Order>) -> Result<Self> {
        let port = serial::open(&config.ball.path, config.ball.baud)?;
        context.tell(Told::PortOpen("ball", config.ball.path.clone()));
        let host = Host::new(config.polls)?;
        Ok(Self {
            context,
            config: config.ball.clone(),
            port: Some(port),
            host,
            orders,
            asked: Duration::ZERO,
        })
    }

    pub(super) fn run(mut self) {
        while !self.context.is_stopped() {
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
