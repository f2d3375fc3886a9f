//! The ISRA ball at its port.

use std::ops::ControlFlow;
use std::sync::mpsc::Receiver;
use std::time::Duration;

use anyhow::Result;
use isra_ball::{Decoder, ENQ, Host, HostConfig, HostEvent, Packet, timing};
use robot_session::{Decoder as _, Driver, EchoError, Session as _};

use super::device::{Input, InputEvent};
use crate::alter::context::Context;
use crate::alter::messages::Notification;
use crate::alter::port::{Port, PortConfig};
use crate::alter::sample::{FULL, Sample};
use cellwire_io::latency::Deadline;

pub(super) struct Ball {
    context: Context,
    driver: Driver<Port>,
    host: Host,
    probe: Receiver<()>,
    polls: HostConfig,
    is_connected: bool,
    /// Whether it was reported that the line returns the polls.
    has_told_echo: bool,
}

impl Ball {
    pub(super) fn open(
        port: &PortConfig,
        polls: HostConfig,
        context: Context,
        probe: Receiver<()>,
    ) -> Result<Self> {
        let driver = Driver::new(Port::open("ball", port, Some(Deadline::of_ball(&polls)), &context)?);
        let host = Host::new(polls)?;
        Ok(Self { context, driver, host, probe, polls, is_connected: false, has_told_echo: false })
    }

    fn collect(&mut self, events: Vec<HostEvent>, out: &mut Vec<InputEvent>) {
        let asked = self.driver.transport_mut().written_at;
        let returns = self.driver.transport_mut().returns();
        for event in events {
            // A known packet begins with another byte than a poll.
            let is_packet = matches!(event, HostEvent::Packet(_) | HostEvent::Old(_));
            if returns && is_packet && !self.polls.echo && !core::mem::replace(&mut self.has_told_echo, true)
            {
                self.context.notify(Notification::Echo("ball", EchoError::NotSet { length: 1 }));
            }
            let now = self.context.clock.now();
            match event {
                HostEvent::Packet(packet) => {
                    let fresh_until = self.host.live_until().unwrap_or(now);
                    out.push(InputEvent::Sample(sample(&packet, fresh_until)));
                    self.context.notify(Notification::Ball(packet, now - asked));
                }
                HostEvent::Old(packet) => self.context.notify(Notification::BallOld(packet, now - asked)),
                HostEvent::Stale => {
                    out.push(InputEvent::Old);
                    self.context.notify(Notification::BallStale);
                }
                HostEvent::Missed => self.context.notify(Notification::BallMissed),
                HostEvent::Corrupt(error) => self.context.notify(Notification::BallCorrupt(error)),
                HostEvent::Echo(error) => self.context.notify(Notification::Echo("ball", error)),
                HostEvent::Unasked(_) => self.context.notify(Notification::BallLate),
                _ => {}
            }
        }
    }

    /// Polls ten times at each rate. The robot thread comes to rest meanwhile: the connection is as good as lost.
    fn probe(&mut self, out: &mut Vec<InputEvent>) {
        self.is_connected = false;
        out.push(InputEvent::Lost);
        self.host.handle_disconnected(self.context.clock.now());
        let events = core::iter::from_fn(|| self.host.poll_event()).collect();
        self.collect(events, out);
        let port = self.driver.transport_mut();
        for baud in [4800, 9600, 19_200] {
            let period = self.polls.period.max(timing::min_period(baud));
            let (mut good, mut corrupt) = (0, 0);
            for _ in 0..10 {
                let Some(received) = port.listen(baud, &[ENQ], period) else { break };
                let mut decoder = Decoder::new();
                let mut rest = received.as_slice();
                while !rest.is_empty() {
                    let taken = decoder.push(rest);
                    rest = rest.get(taken..).unwrap_or_default();
                    if rest.is_empty() {
                        decoder.finish();
                    }
                    while let Some(outcome) = decoder.next_frame() {
                        *if outcome.is_ok() { &mut good } else { &mut corrupt } += 1;
                    }
                }
            }
            self.context.notify(Notification::Probed { port: "ball", baud, good, corrupt });
        }
        self.driver.transport_mut().end_listening();
    }
}

impl Input for Ball {
    fn poll(&mut self, wait: Duration, out: &mut Vec<InputEvent>) {
        if self.probe.try_recv().is_ok() {
            self.probe(out);
        }
        let was_connected = self.is_connected;
        self.driver.transport_mut().follow(&mut self.host, &mut self.is_connected);
        if was_connected && !self.is_connected {
            out.push(InputEvent::Lost);
        }
        let mut events = Vec::new();
        let turn = self.driver.turn(&mut self.host, Some(wait), |_, event| {
            events.push(event);
            ControlFlow::<()>::Continue(())
        });
        debug_assert!(turn.is_ok(), "a port has no errors: it is opened again");
        self.collect(events, out);
        self.driver.transport_mut().trace();
    }

    fn end(&mut self) {
        self.driver.transport_mut().trace_all();
        self.context.end_trace("the host ends");
    }
}

/// Creates a sample of a packet: 127 is the full deflection; -128 is a little more.
fn sample(packet: &Packet, fresh_until: Duration) -> Sample {
    let full = i16::from(i8::MAX);
    let axes = packet.axes().map(|force| {
        // At most 128 · 1000 / 127.
        i16::try_from(i32::from(force) * i32::from(FULL) / i32::from(full)).unwrap_or_default()
    });
    Sample { axes, buttons: packet.keys.0.into(), fresh_until }
}
